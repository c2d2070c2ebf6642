//! How a beam's light is distributed across it: sub-rays that represent it.

use echocast_kernels::{aim, rim};
use glam::Vec3;
use ground::lanes::{LANES, RayBatch};
use std::f64::consts::{PI, TAU};

/// A Gaussian beam as sub-rays of equal weight.
///
/// Irradiance falls as `exp(-2 r^2 / w^2)` across the beam, `w(R)^2 = w0^2 + (phi R)^2` with the half angle `phi` at
/// 1/e^2, each axis its own. Sub-ray `i` of `N` crosses it at `r = w sqrt(-ln(1 - u)/2)`, `u = (i + 1/2)/N`, turned by
/// the golden angle `pi (3 - sqrt 5)` from the previous one (a Vogel spiral); the spiral is rotated at random for each
/// beam. Straight rays keep to `w(R)` at every range if they leave the exit disc with a tangential tilt: a ruled
/// hyperboloid.
#[derive(Clone, Debug)]
pub struct Footprint {
    /// Cosine and sine of each sub-ray's place on the spiral, times `r / w`.
    places: Vec<[f32; 2]>,
    /// Radius of the beam at the exit, m.
    start: f32,
    /// Half angles, horizontal and vertical, rad; for a pixel its full width and height over the focal length.
    half_angles: [f32; 2],
    /// Whether it is rotated at random for each beam.
    pub turns: bool,
}

/// Most sub-rays of a round: as many as the widest packets have.
pub const ROUND: usize = 16;

/// Order of the spiral's 64 places in which each 8 of them, the first 16, 24, 32 and 48 represent the beam, too. Found by
/// annealing: of all orders tried, that whose rounds and prefixes divide the light at straight edges best, over 24
/// directions and 17 distances of the edge from the axis; the first 8, 16 and 32 to 0.053, 0.035 and 0.024 (standard
/// deviation), all 64 to 0.013.
const ROUNDS_OF_64: [u8; 64] = [
    3, 43, 54, 34, 31, 45, 15, 14, 25, 56, 41, 44, 16, 9, 37, 55, 2, 20, 38, 50, 57, 40, 26, 6, 13, 51, 49, 7, 22, 24,
    39, 58, 47, 30, 12, 62, 19, 8, 53, 18, 59, 61, 29, 4, 60, 11, 28, 5, 35, 10, 46, 21, 63, 27, 1, 36, 52, 33, 0, 48,
    32, 17, 42, 23,
];

/// The axes of the beams of a block.
pub struct Across {
    /// Unit vectors across the beam, to the left and up, in the world.
    left: [[f32; LANES]; 3],
    up: [[f32; LANES]; 3],
    /// Cosine and sine of the spiral's rotation.
    turn: [[f32; LANES]; 2],
}

/// The sub-rays of one beam, axis by axis.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct SubRayFan {
    /// Where they start, m.
    pub origin: [[f32; SubRayFan::MOST]; 3],
    /// Unit directions.
    pub direction: [[f32; SubRayFan::MOST]; 3],
}

impl SubRayFan {
    /// Most sub-rays.
    pub const MOST: usize = 64;
}

impl Default for SubRayFan {
    fn default() -> Self {
        SubRayFan { origin: [[0.0; SubRayFan::MOST]; 3], direction: [[0.0; SubRayFan::MOST]; 3] }
    }
}

impl Default for Across {
    /// All zeros, until the axes of each lane are set.
    fn default() -> Self {
        Across { left: [[0.0; LANES]; 3], up: [[0.0; LANES]; 3], turn: [[0.0; LANES]; 2] }
    }
}

impl Across {
    /// Sets the axes of one beam in `direction`, where the sensor's z is `up`, with the spiral rotated by the fraction
    /// `turn` of a circle.
    pub fn set(&mut self, lane: usize, direction: Vec3, up: Vec3, turn: f32) {
        let left = up.cross(direction);
        // For a beam straight up or down, left is not defined.
        let left = if left.length_squared() > 1e-12 { left.normalize() } else { direction.any_orthonormal_vector() };
        self.set_axes(lane, [left, direction.cross(left)], turn);
    }

    /// Sets the axes of all `beams` of a sensor whose z is `up`, with the spiral rotated by 0; those of a beam straight
    /// up or down are zeros.
    pub fn set_all(&mut self, beams: &RayBatch, up: Vec3) {
        let z = up.to_array().map(|axis| [axis; LANES]);
        rim::across(z.each_ref(), beams.directions(), self.left.each_mut(), self.up.each_mut());
        self.turn = [[1.0; LANES], [0.0; LANES]];
    }

    /// Rotates the spiral of a beam by another half circle.
    pub fn turn_over(&mut self, lane: usize) {
        self.turn.iter_mut().for_each(|axis| axis[lane] = -axis[lane]);
    }

    /// [`Across::set`] with the vectors across the beam given.
    pub fn set_axes(&mut self, lane: usize, [left, up]: [Vec3; 2], turn: f32) {
        for (axis, (left, up)) in left.to_array().into_iter().zip(up.to_array()).enumerate() {
            self.left[axis][lane] = left;
            self.up[axis][lane] = up;
        }
        let (sin, cos) = (turn * TAU as f32).sin_cos();
        (self.turn[0][lane], self.turn[1][lane]) = (cos, sin);
    }
}

impl Footprint {
    /// `count` sub-rays, at least 2, of a beam with `diameter` m at the exit and full divergences in rad, at 1/e^2.
    pub fn new(count: usize, diameter: f64, divergence: [f64; 2]) -> Footprint {
        let golden = PI * (3.0 - 5f64.sqrt());
        let place = |i: usize| {
            let u = (i as f64 + 0.5) / count as f64;
            let radius = (-(1.0 - u).ln() / 2.0).sqrt();
            let (sin, cos) = (golden * i as f64).sin_cos();
            [(radius * cos) as f32, (radius * sin) as f32]
        };
        Footprint {
            places: (0..count).map(place).collect(),
            start: (diameter / 2.0) as f32,
            half_angles: divergence.map(|full| (full / 2.0) as f32),
            turns: true,
        }
    }

    /// 64 sub-rays in an order in which they can be sent in rounds of [`ROUND`].
    pub fn in_rounds(diameter: f64, divergence: [f64; 2]) -> Footprint {
        let spiral = Footprint::new(ROUNDS_OF_64.len(), diameter, divergence);
        let places = ROUNDS_OF_64.map(|place| spiral.places[usize::from(place)]).to_vec();
        Footprint { places, ..spiral }
    }

    /// For each sub-ray all sub-rays, the nearest first, itself at the start.
    pub fn neighbours(&self) -> Vec<Vec<u8>> {
        let of = |[x, y]: &[f32; 2]| {
            let away = |other: &u8| {
                let [a, b] = self.places[usize::from(*other)];
                (a - x) * (a - x) + (b - y) * (b - y)
            };
            let mut others: Vec<u8> = (0..self.count() as u8).collect();
            others.sort_by(|a, b| away(a).total_cmp(&away(b)));
            others
        };
        self.places.iter().map(of).collect()
    }

    /// One ray at the rim of this footprint: above its axis unless rotated.
    pub fn rim(&self) -> Footprint {
        // For a beam 1.5 w: an edge there cuts off 0.13 percent of the light. For a pixel its edge.
        let far = if self.turns { 1.5 } else { 0.5 };
        Footprint { places: vec![[far, 0.0]], ..self.clone() }
    }

    /// `count` sub-rays, at least 2, spread evenly over a pixel of a width and height over the focal length: a
    /// low-discrepancy sequence of the plastic number g = 1.3247, `(i/g, i/g^2) mod 1` (Roberts 2018).
    pub fn of_pixel(count: usize, size: [f64; 2]) -> Footprint {
        let place = |i: usize| {
            [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| ((0.5 + step * i as f64).fract() - 0.5) as f32)
        };
        Footprint {
            places: (0..count).map(place).collect(),
            start: 0.0,
            half_angles: size.map(|angle| angle as f32),
            turns: false,
        }
    }

    /// Number of sub-rays.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Writes all sub-rays of the beam at `lane` to the first places of `fan`.
    pub fn fan(&self, across: &Across, beams: &RayBatch, lane: usize, fan: &mut SubRayFan) {
        let vector = |axes: &[[f32; LANES]; 3]| axes.each_ref().map(|axis| axis[lane]);
        let of_beam = |axes: [&[f32; LANES]; 3]| axes.map(|axis| axis[lane]);
        let ([mut cos, mut sin], count) = ([[0.0; SubRayFan::MOST]; 2], self.count());
        for ((cos, sin), place) in cos.iter_mut().zip(&mut sin).zip(&self.places) {
            [*cos, *sin] = *place;
        }
        aim::fan(
            [&cos[..count], &sin[..count]],
            self.start,
            self.half_angles,
            [vector(&across.left), vector(&across.up)],
            across.turn.map(|axis| axis[lane]),
            of_beam(beams.origins()),
            of_beam(beams.directions()),
            fan.origin.each_mut().map(|axis| &mut axis[..]),
            fan.direction.each_mut().map(|axis| &mut axis[..]),
        );
    }

    /// Factors by which the oblique plane that each beam meets, with its `normals` and `cos`ine of incidence at
    /// `ranges` m, lowers the echo of a pulse with the standard deviation `sigma` m.
    pub fn obliqueness(
        &self,
        across: &Across,
        sigma: f32,
        (normals, [cos, ranges]): ([&[f32; LANES]; 3], [&[f32; LANES]; 2]),
        factors: &mut [f32; LANES],
    ) {
        let left = across.left.each_ref();
        rim::obliqueness(sigma, self.start, self.half_angles, normals, left, cos, ranges, factors);
    }

    /// World position of sub-ray `index` of the beam at `lane` at `range` m: to first order in the divergence.
    pub fn crossing(&self, index: usize, across: &Across, beams: &RayBatch, lane: usize, range: f32) -> Vec3 {
        let [cos, sin] = self.places[index];
        let [horizontal, vertical] = self.half_angles;
        let c = cos * across.turn[0][lane] - sin * across.turn[1][lane];
        let s = sin * across.turn[0][lane] + cos * across.turn[1][lane];
        let vector = |[x, y, z]: [&[f32; LANES]; 3]| Vec3::new(x[lane], y[lane], z[lane]);
        let [left, up] = [&across.left, &across.up].map(|[x, y, z]| vector([x, y, z]));
        vector([&beams.org_x, &beams.org_y, &beams.org_z])
            + vector([&beams.dir_x, &beams.dir_y, &beams.dir_z]) * range
            + left * (self.start * c - horizontal * range * s)
            + up * (self.start * s + vertical * range * c)
    }

    /// Sub-ray `index` of every beam of the block: `beams` deflected according to `across`. Their range limits and
    /// times are copied.
    pub fn rays(&self, index: usize, across: &Across, beams: &RayBatch, rays: &mut RayBatch) {
        (rays.range_max, rays.time, rays.beam) = (beams.range_max, beams.time, beams.beam);
        let RayBatch { org_x, org_y, org_z, dir_x, dir_y, dir_z, .. } = rays;
        aim::spread(
            self.places[index],
            self.start,
            self.half_angles,
            &across.left,
            &across.up,
            &across.turn,
            [&beams.org_x, &beams.org_y, &beams.org_z],
            [&beams.dir_x, &beams.dir_y, &beams.dir_z],
            [org_x, org_y, org_z],
            [dir_x, dir_y, dir_z],
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::math::erf;

    /// Sub-rays of a beam along x at `range` m: place across it, left and up.
    fn crossings(footprint: &Footprint, range: f32, turn: f32) -> Vec<[f64; 2]> {
        let mut beams = RayBatch::default();
        beams.dir_x[0] = 1.0;
        let mut across = Across::default();
        across.set(0, Vec3::X, Vec3::Z, turn);
        let mut rays = RayBatch::default();
        (0..footprint.count())
            .map(|index| {
                footprint.rays(index, &across, &beams, &mut rays);
                let length = range / rays.dir_x[0];
                let at = |org: f32, dir: f32| f64::from(org + dir * length);
                [at(rays.org_y[0], rays.dir_y[0]), at(rays.org_z[0], rays.dir_z[0])]
            })
            .collect()
    }

    /// The part of the light on the near side of an edge at `x0` from the axis is `(1 + erf(sqrt 2 x0/w))/2`; measured
    /// bounds of the spiral over |x0| <= 1.2 w and all rotations.
    #[test]
    fn a_knife_edge_divides_the_beam_by_the_error_function() {
        for (count, most) in [(19, 0.13), (64, 0.06), (256, 0.025)] {
            let footprint = Footprint::new(count, 0.012, [3e-3, 1.5e-3]);
            for (range, axis) in [(0.0f32, 0), (2.0, 1), (50.0, 0), (50.0, 1)] {
                let phi = [1.5e-3, 0.75e-3][axis];
                let w = f64::hypot(6e-3, phi * f64::from(range));
                for turn in 0..24 {
                    let places = crossings(&footprint, range, turn as f32 / 24.0);
                    for step in -12..=12 {
                        let x0 = 0.1 * f64::from(step);
                        let near = places.iter().filter(|place| place[axis] < x0 * w).count() as f64 / count as f64;
                        let expected = (1.0 + erf(2f64.sqrt() * x0)) / 2.0;
                        assert!((near - expected).abs() <= most, "{count} {range} m {x0}: {near} {expected}");
                    }
                }
            }
        }
        // Values of the law.
        for (x0, expected) in [(0.25, 0.691_462), (0.5, 0.841_345), (1.0, 0.977_250)] {
            assert!(((1.0 + erf(2f64.sqrt() * x0)) / 2.0 - expected).abs() < 1e-6);
        }
    }

    /// In rounds it is the same footprint, and the first 8, 16 and 32 of its rays divide the light at edges nearly as
    /// well as a spiral of as many does: measured bounds over |x0| <= 1.2 w, all rotations and directions.
    #[test]
    fn the_first_rays_of_rounds_represent_the_beam() {
        let (rounds, spiral) = (Footprint::in_rounds(0.012, [3e-3; 2]), Footprint::new(64, 0.012, [3e-3; 2]));
        let sorted = |footprint: &Footprint| {
            let mut places = footprint.places.clone();
            places.sort_by(|a, b| a[0].total_cmp(&b[0]));
            places
        };
        assert_eq!(sorted(&rounds), sorted(&spiral));
        for (count, most) in [(8, 0.23), (16, 0.16), (32, 0.09), (64, 0.05)] {
            let mut worst = 0.0f64;
            for turn in 0..48 {
                let places = crossings(&rounds, 0.0, turn as f32 / 48.0);
                for step in -12..=12 {
                    let x0 = 0.1 * f64::from(step);
                    let near = places[..count].iter().filter(|place| place[0] < x0 * 6e-3).count() as f64;
                    worst = worst.max((near / count as f64 - (1.0 + erf(2f64.sqrt() * x0)) / 2.0).abs());
                }
            }
            assert!(worst <= most, "{count}: {worst}");
        }
    }

    #[test]
    fn neighbours_are_nearest_first() {
        for footprint in [Footprint::in_rounds(0.01, [1e-3; 2]), Footprint::of_pixel(25, [0.004, 0.002])] {
            for (ray, others) in footprint.neighbours().iter().enumerate() {
                let away = |other: u8| {
                    let [from, to] = [ray, usize::from(other)].map(|ray| footprint.places[ray]);
                    f32::hypot(to[0] - from[0], to[1] - from[1])
                };
                assert!(usize::from(others[0]) == ray && others.len() == footprint.count());
                assert!(others.windows(2).all(|pair| away(pair[0]) <= away(pair[1])));
            }
        }
    }

    /// A fan has the rays that are computed one for all beams.
    #[test]
    fn fans_are_the_rays_of_a_beam() {
        let footprint = Footprint::in_rounds(0.012, [3e-3, 1.5e-3]);
        let (mut beams, mut across, mut rays) = (RayBatch::default(), Across::default(), RayBatch::default());
        let direction = Vec3::new(0.6, 0.64, 0.48);
        (beams.dir_x[5], beams.dir_y[5], beams.dir_z[5]) = direction.into();
        (beams.org_x[5], beams.org_y[5], beams.org_z[5]) = (1.0, 2.0, 3.0);
        across.set(5, direction, Vec3::Z, 0.3);
        let mut fan = SubRayFan::default();
        footprint.fan(&across, &beams, 5, &mut fan);
        for ray in 0..footprint.count() {
            footprint.rays(ray, &across, &beams, &mut rays);
            assert_eq!(fan.origin.map(|axis| axis[ray]), rays.origin(5).to_array());
            assert_eq!(fan.direction.map(|axis| axis[ray]), rays.direction(5).to_array());
        }
    }

    /// Light within a circle: `1 - exp(-2 r^2/w^2)`, of which 0.393469 is within w/2, 0.864665 within w, 0.988891
    /// within 1.5 w; half is within the half maximum, 1.17741 w wide.
    #[test]
    fn circles_encircle_their_part_of_the_light() {
        let count = 1000;
        let footprint = Footprint::new(count, 0.012, [3e-3; 2]);
        for range in [0.0f32, 50.0] {
            let w = f64::hypot(6e-3, 1.5e-3 * f64::from(range));
            let places = crossings(&footprint, range, 0.1);
            for (radius, expected) in [(0.5, 0.393_469), (1.0, 0.864_665), (1.5, 0.988_891), (1.177_41 / 2.0, 0.5)] {
                let within = places.iter().filter(|[y, z]| y.hypot(*z) < radius * w).count();
                let found = within as f64 / count as f64;
                // To within one ray.
                assert!((found - expected).abs() <= 1.0 / count as f64, "{radius} w at {range} m: {found}");
            }
        }
    }

    /// Sub-rays of a pixel fill it evenly, in every part of it.
    #[test]
    fn pixels_are_filled() {
        let (count, width, height) = (64, 0.004, 0.002);
        let places = crossings(&Footprint::of_pixel(count, [width, height]), 1.0, 0.0);
        for (axis, size) in [width, height].into_iter().enumerate() {
            for edge in -4..=4 {
                let part = 0.5 + f64::from(edge) / 8.0;
                let below = places.iter().filter(|place| place[axis] < (part - 0.5) * size).count() as f64;
                assert!((below / count as f64 - part).abs() < 0.05, "axis {axis}, {part}: {below}");
            }
        }
    }

    /// Half of the mean square of the distance from the axis, in w^2, is 1/4 on either axis.
    #[test]
    fn beams_widen_as_hyperbolas() {
        let footprint = Footprint::new(512, 0.012, [3e-3, 1.5e-3]);
        for range in [0.0f32, 4.0, 100.0] {
            let places = crossings(&footprint, range, 0.3);
            for (axis, phi) in [1.5e-3, 0.75e-3].into_iter().enumerate() {
                let mean_square = places.iter().map(|place| place[axis] * place[axis]).sum::<f64>() / 512.0;
                let w = f64::hypot(6e-3, phi * f64::from(range));
                assert!((mean_square / (w * w / 4.0) - 1.0).abs() < 0.02, "{range} m, axis {axis}");
            }
        }
    }
}
