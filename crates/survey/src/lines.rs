//! Where flight lines lie over an area.

use glam::DVec2;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Most lines: strips have 16-bit numbers.
pub(crate) const MOST_LINES: f64 = 65_535.0;

/// Number of strips `width_m` wide, `spacing_m` apart, over an area that is `across_m` wide.
pub(crate) fn count(across_m: f64, width_m: f64, spacing_m: f64) -> f64 {
    // An area as wide as the swath needs one, however the numbers are rounded.
    ((across_m - width_m) / spacing_m - 1e-9).ceil().max(0.0) + 1.0
}

/// Least and greatest extent of `corners` along a direction.
pub(crate) fn extent(corners: &[DVec2], along: DVec2) -> [f64; 2] {
    let values = corners.iter().map(|corner| corner.dot(along));
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// The direction along a side of the polygon in which it is narrowest, rad from x to y, 0 to pi: that with the fewest
/// lines.
pub(crate) fn narrowest(corners: &[DVec2]) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| *b - *a);
    let sides = sides.filter(|side| side.length() > 0.0).map(|side| side.to_angle().rem_euclid(0.5 * TAU));
    let width = |heading: f64| {
        let [low, high] = extent(corners, DVec2::from_angle(heading + FRAC_PI_2));
        high - low
    };
    // Of equal ones the first, however they are rounded.
    let narrower = |best: f64, other: f64| if width(other) < width(best) * (1.0 - 1e-9) { other } else { best };
    sides.reduce(narrower).unwrap_or(0.0)
}

/// Ends of lines in the order and direction in which they are flown, in the direction `heading`, rad from x to y, `count` of them, `spacing_m` apart around the middle of the area.
/// `beside` are the distances to the edges of the swath, to the right (negative) and to the left, m: a line is as long as
/// what its swath covers of the area, from `before` m before to `after` m after it.
pub(crate) fn over(
    corners: &[DVec2],
    heading: f64,
    (count, spacing_m): (u32, f64),
    beside: [f64; 2],
    [before, after]: [f64; 2],
) -> Vec<[DVec2; 2]> {
    let (along, left) = (DVec2::from_angle(heading), DVec2::from_angle(heading + FRAC_PI_2));
    let [low, high] = extent(corners, left);
    let mut ends = Vec::new();
    for index in 0..count {
        let back = index % 2 == 1;
        // Seen from the other direction, the swath has its left on the right.
        let beside = if back { [-beside[1], -beside[0]] } else { beside };
        let middle = 0.5 * (beside[0] + beside[1]);
        let across = 0.5 * (low + high) + spacing_m * (f64::from(index) - 0.5 * f64::from(count - 1)) - middle;
        let covered = clipped(corners, left, [across + beside[0], across + beside[1]]);
        let [from, to] = extent(&covered, along);
        if from > to {
            continue;
        }
        let place = |at: f64| left * across + along * at;
        ends.push(match back {
            false => [place(from - before), place(to + after)],
            true => [place(to + before), place(from - after)],
        });
    }
    ends
}

/// Corners of the part of a polygon that lies between two distances along a direction (Sutherland and Hodgman 1974).
fn clipped(corners: &[DVec2], along: DVec2, [low, high]: [f64; 2]) -> Vec<DVec2> {
    let cut = |corners: &[DVec2], inside: &dyn Fn(DVec2) -> f64| -> Vec<DVec2> {
        let mut kept = Vec::new();
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let (depth_a, depth_b) = (inside(*a), inside(*b));
            if depth_a >= 0.0 {
                kept.push(*a);
            }
            if (depth_a >= 0.0) != (depth_b >= 0.0) {
                kept.push(a.lerp(*b, depth_a / (depth_a - depth_b)));
            }
        }
        kept
    };
    let above = cut(corners, &|corner| corner.dot(along) - low);
    cut(&above, &|corner| high - corner.dot(along))
}

/// Whether `place` is inside of a polygon: a line from it to the right crosses its sides an odd number of times.
pub(crate) fn holds(corners: &[DVec2], place: DVec2) -> bool {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let crosses = |(a, b): &(&DVec2, &DVec2)| {
        (a.y > place.y) != (b.y > place.y) && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    sides.filter(crosses).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Check value 3: 5 km with strips of 1154.701 m that overlap by 30 % need six.
    #[test]
    fn strips_are_as_many_as_cover_the_area() {
        let width = 1154.701_f64;
        assert!((width * 0.7 - 808.290_4).abs() < 5e-4);
        assert_eq!(count(5000.0, width, width * 0.7), 6.0);
        assert_eq!(count(width, width, width * 0.7), 1.0);
        assert_eq!(count(10.0, width, width * 0.7), 1.0);
    }

    /// Every place of a polygon is covered, by the swath of a line that is there alongside.
    #[test]
    fn lines_cover_all_of_a_polygon() {
        let corners = [[0.0, 0.0], [400.0, 50.0], [300.0, 300.0], [180.0, 120.0], [-50.0, 260.0]].map(DVec2::from);
        for (heading, beside) in [(0.0, [-40.0, 40.0]), (0.7, [-40.0, 25.0]), (2.0, [-10.0, 60.0])] {
            let (width, left) = (beside[1] - beside[0], DVec2::from_angle(heading + FRAC_PI_2));
            let spacing = 0.8 * width;
            let [low, high] = extent(&corners, left);
            let count = count(high - low, width, spacing) as u32;
            let lines = over(&corners, heading, (count, spacing), beside, [0.0; 2]);
            for step in 0..90_000 {
                let place = DVec2::new(f64::from(step % 300) * 1.6 - 60.0, f64::from(step / 300) * 1.1 - 10.0);
                if !holds(&corners, place) {
                    continue;
                }
                let covers = |ends: &[DVec2; 2]| {
                    let (ahead, length) = ((ends[1] - ends[0]).normalize(), ends[0].distance(ends[1]));
                    let (along, across) = (ahead.dot(place - ends[0]), ahead.perp_dot(place - ends[0]));
                    (-1e-6..=length + 1e-6).contains(&along) && (beside[0] - 1e-6..=beside[1] + 1e-6).contains(&across)
                };
                assert!(lines.iter().any(covers), "{place} {heading}");
            }
        }
    }

    #[test]
    fn lines_run_along_the_narrowest_side() {
        let long = [[0.0, 0.0], [10.0, 0.0], [10.0, 100.0], [0.0, 100.0]].map(DVec2::from);
        assert!((narrowest(&long) - FRAC_PI_2).abs() < 1e-12);
        let turned = long.map(|corner| DVec2::from_angle(0.4).rotate(corner));
        assert!((narrowest(&turned) - FRAC_PI_2 - 0.4).abs() < 1e-12);
    }
}
