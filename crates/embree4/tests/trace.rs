//! The wrapper tested on geometry whose hits are known.

use embree4::{
    Candidate, Coherence, CommittedScene, Custom, CustomShape, Device, Error, Hit, INVALID, Instance, Joint, LocalRays,
    Mesh, Pace, Packet, Quality, Query, Ray, Scene,
};
use std::cell::RefCell;
use std::sync::Arc;
use std::thread;

const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// The unit right triangle at height `z`; its normal is +z.
fn triangle(device: &Device, z: f32) -> Mesh {
    let corners = [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    Mesh::new(device, corners.into_iter(), &[[0, 1, 2]], u32::MAX).unwrap()
}

fn scene(device: &Device, meshes: &[Mesh]) -> CommittedScene {
    let mut scene = Scene::new(device, Quality::Medium).unwrap();
    for (id, mesh) in (0..).zip(meshes) {
        assert_eq!(scene.attach_mesh(mesh).unwrap(), id);
    }
    scene.commit().unwrap()
}

fn placed(of: &CommittedScene, world_from_object: [f32; 12]) -> Instance {
    Instance::new(of, world_from_object, u32::MAX).unwrap()
}

/// A few thousand unordered triangles, from a small number generator (a 64-bit LCG, Knuth's MMIX constants).
fn clutter(device: &Device) -> Mesh {
    let (positions, triangles) = clutter_of(4000);
    Mesh::new(device, positions.into_iter(), &triangles, u32::MAX).unwrap()
}

fn clutter_of(count: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let positions = (0..count)
        .flat_map(|_| {
            let centre: [f32; 3] = std::array::from_fn(|_| 20.0 * next() - 10.0);
            [(); 3].map(|()| centre.map(|c| c + 2.0 * next()))
        })
        .collect();
    (positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// A fan of `count` unit directions from the origin.
fn fan(count: usize) -> Vec<[f32; 3]> {
    (0..count)
        .map(|i| {
            let (sin, cos) = (0.01 * i as f32).sin_cos();
            let up = -0.5 + (i % 97) as f32 / 97.0;
            let level = (1.0 - up * up).sqrt();
            [level * cos, level * sin, up]
        })
        .collect()
}

/// Traces rays from the origin in packets and unpacks them again.
fn trace<const W: usize>(scene: &CommittedScene, directions: &[[f32; 3]], coherence: Coherence) -> Vec<Ray> {
    let mut hits = Vec::new();
    for directions in directions.chunks(W) {
        let mut rays = Packet::<W>::new();
        let mut valid = [0; W];
        for (lane, direction) in directions.iter().enumerate() {
            [rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]] = *direction;
            valid[lane] = -1;
        }
        scene.intersect(&valid, &mut rays, coherence);
        hits.extend((0..directions.len()).map(|lane| lane_of(&rays, lane)));
    }
    hits
}

fn lane_of<const W: usize>(rays: &Packet<W>, lane: usize) -> Ray {
    Ray {
        org_x: rays.org_x[lane],
        org_y: rays.org_y[lane],
        org_z: rays.org_z[lane],
        tnear: rays.tnear[lane],
        dir_x: rays.dir_x[lane],
        dir_y: rays.dir_y[lane],
        dir_z: rays.dir_z[lane],
        time: rays.time[lane],
        tfar: rays.tfar[lane],
        mask: rays.mask[lane],
        id: rays.id[lane],
        flags: rays.flags[lane],
        ng_x: rays.ng_x[lane],
        ng_y: rays.ng_y[lane],
        ng_z: rays.ng_z[lane],
        u: rays.u[lane],
        v: rays.v[lane],
        prim_id: rays.prim_id[lane],
        geom_id: rays.geom_id[lane],
        inst_id: rays.inst_id[lane],
        inst_prim_id: rays.inst_prim_id[lane],
    }
}

fn trace1(scene: &CommittedScene, directions: &[[f32; 3]]) -> Vec<Ray> {
    directions
        .iter()
        .map(|&direction| {
            let mut ray = Ray::new([0.0; 3], direction);
            scene.intersect1(&mut ray);
            ray
        })
        .collect()
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-5 * a.abs().max(1.0)
}

#[test]
fn the_device_names_a_version_and_a_width_that_fit() {
    let device = Device::new().unwrap();
    let (major, minor, _) = device.version();
    assert!(major == 4 && minor >= 3);
    assert!([4, 8, 16].contains(&device.packet_width()));
    assert_eq!(Device::with_config("isa=sse4.2").unwrap().packet_width(), 4);
}

#[test]
fn a_configuration_with_nul_is_an_error() {
    let error = Device::with_config("threads=1\0isa=sse2").unwrap_err();
    assert_eq!(error.to_string(), r#"the Embree configuration "threads=1\0isa=sse2" contains a NUL character"#);
}

#[test]
fn every_width_and_the_single_ray_find_the_triangle() {
    let device = Device::new().unwrap();
    let scene = scene(&device, &[triangle(&device, 4.0), triangle(&device, 2.0)]);
    let slanted = [0.25, 0.5, 2.0].map(|x: f32| x / (0.25_f32 * 0.25 + 0.5 * 0.5 + 2.0 * 2.0).sqrt());
    let directions = [slanted, [-0.6, 0.0, 0.8]];
    let single = trace1(&scene, &directions);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        for [hit, miss] in [
            trace::<4>(&scene, &directions, coherence),
            trace::<8>(&scene, &directions, coherence),
            trace::<16>(&scene, &directions, coherence),
            single.clone(),
        ]
        .map(|rays| <[Ray; 2]>::try_from(rays).unwrap())
        {
            // It passes (0.25, 0.5, 2): the second mesh, nearer than the first.
            assert!(close(hit.tfar * slanted[2], 2.0), "{hit:?}");
            assert!(close(hit.u, 0.25) && close(hit.v, 0.5), "{hit:?}");
            assert!(close(hit.ng_x, 0.0) && close(hit.ng_y, 0.0) && close(hit.ng_z, 1.0), "{hit:?}");
            assert_eq!((hit.geom_id, hit.prim_id, hit.inst_id), (1, 0, INVALID));
            assert_eq!(miss, Ray::new([0.0; 3], directions[1]));
        }
    }
}

#[test]
fn every_width_finds_the_hits_of_the_single_ray_in_clutter() {
    let device = Device::new().unwrap();
    let scene = scene(&device, &[clutter(&device)]);
    let directions = fan(2000);
    let single = trace1(&scene, &directions);
    assert!(single.iter().filter(|ray| ray.geom_id == 0).count() > 1000);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        for rays in [
            trace::<4>(&scene, &directions, coherence),
            trace::<8>(&scene, &directions, coherence),
            trace::<16>(&scene, &directions, coherence),
        ] {
            // Rays that graze an edge may go either way, but only a few do.
            let other = rays.iter().zip(&single).filter(|(a, b)| a.prim_id != b.prim_id).count();
            assert!(other <= 2, "{other} rays hit something else");
            for (a, b) in rays.iter().zip(&single).filter(|(a, b)| a.prim_id == b.prim_id) {
                assert!(a.tfar == b.tfar || close(a.tfar, b.tfar), "{a:?} {b:?}");
            }
        }
    }
}

#[test]
fn lanes_that_are_not_valid_stay_as_they_are() {
    let device = Device::new().unwrap();
    let scene = scene(&device, &[triangle(&device, 3.0)]);
    fn check<const W: usize>(scene: &CommittedScene) {
        let mut rays = Packet::<W>::new();
        rays.org_x = [0.2; W];
        rays.org_y = [0.2; W];
        rays.dir_z = [1.0; W];
        let before = rays;
        scene.intersect(&[0; W], &mut rays, Coherence::Coherent);
        assert_eq!(rays, before);
        scene.intersect(&std::array::from_fn(|lane| -(lane as i32 % 2)), &mut rays, Coherence::Coherent);
        for lane in 0..W {
            if lane % 2 == 0 {
                assert_eq!(lane_of(&rays, lane), lane_of(&before, lane));
            } else {
                assert!(close(rays.tfar[lane], 3.0) && rays.geom_id[lane] == 0);
            }
        }
    }
    check::<4>(&scene);
    check::<8>(&scene);
    check::<16>(&scene);
}

/// The closest hit among those that count is the closest hit of a scene that contains only them.
#[test]
fn rays_pass_through_what_does_not_count() {
    fn check<const W: usize>(whole: &CommittedScene, rest: &CommittedScene, coherence: Coherence) {
        let mut hits = 0;
        for directions in fan(2000).chunks(W) {
            let mut rays = Packet::<W>::new();
            let mut valid = [0; W];
            for (lane, direction) in directions.iter().enumerate() {
                [rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]] = *direction;
                rays.id[lane] = 100 + lane as u32;
                valid[lane] = -1;
            }
            let (start, mut expected, mut stops, mut rest_stops) = (rays, rays, rays, rays);
            rest.intersect(&valid, &mut expected, coherence);
            rest.occlude(&valid, &mut rest_stops, coherence);
            let counts = |hit: &Candidate| {
                let inside = hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0 + 1e-5;
                assert!(inside && hit.geom_id == 0 && hit.inst_id < 2, "{hit:?}");
                hit.inst_id == 1 && !hit.prim_id.is_multiple_of(3)
            };
            whole.intersect_where(&valid, &mut rays, coherence, &counts);
            whole.occlude_where(&valid, &mut stops, coherence, &counts);
            for lane in 0..directions.len() {
                let (found, expected) = (lane_of(&rays, lane), lane_of(&expected, lane));
                // Occlusion only reports whether there is a hit.
                let stopped = Ray { tfar: f32::NEG_INFINITY, ..lane_of(&start, lane) };
                let expected_stop = if expected.geom_id == INVALID { lane_of(&start, lane) } else { stopped };
                assert_eq!(lane_of(&stops, lane), expected_stop);
                assert_eq!(lane_of(&rest_stops, lane), expected_stop);
                if expected.geom_id == INVALID {
                    assert_eq!(found, expected);
                } else {
                    hits += 1;
                    assert_eq!(found.prim_id, expected.prim_id / 2 * 3 + expected.prim_id % 2 + 1);
                    assert!(close(found.tfar, expected.tfar) && found.inst_id == 1, "{found:?} {expected:?}");
                }
            }
        }
        assert!(hits > 300, "{hits} hits");
    }
    let device = Device::new().unwrap();
    let (positions, triangles) = clutter_of(4000);
    let kept: Vec<[u32; 3]> = triangles.iter().copied().filter(|corners| corners[0] / 3 % 3 != 0).collect();
    let of = |triangles: &[[u32; 3]]| {
        let mesh = Mesh::new(&device, positions.iter().copied(), triangles, u32::MAX).unwrap();
        scene(&device, &[mesh])
    };
    let mut whole = Scene::new(&device, Quality::Medium).unwrap();
    for id in 0..2 {
        whole.attach_instance(&placed(&of(&triangles), IDENTITY), id).unwrap();
    }
    let whole = whole.commit().unwrap();
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check::<4>(&whole, &of(&kept), coherence);
        check::<8>(&whole, &of(&kept), coherence);
        check::<16>(&whole, &of(&kept), coherence);
    }
}

/// A filter that rejects every hit is called for all that a ray meets, with the ray's number and the distance.
#[test]
fn a_filter_that_rejects_every_hit_is_called_for_every_hit() {
    struct Forwards(CommittedScene);
    impl CustomShape for Forwards {
        fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
            vec![self.0.bounds()]
        }

        fn intersect(&self, query: &mut Query) {
            let (mut rays, lanes) = (LocalRays::new(), query.lanes());
            let from: Vec<Vec<f32>> =
                query.origins().into_iter().chain(query.directions()).map(<[f32]>::to_vec).collect();
            rays.rows(lanes).into_iter().zip(from).for_each(|(row, from)| row.copy_from_slice(&from));
            query.forward(&self.0, &mut rays, &[-1; 16]);
        }
    }
    fn check<const W: usize>(world: &CommittedScene, coherence: Coherence) {
        let mut rays = Packet::<W>::new();
        for lane in 0..W {
            let along = [0.005 * lane as f32, 0.1, 1.0];
            let length = along.map(|x| x * x).iter().sum::<f32>().sqrt();
            [rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]] = along.map(|x| x / length);
            (rays.org_x[lane], rays.org_y[lane]) = (0.01, 0.01);
            rays.id[lane] = 100 + lane as u32;
        }
        let (before, met) = (rays, RefCell::new(Vec::new()));
        let refuse = |hit: &Candidate| {
            let height = hit.far * before.dir_z[hit.ray as usize - 100];
            assert!(close(height, height.round()) && hit.inst_id == u32::from(height > 2.5), "{hit:?}");
            met.borrow_mut().push((hit.ray, height.round() as u32));
            false
        };
        world.intersect_where(&[-1; W], &mut rays, coherence, &refuse);
        assert_eq!(rays.tfar, before.tfar);
        let mut met = met.into_inner();
        met.sort_unstable();
        met.dedup();
        let all = (100..100 + W as u32).flat_map(|ray| (1..5).map(move |height| (ray, height)));
        assert!(met.into_iter().eq(all));
    }
    let device = Device::new().unwrap();
    let [near, far] = [[1.0, 2.0], [3.0, 4.0]].map(|z| scene(&device, &z.map(|z| triangle(&device, z))));
    let mut world = Scene::new(&device, Quality::Medium).unwrap();
    world.attach_instance(&placed(&near, IDENTITY), 0).unwrap();
    world.attach_shape(&Custom::new(&device, Arc::new(Forwards(far)), u32::MAX).unwrap(), 1).unwrap();
    let world = world.commit().unwrap();
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check::<4>(&world, coherence);
        check::<8>(&world, coherence);
        check::<16>(&world, coherence);
    }
}

/// Floors at the heights `z + speed * time` of `floors`, each a triangle of mesh 7, from -1 to 1 in x and y.
struct Floors {
    floors: Vec<f32>,
    speed: f32,
}

impl CustomShape for Floors {
    fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
        let (low, high) = self.floors.iter().fold((f32::MAX, f32::MIN), |(low, high), z| (low.min(*z), high.max(*z)));
        [0.0, self.speed].map(|risen| [[-1.0, -1.0, low + risen - 0.01], [1.0, 1.0, high + risen + 0.01]]).to_vec()
    }

    fn intersect(&self, query: &mut Query) {
        assert!([1, 4, 8, 16].contains(&query.lanes()) && query.active().len() == query.lanes());
        for lane in 0..query.lanes() {
            if query.active()[lane] == 0 {
                continue;
            }
            let of = |rows: [&[f32]; 3]| rows.map(|row| row[lane]);
            let ([ox, oy, oz], [dx, dy, dz]) = (of(query.origins()), of(query.directions()));
            // The last ones first, so that nearer hits come after farther ones.
            for (triangle, z) in self.floors.iter().enumerate().rev() {
                let far = (z + self.speed * query.times()[lane] - oz) / dz;
                let [x, y] = [ox + far * dx, oy + far * dy];
                if !(far >= query.near()[lane] && far < query.far()[lane] && x.abs() <= 1.0 && y.abs() <= 1.0) {
                    continue;
                }
                let uv = [0.25 * (x + 1.0), 0.25 * (y + 1.0)];
                if query.refuses() && !query.counts(lane, far, 7, triangle as u32, uv) {
                    continue;
                }
                query.hit(lane, &Hit { far, normal: [0.0, 0.0, 2.0], uv, triangle: triangle as u32, mesh: 7 });
                if query.any_hit() {
                    break;
                }
            }
        }
    }
}

/// A scene with a triangle below everything, and `shape` with the id 2.
fn with_shape(device: &Device, shape: impl CustomShape, mask: u32) -> CommittedScene {
    let mut world = Scene::new(device, Quality::Medium).unwrap();
    world.attach_instance(&placed(&scene(device, &[triangle(device, -9.0)]), IDENTITY), 0).unwrap();
    world.attach_mesh(&triangle(device, -8.0)).unwrap();
    world.attach_shape(&Custom::new(device, Arc::new(shape), mask).unwrap(), 2).unwrap();
    world.commit().unwrap()
}

/// Rays upwards from the height 0, each at its own place and time; some start too late, end too early or pass by.
fn upwards<const W: usize>() -> Packet<W> {
    let mut rays = Packet::new();
    for lane in 0..W {
        let part = lane as f32 / 16.0;
        (rays.org_x[lane], rays.org_y[lane], rays.dir_z[lane]) = (0.9 * part, -0.5 * part, 2.0);
        (rays.time[lane], rays.id[lane]) = (part, 100 + lane as u32);
        match lane % 8 {
            5 => rays.tnear[lane] = 1.6,
            6 => rays.tfar[lane] = 0.4,
            7 => rays.org_x[lane] = 1.1,
            _ => {}
        }
    }
    rays
}

/// The floor, 0 to 2, that such a ray hits and where, counted in lengths of its direction.
fn floor_above(lane: usize, time: f32, counts: impl Fn(u32) -> bool) -> Option<(u32, f32)> {
    let floors = [1.0, 2.0, 4.0].map(|z| (z + 0.5 * time) / 2.0);
    let (near, far) = match lane % 8 {
        5 => (1.6, f32::INFINITY),
        6 => (0.0, 0.4),
        7 => return None,
        _ => (0.0, f32::INFINITY),
    };
    (0..3).map(|floor| (floor, floors[floor as usize])).find(|(floor, z)| (near..far).contains(z) && counts(*floor))
}

/// Packets of every width, with inactive lanes, and rays at different times.
#[test]
fn shapes_are_hit_where_they_are_at_the_time_of_each_ray() {
    fn check<const W: usize>(world: &CommittedScene, coherence: Coherence) {
        // Every third lane of four is inactive.
        let valid = std::array::from_fn(|lane| if lane % 4 == 2 { 0 } else { -1 });
        let before = upwards::<W>();
        let (mut rays, mut stops) = (before, before);
        world.intersect(&valid, &mut rays, coherence);
        world.occlude(&valid, &mut stops, coherence);
        let odd = |floor: u32| floor % 2 == 1;
        let (mut odd_rays, mut odd_stops) = (before, before);
        let counts = |hit: &Candidate| {
            let lane = hit.ray as usize - 100;
            let height = [1.0, 2.0, 4.0][hit.prim_id as usize] + 0.5 * before.time[lane];
            assert!(hit.geom_id == 7 && hit.inst_id == 2 && close(2.0 * hit.far, height), "{hit:?}");
            assert!(close(hit.u, 0.25 * (before.org_x[lane] + 1.0)), "{hit:?}");
            odd(hit.prim_id)
        };
        world.intersect_where(&valid, &mut odd_rays, coherence, &counts);
        world.occlude_where(&valid, &mut odd_stops, coherence, &counts);
        for lane in 0..W {
            let start = lane_of(&before, lane);
            let check = |found: Ray, stop: Ray, expected: Option<(u32, f32)>| match expected.filter(|_| lane % 4 != 2) {
                None => assert_eq!([found, stop], [start; 2], "lane {lane}"),
                Some((floor, far)) => {
                    assert!(close(found.tfar, far) && found.prim_id == floor, "lane {lane}: {found:?}, not {floor}");
                    assert_eq!((found.geom_id, found.inst_id, found.ng_z), (7, 2, 2.0));
                    assert!(close(found.v, 0.25 * (start.org_y + 1.0)), "{found:?}");
                    assert_eq!(stop, Ray { tfar: f32::NEG_INFINITY, ..start }, "lane {lane}");
                }
            };
            let at = start.time;
            check(lane_of(&rays, lane), lane_of(&stops, lane), floor_above(lane, at, |_| true));
            check(lane_of(&odd_rays, lane), lane_of(&odd_stops, lane), floor_above(lane, at, odd));
            let mut single = start;
            world.intersect1(&mut single);
            match floor_above(lane, at, |_| true) {
                None => assert_eq!(single, start),
                Some((floor, far)) => {
                    assert!(close(single.tfar, far), "{single:?}");
                    assert_eq!((single.prim_id, single.geom_id, single.inst_id), (floor, 7, 2));
                }
            }
        }
    }
    let device = Device::new().unwrap();
    let world = with_shape(&device, Floors { floors: vec![1.0, 2.0, 4.0], speed: 0.5 }, u32::MAX);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check::<4>(&world, coherence);
        check::<8>(&world, coherence);
        check::<16>(&world, coherence);
    }
}

#[test]
fn masks_hide_shapes() {
    let device = Device::new().unwrap();
    let world = with_shape(&device, Floors { floors: vec![1.0], speed: 0.0 }, 0b10);
    for (mask, hit) in [(0b01, false), (0b10, true), (0b11, true)] {
        let mut rays = Packet::<8> { mask: [mask; 8], ..upwards() };
        let mut stops = rays;
        world.intersect(&[-1; 8], &mut rays, Coherence::Coherent);
        world.occlude(&[-1; 8], &mut stops, Coherence::Coherent);
        let mut ray = Ray { mask, ..Ray::new([0.0; 3], [0.0, 0.0, 1.0]) };
        world.intersect1(&mut ray);
        assert_eq!([rays.geom_id[0] == 7, stops.tfar[0] == f32::NEG_INFINITY, ray.geom_id == 7], [hit; 3], "{mask:b}");
    }
}

/// A shape that shows another scene: `at` in x at time 0, 1 farther at time 1, and twice as high.
struct Elsewhere {
    of: CommittedScene,
    at: f32,
}

impl CustomShape for Elsewhere {
    fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
        let [low, high] = self.of.bounds();
        [self.at, self.at + 1.0].map(|x| [low, high].map(|[a, b, z]| [a + x, b, 2.0 * z])).to_vec()
    }

    fn intersect(&self, query: &mut Query) {
        let (mut rays, lanes) = (LocalRays::new(), query.lanes());
        let mut active = [0; 16];
        active[..lanes].copy_from_slice(query.active());
        let ([ox, oy, oz], [dx, dy, dz], times) = (query.origins(), query.directions(), query.times());
        let [to_ox, to_oy, to_oz, to_dx, to_dy, to_dz] = rays.rows(lanes);
        for lane in 0..lanes {
            to_ox[lane] = ox[lane] - self.at - times[lane];
            (to_oy[lane], to_oz[lane]) = (oy[lane], 0.5 * oz[lane]);
            (to_dx[lane], to_dy[lane], to_dz[lane]) = (dx[lane], dy[lane], 0.5 * dz[lane]);
            // It excludes rays of this height.
            if query.origins()[1][lane] > 0.55 {
                active[lane] = 0;
            }
        }
        query.forward(&self.of, &mut rays, &active);
    }
}

/// What a shape forwards to is hit as if it were there, by queries of every kind and width.
#[test]
fn shapes_forward_to_scenes_in_frames_of_their_own() {
    fn check<const W: usize>(world: &CommittedScene, coherence: Coherence) {
        let mut before = Packet::<W>::new();
        for lane in 0..W {
            let part = lane as f32 / 16.0;
            // Where the triangles' point (0.2, 0.3) is at the time of the ray; every third lane is inactive, every
            // fifth is excluded.
            (before.time[lane], before.org_x[lane]) = (part, 5.2 + part);
            (before.org_y[lane], before.dir_z[lane]) = (if lane % 5 == 4 { 0.6 } else { 0.3 }, 1.0);
            before.id[lane] = lane as u32;
        }
        let valid = std::array::from_fn(|lane| if lane % 3 == 2 { 0 } else { -1 });
        let (mut rays, mut stops, mut second, mut none) = (before, before, before, before);
        world.intersect(&valid, &mut rays, coherence);
        world.occlude(&valid, &mut stops, coherence);
        let far_one = |hit: &Candidate| hit.inst_id == 2 && hit.geom_id == 1;
        world.intersect_where(&valid, &mut second, coherence, &far_one);
        world.occlude_where(&valid, &mut none, coherence, &|hit: &Candidate| hit.geom_id == 2);
        for lane in 0..W {
            let start = lane_of(&before, lane);
            assert_eq!(lane_of(&none, lane), start, "no hit counts");
            let found = [&rays, &second, &stops].map(|rays| lane_of(rays, lane));
            let mut single = start;
            world.intersect1(&mut single);
            if lane % 5 == 4 {
                assert_eq!((found, single), ([start; 3], start), "lane {lane}");
                continue;
            }
            // Twice as high as in their own scene.
            let expected = |ray: &Ray, mesh: u32, far: f32| {
                assert!(close(ray.tfar, far) && close(ray.u, 0.2) && close(ray.v, 0.3), "lane {lane}: {ray:?}");
                assert_eq!((ray.geom_id, ray.prim_id, ray.inst_id), (mesh, 0, 2), "lane {lane}");
                assert!(ray.ng_x == 0.0 && ray.ng_y == 0.0 && close(ray.ng_z, 1.0), "the normal in its own frame");
            };
            expected(&single, 0, 6.0);
            if lane % 3 == 2 {
                assert_eq!(found, [start; 3], "lane {lane}");
            } else {
                expected(&found[0], 0, 6.0);
                expected(&found[1], 1, 8.0);
                assert_eq!(found[2], Ray { tfar: f32::NEG_INFINITY, ..start }, "lane {lane}");
            }
        }
    }
    let device = Device::new().unwrap();
    let of = scene(&device, &[triangle(&device, 3.0), triangle(&device, 4.0)]);
    let world = with_shape(&device, Elsewhere { of, at: 5.0 }, u32::MAX);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        check::<4>(&world, coherence);
        check::<8>(&world, coherence);
        check::<16>(&world, coherence);
    }
}

#[test]
fn shapes_have_one_to_129_boxes_and_none_of_nothing() {
    struct Boxes(Vec<[[f32; 3]; 2]>);
    impl CustomShape for Boxes {
        fn bounds(&self) -> Vec<[[f32; 3]; 2]> {
            self.0.clone()
        }

        fn intersect(&self, query: &mut Query) {
            for lane in 0..query.lanes() {
                query.hit(lane, &Hit { far: 1.0, normal: [0.0; 3], uv: [0.0; 2], triangle: 0, mesh: 0 });
            }
        }
    }
    let device = Device::new().unwrap();
    let unit = [[-1.0; 3], [1.0; 3]];
    let shape = |boxes: Vec<[[f32; 3]; 2]>| Custom::new(&device, Arc::new(Boxes(boxes)), u32::MAX);
    for count in [1, 2, 129] {
        shape(vec![unit; count]).unwrap();
    }
    for count in [0, 130] {
        assert!(matches!(shape(vec![unit; count]), Err(Error::Embree { .. })), "{count} boxes");
    }
    let nothing = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for (boxes, hit) in [(vec![unit], true), (vec![nothing], false), (vec![nothing; 3], false)] {
        let world = with_shape(&device, Boxes(boxes), u32::MAX);
        let mut ray = Ray { time: 0.5, ..Ray::new([0.0; 3], [0.0, 0.0, 1.0]) };
        world.intersect1(&mut ray);
        assert_eq!(ray.inst_id == 2, hit);
    }
}

#[test]
fn instances_scale_mirror_and_keep_the_mesh_and_scene_alive() {
    let device = Device::new().unwrap();
    let mut world = Scene::new(&device, Quality::Medium).unwrap();
    {
        let object = scene(&device, &[triangle(&device, 1.0)]);
        // x twice as long and mirrored, y three times, z half and turned over; then moved by (10, 0, 5).
        let matrix = [-2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, -0.5, 10.0, 0.0, 5.0];
        world.attach_instance(&placed(&object, IDENTITY), 0).unwrap();
        world.attach_instance(&placed(&object, matrix), 1).unwrap();
        // An id is given once.
        assert!(matches!(world.attach_instance(&placed(&object, matrix), 1), Err(Error::Embree { .. })));
    }
    drop(device);
    let world = world.commit().unwrap();
    // Object point (0.25, 0.5, 1) is world point (9.5, 1.5, 4.5).
    let mut ray = Ray::new([9.5, 1.5, 0.0], [0.0, 0.0, 1.0]);
    world.intersect1(&mut ray);
    let mut rays = Packet::<8>::new();
    rays.org_x = [9.5; 8];
    rays.org_y = [1.5; 8];
    rays.dir_z = [1.0; 8];
    world.intersect(&[-1; 8], &mut rays, Coherence::Coherent);
    for hit in [ray, lane_of(&rays, 0), lane_of(&rays, 7)] {
        assert_eq!((hit.inst_id, hit.geom_id, hit.prim_id), (1, 0, 0));
        assert!(close(hit.tfar, 4.5) && close(hit.u, 0.25) && close(hit.v, 0.5), "{hit:?}");
        // The normal is in the space of the mesh.
        assert!(hit.ng_x == 0.0 && hit.ng_y == 0.0 && close(hit.ng_z, 1.0), "{hit:?}");
    }
}

#[test]
fn masks_hide_meshes_and_instances() {
    let device = Device::new().unwrap();
    let corners = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]].into_iter();
    let inner = scene(&device, &[triangle(&device, 2.0)]);
    let mut world = Scene::new(&device, Quality::Low).unwrap();
    world.attach_mesh(&Mesh::new(&device, corners(1.0), &[[0, 1, 2]], 0b01).unwrap()).unwrap();
    world.attach_instance(&Instance::new(&inner, IDENTITY, 0b10).unwrap(), 1).unwrap();
    world.attach_mesh(&Mesh::new(&device, corners(3.0), &[[0, 1, 2]], 1 << 31).unwrap()).unwrap();
    let world = world.commit().unwrap();
    for (mask, range) in [(0b01, 1.0), (0b10, 2.0), (0b11, 1.0), (1 << 31, 3.0), (0b100, f32::INFINITY)] {
        let mut ray = Ray { mask, ..Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]) };
        world.intersect1(&mut ray);
        let mut rays = Packet::<8>::new();
        (rays.org_x, rays.org_y, rays.dir_z, rays.mask) = ([0.2; 8], [0.2; 8], [1.0; 8], [mask; 8]);
        world.intersect(&[-1; 8], &mut rays, Coherence::Coherent);
        let found = |tfar: f32| tfar == range || close(tfar, range);
        assert!(found(ray.tfar) && rays.tfar.iter().all(|&tfar| found(tfar)), "mask {mask:b}: {ray:?}");
    }
}

#[test]
fn instances_of_instances_are_refused() {
    let device = Device::new().unwrap();
    let object = scene(&device, &[triangle(&device, 1.0)]);
    let mut middle = Scene::new(&device, Quality::Medium).unwrap();
    middle.attach_instance(&placed(&object, IDENTITY), 0).unwrap();
    let middle = middle.commit().unwrap();
    assert_eq!(Instance::new(&middle, IDENTITY, u32::MAX).unwrap_err(), Error::NestedInstance);
}

#[test]
fn transforms_without_inverse_are_refused() {
    let device = Device::new().unwrap();
    let object = scene(&device, &[triangle(&device, 1.0)]);
    for (place, value) in [(4, 0.0), (9, f32::NAN), (0, f32::INFINITY), (8, 1e-45)] {
        let mut transform = IDENTITY;
        transform[place] = value;
        let result = Instance::new(&object, transform, u32::MAX);
        assert!(matches!(result, Err(Error::Transform { .. })), "{transform:?} gave {result:?}");
    }
}

#[test]
fn devices_do_not_mix() {
    let (one, two) = (Device::new().unwrap(), Device::new().unwrap());
    let mut scene_of_one = Scene::new(&one, Quality::Medium).unwrap();
    assert_eq!(scene_of_one.attach_mesh(&triangle(&two, 1.0)), Err(Error::OtherDevice));
    let object = scene(&two, &[triangle(&two, 1.0)]);
    assert_eq!(scene_of_one.attach_instance(&placed(&object, IDENTITY), 0), Err(Error::OtherDevice));
    assert_eq!(scene_of_one.attach_mesh(&triangle(&one.clone(), 1.0)), Ok(0));
}

#[test]
fn meshes_without_content_or_with_wrong_indices_are_refused() {
    let device = Device::new().unwrap();
    let corners = || [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into_iter();
    assert_eq!(
        Mesh::new(&device, corners(), &[], u32::MAX).unwrap_err(),
        Error::EmptyMesh { vertices: 3, triangles: 0 }
    );
    assert_eq!(
        Mesh::new(&device, std::iter::empty(), &[[0, 0, 0]], u32::MAX).unwrap_err(),
        Error::EmptyMesh { vertices: 0, triangles: 1 }
    );
    assert_eq!(
        Mesh::new(&device, corners(), &[[0, 1, 2], [0, 3, 1]], u32::MAX).unwrap_err(),
        Error::IndexOutOfRange { triangle: 1, index: 3, vertices: 3 }
    );
    // As many vertices as an iterator can claim; the claim must not be trusted unchecked.
    let endless = (0..u32::MAX).map(|_| [0.0; 3]);
    let error = Mesh::new(&device, endless, &[[0, 1, 2]], u32::MAX).unwrap_err();
    assert_eq!(error, Error::MeshTooLarge { vertices: u32::MAX as usize, triangles: 1 });
}

#[test]
fn an_iterator_shorter_than_claimed_leaves_vertices_that_are_never_hit() {
    struct Liar;
    impl Iterator for Liar {
        type Item = [f32; 3];
        fn next(&mut self) -> Option<[f32; 3]> {
            None
        }
        fn size_hint(&self) -> (usize, Option<usize>) {
            (3, Some(3))
        }
    }
    impl ExactSizeIterator for Liar {}
    let device = Device::new().unwrap();
    let scene = scene(&device, &[Mesh::new(&device, Liar, &[[0, 1, 2]], u32::MAX).unwrap()]);
    let mut ray = Ray::new([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]);
    scene.intersect1(&mut ray);
    assert_eq!(ray.geom_id, INVALID);
}

#[test]
fn triangles_with_vertices_that_are_not_finite_are_never_hit() {
    let device = Device::new().unwrap();
    let corners = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, f32::NAN],
        [0.0, 1.0, 1.0],
        [0.0, 0.0, 2.0],
        [f32::INFINITY, 0.0, 2.0],
        [0.0, 1.0, 2.0],
        [0.0, 0.0, 3.0],
        [1.0, 0.0, 3.0],
        [0.0, 1.0, 3.0],
    ];
    let mesh = Mesh::new(&device, corners.into_iter(), &[[0, 1, 2], [3, 4, 5], [6, 7, 8]], u32::MAX).unwrap();
    let scene = scene(&device, &[mesh]);
    let mut ray = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);
    scene.intersect1(&mut ray);
    assert_eq!(ray.prim_id, 2);
    assert!(close(ray.tfar, 3.0));
}

#[test]
fn an_empty_scene_is_missed() {
    let scene = Scene::new(&Device::new().unwrap(), Quality::Medium).unwrap().commit().unwrap();
    assert!(trace::<16>(&scene, &fan(16), Coherence::Coherent).iter().all(|ray| ray.geom_id == INVALID));
}

/// Embree does not guarantee this; results that do not depend on machine load rely on it.
#[test]
fn build_threads_do_not_change_a_bit() {
    let run = |helpers: usize| {
        let device = Device::new().unwrap();
        let mut world = Scene::new(&device, Quality::Medium).unwrap();
        let object = scene(&device, &[clutter(&device)]);
        world.attach_mesh(&clutter(&device)).unwrap();
        for i in 0..50_u32 {
            let mut transform = IDENTITY.map(|x| 0.7 * x);
            transform[9] = 2.0 * i as f32 - 50.0;
            transform[10] = 30.0;
            world.attach_instance(&placed(&object, transform), i + 1).unwrap();
        }
        let mut threads = Vec::new();
        let world = world.commit_with(Pace::Now, |joint| {
            threads.extend((0..helpers).map(|_| joint.clone()).map(|joint| thread::spawn(move || joint.help())));
        });
        let world = world.unwrap();
        threads.into_iter().for_each(|thread| thread.join().unwrap());
        let directions = fan(4000);
        let hits = [trace::<16>(&world, &directions, Coherence::Coherent), trace1(&world, &directions)].concat();
        let bits = |ray: &Ray| {
            let floats = [ray.tfar, ray.u, ray.v, ray.ng_x, ray.ng_y, ray.ng_z].map(f32::to_bits);
            (floats, ray.geom_id, ray.prim_id, ray.inst_id)
        };
        hits.iter().map(bits).collect::<Vec<_>>()
    };
    let one = run(0);
    assert!(one.iter().filter(|(_, geom_id, _, _)| *geom_id != INVALID).count() > 4000);
    assert!(one.iter().any(|(_, _, _, inst_id)| *inst_id != INVALID));
    for helpers in [1, 5] {
        assert!(one == run(helpers), "{helpers} helpers give other hits than none");
    }
}

/// Scenes built side by side on more threads than there are cores, one of them in the background.
#[test]
fn builds_wait_for_each_other() {
    let device = Device::new().unwrap();
    thread::scope(|scope| {
        for pace in [Pace::Now, Pace::Aside, Pace::Now, Pace::Aside] {
            let device = &device;
            scope.spawn(move || {
                for _ in 0..20 {
                    let mut world = Scene::new(device, Quality::Low).unwrap();
                    world.attach_mesh(&clutter(device)).unwrap();
                    let helper = |joint: &Arc<Joint>| {
                        drop(thread::spawn({
                            let joint = joint.clone();
                            move || joint.help()
                        }))
                    };
                    let world = world.commit_with(pace, helper).unwrap();
                    assert!(trace::<16>(&world, &fan(16), Coherence::Coherent).iter().any(|ray| ray.geom_id == 0));
                }
            });
        }
    });
}

#[test]
fn threads_share_one_scene() {
    let device = Device::new().unwrap();
    let shared = scene(&device, &[clutter(&device)]);
    let directions = fan(1000);
    let alone = trace::<16>(&shared, &directions, Coherence::Coherent);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            let own = shared.clone();
            let (directions, alone) = (&directions, &alone);
            scope.spawn(move || assert_eq!(&trace::<16>(&own, directions, Coherence::Coherent), alone));
        }
    });
}

/// With flush-to-zero the quotient would be 0, with denormals-are-zero the product.
#[test]
fn building_and_tracing_leave_denormal_numbers_alone() {
    let device = Device::new().unwrap();
    let scene = scene(&device, &[clutter(&device)]);
    trace::<16>(&scene, &fan(64), Coherence::Coherent);
    let denormal = std::hint::black_box(f32::MIN_POSITIVE) / 4.0;
    assert!(denormal > 0.0);
    assert_eq!(std::hint::black_box(denormal) * 4.0, f32::MIN_POSITIVE);
}

#[test]
fn handles_can_be_sent_and_shared() {
    fn check<T: Send + Sync>() {}
    check::<Device>();
    check::<Mesh>();
    check::<Scene>();
    check::<CommittedScene>();
    check::<Error>();
}
