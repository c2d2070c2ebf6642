//! Images of a radar: range by Doppler, and polar.

use super::fan::{FanBins, LaidOut, lay_out};
use super::{Image, ImageKind, PixelSource, Place, filled};
use crate::PolarImage;
use crate::radar_frame::DBM_OF_WATT;
use ground::error::{Error, Result};
use radar::RadarCube;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Power in the cells of `cube`, summed over its channels, dBm.
///
/// # Errors
/// Cells that do not fit the axes; no memory.
pub fn range_doppler(cube: &RadarCube) -> Result<Image> {
    let RadarCube { axes, channels, cells } = cube;
    let [width, height] = [axes.velocity.len, axes.range.len];
    let layer = width.saturating_mul(height);
    if layer == 0 || channels.checked_mul(layer) != Some(cells.len()) {
        let found = format!("{} cells", cells.len());
        return Err(Error::invalid("cube", found, format!("{channels} x {width} x {height}, and more than none")));
    }
    let mut powers: Vec<f32> = filled(layer, 0.0)?;
    for channel in cells.chunks_exact(layer) {
        powers.iter_mut().zip(channel).for_each(|(power, cell)| *power += cell.norm_sqr());
    }
    let mut values = filled(layer, f32::NAN)?;
    for (velocity, ranges) in powers.chunks_exact(height).enumerate() {
        for (range, &power) in ranges.iter().enumerate().filter(|(_, power)| **power > 0.0) {
            values[(height - 1 - range) * width + velocity] = 10.0 * power.log10() + DBM_OF_WATT;
        }
    }
    let place = Place {
        first: [axes.velocity.first, axes.range.at((height - 1) as f64)],
        step: [axes.velocity.step, -axes.range.step],
        axes: ["velocity, m/s", "range, m"],
    };
    Ok(of(ImageKind::RangeDoppler, [width, height], values, place))
}

/// The rows of a polar image by azimuth, clockwise from ahead, which is at the top, or from the leftmost if the rows do
/// not go round; ranges to the right.
///
/// # Errors
/// Lengths that disagree; no memory.
pub fn polar(image: &PolarImage) -> Result<Image> {
    image.check()?;
    let (rows, cells) = (image.azimuths.len(), image.range.len);
    let mut order: Vec<(f64, usize)> =
        seamless(image).into_iter().enumerate().map(|(row, azimuth)| (-azimuth, row)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut values = filled(rows * cells, f32::NAN)?;
    for (line, (_, row)) in values.chunks_exact_mut(cells).zip(&order) {
        line.copy_from_slice(&image.levels[row * cells..][..cells]);
    }
    let step = (order[rows - 1].0 - order[0].0) / (rows - 1).max(1) as f64;
    let place = Place {
        first: [image.range.first, order[0].0],
        step: [image.range.step, if step > 0.0 { step } else { TAU }],
        axes: ["range, m", "azimuth, rad"],
    };
    Ok(of(ImageKind::Polar, [cells, rows], values, place))
}

/// A polar image laid out around the radar: ahead is up. Rows extend to midway between them, cells to half their length
/// before and behind their middles; the longer side has `pixels` pixels, 16 to 8192, which show the strongest of their cells.
///
/// # Errors
/// Lengths that disagree; a side out of bounds; no memory.
pub fn polar_fan(image: &PolarImage, pixels: usize) -> Result<Image> {
    image.check()?;
    let sectors = contiguous(seamless(image));
    let angles: Vec<[f64; 2]> = sectors.iter().map(|(_, limits)| *limits).collect();
    let cells = image.range.len;
    // Of the cells that share a pixel, the strongest is seen.
    let per_pixel = (2 * cells / pixels.max(1)).clamp(1, cells.max(1));
    let count = cells.div_ceil(per_pixel);
    let bins = FanBins { first: image.range.at(-0.5), step: image.range.step * per_pixel as f64, count };
    let LaidOut { size, place, sources } = lay_out(&angles, &bins, pixels, ["right, m", "ahead, m"])?;
    let mut values = filled(sources.len(), f32::NAN)?;
    for (value, source) in values.iter_mut().zip(&sources).filter(|(_, source)| **source != PixelSource::NONE) {
        let row = &image.levels[sectors[source.ping as usize].0 * cells..][..cells];
        let first = source.cell as usize * per_pixel;
        *value = row[first..(first + per_pixel).min(cells)].iter().copied().fold(f32::NAN, f32::max);
    }
    Ok(of(ImageKind::PolarFan, size, values, place))
}

/// Azimuths of rows without a jump in them: from 0 down to a turn to the right if they go round, else within half a
/// turn of the first.
fn seamless(image: &PolarImage) -> Vec<f64> {
    let first = image.azimuths[0];
    let near = |azimuth: f64| first + (azimuth - first + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
    let azimuths: Vec<f64> = image.azimuths.iter().map(|&azimuth| near(azimuth)).collect();
    let (least, most) = azimuths.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
    if (most - least) * (1.0 + 1.5 / azimuths.len() as f64) < TAU {
        return azimuths;
    }
    azimuths.into_iter().map(|azimuth| -(-azimuth).rem_euclid(TAU)).collect()
}

/// The angles that each row covers, in ascending order: to midway between neighbours, however far apart they are (rows of
/// equal steps in sine are far apart at the sides); the outermost as far outward as inward.
fn contiguous(azimuths: Vec<f64>) -> Vec<(usize, [f64; 2])> {
    let mut rows: Vec<(usize, f64)> = azimuths.into_iter().enumerate().collect();
    rows.sort_by(|a, b| a.1.total_cmp(&b.1));
    let last = rows.len() - 1;
    let ahead = |at: usize| 0.5 * (rows[at + 1].1 - rows[at].1);
    let half = |at: usize| match (at, last) {
        // A row of its own goes all the way round.
        (_, 0) => [0.5 * TAU; 2],
        (0, _) => [ahead(0); 2],
        (at, last) if at == last => [ahead(last - 1); 2],
        _ => [ahead(at - 1), ahead(at)],
    };
    (0..rows.len()).map(|at| (rows[at].0, [rows[at].1 - half(at)[0], rows[at].1 + half(at)[1]])).collect()
}

fn of(kind: ImageKind, [width, height]: [usize; 2], values: Vec<f32>, place: Place) -> Image {
    Image { kind, width, height, values, layers: Vec::new(), place, labels: Arc::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::radar_frame::made;
    use num_complex::Complex32;

    #[test]
    fn what_approaches_is_on_the_left() {
        let mut cube = made::frame().cube.unwrap();
        cube.cells.fill(Complex32::ZERO);
        // In two of three channels, at -1 m/s and 2.5 m: 2 mW together.
        for channel in [0, 2] {
            cube.cells[(channel * 4 + 1) * 8 + 5] = Complex32::new(0.0, 0.001_f32.sqrt());
        }
        let image = range_doppler(&cube).unwrap();
        let seen: Vec<usize> = (0..image.values.len()).filter(|&pixel| !image.values[pixel].is_nan()).collect();
        assert_eq!(seen, [image.index([-1.0, 2.5]).unwrap()]);
        assert!((image.values[seen[0]] - 3.010_3).abs() < 1e-4, "{}", image.values[seen[0]]);
        cube.channels = 2;
        assert_eq!(
            range_doppler(&cube).unwrap_err().to_string(),
            "cube is 96 cells; allowed: 2 x 4 x 8, and more than none"
        );
    }

    /// A turn with one bright cell at 40 degrees to the right and 3 m.
    fn spot(rows: usize, turned: impl Fn(usize) -> f64) -> PolarImage {
        let mut image = made::turn(rows, 100);
        image.azimuths = (0..rows).map(turned).collect();
        image.levels.fill(-110.0);
        let row = (0..rows).find(|&row| (image.azimuths[row].to_degrees() + 40.0).rem_euclid(360.0) < 1e-6).unwrap();
        image.levels[row * 100 + 69] = -50.0;
        image
    }

    #[test]
    fn directions_are_those_of_the_rows() {
        let ways: [&dyn Fn(usize) -> f64; 2] =
            [&|row| (-(row as f64)).to_radians(), &|row| (row as f64 - 500.0).to_radians()];
        for way in ways {
            let image = spot(360, way);
            let flat = polar(&image).unwrap();
            assert_eq!((flat.width, flat.height), (100, 360));
            assert_eq!(flat.values[flat.index([69.0 * 0.0432, 40_f64.to_radians()]).unwrap()], -50.0);
            let fan = polar_fan(&image, 400).unwrap();
            let at = |degrees: f64, range: f64| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                fan.values[fan.index([range * sin, range * cos]).unwrap()]
            };
            assert_eq!(
                [at(40.0, 2.98), at(-40.0, 2.98), at(45.0, 2.98), at(40.0, 2.9)],
                [-50.0, -110.0, -110.0, -110.0]
            );
            assert_eq!((fan.width, fan.height), (400, 400));
        }
        // Beams at equal steps in sine leave no gap.
        let sines = spot(5, |row| [0.9, 0.0, -(40_f64.to_radians().sin()), 0.5, -0.9][row].asin());
        let fan = polar_fan(&sines, 400).unwrap();
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            fan.values[fan.index([2.98 * sin, 2.98 * cos]).unwrap()]
        };
        assert!((-60..70).step_by(2).all(|degrees| !at(f64::from(degrees)).is_nan()));
        assert_eq!([at(22.0), at(50.0), at(18.0), at(54.0)], [-50.0, -50.0, -110.0, -110.0]);
        // A sector ahead of an array.
        let sector = spot(121, |row| (row as f64 - 60.0).to_radians());
        let fan = polar_fan(&sector, 600).unwrap();
        assert!((fan.width as f64 / fan.height as f64 - 3_f64.sqrt()).abs() < 0.01, "{} x {}", fan.width, fan.height);
        assert!((polar(&sector).unwrap().place.first[1] + 60_f64.to_radians()).abs() < 1e-9);
        assert!(polar_fan(&sector, 1).is_err());
    }
}
