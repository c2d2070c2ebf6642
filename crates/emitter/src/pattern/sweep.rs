//! How mirrors sweep the beam of a laser scanner along its lines.

use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml;
use serde::{Deserialize, Deserializer, Serialize};
use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

/// What sweeps a beam. Directions are those of light that real mirrors reflect, x ahead, y left, z up; the angle of a line
/// is that from straight down to the left.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[non_exhaustive]
pub enum LineSweep {
    /// A polygon or a mirror at 45 degrees that rotates about the axis ahead: parallel lines, all in one direction.
    Rotating(RotatingMirror),
    /// A mirror that swings.
    Oscillating(OscillatingMirror),
    /// Glass fibres side by side, one after the other.
    Fibre(FibreLine),
    /// A mirror whose beam stays on a cone: every line is a circle.
    Cone(ConeMirror),
    /// A mirror that wobbles on its shaft, at 45 degrees to the beam (Palmer): every line is nearly an ellipse.
    Palmer(PalmerMirror),
}

const SWEEPS: [&str; 5] = ["rotating", "oscillating", "fibre", "cone", "palmer"];

impl<'de> Deserialize<'de> for LineSweep {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (word, section) = yaml::split_tag(deserializer, "type")?;
        Ok(match word.as_str() {
            "rotating" => LineSweep::Rotating(section.read()?),
            "oscillating" => LineSweep::Oscillating(section.read()?),
            "fibre" => LineSweep::Fibre(section.read()?),
            "cone" => LineSweep::Cone(section.read()?),
            "palmer" => LineSweep::Palmer(section.read()?),
            _ => return Err(section.unknown(&word, &SWEEPS)),
        })
    }
}

/// A polygon or a mirror at 45 degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RotatingMirror {
    /// Angles between which the laser fires, degrees, -360 to 360, in the direction of the sweep.
    pub window_deg: [f64; 2],
    /// Angle that the beam sweeps from the start of a line to that of the next, degrees, up to 360: twice that between the
    /// facets of a polygon, 360 for a mirror at 45 degrees.
    #[serde(default = "full_sweep")]
    pub sweep_deg: f64,
    /// How far each facet looks ahead in the middle of its line, degrees, -40 to 40: facets of different tilts take turns.
    /// Their lines are curved. One that looks straight down when not given.
    #[serde(default = "one_facet")]
    pub looks_deg: Vec<f64>,
}

fn full_sweep() -> f64 {
    360.0
}

fn one_facet() -> Vec<f64> {
    vec![0.0]
}

/// A mirror that swings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct OscillatingMirror {
    /// Angle of the beam to each side, degrees, above 0, up to 89.
    pub half_deg: f64,
    /// How the angle changes.
    pub law: SwingLaw,
    /// Part of the time of a line that the mirror takes to turn at each of its ends, 0 to 0.4; of `triangle`.
    #[serde(default = "turn_part")]
    pub turn: f64,
    /// Part of the time from line to line that it takes to fly back, 0 to 0.9; of `sawtooth`.
    #[serde(default)]
    pub flyback: f64,
}

fn turn_part() -> f64 {
    0.05
}

/// How a mirror swings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SwingLaw {
    /// Evenly there and back, a line each way: a zigzag.
    Triangle,
    /// As a pendulum, a line each way: dense at the edges (galvanometer).
    Sine,
    /// Evenly, and at once back: parallel lines.
    Sawtooth,
}

/// Fibres side by side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct FibreLine {
    /// Angle to each side, degrees, above 0, up to 89.
    pub half_deg: f64,
    /// How many fibres there are, 1 to 65536: each pulse takes the next.
    pub fibres: u32,
}

/// A beam on a cone about straight down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ConeMirror {
    /// Angle between the beam and the axis, degrees, above 0, up to 89.
    pub half_deg: f64,
}

/// A mirror whose normal is tilted against the shaft on which it rotates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PalmerMirror {
    /// Tilt of the normal, degrees, above 0, up to 22: the beam deviates by up to twice that in the plane of incidence, by
    /// about 1.4 times that across.
    pub tilt_deg: f64,
    /// Where the wide axis lies.
    #[serde(default)]
    pub wide: WideAxis,
}

/// Where the wide axis of an ellipse lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WideAxis {
    /// Across the direction of flight.
    #[default]
    Across,
    /// Along it.
    Along,
}

/// One line of a sweep.
#[derive(Clone, Copy)]
pub(super) struct SweepLine<'a> {
    sweep: &'a LineSweep,
    /// Which of the lines it is that differ.
    phase: usize,
}

impl LineSweep {
    /// Part of the time of a line in which the laser fires, in its middle.
    pub(super) fn used(&self) -> f64 {
        match self {
            LineSweep::Rotating(mirror) => (mirror.window_deg[1] - mirror.window_deg[0]) / mirror.sweep_deg,
            LineSweep::Oscillating(OscillatingMirror { law: SwingLaw::Sawtooth, flyback, .. }) => 1.0 - flyback,
            _ => 1.0,
        }
    }

    /// After how many lines they are the same again.
    pub(super) fn lines_until_same(&self) -> usize {
        match self {
            LineSweep::Rotating(mirror) => mirror.looks_deg.len(),
            LineSweep::Oscillating(mirror) if mirror.law != SwingLaw::Sawtooth => 2,
            _ => 1,
        }
    }

    /// Greatest angle of a line from its middle, degrees.
    pub(super) fn widest_deg(&self) -> f64 {
        match self {
            LineSweep::Rotating(mirror) => 0.5 * (mirror.window_deg[1] - mirror.window_deg[0]),
            LineSweep::Oscillating(mirror) => mirror.half_deg,
            LineSweep::Fibre(line) => line.half_deg,
            LineSweep::Cone(cone) => cone.half_deg,
            LineSweep::Palmer(mirror) => 2.0 * mirror.tilt_deg,
        }
    }

    /// Line number `number`, counted from time 0.
    pub(super) fn line(&self, number: f64) -> SweepLine<'_> {
        SweepLine { sweep: self, phase: number.rem_euclid(self.lines_until_same() as f64) as usize }
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        /// As flat as a line may be.
        const WIDEST: f64 = 89.0;
        let key = |name: &str| format!("pattern.mechanism.{name}");
        let half = |bounds: &mut Bounds, value: f64| bounds.within(key("half_deg"), value, 1e-6, WIDEST);
        match self {
            LineSweep::Rotating(mirror) => mirror.check(bounds),
            LineSweep::Oscillating(mirror) => {
                half(bounds, mirror.half_deg)?;
                bounds.within(key("turn"), mirror.turn, 0.0, 0.4)?;
                bounds.within(key("flyback"), mirror.flyback, 0.0, 0.9)
            }
            LineSweep::Fibre(line) => {
                half(bounds, line.half_deg)?;
                bounds.within(key("fibres"), f64::from(line.fibres), 1.0, 65536.0)
            }
            LineSweep::Cone(cone) => half(bounds, cone.half_deg),
            LineSweep::Palmer(mirror) => bounds.within(key("tilt_deg"), mirror.tilt_deg, 1e-6, 22.0),
        }
    }
}

impl RotatingMirror {
    fn check(&self, bounds: &mut Bounds) -> Result<()> {
        /// Farthest from straight down that a tilted facet reflects a beam from the left.
        const STEEPEST: f64 = 80.0;
        bounds.within("pattern.mechanism.sweep_deg", self.sweep_deg, 1e-6, 360.0)?;
        for (end, &angle) in self.window_deg.iter().enumerate() {
            bounds.within(format_args!("pattern.mechanism.window_deg[{end}]"), angle, -360.0, 360.0)?;
        }
        let [from, to] = self.window_deg;
        if to <= from || to - from > self.sweep_deg * (1.0 + 1e-9) {
            let allowed = format!("two angles that rise by up to pattern.mechanism.sweep_deg, {}", self.sweep_deg);
            return Err(Error::invalid("pattern.mechanism.window_deg", format!("{from} to {to}"), allowed));
        }
        if self.looks_deg.is_empty() {
            return Err(Error::invalid("pattern.mechanism.looks_deg", "an empty list", "an angle for each facet"));
        }
        for (facet, &look) in self.looks_deg.iter().enumerate() {
            bounds.within(format_args!("pattern.mechanism.looks_deg[{facet}]"), look, -40.0, 40.0)?;
        }
        if self.looks_deg.iter().any(|&look| look != 0.0) && (from < -STEEPEST || to > STEEPEST) {
            let allowed = format!("-{STEEPEST} to {STEEPEST} deg for facets that look ahead or back");
            return Err(Error::invalid("pattern.mechanism.window_deg", format!("{from} to {to}"), allowed));
        }
        Ok(())
    }

    fn direction(&self, facet: usize, part: f64) -> DVec3 {
        let [from, to] = self.window_deg;
        let angle = 0.5 * (from + to) + self.sweep_deg * (part - 0.5);
        let straight = down_and_left(angle.to_radians());
        let look = self.looks_deg[facet].to_radians();
        if look == 0.0 {
            return straight;
        }
        // The beam comes from the right; in the middle of the line the facet without tilt is at 45 degrees to it, and a
        // tilt t of the normal turns the reflected beam by asin(sin(2 t) cos 45).
        let tilt = 0.5 * (SQRT_2 * look.sin()).asin();
        let normal = (straight - DVec3::Y).normalize() * tilt.cos() + DVec3::X * tilt.sin();
        reflected(DVec3::Y, normal)
    }
}

impl OscillatingMirror {
    /// Angle over the greatest, in part `part` of a line from the right to the left.
    fn swing(&self, part: f64) -> f64 {
        match self.law {
            SwingLaw::Sine => -(PI * part).cos(),
            SwingLaw::Sawtooth => 2.0 * (part - 0.5) / (1.0 - self.flyback),
            SwingLaw::Triangle => {
                // Even but for the ends, where the mirror speeds up and slows down evenly.
                let (turn, speed) = (self.turn, 2.0 / (1.0 - self.turn));
                let from_end = part.min(1.0 - part);
                let way = match from_end < turn {
                    true => 0.5 * speed * from_end * from_end / turn,
                    false => speed * (from_end - 0.5 * turn),
                };
                if part < 0.5 { way - 1.0 } else { 1.0 - way }
            }
        }
    }
}

impl SweepLine<'_> {
    /// Direction in part `part` of the time of the line, 0 to 1, of its pulse number `pulse`: a unit vector.
    pub(super) fn direction(&self, part: f64, pulse: u64) -> DVec3 {
        match self.sweep {
            LineSweep::Rotating(mirror) => mirror.direction(self.phase, part),
            LineSweep::Oscillating(mirror) => {
                let way = if self.phase == 1 { 1.0 - part } else { part };
                down_and_left(mirror.half_deg.to_radians() * mirror.swing(way))
            }
            LineSweep::Fibre(line) => {
                let fibre = (pulse % u64::from(line.fibres)) as f64 + 0.5;
                let angle = line.half_deg * (2.0 * fibre / f64::from(line.fibres) - 1.0);
                down_and_left(angle.to_radians())
            }
            LineSweep::Cone(cone) => {
                let (sin, cos) = cone.half_deg.to_radians().sin_cos();
                let (y, x) = (2.0 * PI * part).sin_cos();
                DVec3::new(sin * x, sin * y, -cos)
            }
            LineSweep::Palmer(mirror) => {
                // The beam comes from behind; the shaft halves the angle between it and straight up.
                let shaft = DVec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2);
                let within = DVec3::new(FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2);
                let (sin_tilt, cos_tilt) = mirror.tilt_deg.to_radians().sin_cos();
                let (sin, cos) = (2.0 * PI * part).sin_cos();
                let along = reflected(DVec3::X, shaft * cos_tilt + (within * cos + DVec3::Y * sin) * sin_tilt);
                match mirror.wide {
                    WideAxis::Along => along,
                    WideAxis::Across => DVec3::new(-along.y, along.x, along.z),
                }
            }
        }
    }
}

/// The unit vector at an angle from straight down to the left, rad.
fn down_and_left(angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    DVec3::new(0.0, sin, -cos)
}

/// A beam after a mirror of a unit normal.
fn reflected(beam: DVec3, normal: DVec3) -> DVec3 {
    beam - 2.0 * beam.dot(normal) * normal
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(direction: DVec3) -> [f64; 2] {
        // Across and along, each in its plane with straight down.
        [direction.y.atan2(-direction.z).to_degrees(), direction.x.atan2(-direction.z).to_degrees()]
    }

    /// Check value 8: a Palmer mirror of 10 degrees reaches 20 by 14.00190 degrees, the published field of the VQ-840-GL.
    #[test]
    fn palmer_mirrors_wobble() {
        for (tilt_deg, wide, narrow, aside) in [(10.0, 20.0, 14.001_90, 1.780_82), (7.5, 15.0, 10.546_8, 0.992_973)] {
            let sweep = LineSweep::Palmer(PalmerMirror { tilt_deg, wide: WideAxis::Along });
            let line = sweep.line(3.0);
            let at = |part: f64| angles(line.direction(part, 0));
            assert!((at(0.0)[1].abs() - wide).abs() < 1e-9 && at(0.0)[0].abs() < 1e-9, "{:?}", at(0.0));
            assert!((at(0.5)[1].abs() - wide).abs() < 1e-9);
            for part in [0.25, 0.75] {
                let [across, along] = at(part);
                assert!((across.abs() - narrow).abs() < 1e-4, "{across}");
                assert!((along.abs() - aside).abs() < 1e-3, "{along}");
            }
            let across = LineSweep::Palmer(PalmerMirror { tilt_deg, wide: WideAxis::Across });
            assert!((angles(across.line(0.0).direction(0.0, 0))[0].abs() - wide).abs() < 1e-9);
        }
    }

    /// Check value 6: of a sine mirror, 0.2871326 of all pulses are beyond 0.9 of the greatest angle, 0.2021652 beyond 0.95;
    /// of an even one a tenth, and a twentieth.
    #[test]
    fn sine_mirrors_are_dense_at_the_edges() {
        let share = |law: SwingLaw, beyond: f64| {
            let mirror = OscillatingMirror { half_deg: 20.0, law, turn: 0.0, flyback: 0.0 };
            let count = 1_000_000;
            let parts = (0..count).map(|pulse| (f64::from(pulse) + 0.5) / f64::from(count));
            parts.filter(|&part| mirror.swing(part).abs() > beyond).count() as f64 / f64::from(count)
        };
        for (law, beyond, truth) in [
            (SwingLaw::Sine, 0.9, 0.287_132_6),
            (SwingLaw::Sine, 0.95, 0.202_165_2),
            (SwingLaw::Triangle, 0.9, 0.1),
            (SwingLaw::Sawtooth, 0.95, 0.05),
        ] {
            assert!((share(law, beyond) - truth).abs() < 2e-6, "{law:?} {beyond}: {}", share(law, beyond));
        }
    }

    /// A mirror that turns at its ends never jumps, in place or in speed, and reaches its ends.
    #[test]
    fn mirrors_turn_smoothly() {
        let mirror = OscillatingMirror { half_deg: 30.0, law: SwingLaw::Triangle, turn: 0.1, flyback: 0.0 };
        assert_eq!([0.0, 0.5, 1.0].map(|part| mirror.swing(part)), [-1.0, 0.0, 1.0]);
        let speeds: Vec<f64> = (0..1000)
            .map(|at| 1000.0 * (mirror.swing(f64::from(at + 1) / 1000.0) - mirror.swing(f64::from(at) / 1000.0)))
            .collect();
        assert!(speeds.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.025));
        let sweep = LineSweep::Oscillating(mirror);
        for part in [0.0, 0.2, 0.7] {
            let there = sweep.line(4.0).direction(part, 0);
            assert!((there - sweep.line(5.0).direction(1.0 - part, 0)).length() < 1e-12);
        }
    }

    /// Facets look ahead by their angle in the middle, and their lines curve as those of real mirrors.
    #[test]
    fn tilted_facets_curve_their_lines() {
        let mirror = RotatingMirror { window_deg: [-50.0, 50.0], sweep_deg: 180.0, looks_deg: vec![10.0, 0.0, -10.0] };
        let ahead = |facet: usize, part: f64| mirror.direction(facet, part).x.asin().to_degrees();
        assert!((ahead(0, 0.5) - 10.0).abs() < 1e-9 && (ahead(2, 0.5) + 10.0).abs() < 1e-9);
        assert_eq!(ahead(1, 0.3), 0.0);
        // Towards the beam that comes in, the facet turns it less.
        let [left, right] = [0.75, 0.25].map(|part| ahead(0, part));
        assert!(left < 10.0 && right > 10.0 && left > 5.0, "{left} {right}");
        assert!((mirror.direction(0, 0.75).length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn fibres_take_turns() {
        let line = LineSweep::Fibre(FibreLine { half_deg: 10.0, fibres: 4 });
        let at = |pulse: u64| angles(line.line(0.0).direction(0.0, pulse))[0];
        for (pulse, angle) in [(0, -7.5), (1, -2.5), (3, 7.5), (4, -7.5)] {
            assert!((at(pulse) - angle).abs() < 1e-9);
        }
    }
}
