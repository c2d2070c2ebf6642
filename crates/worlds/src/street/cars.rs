//! Cars: their shapes, parked cars and moving cars.

use super::drive::{self, Drive, KEYS, WHEEL_KEYS};
use super::ground::PARKING;
use super::plan::{LANE, StreetPlan};
use crate::glb::Placement;
use crate::model::{Made, Model};
use crate::noise::Dice;
use crate::shapes::ClosedShape;
use glam::{DQuat, DVec3};
use ground::rng::Draw;
use std::f64::consts::{PI, TAU};

/// Radius of a wheel, half its width, and the distance of its centre from the centre line of the car.
pub(super) const WHEEL: f64 = 0.32;
const HALF_WHEEL: f64 = 0.1;
const TRACK: f64 = 0.76;
/// Radius of the arch above a wheel; half the width of a car, and the lower edge of its body.
const ARCH: f64 = 0.37;
const HALF_WIDTH: f64 = 0.89;
const SILL: f64 = 0.2;
/// The camera node on the first car: above the middle of the roof, so that a sensor there with a view 25 degrees down
/// sees the road and not the car.
const LIDAR: DVec3 = DVec3::new(-0.55, 0.0, 1.9);

const PAINTS: [&str; 5] = ["car_paint", "black_car_paint", "blue_car_paint", "silver_car_paint", "white_paint"];

/// A make of car: positions along it, forward from the middle, and heights.
struct Make {
    name: &'static str,
    length: f64,
    axles: [f64; 2],
    /// Upper edge of the body from the tail to the nose.
    belt: &'static [[f64; 2]],
    /// The cabin: its rear and front end at the belt and at the roof, and the lower edge of its windows.
    foot: [f64; 2],
    top: [f64; 2],
    waist: f64,
    roof: f64,
    /// Pillars between the side windows, as fractions of the length from the rear.
    posts: [f64; 2],
}

const MAKES: [Make; 3] = [
    Make {
        name: "Hatchback",
        length: 4.1,
        axles: [-1.25, 1.3],
        belt: &[[-2.05, 0.7], [-1.98, 0.9], [-0.4, 0.92], [0.95, 0.9], [1.6, 0.78], [1.93, 0.64], [2.05, 0.5]],
        foot: [-1.93, 1.05],
        top: [-1.45, 0.28],
        waist: 0.95,
        roof: 1.4,
        posts: [0.28, 0.6],
    },
    Make {
        name: "Saloon",
        length: 4.6,
        axles: [-1.4, 1.4],
        belt: &[
            [-2.3, 0.7],
            [-2.2, 0.96],
            [-1.5, 0.97],
            [-0.4, 0.93],
            [1.0, 0.92],
            [1.8, 0.8],
            [2.18, 0.66],
            [2.3, 0.5],
        ],
        foot: [-1.6, 1.1],
        top: [-0.95, 0.3],
        waist: 0.99,
        roof: 1.43,
        posts: [0.22, 0.58],
    },
    Make {
        name: "Van",
        length: 4.8,
        axles: [-1.5, 1.5],
        belt: &[[-2.4, 0.8], [-2.37, 1.03], [-0.4, 1.05], [1.45, 1.03], [2.0, 0.9], [2.3, 0.72], [2.4, 0.5]],
        foot: [-2.35, 1.6],
        top: [-2.25, 0.85],
        waist: 1.12,
        roof: 1.88,
        posts: [0.36, 0.64],
    },
];

/// A make in the file: its body in each paint.
struct CarModel {
    make: &'static Make,
    bodies: Vec<usize>,
}

/// Adds all cars; returns how many are parked.
pub(super) fn add(made: &mut Made, plan: &StreetPlan, drives: &[Drive], seed: u64) -> usize {
    let first = made.material(PAINTS[0]);
    let mut kinds = Vec::new();
    for make in &MAKES {
        let mut bodies = vec![made.rounded_mesh(&format!("{}_{}", make.name, PAINTS[0]), &make.body())];
        for paint in &PAINTS[1..] {
            let material = made.material(paint);
            bodies.push(made.glb.repainted(bodies[0], &format!("{}_{paint}", make.name), first, material));
        }
        kinds.push(CarModel { make, bodies });
    }
    let wheel = made.rounded_mesh("Wheel", &wheel());
    let driver = made.rounded_mesh("Driver", &driver());
    let [keys, wheel_keys] = [KEYS, WHEEL_KEYS].map(|rate| drive::key_times(plan.seconds, rate));
    let [times, wheel_times] = [&keys, &wheel_keys].map(|keys| made.glb.times(keys));
    for (number, drive) in drives.iter().enumerate() {
        let name = format!("Car_{}", number + 1);
        // The first random number of a car is its speed.
        let mut dice = Dice::new(seed, Draw::Car, number as u32);
        dice.unit();
        let carries_lidar = number == 0;
        let kind = &kinds[if carries_lidar { 0 } else { dice.below(kinds.len()) }];
        let paint = if carries_lidar { 4 } else { dice.below(PAINTS.len()) };

        let turns: Vec<DQuat> = keys.iter().map(|&time| drive.turned(time)).collect();
        let curve: Vec<[DVec3; 2]> = keys.iter().map(|&time| drive.place(time)).collect();
        let place = Placement { at: curve[0][0], turned: turns[0], ..Placement::HERE };
        let car = made.put(&name, "car", kind.bodies[paint], place);
        let curve = made.glb.curve(times, &curve);
        made.glb.animate(car, "translation", curve);
        if drive.turns() {
            let turns = made.glb.turns(times, &turns);
            made.glb.animate(car, "rotation", turns);
        }

        let rolls = wheel_keys.iter().map(|&time| DQuat::from_rotation_y(drive.rolled(time, WHEEL) % TAU));
        let rolls = made.glb.turns(wheel_times, &rolls.collect::<Vec<_>>());
        let [rear, front] = kind.make.axles;
        let steered = drive.turns().then(|| {
            let steered = keys.iter().map(|&time| DQuat::from_rotation_z(drive.steered(time, front - rear)));
            made.glb.turns(times, &steered.collect::<Vec<_>>())
        });
        let mut children = Vec::new();
        for (corner, at) in kind.make.wheels() {
            let hub = steered.filter(|_| at.x > 0.0);
            let (wheel_name, here) = (format!("Wheel_{corner}_of_{name}"), Placement { at, ..Placement::HERE });
            let place = if hub.is_some() { Placement::HERE } else { here };
            let node = made.glb.object(&wheel_name, "car", wheel, place);
            made.glb.animate(node, "rotation", rolls);
            children.push(match hub {
                None => node,
                Some(steered) => {
                    let hub = made.glb.group(&format!("Hub_{corner}_of_{name}"), here, &[node]);
                    made.glb.animate(hub, "rotation", steered);
                    hub
                }
            });
        }
        let seat =
            Placement { at: DVec3::new(kind.make.top[1] - 0.55, 0.37, kind.make.roof - 0.27), ..Placement::HERE };
        children.push(made.glb.object(&format!("Driver_of_{name}"), "car", driver, seat));
        if carries_lidar {
            let rack = made.rounded_mesh("Rack", &rack(kind.make));
            children.push(made.glb.object(&format!("Rack_of_{name}"), "car", rack, Placement::HERE));
            children.push(made.glb.camera("Lidar", Placement { at: LIDAR, ..Placement::HERE }));
        }
        made.glb.adopt(car, &children);
    }
    park(made, plan, &kinds, wheel, seed)
}

/// Adds cars parked at the kerbs, away from the crossing.
fn park(made: &mut Made, plan: &StreetPlan, kinds: &[CarModel], wheel: usize, seed: u64) -> usize {
    /// Fraction of the parking spaces that are taken, and the length of a space.
    const TAKEN: f64 = 0.55;
    const PLACE: f64 = 6.2;
    /// Fraction of these taken by trucks.
    const TRUCKS: f64 = 0.08;
    let truck = made.rounded_mesh("Truck", &truck());
    let mut trucks = 0;
    let mut dice = Dice::new(seed, Draw::Car, u32::MAX);
    let mut parked = 0;
    for crossing in &plan.crossings {
        for (side, end) in [-1.0, 1.0].into_iter().flat_map(|side| [(side, -1.0), (side, 1.0)]) {
            let places = ((crossing.reach(0, end) - PARKING) / PLACE) as u32;
            for place in 0..places {
                let [taken, shift, aside] = [dice.unit(), dice.between(-0.5, 0.5), dice.between(-0.08, 0.08)];
                let (kind, paint) = (&kinds[dice.below(kinds.len())], dice.below(PAINTS.len()));
                if taken > TAKEN {
                    continue;
                }
                if dice.unit() < TRUCKS {
                    trucks += 1;
                    // A truck fills its space.
                    let x = end * (PARKING + PLACE * (f64::from(place) + 0.5)) + 0.2 * shift;
                    let at = crossing.place(x, side * (LANE + 1.12) + 0.2 * aside, 0.0);
                    let turned = DQuat::from_rotation_z(if side > 0.0 { PI } else { 0.0 });
                    let name = format!("Truck_{trucks:02}");
                    let node = made.put(&name, "truck", truck, Placement { at, turned, ..Placement::HERE });
                    let wheels = [("RL", -1.7, 0.84), ("RR", -1.7, -0.84), ("FL", 1.95, 0.84), ("FR", 1.95, -0.84)];
                    let wheels = wheels.map(|(corner, x, y)| {
                        let at = DVec3::new(x, y, TRUCK_WHEEL * WHEEL);
                        let place = Placement { at, scale: DVec3::splat(TRUCK_WHEEL), ..Placement::HERE };
                        made.glb.object(&format!("Wheel_{corner}_of_{name}"), "truck", wheel, place)
                    });
                    made.glb.adopt(node, &wheels);
                    continue;
                }
                parked += 1;
                let x = end * (PARKING + PLACE * (f64::from(place) + 0.5)) + shift;
                let at = crossing.place(x, side * (LANE + 1.12) + aside, 0.0);
                let turned = DQuat::from_rotation_z(if side > 0.0 { PI } else { 0.0 });
                let name = format!("Parked_{parked:02}");
                let car = made.put(&name, "car", kind.bodies[paint], Placement { at, turned, ..Placement::HERE });
                let wheels = kind.make.wheels().map(|(corner, at)| {
                    let place = Placement { at, ..Placement::HERE };
                    made.glb.object(&format!("Wheel_{corner}_of_{name}"), "car", wheel, place)
                });
                made.glb.adopt(car, &wheels);
            }
        }
    }
    parked
}

/// Value at `x` of a polyline.
fn between(line: &[[f64; 2]], x: f64) -> f64 {
    for pair in line.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        if x <= x1 {
            return y0 + (y1 - y0) * ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
        }
    }
    line.last().map_or(0.0, |[_, y]| *y)
}

impl Make {
    /// Names and positions of the wheels.
    fn wheels(&self) -> [(&'static str, DVec3); 4] {
        let [rear, front] = self.axles;
        [("FL", front, TRACK), ("FR", front, -TRACK), ("RL", rear, TRACK), ("RR", rear, -TRACK)]
            .map(|(name, x, y)| (name, DVec3::new(x, y, WHEEL)))
    }

    /// The car without wheels, the ground at z = 0.
    fn body(&self) -> Model {
        let mut model = Model::default();
        self.hull(&mut model);
        self.cabin(&mut model);
        let (nose, tail) = (self.length / 2.0, -self.length / 2.0);
        let tail_light = between(self.belt, tail + 0.1) - 0.16;
        let mut ball = |material, at: [f64; 3], scale: [f64; 3]| {
            let place = Placement { at: at.into(), scale: scale.into(), ..Placement::HERE };
            model.add_placed(material, &ClosedShape::ball(1), &place);
        };
        for side in [-1.0, 1.0] {
            ball("headlight", [nose - 0.19, side * 0.6, 0.57], [0.17, 0.17, 0.085]);
            ball("tail_light", [tail + 0.06, side * 0.63, tail_light], [0.07, 0.1, 0.09]);
            let y = side * (HALF_WIDTH + 0.06);
            ball(PAINTS[0], [self.foot[1] - 0.42, y, self.waist + 0.02], [0.06, 0.1, 0.07]);
            for x in [-0.75, 0.1] {
                let (x, y) = (self.top[1] - 0.75 + x, side * 0.37);
                ball("plastic", [x, y, self.waist], [0.08, 0.2, 0.3]);
            }
        }
        for x in [nose - 0.02, tail + 0.01] {
            model.add_box("white_paint", [x - 0.02, -0.26, 0.36], [x + 0.02, 0.26, 0.47]);
        }
        model
    }

    /// Everything below the windows, with arches for the wheels.
    fn hull(&self, model: &mut Model) {
        /// Corners of the outline of a section: fractions of the width, and of the height from its bottom.
        const OUTLINE: [[f64; 2]; 5] = [[0.84, 0.0], [0.97, 0.08], [1.0, 0.4], [0.985, 0.8], [0.93, 0.97]];
        let half = self.length / 2.0;
        let mut stations: Vec<f64> = self.belt.iter().map(|[x, _]| *x).collect();
        stations.extend([-half + 0.3, -half + 0.02, half - 0.02, half - 0.3]);
        for axle in self.axles {
            stations.extend([axle - ARCH - 0.004, axle + ARCH + 0.004]);
            stations.extend((0..=8).map(|i| axle + ARCH * (f64::from(i) / 8.0 * PI).cos()));
        }
        stations.sort_by(f64::total_cmp);
        stations.dedup_by(|a, b| (*a - *b).abs() < 1e-3);
        let rings: Vec<Vec<DVec3>> = stations
            .into_iter()
            .map(|x| {
                let under_arch = self.axles.iter().find(|axle| (x - **axle).abs() <= ARCH + 1e-9);
                let low = match under_arch {
                    Some(axle) => WHEEL + (ARCH * ARCH - (x - axle).powi(2)).max(0.0).sqrt(),
                    None => SILL + 0.1 * ((x.abs() - half + 0.15) / 0.15).max(0.0),
                };
                let (high, end) = (between(self.belt, x), x.abs() / half);
                let wide = HALF_WIDTH * (1.0 - 0.05 * end.powi(3) - 0.12 * end.powi(16));
                let side = |sign: f64| OUTLINE.map(|[y, z]| DVec3::new(x, sign * wide * y, low + (high - low) * z));
                let [left, mut right] = [side(1.0), side(-1.0)];
                right.reverse();
                let top = [0.55, 0.0, -0.55].map(|y: f64| DVec3::new(x, wide * y, high + 0.03 * (1.0 - y.abs())));
                left.into_iter().chain(top).chain(right).collect()
            })
            .collect();
        let sides = 2 * OUTLINE.len() + 3;
        model.loft(&rings, [Some("plastic"); 2], |_, side| match side == 0 || side >= sides - 2 {
            true => "plastic",
            false => PAINTS[0],
        });
    }

    /// Windows, pillars and roof.
    fn cabin(&self, model: &mut Model) {
        /// Half the width of a pillar, and the rear and front end of the side windows, as fractions of the length from
        /// the rear.
        const POST: f64 = 0.02;
        const ENDS: [f64; 2] = [0.07, 0.955];
        /// Half the width at the belt and at the roof.
        const WIDTHS: [f64; 2] = [0.83, 0.64];
        const BELT: f64 = 0.9;
        let [rear, front] = self.posts;
        let along = [0.0, ENDS[0], rear - POST, rear + POST, front - POST, front + POST, ENDS[1], 1.0];
        let ring = |z: f64, inset: f64| -> Vec<DVec3> {
            let up = ((z - BELT) / (self.roof - BELT)).max(-0.2);
            let [back, ahead] = [0, 1].map(|i| self.foot[i] + (self.top[i] - self.foot[i]) * up);
            let middle = f64::midpoint(back, ahead);
            let wide = (WIDTHS[0] + (WIDTHS[1] - WIDTHS[0]) * up) * inset;
            let at = |part: f64, y: f64| DVec3::new(middle + (back + (ahead - back) * part - middle) * inset, y, z);
            let narrow = |part: f64| if part == 0.0 || part == 1.0 { 0.93 * wide } else { wide };
            let right = along.iter().map(|&part| at(part, -narrow(part)));
            let left = along.iter().rev().map(|&part| at(part, narrow(part)));
            let bulge = 0.08 / (ahead - back);
            right.chain([at(1.0 + bulge, 0.0)]).chain(left).chain([at(-bulge, 0.0)]).collect()
        };
        let roof = self.roof;
        let levels = [
            (0.82, 1.0),
            (self.waist, 1.0),
            (roof - 0.11, 1.0),
            (roof - 0.045, 0.99),
            (roof - 0.012, 0.93),
            (roof, 0.7),
        ];
        let rings: Vec<Vec<DVec3>> = levels.iter().map(|&(z, inset)| ring(z, inset)).collect();
        let is_van = self.roof > 1.7;
        // From the rear along the right side, the windscreen, back along the left side, the rear window.
        model.loft(&rings, [None, Some(PAINTS[0])], |level, side| {
            let glass = match side {
                3 | 5 | 7 | 8 | 10 | 12 => true,
                1 | 14 | 16 | 17 => !is_van,
                _ => false,
            };
            if level == 1 && glass { "window" } else { PAINTS[0] }
        });
    }
}

/// A wheel about the origin that rolls along x: a tyre, and a rim with five spokes.
fn wheel() -> Model {
    const RIM: f64 = 0.215;
    const SPOKES: u32 = 5;
    let mut wheel = Model::default();
    let half = HALF_WHEEL;
    // The outline of the tyre, around its hole and back.
    let outline = [
        [-half, RIM],
        [-half, WHEEL - 0.04],
        [-half + 0.025, WHEEL],
        [half - 0.025, WHEEL],
        [half, WHEEL - 0.04],
        [half, RIM],
        [0.0, RIM - 0.012],
        [-half, RIM],
    ];
    wheel.turned("rubber", &outline, 28);
    wheel.tube("rim", &[-0.05, 0.06].map(|y| (DVec3::Y * y, 0.055)), 10);
    for spoke in 0..SPOKES {
        let mut shape = ClosedShape::default();
        shape.add_box(DVec3::new(-0.03, -0.03, 0.04), DVec3::new(0.03, 0.04, RIM - 0.005));
        let turned = DQuat::from_rotation_y(f64::from(spoke) / f64::from(SPOKES) * TAU);
        wheel.add_placed("rim", &shape, &Placement { turned, ..Placement::HERE });
    }
    wheel
}

/// Size of the wheels of a truck over those of a car.
const TRUCK_WHEEL: f64 = 1.25;

/// A truck of 5.8 m with a box: the cab in front, the wheels separate.
fn truck() -> Model {
    let mut truck = Model::default();
    truck.add_box("plastic", [-2.85, -0.55, 0.5], [2.6, 0.55, 0.75]);
    truck.add_box("white_paint", [-2.9, -1.02, 0.85], [1.2, 1.02, 2.75]);
    truck.add_box("plastic", [-2.88, -1.0, 0.5], [-2.8, 1.0, 0.62]);
    // From the rear along the right side, the windscreen, and back along the left side.
    let ring = |z: f64, front: f64, half: f64| {
        [[1.3, -half], [front, -half], [front, half], [1.3, half]].map(|[x, y]| DVec3::new(x, y, z)).to_vec()
    };
    let rings = [ring(0.85, 2.88, 0.98), ring(1.35, 2.84, 0.98), ring(2.05, 2.5, 0.93), ring(2.25, 2.36, 0.88)];
    truck.loft(&rings, [Some("plastic"), Some("blue_car_paint")], |level, side| {
        if level == 1 && side < 3 { "window" } else { "blue_car_paint" }
    });
    // Pillars beside the windows.
    for corner in 0..4 {
        truck.tube("blue_car_paint", &[(rings[1][corner], 0.035), (rings[2][corner], 0.035)], 6);
    }
    truck.add_box("blue_car_paint", [2.45, -0.98, 0.45], [2.88, 0.98, 0.85]);
    for side in [-1.0, 1.0] {
        let y = side * 0.75;
        truck.add_box("headlight", [2.88, y - 0.14, 0.62], [2.9, y + 0.14, 0.76]);
        truck.add_box("tail_light", [-2.92, y - 0.12, 0.52], [-2.88, y + 0.12, 0.6]);
    }
    truck
}

/// Head and shoulders; the middle of the head is at the origin.
fn driver() -> Model {
    let mut driver = Model::default();
    let mut ball = |material, at: [f64; 3], scale: [f64; 3]| {
        let place = Placement { at: at.into(), scale: scale.into(), ..Placement::HERE };
        driver.add_placed(material, &ClosedShape::ball(2), &place);
    };
    ball("skin", [0.0, 0.0, 0.0], [0.1, 0.08, 0.12]);
    ball("hair", [-0.02, 0.0, 0.035], [0.095, 0.085, 0.1]);
    ball("jacket", [-0.03, 0.0, -0.36], [0.12, 0.21, 0.24]);
    driver
}

/// Two bars on the roof and the mount of the sensor, which ends a little below it.
fn rack(make: &Make) -> Model {
    let mut rack = Model::default();
    for x in [LIDAR.x - 0.28, LIDAR.x + 0.28] {
        let at = |y: f64, z: f64| (DVec3::new(x, y, z), 0.018);
        let (roof, bar) = (make.roof - 0.05, make.roof + 0.06);
        rack.tube("steel", &[at(-0.6, roof), at(-0.56, bar), at(0.56, bar), at(0.6, roof)], 8);
    }
    let at = |z: f64, radius: f64| (DVec3::new(LIDAR.x, 0.0, z), radius);
    let bar = make.roof + 0.06;
    rack.add_box("steel", [LIDAR.x - 0.32, -0.06, bar], [LIDAR.x + 0.32, 0.06, bar + 0.02]);
    rack.tube("steel", &[at(bar + 0.02, 0.025), at(LIDAR.z - 0.13, 0.025)], 10);
    rack.tube("plastic", &[at(LIDAR.z - 0.13, 0.045), at(LIDAR.z - 0.06, 0.045)], 14);
    rack
}
