//! The water made ready for the rays of one instrument: slabs, in each of which speed and absorption are linear.

use super::profile::{Layer, PHYSICAL_SPEEDS, Profile, SEA_WATER_KG_M3, SpeedRow, WaterRow, unread};
use super::{Absorption, Outside, Water};
use crate::error::{Error, Result};

/// Where absorption changes with depth, slabs are no thicker than this, m, down to [`CONSTANT_FROM`].
const THICKEST: f64 = 500.0;
/// Depth from which on absorption is constant, m: deeper than any sea.
const CONSTANT_FROM: f64 = 12_000.0;
/// Largest error, m/s, of the lines that are drawn through the speeds of a formula.
const SPEED_ERROR: f64 = 0.01;

/// Water between two depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slab {
    /// Depth of its top, m.
    pub top: f64,
    /// Depth of its bottom, m; the last has none and is infinite.
    pub bottom: f64,
    /// Speed of sound at its top, m/s.
    pub speed: f64,
    /// How much faster it gets with depth, 1/s.
    pub gradient: f64,
    /// Density, kg/m^3.
    pub density: f64,
    /// Absorption at its top, dB/m.
    pub absorption: f64,
    /// How much more it gets with depth, dB/m per m.
    pub absorption_slope: f64,
}

/// All the water, from the surface down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Column {
    /// Height of the surface in the world, m.
    pub surface_z: f64,
    /// From depth 0 to infinity; each begins where the one before ends.
    pub slabs: Vec<Slab>,
}

/// Water between two depths, of which the absorption is not known yet.
#[derive(Clone, Copy)]
struct Stretch {
    top: f64,
    bottom: f64,
    /// At the top and at the bottom.
    speed: [f64; 2],
    temperature: [f64; 2],
    salinity: [f64; 2],
    density: f64,
}

impl Stretch {
    /// Of `between`, top and bottom, what is at the part `t` of the thickness.
    fn at([top, bottom]: [f64; 2], t: f64) -> f64 {
        // Not top + (bottom - top) t: both ends shall be met exactly.
        top * (1.0 - t) + bottom * t
    }

    /// From `top` to `bottom`, both within it. What has no end does not change.
    fn part(&self, top: f64, bottom: f64) -> Stretch {
        if self.bottom == f64::INFINITY {
            return Stretch { top, bottom, ..*self };
        }
        let [from, to] = [top, bottom].map(|depth| (depth - self.top) / (self.bottom - self.top));
        let cut = |between: [f64; 2]| [Stretch::at(between, from), Stretch::at(between, to)];
        Stretch {
            top,
            bottom,
            speed: cut(self.speed),
            temperature: cut(self.temperature),
            salinity: cut(self.salinity),
            ..*self
        }
    }
}

impl Slab {
    /// Speed of sound at `depth`, m, in m/s.
    #[inline(always)]
    pub fn speed_at(&self, depth: f64) -> f64 {
        // The last slab has no bottom, but then no gradient either.
        if self.gradient == 0.0 { self.speed } else { self.speed + self.gradient * (depth - self.top) }
    }

    /// Absorption at `depth`, m, in dB/m.
    #[inline(always)]
    pub fn absorption_at(&self, depth: f64) -> f64 {
        self.absorption + self.absorption_slope * (depth - self.top)
    }

    /// What is above and what is below `depth`, which is within it.
    pub fn split(&self, depth: f64) -> (Slab, Slab) {
        let (speed, absorption) = (self.speed_at(depth), self.absorption_at(depth));
        (Slab { bottom: depth, ..*self }, Slab { top: depth, speed, absorption, ..*self })
    }
}

impl Column {
    /// The `water`, which is sound, for a sonar of `frequency_hz` (above 0) at `sonar_depth_m` below the surface; and
    /// what one should know of it.
    ///
    /// # Errors
    /// A sonar above the water, or where the profile says nothing; a profile whose file is not read.
    pub fn new(water: &Water, frequency_hz: f64, sonar_depth_m: f64) -> Result<(Column, Vec<String>)> {
        let covered = |to: f64| match to {
            f64::INFINITY => "0 m or more".to_owned(),
            to => format!("0 to {to} m"),
        };
        let out_of = |from: f64, to: f64, table: &str| {
            let allowed = if sonar_depth_m < 0.0 || table.is_empty() {
                let surface = water.surface_z_m;
                format!("{}, below the surface of the water at z = {surface} m (water.surface_z_m)", covered(to))
            } else if to == f64::INFINITY {
                format!("{from} m or more, where the rows of water.profile.{table} begin")
            } else {
                format!("{from} to {to} m, which the rows of water.profile.{table} cover")
            };
            Error::invalid("the depth of the sonar", format!("{sonar_depth_m} m"), allowed)
        };
        let within = |from: f64, to: f64, table: &str| {
            // Written so that NaN fails too.
            let holds = sonar_depth_m >= from && sonar_depth_m <= to && sonar_depth_m.is_finite();
            if holds { Ok(()) } else { Err(out_of(from, to, table)) }
        };
        let whole = |speed: f64| Stretch {
            top: 0.0,
            bottom: f64::INFINITY,
            speed: [speed; 2],
            temperature: [water.temperature_c; 2],
            salinity: [water.salinity_psu; 2],
            density: SEA_WATER_KG_M3,
        };
        let formula = |row: &WaterRow| {
            water.sound_speed.speed(row.temperature_c, row.salinity_psu, row.depth_m, water.latitude_deg)
        };
        let mut doubts: Vec<Outside> = Vec::new();
        let mut doubt = |row: &WaterRow| {
            for outside in water.sound_speed.outside(row.temperature_c, row.salinity_psu, row.depth_m) {
                if !doubts.iter().any(|known| known.quantity == outside.quantity) {
                    doubts.push(outside);
                }
            }
        };
        let stretches = match &water.profile {
            None => {
                within(0.0, f64::INFINITY, "")?;
                let row = WaterRow {
                    depth_m: sonar_depth_m,
                    temperature_c: water.temperature_c,
                    salinity_psu: water.salinity_psu,
                };
                doubt(&row);
                vec![whole(formula(&row))]
            }
            Some(Profile::Constant { speed_m_s }) => {
                within(0.0, f64::INFINITY, "")?;
                vec![whole(*speed_m_s)]
            }
            Some(Profile::Layers(layers)) => {
                within(layers.first().map_or(0.0, |layer| layer.depth_m), f64::INFINITY, "layers")?;
                let ends = layers.iter().skip(1).map(|layer| layer.depth_m).chain([f64::INFINITY]);
                let mut top = 0.0;
                let mut of = |(&Layer { speed_m_s, density_kg_m3: density, .. }, bottom): (&Layer, f64)| {
                    let layer = Stretch { top, bottom, density, ..whole(speed_m_s) };
                    top = bottom;
                    layer
                };
                layers.iter().zip(ends).map(&mut of).collect()
            }
            Some(Profile::Cast(rows)) => {
                let depth = |row: Option<&SpeedRow>| row.map_or(0.0, |row| row.depth_m);
                within(depth(rows.first()), depth(rows.last()), "cast")?;
                let between = |pair: &[SpeedRow]| Stretch {
                    top: pair[0].depth_m,
                    bottom: pair[1].depth_m,
                    speed: [pair[0].speed_m_s, pair[1].speed_m_s],
                    ..whole(0.0)
                };
                rows.windows(2).map(between).collect()
            }
            Some(Profile::Ts(rows)) => {
                let depth = |row: Option<&WaterRow>| row.map_or(0.0, |row| row.depth_m);
                within(depth(rows.first()), depth(rows.last()), "ts")?;
                rows.iter().for_each(&mut doubt);
                let mut stretches = Vec::new();
                for pair in rows.windows(2) {
                    let whole = Stretch {
                        top: pair[0].depth_m,
                        bottom: pair[1].depth_m,
                        speed: [formula(&pair[0]), formula(&pair[1])],
                        temperature: [pair[0].temperature_c, pair[1].temperature_c],
                        salinity: [pair[0].salinity_psu, pair[1].salinity_psu],
                        density: SEA_WATER_KG_M3,
                    };
                    divide_until_straight(whole, &formula, &mut stretches);
                }
                stretches
            }
            Some(Profile::File(file)) => return Err(unread("water.profile", file)),
        };
        let mut warnings: Vec<String> = doubts
            .iter()
            .map(|outside| format!("the speed of sound is that of {}, for {outside}", water.sound_speed.word()))
            .collect();
        let law = water.absorption;
        let here = law.outside(frequency_hz, water.temperature_c, water.salinity_psu, water.ph, sonar_depth_m);
        warnings.extend(
            here.iter()
                .filter(|outside| outside.quantity == "frequency")
                .map(|outside| format!("the absorption is that of {}, for {outside}", law.word())),
        );
        let [least, most] = PHYSICAL_SPEEDS;
        let odd = stretches.iter().flat_map(|it| it.speed).find(|speed| !(least..=most).contains(speed));
        if let Some(speed) = odd {
            warnings.push(format!("a speed of sound is {speed} m/s; that of water is from {least} to {most} m/s"));
        }
        Ok((Column { surface_z: water.surface_z_m, slabs: slabs(water, frequency_hz, &stretches) }, warnings))
    }

    /// Index of the slab at `depth`, m; of two that meet there, the lower one. Above the surface it is the first.
    #[inline]
    pub fn slab_at(&self, depth: f64) -> usize {
        self.slabs.partition_point(|slab| slab.top <= depth).saturating_sub(1)
    }

    /// Whether sound goes straight: speed and density are the same everywhere.
    pub fn is_uniform(&self) -> bool {
        let first = &self.slabs[0];
        self.slabs.iter().all(|slab| slab.gradient == 0.0 && slab.speed == first.speed && slab.density == first.density)
    }

    /// Mean absorption between two depths, dB/m, on a straight way.
    pub fn mean_absorption(&self, from: f64, to: f64) -> f64 {
        let (from, to) = (from.min(to), from.max(to));
        if to - from < 1e-6 {
            return self.slabs[self.slab_at(from)].absorption_at(from);
        }
        let part = |slab: &Slab| {
            let (top, bottom) = (slab.top.max(from), slab.bottom.min(to));
            (bottom - top) * slab.absorption_at(0.5 * (top + bottom))
        };
        let met = self.slabs.iter().filter(|slab| slab.top < to && slab.bottom > from);
        met.map(part).sum::<f64>() / (to - from)
    }
}

/// Divides `stretch` in halves until its line of speeds is near those of the `formula`.
fn divide_until_straight(stretch: Stretch, formula: &impl Fn(&WaterRow) -> f64, into: &mut Vec<Stretch>) {
    /// Halves of halves; the widest steps of temperature that are allowed take 7.
    const MOST: u32 = 12;
    fn divide(stretch: Stretch, formula: &impl Fn(&WaterRow) -> f64, deeper: u32, into: &mut Vec<Stretch>) {
        let speed_at = |t: f64| {
            formula(&WaterRow {
                depth_m: Stretch::at([stretch.top, stretch.bottom], t),
                temperature_c: Stretch::at(stretch.temperature, t),
                salinity_psu: Stretch::at(stretch.salinity, t),
            })
        };
        // Formulas are near to parabolas between rows: half of what is allowed is left for what lies between these.
        let off = |t: f64| (speed_at(t) - Stretch::at(stretch.speed, t)).abs() > SPEED_ERROR / 2.0;
        if deeper == 0 || ![0.25, 0.5, 0.75].into_iter().any(off) {
            into.push(stretch);
            return;
        }
        let middle = Stretch::at([stretch.top, stretch.bottom], 0.5);
        let [mut upper, mut lower] = [stretch.part(stretch.top, middle), stretch.part(middle, stretch.bottom)];
        let speed = speed_at(0.5);
        (upper.speed[1], lower.speed[0]) = (speed, speed);
        divide(upper, formula, deeper - 1, into);
        divide(lower, formula, deeper - 1, into);
    }
    divide(stretch, formula, MOST, into);
}

/// Slabs of `stretches` that touch: they get the absorption, and go on to the surface and to infinity.
fn slabs(water: &Water, frequency_hz: f64, stretches: &[Stretch]) -> Vec<Slab> {
    let absorption = |depth: f64, temperature: f64, salinity: f64| {
        let db_per_km = water.absorption.db_per_km(frequency_hz, temperature, salinity, water.ph, depth);
        db_per_km.max(0.0) * 1e-3
    };
    let ends = |(part, upper): (&Stretch, usize), top: f64, bottom: f64| Stretch {
        top,
        bottom,
        speed: [part.speed[upper]; 2],
        temperature: [part.temperature[upper]; 2],
        salinity: [part.salinity[upper]; 2],
        ..*part
    };
    let above = stretches.first().filter(|it| it.top > 0.0).map(|it| ends((it, 0), 0.0, it.top));
    let below = stretches.last().filter(|it| it.bottom < f64::INFINITY);
    let below = below.map(|it| ends((it, 1), it.bottom, f64::INFINITY));
    let mut slabs: Vec<Slab> = Vec::with_capacity(stretches.len() + 2);
    let mut add = |part: Stretch| {
        let [from, to] = [0, 1].map(|end| {
            // What has no end has the absorption of its top.
            let depth = if end == 0 || part.bottom == f64::INFINITY { part.top } else { part.bottom };
            absorption(depth, part.temperature[end], part.salinity[end])
        });
        let thickness = part.bottom - part.top;
        slabs.push(Slab {
            top: part.top,
            bottom: part.bottom,
            speed: part.speed[0],
            gradient: (part.speed[1] - part.speed[0]) / thickness,
            density: part.density,
            absorption: from,
            absorption_slope: (to - from) / thickness,
        });
    };
    let cuts = water.absorption != Absorption::None && water.absorption.depends_on_the_water();
    for stretch in above.iter().chain(stretches).chain(&below) {
        let mut rest = *stretch;
        while cuts && rest.top < CONSTANT_FROM && rest.bottom - rest.top > THICKEST {
            // Slabs of the same thickness where that is possible, so at round depths.
            let cut = ((rest.top / THICKEST).floor() + 1.0) * THICKEST;
            add(rest.part(rest.top, cut));
            rest = rest.part(cut, rest.bottom);
        }
        add(rest);
    }
    slabs
}
