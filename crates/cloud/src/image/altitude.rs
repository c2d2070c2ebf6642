//! The height of the sonar over the bed, from the first return.

use crate::cells::SonarView;
use crate::{Ping, Pings};
use ground::error::{Error, Result};

/// The level of the bed is at most this far below the strongest twentieth of a ping, dB; the water surface and volume
/// backscatter are weaker.
const FAINTER: f32 = 25.0;
/// Number of pings before and after a ping whose first returns also count for it.
const NEIGHBOURS: usize = 3;
/// Fraction of the cells after the first return that is above the threshold. Fish and noise are shorter.
const FILLED: f64 = 0.6;
/// Cells checked for that: all cells of a beam divided by the first, but at least the second.
const WINDOW: (usize, usize) = (16, 8);

/// Height of the sonar over the bed at each ping, m, as side-scan software tracks it: the range at which the returns of
/// the bed begin, which stay above the threshold and near the strongest levels of the ping; the median over both sides
/// and seven pings. Pings without a first return near them take the height of the nearest that has one.
///
/// Where the sonar is nearer to the water surface than to the bed, and receives it at the level of the bed, this is the
/// distance to the surface.
///
/// # Errors
/// Pings that do not fit together; none with a first return.
pub fn altitudes(pings: &Pings) -> Result<Vec<f64>> {
    let layout = pings.check()?;
    let candidates: Vec<Vec<f64>> = pings
        .pings
        .iter()
        .map(|ping| {
            let mut found: Vec<f64> = (0..layout.beams()).filter_map(|beam| first_return(ping, beam)).collect();
            // Both sides see the same bed; of adjacent beams only the one that points down sees it that near.
            if layout.view != SonarView::Sidescan {
                found = found.into_iter().reduce(f64::min).into_iter().collect();
            }
            found
        })
        .collect();
    let tracked: Vec<Option<f64>> = (0..candidates.len())
        .map(|ping| {
            let near = ping.saturating_sub(NEIGHBOURS)..(ping + NEIGHBOURS + 1).min(candidates.len());
            median(candidates[near].iter().flatten().copied().collect())
        })
        .collect();
    let known: Vec<usize> = (0..tracked.len()).filter(|&ping| tracked[ping].is_some()).collect();
    if known.is_empty() {
        return Err(Error::invalid(
            "ground range",
            "requested for pings without a first return from the bed above the threshold",
            "slant range for such pings",
        ));
    }
    Ok((0..tracked.len())
        .map(|ping| {
            let after = known.partition_point(|&other| other < ping);
            let nearest = known[after.saturating_sub(1)..(after + 1).min(known.len())]
                .iter()
                .min_by_key(|other| other.abs_diff(ping))
                .and_then(|&other| tracked[other]);
            nearest.unwrap_or(f64::NAN)
        })
        .collect())
}

/// Slant range, m, at which the returns of the bed begin in a beam.
fn first_return(ping: &Ping, beam: usize) -> Option<f64> {
    let layout = &ping.layout;
    let levels = ping.levels(beam);
    let mut strong = levels.to_vec();
    let twentieth = strong.len() * 19 / 20;
    if strong.is_empty() {
        return None;
    }
    let strong = *strong.select_nth_unstable_by(twentieth, f32::total_cmp).1 - FAINTER;
    let above: Vec<bool> =
        levels.iter().zip(&layout.threshold_db).map(|(level, least)| *level >= least.max(strong)).collect();
    let window = (above.len() / WINDOW.0).max(WINDOW.1);
    let dense = |from: usize, length: usize, part: f64| {
        let cells = &above[from..(from + length).min(above.len())];
        let reached = cells.iter().filter(|&&is| is).count();
        // The end of the record may shorten the window, but not to nothing.
        2 * cells.len() >= length && reached as f64 >= part * cells.len() as f64
    };
    let start = (0..above.len()).find(|&bin| above[bin] && dense(bin, window, FILLED))?;
    // A lone noisy cell just before the bed is not its beginning.
    let bin =
        (start..(start + window).min(above.len())).find(|&bin| above[bin] && dense(bin, 4, 0.75)).unwrap_or(start);
    Some(layout.range(bin))
}

/// The median of `values`; for an even number the mean of the middle two.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len();
    (count > 0).then(|| values[(count - 1) / 2].midpoint(values[count / 2]))
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{SyntheticSidescan, pings};
    use super::*;

    #[test]
    fn the_bed_is_found_under_fish_and_noise() {
        let track = SyntheticSidescan { pings: 30, altitude: 8.0, ..SyntheticSidescan::default() };
        let mut pings = pings(&track);
        for ping in &mut pings.pings {
            // A fish of 0.4 m at 4 m to port, and a spike just before the bed on both sides.
            let bins = track.bins;
            ping.cells.intensity[80..88].fill(150.0);
            for beam in 0..2 {
                ping.cells.intensity[beam * bins + 155] = 150.0;
            }
        }
        // One side of a ping receives nothing, another ping receives a school of fish.
        pings.pings[10].cells.intensity[..track.bins].fill(0.0);
        pings.pings[20].cells.intensity[50..track.bins].fill(150.0);
        for (ping, altitude) in altitudes(&pings).unwrap().into_iter().enumerate() {
            assert!((altitude - 8.0).abs() <= track.bin_m, "{ping}: {altitude}");
        }
    }

    #[test]
    fn pings_without_a_return_take_the_height_of_the_nearest() {
        let track = SyntheticSidescan { pings: 20, altitude: 8.0, ..SyntheticSidescan::default() };
        let mut mute = pings(&track);
        for ping in &mut mute.pings[5..] {
            ping.cells.intensity.fill(0.0);
        }
        let found = altitudes(&mute).unwrap();
        assert!(found.iter().all(|altitude| (altitude - 8.0).abs() <= track.bin_m), "{found:?}");
        for ping in &mut mute.pings {
            ping.cells.intensity.fill(0.0);
        }
        let error = altitudes(&mute).unwrap_err().to_string();
        assert!(error.contains("slant range"), "{error}");
    }
}
