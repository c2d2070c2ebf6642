//! The water prepared for the rays of one instrument: slabs, in each of which speed and absorption are linear.

use super::profile::{DEEPEST, Layer, PHYSICAL_SPEEDS, SEA_WATER_KG_M3, SoundSpeedProfile, SpeedRow, WaterRow, unread};
use super::{Outside, Water};
pub(crate) use echocast_kernels::water::Slab;
use ground::error::{Error, Result};

/// Where absorption changes with depth, slabs are no thicker than this, m, down to [`CONSTANT_FROM`].
const THICKEST: f64 = 500.0;
/// Depth below which absorption is constant, m: deeper than any sea.
const CONSTANT_FROM: f64 = 12_000.0;
/// Largest error, m/s, of the lines through the speeds of a formula.
const SPEED_ERROR: f64 = 0.01;
/// Casts of more rows are simplified where they are straight: a ray takes computing time in each slab.
const MANY: usize = 1000;
/// Largest distance of joined rows from the line through their ends, m/s: the resolution of good probes.
const ROW_ERROR: f64 = 0.001;

/// All the water, from the surface down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WaterColumn {
    /// Height of the surface in the world, m.
    pub surface_z: f64,
    /// From depth 0 to infinity; each begins where the one before ends.
    pub slabs: Vec<Slab>,
}

/// Water between two depths, before its absorption is known.
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
    /// Interpolates between `top` and `bottom` at the fraction `t` of the thickness.
    fn at([top, bottom]: [f64; 2], t: f64) -> f64 {
        // Not top + (bottom - top) t: both ends must be exact.
        top * (1.0 - t) + bottom * t
    }

    /// The part from `top` to `bottom`, both within it. A stretch without an end is uniform.
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

impl WaterColumn {
    /// The column of `water`, which is valid, for a sonar of `frequency_hz` (above 0) at `sonar_depth_m` below the
    /// surface; and warnings for the user.
    ///
    /// # Errors
    /// A sonar above the water, or at a depth that the profile does not cover; a profile whose file has not been read.
    pub fn new(water: &Water, frequency_hz: f64, sonar_depth_m: f64) -> Result<(WaterColumn, Vec<String>)> {
        WaterColumn::of(water, ("profile", water.profile.as_ref()), frequency_hz, sonar_depth_m)
    }

    /// The column that depths are corrected with, if it differs from the true one.
    ///
    /// # Errors
    /// As for [`WaterColumn::new`].
    pub fn assumed(water: &Water, frequency_hz: f64, sonar_depth_m: f64) -> Result<Option<WaterColumn>> {
        let Some(assumed) = &water.assumed_profile else { return Ok(None) };
        let (column, _) = WaterColumn::of(water, ("assumed_profile", Some(assumed)), frequency_hz, sonar_depth_m)?;
        Ok(Some(column))
    }

    /// The column of `water` with the `profile` at a key.
    fn of(
        water: &Water,
        (key, profile): (&str, Option<&SoundSpeedProfile>),
        frequency_hz: f64,
        sonar_depth_m: f64,
    ) -> Result<(WaterColumn, Vec<String>)> {
        check_depth(water, (key, profile), sonar_depth_m)?;
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
        let [mut doubts, mut absorption_doubts]: [Vec<Outside>; 2] = Default::default();
        let add = |doubts: &mut Vec<Outside>, found: Vec<Outside>| {
            for outside in found {
                if !doubts.iter().any(|known| known.quantity == outside.quantity) {
                    doubts.push(outside);
                }
            }
        };
        let mut doubt = |row: &WaterRow| {
            add(&mut doubts, water.sound_speed.outside(row.temperature_c, row.salinity_psu, row.depth_m));
        };
        let here =
            WaterRow { depth_m: sonar_depth_m, temperature_c: water.temperature_c, salinity_psu: water.salinity_psu };
        let mut stretches = match profile {
            None => {
                doubt(&here);
                vec![whole(formula(&here))]
            }
            Some(SoundSpeedProfile::Constant { speed_m_s }) => {
                vec![whole(*speed_m_s)]
            }
            Some(SoundSpeedProfile::Layers(layers)) => {
                let ends = layers.iter().skip(1).map(|layer| layer.depth_m).chain([f64::INFINITY]);
                let mut top = 0.0;
                let mut of = |(&Layer { speed_m_s, density_kg_m3: density, .. }, bottom): (&Layer, f64)| {
                    let layer = Stretch { top, bottom, density, ..whole(speed_m_s) };
                    top = bottom;
                    layer
                };
                layers.iter().zip(ends).map(&mut of).collect()
            }
            Some(SoundSpeedProfile::Cast(rows)) => {
                let between = |pair: &[SpeedRow]| Stretch {
                    top: pair[0].depth_m,
                    bottom: pair[1].depth_m,
                    speed: [pair[0].speed_m_s, pair[1].speed_m_s],
                    ..whole(0.0)
                };
                rows.windows(2).map(between).collect()
            }
            Some(SoundSpeedProfile::Ts(rows)) => {
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
            Some(SoundSpeedProfile::File(file)) => return Err(unread(&format!("water.{key}"), file)),
        };
        if stretches.len() > MANY && matches!(profile, Some(SoundSpeedProfile::Cast(_) | SoundSpeedProfile::Ts(_))) {
            stretches = joined(&stretches);
        }
        let mut warnings: Vec<String> = doubts
            .iter()
            .map(|outside| format!("the speed of sound is that of {}, for {outside}", water.sound_speed.word()))
            .collect();
        let law = water.absorption;
        let rows = match profile {
            Some(SoundSpeedProfile::Ts(rows)) => rows,
            _ => std::slice::from_ref(&here),
        };
        for WaterRow { depth_m, temperature_c, salinity_psu } in rows {
            let found = law.outside(frequency_hz, *temperature_c, *salinity_psu, water.ph, *depth_m);
            add(&mut absorption_doubts, found);
        }
        let word = |outside: &Outside| format!("the absorption is that of {}, for {outside}", law.word());
        warnings.extend(absorption_doubts.iter().map(word));
        let [least, most] = PHYSICAL_SPEEDS;
        let odd = stretches.iter().flat_map(|it| it.speed).find(|speed| !(least..=most).contains(speed));
        if let Some(speed) = odd {
            warnings.push(format!("a speed of sound is {speed} m/s; that of water is from {least} to {most} m/s"));
        }
        Ok((WaterColumn { surface_z: water.surface_z_m, slabs: slabs(water, frequency_hz, &stretches) }, warnings))
    }

    /// Checks that the true and the assumed profile of `water` cover `sonar_depth_m`, m below its surface.
    ///
    /// # Errors
    /// A sonar above the water, or at a depth that a profile does not cover.
    pub fn check_depth(water: &Water, sonar_depth_m: f64) -> Result<()> {
        check_depth(water, ("profile", water.profile.as_ref()), sonar_depth_m)?;
        match &water.assumed_profile {
            Some(assumed) => check_depth(water, ("assumed_profile", Some(assumed)), sonar_depth_m),
            None => Ok(()),
        }
    }

    /// Index of the slab at `depth`, m; at a boundary the lower one. Above the surface it is the first.
    #[inline]
    pub fn slab_at(&self, depth: f64) -> usize {
        slab_at(&self.slabs, depth)
    }

    /// Speeds of sound at the ends of the slabs, m/s: they include the least and the greatest of all.
    pub fn end_speeds(&self) -> impl Iterator<Item = f64> {
        self.slabs.iter().flat_map(|slab| {
            let bottom = if slab.bottom.is_finite() { slab.bottom } else { slab.top };
            [slab.speed, slab.speed_at(bottom)]
        })
    }

    /// Speed of sound at `depth`, m, in m/s.
    pub fn speed_at(&self, depth: f64) -> f64 {
        self.slabs[self.slab_at(depth)].speed_at(depth)
    }

    /// Whether sound travels in straight lines: speed and density are the same everywhere.
    pub fn is_uniform(&self) -> bool {
        let first = &self.slabs[0];
        self.slabs.iter().all(|slab| slab.gradient == 0.0 && slab.speed == first.speed && slab.density == first.density)
    }

    /// Mean absorption between two depths, dB/m, on a straight path.
    pub fn mean_absorption(&self, from: f64, to: f64) -> f64 {
        let (from, to) = (from.min(to), from.max(to));
        if to - from < 1e-6 {
            return self.slabs[self.slab_at(from)].absorption_at(from);
        }
        let part = |slab: &Slab| {
            let (top, bottom) = (slab.top.max(from), slab.bottom.min(to));
            (bottom - top) * slab.absorption_at(0.5 * (top + bottom))
        };
        let met = self.slabs[self.slab_at(from)..].iter().take_while(|slab| slab.top < to);
        met.map(part).sum::<f64>() / (to - from)
    }
}

/// Index of the one of adjoining `slabs` that is at `depth`, m; at a boundary the lower one. Above all slabs it is the
/// first.
#[inline]
pub(crate) fn slab_at(slabs: &[Slab], depth: f64) -> usize {
    slabs.partition_point(|slab| slab.top <= depth).saturating_sub(1)
}

/// Checks that the `profile` at a key of `water` covers `sonar_depth_m`, m below its surface.
fn check_depth(water: &Water, (key, profile): (&str, Option<&SoundSpeedProfile>), sonar_depth_m: f64) -> Result<()> {
    let (from, to, table) = match profile {
        // Formulas contain powers of the depth.
        None => (0.0, DEEPEST, ""),
        Some(SoundSpeedProfile::Layers(rows)) => {
            (rows.first().map_or(0.0, |layer| layer.depth_m), f64::INFINITY, "layers")
        }
        Some(SoundSpeedProfile::Cast(rows)) => {
            let depth = |row: Option<&SpeedRow>| row.map_or(0.0, |row| row.depth_m);
            (depth(rows.first()), depth(rows.last()), "cast")
        }
        Some(SoundSpeedProfile::Ts(rows)) => {
            let depth = |row: Option<&WaterRow>| row.map_or(0.0, |row| row.depth_m);
            (depth(rows.first()), depth(rows.last()), "ts")
        }
        Some(SoundSpeedProfile::Constant { .. }) => (0.0, f64::INFINITY, ""),
        // Its rows are unknown: [`WaterColumn::new`] refuses it.
        Some(SoundSpeedProfile::File(_)) => return Ok(()),
    };
    // Written so that NaN fails too.
    if sonar_depth_m >= from && sonar_depth_m <= to && sonar_depth_m.is_finite() {
        return Ok(());
    }
    let allowed = if sonar_depth_m < 0.0 || table.is_empty() {
        let surface = water.surface_z_m;
        let covered = if to == f64::INFINITY { "0 m or more".to_owned() } else { format!("0 to {to} m") };
        format!("{covered}, below the surface of the water at z = {surface} m (water.surface_z_m)")
    } else if to == f64::INFINITY {
        format!("{from} m or more, where the rows of water.{key}.{table} begin")
    } else {
        format!("{from} to {to} m, which the rows of water.{key}.{table} cover")
    };
    Err(Error::invalid("the depth of the sonar", format!("{sonar_depth_m} m"), allowed))
}

/// Joins neighbouring stretches of a long cast while all rows are within [`ROW_ERROR`] of the line through the ends.
fn joined(stretches: &[Stretch]) -> Vec<Stretch> {
    let mut all: Vec<Stretch> = Vec::new();
    // Least and greatest slope of the lines from the start of the last stretch that pass all its rows.
    let mut slopes = [f64::NEG_INFINITY, f64::INFINITY];
    for next in stretches {
        if let Some(last) = all.last_mut() {
            let slope = |depth: f64, speed: f64| (speed - last.speed[0]) / (depth - last.top);
            let [least, most] = slopes;
            let passed = [
                least.max(slope(last.bottom, last.speed[1] - ROW_ERROR)),
                most.min(slope(last.bottom, last.speed[1] + ROW_ERROR)),
            ];
            let whole = slope(next.bottom, next.speed[1]);
            if passed[0] <= whole && whole <= passed[1] {
                slopes = passed;
                let ends = |from: [f64; 2], to: [f64; 2]| [from[0], to[1]];
                (last.bottom, last.speed) = (next.bottom, ends(last.speed, next.speed));
                last.temperature = ends(last.temperature, next.temperature);
                last.salinity = ends(last.salinity, next.salinity);
                continue;
            }
        }
        all.push(*next);
        slopes = [f64::NEG_INFINITY, f64::INFINITY];
    }
    all
}

/// Divides `stretch` into as many equal parts as needed for speeds linear in each part to be close to the `formula`.
fn divide_until_straight(stretch: Stretch, formula: &impl Fn(&WaterRow) -> f64, into: &mut Vec<Stretch>) {
    /// Most parts; the widest temperature steps allowed take 60.
    const MOST: usize = 4096;
    /// Formulas are nearly parabolic between rows: a margin is left for depths between those that are checked.
    const NEAR: f64 = 0.9 * SPEED_ERROR;
    let depth_at = |t: f64| Stretch::at([stretch.top, stretch.bottom], t);
    let speed_at = |t: f64| {
        formula(&WaterRow {
            depth_m: depth_at(t),
            temperature_c: Stretch::at(stretch.temperature, t),
            salinity_psu: Stretch::at(stretch.salinity, t),
        })
    };
    // How far the line over a part, from one `t` to another, is from the formula.
    let off = |[from, to]: [f64; 2]| {
        let ends = [from, to].map(speed_at);
        let beside = |part: f64| (speed_at(Stretch::at([from, to], part)) - Stretch::at(ends, part)).abs();
        [0.25, 0.5, 0.75].map(beside).into_iter().fold(0.0, f64::max)
    };
    let part = |index: usize, parts: usize| [index, index + 1].map(|end| end as f64 / parts as f64);
    // The distance of a parabola from its chords falls with the square of their number.
    let mut parts = ((off([0.0, 1.0]) / NEAR).sqrt().ceil() as usize).clamp(1, MOST);
    while parts < MOST && (0..parts).any(|index| off(part(index, parts)) > NEAR) {
        parts = (parts + parts / 8 + 1).min(MOST);
    }
    for ends in (0..parts).map(|index| part(index, parts)) {
        let [top, bottom] = ends.map(depth_at);
        into.push(Stretch { speed: ends.map(speed_at), ..stretch.part(top, bottom) });
    }
}

/// Slabs of adjoining `stretches`: adds the absorption, and extends them to the surface and to infinity.
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
            // A slab without an end has the absorption of its top.
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
    let cuts = water.absorption.depends_on_the_water();
    for stretch in above.iter().chain(stretches).chain(&below) {
        let mut rest = *stretch;
        while cuts && rest.top < CONSTANT_FROM && rest.bottom - rest.top > THICKEST {
            // Slabs are of equal thickness where possible, and so end at round depths.
            let cut = ((rest.top / THICKEST).floor() + 1.0) * THICKEST;
            add(rest.part(rest.top, cut));
            rest = rest.part(cut, rest.bottom);
        }
        add(rest);
    }
    slabs
}

#[cfg(test)]
mod tests {
    use super::super::Absorption;
    use super::*;
    use crate::medium::environment::Environment;

    const FREQUENCY: f64 = 200e3;

    fn water(keys: &str) -> Water {
        Environment::from_yaml(&format!("water: {{{keys}}}")).unwrap().water.unwrap()
    }

    fn column(keys: &str, depth: f64) -> (WaterColumn, Vec<String>) {
        let (column, warnings) = WaterColumn::new(&water(keys), FREQUENCY, depth).unwrap();
        // From the surface to infinity without gaps, and nothing negative or infinite in between.
        assert_eq!((column.slabs[0].top, column.slabs.last().unwrap().bottom), (0.0, f64::INFINITY));
        assert!(column.slabs.iter().all(|slab| slab.top < slab.bottom));
        assert!(column.slabs.windows(2).all(|pair| pair[0].bottom == pair[1].top));
        for slab in &column.slabs {
            let numbers = [slab.speed, slab.gradient, slab.density, slab.absorption, slab.absorption_slope];
            assert!(numbers.iter().all(|number| number.is_finite()), "{slab:?}");
            let bottom = slab.bottom.min(slab.top + 1e6);
            assert!(slab.speed + slab.gradient * (bottom - slab.top) > 0.0);
            assert!(slab.absorption + slab.absorption_slope * (bottom - slab.top) >= 0.0);
        }
        (column, warnings)
    }

    fn absorption_at(column: &WaterColumn, depth: f64) -> f64 {
        let slab = column.slabs[column.slab_at(depth)];
        slab.absorption + slab.absorption_slope * (depth - slab.top)
    }

    #[test]
    fn one_speed_without_a_profile() {
        let (column, warnings) = column("surface_z_m: 3", 100.0);
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(column.surface_z, 3.0);
        let expected = SoundSpeedAt { t: 10.0, s: 35.0 }.mackenzie(100.0);
        for depth in [-1.0, 0.0, 100.0, 499.9, 500.0, 20_000.0] {
            assert_eq!(column.speed_at(depth), expected);
        }
        assert!(column.slabs.iter().all(|slab| slab.gradient == 0.0 && slab.density == 1025.0));
        let law = |depth| Absorption::FrancoisGarrison.db_per_km(FREQUENCY, 10.0, 35.0, 8.0, depth) * 1e-3;
        for (depth, tolerance) in [(0.0, 1e-15), (500.0, 1e-15), (250.0, 4e-5), (3725.0, 4e-5)] {
            assert!((absorption_at(&column, depth) - law(depth)).abs() <= tolerance, "{depth}");
        }
        // 24 of 500 m, and the rest.
        assert_eq!(column.slabs.len(), 25);
        assert_eq!((column.slabs[24].top, column.slabs[24].absorption_slope), (12_000.0, 0.0));
    }

    struct SoundSpeedAt {
        t: f64,
        s: f64,
    }

    impl SoundSpeedAt {
        fn mackenzie(&self, depth: f64) -> f64 {
            crate::medium::SoundSpeed::Mackenzie.speed(self.t, self.s, depth, 45.0)
        }
    }

    #[test]
    fn mean_absorption_is_that_of_many_depths() {
        let (column, _) = column("", 100.0);
        for (from, to) in [(0.0, 20.0), (30.0, 1234.0), (2500.0, 499.0), (500.0, 1000.0), (11_900.0, 14_000.0)] {
            const STEPS: usize = 20_000;
            let middle = |step: usize| from + (to - from) * (step as f64 + 0.5) / STEPS as f64;
            let expected = (0..STEPS).map(|step| absorption_at(&column, middle(step))).sum::<f64>() / STEPS as f64;
            let found = column.mean_absorption(from, to);
            assert!((found / expected - 1.0).abs() < 1e-7, "{from} to {to}: {found} {expected}");
        }
        assert_eq!(column.mean_absorption(700.0, 700.0), absorption_at(&column, 700.0));
    }

    #[test]
    fn laws_that_ignore_depth_need_one_slab() {
        for law in ["thorp", "none"] {
            let keys = format!("absorption: {law}, profile: {{constant: {{speed_m_s: 1490}}}}");
            let (column, _) = WaterColumn::new(&water(&keys), 20e3, 5.0).unwrap();
            assert_eq!(column.slabs.len(), 1);
            assert_eq!((column.slabs[0].speed, column.slabs[0].absorption_slope), (1490.0, 0.0));
        }
    }

    #[test]
    fn layers_are_as_they_are_written() {
        let keys = "absorption: none, profile: {layers: [{depth_m: 2, speed_m_s: 1500, density_kg_m3: 1020}, {depth_m: 30, \
                    speed_m_s: 1480}, {depth_m: 900, speed_m_s: 1510}]}";
        let (column, warnings) = column(keys, 10.0);
        assert!(warnings.is_empty());
        let found: Vec<_> = column.slabs.iter().map(|it| (it.top, it.speed, it.gradient, it.density)).collect();
        assert_eq!(found, [(0.0, 1500.0, 0.0, 1020.0), (30.0, 1480.0, 0.0, 1025.0), (900.0, 1510.0, 0.0, 1025.0)]);
        // At a boundary the lower slab.
        assert_eq!([0.0, 29.9, 30.0, 1e5, -3.0, f64::NAN].map(|depth| column.slab_at(depth)), [0, 0, 1, 2, 0, 0]);
        assert!(WaterColumn::new(&water(keys), FREQUENCY, 1e4).is_ok());
        let error = WaterColumn::new(&water(keys), FREQUENCY, 1.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "the depth of the sonar is 1 m; allowed: 2 m or more, where the rows of water.profile.layers begin"
        );
    }

    #[test]
    fn casts_are_linear_and_constant_beyond_their_ends() {
        let keys = "profile: {cast: [{depth_m: 10, speed_m_s: 1500}, {depth_m: 20, speed_m_s: 1490}, {depth_m: 1020, \
                    speed_m_s: 1505}]}";
        let (column, _) = column(keys, 15.0);
        for (depth, expected) in [
            (0.0, 1500.0),
            (10.0, 1500.0),
            (15.0, 1495.0),
            (20.0, 1490.0),
            (520.0, 1497.5),
            (1020.0, 1505.0),
            (9000.0, 1505.0),
        ] {
            assert!((column.speed_at(depth) - expected).abs() < 1e-9, "{depth}: {}", column.speed_at(depth));
        }
        // The interval of 1000 m is divided, and its speed is continuous.
        for pair in column.slabs.windows(2) {
            let end = pair[0].speed + pair[0].gradient * (pair[0].bottom - pair[0].top);
            assert!((end - pair[1].speed).abs() < 1e-9);
        }
        let tops: Vec<f64> = column.slabs.iter().map(|slab| slab.top).take(6).collect();
        assert_eq!(tops, [0.0, 10.0, 20.0, 500.0, 1000.0, 1020.0]);
        for (depth, found) in [(5.0, "5"), (2000.0, "2000")] {
            let error = WaterColumn::new(&water(keys), FREQUENCY, depth).unwrap_err().to_string();
            let expected = "m; allowed: 10 to 1020 m, which the rows of water.profile.cast cover";
            assert_eq!(error, format!("the depth of the sonar is {found} {expected}"));
        }
        let error = WaterColumn::new(&water(keys), FREQUENCY, -2.0).unwrap_err().to_string();
        assert!(
            error.starts_with("the depth of the sonar is -2 m; allowed: 0 to 1020 m, below the surface of the water")
        );
    }

    #[test]
    fn temperature_and_salinity_make_speeds_within_a_centimetre_per_second() {
        let rows = [(0.0, 24.0, 36.0), (60.0, 14.0, 35.0), (800.0, 5.0, 34.5), (3000.0, 2.0, 34.8)];
        let text: Vec<String> =
            rows.iter().map(|(z, t, s)| format!("{{depth_m: {z}, temperature_c: {t}, salinity_psu: {s}}}")).collect();
        for formula in ["mackenzie", "leroy", "unesco"] {
            let keys = format!("latitude_deg: 30, absorption: ainslie_mccolm, sound_speed: {formula}");
            let keys = format!("{keys}, profile: {{ts: [{}]}}", text.join(", "));
            let water = water(&keys);
            let (column, warnings) = column(&keys, 40.0);
            assert!(warnings.is_empty(), "{warnings:?}");
            assert!(column.slabs.len() < 60, "{}", column.slabs.len());
            let mut most = 0f64;
            for pair in rows.windows(2) {
                let ((z0, t0, s0), (z1, t1, s1)) = (pair[0], pair[1]);
                for step in 0..=1000 {
                    let u = f64::from(step) / 1000.0;
                    let (z, t, s) = (z0 + (z1 - z0) * u, t0 + (t1 - t0) * u, s0 + (s1 - s0) * u);
                    let exact = water.sound_speed.speed(t, s, z, 30.0);
                    most = most.max((column.speed_at(z) - exact).abs());
                    let law = water.absorption.db_per_km(FREQUENCY, t, s, 8.0, z) * 1e-3;
                    assert!((absorption_at(&column, z) / law - 1.0).abs() < 0.05, "{z}");
                }
            }
            assert!(most < SPEED_ERROR, "{formula}: {most}");
        }
    }

    /// Even the most hostile rows yield a column of bearable size.
    #[test]
    fn the_wildest_cast_is_bounded() {
        let row = |i: u32| WaterRow {
            depth_m: f64::from(i) * 12.0,
            temperature_c: [-4.0, 45.0][i as usize % 2],
            salinity_psu: [0.0, 50.0][i as usize % 2],
        };
        let wild = Water { profile: Some(SoundSpeedProfile::Ts((0..1000).map(row).collect())), ..Water::default() };
        let (column, warnings) = WaterColumn::new(&wild, FREQUENCY, 5.0).unwrap();
        assert!(column.slabs.len() < 200_000, "{}", column.slabs.len());
        assert!(
            warnings[0].starts_with("the speed of sound is that of mackenzie, for temperature -4 C"),
            "{warnings:?}"
        );
    }

    #[test]
    fn doubtful_water_causes_warnings() {
        let warnings_of =
            |keys: &str, frequency: f64| WaterColumn::new(&water(keys), frequency, 20.0).unwrap().1.join("; ");
        assert_eq!(warnings_of("", 450e3), "");
        assert_eq!(
            warnings_of("salinity_psu: 5, absorption: ainslie_mccolm", 450e3),
            "the speed of sound is that of mackenzie, for salinity 5 PSU (valid for 30 to 40 PSU)"
        );
        let absorption = "the absorption is that of francois_garrison, for salinity 5 PSU (valid for 30 to 35 PSU)";
        assert_eq!(warnings_of("salinity_psu: 5, sound_speed: leroy", 450e3), absorption);
        // Where the salts hardly matter.
        assert_eq!(warnings_of("salinity_psu: 5, sound_speed: leroy", 600e3), "");
        // A cast of speeds needs no formula for them.
        assert_eq!(warnings_of("salinity_psu: 5, profile: {constant: {speed_m_s: 1490}}", 450e3), absorption);
        let cast = "profile: {ts: [{depth_m: 0, temperature_c: 24, salinity_psu: 34}, {depth_m: 50, temperature_c: 9, \
                    salinity_psu: 34}]}";
        assert!(
            warnings_of(cast, 450e3).starts_with("the absorption is that of francois_garrison, for temperature 24 C")
        );
        assert_eq!(
            warnings_of("", 1.2e6),
            "the absorption is that of francois_garrison, for frequency 1200000 Hz (valid for 200 to 1000000 Hz)"
        );
        assert!(
            warnings_of("", 100.0).starts_with("the absorption is that of francois_garrison, for frequency 100 Hz")
        );
        assert!(
            warnings_of("absorption: thorp", 450e3)
                .starts_with("the absorption is that of thorp, for frequency 450000 Hz")
        );
        let odd = "absorption: none, allow_unphysical: true, profile: {constant: {speed_m_s: 1.333}}";
        assert_eq!(warnings_of(odd, 1e5), "a speed of sound is 1.333 m/s; that of water is from 1300 to 1700 m/s");
    }

    #[test]
    fn a_sonar_in_the_air_is_refused() {
        let refused =
            |keys: &str, depth: f64| WaterColumn::new(&water(keys), FREQUENCY, depth).unwrap_err().to_string();
        let expected = |allowed: &str| {
            format!(
                "the depth of the sonar is -1.5 m; allowed: {allowed}, below the surface of the water at z = 10 m \
                 (water.surface_z_m)"
            )
        };
        assert_eq!(refused("surface_z_m: 10", -1.5), expected("0 to 12000 m"));
        let constant = "surface_z_m: 10, profile: {constant: {speed_m_s: 1500}}";
        assert_eq!(refused(constant, -1.5), expected("0 m or more"));
        assert!(refused("", f64::NAN).starts_with("the depth of the sonar is NaN m; allowed: 0 to 12000 m"));
        // At that depth formulas yield negative values; one speed for all depths does not use them.
        assert!(refused("", 1e5).starts_with("the depth of the sonar is 100000 m; allowed: 0 to 12000 m, below"));
        assert!(WaterColumn::new(&water("profile: {constant: {speed_m_s: 1500}}"), FREQUENCY, 1e5).is_ok());
    }
}
