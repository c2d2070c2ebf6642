//! How platforms fly, drive or stand: poses over time.

use crate::altitude::{AltitudeProfile, hermite};
use crate::turn::TrackPath;
use crate::{CarrierKind, GroundHeight};
use glam::{DMat3, DQuat, DVec2, DVec3};
use ground::pose::Pose;
use ground::rng::{Draw, Rng};

/// Standard gravity, m/s^2 (CGPM 1901).
pub(crate) const GRAVITY: f64 = 9.806_65;

/// From pose to pose in turns, s.
const TURN_STEP_S: f64 = 0.1;

/// From pose to pose of a ground vehicle, m.
const WHEEL_STEP_M: f64 = 0.5;

/// Half of the distances between its axles and its wheels, m.
const WHEELS: [f64; 2] = [1.4, 0.8];

/// A line that is flown: its strip is a part of a path.
pub(crate) struct FlownLine {
    pub path: TrackPath,
    pub profile: AltitudeProfile,
}

/// A platform's poses over time, as they are added.
pub(crate) struct SurveyFlight {
    pub keys: Vec<(f64, Pose)>,
    /// Times between which the scanner is on, s.
    pub strips: Vec<[f64; 2]>,
    kind: CarrierKind,
    /// Over ground, m/s.
    speed: f64,
    /// Greatest acceleration, m/s^2.
    acceleration: f64,
}

impl SurveyFlight {
    pub fn new(kind: CarrierKind, speed: f64, acceleration: f64) -> SurveyFlight {
        SurveyFlight { keys: Vec::new(), strips: Vec::new(), kind, speed, acceleration }
    }

    /// Greatest acceleration when not given, m/s^2: a bank of 20 degrees (g tan 20); the tilt of 14 degrees of a
    /// multicopter; a brisk drive.
    pub fn usual_acceleration(kind: CarrierKind) -> f64 {
        match kind {
            CarrierKind::Linear => GRAVITY * 20_f64.to_radians().tan(),
            CarrierKind::Multicopter => 2.5,
            CarrierKind::GroundVehicle | CarrierKind::Tripod => 1.5,
        }
    }

    /// Radius of its turns at full speed, m: v^2 / a.
    pub fn radius(&self) -> f64 {
        (self.speed * self.speed / self.acceleration).max(if self.kind == CarrierKind::GroundVehicle {
            6.0
        } else {
            1e-3
        })
    }

    /// Way over which curves begin and end, m: an aircraft takes two seconds to bank.
    fn easing(&self) -> f64 {
        let seconds = if self.kind == CarrierKind::GroundVehicle { 1.0 } else { 2.0 };
        self.speed * seconds
    }

    /// Straight way before and after each line on a path with turns, m.
    pub fn run_in(&self) -> f64 {
        0.5 * self.easing() + 0.5 * self.speed
    }

    /// Adds a pose; times rise.
    fn add(&mut self, time: f64, pose: Pose) {
        if self.keys.last().is_none_or(|(last, _)| time > last + 1e-9) {
            self.keys.push((time, pose));
        }
    }

    fn now(&self) -> f64 {
        self.keys.last().map_or(0.0, |(time, _)| *time)
    }

    /// Flies `lines` one after the other at constant speed, with the shortest turns between them.
    pub fn cruise(&mut self, lines: &[FlownLine], ground: GroundHeight) {
        let (run_in, radius, easing) = (self.run_in(), self.radius(), self.easing());
        let Some(first) = lines.first() else { return };
        let (place, heading) = (first.path.place(0.0), first.path.heading(1e-6));
        let mut course = TrackPath::new(place - run_in * DVec2::from_angle(heading), heading);
        // Where each line begins and ends along the course.
        let mut spans: Vec<[f64; 2]> = Vec::new();
        for line in lines {
            let (place, heading) = (line.path.place(0.0), line.path.heading(1e-6));
            let before = place - run_in * DVec2::from_angle(heading);
            if !spans.is_empty() {
                course.turn_to(before, heading, radius);
            }
            course.straight_to(place);
            let from = course.length();
            course.append(&line.path);
            spans.push([from, course.length()]);
            course.add(0.0, run_in);
        }
        let mut at = 0.0;
        for (index, (line, &[from, to])) in lines.iter().zip(&spans).enumerate() {
            let before = index.checked_sub(1).map(|index| (lines[index].profile.at(f64::INFINITY), spans[index][1]));
            let height = |along: f64| match before {
                _ if along >= from => line.profile.with_slope(along - from)[0],
                Some((z, start)) => {
                    hermite([z, line.profile.at(0.0)], [0.0; 2], (along - start) / (from - start), 1.0)[0]
                }
                None => line.profile.at(0.0),
            };
            self.add_course(&course, [at, from], None, easing, &height, ground);
            // Where a line is straight and level, its ends say it all.
            let step = if line.path.is_straight() {
                line.profile.step().unwrap_or(f64::INFINITY)
            } else {
                TURN_STEP_S * self.speed
            };
            self.add_course(&course, [from, to], Some(step), easing, &height, ground);
            self.strips.push([from / self.speed, to / self.speed]);
            at = to;
        }
        let last = lines.last().map_or(0.0, |line| line.profile.at(f64::INFINITY));
        self.add_course(&course, [at, course.length()], None, easing, &|_| last, ground);
    }

    /// Adds the poses between two places along `course`, every `step` m, or as in turns.
    fn add_course(
        &mut self,
        course: &TrackPath,
        [from, to]: [f64; 2],
        step: Option<f64>,
        easing: f64,
        height: &dyn Fn(f64) -> f64,
        ground: GroundHeight,
    ) {
        let vehicle = self.kind == CarrierKind::GroundVehicle;
        let step = step.unwrap_or(TURN_STEP_S * self.speed);
        let step = if vehicle { step.min(WHEEL_STEP_M) } else { step };
        let parts = ((to - from) / step).ceil().clamp(1.0, 1e7) as u32;
        for part in 0..=parts {
            let along = from + (to - from) * f64::from(part) / f64::from(parts);
            let [place, ahead, bend] = course.smoothed(along, easing);
            let place = place.extend(height(along));
            let pose = match vehicle {
                true => on_wheels(place, ahead, ground),
                false => tilted(place, ahead, (bend * self.speed * self.speed).extend(0.0)),
            };
            self.add(along / self.speed, pose);
        }
    }

    /// Flies `lines` one after the other as a multicopter: it hovers at the beginning and the end, and between the lines
    /// brakes, turns and speeds up within its acceleration.
    pub fn hop(&mut self, lines: &[FlownLine], ground: GroundHeight) {
        let Some(first) = lines.first() else { return };
        let (place, heading) = (first.path.place(0.0), first.path.heading(1e-6));
        let ahead = DVec2::from_angle(heading);
        // From rest to speed, with the acceleration of the quintic below, whose mean is 1 / 1.5 of its greatest.
        let way = 0.5 * 1.5 * self.speed * self.speed / self.acceleration;
        let z = first.profile.at(0.0);
        let mut state = HopState { place: (place - way * ahead).extend(z), velocity: DVec3::ZERO, heading };
        self.add(0.0, tilted(state.place, ahead, DVec3::ZERO));
        for line in lines {
            let heading = line.path.heading(1e-6);
            let begin = line.path.place(0.0).extend(line.profile.at(0.0));
            let speed = self.speed * DVec2::from_angle(heading).extend(0.0);
            self.fly_to(&state, &HopState { place: begin, velocity: speed, heading });
            let start = self.now();
            let length = line.path.length();
            let height = |along: f64| line.profile.at(along);
            let shifted = Shifted { start, speed: self.speed };
            self.add_line(line, &shifted, &height, ground);
            self.strips.push([start, start + length / self.speed]);
            let (place, heading) = line.path.end();
            let velocity = self.speed * DVec2::from_angle(heading).extend(0.0);
            state = HopState { place: place.extend(line.profile.at(length)), velocity, heading };
        }
        let rest = state.place + way / self.speed * state.velocity;
        self.fly_to(&state, &HopState { place: rest, velocity: DVec3::ZERO, heading: state.heading });
    }

    /// Adds the poses of a line that begins at a time.
    fn add_line(&mut self, line: &FlownLine, time: &Shifted, height: &dyn Fn(f64) -> f64, ground: GroundHeight) {
        let straight = line.path.is_straight();
        let step = if straight { line.profile.step().unwrap_or(f64::INFINITY) } else { TURN_STEP_S * self.speed };
        let (length, easing) = (line.path.length(), if straight { 1e-3 } else { self.easing() });
        let parts = (length / step).ceil().clamp(1.0, 1e7) as u32;
        for part in 0..=parts {
            let along = length * f64::from(part) / f64::from(parts);
            let [place, ahead, bend] = line.path.smoothed(along, easing);
            let pose = match self.kind {
                CarrierKind::GroundVehicle => on_wheels(place.extend(height(along)), ahead, ground),
                _ => tilted(place.extend(height(along)), ahead, (bend * self.speed * self.speed).extend(0.0)),
            };
            self.add(time.start + along / time.speed, pose);
        }
    }

    /// Adds the flight from one motion to another along a polynomial of fifth degree, which has no acceleration at its
    /// ends, in the least time that keeps to the acceleration and to one and a half times the speed.
    fn fly_to(&mut self, from: &HopState, to: &HopState) {
        let start = self.now();
        let fits = |duration: f64| {
            let path = Quintic::new(from, to, duration);
            (0..=64).all(|step| {
                let [_, velocity, acceleration] = path.at(duration * f64::from(step) / 64.0);
                velocity.length() <= 1.5 * self.speed && acceleration.length() <= self.acceleration
            })
        };
        // The acceleration falls with the duration, all the more as the speed at the ends does not grow.
        let mut duration = (from.place.distance(to.place) / (1.5 * self.speed)).max(0.1);
        while !fits(duration) && duration < 1e6 {
            duration *= 1.02;
        }
        let path = Quintic::new(from, to, duration);
        let turn =
            (to.heading - from.heading + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let parts = (duration / TURN_STEP_S).ceil().max(1.0) as u32;
        for part in 1..=parts {
            let share = f64::from(part) / f64::from(parts);
            let [place, _, acceleration] = path.at(duration * share);
            let [turned, _] = hermite([0.0, turn], [0.0; 2], share, 1.0);
            self.add(start + duration * share, tilted(place, DVec2::from_angle(from.heading + turned), acceleration));
        }
    }
}

/// When a line is flown.
struct Shifted {
    /// When it begins, s.
    start: f64,
    /// m/s.
    speed: f64,
}

/// Where a multicopter is, how fast, and where it heads, rad from x to y.
struct HopState {
    place: DVec3,
    velocity: DVec3,
    heading: f64,
}

/// A polynomial of fifth degree in time, of least jerk between two motions (Flash and Hogan 1985).
struct Quintic {
    factors: [DVec3; 6],
}

impl Quintic {
    fn new(from: &HopState, to: &HopState, t: f64) -> Quintic {
        let way = to.place - from.place - from.velocity * t;
        let gain = (to.velocity - from.velocity) * t;
        let zero = DVec3::ZERO;
        Quintic {
            factors: [
                from.place,
                from.velocity,
                zero,
                (10.0 * way - 4.0 * gain) / t.powi(3),
                (-15.0 * way + 7.0 * gain) / t.powi(4),
                (6.0 * way - 3.0 * gain) / t.powi(5),
            ],
        }
    }

    /// Place, velocity and acceleration.
    fn at(&self, t: f64) -> [DVec3; 3] {
        let [a, b, _, d, e, f] = self.factors;
        let (t2, t3) = (t * t, t * t * t);
        [
            a + b * t + d * t3 + e * t3 * t + f * t3 * t2,
            b + 3.0 * d * t2 + 4.0 * e * t3 + 5.0 * f * t2 * t2,
            6.0 * d * t + 12.0 * e * t2 + 20.0 * f * t3,
        ]
    }
}

/// The pose of what flies at `place` in the direction `ahead`: its lift is along its z axis, so it leans into turns and
/// tilts as it accelerates, by the angle whose tangent is a / g.
fn tilted(place: DVec3, ahead: DVec2, acceleration: DVec3) -> Pose {
    upright(place, ahead, acceleration + GRAVITY * DVec3::Z)
}

/// The pose at `place` with z along `up` and x over the direction `ahead` on the map.
fn upright(place: DVec3, ahead: DVec2, up: DVec3) -> Pose {
    let z = up.normalize_or(DVec3::Z);
    let left = z.cross(ahead.extend(0.0)).normalize_or(DVec3::Y);
    let axes = DMat3::from_cols(left.cross(z), left, z);
    Pose { position: place, orientation: DQuat::from_mat3(&axes).normalize() }
}

/// The pose of a vehicle whose scanner is above `place`, the height of which is that above its wheels: it stands on the
/// ground below these.
fn on_wheels(place: DVec3, ahead: DVec2, ground: GroundHeight) -> Pose {
    let ahead = ahead.normalize_or(DVec2::X);
    let middle = place.truncate();
    let here = ground(middle.x, middle.y);
    let side = |direction: DVec2, far: f64| {
        let [front, back] = [far, -far].map(|far| middle + far * direction);
        let [front, back] = [front, back].map(|wheel| ground(wheel.x, wheel.y).or(here));
        front.zip(back)
    };
    let rise = |ends: Option<(f64, f64)>, far: f64| ends.map_or(0.0, |(front, back)| (front - back) / (2.0 * far));
    let (along, across) = (side(ahead, WHEELS[0]), side(ahead.perp(), WHEELS[1]));
    let slope = ahead * rise(along, WHEELS[0]) + ahead.perp() * rise(across, WHEELS[1]);
    let all = [along, across].into_iter().flatten().flat_map(|(a, b)| [a, b]);
    let (sum, count) = all.fold((0.0, 0), |(sum, count), z| (sum + z, count + 1));
    let base = if count > 0 { sum / f64::from(count) } else { 0.0 };
    upright(middle.extend(base + place.z), ahead, DVec3::new(-slope.x, -slope.y, 1.0))
}

/// Poses of a tripod that is carried from station to station at a speed, m/s, and stands at each for a multiple of
/// `turn` s; its axes are off level by `level_error` rad, drawn from `seed`. Returns the times of scans, too.
pub(crate) fn stations(
    places: &[DVec3],
    heading: f64,
    (speed, turn): (f64, f64),
    (level_error, seed): (f64, u64),
) -> (Vec<(f64, Pose)>, Vec<[f64; 2]>) {
    let rng = Rng::new(seed, 0);
    let (mut keys, mut times) = (Vec::new(), Vec::new());
    let mut now = 0.0;
    let mut before: Option<DVec3> = None;
    for (station, &place) in places.iter().enumerate() {
        if let Some(before) = before {
            // A turn of the head begins where its angle does.
            now = ((now + before.distance(place).max(1.0) / speed) / turn - 1e-9).ceil() * turn;
        }
        let tilt = |axis: u32| level_error * f64::from(rng.normal(station as u32, Draw::StationLevel, axis));
        let up = DVec3::new(tilt(0).tan(), tilt(1).tan(), 1.0);
        let pose = upright(place, DVec2::from_angle(heading), up);
        keys.push((now, pose));
        times.push([now, now + turn]);
        now += turn;
        keys.push((now, pose));
        before = Some(place);
    }
    (keys, times)
}
