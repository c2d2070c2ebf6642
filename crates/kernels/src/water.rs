//! Rays of sound through layered water, side by side: arcs in slabs in which sound speed is linear in depth, and how
//! rays pass from one to the next.
//!
//! Formulas: Jensen, Kuperman, Porter, Schmidt, "Computational Ocean Acoustics", 2nd ed., chapter 3. Every length is in
//! m, every time in s, every speed in m/s, every loss in dB; depth and sines of grazing angles are positive downwards.

use crate::level::kernels;

/// Rays of a group: as many as the widest vectors hold.
pub const WIDTH: usize = 8;

/// A number of every ray of a group.
pub type Eight<T = f64> = [T; WIDTH];

/// Water between two depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Depth of its top, m.
    pub top: f64,
    /// Depth of its bottom, m; infinite for the last slab.
    pub bottom: f64,
    /// Speed of sound at its top, m/s.
    pub speed: f64,
    /// Increase of speed with depth, 1/s.
    pub gradient: f64,
    /// Density, kg/m^3.
    pub density: f64,
    /// Absorption at its top, dB/m.
    pub absorption: f64,
    /// Increase of absorption with depth, dB/m per m.
    pub absorption_slope: f64,
}

impl Slab {
    /// Speed of sound at `depth`, m, in m/s.
    #[inline(always)]
    #[must_use]
    pub fn speed_at(&self, depth: f64) -> f64 {
        // The last slab has no bottom, but then no gradient either.
        if self.gradient == 0.0 { self.speed } else { self.speed + self.gradient * (depth - self.top) }
    }

    /// Absorption at `depth`, m, in dB/m.
    #[inline(always)]
    #[must_use]
    pub fn absorption_at(&self, depth: f64) -> f64 {
        self.absorption + self.absorption_slope * (depth - self.top)
    }

    /// The parts above and below `depth`, which is within it.
    #[must_use]
    pub fn split(&self, depth: f64) -> (Slab, Slab) {
        let (speed, absorption) = (self.speed_at(depth), self.absorption_at(depth));
        (Slab { bottom: depth, ..*self }, Slab { top: depth, speed, absorption, ..*self })
    }
}

/// An angle that a ray turns by.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Its sine.
    pub sin: f64,
    /// Its cosine.
    pub cos: f64,
    /// Its sine over itself.
    pub sinc: f64,
}

impl Turn {
    /// The turn by an angle of at most 0.02 rad, by the series, to 2e-14.
    #[inline(always)]
    #[must_use]
    pub fn small(angle: f64) -> Turn {
        let q = angle * angle;
        let sinc = 1.0 - q * (1.0 / 6.0) * (1.0 - q * (1.0 / 20.0));
        Turn { sin: angle * sinc, cos: 1.0 - q * 0.5 * (1.0 - q * (1.0 / 12.0) * (1.0 - q * (1.0 / 30.0))), sinc }
    }

    /// The turn by any angle.
    #[must_use]
    pub fn of(angle: f64) -> Turn {
        if angle.abs() <= 0.02 {
            return Turn::small(angle);
        }
        let (sin, cos) = angle.sin_cos();
        Turn { sin, cos, sinc: sin / angle }
    }
}

/// Depth and direction of a ray, and the sound speed there.
#[derive(Clone, Copy, Debug)]
pub struct RayCourse {
    /// Depth, m.
    pub depth: f64,
    /// Sine of the grazing angle.
    pub sine: f64,
    /// Cosine of the grazing angle over sound speed, s/m: the same from slab to slab (Snell).
    pub snell: f64,
    /// Sound speed there.
    pub speed: f64,
}

/// A stretch of a ray within a slab.
#[derive(Clone, Copy, Debug)]
pub struct Arc {
    /// Its horizontal length, m.
    pub level: f64,
    /// Depth at its end, m.
    pub depth: f64,
    /// Sine of the grazing angle there.
    pub sine: f64,
    /// Speed there, m/s.
    pub speed: f64,
    /// Depth in its middle, m.
    pub middle_depth: f64,
    /// Speed there, m/s.
    pub middle_speed: f64,
}

/// Greatest relative change of speed along an arc for which [`Arc::time`] is used: the error of the rule is less than a
/// 120th of its fourth power, relative to the time.
pub const SHORT: f64 = 0.02;

impl Arc {
    /// The arc of `length` m from a point on, along which speed has a `gradient`. `half` and `quarter`: turns by half
    /// and a quarter of the angle that the ray turns by, upwards where sound is faster below.
    ///
    /// The grazing angle falls linearly with length; a chord is `length sinc(half)` long, in the direction of the
    /// middle of the arc.
    #[inline(always)]
    #[must_use]
    pub fn bent(from: &RayCourse, gradient: f64, length: f64, half: Turn, quarter: Turn) -> Arc {
        let cosine = from.snell * from.speed;
        let middle = [from.sine * half.cos - cosine * half.sin, cosine * half.cos + from.sine * half.sin];
        let fall = length * middle[0] * half.sinc;
        // Depth at the middle of the arc, by half the arc.
        let half_fall = 0.5 * length * (from.sine * quarter.cos - cosine * quarter.sin) * quarter.sinc;
        Arc {
            level: length * middle[1] * half.sinc,
            depth: from.depth + fall,
            sine: middle[0] * half.cos - middle[1] * half.sin,
            speed: from.speed + gradient * fall,
            middle_depth: from.depth + half_fall,
            middle_speed: from.speed + gradient * half_fall,
        }
    }

    /// [`Arc::bent`] where speed changes by no more than [`SHORT`].
    #[inline(always)]
    #[must_use]
    pub fn short(from: &RayCourse, gradient: f64, length: f64) -> Arc {
        let half = 0.5 * gradient * from.snell * length;
        Arc::bent(from, gradient, length, Turn::small(half), Turn::small(0.5 * half))
    }

    /// Time along it, by Simpson's rule.
    #[inline(always)]
    #[must_use]
    pub fn time(&self, from: &RayCourse, length: f64) -> f64 {
        // 1 / a + 4 / b + 1 / c, with one division.
        let [a, b, c] = [from.speed, self.middle_speed, self.speed];
        length * (1.0 / 6.0) * ((b * (a + c) + 4.0 * a * c) / (a * b * c))
    }

    /// Integral of speed over it, m^2/s, by Simpson's rule.
    #[inline(always)]
    #[must_use]
    pub fn speed_path(&self, from: &RayCourse, length: f64) -> f64 {
        length * (1.0 / 6.0) * (from.speed + 4.0 * self.middle_speed + self.speed)
    }

    /// Loss by absorption along it, dB: Simpson's rule.
    #[inline(always)]
    #[must_use]
    pub fn absorbed(&self, from: &RayCourse, slab: &Slab, length: f64) -> f64 {
        let ends = slab.absorption_at(from.depth) + slab.absorption_at(self.depth);
        length * (1.0 / 6.0) * (ends + 4.0 * slab.absorption_at(self.middle_depth))
    }
}

/// Length of the arc to a boundary `fall` m above or below that the ray reaches without turning over, given the sines
/// of its grazing angles here and there, without signs, and its curvature, 1/m; infinite where it turns by more than
/// 0.06 rad on the way.
#[inline(always)]
#[must_use]
pub fn short_way(fall: f64, [sine, sine_there]: [f64; 2], curvature: f64) -> f64 {
    // Half the angle of the arc: its tangent is the difference of the cosines over the sum of the sines.
    let part = fall / (sine + sine_there);
    let tangent = curvature * part;
    // The arc tangent's power series, to 1e-12.
    let square = tangent * tangent;
    let series = 1.0 - square * (1.0 / 3.0 - square * (1.0 / 5.0 - square * (1.0 / 7.0)));
    if tangent < 0.03 { 2.0 * part * series } else { f64::INFINITY }
}

/// Part of the energy that passes a boundary without losses, given densities times speeds on both sides, and the sines
/// of the grazing angles there.
#[inline(always)]
#[must_use]
pub fn transmittance([here, there]: [f64; 2], [sine, sine_there]: [f64; 2]) -> f64 {
    let (a, b) = (here * sine_there, there * sine);
    4.0 * a * b / ((a + b) * (a + b))
}

/// Whether speeds or densities differ by more than rounding.
#[inline(always)]
#[must_use]
pub fn differ(a: f64, b: f64) -> bool {
    const SAME: f64 = 1e-12;
    (a - b).abs() > SAME * a
}

/// A sine, made safe to divide by.
#[inline(always)]
#[must_use]
pub fn steep(sine: f64) -> f64 {
    const LEAST: f64 = 1e-6;
    if sine.abs() < LEAST { LEAST.copysign(sine) } else { sine }
}

/// Rays side by side.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct WaterRays {
    /// Origin of the vertical plane of each, m.
    pub start: [Eight; 2],
    /// Horizontal unit vector in that plane.
    pub heading: [Eight; 2],
    /// Horizontal distance from its start, m.
    pub distance: Eight,
    /// Depth, m.
    pub depth: Eight,
    /// Sine of the grazing angle.
    pub sine: Eight,
    /// As in [`RayCourse`].
    pub snell: Eight,
    /// Sound speed there, m/s.
    pub speed: Eight,
    /// Time since the start, s.
    pub time: Eight,
    /// Path since the start, m.
    pub path: Eight,
    /// Loss by absorption and mirrors since the start, dB.
    pub absorbed: Eight,
    /// Part of the energy transmitted by boundaries between slabs, 0 to 1.
    pub transmitted: Eight,
    /// Integral of speed over the path, m^2/s.
    pub speed_path: Eight,
    /// Width of the tube within the vertical plane per radian at the start, m; negative beyond a caustic.
    pub tube: Eight,
    /// Widening of the tube per m^2/s of `speed_path`, s/m: constant within a slab.
    pub widening: Eight,
    /// Decrease of `snell` per radian that the start points further down, with its sign inverted by every reflection,
    /// s/m.
    pub turn: Eight,
    /// Index of the slab.
    pub slab: Eight<u32>,
}

impl Default for WaterRays {
    fn default() -> Self {
        WaterRays {
            start: [[0.0; WIDTH]; 2],
            heading: [[0.0; WIDTH]; 2],
            distance: [0.0; WIDTH],
            depth: [0.0; WIDTH],
            sine: [0.0; WIDTH],
            snell: [0.0; WIDTH],
            speed: [1.0; WIDTH],
            time: [0.0; WIDTH],
            path: [0.0; WIDTH],
            absorbed: [0.0; WIDTH],
            transmitted: [1.0; WIDTH],
            speed_path: [0.0; WIDTH],
            tube: [0.0; WIDTH],
            widening: [0.0; WIDTH],
            turn: [0.0; WIDTH],
            slab: [0; WIDTH],
        }
    }
}

/// Where rays stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Stop {
    /// They are not traced any further.
    #[default]
    Ended,
    /// Within a slab, or at its boundary on the other side: they continue.
    Onward,
    /// At the upper boundary of their slab, not yet through it: the surface, a boundary that reflects everything, or
    /// the axis of a duct.
    Top,
    /// At the lower one.
    Bottom,
    /// Before a stretch on which they turn over, or along which they stay level.
    Level,
}

/// A straight line in place of stretches of a ray.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Chords {
    /// Where it starts, m.
    pub from: [Eight<f32>; 3],
    /// Unit vector along it.
    pub along: [Eight<f32>; 3],
    /// Its length, m.
    pub length: Eight<f32>,
    /// Whether something may be hit along it; undefined for rays that have ended.
    pub traced: Eight<bool>,
}

impl Default for Chords {
    fn default() -> Self {
        Chords { from: [[0.0; WIDTH]; 3], along: [[0.0; WIDTH]; 3], length: [0.0; WIDTH], traced: [false; WIDTH] }
    }
}

/// Limits of arcs within a slab.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Greatest speed, m/s.
    pub fastest: f64,
    /// An arc along which speed changes by no more than [`SHORT`] of itself is no longer than this, s, times the speed.
    pub short: f64,
    /// An arc that is near its chord is no longer than this, (m s)^(1/2), over the square root of its `snell`.
    pub chord: f64,
    /// Whether nothing can be hit there.
    pub empty: bool,
}

impl Limits {
    /// The limits in `slab`; `sagitta`: how far an arc may be from its chord, m.
    #[must_use]
    pub fn new(slab: &Slab, sagitta: f64, empty: bool) -> Limits {
        let gradient = slab.gradient.abs();
        let bottom = if slab.gradient > 0.0 { slab.speed_at(slab.bottom) } else { 0.0 };
        // Arc and chord are length^2 / (8 radius) apart, and the radius is 1 / (gradient snell).
        let chord = if empty { f64::INFINITY } else { (8.0 * sagitta / gradient).sqrt() };
        Limits { fastest: slab.speed.max(bottom), short: SHORT / gradient, chord, empty }
    }
}

/// A distance, m, that sound of at most the speed `fastest` does not reach in `time`, s.
#[inline(always)]
#[must_use]
pub fn farther(fastest: f64, time: f64) -> f64 {
    time * fastest + 1e-3
}

/// Slabs of a group's rays: a column for each of their properties.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Slabs {
    top: Eight,
    bottom: Eight,
    speed: Eight,
    gradient: Eight,
    density: Eight,
    absorption: Eight,
    absorption_slope: Eight,
    fastest: Eight,
    short: Eight,
    chord: Eight,
}

impl Slabs {
    #[inline(always)]
    fn new() -> Slabs {
        Slabs {
            top: [0.0; WIDTH],
            bottom: [0.0; WIDTH],
            speed: [1.0; WIDTH],
            gradient: [0.0; WIDTH],
            density: [1.0; WIDTH],
            absorption: [0.0; WIDTH],
            absorption_slope: [0.0; WIDTH],
            fastest: [1.0; WIDTH],
            short: [0.0; WIDTH],
            chord: [0.0; WIDTH],
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, slab: &Slab, limits: &Limits) {
        self.top[i] = slab.top;
        self.bottom[i] = slab.bottom;
        self.speed[i] = slab.speed;
        self.gradient[i] = slab.gradient;
        self.density[i] = slab.density;
        self.absorption[i] = slab.absorption;
        self.absorption_slope[i] = slab.absorption_slope;
        self.fastest[i] = limits.fastest;
        self.short[i] = limits.short;
        self.chord[i] = limits.chord;
    }

    #[inline(always)]
    fn get(&self, i: usize) -> Slab {
        Slab {
            top: self.top[i],
            bottom: self.bottom[i],
            speed: self.speed[i],
            gradient: self.gradient[i],
            density: self.density[i],
            absorption: self.absorption[i],
            absorption_slope: self.absorption_slope[i],
        }
    }
}

#[inline(always)]
fn pick(yes: bool, a: f64, b: f64) -> f64 {
    if yes { a } else { b }
}

/// The water that rays are traced through.
pub struct Through<'a> {
    /// From the surface down.
    pub slabs: &'a [Slab],
    /// Limits of arcs in each of `slabs`.
    pub limits: &'a [Limits],
    /// Greatest distance of a ray from the chord that is traced in its place, m.
    pub sagitta: f64,
    /// z of the surface, m.
    pub surface_z: f64,
    /// Least and greatest coordinates of what can be hit, m.
    pub bounds: [[f64; 3]; 2],
}

kernels! {
    /// Advances every ray of every group that is not [`Stop::Ended`] as far as one chord may replace it, or to where it
    /// stops; `starts` are the rays where their chords start. `latest`: when rays end, s.
    pub fn lead(
        water: &Through<'_>,
        latest: &[Eight],
        rays: &mut [WaterRays],
        starts: &mut [WaterRays],
        chords: &mut [Chords],
        stops: &mut [Eight<Stop>],
    ) {
        let ends = starts.iter_mut().zip(chords).zip(stops);
        for ((rays, latest), ((start, chords), stops)) in rays.iter_mut().zip(latest).zip(ends) {
            if *stops != [Stop::Ended; WIDTH] {
                lead_group(water, latest, rays, start, chords, stops);
            }
        }
    }
}

/// [`lead`] for one group.
#[inline(always)]
fn lead_group(
    water: &Through<'_>,
    latest: &Eight,
    rays: &mut WaterRays,
    start: &mut WaterRays,
    chords: &mut Chords,
    stops: &mut Eight<Stop>,
) {
    /// Stretches in one chord, at most.
    const MOST: usize = 256;
    *start = *rays;
    let mut here = Slabs::new();
    let mut empty = [false; WIDTH];
    let mut going = [false; WIDTH];
    for i in 0..WIDTH {
        if stops[i] != Stop::Ended {
            let limits = &water.limits[rays.slab[i] as usize];
            here.set(i, &water.slabs[rays.slab[i] as usize], limits);
            empty[i] = limits.empty;
            (going[i], stops[i]) = (true, Stop::Onward);
        }
    }
    // 1 / sqrt(snell), which is constant.
    let mut root = [0.0; WIDTH];
    for i in 0..WIDTH {
        root[i] = 1.0 / rays.snell[i].sqrt();
    }
    // Length and turn of the chords' arcs so far.
    let (mut way, mut turned) = ([0.0; WIDTH], [0.0; WIDTH]);
    for _ in 0..MOST {
        let (mut down, mut crosses, mut level) = ([false; WIDTH], [false; WIDTH], [false; WIDTH]);
        for i in 0..WIDTH {
            let slab = here.get(i);
            let at = RayCourse { depth: rays.depth[i], sine: rays.sine[i], snell: rays.snell[i], speed: rays.speed[i] };
            let (gradient, sine) = (slab.gradient, at.sine.abs());
            let falls = at.sine > 0.0;
            let straight = gradient == 0.0;
            let bound = pick(falls, slab.bottom, slab.top);
            let fall = (bound - at.depth).abs();
            let curvature = gradient.abs() * at.snell;
            // Rays bend away from the side where sound is faster: there they may turn over.
            let cosine = at.snell * slab.speed_at(bound);
            let over = (falls == (gradient > 0.0)) & !straight & (cosine >= 1.0);
            let cosine = cosine.min(1.0);
            let sine_there = pick(straight, sine, (1.0 - cosine * cosine).sqrt());
            let exit = pick(over, f64::INFINITY, short_way(fall, [sine, sine_there], curvature));
            // How far one arc may take it.
            let rest = farther(here.fastest[i], latest[i] - rays.time[i]);
            let most = rest.min(here.chord[i] * root[i]).min(here.short[i] * at.speed);
            let flat = (at.sine == 0.0) | (over & (most * curvature >= 2.0 * sine));
            let length = exit.min(most);
            let turn = curvature * length;
            // No arc that turns by this much over this length is farther from its chord.
            let fits = (way[i] == 0.0) | empty[i] | ((way[i] + length) * (turned[i] + turn) <= 4.0 * water.sagitta);
            let goes = going[i] & (rays.time[i] < latest[i]);
            let takes = goes & fits & !flat;
            let arc = Arc::short(&at, gradient, length);
            let speed_path = arc.speed_path(&at, length);
            rays.distance[i] += pick(takes, arc.level, 0.0);
            rays.depth[i] = pick(takes, arc.depth, at.depth);
            rays.sine[i] = pick(takes, arc.sine, at.sine);
            rays.speed[i] = pick(takes, arc.speed, at.speed);
            rays.time[i] += pick(takes, arc.time(&at, length), 0.0);
            rays.path[i] += pick(takes, length, 0.0);
            rays.absorbed[i] += pick(takes, arc.absorbed(&at, &slab, length), 0.0);
            rays.speed_path[i] += pick(takes, speed_path, 0.0);
            rays.tube[i] += pick(takes, rays.widening[i] * speed_path, 0.0);
            way[i] += pick(takes, length, 0.0);
            turned[i] += pick(takes, turn, 0.0);
            going[i] = takes;
            down[i] = falls;
            crosses[i] = takes & (exit <= most);
            level[i] = goes & fits & flat;
        }
        let mut there = here;
        let (mut next, mut changes) = (rays.slab, [false; WIDTH]);
        for i in 0..WIDTH {
            if level[i] {
                stops[i] = Stop::Level;
            }
            if crosses[i] {
                next[i] = if down[i] { rays.slab[i] + 1 } else { rays.slab[i].wrapping_sub(1) };
                match water.slabs.get(next[i] as usize).zip(water.limits.get(next[i] as usize)) {
                    Some((slab, limits)) => {
                        there.set(i, slab, limits);
                        changes[i] = limits.empty != empty[i];
                    }
                    // The surface.
                    None => (crosses[i], going[i], stops[i]) = (false, false, Stop::Top),
                }
            }
        }
        let (mut held, mut refracts) = ([false; WIDTH], [false; WIDTH]);
        if cross([&here, &there], rays, &down, &mut crosses, [&mut held, &mut refracts]) {
            refract([&here, &there], rays, &down, &refracts);
        }
        let mut fits = [false; WIDTH];
        look_ahead(water, &there, rays, [&root, &way, &turned], &mut fits);
        let mut goes_on = false;
        for i in 0..WIDTH {
            if held[i] {
                (going[i], stops[i]) = (false, if down[i] { Stop::Bottom } else { Stop::Top });
            }
            if crosses[i] {
                rays.slab[i] = next[i];
                going[i] &= !changes[i];
            }
            // Surfaces where the water changes are hit on the side that the ray comes from.
            going[i] &= empty[i] | (fits[i] & !refracts[i]);
            goes_on |= going[i];
        }
        // Rays that do not pass have stopped: their entries are not used.
        here = there;
        if !goes_on {
            break;
        }
    }
    write_chords(water, rays, start, &empty, chords);
}

/// Passes rays through the boundaries between their slabs, without refraction; those that are held there turn over, or
/// are reflected. Returns whether any are refracted.
#[inline(always)]
fn cross(
    [here, there]: [&Slabs; 2],
    rays: &mut WaterRays,
    down: &[bool; WIDTH],
    crosses: &mut [bool; WIDTH],
    [held, refracts]: [&mut [bool; WIDTH]; 2],
) -> bool {
    let mut any = false;
    for i in 0..WIDTH {
        let (slab, next) = (here.get(i), there.get(i));
        let depth = pick(down[i], slab.bottom, slab.top);
        let (from, to) = (slab.speed_at(depth), next.speed_at(depth));
        let bends = differ(from, to) | differ(slab.density, next.density);
        let side = pick(down[i], 1.0, -1.0);
        let axis = !bends & (side * next.gradient > 0.0) & (side * slab.gradient < 0.0);
        let stays = (bends & (rays.snell[i] * to >= 1.0)) | axis;
        let passes = crosses[i] & !stays;
        let sine = side * rays.sine[i].abs();
        // Without refraction, the widening of the tube changes only with the gradient.
        let change = (slab.gradient - next.gradient) * rays.snell[i] * rays.snell[i] * rays.tube[i] / steep(sine);
        rays.depth[i] = pick(passes, depth, rays.depth[i]);
        rays.sine[i] = pick(passes, sine, rays.sine[i]);
        rays.speed[i] = pick(passes, to, rays.speed[i]);
        rays.widening[i] += pick(passes & !bends, change, 0.0);
        held[i] = crosses[i] & stays;
        crosses[i] = passes;
        refracts[i] = passes & bends;
        any |= refracts[i];
    }
    any
}

/// Refracts rays at the boundaries between their slabs.
#[inline(always)]
fn refract([here, there]: [&Slabs; 2], rays: &mut WaterRays, down: &[bool; WIDTH], refracts: &[bool; WIDTH]) {
    for i in 0..WIDTH {
        let (slab, next) = (here.get(i), there.get(i));
        let from = slab.speed_at(rays.depth[i]);
        let cosine_on = rays.snell[i] * rays.speed[i];
        let sine = rays.sine[i].abs().max(1e-9);
        let sine_on = (1.0 - cosine_on * cosine_on).sqrt().max(1e-9);
        let on = pick(down[i], sine_on, -sine_on);
        let part = transmittance([slab.density * from, next.density * rays.speed[i]], [sine, sine_on]);
        let tube = rays.tube[i] * (sine_on / sine);
        let widening = (rays.turn[i] - next.gradient * rays.snell[i] * rays.snell[i] * tube) / steep(on);
        rays.sine[i] = pick(refracts[i], on, rays.sine[i]);
        rays.transmitted[i] *= pick(refracts[i], part, 1.0);
        rays.tube[i] = pick(refracts[i], tube, rays.tube[i]);
        rays.widening[i] = pick(refracts[i], widening, rays.widening[i]);
    }
}

/// Whether the path of each ray through the slab that it comes to fits into its chord, too. `way` and `turned`: length
/// and turn of the chord's arcs so far; `root`: 1 / sqrt(snell).
#[inline(always)]
fn look_ahead(
    water: &Through<'_>,
    there: &Slabs,
    rays: &WaterRays,
    [root, way, turned]: [&Eight; 3],
    fits: &mut [bool; WIDTH],
) {
    for i in 0..WIDTH {
        let slab = there.get(i);
        let length = ((slab.bottom - slab.top) / rays.sine[i].abs()).min(there.chord[i] * root[i]);
        let turn = turned[i] + slab.gradient.abs() * rays.snell[i] * length;
        // NaN where a straight path does not end.
        fits[i] = ((way[i] + length) * turn).max(0.0) <= 4.0 * water.sagitta;
    }
}

/// Writes the chords from `start` to where `rays` are now, and whether they come near what can be hit.
#[inline(always)]
fn write_chords(water: &Through<'_>, rays: &WaterRays, start: &WaterRays, empty: &[bool; WIDTH], chords: &mut Chords) {
    // A hit on the box itself is one on its contents.
    let margin = 2.0 * water.sagitta;
    for i in 0..WIDTH {
        let (level, fall) = (rays.distance[i] - start.distance[i], rays.depth[i] - start.depth[i]);
        let length = (level * level + fall * fall).sqrt();
        let per_length = 1.0 / length;
        let heading = [start.heading[0][i], start.heading[1][i]];
        let along = [heading[0] * level * per_length, heading[1] * level * per_length, -fall * per_length];
        let from = [
            start.start[0][i] + heading[0] * start.distance[i],
            start.start[1][i] + heading[1] * start.distance[i],
            water.surface_z - start.depth[i],
        ];
        let mut near = (length > 0.0) & !empty[i];
        for axis in 0..3 {
            let to = from[axis] + along[axis] * length;
            let [low, high] = [water.bounds[0][axis] - margin, water.bounds[1][axis] + margin];
            near &= (from[axis].max(to) >= low) & (from[axis].min(to) <= high);
            chords.from[axis][i] = from[axis] as f32;
            chords.along[axis][i] = along[axis] as f32;
        }
        chords.length[i] = length as f32;
        chords.traced[i] = near;
    }
}
