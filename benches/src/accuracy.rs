//! How close adaptive beams come to what a beam of very many rays reports, beside 64 rays for every beam, and beside how
//! far two equally good patterns of 64 rays differ. Nothing is random but the pattern of the rays: no noise, no rounding,
//! and the data-sheet line of statistical receivers is their limit.

use crate::Result;
use crate::presets::lidars;
use crate::scenes::{Site, sites};
use echocast::detect::{Detection, Noise, RangePoint};
use echocast::{Cause, FieldSet, PointCloud, ReturnMode, ReturnsSpec, ScanOptions, Sensor, SubRays, Trajectory};
use serde_json::{Value, json};
use std::sync::Arc;

/// Rays per beam of the reference: as many as there may be.
const MANY: u32 = 1024;

/// Beams that are compared, about.
const COMPARED: usize = 20_000;

/// Returns closer together than this are the same, m.
const SAME_M: f32 = 0.05;
const CLOSE_M: f32 = 0.01;

/// Most by which a range counts as off, in standard deviations.
const FARTHEST_OFF: f64 = 10.0;

const HEAD: &str = "
Adaptive beams without noise against 1,024 rays a beam. Rays a beam; of beams with returns in either, the part with as
many of them (count); of the returns of beams with several, the part found within 5 cm (found); of first returns, the
part found within 1 cm (1cm); how far these are off, in sigmas of the range noise, at most 10, which a missing one counts
(off); by how much their intensities differ, in 1/255 of full scale, or in percent where there is none (int.);
Kolmogorov-Smirnov distances of ranges and intensities; total variation of the numbers of returns (TV); of beams with
mixed points, the part found to have them (mixed). 64 / 64: two patterns of 64 rays, one against the other.";

pub fn run() -> Result<Value> {
    println!("{HEAD}");
    let [sensor, scene, returns, rays] = ["sensor", "scene", "returns", "rays"];
    let columns = ["a beam", "count", "found", "1cm", "off", "int.", "KS range", "KS int.", "TV", "mixed"];
    println!("{}", line([sensor, scene, returns, rays], &columns.map(str::to_owned)));
    let sensors = lidars()?;
    let mut rows = Vec::new();
    for site in sites()? {
        let site = site?;
        for sensor in &sensors {
            let mut all = ReturnsSpec::default();
            (all.mode, all.max) = (ReturnMode::All, 3);
            for returns in [all, sensor.spec().returns] {
                rows.extend(compared(&site, sensor, returns)?);
            }
        }
    }
    Ok(json!(rows))
}

/// Rows of the table for one sensor that reports `returns`.
fn compared(site: &Site, sensor: &Sensor, returns: ReturnsSpec) -> Result<Vec<Value>> {
    // Odd, as adaptive beams in even and odd columns differ.
    let step = sensor.beams().len().div_ceil(COMPARED) | 1;
    let scanned = |sub_rays: SubRays, frame: u32| -> Result<Reported> {
        let mut exact = without_noise(sensor, sub_rays, returns)?;
        if sub_rays == SubRays::Count(MANY) {
            // Beams with other numbers see nothing, so that their rays cost little.
            let (beams, farthest) = (Arc::make_mut(&mut exact.beams), sensor.spec().range.max_m);
            let farthest = farthest.map_or(f32::INFINITY, |farthest| farthest as f32);
            beams.range_max =
                (0..beams.len()).map(|beam| if beam.is_multiple_of(step) { farthest } else { 0.0 }).collect();
        }
        let fields = FieldSet::parse("range,intensity,beam,cause")?;
        let options = ScanOptions::default().fields(fields).frame(frame);
        let mut cloud = PointCloud::default();
        site.built.scan_into(&exact, &Trajectory::fixed(site.pose), &options, &mut cloud)?;
        Ok(Reported::of(&cloud, sensor.beams().len(), step))
    };
    let reference = scanned(SubRays::Count(MANY), 0)?;
    let adaptive = scanned(SubRays::Adaptive, 0)?;
    let [pattern, other] = [scanned(SubRays::Count(64), 0)?, scanned(SubRays::Count(64), 1)?];
    let noise = &sensor.spec().noise;
    let mode = returns.mode.name();
    let cases = [("adaptive", &adaptive, &reference), ("64", &pattern, &reference), ("64 / 64", &other, &pattern)];
    Ok(Vec::from(
        cases.map(|(rays, ours, reference)| row([sensor.name(), site.name, mode, rays], ours, reference, noise)),
    ))
}

/// `sensor` as an instrument that measures exactly.
fn without_noise(sensor: &Sensor, sub_rays: SubRays, returns: ReturnsSpec) -> Result<Sensor> {
    let mut spec = sensor.spec().clone();
    (spec.beam.sub_rays, spec.returns) = (sub_rays, returns);
    spec.noise = Noise::default();
    spec.range.resolution_m = 0.0;
    if let Detection::Statistical(line) = spec.detection.model {
        spec.detection.model = Detection::RadarEquation { reflectance: line.reflectance, at_m: line.at_m };
    }
    Ok(Sensor::from_spec(spec)?)
}

/// A return.
#[derive(Clone, Copy)]
struct Point {
    range: f32,
    intensity: f32,
    is_mixed: bool,
}

/// What the compared beams report.
struct Reported {
    /// The returns of each, nearest first.
    beams: Vec<Vec<Point>>,
    rays_per_beam: f64,
    /// Full scale of intensities, if they have one.
    full_scale: Option<f32>,
}

impl Reported {
    /// Of every beam whose number is a multiple of `step`, of `count` in all.
    fn of(cloud: &PointCloud, count: usize, step: usize) -> Reported {
        let c = cloud.columns();
        let mut beams = vec![Vec::new(); count.div_ceil(step)];
        for row in 0..cloud.len() {
            let beam = c.beam()[row] as usize;
            if beam.is_multiple_of(step) {
                let is_mixed = c.cause()[row] == Cause::Mixed as u8;
                beams[beam / step].push(Point { range: c.range()[row], intensity: c.intensity()[row], is_mixed });
            }
        }
        beams.iter_mut().for_each(|points| points.sort_by(|a: &Point, b| a.range.total_cmp(&b.range)));
        Reported { beams, rays_per_beam: cloud.rays as f64 / count as f64, full_scale: cloud.intensity_full_scale }
    }

    /// All values of a quantity, ascending.
    fn sorted(&self, of: impl Fn(&Point) -> f32) -> Vec<f32> {
        let mut values: Vec<f32> = self.beams.iter().flatten().map(of).collect();
        values.sort_by(f32::total_cmp);
        values
    }
}

/// Compares, prints and returns what is compared.
fn row([sensor, scene, mode, rays]: [&str; 4], ours: &Reported, reference: &Reported, noise: &Noise) -> Value {
    let pairs = || ours.beams.iter().zip(&reference.beams);
    let count =
        mean(pairs().filter(|(a, b)| !(a.is_empty() && b.is_empty())).map(|(a, b)| a.len() == b.len()).map(f64::from));
    let several = mean(reference.beams.iter().map(|points| f64::from(points.len() > 1)));
    let found = mean(pairs().filter(|(_, b)| b.len() > 1).flat_map(|(a, b)| {
        b.iter().map(|point| f64::from(a.iter().any(|it| (it.range - point.range).abs() <= SAME_M)))
    }));
    let firsts = || pairs().map(|(a, b)| (a.first(), b.first())).filter(|(a, b)| a.is_some() || b.is_some());
    let apart = |a: &Point, b: &Point| (a.range - b.range).abs();
    let close = mean(
        firsts().filter_map(|(a, b)| Some((a, b?))).map(|(a, b)| f64::from(a.is_some_and(|a| apart(a, b) <= CLOSE_M))),
    );
    let off = mean(firsts().map(|pair| match pair {
        (Some(a), Some(b)) => (f64::from(apart(a, b)) / sigma(noise, b.range)).min(FARTHEST_OFF),
        _ => FARTHEST_OFF,
    }));
    let same = || firsts().filter_map(|(a, b)| a.zip(b)).filter(|(a, b)| apart(a, b) <= SAME_M);
    let (intensity, unit) = match reference.full_scale {
        Some(full) => (mean(same().map(|(a, b)| f64::from((a.intensity - b.intensity).abs() / full * 255.0))), ""),
        None => (mean(same().map(|(a, b)| f64::from((a.intensity / b.intensity - 1.0).abs() * 100.0))), "%"),
    };
    let smirnov = |of: fn(&Point) -> f32| kolmogorov_smirnov(&ours.sorted(of), &reference.sorted(of));
    let (ks_range, ks_intensity) = (smirnov(|point| point.range), smirnov(|point| point.intensity));
    let numbers = |reported: &Reported, number: usize| {
        mean(reported.beams.iter().map(|points| f64::from(points.len() == number)))
    };
    let variation = 0.5 * (0..4).map(|number| (numbers(ours, number) - numbers(reference, number)).abs()).sum::<f64>();
    let is_mixed = |points: &Vec<Point>| points.iter().any(|point| point.is_mixed);
    let mixed = mean(pairs().filter(|(_, b)| is_mixed(b)).map(|(a, _)| f64::from(is_mixed(a))));
    let rays_per_beam = ours.rays_per_beam;
    let mut columns = [
        (2, rays_per_beam),
        (4, count),
        (4, found),
        (4, close),
        (3, off),
        (2, intensity),
        (4, ks_range),
        (4, ks_intensity),
        (4, variation),
        (4, mixed),
    ]
    .map(|(digits, value): (usize, f64)| if value.is_nan() { "-".to_owned() } else { format!("{value:.digits$}") });
    columns[5] += unit;
    println!("{}", line([sensor, scene, mode, rays], &columns));
    json!({"sensor": sensor, "scene": scene, "returns": mode, "rays": rays, "rays_per_beam": rays_per_beam, "count": count,
        "several": several, "found": found, "within_1cm": close, "off_sigmas": off, "intensity": intensity,
        "intensity_unit": if unit.is_empty() { "1/255" } else { unit }, "ks_range": ks_range, "ks_intensity": ks_intensity,
        "tv_returns": variation, "mixed_found": mixed})
}

/// A line of the table.
fn line([sensor, scene, mode, rays]: [&str; 4], columns: &[String; 10]) -> String {
    let columns: String = columns.iter().map(|column| format!("{column:>9}")).collect();
    format!("{sensor:<22}{scene:<11}{mode:<11}{rays:<9}{columns}")
}

/// Mean of `values`; NaN of none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// Standard deviation of a strong echo from `range` m, m.
fn sigma(noise: &Noise, range: f32) -> f64 {
    let range = f64::from(range);
    let plain = noise.range_sigma_m + noise.range_sigma_per_m * range;
    plain.hypot(table_sigma(&noise.range_table, range))
}

/// That of a table at `range` m: linear between its points, constant outside.
fn table_sigma(points: &[RangePoint], range: f64) -> f64 {
    let above = points.partition_point(|point| point.at_m <= range);
    match (above.checked_sub(1).map(|below| points[below]), points.get(above)) {
        (Some(a), Some(b)) => a.sigma_m + (b.sigma_m - a.sigma_m) * (range - a.at_m) / (b.at_m - a.at_m),
        (only, None) => only.map_or(0.0, |point| point.sigma_m),
        (None, Some(point)) => point.sigma_m,
    }
}

/// Greatest difference of the distributions of two samples, both ascending.
fn kolmogorov_smirnov(a: &[f32], b: &[f32]) -> f64 {
    let (mut i, mut j, mut most) = (0, 0, 0.0f64);
    while i < a.len() && j < b.len() {
        let value = a[i].min(b[j]);
        i += a[i..].iter().take_while(|&&it| it <= value).count();
        j += b[j..].iter().take_while(|&&it| it <= value).count();
        most = most.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_known_samples() {
        assert_eq!(kolmogorov_smirnov(&[1.0, 2.0, 2.0, 3.0], &[1.0, 2.0, 2.0, 3.0]), 0.0);
        assert_eq!(kolmogorov_smirnov(&[1.0, 2.0], &[3.0, 4.0, 5.0]), 1.0);
        // 3/4 of the first and 1/4 of the second are at most 2.
        assert_eq!(kolmogorov_smirnov(&[1.0, 2.0, 2.0, 3.0], &[2.0, 3.0, 3.0, 4.0]), 0.5);
    }

    #[test]
    fn tables_are_linear_between_points() {
        let points = [(1.0, 0.02), (3.0, 0.06)].map(|(at_m, sigma_m)| RangePoint { at_m, mean_m: 0.0, sigma_m });
        for (range, expected) in [(0.5, 0.02), (1.0, 0.02), (2.0, 0.04), (3.0, 0.06), (9.0, 0.06)] {
            assert!((table_sigma(&points, range) - expected).abs() < 1e-12, "{range}");
        }
        assert_eq!(table_sigma(&[], 5.0), 0.0);
    }
}
