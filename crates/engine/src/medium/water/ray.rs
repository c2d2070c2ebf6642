//! A ray of sound in layered water, in its vertical plane.
//!
//! The ocean is stratified: in a slab sound speed is linear in depth, so a ray is a circular arc, or a straight line
//! without gradient, and `cos(grazing angle) / speed` is the same in all slabs (Snell). Slabs, arcs and the equations
//! below: Jensen, Kuperman, Porter, Schmidt, "Computational Ocean Acoustics", 2nd ed., chapter 3.

use super::Slab;
use echocast_kernels::water::{Arc, RayCourse, SHORT, Turn, differ, short_way, steep, transmittance};

/// A ray that rises above and falls below the axis of a duct by no more than this, m, is treated as running along it:
/// otherwise one that is level there would pass from slab to slab without progress.
const NARROW: f64 = 1e-6;

/// A ray in progress.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RefractedRay {
    /// Horizontal distance, m.
    pub distance: f64,
    /// Depth below the sea surface, m.
    pub depth: f64,
    /// Sine of the grazing angle, positive downwards.
    pub sine: f64,
    /// Cosine of the grazing angle over sound speed, s/m.
    pub snell: f64,
    /// Index of the slab.
    pub slab: usize,
    /// Sound speed here, m/s.
    pub speed: f64,
    /// Time since the start, s.
    pub time: f64,
    /// Path length since the start, m.
    pub path: f64,
    /// Whether it runs straight along the boundary of two slabs, where sound is slowest: both bend it back.
    pub level: bool,
    /// Loss by absorption and mirrors since the start, dB; excludes that at boundaries between slabs.
    pub absorbed: f64,
    /// Part of the energy transmitted by boundaries between slabs, 0 to 1.
    pub transmitted: f64,
    /// Integral of speed over the path, m^2/s: divided by the speed at the start it is the width of the tube
    /// perpendicular to the plane.
    pub speed_path: f64,
    /// Width of the tube within the vertical plane per radian at the start, m; negative beyond a caustic.
    pub tube: f64,
    /// Widening of the tube per m^2/s of `speed_path`, s/m: constant within a slab.
    pub widening: f64,
    /// Decrease of `snell` per radian that the start points further down, with its sign inverted by every reflection,
    /// s/m.
    pub turn: f64,
}

/// How a segment of a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// Within the slab.
    Inside,
    /// At its upper or lower boundary.
    Top,
    Bottom,
}

impl RefractedRay {
    /// A ray that starts at `depth` in `slabs[slab]`, with the sine and the cosine of its grazing angle, positive down.
    pub fn launch(depth: f64, [sine, cosine]: [f64; 2], slabs: &[Slab], slab: usize) -> RefractedRay {
        let speed = slabs[slab].speed_at(depth);
        RefractedRay {
            distance: 0.0,
            depth,
            sine,
            snell: cosine / speed,
            slab,
            speed,
            time: 0.0,
            path: 0.0,
            level: false,
            absorbed: 0.0,
            transmitted: 1.0,
            speed_path: 0.0,
            tube: 0.0,
            widening: 1.0 / speed,
            turn: sine / speed,
        }
    }

    /// Loss by absorption, boundaries between slabs and mirrors since the start, dB.
    pub fn loss(&self) -> f64 {
        self.absorbed - 10.0 * self.transmitted.max(1e-30).log10()
    }

    /// Adds a loss of `db`, as of mirrors; a negative value is a gain.
    pub fn lose(&mut self, db: f64) {
        self.absorbed += db;
    }

    /// Gradient of the speed on the path through `slab`, 1/s, positive down.
    pub fn gradient(&self, slab: &Slab) -> f64 {
        if self.level { 0.0 } else { slab.gradient }
    }

    /// The ray `length` m further along the arc within `slab`. Inlined to avoid the copy.
    #[inline]
    pub fn advanced(&self, slab: &Slab, length: f64) -> RefractedRay {
        let mut next = *self;
        let RefractedRay { depth, sine, snell, speed, .. } = *self;
        let (from, gradient) = (RayCourse { depth, sine, snell, speed }, self.gradient(slab));
        let half = 0.5 * gradient * snell * length;
        let arc = Arc::bent(&from, gradient, length, Turn::of(half), Turn::of(0.5 * half));
        let is_short = half.abs() <= 0.02;
        let time = if is_short && (arc.speed - speed).abs() <= SHORT * speed {
            arc.time(&from, length)
        } else {
            // The difference of artanh(sine) = ln((1 + sine) / cosine), which is odd.
            let [start, end] = [(sine, speed), (arc.sine, arc.speed)].map(|(sine, speed)| (1.0 + sine.abs()) / speed);
            let over_vertex = sine * arc.sine < 0.0;
            let span = if over_vertex { start * end / (snell * snell) } else { start / end };
            (span.ln() / gradient).abs()
        };
        let speed_path = if is_short { arc.speed_path(&from, length) } else { arc.level / snell };
        next.distance += arc.level;
        (next.depth, next.sine, next.speed) = (arc.depth, arc.sine, arc.speed);
        next.time += time;
        next.path += length;
        next.absorbed += arc.absorbed(&from, slab, length);
        next.speed_path += speed_path;
        next.tube += self.widening * speed_path;
        next
    }

    /// Length of the arc to where it leaves `slab`, and at which boundary.
    #[inline]
    pub fn exit(&self, slab: &Slab) -> (f64, End) {
        let to = |end: End| match end {
            End::Bottom => slab.bottom - self.depth,
            _ => slab.top - self.depth,
        };
        let ahead = if self.sine > 0.0 { End::Bottom } else { End::Top };
        if self.gradient(slab) == 0.0 {
            return if self.sine == 0.0 {
                (f64::INFINITY, End::Inside)
            } else {
                ((to(ahead) / self.sine).max(0.0), ahead)
            };
        }
        // Rays bend away from the side where sound is faster.
        let faster = if slab.gradient > 0.0 { End::Bottom } else { End::Top };
        let slower = if slab.gradient > 0.0 { End::Top } else { End::Bottom };
        let speed_at = |end: End| slab.speed_at(if end == End::Bottom { slab.bottom } else { slab.top });
        let towards = self.sine * slab.gradient.signum();
        let curvature = slab.gradient.abs() * self.snell;
        let end = if towards > 0.0 && self.snell * speed_at(faster) < 1.0 { faster } else { slower };
        let cosine = (self.snell * speed_at(end)).min(1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        if towards > 0.0 && end == slower {
            // Over its vertex and back.
            let angle = towards.atan2(self.snell * self.speed) + sine.atan2(cosine);
            return (angle / curvature, end);
        }
        let sum = self.sine.abs() + sine;
        let fall = to(end).abs();
        if fall == 0.0 {
            return (0.0, end);
        }
        let short = short_way(fall, [self.sine.abs(), sine], curvature);
        let length = if short.is_finite() { short } else { 2.0 * (curvature * fall / sum).atan() / curvature };
        (length, end)
    }

    /// Passes into the next slab, or back into this one where the boundary reflects everything. Returns the part of the
    /// energy transmitted, 0 to 1; `None`: the water is the same on both sides.
    pub fn cross(&mut self, slabs: &[Slab], end: End) -> Option<f64> {
        let here = &slabs[self.slab];
        let (there, depth) = match end {
            End::Bottom => (self.slab + 1, here.bottom),
            _ => (self.slab - 1, here.top),
        };
        self.depth = depth;
        let next = &slabs[there];
        let (from, to) = (here.speed_at(depth), next.speed_at(depth));
        let down = if end == End::Bottom { 1.0 } else { -1.0 };
        // At a vertex its sign may be wrong.
        self.sine = down * self.sine.abs();
        let mut transmitted = None;
        if differ(from, to) || differ(here.density, next.density) {
            let cosine = self.snell * to;
            if cosine >= 1.0 {
                self.speed = from;
                self.mirror(here);
                return Some(0.0);
            }
            let (sine, sine_on) = (self.sine.abs().max(1e-9), (1.0 - cosine * cosine).sqrt().max(1e-9));
            let part = transmittance([here.density * from, next.density * to], [sine, sine_on]);
            self.transmitted *= part;
            self.tube *= sine_on / sine;
            self.sine = down * sine_on;
            transmitted = Some(part);
        } else if down * next.gradient > 0.0 && down * here.gradient < 0.0 {
            // Sound is slowest here. A ray gets this far before it is level and turns back: sine^2 / (2 curvature).
            let bend = next.gradient.abs().min(here.gradient.abs()) * self.snell;
            let reach = self.sine * self.sine / (2.0 * bend);
            if reach < NARROW {
                (self.level, self.sine, self.snell) = (true, 0.0, 1.0 / to);
            }
        }
        self.speed = to;
        self.slab = there;
        if transmitted.is_some() {
            self.widen(next);
        } else if !self.level {
            // As in `widen`, but exact for level rays too, for which `turn` is zero.
            self.widening += (here.gradient - next.gradient) * self.snell * self.snell * self.tube / steep(self.sine);
        }
        transmitted
    }

    /// Reflection by a horizontal boundary of the slab.
    pub fn mirror(&mut self, slab: &Slab) {
        self.sine = -self.sine;
        self.turn = -self.turn;
        self.widen(slab);
    }

    /// Sets how the tube widens from here on: within a slab its width over the sine of the ray is the derivative of the
    /// horizontal distance by `snell` at this depth, times `turn`; across slabs that derivative is continuous.
    fn widen(&mut self, slab: &Slab) {
        self.widening = (self.turn - slab.gradient * self.snell * self.snell * self.tube) / steep(self.sine);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slab(top: f64, bottom: f64, speed: f64, gradient: f64) -> Slab {
        Slab { top, bottom, speed, gradient, density: 1025.0, absorption: 0.0, absorption_slope: 0.0 }
    }

    /// A ray that arrives level, by rounding even from the wrong side, stays on its own side.
    #[test]
    fn total_reflection_returns_rays() {
        let slabs = [slab(0.0, 10.0, 1490.0, 1.0), slab(10.0, 20.0, 1600.0, 1.0)];
        for sine in [1e-18, -1e-18] {
            let mut ray = RefractedRay::launch(10.0, [sine, 1.0], &slabs, 0);
            assert_eq!(ray.cross(&slabs, End::Bottom), Some(0.0));
            assert_eq!((ray.slab, ray.sine.signum(), ray.speed), (0, -1.0, 1500.0));
        }
        let slabs = [slab(0.0, 10.0, 1600.0, 0.0), slab(10.0, 20.0, 1500.0, -1.0)];
        for sine in [1e-18, -1e-18] {
            let mut ray = RefractedRay::launch(10.0, [sine, 1.0], &slabs, 1);
            assert_eq!(ray.cross(&slabs, End::Top), Some(0.0));
            assert_eq!((ray.slab, ray.sine.signum(), ray.speed), (1, 1.0, 1500.0));
        }
    }

    /// Where sound is slowest a level ray is held from both sides, and one that is nearly level oscillates about it.
    #[test]
    fn a_duct_holds_rays_on_its_axis() {
        let slabs = [slab(0.0, 100.0, 1500.0, -0.2), slab(100.0, 200.0, 1480.0, 0.1)];
        for (sine, depth) in [(0.0, 100.0), (1e-9, 100.0), (-1e-9, 100.0), (0.0, 100.0 - 1e-9), (0.0, 100.0 + 1e-9)] {
            let mut ray = RefractedRay::launch(depth, [sine, 1.0], &slabs, usize::from(depth >= 100.0));
            for _ in 0..4 {
                let here = &slabs[ray.slab];
                let (length, end) = ray.exit(here);
                if end == End::Inside {
                    break;
                }
                ray = ray.advanced(here, length);
                ray.cross(&slabs, end);
            }
            assert!(ray.level && ray.path < 0.2, "{sine} {depth}: {ray:?}");
            let far = ray.advanced(&slabs[ray.slab], 1e5);
            assert!((far.depth - 100.0).abs() < 2e-9 && (far.time - far.path / 1480.0).abs() < 1e-9);
        }
        let mut ray = RefractedRay::launch(100.0, [0.01, (1f64 - 1e-4).sqrt()], &slabs, 1);
        for _ in 0..10 {
            let here = &slabs[ray.slab];
            let (length, end) = ray.exit(here);
            assert!(length > 100.0);
            ray = ray.advanced(here, length);
            ray.cross(&slabs, end);
            assert!((ray.sine.abs() - 0.01).abs() < 1e-12 && !ray.level);
        }
    }
}
