//! Closed surfaces let nothing through: rays anywhere on them, at their edges and exactly at their corners meet them, from
//! inside and from outside, all of them where the library finds hits itself. Embree misses a few in a million of them,
//! and of those at corners a few in a thousand (its issues 174 and 181).

use echocast::scene::Array;
use echocast::{BuiltScene, Engine, Field, LiveScene, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::reference::{Random, SceneBuilder, Shape, beams};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::ops::Range;

/// How long rays of a scan take, s.
const LENGTH_S: f64 = 0.1;

/// What rays are aimed at.
const KINDS: [&str; 3] = ["anywhere", "edges", "corners"];

/// Part of the rays at a body that Embree may miss, by [`KINDS`]: at corners a few times what it misses of two million of
/// them, 0.1 % of those from inside a ball and 0.8 % from outside, a fifth of that of one that flies, 0.01 % of others'.
fn missed(body: &str, is_inside: bool) -> [f64; KINDS.len()] {
    match (body, is_inside) {
        // The library finds these hits itself.
        ("skin" | "skin of a room", _) => [0.0; 3],
        ("ball", true) => [1e-5, 1e-5, 4e-3],
        ("ball", false) => [1e-5, 1e-5, 0.02],
        ("moving", true) => [1e-5, 1e-5, 1e-3],
        ("moving", false) => [1e-5, 1e-5, 6e-3],
        _ => [1e-5, 1e-5, 5e-4],
    }
}

/// A surface, and where its corners are.
struct Body {
    name: &'static str,
    built: BuiltScene,
    /// At the beginning of a scan and at its end; in between they move in straight lines.
    corners: [Vec<DVec3>; 2],
    triangles: Vec<[u32; 3]>,
    /// Around each corner.
    fans: Vec<Vec<u32>>,
    /// Within it; nothing: it is open.
    middle: Option<DVec3>,
    /// How far from the middle, or above, one may look at it from outside, m.
    outside: Range<f64>,
    /// And from inside, in each direction.
    inside: f64,
}

impl Body {
    fn new(
        name: &'static str,
        built: BuiltScene,
        shape: &Shape,
        places: [DAffine3; 2],
        middle: Option<DVec3>,
        outside: Range<f64>,
        inside: f64,
    ) -> Body {
        let at = |place: DAffine3| {
            shape.positions.iter().map(|&p| place.transform_point3(DVec3::from_array(p.map(f64::from)))).collect()
        };
        let mut fans = vec![Vec::new(); shape.positions.len()];
        for (number, corners) in (0..).zip(&shape.triangles) {
            corners.iter().for_each(|&corner| fans[corner as usize].push(number));
        }
        Body { name, built, corners: places.map(at), triangles: shape.triangles.clone(), fans, middle, outside, inside }
    }

    /// Where a corner is when a `part` of the scan has passed.
    fn corner(&self, corner: u32, part: f64) -> DVec3 {
        let [a, b] = self.corners.each_ref().map(|corners| corners[corner as usize]);
        a.lerp(b, part)
    }

    /// On which side of a triangle a place clearly is; 0: it sees it edge-on.
    fn side(&self, triangle: u32, from: DVec3, part: f64) -> f64 {
        let [a, b, c] = self.triangles[triangle as usize].map(|corner| self.corner(corner, part));
        let cos = (b - a).cross(c - a).normalize().dot((from - a).normalize());
        if cos.abs() < 0.02 { 0.0 } else { cos.signum() }
    }

    /// A target for an eye at `from`: a point of a triangle, a point of an edge, or a corner, and which of [`KINDS`] it is.
    /// `near`: of which triangle.
    fn target(&self, random: &mut Random, near: usize, from: DVec3, part: f64) -> Option<(DVec3, usize)> {
        let triangle = near as u32 % self.triangles.len() as u32;
        let corners = self.triangles[triangle as usize];
        let side = self.side(triangle, from, part);
        // At the rim of what is seen, or of something open, rounding may miss it.
        let within = |corner: u32| {
            let fan = &self.fans[corner as usize];
            fan.len() > 3 && fan.iter().all(|&other| self.side(other, from, part) == side)
        };
        if side == 0.0 || !corners.iter().all(|&corner| within(corner)) {
            return None;
        }
        let [a, b, c] = corners.map(|corner| self.corner(corner, part));
        let kind = random.below(KINDS.len());
        let target = match kind {
            0 => {
                let [u, v] = [random.unit(), random.unit()];
                let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
                a * (1.0 - u - v) + b * u + c * v
            }
            1 => a.lerp(b, if random.unit() < 0.3 { 0.5 } else { random.unit() }),
            _ => a,
        };
        Some((target, kind))
    }

    /// How many of about `count` rays from one place do not meet what they are aimed at, and how many there are, by
    /// [`KINDS`].
    fn leaks(&self, random: &mut Random, count: usize, is_inside: bool) -> [[usize; 2]; KINDS.len()] {
        let mut eye = match (self.middle, is_inside) {
            (Some(middle), true) => middle + random.in_cube(self.inside),
            (middle, _) => {
                let away = random.between(self.outside.start, self.outside.end);
                middle.unwrap_or_default() + random.direction() * away
            }
        };
        if random.unit() < 0.5 {
            eye = eye.round();
        }
        // Neighbours side by side, or anywhere.
        let (in_order, start) = (random.unit() < 0.7, random.below(self.triangles.len()));
        let (mut directions, mut times, mut aims) = (Vec::new(), Vec::new(), Vec::new());
        for ray in 0..count {
            let part = if ray % 16 == 0 { random.below(9) as f64 / 8.0 } else { random.unit() };
            let near = if in_order { start + ray / 8 } else { random.below(self.triangles.len()) };
            let Some((target, kind)) = self.target(random, near, eye, part) else { continue };
            let (direction, distance) = (target - eye).normalize_and_length();
            directions.push(direction);
            aims.push((distance, kind));
            times.push(part * LENGTH_S);
        }
        let mut sums = [[0; 2]; KINDS.len()];
        if directions.is_empty() {
            // All of it is seen edge-on.
            return sums;
        }
        let mut beams = beams(&directions);
        beams.time = times;
        let sensor = Sensor::from_beams("test", beams).unwrap();
        let fields = [Field::TrueRange].into_iter().collect();
        let options = ScanOptions::default().fields(fields).organised(true);
        let path = Trajectory::fixed(Pose::at(eye.x, eye.y, eye.z));
        let cloud = self.built.scan(&sensor, &path, &options).unwrap();
        for (&range, (distance, kind)) in cloud.columns().true_range().iter().zip(aims) {
            // Nothing is behind it that is as near.
            let is_met = f64::from(range) <= distance * (1.0 + 1e-3) + 1e-3;
            sums[kind] = [sums[kind][0] + usize::from(!is_met), sums[kind][1] + 1];
        }
        sums
    }
}

/// A level grid of squares 1 m wide around 0, `half` to each side.
fn grid(half: i32) -> Shape {
    let side = 2 * half + 1;
    let places = (0..side * side).map(|at| [at % side - half, at / side - half, 0]);
    let mut shape = Shape { positions: places.map(|place| place.map(|at| at as f32)).collect(), ..Shape::default() };
    for at in (0..side * (side - 1)).filter(|at| at % side < side - 1).map(|at| at as u32) {
        let side = side as u32;
        shape.triangles.extend([[at, at + 1, at + side], [at + side, at + 1, at + side + 1]]);
    }
    shape
}

/// The sides of a box from 0 to `size` m in squares 1 m wide, which share their corners.
fn room(size: [i32; 3]) -> Shape {
    let mut shape = Shape::default();
    let mut known = std::collections::HashMap::new();
    let mut corner = |place: [i32; 3]| {
        *known.entry(place).or_insert_with(|| {
            shape.positions.push(place.map(|at| at as f32));
            shape.positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for end in [0, size[axis]] {
            for (i, j) in (0..size[u]).flat_map(|i| (0..size[v]).map(move |j| (i, j))) {
                let [a, b, c, d] = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[di, dj]| {
                    let mut place = [end; 3];
                    (place[u], place[v]) = (i + di, j + dj);
                    corner(place)
                });
                let two = if end > 0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                shape.triangles.extend(two);
            }
        }
    }
    shape
}

/// [`Shape::sphere`] with one corner at each pole.
fn ball(rows: u32) -> Shape {
    let mut shape = Shape::sphere(1.0, rows).flat();
    let last = shape.positions.len() as u32 - 1;
    for corner in shape.triangles.as_flattened_mut() {
        *corner = if *corner < 2 * rows { 0 } else { (*corner).min(last - 2 * rows + 1) };
    }
    shape
}

fn built(scene: Scene, change: impl FnOnce(&mut LiveScene)) -> BuiltScene {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&scene).unwrap();
    change(&mut live);
    live.set_time(0.0, LENGTH_S).unwrap();
    live.commit().unwrap()
}

fn bodies(random: &mut Random) -> Vec<Body> {
    let still = |name, shape: Shape, copies: &[DAffine3], middle: Option<DVec3>, outside, inside| {
        let mut scene = SceneBuilder::new();
        let mesh = scene.mesh([(shape.clone(), None)]);
        copies.iter().for_each(|place| _ = scene.place(mesh, *place));
        let place = copies[0];
        Body::new(name, built(scene.finish(), |_| ()), &shape, [place; 2], middle, outside, inside)
    };
    let one = [DAffine3::IDENTITY];
    // Far from the origin, turned, sheared and scaled.
    let far = DVec3::new(613.0, -455.0, 87.0);
    let copies = [far, far + 300.0].map(|place| DAffine3::from_mat3_translation(random.linear_map(), place));
    let mut all = vec![
        still("grid", grid(20), &one, None, 3.0..60.0, 0.0),
        still("ball", ball(40), &one, Some(DVec3::ZERO), 1.5..50.0, 0.5),
        still("room", room([8, 6, 3]), &one, Some(DVec3::new(4.0, 3.0, 1.5)), 10.0..80.0, 1.0),
        still("instance", ball(24), &copies, Some(far), 5.0..90.0, 0.1),
        still("instance of a room", room([4, 4, 4]), &copies, None, 0.0..0.0, 0.0),
    ];
    let last = all.last_mut().unwrap();
    last.middle = Some(copies[0].transform_point3(DVec3::splat(2.0)));
    (last.outside, last.inside) = (20.0..90.0, 0.1);

    // Flying, turned once and for all.
    let turn = DMat3::from_quat(random.rotation());
    let places = [DVec3::new(3.0, 1.0, -2.0), DVec3::new(5.5, 0.5, -1.0)];
    for (name, shape, half) in [("moving", ball(24), 1.0), ("moving room", room([3, 4, 2]), 1.0)] {
        let poses = places.map(|place| DAffine3::from_mat3_translation(turn * half, place));
        let mut scene = SceneBuilder::new();
        let mesh = scene.mesh([(shape.clone(), None)]);
        scene.place(mesh, poses[0]);
        let built = built(scene.finish(), |live| {
            let id = live.objects().next().unwrap().0;
            live.set_motion(id, &[(0.0, poses[0]), (LENGTH_S, poses[1])]).unwrap();
        });
        // It flies from here to there, around what is in it all the time.
        let inside = if name == "moving" { None } else { Some(0.0) };
        let middle = poses.map(|pose| pose.transform_point3(DVec3::splat(if inside.is_some() { 1.2 } else { 0.0 })));
        all.push(Body::new(name, built, &shape, poses, Some(0.5 * (middle[0] + middle[1])), 9.0..60.0, 0.05));
    }

    // Whose corners move, each its own way.
    for (name, shape) in [("skin", ball(24)), ("skin of a room", room([4, 4, 4]))] {
        let moved: Vec<[f32; 3]> =
            shape.positions.iter().map(|place| place.map(|at| at + random.between(-0.02, 0.02) as f32)).collect();
        let mut scene = SceneBuilder::new();
        let mesh = scene.mesh([(shape.clone(), None)]);
        let place = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.3), DVec3::new(-7.0, 4.0, 1.0));
        scene.place(mesh, place);
        let keys = [(0.0, Array::from(shape.positions.clone())), (LENGTH_S, Array::from(moved.clone()))];
        let built = built(scene.finish(), |live| {
            let id = live.objects().next().unwrap().0;
            live.set_vertex_motion(id, &keys).unwrap();
        });
        let middle = place.transform_point3(DVec3::splat(if name == "skin" { 0.0 } else { 2.0 }));
        let mut body = Body::new(name, built, &shape, [place; 2], Some(middle), 9.0..60.0, 0.3);
        let world = |&p: &[f32; 3]| place.transform_point3(DVec3::from_array(p.map(f64::from)));
        body.corners[1] = moved.iter().map(world).collect();
        all.push(body);
    }
    all
}

/// Sends about as many rays at bodies of all kinds, from inside and from outside, and counts those that are lost.
fn check(rays: usize, at_once: usize) {
    let random = &mut Random::new(7);
    let bodies = bodies(random);
    let (mut lost, mut report) = (0, String::new());
    for body in &bodies {
        for is_inside in [true, false] {
            let mut sums = [[0; 2]; KINDS.len()];
            while sums.iter().map(|[_, count]| count).sum::<usize>() < rays / bodies.len() / 2 {
                let leaks = body.leaks(random, at_once, is_inside);
                for (sum, [lost, count]) in sums.iter_mut().zip(leaks) {
                    *sum = [sum[0] + lost, sum[1] + count];
                }
            }
            let from = if is_inside && body.middle.is_some() { "inside" } else { "outside" };
            let each = KINDS.iter().zip(sums).map(|(kind, [lost, count])| format!("{kind} {lost} of {count}"));
            report += &format!("{} from {from}: {}\n", body.name, each.collect::<Vec<_>>().join(", "));
            let too_many =
                |([lost, count], most): ([usize; 2], f64)| lost.saturating_sub((most * count as f64) as usize);
            lost += sums.into_iter().zip(missed(body.name, is_inside)).map(too_many).sum::<usize>();
        }
    }
    println!("{report}");
    assert_eq!(lost, 0, "rays get through:\n{report}");
}

#[test]
fn closed_surfaces_let_nothing_through() {
    check(1_000_000, 5_000);
}

/// `cargo test --release --test physics -- --ignored --nocapture a_hundred_million`
#[test]
#[ignore = "takes minutes: the same with a hundred times as many rays"]
fn a_hundred_million_rays_do_not_get_through() {
    check(100_000_000, 100_000);
}
