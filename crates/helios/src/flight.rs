//! Where the platform is on each leg, and when.

use crate::beams::HeadTurn;
use crate::notes::{NoteBook, XmlPlace};
use crate::pattern::HeadPlan;
use crate::platform::{HeliosMovement, HeliosRotors};
use crate::survey::{HeliosLeg, HeliosSurvey};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;

/// A leg on which the scanner is on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FlownLeg {
    /// Its number, from 0.
    pub leg: usize,
    /// When it begins, s.
    pub from_s: f64,
    /// When it ends, s.
    pub to_s: f64,
}

/// Poses of the platform over time, axes of HELIOS++, and the legs on which the scanner is on.
#[derive(Default)]
pub(crate) struct Flight {
    pub keys: Vec<(f64, Pose)>,
    pub legs: Vec<FlownLeg>,
}

/// Time that passes between legs where the platform jumps or turns at once, s.
const JUMP_S: f64 = 1e-3;

/// More keys than any flight needs.
const MOST_KEYS: usize = 2_000_000;

/// Height of the ground at x and y, m.
pub(crate) type LegGround<'g> = &'g dyn Fn(f64, f64) -> Option<f64>;

impl Flight {
    /// The flight of `survey`, whose head turns on its legs as `heads` say.
    ///
    /// # Errors
    /// Legs that never end, or none on which anything is measured.
    pub fn of(
        survey: &HeliosSurvey,
        heads: &[HeadTurn],
        plan: HeadPlan,
        ground: LegGround,
        notes: &NoteBook,
    ) -> Result<Flight> {
        let (points, legs) = (points(survey, ground), &survey.legs);
        let mut flight = Flight::default();
        let mut yaw = 0.0;
        for (index, leg) in legs.iter().enumerate() {
            let wrong = |message: &str| {
                Error::parse(notes.path(leg.place), format!("line {}", leg.place.line), format!("leg {message}"))
            };
            let head = heads[index];
            let limit = leg.longest_s.or(leg.scanner.number("maxDuration_s").filter(|longest| *longest > 0.0));
            let is_last = index + 1 == legs.len();
            let mut path = match &survey.platform.movement {
                HeliosMovement::Interpolated => {
                    let track = leg.track.as_ref().ok_or_else(|| wrong("has no trajectory"))?;
                    track.path()?
                }
                HeliosMovement::Static => {
                    let duration = if head.rate_deg_s == 0.0 { limit.unwrap_or(0.0) } else { head.duration_s() };
                    let is_on = leg.scanner.flag("active") != Some(false);
                    if duration <= 0.0 && is_on {
                        return Err(wrong("never ends; allowed: a head that turns, or maxDuration_s"));
                    }
                    let pose = Pose { position: points[index], orientation: DQuat::IDENTITY };
                    vec![(0.0, pose), (duration, pose)]
                }
                // The last point is where the last but one leg ends.
                _ if is_last => continue,
                movement => {
                    // The platform goes on from where it is: before that it may have cut a corner, or had no more time.
                    let from = flight.keys.last().map_or(points[index], |(_, pose)| pose.position);
                    let course = LegCourse { from, to: points[index + 1], then: points.get(index + 2).copied() };
                    course.check(leg, &wrong)?;
                    course.flown(movement, leg, &mut yaw)
                }
            };
            if !matches!(survey.platform.movement, HeliosMovement::Interpolated | HeliosMovement::Static) {
                // A leg is done when its point is reached and the head has turned.
                hold(&mut path, head.duration_s());
            }
            if let Some(limit) = limit {
                cut(&mut path, limit);
            }
            if path[path.len() - 1].0 > 0.0 {
                let step = match (plan, &survey.platform.movement) {
                    (HeadPlan::OfPattern, HeliosMovement::Static) => head.duration_s(),
                    _ => 0.0,
                };
                flight.add(index, leg, path, step)?;
            }
        }
        if flight.legs.is_empty() {
            let place = legs[0].place;
            let message = "survey has no leg on which its scanner is on and moves; the last leg of a moving platform measures nothing";
            return Err(Error::parse(notes.path(place), format!("line {}", place.line), message));
        }
        Ok(flight)
    }

    /// Adds a leg along `path`, whose times count from its beginning, at a multiple of `step`, s, if that is not 0.
    fn add(&mut self, index: usize, leg: &HeliosLeg, path: Vec<(f64, Pose)>, step: f64) -> Result<()> {
        let mut start = match self.keys.last() {
            None => 0.0,
            Some((time, pose)) if same(pose, &path[0].1) && step == 0.0 => *time,
            Some((time, _)) => time + JUMP_S,
        };
        if step > 0.0 {
            start = (start / step - 1e-9).ceil().max(0.0) * step;
        }
        if self.keys.len() + path.len() > MOST_KEYS {
            return Err(too_long());
        }
        let end = start + path[path.len() - 1].0;
        for (time, pose) in path {
            let time = start + time;
            if self.keys.last().is_none_or(|(before, _)| time > *before) {
                self.keys.push((time, pose));
            }
        }
        if leg.scanner.flag("active") != Some(false) {
            self.legs.push(FlownLeg { leg: index, from_s: start, to_s: end });
        }
        Ok(())
    }

    /// Turns the carrier with the head, which turns on the legs as `heads` say, about `axis` of a scanner mounted with the
    /// rotation `mount`.
    ///
    /// # Errors
    /// Too many turns.
    pub fn turn_with(&mut self, heads: &[HeadTurn], mount: DQuat, axis: DVec3) -> Result<()> {
        // Between keys the carrier turns the short way.
        const STEP_DEG: f64 = 90.0;
        // From the end of one leg to the beginning of the next one at the same time, s.
        const INSTANT: f64 = 1e-6;
        let about = mount * axis;
        let mut turned: Vec<(f64, Pose)> = Vec::with_capacity(self.keys.len());
        for (index, (time, pose)) in self.keys.iter().enumerate() {
            // Of two legs that meet, the later one goes on from here.
            let mut there = self.legs.iter().filter(|leg| (leg.from_s..=leg.to_s).contains(time));
            let (ending, leg) = (there.next(), there.next_back());
            let Some(leg) = leg.or(ending) else {
                turned.push((*time, *pose));
                continue;
            };
            let on_leg = |leg: &FlownLeg, time: f64, pose: &Pose| {
                let head = heads[leg.leg];
                let angle = (head.from_deg + head.rate_deg_s * (time - leg.from_s)).to_radians();
                let orientation = (pose.orientation * DQuat::from_axis_angle(about, angle)).normalize();
                (time, Pose { orientation, ..*pose })
            };
            let (head, with_head) = (heads[leg.leg], |time: f64, pose: &Pose| on_leg(leg, time, pose));
            let ended = ending.filter(|ending| ending.leg != leg.leg);
            turned.extend(ended.map(|ended| on_leg(ended, *time, pose)));
            turned.push(with_head(if ended.is_some() { time + INSTANT } else { *time }, pose));
            let Some((next, later)) = self.keys.get(index + 1).filter(|(next, _)| *next <= leg.to_s) else { continue };
            let steps = (head.rate_deg_s * (next - time) / STEP_DEG).abs().ceil() as usize;
            if turned.len().saturating_add(steps) > MOST_KEYS {
                return Err(too_long());
            }
            for step in 1..steps {
                let part = step as f64 / steps as f64;
                let between = Pose {
                    position: pose.position.lerp(later.position, part),
                    orientation: pose.orientation.slerp(later.orientation, part),
                };
                turned.push(with_head(time + (next - time) * part, &between));
            }
        }
        self.keys = turned;
        Ok(())
    }
}

fn too_long() -> Error {
    Error::Memory(format!("a trajectory of more than {MOST_KEYS} poses"))
}

fn same(a: &Pose, b: &Pose) -> bool {
    a.position.distance(b.position) < 1e-9 && a.orientation.dot(b.orientation).abs() > 1.0 - 1e-12
}

/// The points of the legs, on the ground where they ask for that.
fn points(survey: &HeliosSurvey, ground: LegGround) -> Vec<DVec3> {
    let point = |leg: &HeliosLeg| {
        let [x, y, z] = ["x", "y", "z"].map(|axis| leg.platform.number(axis).unwrap_or(0.0));
        // As there, what is not over any ground stands at height 0.
        let on_ground = leg.platform.flag("onGround") == Some(true);
        DVec3::new(x, y, if on_ground { ground(x, y).unwrap_or(0.0) } else { z })
    };
    survey.legs.iter().map(point).collect()
}

/// Adds that the platform waits at its end until `duration`, s.
fn hold(path: &mut Vec<(f64, Pose)>, duration: f64) {
    let (end, pose) = path[path.len() - 1];
    if duration > end {
        path.push((duration, pose));
    }
}

/// Cuts a path at `limit`, s.
fn cut(path: &mut Vec<(f64, Pose)>, limit: f64) {
    let after = path.partition_point(|(time, _)| *time < limit);
    if after == 0 || after == path.len() {
        return;
    }
    let ((t0, a), (t1, b)) = (path[after - 1], path[after]);
    let part = (limit - t0) / (t1 - t0);
    let pose =
        Pose { position: a.position.lerp(b.position, part), orientation: a.orientation.slerp(b.orientation, part) };
    path.truncate(after);
    path.push((limit, pose));
}

/// The way of a leg, and where the next one leads.
struct LegCourse {
    from: DVec3,
    to: DVec3,
    then: Option<DVec3>,
}

/// Speed of a platform whose leg gives none, m/s (XmlAssetsLoader.cpp, 3dgeo-heidelberg/helios fd94d1f).
const USUAL_SPEED_M_S: f64 = 70.0;

fn speed(leg: &HeliosLeg) -> f64 {
    leg.platform.number("movePerSec_m").unwrap_or(USUAL_SPEED_M_S)
}

fn yaw_to(way: DVec3) -> Option<f64> {
    (way.truncate().length() > 1e-9).then(|| (-way.x).atan2(way.y))
}

impl LegCourse {
    fn check(&self, leg: &HeliosLeg, wrong: &dyn Fn(&str) -> Error) -> Result<()> {
        if speed(leg) <= 0.0 && self.from != self.to {
            return Err(wrong("has movePerSec_m 0, and so never reaches its point; allowed: above 0"));
        }
        Ok(())
    }

    /// Poses of the platform along it; `yaw` is its heading, which stays where the way leads straight up, rad.
    fn flown(&self, movement: &HeliosMovement, leg: &HeliosLeg, yaw: &mut f64) -> Vec<(f64, Pose)> {
        let way = self.to - self.from;
        *yaw = yaw_to(way).unwrap_or(*yaw);
        let departure = leg.platform.number("yawAtDeparture_deg").map(f64::to_radians);
        let (heading, profile) = match movement {
            HeliosMovement::Multicopter(rotors) => {
                if leg.platform.flag("smoothTurn") == Some(true) {
                    return self.turned(rotors, leg, *yaw);
                }
                let stops = leg.platform.flag("stopAndTurn") != Some(false);
                let slows = leg.platform.flag("slowdownEnabled") != Some(false);
                (departure.filter(|_| stops).unwrap_or(*yaw), rotors.profile(way.length(), speed(leg), [stops, slows]))
            }
            _ => (*yaw, vec![(0.0, 0.0), (way.length() / speed(leg).max(1e-12), way.length())]),
        };
        let orientation = DQuat::from_rotation_z(heading);
        let along = way.normalize_or_zero();
        let pose = |distance: f64| Pose { position: self.from + along * distance, orientation };
        if way == DVec3::ZERO {
            return vec![(0.0, pose(0.0))];
        }
        profile.into_iter().map(|(time, distance)| (time, pose(distance))).collect()
    }

    /// Poses of a multicopter that keeps its speed and turns into the next leg before its point: along the arc that its
    /// rate of turning allows.
    fn turned(&self, rotors: &HeliosRotors, leg: &HeliosLeg, yaw: f64) -> Vec<(f64, Pose)> {
        let way = self.to - self.from;
        let speed = speed(leg).min(rotors.force_max / rotors.drag);
        let pose = |position, yaw| Pose { position, orientation: DQuat::from_rotation_z(yaw) };
        let next = self.then.map(|then| then - self.to).filter(|next| yaw_to(*next).is_some());
        let (Some(next), true) = (next, way.length() > 1e-9) else {
            return vec![(0.0, pose(self.from, yaw)), (way.length() / speed, pose(self.to, yaw))];
        };
        use std::f64::consts::{PI, TAU};
        let turn = (yaw_to(next).unwrap_or(yaw) - yaw + PI).rem_euclid(TAU) - PI;
        let radius = speed / rotors.yaw_rate_deg_s.to_radians();
        let half = (turn.abs() / 2.0).tan();
        // No more than half of either leg is cut off.
        let cut = (radius * half).min(0.45 * way.length()).min(0.45 * next.length());
        let radius = cut / half.max(1e-12);
        let (begin, end) = (self.to - way.normalize_or_zero() * cut, self.to + next.normalize_or_zero() * cut);
        let straight = begin.distance(self.from) / speed;
        let mut path = vec![(0.0, pose(self.from, yaw)), (straight, pose(begin, yaw))];
        let steps = (turn.abs() / 0.1).ceil().max(1.0) as usize;
        let duration = (radius * turn.abs() / speed).max(1e-6);
        let side = DQuat::from_rotation_z(turn.signum() * PI / 2.0) * way.with_z(0.0).normalize_or_zero();
        let centre = begin + side * radius;
        for step in 1..=steps {
            let part = step as f64 / steps as f64;
            let around = centre + DQuat::from_rotation_z(turn * part) * (begin - centre);
            let position = if step == steps { end } else { around.with_z(begin.z + (end.z - begin.z) * part) };
            path.push((straight + duration * part, pose(position, yaw + turn * part)));
        }
        path
    }
}

impl HeliosRotors {
    /// Times, s, and distances, m, on a way of `length` at `speed`: with `[stops, slows]`, the speed grows from almost 0
    /// and decays to that.
    ///
    /// There, a force that grows as e^(speedup t) from 0.0001 to engine_max_force and decays as e^(-slowdown t) down to
    /// 0.001 drives against a drag that stops the platform within milliseconds: the speed is force over drag, up to the one
    /// asked for (HelicopterPlatform.cpp, SimplePhysicsPlatform.cpp, 3dgeo-heidelberg/helios fd94d1f).
    fn profile(&self, length: f64, speed: f64, [stops, slows]: [bool; 2]) -> Vec<(f64, f64)> {
        let most = speed.min(self.force_max / self.drag).max(1e-9);
        let least =
            [(1e-4, stops), (1e-3, slows)].map(|(force, on)| if on { (force / self.drag).min(most) } else { most });
        let [up, down] = [self.speedup, self.slowdown];
        // Of an exponential ramp, the distance is the change of the speed over its rate. On a short way, the ramps meet.
        let meet = (length + least[0] / up + least[1] / down) / (1.0 / up + 1.0 / down);
        let top = match [stops, slows] {
            [true, true] => most.min(meet),
            [true, false] => most.min(least[0] + length * up),
            _ => most,
        };
        let top = top.max(least[0]);
        let ramps = [((top - least[0]) / up, up, least[0]), (((top - least[1]) / down).max(0.0), down, least[1])];
        let (rise, fall) = (ramps[0].0.min(length), ramps[1].0.min(length - ramps[0].0.min(length)));
        let mut profile = vec![(0.0, 0.0)];
        let mut push = |time: f64, distance: f64| {
            if profile.last().is_none_or(|(before, at)| time > before + 1e-9 && distance >= *at) {
                profile.push((time, distance));
            }
        };
        const STEPS: usize = 16;
        let duration_up = (top / least[0]).ln() / up;
        for step in 1..=STEPS {
            let time = duration_up * step as f64 / STEPS as f64;
            push(time, (least[0] * (up * time).exp() - least[0]) / up);
        }
        let cruise = ((length - rise - fall) / top).max(0.0);
        push(duration_up + cruise, length - fall);
        let duration_down = (top / least[1]).ln().max(0.0) / down;
        for step in 1..=STEPS {
            let time = duration_down * step as f64 / STEPS as f64;
            push(duration_up + cruise + time, length - fall + (top - top * (-down * time).exp()) / down);
        }
        // Rounding errors of the ramps must not move the point.
        if let Some(last) = profile.last_mut() {
            last.1 = length;
        }
        profile
    }
}

/// Notes what of the settings of the platforms is approximated.
pub(crate) fn note_settings(survey: &HeliosSurvey, notes: &NoteBook) {
    let movement = &survey.platform.movement;
    let how = |name: &str| -> Option<&'static str> {
        Some(match (movement, name) {
            (HeliosMovement::GroundVehicle, "movePerSec_m") => {
                "the vehicle has its speed at once and drives straight to its points"
            }
            (HeliosMovement::Multicopter(_), "smoothTurn") => "the turn is an arc at constant speed",
            (HeliosMovement::Multicopter(_), "stopAndTurn" | "slowdownEnabled") => return None,
            (HeliosMovement::Static | HeliosMovement::Interpolated, "movePerSec_m") => {
                "has no effect on such a platform, as in HELIOS++"
            }
            (_, "smoothTurn" | "stopAndTurn" | "slowdownEnabled" | "yawAtDeparture_deg") => {
                "has an effect on multicopters only, as in HELIOS++"
            }
            _ => return None,
        })
    };
    for leg in &survey.legs {
        for name in ["movePerSec_m", "smoothTurn", "stopAndTurn", "slowdownEnabled", "yawAtDeparture_deg"] {
            if let (Some(place), Some(how)) = (leg.platform.place(name), how(name)) {
                notes.approximated(place, name, how);
            }
        }
    }
    let duration = |place: XmlPlace| {
        notes.approximated(place, "maxDuration_s", "the leg ends there; the next begins at its own point")
    };
    survey.legs.iter().filter(|leg| leg.longest_s.is_some()).for_each(|leg| duration(leg.place));
}
