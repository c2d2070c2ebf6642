//! Physical optics of flat facets: Kirchhoff's integral over a triangle between a source and an observer, both at any
//! distance.
//!
//! A wave of a point source, `e^(-jkr) / r`, reflected by a flat facet with a reflection coefficient of 1, arrives at an
//! observer as `U = (jk / 2 pi) integral (cos a + cos b) / 2 e^(-jk (r + s)) / (r s) dA` [1/m], `r` and `s` being the
//! distances from a place on the facet to source and observer, `a` and `b` the angles there to its normal (Born and Wolf,
//! Principles of Optics, 8.3.2). The radar cross-section of a facet with source and observer at the distance `R` is
//! `4 pi R^4 |U|^2`, and the received amplitude `sqrt(Pt Gt Gr) lambda / (4 pi) U`.

use glam::DVec3;
use num_complex::Complex64;
use std::f64::consts::PI;

/// A source and an observer.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    /// Place of the source, or of its mirror image, m.
    pub source: DVec3,
    /// Likewise of the observer.
    pub observer: DVec3,
}

/// Greatest deviation of the phase over a facet from a linear one for [`Ends::facet`] to hold, rad.
const STRAIGHT: f64 = 0.05;

/// Likewise along a piece of an edge, where the deviation is taken into account to first order.
const STRAIGHT_PIECE: f64 = 0.3;

/// Shortest pieces of an edge, per [`STRAIGHT_PIECE`]'s: what one turns by is at its phase to a microradian.
const NEAREST: f64 = 7e-4;

impl Ends {
    /// Length of the path by way of `place`, m.
    pub fn length(&self, place: DVec3) -> f64 {
        (place - self.source).length() + (place - self.observer).length()
    }

    /// Second derivative of that length for steps across the path, at most, 1/m.
    fn curvature(&self, place: DVec3) -> f64 {
        1.0 / (place - self.source).length() + 1.0 / (place - self.observer).length()
    }

    /// Radius of the first Fresnel zone at `place` for the wave number `k`, rad/m: m.
    pub fn fresnel(&self, place: DVec3, k: f64) -> f64 {
        (2.0 * PI / (k * self.curvature(place))).sqrt()
    }

    /// Kirchhoff's integral over a triangle, 1/m, for a wave number `k`, rad/m; 0 if source and observer are on different
    /// sides of it.
    pub fn facet(&self, corners: [DVec3; 3], k: f64) -> Complex64 {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let double = normal.length();
        let middle = (a + b + c) / 3.0;
        let [to_source, to_observer] = [self.source - middle, self.observer - middle];
        let [r, s] = [to_source.length(), to_observer.length()];
        let [up, down] = [normal.dot(to_source), normal.dot(to_observer)];
        if double == 0.0 || r == 0.0 || s == 0.0 || up * down <= 0.0 {
            return Complex64::ZERO;
        }
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        let bend = 0.125 * k * longest * (1.0 / r + 1.0 / s);
        if bend > STRAIGHT {
            return self.outline(corners, k);
        }
        let obliquity = 0.5 * (up / r + down / s).abs() / double;
        let lengths = corners.map(|corner| self.length(corner));
        let [x, y] = [-k * (lengths[1] - lengths[0]), -k * (lengths[2] - lengths[0])];
        let integral = double * linear_phase(x, y) * Complex64::cis(-k * lengths[0]);
        Complex64::new(0.0, k / (2.0 * PI) * obliquity / (r * s)) * integral
    }

    /// At most the magnitude of [`Ends::facet`], without its phases: all in phase, or what its edges return at most
    /// (Gordon 1975, IEEE Trans. AP-23, 590), and no more than twice a mirror.
    pub fn bound(&self, [a, b, c]: [DVec3; 3], k: f64) -> f64 {
        let normal = (b - a).cross(c - a);
        let double = normal.length();
        let middle = (a + b + c) / 3.0;
        let [to_source, to_observer] = [self.source - middle, self.observer - middle];
        let [r, s] = [to_source.length(), to_observer.length()];
        let half = to_source / r + to_observer / s;
        let obliquity = 0.5 * half.dot(normal).abs() / double;
        let tilt = (half.length_squared() - 4.0 * obliquity * obliquity).max(0.0).sqrt();
        let edges = (b - a).length() + (c - b).length() + (a - c).length();
        let area = (0.5 * double).min(edges / (k * tilt).max(f64::MIN_POSITIVE));
        (k / (2.0 * PI) * obliquity * area / (r * s)).min(2.0 / (r + s))
    }

    /// At most the magnitude of [`Ends::facet`], as [`Ends::bound`], but closer for facets that are wide: edges return most
    /// from where the phase along them is stationary, or else from where it changes least.
    pub fn edge_bound(&self, corners: [DVec3; 3], k: f64) -> f64 {
        let [a, b, c] = corners;
        let Some(frame) = OutlineFrame::new(self, corners) else { return 0.0 };
        let (mirror, scale) = (1.0 / frame.distance, 1.0 / (4.0 * PI * frame.distance));
        let mut sides = [0.0; 3];
        let mut sum = 0.0;
        for (number, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
            let [x, y] = frame.offset(from);
            let [u, v] = frame.offset(to);
            let (across, along) = (x * v - y * u, (u - x).hypot(v - y));
            sides[number] = across;
            if along == 0.0 {
                continue;
            }
            // Nearest to the axis, where the azimuth turns fastest.
            let part = (-(x * (u - x) + y * (v - y)) / (along * along)).clamp(0.0, 1.0);
            let nearest = from.lerp(to, part);
            let [p, q] = [x + (u - x) * part, y + (v - y) * part];
            let length = (to - from).length();
            let turning = across.abs() / (p * p + q * q).max(f64::MIN_POSITIVE) / length;
            let obliquity = [from, nearest, to].map(|place| frame.obliquity(self, place));
            let weight = turning * obliquity.into_iter().fold(0.0, f64::max);
            let direction = (to - from) / length;
            let [first, last] = [self.slope(from, direction), self.slope(to, direction)];
            let extent = if first * last <= 0.0 {
                let place = from + direction * self.stationary(from, direction);
                let bend = self.bend(place, direction);
                // Partial integrals overshoot.
                1.4 * (2.0 * PI / (k * bend).max(f64::MIN_POSITIVE)).sqrt()
            } else {
                2.0 / (k * first.abs().min(last.abs()))
            };
            // No edge turns by more than half the way around.
            sum += (weight * extent.min(length)).min(2.0 * PI);
        }
        let around = sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0);
        scale * sum + if around { mirror } else { 0.0 }
    }

    /// Where on a line from `from` along a unit vector the length of the path is stationary, m: as unfolding shows, between
    /// the feet of both ends, in the ratio of their distances.
    fn stationary(&self, from: DVec3, along: DVec3) -> f64 {
        let [(x, h), (y, i)] = [self.source, self.observer].map(|end| {
            let foot = along.dot(end - from);
            (foot, (end - from - along * foot).length())
        });
        if h + i > 0.0 { (x * i + y * h) / (h + i) } else { 0.5 * (x + y) }
    }

    /// Derivative of the length of the path for steps along `direction` from `place`.
    fn slope(&self, place: DVec3, direction: DVec3) -> f64 {
        let [r, s] = [place - self.source, place - self.observer];
        direction.dot(r) / r.length() + direction.dot(s) / s.length()
    }

    /// Second derivative likewise, 1/m.
    fn bend(&self, place: DVec3, direction: DVec3) -> f64 {
        let one = |from: DVec3| {
            let (length, along) = (from.length(), direction.dot(from));
            (1.0 - (along / length).powi(2)) / length
        };
        one(place - self.source) + one(place - self.observer)
    }

    /// [`Ends::facet`] as a sum along the edges: exact at any size and distance.
    ///
    /// The integral over a plane is that of a line around it (Maggi 1888, Rubinowicz 1917; Born and Wolf 8.9). With the
    /// observer mirrored in the plane, at a distance `d` from the source, the azimuth `p` of a place on the edge about the
    /// line through both and the angle `q` between the directions from there to both,
    /// `U = 1 / (4 pi d) integral (2 e^(-jkd) - (1 - cos q) e^(-jk (r + s))) dp`, which is regular where this line crosses
    /// an edge.
    fn outline(&self, corners: [DVec3; 3], k: f64) -> Complex64 {
        let [mut direct, mut edges] = [Complex64::ZERO; 2];
        self.each_piece(corners, [false; 3], k, f64::INFINITY, &mut |part| match part {
            OutlinePart::Mirror(value, _) => direct += value,
            OutlinePart::Edge(value, _) => edges += value,
        });
        direct + edges
    }

    /// Passes the parts of [`Ends::facet`] to `visit`: that of the mirror image, which has the fraction of a full turn
    /// that the triangle takes around the specular point, and those of the edges, piece by piece, each of which spans at
    /// most `span` m of path length. Edges that are `inner`, from the first, second and third corner on, are left out: those
    /// between triangles of one plane, whose waves cancel.
    pub fn each_piece(
        &self,
        corners: [DVec3; 3],
        inner: [bool; 3],
        k: f64,
        span: f64,
        visit: &mut dyn FnMut(OutlinePart),
    ) {
        let [a, b, c] = corners;
        let Some(frame) = OutlineFrame::new(self, corners) else { return };
        let (distance, specular) = (frame.distance, frame.specular);
        let scale = 1.0 / (4.0 * PI * distance);
        let edge = EdgeFrame { of: self, k, frame: &frame, scale };
        let mut whole = 0.0;
        // What each corner contributes: where edges end, waves of both start.
        let mut ends = [Complex64::ZERO; 3];
        for (number, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
            let along = to - from;
            let length = along.length();
            if length == 0.0 {
                continue;
            }
            if inner[number] {
                whole += frame.inner_angle(from, to);
                continue;
            }
            let along = along / length;
            let nearest = self.stationary(from, along).clamp(0.0, length);
            // Pieces around the place of stationary phase; away from it, waves leave from the ends only.
            let fresnel = self.fresnel(from + along * nearest, k);
            let [near, far] = [(nearest - NEAR_EDGE * fresnel).max(0.0), (nearest + NEAR_EDGE * fresnel).min(length)];
            let beyond = |end: f64| (end - nearest).abs() >= NEAR_EDGE * fresnel * 0.999;
            let (mut sum, turned) = edge.pieces(from, along, [near, far], fresnel, span, visit);
            // As the pieces turn: through the line or beside it, the whole must agree with them.
            let rest = [(from, from + along * near), (from + along * far, to)];
            whole += turned + rest.map(|(from, to)| edge.angle(from, to)).iter().sum::<f64>();
            if near > 0.0 && beyond(near) {
                ends[number] -= edge.end(from, along);
                sum += edge.end(from + along * near, along);
            }
            if far < length && beyond(far) {
                ends[(number + 1) % 3] += edge.end(to, along);
                sum -= edge.end(from + along * far, along);
            }
            visit(OutlinePart::Edge(sum, from + along * (0.5 * (near + far))));
        }
        for (value, place) in ends.into_iter().zip(corners) {
            if value != Complex64::ZERO {
                visit(OutlinePart::Edge(value, place));
            }
        }
        let share = whole / (2.0 * PI);
        if share.abs() > 1e-9 {
            let value = 4.0 * PI * share * scale * Complex64::cis(-k * distance);
            visit(OutlinePart::Mirror(value, specular));
        }
    }
}

/// A part of a facet's echo, 1/m, and the place on the facet that it comes from.
#[derive(Clone, Copy, Debug)]
pub enum OutlinePart {
    /// The mirror image of the source.
    Mirror(Complex64, DVec3),
    /// A piece of an edge.
    Edge(Complex64, DVec3),
}

/// Half the part of an edge, around the place of stationary phase, that is divided into pieces, in Fresnel radii: beyond,
/// the integral is that of its ends to a percent of these.
const NEAR_EDGE: f64 = 2.0;

/// The line from a source to the mirror image of the observer in the plane of a triangle, around which edges turn.
#[derive(Clone, Copy)]
struct OutlineFrame {
    source: DVec3,
    /// The observer's image, so that the reflected wave goes on straight.
    image: DVec3,
    /// m.
    distance: f64,
    /// Where the line crosses the plane.
    specular: DVec3,
    /// Axes of the offset from the line.
    across: DVec3,
    aside: DVec3,
    /// Orientation of the triangle around the line, seen from the source's side.
    turn: f64,
}

impl OutlineFrame {
    /// `None`: the triangle has no area, or source and observer are on different sides of it.
    fn new(of: &Ends, [a, b, c]: [DVec3; 3]) -> Option<OutlineFrame> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        let [up, down] = [normal.dot(of.source - a), normal.dot(of.observer - a)];
        if up * down <= 0.0 {
            return None;
        }
        let image = of.observer - 2.0 * down * normal;
        let axis = image - of.source;
        let distance = axis.length();
        let axis = axis / distance;
        let across = axis.any_orthonormal_vector();
        Some(OutlineFrame {
            source: of.source,
            image,
            distance,
            specular: of.source + axis * (distance * up.abs() / (up.abs() + down.abs())),
            across,
            aside: axis.cross(across),
            turn: if up > 0.0 { -1.0 } else { 1.0 },
        })
    }

    /// Offset of a place from the line, m.
    fn offset(&self, place: DVec3) -> [f64; 2] {
        let from = place - self.source;
        [from.dot(self.across), from.dot(self.aside)]
    }

    /// By how much the azimuth turns from one place to another.
    fn angle(&self, from: DVec3, to: DVec3) -> f64 {
        let ([x, y], [u, v]) = (self.offset(from), self.offset(to));
        let (cross, dot) = (x * v - y * u, x * u + y * v);
        // Most angles are small: by the series, to 1e-9.
        if cross.abs() < 0.05 * dot {
            let t = cross / dot;
            let t2 = t * t;
            return self.turn * t * (1.0 - t2 * (1.0 / 3.0 - t2 * (1.0 / 5.0 - t2 / 7.0)));
        }
        self.turn * cross.atan2(dot)
    }

    /// Likewise along an edge between two triangles of one plane: where the line crosses it, each has half of the image.
    fn inner_angle(&self, from: DVec3, to: DVec3) -> f64 {
        let angle = self.angle(from, to);
        if PI - angle.abs() < 1e-9 { 0.0 } else { angle }
    }

    /// `1 - cos q` at a place, see [`Ends::outline`].
    fn obliquity(&self, of: &Ends, place: DVec3) -> f64 {
        let [r, s] = [place - of.source, place - self.image];
        1.0 - r.dot(s) / (r.length() * s.length())
    }
}

/// What all edges of a triangle share.
struct EdgeFrame<'a> {
    of: &'a Ends,
    k: f64,
    frame: &'a OutlineFrame,
    scale: f64,
}

impl EdgeFrame<'_> {
    /// By how much the azimuth turns from one place to another.
    fn angle(&self, from: DVec3, to: DVec3) -> f64 {
        self.frame.angle(from, to)
    }

    /// `1 - cos q` at a place.
    fn obliquity(&self, place: DVec3) -> f64 {
        self.frame.obliquity(self.of, place)
    }

    /// Integral along the part of an edge from `near` to `far` m, piece by piece, and by how much the azimuth turns on it;
    /// what spans more than `span` m of path length is passed to `visit` on the way.
    fn pieces(
        &self,
        from: DVec3,
        along: DVec3,
        [near, far]: [f64; 2],
        fresnel: f64,
        span: f64,
        visit: &mut dyn FnMut(OutlinePart),
    ) -> (Complex64, f64) {
        let piece = (4.0 * STRAIGHT_PIECE / PI).sqrt() * fresnel;
        let (mut sum, mut turned) = (Complex64::ZERO, 0.0);
        let mut start = near;
        let mut here = from + along * near;
        let mut first = self.of.length(here);
        let mut group = (near, first);
        let mut obliquity = self.obliquity(here);
        while start < far {
            let [x, y] = self.frame.offset(here);
            // Beside the line through the mirror image the azimuth turns at once: pieces shorten on the way there.
            let step = piece.min((0.3 * x.hypot(y)).max(NEAREST * piece));
            let end = if start + 1.2 * step >= far { far } else { start + step };
            let next = from + along * end;
            let middle = 0.5 * (here + next);
            let last = self.of.length(next);
            // The mean of a parabola through both ends and the middle (Simpson), and its depth.
            let halfway_length = self.of.length(middle);
            let mean = (first + last + 4.0 * halfway_length) / 6.0;
            let depth = 0.5 * self.k * (first + last) - self.k * halfway_length;
            let [halfway, after] = [middle, next].map(|place| self.obliquity(place));
            let angles = [self.angle(here, middle), self.angle(middle, next)];
            turned += angles[0] + angles[1];
            // What both halves weigh, and with a weight in between that rises evenly.
            let weights = [0.5 * (obliquity + halfway) * angles[0], 0.5 * (halfway + after) * angles[1]];
            let turn = 0.5 * self.k * (last - first);
            let [even, rising, bent] = sincs(turn);
            let both = weights[0] + weights[1];
            let rising = 2.0 * (weights[1] - weights[0]) * rising;
            let integral = Complex64::new(both * even, -rising - both * depth * bent);
            sum -= self.scale * integral * Complex64::cis(-self.k * mean);
            obliquity = after;
            if (last - group.1).abs() >= span && end < far {
                visit(OutlinePart::Edge(sum, from + along * (0.5 * (group.0 + end))));
                (sum, group) = (Complex64::ZERO, (end, last));
            }
            (start, here, first) = (end, next, last);
        }
        (sum, turned)
    }

    /// The upper end of the integral along an edge, to second order in one over the phase's slope: by parts, of `w e^jp` it
    /// is `w e^jp / (j p') (1 + (p'' / p' - w' / w) / (j p'))` (stationary phase, Born and Wolf, appendix III).
    fn end(&self, place: DVec3, along: DVec3) -> Complex64 {
        let slope = self.of.slope(place, along);
        let [x, y] = self.frame.offset(place);
        let [u, v] = self.frame.offset(place + along);
        let (u, v) = (u - x, v - y);
        let square = (x * x + y * y).max(f64::MIN_POSITIVE);
        let weight = -self.scale * self.frame.turn * (x * v - y * u) / square * self.obliquity(place);
        let over = Complex64::new(0.0, -self.k * slope).inv();
        let change = self.of.bend(place, along) / slope + 2.0 * (x * u + y * v) / square;
        weight * Complex64::cis(-self.k * self.of.length(place)) * over * (1.0 + change * over)
    }
}

/// `sin x / x`.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

/// Half the integrals over -1 to 1 of `e^(jxt)` times 1, `t / j` and `t^2 - 1/3`.
fn sincs(x: f64) -> [f64; 3] {
    let x2 = x * x;
    if x2 < 1e-2 {
        let even = 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0));
        let rising = x / 3.0 * (1.0 - x2 / 10.0 * (1.0 - x2 / 28.0));
        return [even, rising, -x2 * 2.0 / 45.0 * (1.0 - x2 / 14.0)];
    }
    let (sin, cos) = x.sin_cos();
    let (even, rising) = (sin / x, (sin - x * cos) / x2);
    [even, rising, even * (2.0 / 3.0) - 2.0 * rising / x]
}

/// Integral of `e^(j phase)` over a triangle, per twice its area, with a linear phase that is 0, `x` and `y` at its
/// corners, rad: the second divided difference of the exponential at these places (Hermite and Genocchi).
fn linear_phase(x: f64, y: f64) -> Complex64 {
    /// Below, the series converges faster than differences lose digits.
    const SMALL: f64 = 0.7;
    if x.abs().max(y.abs()) < SMALL {
        // Sum of h_n(jx, jy) / (n + 2)!, h_n being the complete symmetric polynomials.
        let mut sum = Complex64::ZERO;
        let (mut complete, mut power, mut factorial, mut turn) = (1.0, 1.0, 2.0, Complex64::ONE);
        for order in 0..12 {
            sum += turn * (complete / factorial);
            power *= x;
            complete = complete * y + power;
            factorial *= f64::from(order + 3);
            turn *= Complex64::I;
        }
        return sum;
    }
    // First divided differences from 0.
    let first = |x: f64| Complex64::cis(0.5 * x) * sinc(0.5 * x);
    let apart = x - y;
    if apart.abs() > 1e-3 {
        return (first(x) - first(y)) / Complex64::new(0.0, apart);
    }
    // The derivative of (e^z - 1) / z at jx in the middle of both.
    let at = 0.5 * (x + y);
    let z = Complex64::new(0.0, at);
    (Complex64::cis(at) * (z - 1.0) + 1.0) / (z * z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wave number at 77 GHz, rad/m.
    const K: f64 = 2.0 * PI / 3.893_409e-3;

    fn ends(source: DVec3, observer: DVec3) -> Ends {
        Ends { source, observer }
    }

    /// Sum over a fine grid, for triangles with a right angle at `a`.
    fn quadrature(of: &Ends, [a, b, c]: [DVec3; 3], k: f64, count: usize) -> Complex64 {
        let (u, v) = ((b - a) / count as f64, (c - a) / count as f64);
        let normal = u.cross(v);
        let mut sum = Complex64::ZERO;
        for i in 0..count {
            for j in 0..count - i {
                for (shift, fits) in [(1.0 / 3.0, true), (2.0 / 3.0, j + 1 < count - i)] {
                    if !fits {
                        continue;
                    }
                    let place = a + u * (i as f64 + shift) + v * (j as f64 + shift);
                    let (r, s) = (of.source - place, of.observer - place);
                    let cos = 0.5 * (normal.dot(r) / r.length() + normal.dot(s) / s.length()).abs();
                    sum += 0.5 * cos * Complex64::cis(-k * of.length(place)) / (r.length() * s.length());
                }
            }
        }
        sum * Complex64::new(0.0, k / (2.0 * PI))
    }

    #[test]
    fn both_forms_are_the_integral() {
        let cases = [
            (DVec3::new(3.0, 0.4, 0.3), DVec3::new(3.0, 0.4, 0.3), 0.1),
            (DVec3::new(2.0, 0.5, 0.1), DVec3::new(2.0, -0.8, 0.6), 0.1),
            (DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.5, 0.02, 0.01), 0.2),
            (DVec3::new(30.0, 2.0, 1.0), DVec3::new(30.0, 2.0, 1.0), 0.05),
            (DVec3::new(5.0, 0.03, 0.02), DVec3::new(5.0, 0.03, 0.02), 0.3),
            (DVec3::new(1.0, -1.5, 0.2), DVec3::new(4.0, 3.0, 1.0), 0.4),
            (DVec3::new(3.0, -0.1, 0.2), DVec3::new(0.8, 0.3, 0.1), 0.4),
        ];
        for (source, observer, side) in cases {
            let of = ends(source, observer);
            let corners = [DVec3::ZERO, DVec3::new(0.0, side, 0.0), DVec3::new(0.0, 0.0, 0.8 * side)];
            let truth = quadrature(&of, corners, K, 600);
            let scale = K / (2.0 * PI) * 0.4 * side * side / (source.length() * observer.length());
            let [facet, outline] = [of.facet(corners, K), of.outline(corners, K)];
            for (name, found) in [("facet", facet), ("outline", outline)] {
                let error = (found - truth).norm() / truth.norm().max(0.03 * scale);
                assert!(error < 0.004, "{name} of {side} m from {source}: {found}, not {truth}: {error}");
            }
        }
    }

    /// Bounds are above what facets return, at any size, place and tilt.
    #[test]
    fn bounds_are_above_the_integral() {
        let mut state = 1_u64;
        let mut random = |low: f64, high: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut ratios = Vec::new();
        for case in 0..4000 {
            let size = 10f64.powf(random(-2.0, 1.0));
            let mut place = |size: f64| DVec3::new(random(-size, size), random(-size, size), random(-size, size));
            let source = place(30.0) + 2.0 * DVec3::Z;
            let observer = if case % 2 == 0 { source } else { place(30.0) };
            let middle = place(5.0);
            let corners = [middle + place(size), middle + place(size), middle + place(size)];
            let of = ends(source, observer);
            let found = of.facet(corners, K).norm();
            let (bound, coarse) = (of.edge_bound(corners, K), of.bound(corners, K));
            assert!(found <= 1.1 * bound, "{found} of {bound}: {source} {observer} {corners:?}");
            // From the middle of a facet that is large for its distance, the tilt of its edges is not known.
            assert!(found <= 2.0 * coarse, "{found} of {coarse}: {source} {observer} {corners:?}");
            if found > 0.0 {
                ratios.push(found / bound);
            }
        }
        ratios.sort_by(f64::total_cmp);
        // Half of them are within 16 dB.
        assert!(ratios[ratios.len() / 2] > 0.15, "{}", ratios[ratios.len() / 2]);
    }

    /// Radar cross-section of triangles, m^2.
    fn cross_section(of: &Ends, triangles: &[[DVec3; 3]]) -> f64 {
        let sum: Complex64 = triangles.iter().map(|corners| of.facet(*corners, K)).sum();
        4.0 * PI * of.source.length().powi(4) * sum.norm_sqr()
    }

    fn plate(side: f64) -> [[DVec3; 3]; 2] {
        let h = 0.5 * side;
        let corner = |y: f64, z: f64| DVec3::new(0.0, h * y, h * z);
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        [[a, b, c], [a, c, d]]
    }

    /// Check values 7 to 9: a plate of 0.1 m at 77 GHz, closed forms in the far field.
    #[test]
    fn plates_are_as_in_textbooks() {
        for (degrees, db) in [(0.0, 19.1855), (0.5, 16.09646), (1.0, 0.27876), (2.0, -0.17752)] {
            let angle: f64 = f64::to_radians(degrees);
            let far = 1000.0 * DVec3::new(angle.cos(), angle.sin(), 0.0);
            let found = 10.0 * cross_section(&ends(far, far), &plate(0.1)).log10();
            assert!((found - (db + 20.0 * angle.cos().log10())).abs() < 0.01, "{degrees}: {found}");
        }
        let null = 1.115_450_f64.to_radians();
        let far = 1000.0 * DVec3::new(null.cos(), null.sin(), 0.0);
        assert!(cross_section(&ends(far, far), &plate(0.1)) < 1e-6);
    }

    /// Check value 36: a large plate is a mirror, whatever its outline.
    #[test]
    fn large_plates_are_mirrors() {
        for (side, place) in [(30.0, DVec3::new(10.0, 0.7, 0.3)), (200.0, DVec3::new(10.0, -3.0, 2.0))] {
            let found: Complex64 = plate(side).iter().map(|corners| ends(place, place).facet(*corners, K)).sum();
            let identity = Complex64::cis(-K * 20.0) / 20.0;
            // Edges add their own echoes, which decline with their distance.
            assert!((found - identity).norm() < 0.01 * identity.norm(), "{found} {identity}");
            // Likewise without the diagonal, wherever the image is.
            for aside in [DVec3::ZERO, DVec3::new(0.0, 1e-9, 0.0), DVec3::new(0.0, 0.3, -0.1)] {
                let of = ends(DVec3::new(10.0, 0.7, 0.7) + aside, DVec3::new(10.0, 0.7, 0.7) + aside);
                let mut mirror = Complex64::ZERO;
                for (corners, inner) in plate(side).into_iter().zip([[false, false, true], [true, false, false]]) {
                    of.each_piece(corners, inner, K, f64::INFINITY, &mut |part| {
                        if let OutlinePart::Mirror(value, _) = part {
                            mirror += value;
                        }
                    });
                }
                assert!((mirror - identity).norm() < 1e-9, "{aside}: {mirror} {identity}");
            }
            let mut mirror = Complex64::ZERO;
            for corners in plate(side) {
                ends(place, place).each_piece(corners, [false; 3], K, f64::INFINITY, &mut |part| {
                    if let OutlinePart::Mirror(value, _) = part {
                        mirror += value;
                    }
                });
            }
            assert!((mirror - identity).norm() < 1e-9, "{mirror} {identity}");
            // Check value 36: the received amplitude.
            let amplitude = mirror.norm() * 3.893_409e-3 / (4.0 * PI);
            assert!((amplitude / 1.549_138e-5 - 1.0).abs() < 1e-5, "{amplitude}");
        }
    }

    /// A sphere of many facets is within 1 dB of `pi r^2`, and of physical optics' own closed form within 0.3 dB.
    #[test]
    fn spheres_of_facets() {
        let (radius, rings) = (0.1, 180);
        let place = |ring: usize, step: usize| {
            let (polar, around) = (PI * ring as f64 / rings as f64, PI * step as f64 / rings as f64);
            radius * DVec3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos())
        };
        let far = DVec3::new(40.0, 13.0, 21.0);
        let mut triangles = Vec::new();
        for ring in 0..rings {
            for step in 0..2 * rings {
                let [a, b] = [place(ring, step), place(ring + 1, step)];
                let [c, d] = [place(ring + 1, step + 1), place(ring, step + 1)];
                triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|corners| corners[0].dot(far) > 0.0));
            }
        }
        let found = cross_section(&ends(far, far), &triangles) / (PI * radius * radius);
        assert!(10.0 * found.log10().abs() < 1.0, "{found}");
        assert!((10.0 * (found / 0.995_485).log10()).abs() < 0.3, "{found}");
    }

    /// A mirror image on an edge, or anywhere near it, is half a mirror and the edge's own wave: nothing jumps.
    #[test]
    fn images_pass_edges_smoothly() {
        let corners = [DVec3::ZERO, DVec3::new(0.0, 0.1, 0.0), DVec3::new(0.0, 0.0, 0.1)];
        for offset in [-1e-3, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 1e-3] {
            let place = DVec3::new(40.0, 0.03, offset);
            let of = ends(place, place);
            let truth = quadrature(&of, corners, K, 400);
            let (facet, outline) = (of.facet(corners, K), of.outline(corners, K));
            assert!((facet - truth).norm() < 0.015 * truth.norm(), "{offset}: {facet} {truth}");
            assert!((outline - truth).norm() < 0.02 * truth.norm(), "{offset}: {outline} {truth}");
        }
    }

    #[test]
    fn linear_phases_are_continuous() {
        for x in [-9.0, -0.7001, -0.6999, -0.3, 0.0, 1e-5, 0.5, 0.6999, 0.7001, 2.0, 12.0] {
            for apart in [-4.0, -1.0001e-3, -0.999e-3, 0.0, 1e-6, 0.999e-3, 1.0001e-3, 0.3] {
                let y = x + apart;
                // By Simpson's rule over lines of equal distance from the first corner.
                let count = 2000;
                let mut sum = Complex64::ZERO;
                for step in 0..=count {
                    let t = f64::from(step) / f64::from(count);
                    let weight = if step == 0 || step == count {
                        1.0
                    } else if step % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    };
                    let line = Complex64::cis(t * 0.5 * (x + y)) * sinc(0.5 * t * (x - y));
                    sum += weight / 3.0 / f64::from(count) * t * line;
                }
                assert!((linear_phase(x, y) - sum).norm() < 2e-7, "{x} {y}: {} {sum}", linear_phase(x, y));
            }
        }
    }
}
