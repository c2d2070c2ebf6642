//! Fan: beams and ranges laid out around the sonar.

use super::{Image, ImageKind, LONE_SECTOR, PixelSource, Place, check_view, filled, middle, of_sources};
use crate::cells::SonarView;
use crate::{Ping, Pings};
use glam::DVec2;
use ground::angle::direction_f64;
use ground::error::{Error, Result};
use std::f64::consts::{PI, TAU};

/// Number of directions distinguished: finer than a pixel of the largest picture.
const DIRECTIONS: usize = 1 << 16;
/// Neighbours share a border if the angle between them is at most this many times the usual one.
const USUAL: f64 = 3.0;
/// Allowed lengths of the longer side, pixels.
const SIDES: std::ops::RangeInclusive<usize> = 16..=8192;

/// One ping of an imaging or swath sonar: for an imaging sonar ahead is up; for a swath sonar the image is a section
/// through the water across the track, with up at the top. Starboard is to the right. Beams extend to midway between
/// them; the longer side has `pixels` pixels, 16 to 8192.
///
/// # Errors
/// A ping of another sonar, or one with inconsistent columns; a side out of bounds.
pub fn fan(ping: &Ping, pixels: usize) -> Result<Image> {
    let pings = Pings { pings: vec![ping.clone()] };
    let words = "imaging and swath sonars; a single beam that turns makes a fan of many pings, others a waterfall";
    check_view(&pings, "fan", &[SonarView::Fan, SonarView::Swath], words)?;
    let view = ping.layout.view;
    let angles = ping.layout.axes.iter().map(|&axis| angle(view, axis)).collect();
    let sectors: Vec<Sector> =
        limits(angles).into_iter().map(|(beam, limits)| Sector { ping: 0, beam, limits }).collect();
    draw(&pings, &sectors, pixels)
}

/// The pings of a rotating single beam, around the place where the first was sent: the direction ahead of the sonar at
/// that time is up. Its motion meanwhile is ignored; a [mosaic](fn@super::mosaic) includes it. Later pings cover
/// earlier ones.
///
/// # Errors
/// Pings that do not fit together or of another sonar; a side out of bounds.
pub fn turning_fan(pings: &Pings, pixels: usize) -> Result<Image> {
    check_view(pings, "turning fan", &[SonarView::Single], "sonars of a single beam; others make a fan of each ping")?;
    let start = pings.pings[0].pose.orientation.inverse();
    let mut angles: Vec<f64> = Vec::with_capacity(pings.pings.len());
    for ping in &pings.pings {
        let look = start * (ping.pose.orientation * ping.layout.axis(0));
        let angle = look.y.atan2(look.x);
        // Continues from the previous ping, the shorter way round.
        let before = angles.last().copied().unwrap_or(angle);
        angles.push(before + (angle - before + PI).rem_euclid(TAU) - PI);
    }
    let steps: Vec<f64> = angles.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let usual = sector(steps.clone());
    let sectors: Vec<Sector> = (0..angles.len())
        .map(|ping| {
            let border = |step: Option<usize>, outwards: usize| match step.and_then(|step| steps.get(step)) {
                Some(&step) if step <= USUAL * usual => angles[ping].midpoint(angles[outwards]),
                _ => angles[ping],
            };
            let before = border(ping.checked_sub(1), ping.saturating_sub(1));
            let after = border(Some(ping), (ping + 1).min(angles.len() - 1));
            // Half the usual step on the side without a neighbour, and for a beam that reverses.
            let half = 0.5 * usual;
            let limits = [before.min(after).min(angles[ping] - half), before.max(after).max(angles[ping] + half)];
            Sector { ping, beam: 0, limits }
        })
        .collect();
    draw(pings, &sectors, pixels)
}

/// Usual width of a beam with these `steps` to its neighbours, rad.
fn sector(steps: Vec<f64>) -> f64 {
    Some(middle(steps)).filter(|&usual| usual > 0.0).unwrap_or(LONE_SECTOR)
}

/// A beam, and the angles it covers, counter-clockwise from up in the image, rad.
struct Sector {
    ping: usize,
    beam: usize,
    limits: [f64; 2],
}

/// Angle of a beam in the image, counter-clockwise from up, rad.
fn angle(view: SonarView, axis: [f32; 2]) -> f64 {
    match view {
        // Across the track: y is left, z is up.
        SonarView::Swath => {
            let look = direction_f64(axis);
            look.y.atan2(look.z)
        }
        _ => f64::from(axis[0]),
    }
}

/// The angles that each beam covers: to midway between neighbours; at the edges and beside gaps, half the usual step.
/// Sorted by ascending angle.
pub(super) fn limits(angles: Vec<f64>) -> Vec<(usize, [f64; 2])> {
    let Some(&first) = angles.first() else { return Vec::new() };
    // No seam between the beams unless they cover the full circle.
    let mut beams: Vec<(usize, f64)> =
        angles.iter().map(|angle| first + (angle - first + PI).rem_euclid(TAU) - PI).enumerate().collect();
    beams.sort_by(|a, b| a.1.total_cmp(&b.1));
    let usual = sector(beams.windows(2).map(|pair| pair[1].1 - pair[0].1).collect());
    let half = |one: usize, other: Option<usize>| match other.and_then(|other| beams.get(other)) {
        Some((_, angle)) if (angle - beams[one].1).abs() <= USUAL * usual => 0.5 * (angle - beams[one].1).abs(),
        _ => 0.5 * usual,
    };
    (0..beams.len())
        .map(|i| (beams[i].0, [beams[i].1 - half(i, i.checked_sub(1)), beams[i].1 + half(i, Some(i + 1))]))
        .collect()
}

fn draw(pings: &Pings, sectors: &[Sector], pixels: usize) -> Result<Image> {
    let layout = &pings.pings[0].layout;
    let axes = ["right, m", if layout.view == SonarView::Swath { "up, m" } else { "ahead, m" }];
    let limits: Vec<[f64; 2]> = sectors.iter().map(|sector| sector.limits).collect();
    let bins = FanBins { first: 0.0, step: layout.bin_m, count: layout.bins };
    let LaidOut { size, place, mut sources } = lay_out(&limits, &bins, pixels, axes)?;
    for source in sources.iter_mut().filter(|source| **source != PixelSource::NONE) {
        let Sector { ping, beam, .. } = sectors[source.ping as usize];
        *source = PixelSource { ping: ping as u32, cell: layout.cell(beam, 0, source.cell as usize) as u32 };
    }
    of_sources(ImageKind::Fan, &pings.pings, size, &sources, place)
}

/// The range bins of all sectors.
pub(super) struct FanBins {
    /// Near end of the first, m.
    pub first: f64,
    /// Length of each, m.
    pub step: f64,
    pub count: usize,
}

/// What the pixels of a fan show.
pub(super) struct LaidOut {
    /// Columns and rows.
    pub size: [usize; 2],
    pub place: Place,
    /// For each pixel the sector, as `ping`, and the range bin, as `cell`.
    pub sources: Vec<PixelSource>,
}

/// Lays out sectors, each with the angles that it covers, counter-clockwise from up in the image, rad; later ones cover
/// earlier ones. The longer side has `pixels` pixels.
///
/// # Errors
/// A side out of bounds; no memory.
pub(super) fn lay_out(sectors: &[[f64; 2]], bins: &FanBins, pixels: usize, axes: [&'static str; 2]) -> Result<LaidOut> {
    if !SIDES.contains(&pixels) {
        let allowed = format!("{} to {} pixels", SIDES.start(), SIDES.end());
        return Err(Error::invalid("side of a fan", pixels, allowed));
    }
    // The sector that covers each direction.
    let mut looks: Vec<Option<usize>> = filled(DIRECTIONS, None)?;
    let turn = DIRECTIONS as f64 / TAU;
    for (sector, limits) in sectors.iter().enumerate() {
        let [from, to] = limits.map(|angle| (angle * turn).round() as i64);
        // At least one direction, at most all of them.
        for direction in from..to.clamp(from + 1, from + DIRECTIONS as i64) {
            looks[direction.rem_euclid(DIRECTIONS as i64) as usize] = Some(sector);
        }
    }
    // Extent of the beams on all sides, starting at the instrument.
    let reach = bins.first + bins.count as f64 * bins.step;
    let (mut low, mut high) = (DVec2::ZERO, DVec2::ZERO);
    for direction in (0..DIRECTIONS).filter(|&direction| looks[direction].is_some()) {
        let (sin, cos) = ((direction as f64 + 0.5) / turn).sin_cos();
        let rim = reach * DVec2::new(-sin, cos);
        (low, high) = (low.min(rim), high.max(rim));
    }
    let size = high - low;
    let metres = size.max_element() / pixels as f64;
    let [width, height] = (size / metres).ceil().max(DVec2::ONE).min(DVec2::splat(pixels as f64)).to_array();
    let (width, height) = (width as usize, height as usize);
    let place = Place { first: [low.x + 0.5 * metres, high.y - 0.5 * metres], step: [metres, -metres], axes };
    let mut sources = filled(width * height, PixelSource::NONE)?;
    for (row, line) in sources.chunks_exact_mut(width).enumerate() {
        let up = place.first[1] + row as f64 * place.step[1];
        for (column, source) in line.iter_mut().enumerate() {
            let right = place.first[0] + column as f64 * place.step[0];
            let bin = (right.hypot(up) - bins.first) / bins.step;
            let direction = ((-right).atan2(up) * turn).floor().rem_euclid(DIRECTIONS as f64) as usize;
            if (0.0..bins.count as f64).contains(&bin)
                && let Some(sector) = looks[direction.min(DIRECTIONS - 1)]
            {
                *source = PixelSource { ping: sector as u32, cell: bin as u32 };
            }
        }
    }
    Ok(LaidOut { size: [width, height], place, sources })
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{TARGET, imaging, turning};
    use super::*;
    use crate::Field;
    use std::sync::Arc;

    /// Middle of the pixels with the label of the target.
    fn target(image: &Image) -> DVec2 {
        let ids = image.layer(Field::CategoryId).unwrap();
        let found: Vec<DVec2> = (0..ids.len())
            .filter(|&i| ids[i] == TARGET)
            .map(|i| image.coordinates(i % image.width, i / image.width).into())
            .collect();
        found.iter().sum::<DVec2>() / found.len() as f64
    }

    #[test]
    fn cells_are_at_their_angle_and_range() {
        // 20 degrees to port at 12 m.
        let angle = 20f64.to_radians();
        let ahead = imaging(SonarView::Fan, 20.0, 12.0);
        let image = fan(&ahead, 600).unwrap();
        assert!(target(&image).distance(12.0 * DVec2::new(-angle.sin(), angle.cos())) < 0.1, "{}", target(&image));
        // A sector of 120 degrees is sqrt(3) times as wide as high.
        assert_eq!((image.width, image.height), (600, 347));
        assert!(image.values[0].is_nan() && image.values[image.index([0.0, 5.0]).unwrap()].is_finite());

        let down = imaging(SonarView::Swath, 20.0, 12.0);
        let image = fan(&down, 600).unwrap();
        assert!(target(&image).distance(12.0 * DVec2::new(-angle.sin(), -angle.cos())) < 0.1, "{}", target(&image));
        assert_eq!(image.place.axes[1], "up, m");
        let error = fan(&down, 8).unwrap_err().to_string();
        assert_eq!(error, "side of a fan is 8; allowed: 16 to 8192 pixels");
        let error = fan(&turning(4, 90.0).pings[0], 100).unwrap_err().to_string();
        assert!(error.starts_with("fan is requested for a single sonar; allowed: imaging and swath"), "{error}");
    }

    #[test]
    fn a_turning_beam_sees_all_around() {
        let pings = turning(200, 1.8);
        let image = turning_fan(&pings, 400).unwrap();
        assert_eq!((image.width, image.height), (400, 400));
        // The target of the 50th ping: 90 degrees to the left of the first, at 12 m.
        assert!(target(&image).distance(DVec2::new(-12.0, 0.0)) < 0.2, "{}", target(&image));
        let seen = image.values.iter().filter(|value| value.is_finite()).count() as f64;
        assert!((seen / 160_000.0 - PI / 4.0).abs() < 0.01, "{seen}");
        // Half a turn leaves the other half empty, and a second turn covers the first.
        let half = turning_fan(&turning(101, 1.8), 400).unwrap();
        assert!((half.width as f64 / half.height as f64 - 0.5).abs() < 0.02, "{} {}", half.width, half.height);
        let mut twice = turning(400, 1.8);
        twice.pings[250].cells.intensity.fill(7.0);
        let again = turning_fan(&twice, 400).unwrap();
        let gain = twice.pings[0].layout.tvg_db[100];
        assert_eq!(again.values[again.index([-(100.5 * 0.05), 0.0]).unwrap()], 7.0 + gain);
    }

    #[test]
    fn a_lone_beam_is_as_wide_as_one_can_see() {
        let lone = turning_fan(&turning(1, 1.8), 400).unwrap();
        let mut still = turning(3, 0.0);
        assert_eq!(turning_fan(&still, 400).unwrap().width, lone.width);
        let mut one = imaging(SonarView::Fan, 0.0, 12.0);
        let layout = Arc::make_mut(&mut one.layout);
        layout.axes = vec![[0.0; 2]];
        one.cells = still.pings.remove(0).cells;
        for image in [lone, fan(&one, 400).unwrap()] {
            // 2 degrees of 400 pixels.
            assert!(image.height == 400 && (13..=16).contains(&image.width), "{} x {}", image.width, image.height);
            let seen = image.values.iter().filter(|value| value.is_finite()).count();
            assert!((2000..3600).contains(&seen), "{seen}");
        }
    }

    #[test]
    fn gaps_between_beams_stay() {
        let degrees = |angles: &[f64]| limits(angles.iter().map(|angle| angle.to_radians()).collect());
        let found = degrees(&[10.0, 0.0, 30.0, 20.0, 90.0, 100.0]);
        let expected = [(1, -5, 5), (0, 5, 15), (3, 15, 25), (2, 25, 35), (4, 85, 95), (5, 95, 105)];
        for ((beam, [from, to]), expected) in found.into_iter().zip(expected) {
            assert_eq!((beam, from.to_degrees().round() as i32, to.to_degrees().round() as i32), expected);
        }
        // Across the seam at half a turn.
        let found = degrees(&[179.0, -179.0, -177.0]);
        assert!((found[2].1[1].to_degrees() - 184.0).abs() < 1e-9, "{found:?}");
    }
}
