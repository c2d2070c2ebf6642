//! Mosaic: what the sonar saw, placed on the map by its poses.

use super::grid::{self, Grid, span};
use super::{
    Image, ImageKind, ImageRange, LONE_SECTOR, PixelSource, altitudes, check_view, filled, layers, level, levels,
    middle,
};
use crate::Pings;
use crate::cells::SonarView;
use glam::{DMat2, DVec2};
use ground::error::Result;
use ground::math::{LOG2_PER_DB, exp2};
use ground::named;
use ground::pose::Pose;
use std::sync::Arc;

/// Neighbours share a border if their distance and turn are at most this many times the usual ones. Between others
/// there is a gap.
const USUAL: f64 = 3.0;
/// A turn that is always allowed, rad: 2 degrees.
const TURN: f64 = 0.035;

/// What a mosaic pixel shows when several cells fall into it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Overlap {
    /// Mean of the power; its label is that of the strongest cell.
    #[default]
    Mean,
    /// The strongest.
    Max,
    /// The last one received.
    Last,
    /// The one nearest to the sonar.
    Nearest,
}

named! { Overlap: Mean "mean", Max "max", Last "last", Nearest "nearest" }

/// The pings of a side-scan, imaging or single-beam sonar on a map of squares of `cell_m` metres: each cell is where
/// its beam points from the ping's position and heading, at its range. Roll and pitch are ignored, as is the height of
/// the scatterers, which a sonar cannot know.
///
/// Neighbouring pings share a border midway between them, so that a swath has no holes; where the sonar turns, it is
/// stretched on the outside and overlaps on the inside of the turn. Missing pings leave a gap. Beams of an imaging
/// sonar extend to midway between them.
///
/// # Errors
/// Pings that do not fit together, are from a swath sonar, or, for ground range, lack a first return of the bed; a cell
/// that is not a length or makes too many pixels.
pub fn mosaic(pings: &Pings, range: ImageRange, cell_m: f64, overlap: Overlap) -> Result<Image> {
    check(pings)?;
    let heights = if range == ImageRange::Ground { Some(altitudes(pings)?) } else { None };
    draw(pings, &strips(pings, heights), cell_m, overlap)
}

/// The mosaic that fits into a picture of `pixels`: over ground range where a side-scan sonar sees the bed, else over
/// slant range. Returns the range as well.
///
/// # Errors
/// As [`mosaic`].
pub fn fitting(pings: &Pings, pixels: [u32; 2]) -> Result<(ImageRange, Image)> {
    // The bed may be out of reach.
    let heights = if check(pings)? == SonarView::Sidescan { altitudes(pings).ok() } else { None };
    let range = if heights.is_some() { ImageRange::Ground } else { ImageRange::Slant };
    let strips = strips(pings, heights);
    let cell = grid::fitting(extent(&strips), pixels);
    Ok((range, draw(pings, &strips, cell, Overlap::Mean)?))
}

fn check(pings: &Pings) -> Result<SonarView> {
    let allowed = [SonarView::Sidescan, SonarView::Fan, SonarView::Single];
    check_view(pings, "mosaic", &allowed, "sidescan, fan and single sonars; a swath makes a depth map")
}

fn draw(pings: &Pings, strips: &[Strip], cell_m: f64, overlap: Overlap) -> Result<Image> {
    let grid = Grid::new(extent(strips), cell_m)?;
    let mut sources = filled(grid.len(), PixelSource::NONE)?;
    let mut scores = filled(grid.len(), f32::NEG_INFINITY)?;
    // For the mean: power over 1 uPa^2, and the number of samples in it.
    let mut sums = if overlap == Overlap::Mean { filled(grid.len(), (0f64, 0u32))? } else { Vec::new() };
    for strip in strips {
        let ping = &pings.pings[strip.ping];
        let layout = &ping.layout;
        // Every cell is drawn, and no pixel in the strip is left out.
        let step = layout.bin_m.min(0.5 * cell_m);
        let steps = (strip.reach / step) as usize;
        for i in 0..steps {
            let distance = (i as f64 + 0.5) * step;
            let slant = (distance * distance + strip.altitude * strip.altitude).sqrt();
            let bin = ((slant / layout.bin_m) as usize).min(layout.bins - 1);
            let cell = layout.cell(strip.beam, 0, bin);
            let level = level(ping, cell);
            if !level.is_finite() {
                continue;
            }
            let score = match overlap {
                Overlap::Mean | Overlap::Max => level,
                Overlap::Last => strip.ping as f32,
                Overlap::Nearest => -distance as f32,
            };
            let power = if overlap == Overlap::Mean { f64::from(exp2(level * LOG2_PER_DB)) } else { 0.0 };
            let [start, end] = strip.at(distance);
            let places = (start.distance(end) / (0.5 * cell_m)).ceil().max(1.0) as usize;
            for j in 0..places {
                let pixel = grid.index(start.lerp(end, (j as f64 + 0.5) / places as f64));
                if let Some((sum, count)) = sums.get_mut(pixel) {
                    *sum += power;
                    *count += 1;
                }
                if score >= scores[pixel] {
                    scores[pixel] = score;
                    sources[pixel] = PixelSource { ping: strip.ping as u32, cell: cell as u32 };
                }
            }
        }
    }
    let mut values = levels(&pings.pings, &sources)?;
    for (value, (sum, count)) in values.iter_mut().zip(&sums).filter(|(_, (_, count))| *count > 0) {
        *value = (10.0 * (sum / f64::from(*count)).log10()) as f32;
    }
    Ok(Image {
        kind: ImageKind::Mosaic,
        width: grid.width,
        height: grid.height,
        values,
        layers: layers(&pings.pings, &sources)?,
        place: grid.place(),
        labels: pings.pings.first().map(|ping| Arc::clone(&ping.labels)).unwrap_or_default(),
    })
}

/// The strip that one beam of a ping covers: at the distance `r` over the bed, from `from[0] + r along[0]` to
/// `from[1] + r along[1]`.
struct Strip {
    ping: usize,
    beam: usize,
    from: [DVec2; 2],
    along: [DVec2; 2],
    /// Height over the bed for ground range, else 0, m.
    altitude: f64,
    /// Farthest distance, m.
    reach: f64,
}

impl Strip {
    fn at(&self, distance: f64) -> [DVec2; 2] {
        [0, 1].map(|side| self.from[side] + distance * self.along[side])
    }
}

fn extent(strips: &[Strip]) -> [DVec2; 2] {
    span(strips.iter().flat_map(|strip| [strip.at(0.0), strip.at(strip.reach)]).flatten())
}

/// Direction in which a sonar points, seen from above, regardless of its roll and pitch.
pub fn heading(pose: &Pose) -> DVec2 {
    let rotation = pose.rotation();
    let ahead = rotation.x_axis;
    // One that points straight up or down heads where it would point if it were pitched to the horizontal.
    let level = if ahead.truncate().length() > 1e-6 { ahead } else { -ahead.z.signum() * rotation.z_axis };
    level.truncate().normalize_or(DVec2::X)
}

/// The strips that the pings cover; over ground range if the `altitudes` of the sonar are known.
fn strips(Pings { pings }: &Pings, altitudes: Option<Vec<f64>>) -> Vec<Strip> {
    let altitudes = altitudes.unwrap_or_else(|| vec![0.0; pings.len()]);
    let layout = &pings[0].layout;
    let from: Vec<DVec2> = pings.iter().map(|ping| ping.pose.position.truncate()).collect();
    let headings: Vec<DVec2> = pings.iter().map(|ping| heading(&ping.pose)).collect();
    let looks = |ping: usize, azimuth: f64| DMat2::from_angle(azimuth) * headings[ping];
    let azimuth = |beam: usize| f64::from(layout.axes[beam][0]);
    let mut strips = Vec::new();
    let mut add = |ping: usize, beam: usize, from: [DVec2; 2], along: [DVec2; 2]| {
        let altitude: f64 = altitudes[ping];
        let reach = (layout.reach().powi(2) - altitude.powi(2)).max(0.0).sqrt();
        strips.push(Strip { ping, beam, from, along, altitude, reach });
    };
    if layout.view == SonarView::Fan {
        for (beam, limits) in super::fan::limits((0..layout.beams()).map(azimuth).collect()) {
            for ping in 0..pings.len() {
                add(ping, beam, [from[ping]; 2], limits.map(|azimuth| looks(ping, azimuth)));
            }
        }
        return strips;
    }
    let steps: Vec<[f64; 2]> = (1..pings.len())
        .map(|ping| [from[ping].distance(from[ping - 1]), headings[ping].angle_to(headings[ping - 1]).abs()])
        .collect();
    // Only steps with motion.
    let moving = |what: usize| steps.iter().map(|step| step[what]).filter(|&step| step > 1e-9).collect();
    let [distance, turn] = [0, 1].map(|what| middle(moving(what)));
    let neighbours = |first: usize| {
        let [apart, turned] = steps[first];
        let missing = pings[first + 1].number.abs_diff(pings[first].number) > 1;
        !missing && apart <= (USUAL * distance).max(layout.bin_m) && turned <= (USUAL * turn).max(TURN)
    };
    for beam in 0..layout.beams() {
        for ping in 0..pings.len() {
            let (here, direction) = (from[ping], looks(ping, azimuth(beam)));
            let border = |other: Option<usize>, outwards: f64| {
                let moved = |other: &usize| steps[ping.min(*other)].iter().any(|&step| step > 1e-9);
                match other.filter(moved) {
                    Some(other) => (here.midpoint(from[other]), direction.midpoint(looks(other, azimuth(beam)))),
                    None if distance > 0.0 => (here + 0.5 * outwards * distance * headings[ping], direction),
                    None if turn > 0.0 => (here, direction),
                    // No neighbour to compare with: to both sides of its beam.
                    None => (here, DMat2::from_angle(0.5 * outwards * LONE_SECTOR) * direction),
                }
            };
            let before = border(ping.checked_sub(1).filter(|&before| neighbours(before)), -1.0);
            let after = border(Some(ping + 1).filter(|&after| after < pings.len() && neighbours(ping)), 1.0);
            add(ping, beam, [before.0, after.0], [before.1, after.1]);
        }
    }
    strips
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{SyntheticSidescan, TARGET, pings, turning};
    use super::*;
    use crate::Field;
    use std::f64::consts::FRAC_PI_2;

    /// Pixels of `image` with the label of the target.
    fn target(image: &Image) -> Vec<[f64; 2]> {
        let ids = image.layer(Field::CategoryId).unwrap();
        (0..ids.len())
            .filter(|&i| ids[i] == TARGET)
            .map(|i| image.coordinates(i % image.width, i / image.width))
            .collect()
    }

    #[test]
    fn a_target_is_at_its_place_in_the_world() {
        for course in [0.0, 0.5, 2.0, -FRAC_PI_2] {
            let track =
                SyntheticSidescan { course, start: DVec2::new(1000.0, -2000.0), ..SyntheticSidescan::default() };
            let pings = pings(&track);
            for overlap in [Overlap::Mean, Overlap::Max, Overlap::Last, Overlap::Nearest] {
                let image = mosaic(&pings, ImageRange::Ground, 0.1, overlap).unwrap();
                let found = target(&image);
                let centre = found.iter().fold(DVec2::ZERO, |sum, &at| sum + DVec2::from(at)) / found.len() as f64;
                let expected = track.target_in_world();
                assert!(centre.distance(expected) < 0.1, "{course} {overlap:?}: {centre} {expected}");
                // As long and wide as the target: half a metre along, 0.4 m across.
                let area = found.len() as f64 * 0.01;
                assert!((area - 0.2).abs() < 0.1, "{course} {overlap:?}: {area}");
            }
        }
    }

    #[test]
    fn a_swath_is_closed_but_missing_pings_leave_a_gap() {
        let track = SyntheticSidescan { pings: 40, speed: 1.0, course: 0.3, ..SyntheticSidescan::default() };
        let mut pings = pings(&track);
        let empty = |image: &Image| {
            // Along the track at 10 m to starboard.
            let along = DVec2::from_angle(track.course);
            (5..350)
                .filter(|&i| {
                    let at = track.start + 0.1 * f64::from(i) * along - 10.0 * along.perp();
                    image.values[image.index(at.into()).unwrap()].is_nan()
                })
                .count()
        };
        // Pixels much smaller than the distance from ping to ping, and much larger.
        for cell in [0.07, 3.0] {
            assert_eq!(empty(&mosaic(&pings, ImageRange::Slant, cell, Overlap::Mean).unwrap()), 0);
        }
        pings.pings.drain(20..25);
        let image = mosaic(&pings, ImageRange::Slant, 0.07, Overlap::Mean).unwrap();
        assert!((45..55).contains(&empty(&image)), "{}", empty(&image));
    }

    #[test]
    fn a_turn_stretches_the_outer_side() {
        // A quarter circle of radius 30 m to port.
        let mut turn = pings(&SyntheticSidescan { pings: 91, target: None, ..SyntheticSidescan::default() });
        for (i, ping) in turn.pings.iter_mut().enumerate() {
            let angle = i as f64;
            let position = 30.0 * DVec2::from_angle((angle - 90.0).to_radians());
            ping.pose = Pose::at(position.x, position.y, 8.0).with_rpy_deg(0.0, 0.0, angle);
        }
        let image = mosaic(&turn, ImageRange::Slant, 0.1, Overlap::Nearest).unwrap();
        // Outside, 15 m from the track, nothing is left empty.
        for tenths in 5..895 {
            let at = 45.0 * DVec2::from_angle((f64::from(tenths) / 10.0 - 90.0).to_radians());
            assert!(!image.values[image.index(at.into()).unwrap()].is_nan(), "{tenths}");
        }
    }

    #[test]
    fn one_ping_is_to_be_seen() {
        for (one, sides) in [
            (pings(&SyntheticSidescan { pings: 1, target: None, ..SyntheticSidescan::default() }), 2.0),
            (turning(1, 1.8), 1.0),
        ] {
            let image = mosaic(&one, ImageRange::Slant, 0.05, Overlap::Mean).unwrap();
            let seen = 0.05 * 0.05 * image.values.iter().filter(|value| value.is_finite()).count() as f64;
            let reach = one.pings[0].layout.reach();
            // A sector of two degrees for each beam, whose edges touch pixels beside it.
            let area = sides * 0.5 * LONE_SECTOR * reach * reach;
            assert!(seen > area && seen < area + sides * 0.15 * reach, "{seen} {area}");
            let (range, fitted) = fitting(&one, [400, 300]).unwrap();
            assert_eq!(range == ImageRange::Ground, sides == 2.0);
            assert!(fitted.values.iter().filter(|value| value.is_finite()).count() > 500);
        }
    }

    /// Most pings are of a stationary sonar: those in motion still join.
    #[test]
    fn a_rest_on_the_way_leaves_no_gaps() {
        let mut resting = pings(&SyntheticSidescan { pings: 30, target: None, ..SyntheticSidescan::default() });
        let moving = Pings { pings: resting.pings[19..].to_vec() };
        let rest = resting.pings[19].pose;
        resting.pings[..19].iter_mut().for_each(|ping| ping.pose = rest);
        let seen = |pings: &Pings| {
            let image = mosaic(pings, ImageRange::Slant, 0.1, Overlap::Last).unwrap();
            image.values.iter().filter(|value| value.is_finite()).count() as f64
        };
        let (with, without) = (seen(&resting), seen(&moving));
        assert!(with >= without && with < 1.02 * without, "{with} {without}");
    }

    #[test]
    fn the_mean_is_of_the_power() {
        let mut pings = pings(&SyntheticSidescan { speed: 0.25, target: None, ..SyntheticSidescan::default() });
        for (i, ping) in pings.pings.iter_mut().enumerate() {
            Arc::make_mut(&mut ping.layout).tvg_db.fill(0.0);
            ping.cells.intensity.fill(if i % 2 == 0 { 80.0 } else { 100.0 });
        }
        let value = |overlap| {
            let image = mosaic(&pings, ImageRange::Slant, 2.0, overlap).unwrap();
            image.values[image.index([5.0, 10.2]).unwrap()]
        };
        let mean = 10.0 * ((1e8f32 + 1e10) / 2.0).log10();
        assert!((value(Overlap::Mean) - mean).abs() < 0.2, "{} {mean}", value(Overlap::Mean));
        assert_eq!(value(Overlap::Max), 100.0);
    }
}
