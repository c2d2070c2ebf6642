//! A survey before it is flown: its strips, the path from one to the next, and what it will measure.

use crate::altitude::{AltitudeProfile, GroundProfile, block_m};
use crate::lines::{self, MOST_LINES};
use crate::platform::{FlownLine, SurveyFlight, stations};
use crate::spec::signed_area;
use crate::turn::TrackPath;
use crate::{CarrierKind, CrossLines, GroundHeight, PlanSpec, SurveySwath};
use emitter::Trajectory;
use glam::{DVec2, DVec3};
use ground::error::{Error, Result};
use ground::report::Report;
use std::f64::consts::FRAC_PI_2;

/// A strip of a plan: a flight line, a course, or a station.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FlightLine {
    /// Its number, from 1.
    pub strip: u16,
    /// When the scanner is on, s.
    pub from_s: f64,
    /// See `from_s`.
    pub to_s: f64,
    /// Where it begins, m.
    pub start_m: DVec3,
    /// Where it ends, m.
    pub end_m: DVec3,
    /// Its length over ground, m.
    pub length_m: f64,
}

/// What strips cover of an area.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Coverage {
    /// The area, m^2.
    pub area_m2: f64,
    /// Part of it that lies in a swath, 0 to 1.
    pub covered: f64,
    /// Mean density of pulses in it, of all strips, 1/m^2.
    pub mean_per_m2: f64,
    /// Density that nine tenths of it exceed, 1/m^2.
    pub least_per_m2: f64,
}

/// A survey as planned.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SurveyPlan {
    /// Path of the platform.
    pub trajectory: Trajectory,
    /// Its strips, in the order of their numbers and times.
    pub strips: Vec<FlightLine>,
    /// Width of the swath on level ground, m; 0 of a tripod.
    pub swath_m: f64,
    /// Where the swath ends to the right (negative) and to the left, m.
    pub beside_m: [f64; 2],
    /// From strip to strip, m; `None`: there are no parallel ones.
    pub spacing_m: Option<f64>,
    /// Coverage of the area; `None`: there is none.
    pub coverage: Option<Coverage>,
    /// What the scanner covers.
    pub swath: SurveySwath,
    /// Height that was asked for, m.
    pub height_m: f64,
    /// Speed over ground, m/s.
    pub speed_m_s: f64,
    /// Pulses of all strips.
    pub pulses: f64,
    /// Points of all strips, one for each pulse that meets level ground within range.
    pub points: f64,
    /// Corners of the area, m; empty: there is none.
    pub area: Vec<DVec2>,
    /// What is not as one might expect.
    pub report: Report,
}

/// Most poses of a plan.
const MOST_KEYS: usize = 20_000_000;

impl SurveyPlan {
    /// Plans the survey `spec`, whose section is at `key`, with a scanner of this swath, over `ground`; `seed`: of the
    /// level errors of tripods.
    ///
    /// # Errors
    /// As [`PlanSpec::check`]; a strip or a station that is not over the scene; too many strips; a density that cannot be
    /// reached; a corner that is too sharp.
    pub fn new(spec: &PlanSpec, key: &str, swath: &SurveySwath, ground: GroundHeight, seed: u64) -> Result<SurveyPlan> {
        spec.check(key)?;
        if spec.is_nowhere() {
            return Err(Error::invalid(key, "nowhere", "one of area, polygon_m, course_m and stations_m"));
        }
        let planner = Planner { spec, key, swath, ground, speed: spec.speed_m_s.unwrap_or(1.0), seed };
        if spec.platform == CarrierKind::Tripod {
            return planner.tripod();
        }
        if swath.panorama.is_some() {
            let allowed = "tripod for a scanner whose head turns";
            return Err(Error::invalid(format!("{key}.platform"), "one that moves", allowed));
        }
        planner.moving()
    }

    /// Time from the beginning to the end, s.
    pub fn total_s(&self) -> f64 {
        let (start, end) = self.trajectory.span();
        end - start
    }

    /// From line to line on the ground, m; `None`: no line scanner, or one that stands still.
    pub fn line_spacing_m(&self) -> Option<f64> {
        self.swath.lines_hz.filter(|_| self.swath_m > 0.0).map(|lines| self.speed_m_s / lines)
    }

    /// Pulses per m^2 straight below, and mean of a swath.
    pub fn densities(&self) -> [f64; 2] {
        let [from, to] = self.swath.edges_rad;
        let nadir = self.swath.density_at(0.0, self.height_m, self.speed_m_s);
        [nadir, self.swath.pulses_between_hz(from, to) / (self.speed_m_s * self.swath_m)]
    }

    /// Zones of the nearest and the farthest echo of the swath: how many pulses are in the air when they come back, and
    /// one; and their length, m.
    pub fn zones(&self) -> ([u64; 2], f64) {
        let widest = self.swath.edges_rad.map(f64::abs).into_iter().fold(0.0, f64::max);
        let farthest = (self.height_m / widest.cos()).min(self.swath.range_m[1]);
        let rate = self.swath.pulse_rate_hz;
        ([self.height_m, farthest].map(|range| zone(range, rate)), unambiguous_m(rate))
    }

    /// Time on strips, s.
    pub fn on_line_s(&self) -> f64 {
        self.strips.iter().map(|strip| strip.to_s - strip.from_s).sum()
    }
}

struct Planner<'p> {
    spec: &'p PlanSpec,
    key: &'p str,
    swath: &'p SurveySwath,
    ground: GroundHeight<'p>,
    speed: f64,
    seed: u64,
}

/// A straight line of the plan with the ground below it.
struct LineBelow {
    ends: [DVec2; 2],
    below: GroundProfile,
}

impl Planner<'_> {
    fn tripod(&self) -> Result<SurveyPlan> {
        let Some((_, turn)) = self.swath.panorama else {
            let allowed = "a platform that moves, for a scanner without a head that turns";
            return Err(Error::invalid(format!("{}.platform", self.key), "tripod", allowed));
        };
        let places = self.spec.stations_m.iter().enumerate().map(|(index, &[x, y])| {
            let missed = || {
                let key = format!("{}.stations_m[{index}]", self.key);
                Error::invalid(key, format!("{x},{y}, below which there is nothing"), "places on the scene")
            };
            (self.ground)(x, y).map(|z| DVec3::new(x, y, z + self.spec.height_m)).ok_or_else(missed)
        });
        let places: Vec<DVec3> = places.collect::<Result<_>>()?;
        let heading = FRAC_PI_2 - self.spec.heading_deg.unwrap_or(90.0).to_radians();
        let level = (self.spec.level_error_deg.to_radians(), self.seed);
        let (keys, times) = stations(&places, heading, (self.speed, turn), level);
        let strips: Vec<FlightLine> = (1..)
            .zip(places.iter().zip(times))
            .map(|(strip, (&place, [from_s, to_s]))| FlightLine {
                strip,
                from_s,
                to_s,
                start_m: place,
                end_m: place,
                length_m: 0.0,
            })
            .collect();
        let pulses = strips.len() as f64 * turn * self.swath.fired_hz;
        Ok(SurveyPlan {
            trajectory: Trajectory::new(keys)?,
            strips,
            swath_m: 0.0,
            beside_m: [0.0; 2],
            swath: self.swath.clone(),
            height_m: self.spec.height_m,
            spacing_m: None,
            coverage: None,
            speed_m_s: self.speed,
            pulses,
            points: pulses,
            area: Vec::new(),
            report: Report::default(),
        })
    }

    fn moving(&self) -> Result<SurveyPlan> {
        let (spec, swath) = (self.spec, self.swath);
        let corners = spec.corners();
        let mut report = Report::default();
        let acceleration = spec.acceleration_m_s2.unwrap_or(SurveyFlight::usual_acceleration(spec.platform));
        let mut flight = SurveyFlight::new(spec.platform, self.speed, acceleration);
        let mut spacing_m = None;
        let flown = if spec.course_m.is_empty() {
            let (lines, spacing) = self.lines(&corners)?;
            spacing_m = Some(spacing);
            self.flown(lines, &mut report)?
        } else {
            vec![self.course(flight.radius())?]
        };
        match spec.platform {
            CarrierKind::Multicopter => flight.hop(&flown, self.ground),
            _ => flight.cruise(&flown, self.ground),
        }
        if flight.keys.len() > MOST_KEYS {
            let allowed = format!("an area or a speed for which it has {MOST_KEYS} at most");
            return Err(Error::invalid(self.key, format!("a path of {} poses", flight.keys.len()), allowed));
        }
        let trajectory = Trajectory::new(flight.keys)?;
        let strips: Vec<FlightLine> = (1..)
            .zip(flown.iter().zip(&flight.strips))
            .map(|(strip, (line, &[from_s, to_s]))| FlightLine {
                strip,
                from_s,
                to_s,
                start_m: trajectory.at(from_s).position,
                end_m: trajectory.at(to_s).position,
                length_m: line.path.length(),
            })
            .collect();
        let on_line: f64 = strips.iter().map(|strip| strip.to_s - strip.from_s).sum();
        let coverage = (!corners.is_empty()).then(|| self.coverage(&corners, &flown));
        self.warn(coverage.as_ref(), &mut report);
        Ok(SurveyPlan {
            trajectory,
            strips,
            swath_m: swath.width_m(spec.height_m),
            beside_m: swath.edges_rad.map(|edge| spec.height_m * edge.tan()),
            swath: swath.clone(),
            height_m: spec.height_m,
            spacing_m,
            coverage,
            speed_m_s: self.speed,
            pulses: on_line * swath.fired_hz,
            points: on_line * swath.points_hz(spec.height_m),
            area: corners,
            report,
        })
    }

    /// The lines over the area, in the order in which they are flown, and their spacing, m.
    fn lines(&self, corners: &[DVec2]) -> Result<(Vec<[DVec2; 2]>, f64)> {
        let (spec, swath) = (self.spec, self.swath);
        let heading = match spec.heading_deg {
            // Compass headings count clockwise from y.
            Some(compass) => FRAC_PI_2 - compass.to_radians(),
            None => lines::narrowest(corners),
        };
        let beside = swath.edges_rad.map(|edge| spec.height_m * edge.tan());
        // Edges in the order of angles from the right to the left; the scanner must have been ahead to look back.
        let around = [spec.height_m * swath.reach[1], -spec.height_m * swath.reach[0]];
        let width = beside[1] - beside[0];
        if width <= 0.0 {
            let found = "for a sensor whose beams do not spread across the track";
            return Err(Error::invalid(self.key, found, "a sensor with a swath"));
        }
        let twice = if spec.crossing == CrossLines::All { 2.0 } else { 1.0 };
        let spacing = match spec.density_per_m2 {
            Some(density) => {
                /// Least and greatest part of the swath from strip to strip.
                const PARTS: [f64; 2] = [0.05, 0.9];
                let [from, to] = swath.edges_rad;
                let spacing = twice * swath.pulses_between_hz(from, to) / (self.speed * density);
                if spacing < PARTS[0] * width {
                    let most = twice * swath.pulses_between_hz(from, to) / (self.speed * PARTS[0] * width);
                    let allowed =
                        format!("up to {most:.1} with strips that overlap by 95 %; more at a lower speed or height");
                    return Err(Error::invalid(format!("{}.density_per_m2", self.key), density, allowed));
                }
                spacing.min(PARTS[1] * width)
            }
            None => width * (1.0 - spec.overlap.unwrap_or(0.3)),
        };
        let across = |heading: f64| {
            let [low, high] = lines::extent(corners, DVec2::from_angle(heading + FRAC_PI_2));
            high - low
        };
        let crossing = heading - FRAC_PI_2;
        let count = lines::count(across(heading), width, spacing);
        let (crossings, cross_spacing) = match spec.crossing {
            CrossLines::None => (0.0, spacing),
            CrossLines::All => (lines::count(across(crossing), width, spacing), spacing),
            CrossLines::Count(count) => (f64::from(count), across(crossing) / f64::from(count.max(1))),
        };
        if count + crossings > MOST_LINES {
            let found = format!("so large that it needs {:.0} strips", count + crossings);
            return Err(Error::invalid(self.key, found, format!("up to {MOST_LINES} strips")));
        }
        let mut all = lines::over(corners, heading, (count as u32, spacing), beside, around);
        if crossings > 0.0 {
            all.extend(lines::over(corners, crossing, (crossings as u32, cross_spacing), beside, around));
        }
        Ok((all, spacing))
    }

    /// The lines with their heights.
    fn flown(&self, lines: Vec<[DVec2; 2]>, report: &mut Report) -> Result<Vec<FlownLine>> {
        /// Places of all lines at which the ground is looked up.
        const MOST: f64 = 200_000.0;
        let length: f64 = lines.iter().map(|[from, to]| from.distance(*to)).sum();
        let step = (block_m(self.spec.height_m, self.speed) / 8.0).max(length / MOST);
        let mut found = Vec::with_capacity(lines.len());
        for (index, ends) in lines.into_iter().enumerate() {
            let Some(below) = GroundProfile::new(self.ground, ends, step) else {
                // Adding zero turns -0 into 0.
                let [from, to] = ends.map(|end| end + DVec2::ZERO);
                let found = format!(
                    "not all over the scene: strip {} from {:.1},{:.1} to {:.1},{:.1} misses it",
                    index + 1,
                    from.x,
                    from.y,
                    to.x,
                    to.y
                );
                return Err(Error::invalid(self.key, found, "an area within the scene"));
            };
            found.push(LineBelow { ends, below });
        }
        let gaps: Vec<String> = (1..)
            .zip(&found)
            .filter(|(_, line)| line.below.gaps)
            .map(|(strip, _): (usize, _)| strip.to_string())
            .collect();
        if !gaps.is_empty() {
            let which = if gaps.len() > 8 {
                format!("{} and {} more", gaps[..8].join(", "), gaps.len() - 8)
            } else {
                gaps.join(", ")
            };
            report.warn(format!("strips leave the scene for a part of their way: {which}"));
        }
        let level = found.iter().map(|line| line.below.mean()).sum::<f64>() / found.len().max(1) as f64;
        let made = found.iter().enumerate().map(|(index, LineBelow { ends: [from, to], below })| {
            let mut path = TrackPath::new(*from, (*to - *from).to_angle());
            path.add(0.0, from.distance(*to));
            self.flown_above(path, below, level, index + 1)
        });
        made.collect()
    }

    /// The path of this `strip`, at its height.
    fn flown_above(&self, path: TrackPath, below: &GroundProfile, level: f64, strip: usize) -> Result<FlownLine> {
        let profile = self.profile(below, level);
        let [clearance, along] = profile.least_clearance(below);
        if self.flies() && clearance <= 0.0 {
            let (height, place) = (self.spec.height_m, path.place(along));
            let found = format!("{height}, below ground of strip {strip} at {:.1},{:.1}", place.x, place.y);
            let allowed = format!("more than {:.1} m for it", height - clearance);
            return Err(Error::invalid(format!("{}.height_m", self.key), found, allowed));
        }
        Ok(FlownLine { path, profile })
    }

    fn flies(&self) -> bool {
        self.spec.platform != CarrierKind::GroundVehicle
    }

    /// Heights of the platform; those of a ground vehicle are above its wheels.
    fn profile(&self, below: &GroundProfile, level: f64) -> AltitudeProfile {
        match self.flies() {
            true => AltitudeProfile::new(self.spec, self.speed, below, level),
            false => AltitudeProfile::level(self.spec.height_m),
        }
    }

    /// The strip along a course, whose corners are rounded with `radius` m.
    fn course(&self, radius: f64) -> Result<FlownLine> {
        let places: Vec<DVec2> = self.spec.course_m.iter().map(|place| DVec2::from(*place)).collect();
        let heading = (places[1] - places[0]).to_angle();
        let mut path = TrackPath::new(places[0], heading);
        let mut used = 0.0;
        for (index, corner) in places.windows(3).enumerate() {
            let [before, after] = [corner[1] - corner[0], corner[2] - corner[1]];
            let turn = before.angle_to(after);
            let cut = radius * (0.5 * turn.abs()).tan();
            let last = index + 3 == places.len();
            let room = (before.length() - used).min(after.length() * if last { 1.0 } else { 0.5 });
            if cut > room {
                let key = format!("{}.course_m[{}]", self.key, index + 1);
                let found = format!("a corner of {:.0} degrees with {room:.1} m beside it", turn.abs().to_degrees());
                let allowed = format!("corners with room for turns of {radius:.1} m; a lower speed makes them smaller");
                return Err(Error::invalid(key, found, allowed));
            }
            path.add(0.0, before.length() - used - cut);
            path.add(turn.signum() / radius, radius * turn.abs());
            used = cut;
        }
        let [.., before, last] = places[..] else { return Err(Error::Internal("a course without corners".into())) };
        path.add(0.0, before.distance(last) - used);
        let block = block_m(self.spec.height_m, self.speed);
        let along = |part: f64| path.place(path.length() * part);
        let missed = || Error::invalid(self.key, "a course that misses the scene", "a course over the scene");
        let below = GroundProfile::along(self.ground, &along, path.length(), block / 8.0).ok_or_else(missed)?;
        self.flown_above(path, &below, below.mean(), 1)
    }

    /// What the lines cover of the area, in cells.
    fn coverage(&self, corners: &[DVec2], flown: &[FlownLine]) -> Coverage {
        /// Cells along the longer side of the area.
        const CELLS: f64 = 128.0;
        let ([x0, x1], [y0, y1]) = (lines::extent(corners, DVec2::X), lines::extent(corners, DVec2::Y));
        let size = (x1 - x0).max(y1 - y0) / CELLS;
        let counts = [(x1 - x0) / size, (y1 - y0) / size].map(|count| count.ceil().max(1.0) as u32);
        let steps = [(x1 - x0) / f64::from(counts[0]), (y1 - y0) / f64::from(counts[1])];
        let lines: Vec<(DVec2, DVec2, f64, &AltitudeProfile)> = flown
            .iter()
            .map(|line| {
                let (start, length) = (line.path.place(0.0), line.path.length());
                (start, DVec2::from_angle(line.path.heading(1e-6)), length, &line.profile)
            })
            .collect();
        // No pulse comes back from farther away.
        let farthest = self.swath.range_m[1].min(self.spec.height_m * 15.0);
        let (mut densities, mut inside) = (Vec::new(), 0_usize);
        for cell in 0..counts[0] * counts[1] {
            let [column, row] = [cell % counts[0], cell / counts[0]];
            let place = DVec2::new(x0 + (f64::from(column) + 0.5) * steps[0], y0 + (f64::from(row) + 0.5) * steps[1]);
            if !lines::holds(corners, place) {
                continue;
            }
            // Where there is no ground there is nothing to cover.
            let Some(z) = (self.ground)(place.x, place.y) else { continue };
            let (mut density, mut covered) = (0.0, false);
            for (start, ahead, length, profile) in &lines {
                let away = place - *start;
                let (along, across) = (ahead.dot(away), ahead.perp_dot(away));
                if across.abs() > farthest || !(0.0..=*length).contains(&along) {
                    continue;
                }
                let height = profile.at(along) - z;
                density += self.swath.density_at(across, height, self.speed);
                let angle = across.atan2(height);
                covered |=
                    height > 0.0 && (self.swath.edges_rad[0] - 1e-9..=self.swath.edges_rad[1] + 1e-9).contains(&angle);
            }
            densities.push(density);
            inside += usize::from(covered);
        }
        let cells = densities.len().max(1) as f64;
        let mean_per_m2 = densities.iter().sum::<f64>() / cells;
        densities.sort_by(f64::total_cmp);
        Coverage {
            area_m2: signed_area(corners).abs(),
            covered: inside as f64 / cells,
            mean_per_m2,
            least_per_m2: densities.get(densities.len() / 10).copied().unwrap_or(0.0),
        }
    }

    /// Warns of what surveyors would want to know before they fly.
    fn warn(&self, coverage: Option<&Coverage>, report: &mut Report) {
        let (swath, height) = (self.swath, self.spec.height_m);
        if let Some(coverage) = coverage.filter(|coverage| coverage.covered < 0.995) {
            report.warn(format!(
                "{:.1} % of the area lies in no swath: more overlap, or a height above ground (above: ground), covers hills",
                100.0 * (1.0 - coverage.covered)
            ));
        }
        if !self.flies() {
            return;
        }
        let widest = swath.edges_rad.map(f64::abs).into_iter().fold(0.0, f64::max);
        let [nearest, farthest] = [height, height / widest.cos()];
        let [least, most] = swath.range_m;
        if farthest > most || nearest < least {
            report.warn(format!(
                "the swath is {nearest:.1} to {farthest:.1} m away, and the sensor measures from {least} to {most} m"
            ));
        }
        let [first, last] = [nearest, farthest.min(most)].map(|range| zone(range, swath.pulse_rate_hz));
        if last > first {
            report.warn(format!(
                "echoes come back after {} to {} further pulses (zones {first} to {last} of {:.1} m at {} Hz): those near a \
                 pulse are lost in some instruments",
                first - 1,
                last - 1,
                unambiguous_m(swath.pulse_rate_hz),
                swath.pulse_rate_hz
            ));
        }
    }
}

/// Speed of light in vacuum, m/s (CGPM 1983).
const LIGHT: f64 = 299_792_458.0;

/// Farthest range from which an echo comes back before the next pulse, m: c / (2 f).
pub(crate) fn unambiguous_m(pulse_rate_hz: f64) -> f64 {
    LIGHT / (2.0 * pulse_rate_hz)
}

/// Zone of a range, m, from 1: how many pulses are in the air when its echo comes back, and one.
pub(crate) fn zone(range_m: f64, pulse_rate_hz: f64) -> u64 {
    (range_m / unambiguous_m(pulse_rate_hz)) as u64 + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AreaBox;
    use crate::HeightAbove;
    use crate::platform::GRAVITY;
    use emitter::pattern::Pattern;
    use glam::DQuat;

    const SCANNER: &str = "{type: line_scan, pulse_rate_hz: 100e3, lines_hz: 100, mechanism: {type: rotating, window_deg: \
                           [-45, 45], sweep_deg: 180}}";

    fn swath(yaml: &str) -> SurveySwath {
        let pattern = Pattern::from_yaml(yaml).unwrap();
        let beams = pattern.beams(0.0).unwrap();
        SurveySwath::new(&pattern, &beams, DQuat::IDENTITY, [1.0, 1e4], None).unwrap()
    }

    fn spec(platform: CarrierKind) -> PlanSpec {
        PlanSpec {
            area: Some(AreaBox { min_m: [0.0, 0.0], max_m: [600.0, 400.0] }),
            platform,
            speed_m_s: Some(10.0),
            ..PlanSpec::new(60.0)
        }
    }

    fn hills(x: f64, y: f64) -> Option<f64> {
        Some(20.0 * (x / 150.0).sin() * (y / 200.0).cos())
    }

    fn plan(spec: &PlanSpec) -> Result<SurveyPlan> {
        SurveyPlan::new(spec, "plan", &swath(SCANNER), &hills, 3)
    }

    /// On every strip the platform is at its height above the smoothed ground, at its speed and on a straight line; between
    /// strips neither place nor velocity jump, and the acceleration stays within its bound.
    #[test]
    fn platforms_fly_smoothly_from_strip_to_strip() {
        for (kind, bound) in
            [(CarrierKind::Linear, GRAVITY * 20_f64.to_radians().tan()), (CarrierKind::Multicopter, 2.5)]
        {
            let plan = plan(&spec(kind)).unwrap();
            assert_eq!(plan.strips.len(), 5);
            for strip in &plan.strips {
                let way = plan.trajectory.at(strip.to_s).position - plan.trajectory.at(strip.from_s).position;
                assert!((way.truncate().length() - 10.0 * (strip.to_s - strip.from_s)).abs() < 1e-6);
                for step in 0..=100 {
                    let time = strip.from_s + (strip.to_s - strip.from_s) * f64::from(step) / 100.0;
                    let pose = plan.trajectory.at(time);
                    let place = pose.position;
                    let above = place.z - hills(place.x, place.y).unwrap();
                    assert!((above - 60.0).abs() < 4.0, "{kind:?} {above}");
                    let across = way.truncate().normalize().perp_dot((place - strip.start_m).truncate());
                    assert!(across.abs() < 1e-6);
                    // Level, and ahead.
                    assert!((pose.orientation * DVec3::Z).z > 1.0 - 1e-9);
                    assert!((pose.orientation * DVec3::X).dot(way.normalize()) > 0.98);
                }
            }
            let (start, end) = plan.trajectory.span();
            let step = 0.2;
            let places: Vec<DVec3> = (0..((end - start) / step) as u32)
                .map(|index| plan.trajectory.at(start + step * f64::from(index)).position)
                .collect();
            for places in places.windows(3) {
                let velocity = (places[1] - places[0]) / step;
                assert!(velocity.length() < 16.0, "{kind:?} {velocity}");
                let acceleration = (places[2] - 2.0 * places[1] + places[0]) / (step * step);
                assert!(acceleration.truncate().length() < 1.05 * bound, "{kind:?} {acceleration}");
            }
            // Somewhere it leans as much as its acceleration needs.
            let tilt = |pose: ground::pose::Pose| (pose.orientation * DVec3::Z).z.clamp(-1.0, 1.0).acos();
            let most = plan.trajectory.clone().into_keys().into_iter().map(|(_, pose)| tilt(pose)).fold(0.0, f64::max);
            assert!((most / (bound / GRAVITY).atan() - 1.0).abs() < 0.1, "{kind:?} {most}");
        }
    }

    /// A multicopter hovers at the beginning and at the end.
    #[test]
    fn multicopters_start_and_end_at_rest() {
        let plan = plan(&spec(CarrierKind::Multicopter)).unwrap();
        let (start, end) = plan.trajectory.span();
        assert!(plan.trajectory.velocity(start + 0.05).length() < 0.1);
        assert!(plan.trajectory.velocity(end - 0.05).length() < 0.1);
        assert!(plan.trajectory.velocity(plan.strips[0].from_s + 0.5).length() > 9.9);
    }

    /// A vehicle stands on the ground, with its axes along it.
    #[test]
    fn vehicles_follow_the_ground() {
        let course = vec![[0.0, 0.0], [100.0, 0.0], [160.0, 60.0], [160.0, 200.0]];
        let spec = PlanSpec {
            course_m: course,
            platform: CarrierKind::GroundVehicle,
            speed_m_s: Some(5.0),
            ..PlanSpec::new(2.0)
        };
        let plan = plan(&spec).unwrap();
        assert_eq!((plan.strips.len(), plan.spacing_m), (1, None));
        for (_, pose) in plan.trajectory.clone().into_keys() {
            let place = pose.position;
            assert!((place.z - hills(place.x, place.y).unwrap() - 2.0).abs() < 0.02);
            let rise = |x: f64, y: f64| {
                (hills(place.x + x, place.y + y).unwrap() - hills(place.x - x, place.y - y).unwrap()) / 0.2
            };
            let normal = DVec3::new(-rise(0.1, 0.0), -rise(0.0, 0.1), 1.0).normalize();
            assert!((pose.orientation * DVec3::Z).dot(normal) > 1.0 - 1e-4);
        }
        let sharp = PlanSpec { course_m: vec![[0.0, 0.0], [10.0, 0.0], [0.0, 1.0]], ..spec };
        let error = super::tests::plan(&sharp).unwrap_err().to_string();
        assert!(error.starts_with("plan.course_m[1] is a corner of"), "{error}");
    }

    /// Stations stand where they are asked to, level within their error, for whole turns of the head.
    #[test]
    fn tripods_stand_level_within_their_error() {
        let scanner = swath(
            "{type: line_scan, pulse_rate_hz: 1e5, lines_hz: 60, plane: upright, mechanism: {type: rotating, \
                             window_deg: [-40, 60], sweep_deg: 240}, head: {rate_deg_s: 9}}",
        );
        let stations: Vec<[f64; 2]> =
            (0..400).map(|index| [f64::from(index % 20) * 10.0, f64::from(index / 20) * 10.0]).collect();
        let spec = PlanSpec {
            stations_m: stations,
            platform: CarrierKind::Tripod,
            level_error_deg: 0.01,
            ..PlanSpec::new(1.7)
        };
        let plan = SurveyPlan::new(&spec, "plan", &scanner, &hills, 3).unwrap();
        let mut sum = 0.0;
        for strip in &plan.strips {
            assert!((strip.to_s - strip.from_s - 40.0).abs() < 1e-9 && (strip.from_s / 40.0).fract() < 1e-9);
            let pose = plan.trajectory.at(strip.from_s + 1.0);
            assert!((pose.position.z - hills(pose.position.x, pose.position.y).unwrap() - 1.7).abs() < 1e-9);
            let up = pose.orientation * DVec3::Z;
            sum += up.x * up.x + up.y * up.y;
        }
        let sigma = (sum / 800.0).sqrt().to_degrees();
        // Three standard errors of a standard deviation from 800 numbers.
        assert!((sigma / 0.01 - 1.0).abs() < 3.0 / 1600_f64.sqrt(), "{sigma}");
        let moving =
            SurveyPlan::new(&super::tests::spec(CarrierKind::Linear), "plan", &scanner, &hills, 3).unwrap_err();
        assert!(moving.to_string().contains("tripod for a scanner whose head turns"), "{moving}");
    }

    /// A density that is asked for is that in the middle of the area, with crossing strips too.
    #[test]
    fn densities_are_reached() {
        let flat: GroundHeight = &|_, _| Some(0.0);
        for (crossing, density) in [(CrossLines::None, 60.0), (CrossLines::All, 120.0)] {
            let spec = PlanSpec {
                area: Some(AreaBox { min_m: [0.0, 0.0], max_m: [3000.0, 3000.0] }),
                density_per_m2: Some(density),
                crossing,
                ..spec(CarrierKind::Linear)
            };
            let plan = SurveyPlan::new(&spec, "plan", &swath(SCANNER), flat, 0).unwrap();
            let found = plan.coverage.unwrap();
            assert!(found.covered == 1.0 && (found.mean_per_m2 / density - 1.0).abs() < 0.03, "{found:?}");
        }
        let much = PlanSpec { density_per_m2: Some(1e4), ..spec(CarrierKind::Linear) };
        let error = plan(&much).unwrap_err().to_string();
        assert!(error.contains("plan.density_per_m2 is 10000; allowed: up to"), "{error}");
    }

    #[test]
    fn strips_that_miss_the_scene_are_errors() {
        let elsewhere: GroundHeight = &|x, _| (x > 1e4).then_some(0.0);
        let error = SurveyPlan::new(&spec(CarrierKind::Linear), "plan", &swath(SCANNER), elsewhere, 0).unwrap_err();
        assert!(error.to_string().contains("strip 1 from") && error.to_string().contains("misses it"), "{error}");
        let edge: GroundHeight = &|x, _| (x < 500.0).then_some(0.0);
        let plan = SurveyPlan::new(&spec(CarrierKind::Linear), "plan", &swath(SCANNER), edge, 0).unwrap();
        assert!(plan.report.warnings[0].starts_with("strips leave the scene"), "{:?}", plan.report);
    }

    /// At one height, along terrain that is steeper than it is followed, and along a course.
    #[test]
    fn flights_through_the_ground_are_errors() {
        let sea = PlanSpec { above: HeightAbove::Sea, height_m: 10.0, ..spec(CarrierKind::Linear) };
        let error = plan(&sea).unwrap_err().to_string();
        assert!(error.contains("plan.height_m is 10, below ground of strip 1 at "), "{error}");
        // A cliff, over which the mean of what is before and behind is 20 m lower than its edge.
        let cliff: GroundHeight = &|x, _| Some(if x < 300.0 { 0.0 } else { 40.0 });
        let course = PlanSpec { area: None, course_m: vec![[0.0, 0.0], [600.0, 0.0]], ..spec(CarrierKind::Linear) };
        for low in [spec(CarrierKind::Multicopter), course] {
            let made = |height_m: f64| {
                SurveyPlan::new(&PlanSpec { height_m, ..low.clone() }, "plan", &swath(SCANNER), cliff, 0)
            };
            assert!(made(10.0).unwrap_err().to_string().contains("plan.height_m is 10, below ground of strip 1 at "));
            assert!(made(30.0).is_ok());
        }
    }

    /// Section 5 of the specification of surveys: ranges without ambiguity, and zones.
    #[test]
    fn zones_count_pulses_in_the_air() {
        for (rate, expected) in [(100e3, 1498.962), (300e3, 499.6541), (550e3, 272.5386), (1e6, 149.8962)] {
            assert!((unambiguous_m(rate) / expected - 1.0).abs() < 1e-6);
        }
        assert_eq!([(1000.0, 1e6), (1000.0, 300e3), (1000.0, 2e6)].map(|(range, rate)| zone(range, rate)), [7, 3, 14]);
    }

    #[test]
    fn mistakes_are_named() {
        let error = |spec: PlanSpec| spec.check("trajectory.plan").unwrap_err().to_string();
        let twice = PlanSpec { course_m: vec![[0.0; 2], [9.0; 2]], ..spec(CarrierKind::Linear) };
        assert!(error(twice).starts_with("trajectory.plan.area is given beside another place; allowed: one of area,"));
        let nowhere = PlanSpec { area: None, ..spec(CarrierKind::Linear) };
        assert!(
            plan(&nowhere).unwrap_err().to_string().starts_with("plan is nowhere; allowed: one of area, polygon_m")
        );
        let both = PlanSpec { overlap: Some(0.3), density_per_m2: Some(3.0), ..spec(CarrierKind::Linear) };
        assert!(error(both).starts_with("trajectory.plan.density_per_m2 is given beside overlap"));
        let still = PlanSpec { speed_m_s: None, ..spec(CarrierKind::Linear) };
        assert!(error(still).starts_with("trajectory.plan.speed_m_s is missing"));
        assert!(error(spec(CarrierKind::Tripod)).starts_with("trajectory.plan.platform is not one for this place"));
        let high = PlanSpec { height_m: 1e5, ..spec(CarrierKind::Linear) };
        assert!(error(high).starts_with("trajectory.plan.height_m is 100000; allowed: above 0, up to 20000 m"));
    }
}
