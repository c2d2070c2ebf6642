//! Sound returned by surfaces, and its extent in range: many arrivals side by side.

use crate::level::kernels;
use crate::math::{exp2, log2};

/// Arrivals at a time.
pub const WAYS: usize = 64;

/// A number for each.
pub type ArrivalRow<T = f32> = [T; WAYS];

/// Steps of the tables of laws, even in `sqrt(1 - sine of the grazing angle)`, fine at both ends: 0.16 degrees near
/// normal incidence, half a degree at grazing.
pub const STEPS: usize = 512;

/// Paths of sound out to a surface and back. Vectors are in the world frame, those at the start in the sensor frame.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Ways {
    /// Unit vector along the ray where it arrives.
    pub direction: [ArrivalRow; 3],
    /// The same for the ray along which the echo returns, as if it went out.
    pub back: [ArrivalRow; 3],
    /// Normal of the surface, of any length.
    pub normal: [ArrivalRow; 3],
    /// Unit vectors along the ray where it starts, and perpendicular to it, sensor frame.
    pub launch: [ArrivalRow; 3],
    /// See `launch`.
    pub tangent: [ArrivalRow; 3],
    /// Size of the ray's cell of directions along the tangent, and perpendicular to both, rad.
    pub cell: ArrivalRow,
    /// See `cell`.
    pub aside: ArrivalRow,
    /// Widths of the tube of the ray per radian at the start, m: in its vertical plane, and perpendicular to it.
    pub tube: [ArrivalRow; 2],
    /// The same for the return path.
    pub back_tube: [ArrivalRow; 2],
    /// Lengths of the outward and return paths, m.
    pub path: [ArrivalRow; 2],
    /// Sound speed at the surface over that at the start, for the outward and return paths together.
    pub speed: ArrivalRow,
    /// Where the law of the surface begins in the tables.
    pub law: ArrivalRow<u32>,
    /// Sines of the grazing angles of the outward and return paths.
    pub sines: [ArrivalRow; 2],
    /// log2 of the received energy.
    pub beam_gain: ArrivalRow,
    /// How much the range changes from one side of the ray's cell to the other, m.
    pub reach: ArrivalRow,
    /// Displacement along the surface per metre of that.
    pub slide: [ArrivalRow; 3],
}

impl Default for Ways {
    fn default() -> Ways {
        let ([unit, zero], whole) = ([[1.0; WAYS], [0.0; WAYS]], [0; WAYS]);
        let ahead = [unit, zero, zero];
        Ways {
            direction: ahead,
            back: ahead,
            normal: ahead,
            launch: ahead,
            tangent: [zero, unit, zero],
            cell: zero,
            aside: zero,
            tube: [unit; 2],
            back_tube: [unit; 2],
            path: [unit; 2],
            speed: unit,
            law: whole,
            sines: [unit; 2],
            beam_gain: zero,
            reach: zero,
            slide: [zero; 3],
        }
    }
}

/// Parts of echoes at a time.
pub const PARTS: usize = 64;

/// Parts of one echo that are added together.
pub const RUN: usize = 8;

/// A number for each part, with room for a run at the end.
pub type PartRow<T = f32> = [T; PARTS + RUN];

/// Parts of echoes in range bins.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Parts {
    /// Range bin of the part.
    pub bin: PartRow<u32>,
    /// Ends of the whole echo, in bins.
    pub low: PartRow,
    /// See `low`.
    pub high: PartRow,
    /// Energy of the echo in a bin that it fills, and the least energy of a part.
    pub share: PartRow,
    /// See `share`.
    pub least: PartRow,
    /// Factor of the texture, 1 on average.
    pub rough: PartRow,
    /// Position of the echo's middle along the array, in lengths over which scatterers stay the same; how many of these
    /// a bin spans; and the bin of the middle.
    pub along: PartRow,
    /// See `along`.
    pub slope: PartRow,
    /// See `along`.
    pub middle: PartRow,
    /// The object that the scatterers belong to.
    pub object: PartRow<u32>,
}

impl Default for Parts {
    fn default() -> Parts {
        let ([zero, unit], whole) = ([[0.0; PARTS + RUN], [1.0; PARTS + RUN]], [0; PARTS + RUN]);
        Parts {
            bin: whole,
            low: zero,
            high: zero,
            share: zero,
            least: zero,
            rough: unit,
            along: zero,
            slope: zero,
            middle: zero,
            object: whole,
        }
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a + b x`.
#[inline(always)]
fn plus(a: [f32; 3], b: [f32; 3], x: f32) -> [f32; 3] {
    [a[0] + b[0] * x, a[1] + b[1] * x, a[2] + b[2] * x]
}

#[inline(always)]
fn times(a: [f32; 3], x: f32) -> [f32; 3] {
    [a[0] * x, a[1] * x, a[2] * x]
}

#[inline(always)]
fn at(rows: &[ArrivalRow; 3], lane: usize) -> [f32; 3] {
    [rows[0][lane], rows[1][lane], rows[2][lane]]
}

/// Sine of the grazing angle between a unit vector and a surface with this normal, of any length.
#[inline(always)]
pub fn sine(direction: [f32; 3], normal: [f32; 3]) -> f32 {
    (dot(direction, normal).abs() / dot(normal, normal).sqrt()).clamp(1e-3, 1.0)
}

/// Component of the unit `direction` along a normal of any length, times that, for the extent of a hit: not less than
/// at a grazing angle of 0.6 degrees, as at the rim of a round object the extent would reach far behind it.
#[inline(always)]
pub fn towards(direction: [f32; 3], normal: [f32; 3]) -> f32 {
    const LEAST: f32 = 1e-2;
    let along = dot(direction, normal);
    let least = LEAST * dot(normal, normal).sqrt();
    if along.abs() > least { along } else { least.copysign(along) }
}

/// Position of the sine of a grazing angle in the table of a law, in steps.
#[inline(always)]
pub fn step(sine: f32) -> f32 {
    (1.0 - sine).max(0.0).sqrt() * STEPS as f32
}

/// The step that contains such a position, and the part of it before the position.
#[inline(always)]
pub fn within_step(at: f32) -> (usize, f32) {
    let step = (at as usize).min(STEPS - 1);
    (step, at - step as f32)
}

/// Interpolates between `low` and `high` at the fraction `part`.
#[inline(always)]
pub fn between(low: f32, high: f32, part: f32) -> f32 {
    low * (1.0 - part) + high * part
}

/// log2 of `speed` (pressure follows from intensity by the impedance) over the area of the tube of a ray, whose phase
/// turns `turns` times for each metre of range. At a caustic diffraction limits its width.
#[inline(always)]
pub fn tube_spread([upright, level]: [f32; 2], path: f32, speed: f32, turns: f32) -> f32 {
    let least = path.min((2.0 * path / turns).sqrt());
    log2(speed) - log2((upright.max(least) * level).max(1e-6)).abs()
}

/// log2 of the energy loss on a path of `2^path` m: none within a metre. `law`: powers of the length near and far, and
/// log2 of the length, m, from which on it is far.
#[inline(always)]
pub fn one_way(path: f32, [near, far, from]: [f32; 3]) -> f32 {
    near * path.max(0.0).min(from) + far * (path - from).max(0.0)
}

/// A vector across a ray at its start, carried to where the ray arrives, m: the tube turns with the ray in its vertical
/// plane, and is wider or narrower in that plane than perpendicular to it.
#[inline(always)]
fn carried(across: [f32; 3], launch: [f32; 3], direction: [f32; 3], [upright, level]: [f32; 2]) -> [f32; 3] {
    let aside = |direction: [f32; 3]| {
        let length = (direction[0] * direction[0] + direction[1] * direction[1]).sqrt();
        // For a vertical ray any direction will do.
        let any = if length > 0.0 { 0.0 } else { 1.0 };
        let scale = (1.0 - any) / (length + any);
        [-direction[1] * scale, direction[0] * scale + any, 0.0]
    };
    let (before, now) = (aside(launch), aside(direction));
    let scaled = times(now, level * dot(across, before));
    plus(scaled, cross(direction, now), upright * dot(across, cross(launch, before)))
}

/// [`reaches`]; `BENT`: rays bend (or are reflected), `WIDE`: cells also have a width perpendicular to the tangent.
#[inline(always)]
fn find_reaches<const BENT: bool, const WIDE: bool>(rotation: [[f32; 3]; 3], it: &mut Ways) {
    for lane in 0..WAYS {
        let (direction, back, normal) = (at(&it.direction, lane), at(&it.back, lane), at(&it.normal, lane));
        let [launch, tangent] = [&it.launch, &it.tangent].map(|rows| {
            let [x, y, z] = at(rows, lane);
            plus(plus(times(rotation[0], x), rotation[1], y), rotation[2], z)
        });
        let towards = towards(direction, normal);
        let tube = [it.tube[0][lane], it.tube[1][lane]];
        // From one side of the cell to the other, along the surface: the change of range, and the displacement.
        let side = |across: [f32; 3]| {
            let across = if BENT { carried(across, launch, direction, tube) } else { times(across, tube[1]) };
            let farther = -dot(across, normal) / towards;
            let way = plus(across, direction, farther);
            (0.5 * (farther + dot(way, back)), way)
        };
        let (reach, way) = side(times(tangent, it.cell[lane]));
        let (length, per_metre, way) = if WIDE {
            // The cell's sides combined: length by the spread of both, direction by their mean.
            let (aside, way_aside) = side(times(cross(tangent, launch), it.aside[lane]));
            let square = reach * reach + aside * aside;
            let per_metre = if square > 1e-12 { 1.0 } else { 0.0 } / square.max(1e-12);
            (square.sqrt(), per_metre, plus(times(way, reach), way_aside, aside))
        } else {
            (reach, if reach.abs() > 1e-6 { 1.0 / reach } else { 0.0 }, way)
        };
        it.reach[lane] = length;
        for axis in 0..3 {
            // Zero where there is no displacement, which then need not be a number.
            it.slide[axis][lane] = if per_metre == 0.0 { 0.0 } else { way[axis] * per_metre };
        }
    }
}

kernels! {
    /// Adds the scattering by the laws of the surfaces to the loudness, `log2(s_b / sine in)`; `same`: all return paths
    /// are the outward paths.
    ///
    /// Between two directions `s_b` is the geometric mean of the backscatter into either, our assumption: it is
    /// reciprocal, and turns Lambert's law into `mu sin(in) sin(out)`, which is that law. It has no lobes about the
    /// specular direction.
    pub fn weigh(laws: &[f32], same: bool, it: &mut Ways) {
        let (mut low, mut high, mut part) = ([[0.0; WAYS]; 2], [[0.0; WAYS]; 2], [[0.0; WAYS]; 2]);
        let sides = if same { 1 } else { 2 };
        for side in 0..sides {
            let directions = if side == 0 { &it.direction } else { &it.back };
            for lane in 0..WAYS {
                let sine = sine(at(directions, lane), at(&it.normal, lane));
                it.sines[side][lane] = sine;
                part[side][lane] = step(sine);
            }
            for lane in 0..WAYS {
                let step;
                (step, part[side][lane]) = within_step(part[side][lane]);
                let first = it.law[lane] as usize + step;
                (low[side][lane], high[side][lane]) = (laws[first], laws[first + 1]);
            }
        }
        let value = |side: usize, lane: usize| between(low[side][lane], high[side][lane], part[side][lane]);
        if same {
            it.sines[1] = it.sines[0];
            for lane in 0..WAYS {
                it.beam_gain[lane] += value(0, lane);
            }
        } else {
            for lane in 0..WAYS {
                let sines = log2(it.sines[1][lane] / it.sines[0][lane]);
                it.beam_gain[lane] += 0.5 * (value(0, lane) + value(1, lane) + sines);
            }
        }
    }

    /// Adds the loss by spreading, by the tubes of the rays: of the return path alone, as the outward path determines
    /// the footprint that the ray represents.
    pub fn spread_tubes(turns: f32, it: &mut Ways) {
        for lane in 0..WAYS {
            let tube = [it.back_tube[0][lane], it.back_tube[1][lane]];
            it.beam_gain[lane] += tube_spread(tube, it.path[1][lane], it.speed[lane], turns);
        }
    }

    /// Adds the loss by spreading by a law ([`one_way`]), likewise. Levels do not rise within a metre of the sonar.
    pub fn spread_by(law: [f32; 3], it: &mut Ways) {
        for lane in 0..WAYS {
            let [out, back] = [log2(it.path[0][lane].max(1e-3)), log2(it.path[1][lane].max(1e-3))];
            it.beam_gain[lane] += 2.0 * out - one_way(out, law) - one_way(back, law);
        }
    }

    /// Finds how much the range of echoes changes over the cells of their rays, and the displacement along the surface
    /// per metre of that. `rotation`: columns of the matrix from the sensor to the world; `bent`: any outward path
    /// bends; `wide`: cells also have a width perpendicular to the tangent.
    pub fn reaches(rotation: [[f32; 3]; 3], bent: bool, wide: bool, it: &mut Ways) {
        match (bent, wide) {
            (false, false) => find_reaches::<false, false>(rotation, it),
            (false, true) => find_reaches::<false, true>(rotation, it),
            (true, false) => find_reaches::<true, false>(rotation, it),
            (true, true) => find_reaches::<true, true>(rotation, it),
        }
    }

    /// Divides echoes among their bins: energies of the first [`PARTS`], their square roots, and the positions of their
    /// scatterers along the array, as the words of an address: these positions are less than 2^31.
    pub fn divide(
        parts: &Parts,
        energies: &mut [f32; PARTS],
        amplitudes: &mut [f32; PARTS],
        places: &mut [u32; PARTS],
    ) {
        /// Added to a number, it leaves a whole number in the lower half of the bits.
        const UNIT: f64 = 1.5 * (1u64 << 52) as f64;
        for part in 0..PARTS {
            let bin = parts.bin[part] as i32 as f32;
            let (low, high) = (parts.low[part].max(bin), parts.high[part].min(bin + 1.0));
            let energy = (parts.share[part] * (high - low)).max(parts.least[part]) * parts.rough[part];
            // The middle of what is in the bin.
            let along = parts.along[part] + parts.slope[part] * (0.5 * (low + high) - parts.middle[part]);
            // Shifted, so that not all of them change at once.
            let shift = parts.object[part].wrapping_add(parts.bin[part].wrapping_mul(0x9E37_79B9));
            let place = along + (shift >> 8) as i32 as f32 / (1 << 24) as f32;
            energies[part] = energy;
            amplitudes[part] = energy.sqrt();
            places[part] = (f64::from(place.floor()) + UNIT).to_bits() as u32;
        }
    }

    /// `a *= x`, `b *= x`.
    pub fn scale(x: &[f32; PARTS], a: &mut [f32; PARTS], b: &mut [f32; PARTS]) {
        for part in 0..PARTS {
            a[part] *= x[part];
            b[part] *= x[part];
        }
    }

    /// 2 to the power of each.
    pub fn powers(row: &mut ArrivalRow) {
        for power in row {
            *power = exp2(*power);
        }
    }
}
