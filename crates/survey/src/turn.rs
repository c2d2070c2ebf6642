//! Paths of straight lines and arcs, and the shortest of them from one line to the next.

use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// A path on the map: straight lines and arcs, each going on where the last one ends, in the same direction.
#[derive(Clone, Debug)]
pub(crate) struct TrackPath {
    stretches: Vec<TrackStretch>,
    length: f64,
}

/// A part of a path with one curvature.
#[derive(Clone, Copy, Debug)]
struct TrackStretch {
    /// Where it begins along the path, m.
    at: f64,
    place: DVec2,
    /// Direction at its beginning, rad from x to y.
    heading: f64,
    /// 1/m, positive to the left.
    curvature: f64,
}

impl TrackStretch {
    /// Place after `along` m.
    fn place(&self, along: f64) -> DVec2 {
        let (heading, curvature) = (self.heading, self.curvature);
        if curvature == 0.0 {
            return self.place + along * DVec2::from_angle(heading);
        }
        let turned = heading + curvature * along;
        self.place + DVec2::new(turned.sin() - heading.sin(), heading.cos() - turned.cos()) / curvature
    }

    fn heading(&self, along: f64) -> f64 {
        self.heading + self.curvature * along
    }

    /// Integral of the place, less `from`, over the first `along` m.
    fn integral(&self, along: f64, from: DVec2) -> DVec2 {
        let (heading, curvature) = (self.heading, self.curvature);
        let start = (self.place - from) * along;
        if curvature == 0.0 {
            return start + 0.5 * along * along * DVec2::from_angle(heading);
        }
        let turned = heading + curvature * along;
        let x = (heading.cos() - turned.cos()) / curvature - along * heading.sin();
        let y = (heading.sin() - turned.sin()) / curvature + along * heading.cos();
        start + DVec2::new(x, y) / curvature
    }
}

impl TrackPath {
    /// A path that begins at `place` in the direction `heading`, rad from x to y, without length yet.
    pub fn new(place: DVec2, heading: f64) -> TrackPath {
        TrackPath { stretches: vec![TrackStretch { at: 0.0, place, heading, curvature: 0.0 }], length: 0.0 }
    }

    /// Its length, m.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Place and direction at its end.
    pub fn end(&self) -> (DVec2, f64) {
        (self.place(self.length), self.heading(self.length))
    }

    /// Adds `length` m of a curvature, 1/m.
    pub fn add(&mut self, curvature: f64, length: f64) {
        let (place, heading) = self.end();
        if length > 0.0 {
            self.stretches.push(TrackStretch { at: self.length, place, heading, curvature });
            self.length += length;
        }
    }

    /// Adds a straight line to `place`, which lies ahead.
    pub fn straight_to(&mut self, place: DVec2) {
        let (from, _) = self.end();
        self.stretches.push(TrackStretch {
            at: self.length,
            place: from,
            heading: (place - from).to_angle(),
            curvature: 0.0,
        });
        self.length += from.distance(place);
    }

    /// Adds the shortest path to `place`, where it has the direction `heading`, with turns of `radius` m.
    pub fn turn_to(&mut self, place: DVec2, heading: f64, radius: f64) {
        let shortest = shortest(self.end(), (place, heading), radius);
        shortest.into_iter().for_each(|(curvature, length)| self.add(curvature, length));
    }

    /// Adds `other`, which begins where this one ends.
    pub fn append(&mut self, other: &TrackPath) {
        self.stretches
            .extend(other.stretches.iter().map(|stretch| TrackStretch { at: self.length + stretch.at, ..*stretch }));
        self.length += other.length;
    }

    /// Whether it is one straight line.
    pub fn is_straight(&self) -> bool {
        self.stretches.iter().all(|stretch| stretch.curvature == 0.0) && self.stretches.len() <= 2
    }

    fn stretch(&self, along: f64) -> &TrackStretch {
        let after = self.stretches.partition_point(|stretch| stretch.at <= along);
        &self.stretches[after.saturating_sub(1)]
    }

    /// Place after `along` m; before its beginning and after its end it goes straight on.
    pub fn place(&self, along: f64) -> DVec2 {
        if along > self.length {
            let (place, heading) = (self.place(self.length), self.heading(self.length));
            return place + (along - self.length) * DVec2::from_angle(heading);
        }
        let stretch = self.stretch(along);
        stretch.place(along - stretch.at)
    }

    /// Direction after `along` m, rad from x to y.
    pub fn heading(&self, along: f64) -> f64 {
        let along = along.min(self.length);
        let stretch = self.stretch(along);
        stretch.heading(along - stretch.at)
    }

    /// Mean place over the `width` m around `along`, its derivative and its second derivative by the way: a path whose
    /// curvature is continuous, and that of the path itself where that is straight.
    pub fn smoothed(&self, along: f64, width: f64) -> [DVec2; 3] {
        let (from, to) = (along - 0.5 * width, along + 0.5 * width);
        let near = self.place(along);
        let (mut at, mut sum) = (from, DVec2::ZERO);
        let mut index = self.stretches.partition_point(|stretch| stretch.at <= from).saturating_sub(1);
        while at < to {
            let stretch = &self.stretches[index];
            let end = self.stretches.get(index + 1).map_or(self.length.max(at), |next| next.at).min(to);
            if end > at {
                sum += stretch.integral(end - stretch.at, near) - stretch.integral(at - stretch.at, near);
                at = end;
            }
            if index + 1 == self.stretches.len() {
                break;
            }
            index += 1;
        }
        if at < to {
            // Straight on from the end.
            let [a, b] = [at, to].map(|along| self.place(along) - near);
            sum += 0.5 * (to - at) * (a + b);
        }
        let direction = |along: f64| DVec2::from_angle(self.heading(along));
        [near + sum / width, (self.place(to) - self.place(from)) / width, (direction(to) - direction(from)) / width]
    }
}

/// Curvatures and lengths of the shortest path between two places with directions, with turns of `radius` m: two turns
/// with a straight line or a third turn between them (Dubins 1957; closed forms of Shkel and Lumelsky 2001).
fn shortest((from, start): (DVec2, f64), (to, end): (DVec2, f64), radius: f64) -> Vec<(f64, f64)> {
    let turned = |angle: f64| angle.rem_euclid(TAU);
    let way = (to - from) / radius;
    let (d, line) = (way.length(), way.to_angle());
    let (a, b) = (turned(start - line), turned(end - line));
    let ((sin_a, cos_a), (sin_b, cos_b), cos_ab) = (a.sin_cos(), b.sin_cos(), (a - b).cos());
    let (left, right) = (1.0 / radius, -1.0 / radius);
    let mut words: Vec<[(f64, f64); 3]> = Vec::new();
    // Two turns to one side, then two to different sides; lengths in radii.
    let square = 2.0 + d * d - 2.0 * cos_ab;
    let straight = square + 2.0 * d * (sin_a - sin_b);
    if straight >= 0.0 {
        let middle = (cos_b - cos_a).atan2(d + sin_a - sin_b);
        words.push([(left, turned(middle - a)), (0.0, straight.sqrt()), (left, turned(b - middle))]);
    }
    let straight = square + 2.0 * d * (sin_b - sin_a);
    if straight >= 0.0 {
        let middle = (cos_a - cos_b).atan2(d - sin_a + sin_b);
        words.push([(right, turned(a - middle)), (0.0, straight.sqrt()), (right, turned(middle - b))]);
    }
    let square = d * d - 2.0 + 2.0 * cos_ab;
    let straight = square + 2.0 * d * (sin_a + sin_b);
    if straight >= 0.0 {
        let p = straight.sqrt();
        let middle = (-cos_a - cos_b).atan2(d + sin_a + sin_b) - (-2.0_f64).atan2(p);
        words.push([(left, turned(middle - a)), (0.0, p), (right, turned(middle - b))]);
    }
    let straight = square - 2.0 * d * (sin_a + sin_b);
    if straight >= 0.0 {
        let p = straight.sqrt();
        let middle = (cos_a + cos_b).atan2(d - sin_a - sin_b) - 2.0_f64.atan2(p);
        words.push([(right, turned(a - middle)), (0.0, p), (left, turned(b - middle))]);
    }
    // Three turns.
    let part = (6.0 - d * d + 2.0 * cos_ab + 2.0 * d * (sin_a - sin_b)) / 8.0;
    if part.abs() <= 1.0 {
        let p = turned(TAU - part.acos());
        let t = turned(a - (cos_a - cos_b).atan2(d - sin_a + sin_b) + 0.5 * p);
        words.push([(right, t), (left, p), (right, turned(a - b - t + p))]);
    }
    let part = (6.0 - d * d + 2.0 * cos_ab + 2.0 * d * (sin_b - sin_a)) / 8.0;
    if part.abs() <= 1.0 {
        let p = turned(TAU - part.acos());
        let t = turned(-a + (cos_b - cos_a).atan2(d + sin_a - sin_b) + 0.5 * p);
        words.push([(left, t), (right, p), (left, turned(b - a - t + p))]);
    }
    // A whole turn that is only a rounding error is none.
    let length = |word: &[(f64, f64); 3]| word.iter().map(|(_, length)| length).sum::<f64>();
    let words = words.into_iter().map(|word| {
        word.map(|(curvature, length)| (curvature, if curvature != 0.0 && length > TAU - 1e-9 { 0.0 } else { length }))
    });
    let reaches = |word: &[(f64, f64); 3]| {
        let mut path = TrackPath::new(from, start);
        word.iter().for_each(|(curvature, length)| path.add(*curvature, length * radius));
        let (place, heading) = path.end();
        let off = (heading - end + PI).rem_euclid(TAU) - PI;
        place.distance(to) < 1e-6 * (1.0 + d) * radius && off.abs() < 1e-6
    };
    let best = words.filter(reaches).min_by(|a, b| length(a).total_cmp(&length(b)));
    best.into_iter().flatten().map(|(curvature, length)| (curvature, length * radius)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From any pose to any other, the path arrives, is as long as it says, and no shorter than the way.
    #[test]
    fn turns_arrive() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..2000 {
            let mut path = TrackPath::new(DVec2::new(3.0, -2.0), TAU * next());
            let (to, heading) = (DVec2::new(100.0 * next() - 50.0, 100.0 * next() - 50.0), TAU * next());
            path.turn_to(to, heading, 10.0);
            let (place, direction) = path.end();
            assert!(place.distance(to) < 1e-4, "{place} {to}");
            assert!(((direction - heading + PI).rem_euclid(TAU) - PI).abs() < 1e-5);
            assert!(path.length() >= to.distance(DVec2::new(3.0, -2.0)) - 1e-6);
        }
    }

    /// Lines that are closer than two radii need three turns, as around a light bulb; its outer arcs are as long as the
    /// triangle of the three centres says.
    #[test]
    fn close_lines_need_three_turns() {
        let mut path = TrackPath::new(DVec2::ZERO, 0.0);
        path.turn_to(DVec2::new(0.0, 10.0), PI, 20.0);
        // Centres of the outer circles are 2 (20) + 10 = 50 m apart; the angle at each is acos(25 / 40).
        let outer = (25.0_f64 / 40.0).acos();
        let expected = 20.0 * (2.0 * outer + PI + 2.0 * outer);
        assert!((path.length() - expected).abs() < 1e-9, "{} {expected}", path.length());
        // Lines two radii apart need a half circle.
        let mut path = TrackPath::new(DVec2::ZERO, 0.0);
        path.turn_to(DVec2::new(0.0, 40.0), PI, 20.0);
        assert!((path.length() - 20.0 * PI).abs() < 1e-9);
    }

    /// The mean of places is that of many of them; where the path is straight it is the path.
    #[test]
    fn smoothed_paths_are_means() {
        let mut path = TrackPath::new(DVec2::new(1e5, 2e5), 0.3);
        path.add(0.0, 50.0);
        path.add(0.05, 40.0);
        path.add(-0.02, 30.0);
        path.add(0.0, 50.0);
        let width = 20.0;
        for step in 0..340 {
            let along = 0.5 * f64::from(step);
            let [place, first, second] = path.smoothed(along, width);
            let count = 2000;
            let many = (0..count).map(|k| path.place(along + width * ((f64::from(k) + 0.5) / f64::from(count) - 0.5)));
            let mean = many.sum::<DVec2>() / f64::from(count);
            assert!(place.distance(mean) < 1e-4, "{along}: {place} {mean}");
            // Derivatives are differences.
            let [after, ..] = path.smoothed(along + 1e-3, width);
            let [before, ..] = path.smoothed(along - 1e-3, width);
            assert!(((after - before) / 2e-3).distance(first) < 1e-4);
            assert!(second.length() <= 0.05 + 1e-12);
        }
        assert!(path.smoothed(30.0, width)[0].distance(path.place(30.0)) < 1e-9);
    }
}
