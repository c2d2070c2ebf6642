//! Moving cars: their routes, and traffic that follows, brakes, stops and turns.

use super::plan::{Crossing, LANE_MIDDLE, SIDE_STOP, STOP, StreetPlan};
use crate::noise::Dice;
use glam::{DQuat, DVec2, DVec3};
use ground::rng::Draw;
use std::cmp::Ordering;
use std::f64::consts::{FRAC_PI_2, PI};

/// Keyframes per second of cars, and of their wheels.
pub(super) const KEYS: f64 = 10.0;
pub(super) const WHEEL_KEYS: f64 = 30.0;
/// Maximum speed of cars, m/s.
const FASTEST: f64 = 14.0;
/// Step of the simulation, s.
const STEP: f64 = 0.01;

/// The intelligent driver model (Treiber, Hennecke and Helbing 2000, Phys. Rev. E 62, 1805): acceleration and
/// comfortable deceleration in m/s^2, time headway in s, and the gap at rest in m.
const ACCELERATION: f64 = 1.9;
const BRAKING: f64 = 2.4;
const HEADWAY: f64 = 1.0;
const GAP: f64 = 2.0;
/// Maximum deceleration, and the maximum that a driver accepts in order to stop at a light.
const HARDEST: f64 = 7.0;
const WILLING: f64 = 3.5;
/// Length assumed for every car.
const LENGTH: f64 = 4.6;
/// Radius of the turn at the crossing, and the speed there.
const RADIUS: f64 = 6.5;
const TURNING: f64 = 4.5;

/// Maximum number of cars at a single crossing.
const MOST_CARS: usize = 10;

/// Directions of lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lane {
    East,
    West,
    South,
    North,
}

impl Lane {
    fn is_in_side_street(self) -> bool {
        matches!(self, Lane::South | Lane::North)
    }

    /// The axis along which the lane leads, and its sign along that axis.
    fn axis(self) -> (usize, f64) {
        match self {
            Lane::East => (0, 1.0),
            Lane::West => (0, -1.0),
            Lane::North => (1, 1.0),
            Lane::South => (1, -1.0),
        }
    }
}

/// Cars at a single crossing: lane, start in m relative to the crossing, range of desired speeds, and whether the car
/// turns. First comes the carrier of the sensor, then one that stops in the side street, one that turns to the right,
/// and others. None leaves the street before the end of the animation, and the first meets no red light.
const STARTS: [(Lane, f64, [f64; 2], bool); MOST_CARS] = [
    (Lane::East, -60.0, [12.0, 12.8], false),
    (Lane::South, -44.0, [9.0, 10.0], false),
    (Lane::West, -38.0, [8.5, 8.9], true),
    (Lane::West, -8.0, [9.2, 10.2], false),
    (Lane::East, -27.0, [12.0, 12.2], false),
    (Lane::West, -62.0, [11.0, 14.0], false),
    (Lane::East, 11.0, [8.0, 8.3], false),
    (Lane::North, -40.0, [8.0, 9.0], false),
    (Lane::East, -84.0, [10.0, 14.0], false),
    (Lane::West, -86.0, [10.0, 14.0], false),
];

/// A route: straight, or with one arc to the right. Lengths along it are 0 where its straight part, extended if it
/// turns, has coordinate 0 along its axis: in the middle of the crossing at the origin.
#[derive(Clone, Copy, Debug)]
struct CarRoute {
    middle: DVec2,
    heading: f64,
    /// Length at which the arc begins.
    turn: Option<f64>,
}

impl CarRoute {
    /// A route in the street whose centre line is at `street`: a y, or an x for side streets.
    fn new(lane: Lane, street: f64, turns: bool) -> Self {
        let (x, y, heading) = match lane {
            Lane::East => (0.0, street - LANE_MIDDLE, 0.0),
            Lane::West => (0.0, street + LANE_MIDDLE, PI),
            Lane::South => (street - LANE_MIDDLE, 0.0, -FRAC_PI_2),
            Lane::North => (street + LANE_MIDDLE, 0.0, FRAC_PI_2),
        };
        CarRoute { middle: DVec2::new(x, y), heading, turn: turns.then_some(-LANE_MIDDLE - RADIUS) }
    }

    /// Position and heading at `length`.
    fn at(&self, length: f64) -> (DVec2, f64) {
        let ahead = DVec2::from_angle(self.heading);
        let Some(turn) = self.turn.filter(|turn| length > *turn) else {
            return (self.middle + ahead * length, self.heading);
        };
        let angle = ((length - turn) / RADIUS).min(FRAC_PI_2);
        let heading = self.heading - angle;
        let center = self.middle + ahead * turn - ahead.perp() * RADIUS;
        let after = (length - turn - RADIUS * FRAC_PI_2).max(0.0);
        (center + DVec2::from_angle(heading).perp() * RADIUS + DVec2::from_angle(heading) * after, heading)
    }

    /// Curvature (one over the radius), positive to the left, averaged over 3 m.
    fn curvature(&self, length: f64) -> f64 {
        const HALF: f64 = 1.5;
        (self.at(length + HALF).1 - self.at(length - HALF).1) / (2.0 * HALF)
    }
}

/// A car's drive: its distance along the route and its speed at every step.
pub(super) struct Drive {
    way: CarRoute,
    lane: Lane,
    street: f64,
    desired: f64,
    states: Vec<[f64; 2]>,
    /// The crossings on its route.
    crossings: Vec<Ahead>,
    /// Where its street ends, if it has to stop there.
    end: f64,
    /// Index in the list of a crossing whose light is no longer green, and whether the car drives on there because it
    /// can no longer stop.
    hurries: Option<(usize, bool)>,
}

/// A crossing on the route of a car: the length at its middle, and whether its lights are in opposite phase.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    middle: f64,
    is_odd: bool,
}

impl Drive {
    /// Distance along the route, and speed.
    fn state(&self, time: f64) -> [f64; 2] {
        let last = self.states.len() - 1;
        let step = ((time / STEP) as usize).min(last.saturating_sub(1));
        let part = (time / STEP - step as f64).clamp(0.0, 1.0);
        let ([length, speed], [next, next_speed]) = (self.states[step], self.states[(step + 1).min(last)]);
        [length + (next - length) * part, speed + (next_speed - speed) * part]
    }

    /// Position and velocity.
    pub fn place(&self, time: f64) -> [DVec3; 2] {
        let [length, speed] = self.state(time);
        let (at, heading) = self.way.at(length);
        [at.extend(0.0), (DVec2::from_angle(heading) * speed).extend(0.0)]
    }

    pub fn turned(&self, time: f64) -> DQuat {
        DQuat::from_rotation_z(self.way.at(self.state(time)[0]).1)
    }

    /// Angle by which its wheels have turned.
    pub fn rolled(&self, time: f64, radius: f64) -> f64 {
        (self.state(time)[0] - self.states[0][0]) / radius
    }

    /// Whether it turns at the crossing.
    pub fn turns(&self) -> bool {
        self.way.turn.is_some()
    }

    /// Length at which the turn is over.
    fn turned_at(&self) -> f64 {
        self.way.turn.map_or(f64::INFINITY, |turn| turn + RADIUS * FRAC_PI_2)
    }

    /// Steering angle of the front wheels, positive to the left.
    pub fn steered(&self, time: f64, wheelbase: f64) -> f64 {
        (wheelbase * self.way.curvature(self.state(time)[0])).atan()
    }

    /// Its slowest speed, and its fastest.
    #[cfg(test)]
    pub fn speeds(&self) -> [f64; 2] {
        let speeds = || self.states.iter().map(|[_, speed]| *speed);
        [speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max)]
    }

    /// The acceleration behind an obstacle `gap` m ahead that is approached at `closing` m/s; on a free road, the gap
    /// is infinite.
    fn follow(&self, gap: f64, closing: f64) -> f64 {
        let speed = self.now()[1];
        let desired_gap = GAP + (speed * HEADWAY + speed * closing / (2.0 * (ACCELERATION * BRAKING).sqrt())).max(0.0);
        let free = 1.0 - (speed / self.limit()).powi(4);
        ACCELERATION * (free - (desired_gap / gap.max(0.1)).powi(2))
    }

    fn now(&self) -> [f64; 2] {
        self.states.last().copied().unwrap_or_default()
    }

    /// The desired speed: reduced near a turn.
    fn limit(&self) -> f64 {
        let Some(turn) = self.way.turn else { return self.desired };
        let length = self.now()[0];
        let (before, after) = (turn - length, length - turn - RADIUS * FRAC_PI_2);
        (TURNING.powi(2) + 2.0 * 1.5 * before.max(after).max(0.0)).sqrt().min(self.desired)
    }
}

/// Times of keyframes, about `rate` per second, from 0 to exactly `seconds`.
pub(super) fn key_times(seconds: f64, rate: f64) -> Vec<f64> {
    let last = (seconds * rate).ceil() as u32;
    (0..=last).map(|key| seconds * f64::from(key) / f64::from(last)).collect()
}

/// A possible start of a car: its lane and street, the length along its route, the range of desired speeds, and whether
/// it turns.
struct CarStart {
    lane: Lane,
    street: f64,
    length: f64,
    desired: [f64; 2],
    turns: bool,
}

/// Possible starts of cars, that of the carrier of the sensor first.
fn starts(plan: &StreetPlan, seed: u64) -> Vec<CarStart> {
    /// In a town: distance of the first car before a crossing from its middle, least distance of a car from the middle
    /// of the crossing behind it, and distance from car to car.
    const FIRST: f64 = 42.0;
    const LAST: f64 = 24.0;
    const APART: f64 = 17.0;
    if !plan.is_town {
        let start = |&(lane, start, desired, turns): &(Lane, f64, [f64; 2], bool)| CarStart {
            lane,
            street: 0.0,
            length: start * plan.pace,
            desired,
            turns,
        };
        return STARTS.iter().map(start).collect();
    }
    let mut starts = Vec::new();
    for lane in [Lane::East, Lane::West, Lane::South, Lane::North] {
        let (axis, sign) = lane.axis();
        for &street in &plan.middles[1 - axis] {
            let mut behind = plan.ends()[axis][usize::from(sign < 0.0)] * sign - LAST + LENGTH / 2.0 + 0.4;
            for Ahead { middle, .. } in ahead(plan, lane, street) {
                let cars = ((middle - FIRST - behind - LAST) / APART + 1.0).max(0.0) as u32;
                starts.extend((0..cars).map(|car| {
                    let length = middle - FIRST - APART * f64::from(car);
                    CarStart { lane, street, length, desired: [9.0, 12.5], turns: false }
                }));
                behind = middle;
            }
        }
    }
    // The first drives along the middle street, from its beginning.
    let far = |start: &CarStart| (start.lane != Lane::East, start.street.abs(), start.length);
    let order = |a: &usize, b: &usize| far(&starts[*a]).partial_cmp(&far(&starts[*b])).unwrap_or(Ordering::Equal);
    let first = (0..starts.len()).min_by(order).unwrap_or(0);
    starts.swap(0, first);
    let mut dice = Dice::new(seed, Draw::Car, u32::MAX - 1);
    for place in 1..starts.len() {
        let other = place + dice.below(starts.len() - place);
        starts.swap(place, other);
    }
    starts
}

/// The crossings on a lane of a street, in the order in which the lane passes them.
fn ahead(plan: &StreetPlan, lane: Lane, street: f64) -> Vec<Ahead> {
    let (axis, sign) = lane.axis();
    let on = |crossing: &&Crossing| crossing.at[1 - axis] == street;
    let ahead = |crossing: &Crossing| Ahead { middle: sign * crossing.at[axis], is_odd: crossing.is_odd };
    let mut all: Vec<Ahead> = plan.crossings.iter().filter(on).map(ahead).collect();
    all.sort_by(|a, b| a.middle.total_cmp(&b.middle));
    all
}

/// Maximum number of cars.
pub(super) fn most_cars(plan: &StreetPlan) -> u32 {
    starts(plan, 0).len() as u32
}

/// The drives of the cars.
pub(super) fn drives(plan: &StreetPlan, cars: u32, seed: u64) -> Vec<Drive> {
    let starts = starts(plan, seed).into_iter().take(cars as usize).enumerate();
    let mut drives: Vec<Drive> = starts
        .map(|(number, CarStart { lane, street, length, desired: [low, high], turns })| {
            let desired = Dice::new(seed, Draw::Car, number as u32).between(low, high);
            let (axis, sign) = lane.axis();
            let end = plan.ends()[axis][usize::from(sign > 0.0)] * sign;
            Drive {
                way: CarRoute::new(lane, street, turns),
                lane,
                street,
                desired,
                states: vec![[length, desired]],
                crossings: ahead(plan, lane, street),
                // At a single crossing no car gets there.
                end: if plan.is_town { end - 1.0 } else { f64::INFINITY },
                hurries: None,
            }
        })
        .collect();
    let steps = (plan.seconds / STEP).ceil() as u32;
    for step in 0..steps {
        let time = f64::from(step) * STEP;
        let accelerations: Vec<f64> = (0..drives.len()).map(|car| acceleration(&mut drives, car, plan, time)).collect();
        for (drive, acceleration) in drives.iter_mut().zip(accelerations) {
            let [length, speed] = drive.now();
            let next = (speed + acceleration * STEP).clamp(0.0, FASTEST);
            drive.states.push([length + f64::midpoint(speed, next) * STEP, next]);
        }
    }
    drives
}

fn acceleration(drives: &mut [Drive], car: usize, plan: &StreetPlan, time: f64) -> f64 {
    /// A car this far past a stop line has crossed it.
    const PAST: f64 = 1.0;
    let drive = &mut drives[car];
    let in_side_street = drive.lane.is_in_side_street();
    let stop = if in_side_street { SIDE_STOP } else { STOP };
    let [length, speed] = drive.now();
    let front = length + LENGTH / 2.0;
    let next = drive.crossings.iter().position(|crossing| crossing.middle - stop + PAST > front);
    let to_line = next.map(|next| drive.crossings[next].middle - stop - front);
    if let (Some(next), Some(to_line)) = (next, to_line) {
        if plan.is_green(in_side_street, drive.crossings[next].is_odd, time) {
            drive.hurries = None;
        } else if drive.hurries.is_none_or(|(crossing, _)| crossing != next) {
            drive.hurries = Some((next, to_line <= 0.0 || speed * speed / (2.0 * to_line) > WILLING));
        }
    } else {
        drive.hurries = None;
    }
    let drive = &drives[car];
    let mut acceleration = drive.follow(f64::INFINITY, 0.0);
    if let (Some((_, false)), Some(to_line)) = (drive.hurries, to_line) {
        // Behind an obstacle, cars stop at the gap at rest; at a stop line they stop closer.
        acceleration = acceleration.min(drive.follow(to_line + 0.6 * GAP, speed));
    }
    if drive.end.is_finite() {
        acceleration = acceleration.min(drive.follow(drive.end - front + 0.6 * GAP, speed));
    }
    let in_lane = |other: &&Drive| other.lane == drive.lane && other.street == drive.street;
    for other in drives.iter().filter(in_lane) {
        let [ahead, other_speed] = other.now();
        // Cars that have turned and cars that drive straight on no longer obstruct each other.
        let gone = |turning: &Drive| turning.turns() && turning.now()[0] > turning.turned_at();
        let left = drive.turns() != other.turns() && (gone(drive) || gone(other));
        if ahead > length && !left {
            acceleration = acceleration.min(drive.follow(ahead - length - LENGTH, speed - other_speed));
        }
    }
    acceleration.max(-HARDEST)
}
