//! Where an object whose mesh keeps its shape is, at all times of one scan, in the form that rays need.

use echocast_kernels::aim::MovingFrame;
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};

/// Poses of an object at all times of a scan, counted from 0 to 1: pieces between which it may bend or jump, on each of
/// which its position and the inverse of its linear part are parabolas in time. They are short enough that no point of
/// the object is farther than `TOLERANCE_M` from where it should be.
#[derive(Clone, Debug)]
pub struct Path {
    pieces: Vec<Piece>,
    /// For each of as many equal parts of the time as there are pieces, the first piece that reaches into it.
    first: Vec<u32>,
}

/// Half of the documented accuracy: a tenth of a millimetre, which at one metre is a tenth of a milliradian.
const TOLERANCE_M: f64 = 0.05e-3;

/// Where a piece is sampled, as parts of its length: at both ends and in the middle, through which it passes, and in
/// between, where it is checked, at uneven steps, so that no rotation and no wave goes unnoticed at all of them.
const PROBES: [f64; 7] = [0.0, 0.21, 0.38, 0.5, 0.69, 0.87, 1.0];

/// Which of [`PROBES`] are its ends and its middle.
const THROUGH: [usize; 3] = [0, 3, 6];

/// No piece is a smaller part of the time between two bends: a motion that needs shorter ones jumps.
const SHORTEST: f64 = 1.0 / (1 << 18) as f64;

/// Most parts into which a piece that is too long is cut at once.
const MOST_PARTS: f64 = 32.0;

/// A motion that jumps more often, other than at its bends, is noise.
const MOST_JUMPS: usize = 64;

/// Most pieces of a path: what takes longer is not worth waiting for.
const MOST_PIECES: usize = 1 << 20;

/// A part of a path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Piece {
    /// Its time, the object's origin relative to the scene's, m, and the linear part of object-from-world.
    frame: MovingFrame,
    /// Whether the object is visible.
    visible: bool,
    /// Velocity of its origin, m/s.
    velocity: Parabola<Vec3>,
    /// Rate of change of the linear part of world-from-object, 1/s.
    turning: Parabola<Mat3>,
}

/// `a`, `b` and `c` of `a + b t + c t^2`.
type Parabola<T> = [T; 3];

/// The parabola that has these values at 0, 1/2 and 1.
fn parabola<T>([start, middle, end]: [T; 3]) -> Parabola<T>
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let bend = (start + end) * 2.0 - middle * 4.0;
    [start, end - start - bend, bend]
}

/// Its value at `t`.
fn at<T>([a, b, c]: Parabola<T>, t: f32) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
{
    a + (b + c * t) * t
}

/// Weights of the values at [`PROBES`] in the derivatives at the ends and in the middle of a piece of length 1: those of
/// the polynomial through all values.
fn slopes() -> [[f64; PROBES.len()]; 3] {
    let others = |k: usize| (0..PROBES.len()).filter(move |&other| other != k);
    THROUGH.map(|place| {
        std::array::from_fn(|k| {
            let whole: f64 = others(k).map(|m| PROBES[k] - PROBES[m]).product();
            let without =
                |left: usize| others(k).filter(|&m| m != left).map(|m| PROBES[place] - PROBES[m]).product::<f64>();
            others(k).map(without).sum::<f64>() / whole
        })
    })
}

/// Pose of an object at one time.
#[derive(Clone, Copy, Debug)]
pub struct PathPose {
    /// Its origin relative to the scene's, m.
    pub place: Vec3,
    /// The linear part of object-from-world.
    pub inverse: Mat3,
}

/// The time span of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// s.
    pub start: f64,
    /// s; 0: nothing moves.
    pub length: f64,
}

impl Span {
    /// The part of it that has passed at `time`, s; 0 if nothing moves.
    pub fn part(&self, time: f64) -> f32 {
        if self.length > 0.0 { ((time - self.start) / self.length) as f32 } else { 0.0 }
    }
}

impl Path {
    const PIECE_BYTES: usize = size_of::<Piece>() + size_of::<u32>();

    /// The path along `world_from_object` of an object that can be seen at the times that are `visible`, and that may
    /// bend or jump at `bends`, in any order. `bounds` is the box of the object's mesh; `origin` the scene's. `None`:
    /// it is noise, or its pieces take more than `most_bytes`.
    pub fn new(
        span: Span,
        mut bends: Vec<f64>,
        bounds: [[f32; 3]; 2],
        origin: DVec3,
        world_from_object: impl Fn(f64) -> DAffine3,
        visible: impl Fn(f64) -> bool,
        most_bytes: usize,
    ) -> Option<Path> {
        let Span { start, length } = span;
        bends.push(start);
        bends.push(start + length);
        bends.retain(|time| (start..=start + length).contains(time));
        bends.sort_by(f64::total_cmp);
        // Times that differ only by rounding: there is no velocity between them.
        let rounding = 1e-9 * length + 16.0 * f64::EPSILON * start.abs();
        bends.dedup_by(|later, before| *later - *before <= rounding);
        if let Some(last) = bends.last_mut() {
            *last = start + length;
        }
        let local_from_object = |time: f64| DAffine3::from_translation(-origin) * world_from_object(time);
        let (marks, slopes) = (marks(bounds), slopes());
        let mut pieces = Vec::with_capacity(bends.len());
        let most = MOST_PIECES.min(most_bytes / Path::PIECE_BYTES);
        let mut jumps = 0;
        // Pieces yet to be made, the first on top: time and pose at both ends.
        let mut cuts: Vec<[(f64, DAffine3); 2]> = Vec::new();
        for ends in bends.windows(2) {
            let whole = ends[1] - ends[0];
            let visible = visible(0.5 * (ends[0] + ends[1]));
            // A little inside: at its ends it may jump.
            let inside = (1e-9 * whole).max(4.0 * f64::EPSILON * ends[1].abs());
            let [first, last] = [ends[0] + inside, ends[1] - inside].map(&local_from_object);
            cuts.push([(ends[0], first), (ends[1], last)]);
            while let Some([(from, start), (to, end)]) = cuts.pop() {
                let mut probes = [start; PROBES.len()];
                probes[PROBES.len() - 1] = end;
                for (place, probe) in PROBES.iter().zip(&mut probes).skip(1).take(PROBES.len() - 2) {
                    *probe = local_from_object(from + place * (to - from));
                }
                let piece = Piece::through(span, [from, to], visible, &probes, &slopes);
                let off = if piece.surely_fits(&probes, bounds) { 0.0 } else { piece.farthest(&probes, &marks) };
                let fits = off <= TOLERANCE_M;
                if fits || to - from <= SHORTEST * whole {
                    jumps += usize::from(!fits);
                    if pieces.len() >= most || jumps > MOST_JUMPS {
                        return None;
                    }
                    pieces.push(piece);
                    continue;
                }
                // An error falls with the cube of the length.
                let parts = (off / TOLERANCE_M).cbrt().ceil().clamp(2.0, MOST_PARTS);
                let mut later = (to, end);
                for part in (0..parts as usize).rev() {
                    let time = from + (to - from) * part as f64 / parts;
                    let earlier = if part == 0 { (from, start) } else { (time, local_from_object(time)) };
                    cuts.push([earlier, later]);
                    later = earlier;
                }
            }
        }
        let count = pieces.len();
        let mut first = Vec::with_capacity(count);
        let mut piece = 0;
        for part in 0..count {
            let start = part as f32 / count as f32;
            while piece + 1 < count && pieces[piece + 1].frame.start <= start {
                piece += 1;
            }
            first.push(piece as u32);
        }
        Some(Path { pieces, first })
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        self.pieces.len() * Path::PIECE_BYTES
    }

    /// The path of an object that rests at `local_from_object`, visible or not.
    pub fn standing(local_from_object: &DAffine3, visible: bool) -> Path {
        let place = local_from_object.translation.as_vec3().to_array();
        let into = inverse(&local_from_object.matrix3).as_mat3().to_cols_array_2d();
        let frame = MovingFrame {
            place: [place, [0.0; 3], [0.0; 3]],
            into: [into, [[0.0; 3]; 3], [[0.0; 3]; 3]],
            ..MovingFrame::default()
        };
        Path { pieces: vec![Piece { frame, visible, ..Piece::default() }], first: vec![0] }
    }

    /// The piece that `time`, 0 to 1, is in.
    pub fn piece(&self, time: f32) -> &Piece {
        let part = (time * self.first.len() as f32) as usize;
        let mut piece = self.first[part.min(self.first.len() - 1)] as usize;
        // Rounded, a time can lie before the first piece of its part.
        while self.pieces.get(piece + 1).is_some_and(|next| next.frame.start <= time) {
            piece += 1;
        }
        &self.pieces[piece]
    }

    /// Pose at `time`, 0 to 1.
    pub fn at(&self, time: f32) -> PathPose {
        let piece = self.piece(time);
        piece.at_part(piece.part(time))
    }

    /// Boxes, least and greatest x, y, z, at `steps` evenly spaced times from 0 to 1, such that in between, what is
    /// within `bounds(time)` (object frame), which bends at `bends` alone, stays within the box interpolated between
    /// them; they are empty where nothing is ever visible.
    pub fn boxes(&self, steps: usize, bends: &[f32], bounds: impl Fn(f32) -> [[f32; 3]; 2]) -> Vec<[[f32; 3]; 2]> {
        /// Margin, m: far more than `TOLERANCE_M`.
        const MARGIN_M: f32 = 2e-3;
        /// Margin relative to a coordinate: far more than the rounding of a place and of a ray there.
        const ROUNDING: f32 = 16.0 * f32::EPSILON;
        const NOTHING: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        // Bounds at the ends of each piece and in between, widened by how far it bends from there to the next sample.
        const PARTS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
        let sample = |piece: &Piece, part: f32, time: f32| {
            let stray = Vec3::from(piece.frame.place[2]).abs() * (0.25 * PARTS[1] * PARTS[1]);
            let [low, high] = surround(&piece.at_part(part), bounds(time));
            (time, [low - stray, high + stray])
        };
        let mut samples = Vec::with_capacity(PARTS.len() * self.pieces.len() + bends.len());
        for (index, piece) in self.pieces.iter().enumerate().filter(|(_, piece)| piece.visible) {
            let end = self.pieces.get(index + 1).map_or(1.0, |next| next.frame.start);
            let time = |part: f32| piece.frame.start + part * (end - piece.frame.start);
            samples.extend(PARTS.map(|part| sample(piece, part, time(part))));
        }
        for &time in bends {
            let piece = self.piece(time);
            if piece.visible {
                samples.push(sample(piece, piece.part(time), time));
            }
        }
        let last = steps.max(2) - 1;
        let mut boxes = vec![NOTHING; last + 1];
        for step in 0..last {
            let (from, to) = (step as f32 / last as f32, (step + 1) as f32 / last as f32);
            // The boxes at both ends of the interval must hold every sample within it, and the path at the ends
            // themselves.
            let ends = [from, to].map(|time| {
                let piece = self.piece(time);
                (time, sample(piece, piece.part(time), time).1, piece.visible)
            });
            let within = samples.iter().filter(|(time, _)| (from..=to).contains(time)).copied();
            let all = within.chain(ends.into_iter().filter(|end| end.2).map(|(time, bounds, _)| (time, bounds)));
            // Linear between the boxes at both ends, if it is visible there, widened by what sticks out.
            let [a, b] = match ends {
                [(_, a, true), (_, b, true)] => [a, b],
                _ => {
                    let whole = all.clone().fold(NOTHING, |sum, (_, next)| unite(sum, next));
                    [whole; 2]
                }
            };
            let mut out = [Vec3::ZERO; 2];
            let mut is_seen = false;
            for (time, [low, high]) in all {
                let part = (time - from) / (to - from);
                out[0] = out[0].max(a[0].lerp(b[0], part) - low);
                out[1] = out[1].max(high - a[1].lerp(b[1], part));
                is_seen = true;
            }
            let widened = |[low, high]: [Vec3; 2]| {
                if is_seen { [low - out[0], high + out[1]] } else { NOTHING }
            };
            boxes[step] = unite(boxes[step], widened(a));
            boxes[step + 1] = unite(boxes[step + 1], widened(b));
        }
        let wider = |[low, high]: &[Vec3; 2]| {
            // The ends of empty boxes are infinite, and stay so.
            let [a, b] = [low, high].map(|end| MARGIN_M + ROUNDING * end.abs().min(Vec3::splat(f32::MAX)));
            [(*low - a).to_array(), (*high + b).to_array()]
        };
        boxes.iter().map(wider).collect()
    }
}

/// The box around the corners of `bounds` (object frame) at a pose.
fn surround(place: &PathPose, bounds: [[f32; 3]; 2]) -> [Vec3; 2] {
    let linear = place.inverse.inverse();
    let [low, high] = bounds.map(Vec3::from);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let middle = place.place + linear * middle;
    let half = linear.x_axis.abs() * half.x + linear.y_axis.abs() * half.y + linear.z_axis.abs() * half.z;
    // A thousandth for rotation between samples.
    let half = half * 1.001;
    [middle - half, middle + half]
}

fn unite(a: [Vec3; 2], b: [Vec3; 2]) -> [Vec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Points that must be within the tolerance: the corners of a box, and one metre along each axis, so that small objects
/// do not rotate too far.
fn marks(bounds: [[f32; 3]; 2]) -> [DVec3; 11] {
    let corner = |k: usize| DVec3::from_array(std::array::from_fn(|axis| f64::from(bounds[k >> axis & 1][axis])));
    std::array::from_fn(|k| match k {
        0..8 => corner(k),
        _ => DVec3::AXES[k - 8],
    })
}

impl Piece {
    /// The piece through the poses at [`PROBES`] between two times, s; see [`slopes`].
    fn through(
        span: Span,
        [from, to]: [f64; 2],
        visible: bool,
        probes: &[DAffine3; PROBES.len()],
        slopes: &[[f64; PROBES.len()]; 3],
    ) -> Piece {
        let places = parabola(THROUGH.map(|k| probes[k].translation));
        let inverses = parabola(THROUGH.map(|k| inverse(&probes[k].matrix3)));
        let frame = MovingFrame {
            start: ((from - span.start) / span.length) as f32,
            rate: (span.length / (to - from)) as f32,
            place: places.map(|place| place.as_vec3().to_array()),
            into: inverses.map(|inverse| inverse.as_mat3().to_cols_array_2d()),
        };
        let rates = slopes.map(|weights| {
            let mut rate = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
            for (weight, probe) in weights.iter().zip(probes) {
                // Relative to the start, lest large coordinates lose digits.
                rate.matrix3 += (probe.matrix3 - probes[0].matrix3) * (weight / (to - from));
                rate.translation += (probe.translation - probes[0].translation) * (weight / (to - from));
            }
            rate
        });
        let velocity = parabola(rates.map(|rate| rate.translation)).map(|velocity| velocity.as_vec3());
        let turning = parabola(rates.map(|rate| rate.matrix3)).map(|turning| turning.as_mat3());
        Piece { frame, visible, velocity, turning }
    }

    /// What the piece says where it is checked, and the pose there.
    fn checked<'a>(&'a self, probes: &'a [DAffine3; PROBES.len()]) -> impl Iterator<Item = (PathPose, &'a DAffine3)> {
        let checked = PROBES.iter().zip(probes).enumerate().filter(|(k, _)| !THROUGH.contains(k));
        checked.map(|(_, (part, exact))| (self.at_part(*part as f32), exact))
    }

    /// Greatest distance of any of `marks` (object frame) from where it should be, m, where the piece is checked.
    fn farthest(&self, probes: &[DAffine3; PROBES.len()], marks: &[DVec3; 11]) -> f64 {
        self.checked(probes).map(|(is, exact)| is.farthest(exact, marks)).fold(0.0, f64::max)
    }

    /// Whether [`Piece::farthest`] of the [`marks`] of `bounds` is certainly within the tolerance, as that of most pieces
    /// is: found sooner than the distance of every mark.
    fn surely_fits(&self, probes: &[DAffine3; PROBES.len()], bounds: [[f32; 3]; 2]) -> bool {
        self.checked(probes).all(|(is, exact)| is.surely_fits(exact, bounds))
    }

    /// Whether `time`, 0 to 1, is in it.
    pub fn covers(&self, time: f32) -> bool {
        let passed = (time - self.frame.start) * self.frame.rate;
        (0.0..1.0).contains(&passed)
    }

    /// Whether the object is visible.
    pub fn is_visible(&self) -> bool {
        self.visible
    }

    /// The part of the piece that has passed at `time`, 0 to 1.
    pub fn part(&self, time: f32) -> f32 {
        ((time - self.frame.start) * self.frame.rate).clamp(0.0, 1.0)
    }

    /// Pose of the object when `part` of the piece has passed.
    pub fn at_part(&self, part: f32) -> PathPose {
        let into = self.frame.into.map(|columns| Mat3::from_cols_array_2d(&columns));
        PathPose { place: at(self.frame.place.map(Vec3::from), part), inverse: at(into, part) }
    }

    /// Velocity of the point at `object` (object frame) when `part` of the piece has passed, m/s.
    pub fn velocity(&self, part: f32, object: Vec3) -> Vec3 {
        at(self.velocity, part) + at(self.turning, part) * object
    }

    /// The frame that rays are transformed into.
    pub fn frame(&self) -> &MovingFrame {
        &self.frame
    }
}

/// The inverse of a linear part; one that is squeezed flat gets a thickness of a millionth.
fn inverse(linear: &DMat3) -> DMat3 {
    let size = linear.x_axis.length().max(linear.y_axis.length()).max(linear.z_axis.length());
    let flat = linear.determinant().abs() <= 1e-18 * size * size * size;
    if flat {
        (*linear + DMat3::from_diagonal(DVec3::splat(1e-6 * size.max(1e-6)))).inverse()
    } else {
        linear.inverse()
    }
}

impl PathPose {
    /// The point at `object` (object frame) in the scene's frame.
    pub fn to_local(self, object: Vec3) -> Vec3 {
        self.place + self.inverse.inverse() * object
    }

    /// The direction `object` (object frame), of any length, in the scene's frame.
    pub fn turn(&self, object: Vec3) -> Vec3 {
        self.inverse.inverse() * object
    }

    /// A normal (object frame) in the scene's frame, of any length.
    pub fn normal(&self, normal: Vec3) -> Vec3 {
        self.inverse.transpose() * normal
    }

    /// Matrix that takes normals of the object at another pose `place` to its normals here, in the scene's frame.
    pub fn normals_from(&self, place: PathPose) -> Mat3 {
        self.inverse.transpose() * place.inverse.inverse().transpose()
    }

    /// Whether each of the [`marks`] of `bounds` (object frame) is certainly within the tolerance of where `exact` places
    /// it.
    fn surely_fits(&self, exact: &DAffine3, bounds: [[f32; 3]; 2]) -> bool {
        let inverse = self.inverse.as_dmat3();
        // How far a point is off is affine in where it is, and of all points of a box most at a corner.
        let linear = exact.matrix3 * (inverse * exact.matrix3 - DMat3::IDENTITY);
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let offset = exact.matrix3 * (inverse * (exact.translation - self.place.as_dvec3()));
        let [low, high] = bounds.map(|end| DVec3::from(end.map(f64::from)));
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let centre = x * middle.x + y * middle.y + z * middle.z + offset;
        let spread = x.abs() * half.x + y.abs() * half.y + z.abs() * half.z;
        let most = [centre.abs() + spread, x + offset, y + offset, z + offset];
        most.iter().all(|off| off.length_squared() <= TOLERANCE_M * TOLERANCE_M)
    }

    /// Greatest distance of any of `marks` (object frame) from where `exact` places it, m.
    fn farthest(&self, exact: &DAffine3, marks: &[DVec3; 11]) -> f64 {
        let inverse = self.inverse.as_dmat3();
        let off = marks.iter().map(|mark| {
            let should = exact.transform_point3(*mark);
            let is = inverse * (should - self.place.as_dvec3());
            // Rounding to single precision is no reason to cut.
            let rounding = 2e-7 * (should.abs().max_element() + mark.abs().max_element());
            let off = exact.transform_vector3(is - *mark).length() - 4.0 * rounding;
            if off.is_nan() { f64::INFINITY } else { off }
        });
        off.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// A key that rounding has put next to the start, or to the end.
    #[test]
    fn no_piece_is_too_short_to_have_a_speed() {
        let pose = |time: f64| DAffine3::from_translation(8.0 * time * DVec3::X);
        let span = Span { start: 0.3, length: 0.9 };
        let path = path(span, &[0.3_f64.next_up(), 0.7, (0.3_f64 + 0.9).next_down()], pose);
        for time in [0.0, 0.3, 0.9999, 1.0] {
            let piece = path.piece(time);
            let velocity = piece.velocity(piece.part(time), Vec3::ZERO);
            assert!((velocity - 8.0 * Vec3::X).length() < 1e-3, "{velocity} at {time}");
        }
    }

    const CUBE: [[f32; 3]; 2] = [[-1.0; 3], [1.0; 3]];

    fn path(span: Span, bends: &[f64], pose: impl Fn(f64) -> DAffine3) -> Path {
        Path::new(span, bends.to_vec(), CUBE, DVec3::ZERO, pose, |_| true, usize::MAX).unwrap()
    }

    /// Every corner at every time, against the exact pose; and no corner leaves its box.
    fn check(span: Span, bends: &[f64], pose: impl Fn(f64) -> DAffine3) -> usize {
        let path = path(span, bends, &pose);
        for steps in [2, 5] {
            let boxes = path.boxes(steps, &[], |_| CUBE);
            for k in 0..=1000 {
                let part = (f64::from(k) + 0.37) / 1001.0;
                let place = path.at(part as f32);
                let exact = pose(span.start + span.length * f64::from(part as f32));
                let at = part as f32 * (boxes.len() - 1) as f32;
                let (step, fraction) = (at as usize, at.fract());
                for mark in marks(CUBE) {
                    let (is, should) = (place.to_local(mark.as_vec3()), exact.transform_point3(mark).as_vec3());
                    assert!((is - should).length() < 1e-4, "{part}: {is} {should}");
                }
                for corner in &marks(CUBE)[..8] {
                    let point = exact.transform_point3(*corner).as_vec3();
                    let [low, high] =
                        [0, 1].map(|end| Vec3::from(boxes[step][end]).lerp(Vec3::from(boxes[step + 1][end]), fraction));
                    assert!(point.cmpge(low).all() && point.cmple(high).all(), "{part}: {point} {low} {high}");
                }
            }
        }
        path.pieces.len()
    }

    /// A pose that is off by a little, of boxes large and small, up to 500 m away: what surely fits does, and much of what
    /// fits does so surely.
    #[test]
    fn what_surely_fits_fits() {
        let mut state = 1_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut fits, mut surely) = (0, 0);
        for _ in 0..10_000 {
            let mut vector = || DVec3::new(random(), random(), random());
            let place = DAffine3::from_scale_rotation_translation(
                vector() + 1.5,
                DQuat::from_scaled_axis(3.0 * vector()),
                300.0 * vector(),
            );
            let off = 2e-5 * vector().x.exp2().powi(8);
            let moved = DAffine3::from_rotation_translation(DQuat::from_scaled_axis(off * vector()), off * vector());
            let (low, size) = (3.0 * vector(), 2.0 * vector().abs());
            let bounds = [low, low + size].map(|end| end.as_vec3().to_array());
            let is = PathPose { place: place.translation.as_vec3(), inverse: inverse(&place.matrix3).as_mat3() };
            let farthest = is.farthest(&(moved * place), &marks(bounds));
            if is.surely_fits(&(moved * place), bounds) {
                assert!(farthest <= TOLERANCE_M, "{farthest} {place}");
                surely += 1;
            }
            fits += u32::from(farthest <= 0.3 * TOLERANCE_M);
        }
        assert!(fits > 1000 && surely > fits / 4, "{fits} {surely}");
        let broken = PathPose { place: Vec3::NAN, inverse: Mat3::IDENTITY };
        assert!(!broken.surely_fits(&DAffine3::IDENTITY, CUBE));
    }

    #[test]
    fn what_moves_straight_is_one_piece() {
        let span = Span { start: 5.0, length: 0.1 };
        let straight = |time: f64| DAffine3::from_translation(DVec3::new(30.0 * time, 2.0, 3.0 * time));
        assert_eq!(check(span, &[], straight), 1);
        let path = path(span, &[], straight);
        let piece = path.piece(0.3);
        assert!((piece.velocity(0.3, Vec3::ONE) - Vec3::new(30.0, 0.0, 3.0)).length() < 1e-3);
    }

    #[test]
    fn a_rotor_is_exact_at_fifty_turns_a_second() {
        let span = Span { start: 12.0, length: 0.1 };
        let rate = 50.0 * std::f64::consts::TAU;
        let rotor = |time: f64| {
            DAffine3::from_scale_rotation_translation(
                DVec3::new(1.0, 2.0, 0.5),
                DQuat::from_rotation_z(rate * time),
                DVec3::new(10.0, -20.0, 3.0),
            )
        };
        let pieces = check(span, &[], rotor);
        assert!((100..500).contains(&pieces), "{pieces}");
        let path = path(span, &[], rotor);
        for time in [0.0, 0.123, 0.9999] {
            let piece = path.piece(time);
            let exact = rotor(span.start + span.length * f64::from(time));
            let point = DVec3::new(1.0, 0.5, 1.0);
            let should = DVec3::Z.cross(exact.transform_vector3(point)) * rate;
            let is = piece.velocity(piece.part(time), point.as_vec3());
            assert!((is.as_dvec3() - should).length() < 1e-3 * rate, "{is} {should}");
        }
    }

    #[test]
    fn what_bends_and_jumps_does_so_at_its_time() {
        let span = Span { start: 0.0, length: 1.0 };
        let pose = |time: f64| {
            let x = if time < 0.3 { 10.0 * time } else { 3.0 - 5.0 * (time - 0.3) };
            let y = if time < 0.6 { 0.0 } else { 40.0 };
            DAffine3::from_translation(DVec3::new(x, y, 0.0))
        };
        assert_eq!(check(span, &[0.6, 0.3, 7.0], pose), 3);
    }

    #[test]
    fn noise_does_not_take_all_memory() {
        let noise = |time: f64| DAffine3::from_translation(DVec3::X * (1e9 * time).sin());
        let span = Span { start: 0.0, length: 1.0 };
        assert!(Path::new(span, vec![], CUBE, DVec3::ZERO, noise, |_| true, 1 << 20).is_none());
    }

    #[test]
    fn what_is_not_seen_has_no_box() {
        let span = Span { start: 0.0, length: 1.0 };
        let still = |_| DAffine3::IDENTITY;
        let path = Path::new(span, vec![0.5], CUBE, DVec3::ZERO, still, |time| time > 0.5, usize::MAX).unwrap();
        assert!(!path.piece(0.2).is_visible() && path.piece(0.7).is_visible());
        let boxes = path.boxes(2, &[], |_| CUBE);
        assert!(boxes[0][0][0] <= -1.0 && boxes[1][1][0] >= 1.0);
        let never = Path::new(span, vec![], CUBE, DVec3::ZERO, still, |_| false, usize::MAX).unwrap();
        assert!(never.boxes(2, &[], |_| CUBE).iter().all(|[low, high]| low[0] > high[0]));
    }
}
