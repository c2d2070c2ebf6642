use super::*;
use crate::random::{block, unit};
use crate::{Level, limit_level};

/// Numbers in -1 to 1.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 += 1;
        2.0 * unit(block([self.0, 0, 0, 0], [5, 6])[0]) - 1.0
    }

    fn point(&mut self) -> [f32; 3] {
        [self.next(), self.next(), self.next()]
    }

    fn index(&mut self, below: usize) -> u32 {
        (((self.next() + 1.0) / 2.0 * below as f32) as usize).min(below - 1) as u32
    }
}

struct Scene {
    tree: Tree,
    triangles: Vec<[u32; 3]>,
    a: MeshStep,
    b: MeshStep,
}

fn step(tree: &Tree, positions: &[[f32; 3]]) -> MeshStep {
    let positions: Vec<_> = positions.iter().map(|&[x, y, z]| [x, y, z, f32::NAN]).collect();
    let mut boxes = Vec::new();
    tree.fit(&positions, &mut boxes);
    MeshStep { positions, boxes }
}

fn scene(rest: &[[f32; 3]], triangles: Vec<[u32; 3]>, a: Vec<[f32; 3]>, b: Vec<[f32; 3]>) -> Scene {
    let tree = Tree::new(rest, &triangles);
    let (a, b) = (step(&tree, &a), step(&tree, &b));
    Scene { tree, triangles, a, b }
}

/// Loose triangles of all sizes that fly and turn.
fn debris(random: &mut Random, count: usize) -> Scene {
    let mut rest = Vec::new();
    for _ in 0..count {
        let (centre, size) = (random.point(), 0.02 + 0.3 * random.next().powi(4));
        for _ in 0..3 {
            let corner = random.point();
            rest.push([0, 1, 2].map(|axis| centre[axis] + size * corner[axis]));
        }
    }
    let mut moved = |far: f32| {
        let mut all = rest.clone();
        for place in all.as_flattened_mut() {
            *place += far * random.next();
        }
        all
    };
    let (a, b) = (moved(0.05), moved(0.3));
    scene(&rest, (0..count as u32).map(|of| [3 * of, 3 * of + 1, 3 * of + 2]).collect(), a, b)
}

/// A closed surface with bumps: rings around the z axis, the first and last of which are points.
fn ball(rings: usize, sides: usize, bump: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    use std::f32::consts::{PI, TAU};
    let mut positions = vec![[0.0, 0.0, 1.0]];
    for ring in 1..rings {
        for side in 0..sides {
            let (polar, turn) = (PI * ring as f32 / rings as f32, TAU * side as f32 / sides as f32);
            let size = 1.0 + bump * (5.0 * turn).sin() * (4.0 * polar).sin();
            positions.push([size * polar.sin() * turn.cos(), size * polar.sin() * turn.sin(), size * polar.cos()]);
        }
    }
    positions.push([0.0, 0.0, -1.0]);
    let last = positions.len() as u32 - 1;
    let at = |ring: usize, side: usize| (1 + (ring - 1) * sides + side % sides) as u32;
    let mut triangles = Vec::new();
    for side in 0..sides {
        triangles.push([0, at(1, side), at(1, side + 1)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            triangles.extend([[a, c, b], [b, c, d]]);
        }
        triangles.push([at(rings - 1, side), last, at(rings - 1, side + 1)]);
    }
    (positions, triangles)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Where the ray of a lane meets a triangle's plane: parameter, weights of the second and third corner, normal.
/// Moller and Trumbore 1997, "Fast, minimum storage ray/triangle intersection".
fn plane(scene: &Scene, triangle: usize, rays: &RayPacket, lane: usize) -> (f64, f64, f64, [f64; 3]) {
    let part = f64::from(rays.part[lane]);
    let [a, b, c] = scene.triangles[triangle].map(|corner| {
        [0, 1, 2].map(|axis| {
            let of = |step: &MeshStep| f64::from(step.positions[corner as usize][axis]);
            (1.0 - part) * of(&scene.a) + part * of(&scene.b)
        })
    });
    let (org, dir) = ([0, 1, 2].map(|axis| rays.org[axis][lane]), [0, 1, 2].map(|axis| rays.dir[axis][lane]));
    let (org, dir) = (org.map(f64::from), dir.map(f64::from));
    let (e, f) = (minus(b, a), minus(c, a));
    let p = cross(dir, f);
    let (q, to) = (cross(minus(org, a), e), minus(org, a));
    let whole = dot(e, p);
    (dot(f, q) / whole, dot(to, p) / whole, dot(dir, q) / whole, cross(e, f))
}

/// By how much a point is outside a triangle, below 0 inside.
fn outside(u: f64, v: f64) -> f64 {
    (-u).max(-v).max(u + v - 1.0)
}

/// Rays of all kinds: from one place or many, side by side or not, of any length, between limits.
fn packet(random: &mut Random) -> RayPacket {
    let mut packet = RayPacket::default();
    let (eye, ahead) = (random.point(), random.point());
    let (spread, wide) = (random.next().powi(4), random.next().powi(6));
    for lane in 0..RAYS {
        let (start, aside) = (random.point(), random.point());
        let length = 2f32.powf(6.0 * random.next());
        for axis in 0..3 {
            packet.org[axis][lane] = 2.0 * eye[axis] + wide * start[axis];
            packet.dir[axis][lane] = length * (0.4 * ahead[axis] - 2.0 * eye[axis] + spread * aside[axis]);
        }
        packet.part[lane] = (0.5 + 0.6 * random.next()).clamp(0.0, 1.0);
        if random.next() > 0.6 {
            (packet.near[lane], packet.far[lane]) = (0.5 / length, 1.0 / length);
        }
    }
    // Exactly along an axis.
    if random.next() > 0.8 {
        for lane in 0..RAYS {
            packet.dir[0][lane] = 0.0;
            packet.dir[2][lane] = if random.next() > 0.0 { 0.0 } else { packet.dir[2][lane] };
        }
    }
    packet
}

fn trace(scene: &Scene, packet: &RayPacket, active: u16) -> (RayPacket, u16) {
    let mut traced = packet.clone();
    let hits = intersect(&scene.tree, &scene.a, &scene.b, &mut traced, active, None);
    (traced, hits)
}

/// Checks that no clearly nearer triangle is missed, that hits are where they should be, and that clear hits are found.
fn compare(scene: &Scene, packet: &RayPacket, active: u16) -> usize {
    let (traced, hits) = trace(scene, packet, active);
    assert_eq!(occluded(&scene.tree, &scene.a, &scene.b, packet, active, None), hits);
    assert_eq!(hits & !active, 0);
    for lane in 0..RAYS {
        let (near, far) = (f64::from(packet.near[lane]), f64::from(packet.far[lane]));
        if hits >> lane & 1 == 0 {
            assert_eq!(traced.far[lane], packet.far[lane]);
            assert_eq!((traced.triangle[lane], traced.u[lane]), (packet.triangle[lane], packet.u[lane]));
        } else {
            let found = f64::from(traced.far[lane]);
            let (at, u, v, normal) = plane(scene, traced.triangle[lane] as usize, packet, lane);
            // A ray that is nearly in a plane may meet it anywhere: there is none among these.
            let size = dot(normal, normal).sqrt();
            let dir = [0, 1, 2].map(|axis| f64::from(packet.dir[axis][lane]));
            let steep = (dot(normal, dir) / size / dot(dir, dir).sqrt()).abs();
            let fine = 1e-6 / steep / size.sqrt().min(1.0);
            assert!((found - at).abs() <= 1e-5 * at.max(1e-3) + fine * at, "{found} instead of {at}");
            assert!(found > near && found <= far);
            assert!((f64::from(traced.u[lane]) - u).abs() < 1e-5 + 10.0 * fine, "u {} {u}", traced.u[lane]);
            assert!((f64::from(traced.v[lane]) - v).abs() < 1e-5 + 10.0 * fine);
            let apart = minus([0, 1, 2].map(|axis| f64::from(traced.normal[axis][lane])), normal);
            assert!(dot(apart, apart).sqrt() < 1e-5 * size + 1e-6, "{apart:?} {normal:?}");
        }
        if active >> lane & 1 == 0 {
            continue;
        }
        for triangle in 0..scene.triangles.len() {
            let (at, u, v, _) = plane(scene, triangle, packet, lane);
            let clear = outside(u, v) < -1e-4 && at > near * 1.0001 + 1e-4 && at < far * 0.9999;
            let nearest = f64::from(traced.far[lane]) * 0.9999 - 1e-4;
            assert!(!clear || hits >> lane & 1 == 1 && at >= nearest, "lane {lane} misses {triangle} at {at}");
        }
    }
    hits.count_ones() as usize
}

#[test]
fn closest_hits_are_those_of_all_triangles_one_by_one() {
    let random = &mut Random(0);
    let mut hits = 0;
    for count in [1, 2, 9, 17, 130, 700] {
        let mut scene = debris(random, count);
        for turn in 0..100 {
            let packet = packet(random);
            let active = if turn % 3 == 0 { !0 } else { random.index(1 << 16) as u16 };
            hits += compare(&scene, &packet, active);
        }
        // At rest.
        scene.b = scene.a.clone();
        let mut packet = packet(random);
        hits += compare(&scene, &packet, !0);
        let moving = trace(&scene, &packet, !0);
        let still = intersect(&scene.tree, &scene.a, &scene.a, &mut packet, !0, None);
        assert_eq!((still, packet.triangle), (moving.1, moving.0.triangle));
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn no_ray_leaves_a_closed_mesh() {
    let random = &mut Random(100_000);
    let (positions, triangles) = ball(40, 60, 0.1);
    let moved = positions.iter().map(|[x, y, z]| [x * 1.3 + 0.4 * z, y + 0.2, z * 0.8 + 0.1 * y]).collect();
    let scene = scene(&positions, triangles, positions.clone(), moved);
    for _ in 0..6250 {
        let mut packet = packet(random);
        let spread = random.next();
        let at = random.point().map(|place| 0.3 * place);
        for lane in 0..RAYS {
            // Half of them at a corner or at the middle of an edge, as exactly as the numbers allow.
            let [a, b, _] = scene.triangles[random.index(scene.triangles.len()) as usize];
            let other = if random.next() > 0.0 { a } else { b };
            let aimed = random.next() > 0.0;
            let part = packet.part[lane];
            let place = |corner: u32, axis: usize| {
                let of = |step: &MeshStep| step.positions[corner as usize][axis];
                (1.0 - part) * of(&scene.a) + part * of(&scene.b)
            };
            for axis in 0..3 {
                packet.org[axis][lane] = at[axis];
                if aimed {
                    packet.dir[axis][lane] = 0.5 * (place(a, axis) + place(other, axis)) - at[axis];
                } else {
                    packet.dir[axis][lane] = at[axis] + spread * packet.dir[axis][lane] + 0.01 * random.next();
                }
            }
        }
        (packet.near, packet.far) = ([0.0; RAYS], [f32::INFINITY; RAYS]);
        assert_eq!(trace(&scene, &packet, !0).1, !0);
    }
}

/// Another test that limits the level meanwhile changes none of the results.
#[test]
fn levels_give_the_same_bits() {
    let random = &mut Random(300_000);
    let scene = debris(random, 400);
    let packets: Vec<_> = (0..200).map(|_| packet(random)).collect();
    let all = || packets.iter().map(|packet| format!("{:?}", trace(&scene, packet, !0))).collect::<Vec<_>>();
    limit_level(Level::Plain);
    let plain = all();
    for level in [Level::Avx2, Level::Avx512] {
        limit_level(level);
        assert!(all() == plain, "{level:?}");
    }
    limit_level(Level::Avx512);
}

#[test]
fn what_is_refused_is_passed_through() {
    // Sheets across the z axis, at heights 1 to 40.
    let rest: Vec<_> =
        (1..=40).flat_map(|z| [[-9.0, -9.0, z as f32], [9.0, -9.0, z as f32], [0.0, 9.0, z as f32]]).collect();
    let triangles = (0..40).map(|of| [3 * of, 3 * of + 1, 3 * of + 2]).collect();
    let scene = scene(&rest, triangles, rest.clone(), rest.clone());
    let mut packet = RayPacket { dir: [[0.0; RAYS], [0.0; RAYS], [2.0; RAYS]], ..RayPacket::default() };
    let from = |calls: &mut Vec<usize>, lane: usize, triangle: u32| {
        calls[lane] += 1;
        triangle as usize >= 2 * lane
    };
    let mut calls = vec![0; RAYS];
    let mut accept = |lane: usize, far: f32, triangle: u32, [u, v]: [f32; 2]| {
        // The axis meets each at 1/4, 1/4, 1/2.
        assert!((u - 0.25).abs() < 1e-6 && (v - 0.5).abs() < 1e-6 && far == (triangle + 1) as f32 / 2.0);
        from(&mut calls, lane, triangle)
    };
    let hits = intersect(&scene.tree, &scene.a, &scene.b, &mut packet, !1, Some(&mut accept));
    assert_eq!(hits, !1);
    for lane in 1..RAYS {
        assert_eq!((packet.triangle[lane], packet.far[lane]), (2 * lane as u32, (2 * lane + 1) as f32 / 2.0));
        assert!(packet.normal[0][lane] == 0.0 && packet.normal[1][lane] == 0.0);
        assert_eq!(packet.normal[2][lane], 18.0 * 18.0);
    }
    assert_eq!((packet.far[0], calls[0]), (f32::INFINITY, 0));
    // Not beyond the nearest that counts.
    packet.far = [f32::INFINITY; RAYS];
    packet.far[3] = 3.4;
    let mut accept = |lane: usize, _: f32, triangle: u32, _: [f32; 2]| triangle as usize >= 2 * lane;
    let any = occluded(&scene.tree, &scene.a, &scene.b, &packet, !0, Some(&mut accept));
    assert_eq!(any, !(1 << 3));
    // Limits: near is not hit, far is.
    (packet.near, packet.far) = ([0.5; RAYS], [1.0; RAYS]);
    assert_eq!(occluded(&scene.tree, &scene.a, &scene.b, &packet, 1, None), 1);
    packet.far = [0.99; RAYS];
    assert_eq!(occluded(&scene.tree, &scene.a, &scene.b, &packet, 1, None), 0);
}

#[test]
fn hostile_meshes_and_rays_are_harmless() {
    let random = &mut Random(500_000);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX, 1e30, 1e-40, 0.0];
    // No triangles, and missing vertices.
    for (positions, triangles) in [(vec![], vec![]), (vec![[0.0; 3]], vec![[0, 0, 1], [u32::MAX; 3]])] {
        let scene = scene(&positions, triangles, positions.clone(), positions.clone());
        assert_eq!(trace(&scene, &packet(random), !0).1, 0);
        let [lower, upper] = scene.tree.bounds(&scene.a);
        assert!(lower[0] > upper[0]);
    }
    // All in one place: leaves have a limited size, and nodes are not too deep.
    let positions = vec![[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]];
    let same = scene(&positions, vec![[0, 1, 2]; 5000], positions.clone(), positions.clone());
    let mut rays = RayPacket { org: [[0.2; RAYS]; 3], ..RayPacket::default() };
    rays.dir[2] = [1.0; RAYS];
    let (traced, hits) = trace(&same, &rays, !0);
    assert!(hits == !0 && traced.far.iter().all(|far| (far - 2.8).abs() < 1e-5));
    // Each as far again as all before, which leaves most splits one-sided.
    let positions: Vec<_> = (0..300).map(|at| [1.2f32.powi(at), (at % 3) as f32, (at % 2) as f32]).collect();
    let triangles = (0..298).map(|at| [at, at + 1, at + 2]).collect();
    let growing = scene(&positions, triangles, positions.clone(), positions.clone());
    trace(&growing, &rays, !0);
    // Corners that are not numbers, next to a triangle that is hit all the same.
    for _ in 0..50 {
        let mut rest: Vec<_> = (0..90).map(|_| random.point()).collect();
        rest[..3].copy_from_slice(&[[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]]);
        let triangles: Vec<_> = (0..30).map(|of| [3 * of, 3 * of + 1, 3 * of + 2]).collect();
        let mut spoilt = || {
            let mut all = rest.clone();
            for corner in &mut all[3..] {
                if random.next() > 0.3 {
                    corner[random.index(3) as usize] = bad[random.index(5) as usize];
                }
            }
            all
        };
        let (a, b) = (spoilt(), spoilt());
        let scene = scene(&spoilt(), triangles, a, b);
        let mut packet = packet(random);
        packet.org = [[0.0; RAYS]; 3];
        packet.dir = [[0.1; RAYS], [0.1; RAYS], [1.0; RAYS]];
        (packet.near, packet.far) = ([0.0; RAYS], [f32::INFINITY; RAYS]);
        let (traced, hits) = trace(&scene, &packet, !0);
        assert_eq!(hits, !0);
        for lane in 0..RAYS {
            let corners = scene.triangles[traced.triangle[lane] as usize];
            for step in [&scene.a, &scene.b] {
                assert!(
                    corners.iter().all(|&corner| step.positions[corner as usize][..3].iter().all(|at| at.is_finite()))
                );
            }
            assert!(traced.far[lane] <= 2.000_01);
        }
    }
    // Invalid rays.
    let scene = debris(random, 200);
    for _ in 0..500 {
        let mut packet = packet(random);
        let RayPacket { org, dir, near, far, part, .. } = &mut packet;
        let columns: [&mut [f32; RAYS]; 4] = [&mut org[random.index(3) as usize], &mut dir[1], near, part];
        let spoilt = random.next() > 0.0;
        for column in columns {
            if random.next() > 0.0 {
                column[random.index(RAYS) as usize] = bad[random.index(bad.len()) as usize];
            }
        }
        if spoilt {
            far[5] = f32::NAN;
        }
        let was = packet.clone();
        let (_, hits) = trace(&scene, &packet, !0);
        for lane in 0..RAYS {
            let sum = was.org[0][lane] + was.org[1][lane] + was.org[2][lane] + was.dir[1][lane] + was.part[lane];
            if !sum.is_finite() || was.near[lane].is_nan() || was.far[lane].is_nan() {
                assert_eq!(hits >> lane & 1, 0);
            }
        }
    }
    let none = RayPacket::default();
    assert_eq!(trace(&scene, &none, !0).1, 0);
}

#[test]
fn steps_that_do_not_fit_hit_nothing() {
    let random = &mut Random(700_000);
    let Scene { tree, a, b, triangles } = debris(random, 100);
    let other = debris(random, 3000);
    let mut packet = packet(random);
    for (a, b) in [(&MeshStep::default(), &b), (&a, &other.a), (&MeshStep { boxes: Vec::new(), ..a.clone() }, &b)] {
        assert_eq!(intersect(&tree, a, b, &mut packet, !0, None), 0);
    }
    // Too few positions.
    let short = step(&tree, &[[1.0; 3]; 7]);
    assert_eq!(occluded(&tree, &short, &short, &packet, !0, None), 0);
    // Memory is allocated once, and boxes hold all corners.
    let mut boxes = a.boxes.clone();
    let before = boxes.as_ptr();
    tree.fit(&b.positions, &mut boxes);
    assert_eq!(boxes.as_ptr(), before);
    let [lower, upper] = tree.bounds(&MeshStep { positions: b.positions.clone(), boxes });
    for corner in triangles.as_flattened() {
        for axis in 0..3 {
            let at = b.positions[*corner as usize][axis];
            assert!(lower[axis] <= at && at <= upper[axis] && upper[axis] < 3.0);
        }
    }
}
