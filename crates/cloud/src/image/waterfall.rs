//! Waterfall: a row for each ping.

use super::{Image, ImageKind, ImageRange, PixelSource, Place, altitudes, filled, of_sources};
use crate::Pings;
use crate::cells::{Layout, SonarView};
use ground::error::{Error, Result};

/// Maximum number of pixels of a waterfall.
const MOST_PIXELS: usize = 1 << 26;

/// A row for each ping by its index, the first at the top, regardless of the sonar's track:
/// `[port reversed | starboard]` for a side-scan sonar, nearest ranges in the middle; else the cells of one beam,
/// nearest on the left. Pixels are as wide as cells.
///
/// `beam`: only this one; by default both sides of a side-scan sonar, the middle beam of others.
///
/// # Errors
/// Pings that do not fit together, no such beam, ground range for other than a side-scan sonar or without a first
/// return of the bed, too many pixels.
pub fn waterfall(pings: &Pings, range: ImageRange, beam: Option<usize>) -> Result<Image> {
    let layout = pings.check()?;
    let (port, starboard) = match beam {
        Some(beam) if beam >= layout.beams() => {
            let allowed = format!("0 to {}, the beams of this sonar", layout.beams() - 1);
            return Err(Error::invalid("beam", beam, allowed));
        }
        Some(beam) => (None, Some(beam)),
        None => match middle_beam(layout) {
            Some(beam) => (None, Some(beam)),
            None => sides(layout),
        },
    };
    let heights = match range {
        ImageRange::Slant => vec![0.0; pings.pings.len()],
        ImageRange::Ground if layout.view == SonarView::Sidescan => altitudes(pings)?,
        ImageRange::Ground => {
            let found = format!("requested for a {} sonar", layout.view.name());
            return Err(Error::invalid("ground range in a waterfall", found, "slant range, or a sidescan sonar"));
        }
    };
    let bins = layout.bins;
    let left = if port.is_some() { bins } else { 0 };
    let right = if starboard.is_some() { bins } else { 0 };
    let (width, height) = (left + right, heights.len());
    if width.checked_mul(height).is_none_or(|pixels| pixels > MOST_PIXELS) {
        let found = format!("{width} x {height} pixels large");
        return Err(Error::invalid("waterfall", found, format!("at most {MOST_PIXELS} pixels; write fewer pings")));
    }
    let mut sources = filled(width * height, PixelSource::NONE)?;
    for (ping, (row, altitude)) in sources.chunks_exact_mut(width).zip(heights).enumerate() {
        for (column, source) in row.iter_mut().enumerate() {
            let (beam, step) = if column < left { (port, left - 1 - column) } else { (starboard, column - left) };
            // A scatterer at this distance over the bed is received at this slant range.
            let slant = layout.range(step).hypot(altitude) / layout.bin_m;
            if let Some(beam) = beam
                && slant < bins as f64
            {
                *source = PixelSource { ping: ping as u32, cell: layout.cell(beam, 0, slant as usize) as u32 };
            }
        }
    }
    let place = Place {
        first: [(0.5 - left as f64) * layout.bin_m, 0.0],
        step: [layout.bin_m, 1.0],
        axes: [if port.is_some() { "across, m" } else { "range, m" }, "ping"],
    };
    of_sources(ImageKind::Waterfall, &pings.pings, [width, height], &sources, place)
}

/// The beam that a waterfall shows by default: the middle one; `None` for a side-scan sonar, both sides of which are
/// shown.
pub fn middle_beam(layout: &Layout) -> Option<usize> {
    (layout.view != SonarView::Sidescan).then(|| layout.beams() / 2)
}

/// The beams that point to port, which is left, and to starboard.
fn sides(layout: &Layout) -> (Option<usize>, Option<usize>) {
    let looks = |left: bool| layout.axes.iter().position(|axis| (axis[0].sin() > 0.0) == left);
    (looks(true), looks(false))
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{SyntheticSidescan, TARGET, pings};
    use super::*;
    use crate::Field;

    #[test]
    fn an_unmoved_flat_bed_gives_straight_lines() {
        let pings = pings(&SyntheticSidescan { speed: 0.0, target: None, ..SyntheticSidescan::default() });
        for range in [ImageRange::Slant, ImageRange::Ground] {
            let image = waterfall(&pings, range, None).unwrap();
            let first = &image.values[..image.width];
            for row in image.values.chunks(image.width) {
                assert!(row.iter().zip(first).all(|(a, b)| a == b || a.is_nan() && b.is_nan()), "{range:?}");
            }
            // Both sides see the same.
            assert!((0..image.width / 2).all(|i| {
                let (port, starboard) = (first[image.width / 2 - 1 - i], first[image.width / 2 + i]);
                port == starboard || port.is_nan() && starboard.is_nan()
            }));
        }
    }

    #[test]
    fn ground_range_puts_a_target_at_its_distance_and_drops_the_water() {
        let track = SyntheticSidescan::default();
        let [_, across] = track.target.unwrap();
        let pings = pings(&track);
        let ground = waterfall(&pings, ImageRange::Ground, None).unwrap();
        let slant = waterfall(&pings, ImageRange::Slant, None).unwrap();
        let row = track.pings / 2;
        // To port: left of the middle.
        let edge = across - 0.2;
        for (image, distance) in [(&ground, -edge), (&slant, -edge.hypot(track.altitude))] {
            let ids = image.layer(Field::CategoryId).unwrap();
            let columns: Vec<f64> = (0..image.width)
                .filter(|column| ids[row * image.width + column] == TARGET)
                .map(|column| image.coordinates(column, row)[0])
                .collect();
            let nearest = columns.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!((nearest - distance).abs() <= 1.5 * track.bin_m, "{nearest} {distance}");
            // The brightest pixels are those of the target.
            let brightest = (0..image.width).filter(|column| !image.values[row * image.width + column].is_nan());
            let brightest = brightest
                .max_by(|a, b| image.values[row * image.width + a].total_cmp(&image.values[row * image.width + b]));
            assert_eq!(ids[row * image.width + brightest.unwrap()], TARGET);
        }
        let water = |image: &Image| image.layer(Field::CategoryId).unwrap()[row * image.width..][image.width / 2];
        assert_eq!((water(&slant), water(&ground)), (0, 1));
        // There is nothing past the last cell.
        assert!(ground.values[0].is_nan() && !slant.values[0].is_nan());
        assert_eq!(ground.index([-across, row as f64]).map(|pixel| pixel / ground.width), Some(row));
    }

    #[test]
    fn one_beam_runs_from_left_to_right() {
        let pings = pings(&SyntheticSidescan::default());
        let both = waterfall(&pings, ImageRange::Slant, None).unwrap();
        let port = waterfall(&pings, ImageRange::Slant, Some(0)).unwrap();
        assert_eq!((port.width * 2, port.height), (both.width, both.height));
        assert_eq!(port.values[3], both.values[both.width / 2 - 1 - 3]);
        let error = waterfall(&pings, ImageRange::Slant, Some(2)).unwrap_err().to_string();
        assert_eq!(error, "beam is 2; allowed: 0 to 1, the beams of this sonar");
    }
}
