//! Scenes that move: driving cars, walking people, cloth from a cache, and the columns of motion. One core.

use crate::Result;
use crate::clock::{cpu_per_call, cpu_seconds, median};
use crate::presets;
use crate::scenes::{self, Builder, Shapes};
use echocast::generate::Street;
use echocast::scene::{CacheFile, Mesh, Object};
use echocast::{BareLoop, Engine, FieldSet, LiveScene, LoadOptions, PointCloud, Pose, ScanOptions, Scene, Trajectory};
use echocast_kernels::skin::{Influences, JointMatrix, skin};
use glam::{DAffine3, DQuat, DVec3};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f32::consts::TAU;
use std::sync::Arc;
use std::time::Duration;

const ROUNDS: usize = 9;
const LEAST: Duration = Duration::from_millis(40);
/// Frames of the street and of boxes.
const FRAMES: u32 = 40;
const CARS: usize = 200;
const PEOPLE: usize = 20;
const JOINTS: usize = 50;

pub fn run() -> Result<Value> {
    println!("\nMotion, one core");
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| {
        let (cars, street, turning) = (cars()?, street()?, turning()?);
        Ok(json!({"cars": cars, "street": street, "turning": turning, "people": people()?, "cloth": cloth()?}))
    })
}

/// A closed, bumpy body of `rows` rings of `columns` quads.
fn body(size: [f32; 3], rows: u32, columns: u32) -> Mesh {
    let mut body = Builder::default();
    for row in 0..=rows {
        let (sin, cos) = (0.5 * TAU * row as f32 / rows as f32).sin_cos();
        for column in 0..columns {
            let angle = TAU * column as f32 / columns as f32;
            let bump = 1.0 + 0.03 * (7.0 * angle).sin() * sin;
            let p = [sin * angle.cos() * bump, sin * angle.sin() * bump, 1.0 - cos];
            body.positions.push(std::array::from_fn(|axis| p[axis] * size[axis]));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (row * columns + column, row * columns + (column + 1) % columns);
            body.triangles.extend([[a, b, b + columns], [a, b + columns, a + columns]]);
        }
    }
    body.mesh("body")
}

/// A static city of 180,000 triangles, and 200 cars of 5,000 that all drive.
fn cars() -> Result<Value> {
    let engine = Engine::with_threads(1)?;
    let sensor = presets::of_one_ray("velodyne_vlp32c")?;
    let car = Arc::new(body([2.2, 0.9, 0.75], 50, 50));
    let mut shapes = Shapes::new(5);
    let streets: Vec<(DVec3, DVec3)> = (0..CARS)
        .map(|number| {
            let lane = f64::from(shapes.between(-4.0, 5.0).floor()) * 72.0;
            let side: f64 = if shapes.between(0.0, 1.0) < 0.5 { 2.5 } else { -2.5 };
            let along = f64::from(shapes.between(-200.0, 200.0));
            let speed = 14.0 * side.signum();
            match number % 2 {
                0 => (DVec3::new(lane + side, along, 0.2), DVec3::Y * speed),
                _ => (DVec3::new(along, lane - side, 0.2), DVec3::X * speed),
            }
        })
        .collect();
    let pose = |(place, speed): &(DVec3, DVec3), time: f64| {
        DAffine3::from_rotation_translation(DQuat::from_rotation_z(speed.y.atan2(speed.x)), *place + *speed * time)
    };
    let mut live = LiveScene::new(&engine);
    live.add_scene(&scenes::city())?;
    let ids: Vec<_> = streets
        .iter()
        .map(|street| {
            let object = Object::new("car", car.clone()).world_from_object(pose(street, 0.0)).category_id(9);
            live.add(object)
        })
        .collect::<echocast::Result<_>>()?;
    let still = live.commit()?;
    let at = Pose::at(0.0, 0.0, 2.0);
    let mut bare = BareLoop::new(&still, &sensor, at);
    for (id, street) in ids.iter().zip(&streets) {
        live.set_motion(*id, &[0.0, 20.0].map(|time| (time, pose(street, time))))?;
    }
    let length = sensor.scan_time();
    let trajectory = Trajectory::fixed(at);
    let mut setting = Vec::new();
    for frame in 0..=ROUNDS {
        let start = cpu_seconds();
        live.set_time(0.1 * frame as f64, length)?;
        live.commit()?;
        if frame > 0 {
            setting.push(cpu_seconds() - start);
        }
    }
    live.set_time(0.0, length)?;
    let moving = live.commit()?;
    let default = ScanOptions::default();
    let truth = FieldSet::parse("default,velocity,radial_velocity,flow,track_id")?;
    let truth = ScanOptions::default().fields(truth);
    let mut clouds = [PointCloud::default(), PointCloud::default(), PointCloud::default()];
    let mut times = [const { Vec::new() }; 4];
    for round in 0..=ROUNDS {
        let [a, b, c] = &mut clouds;
        let scan = |built: &echocast::BuiltScene, options: &ScanOptions, cloud: &mut PointCloud| {
            cpu_per_call(LEAST, || {
                built.scan_into(&sensor, &trajectory, options, cloud).expect("a scan of a built scene succeeds");
            })
        };
        let sample = [
            cpu_per_call(LEAST, || bare.run()),
            scan(&still, &default, a),
            scan(&moving, &default, b),
            scan(&moving, &truth, c),
        ];
        if round > 0 {
            times.iter_mut().zip(sample).for_each(|(list, time)| list.push(time));
        }
    }
    let ratio = |under: usize| median(times[0].iter().zip(&times[under]).map(|(a, b)| a / b).collect());
    let points = clouds[1].len() as f64;
    // The difference of two times is useless if one is disturbed: take the minimum of each.
    let [without, with] = [2, 3].map(|under| times[under].iter().copied().fold(f64::INFINITY, f64::min));
    let added = (with - without) / points * 1e9;
    let setting = median(setting) * 1e3;
    println!(
        "{CARS} cars of {} triangles that drive through the city: default columns {:.2} of the bare loop of the still \
         scene ({:.2} standing), setting a frame {setting:.2} ms, columns of motion {added:.1} ns a point",
        car.triangle_count(),
        ratio(2),
        ratio(1),
    );
    Ok(json!({"default_ratio": ratio(2), "still_ratio": ratio(1), "set_ms": setting, "truth_ns_per_point": added}))
}

/// The generated street: ten cars that drive with wheels that roll, two people who walk, a flag. Setting a frame of it, as
/// it moves and frozen, and scans of the moving frame beside those of the frozen one.
fn street() -> Result<Value> {
    let street = Street::default().cars(10).scene(7)?;
    let scene = Scene::from_glb_bytes(street.bytes(), &LoadOptions::default())?;
    let mut live = LiveScene::new(&Engine::with_threads(1)?);
    live.add_scene(&scene)?;
    let sensor = presets::of_one_ray("velodyne_vlp16")?;
    let trajectory = Trajectory::fixed(scene.camera("Corner")?.pose);
    let mut clouds = [PointCloud::default(), PointCloud::default()];
    let (mut setting, mut scanning) = ([const { Vec::new() }; 2], [const { Vec::new() }; 2]);
    for frame in 0..=FRAMES {
        for (kind, length) in [sensor.scan_time(), 0.0].into_iter().enumerate() {
            let start = cpu_seconds();
            let time = 0.1 * f64::from(frame);
            live.set_time(time, length)?;
            let built = live.commit()?;
            let set = cpu_seconds() - start;
            let options = ScanOptions::default().start_time(time);
            let scan = cpu_per_call(LEAST / 2, || {
                let cloud = &mut clouds[kind];
                built.scan_into(&sensor, &trajectory, &options, cloud).expect("a scan of a built scene succeeds");
            });
            // Memory of the first frames is allocated.
            if frame > 1 {
                setting[kind].push(set);
                scanning[kind].push(scan);
            }
        }
    }
    let speed = median(scanning[1].iter().zip(&scanning[0]).map(|(still, moving)| still / moving).collect());
    let [set, frozen] = setting.map(|times| median(times) * 1e3);
    let [moving, still] = scanning.map(|times| median(times) * 1e3);
    println!(
        "generated street, ten cars and two people: setting a frame {set:.2} ms ({frozen:.2} frozen), a scan of one ray \
         a beam {moving:.2} ms ({still:.2} frozen), {speed:.2} of the speed of the frozen one"
    );
    Ok(json!({"set_ms": set, "set_frozen_ms": frozen, "scan_ms": moving, "scan_frozen_ms": still, "speed": speed}))
}

/// 1000 boxes that drive and turn.
fn turning() -> Result<Value> {
    const BOXES: u32 = 1000;
    let mut corners = Builder::default();
    corners.cuboid([-2.0, -0.9, 0.0], [2.0, 0.9, 1.5]);
    let mesh = Arc::new(corners.mesh("box"));
    let mut live = LiveScene::new(&Engine::with_threads(1)?);
    for number in 0..BOXES {
        let place = DVec3::new(f64::from(number % 40) * 6.0, f64::from(number / 40) * 6.0, 0.0);
        // A quarter of a turn in a second, in a key for each frame.
        let key = |key: u32| {
            let time = f64::from(key) * 0.1;
            let turn = DQuat::from_rotation_z(0.25 * f64::from(TAU) * time);
            (time, DAffine3::from_rotation_translation(turn, place + DVec3::X * time))
        };
        let id = live.add(Object::new("box", mesh.clone()).world_from_object(key(0).1))?;
        live.set_motion(id, &(0..FRAMES + 2).map(key).collect::<Vec<_>>())?;
    }
    let mut times = Vec::new();
    for frame in 0..=FRAMES {
        let start = cpu_seconds();
        live.set_time(0.05 + 0.1 * f64::from(frame), 0.1)?;
        live.commit()?;
        if frame > 0 {
            times.push(cpu_seconds() - start);
        }
    }
    let setting = median(times) * 1e3;
    println!("{BOXES} boxes that drive and turn: setting a frame {setting:.2} ms");
    Ok(json!({"set_ms": setting}))
}

/// 20 people of 20,000 vertices and 50 joints, walking.
fn people() -> Result<Value> {
    let scene = Scene::from_glb_bytes(&walkers()?, &LoadOptions::default().looped(true))?;
    let vertices: usize = scene.objects.iter().map(|object| object.mesh.parts[0].positions.len()).sum();
    let mut live = LiveScene::new(&Engine::with_threads(1)?);
    live.add_scene(&scene)?;
    let mut times = Vec::new();
    for frame in 0..=2 * ROUNDS {
        let start = cpu_seconds();
        live.set_time(0.1 * frame as f64, 0.1)?;
        live.commit()?;
        if frame > 1 {
            times.push(cpu_seconds() - start);
        }
    }
    let setting = median(times) * 1e3;
    // The kernel alone, on one of them.
    let rest = &scene.objects[0].mesh.parts[0].positions;
    let joints: Vec<[u16; 4]> =
        (0..rest.len()).map(|k| [0, 1, 2, 3].map(|n| ((k / 400 + n) % JOINTS) as u16)).collect();
    let weights = vec![[0.4, 0.3, 0.2, 0.1]; rest.len()];
    let palette: Vec<JointMatrix> = vec![std::array::from_fn(|k| if k % 5 == 0 { 1.0 } else { 0.01 }); JOINTS];
    let mut out = vec![[0.0; 4]; rest.len()];
    let sets = [Influences { joints: &joints, weights: &weights }];
    let seconds = cpu_per_call(LEAST, || skin(rest, &sets, &palette, &mut out));
    let rate = rest.len() as f64 / seconds / 1e6;
    println!(
        "{PEOPLE} people of {} vertices and {JOINTS} joints: posing and fitting a frame of 0.1 s to 1 mm {setting:.1} ms, \
         skinning {rate:.0} M vertices/s",
        vertices / PEOPLE
    );
    Ok(json!({"set_ms": setting, "skin_mvertices_per_s": rate}))
}

/// A GLB file of people: a tube each, around a chain of joints that swing once a second.
fn walkers() -> Result<Vec<u8>> {
    let mesh = body([0.25, 0.25, 0.9], 199, 100);
    let part = &mesh.parts[0];
    let mut bin: Vec<u8> = Vec::new();
    let mut views = Vec::new();
    let mut view = |bytes: &[u8]| {
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        bin.extend_from_slice(bytes);
        bin.resize(bin.len().next_multiple_of(4), 0);
        views.len() - 1
    };
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let count = part.positions.len();
    let joint_of = |z: f32| (z / 1.8 * JOINTS as f32).clamp(0.0, JOINTS as f32 - 1.0);
    let mut joints = Vec::new();
    let mut weights = Vec::new();
    for position in part.positions.iter() {
        let at = joint_of(position[2]);
        let first = (at as usize).min(JOINTS - 2);
        let part = (at - first as f32).clamp(0.0, 1.0);
        joints.extend([first as u8, first as u8 + 1, 0, 0]);
        weights.extend([1.0 - part, part, 0.0, 0.0]);
    }
    let step = 1.8 / JOINTS as f32;
    let mut inverse = Vec::new();
    for joint in 0..JOINTS {
        inverse.extend([
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
            -step * joint as f32,
            1.0,
        ]);
    }
    const KEYS: usize = 25;
    let times: Vec<f32> = (0..KEYS).map(|key| key as f32 / (KEYS - 1) as f32).collect();
    let swing: Vec<f32> = times
        .iter()
        .flat_map(|time| {
            let half = 0.5 * 0.007 * (TAU * time).sin();
            [half.sin(), 0.0, 0.0, half.cos()]
        })
        .collect();
    let positions = view(&floats(part.positions.as_flattened()));
    let triangles: Vec<u8> = part.triangles.as_flattened().iter().flat_map(|index| index.to_le_bytes()).collect();
    let indices = view(&triangles);
    let (joints, weights) = (view(&joints), view(&floats(&weights)));
    let (inverse, times, swing) = (view(&floats(&inverse)), view(&floats(&times)), view(&floats(&swing)));
    let accessors = json!([
        {"bufferView": positions, "componentType": 5126, "count": count, "type": "VEC3"},
        {"bufferView": indices, "componentType": 5125, "count": part.triangles.len() * 3, "type": "SCALAR"},
        {"bufferView": joints, "componentType": 5121, "count": count, "type": "VEC4"},
        {"bufferView": weights, "componentType": 5126, "count": count, "type": "VEC4"},
        {"bufferView": inverse, "componentType": 5126, "count": JOINTS, "type": "MAT4"},
        {"bufferView": times, "componentType": 5126, "count": KEYS, "type": "SCALAR"},
        {"bufferView": swing, "componentType": 5126, "count": KEYS, "type": "VEC4"},
    ]);
    let (mut nodes, mut skins, mut channels, mut roots) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for person in 0..PEOPLE {
        let first = nodes.len();
        for joint in 0..JOINTS {
            let place = if joint == 0 { [2.0 * person as f32, 5.0, 0.0] } else { [0.0, 0.0, step] };
            let children: Vec<usize> = if joint + 1 < JOINTS { vec![first + joint + 1] } else { Vec::new() };
            let mut node = json!({"translation": place});
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            nodes.push(node);
            channels.push(json!({"sampler": 0, "target": {"node": first + joint, "path": "rotation"}}));
        }
        skins.push(json!({"joints": (first..first + JOINTS).collect::<Vec<_>>(), "inverseBindMatrices": 4}));
        roots.extend([first, nodes.len()]);
        nodes.push(json!({"mesh": 0, "skin": person, "name": format!("Person_{person}")}));
    }
    let attributes = json!({"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3});
    let file = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes, "skins": skins,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1}]}],
        "animations": [{"name": "walk", "samplers": [{"input": 5, "output": 6}], "channels": channels}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bin.len()}],
    });
    let mut text = serde_json::to_vec(&file)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut glb = Vec::new();
    let total = 12 + 8 + text.len() + 8 + bin.len();
    glb.extend(b"glTF");
    for number in [2, total as u32, text.len() as u32] {
        glb.extend(number.to_le_bytes());
    }
    glb.extend(b"JSON");
    glb.extend(&text);
    glb.extend((bin.len() as u32).to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend(&bin);
    Ok(glb)
}

/// A cloth of 200,000 triangles that waves, from a cache of its vertices.
fn cloth() -> Result<Value> {
    const SIDE: u32 = 317;
    const SAMPLES: u32 = 30;
    let folder = tempfile::tempdir()?;
    let place = |k: u32, time: f32| {
        let (x, y) = ((k % SIDE) as f32 * 0.02, (k / SIDE) as f32 * 0.02);
        [x, y, 0.2 * (3.0 * x + 6.0 * time).sin() * (2.0 * y + time).cos()]
    };
    let mut obj = String::from("o Cloth\n");
    for k in 0..SIDE * SIDE {
        let [x, y, z] = place(k, 0.0);
        obj += &format!("v {x} {y} {z}\n");
    }
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let a = row * SIDE + column + 1;
            obj += &format!("f {a} {} {}\nf {a} {} {}\n", a + 1, a + SIDE + 1, a + SIDE + 1, a + SIDE);
        }
    }
    let mut cache = b"POINTCACHE2\0".to_vec();
    cache.extend([1, SIDE * SIDE].into_iter().flat_map(u32::to_le_bytes));
    cache.extend([0f32, 1.0].into_iter().flat_map(f32::to_le_bytes));
    cache.extend(SAMPLES.to_le_bytes());
    for sample in 0..SAMPLES {
        for k in 0..SIDE * SIDE {
            cache.extend(place(k, sample as f32 / 10.0).into_iter().flat_map(f32::to_le_bytes));
        }
    }
    let (scene, baked) = (folder.path().join("cloth.obj"), folder.path().join("cloth.pc2"));
    std::fs::write(&scene, obj)?;
    std::fs::write(&baked, cache)?;
    let file = CacheFile::new(baked.clone()).fps(10.0);
    let options = LoadOptions::default().caches(BTreeMap::from([("Cloth".to_owned(), file)]));
    let scene = Scene::load_with(&scene, &options)?;
    let mesh = scene.objects[0].mesh.clone();
    let mut live = LiveScene::new(&Engine::with_threads(1)?);
    live.add_scene(&scene)?;
    let device = embree4::Device::new()?;
    let part = &mesh.parts[0];
    let mut times = [const { Vec::new() }; 3];
    for frame in 0..=ROUNDS {
        let start = cpu_seconds();
        live.set_time(0.1 * frame as f64, 0.1)?;
        live.commit()?;
        let set = cpu_seconds() - start;
        let geometry = embree4::Mesh::new(&device, part.positions.iter().copied(), &part.triangles, u32::MAX)?;
        let mut low = embree4::Scene::new(&device, embree4::Quality::Low)?;
        low.attach_mesh(&geometry)?;
        let start = cpu_seconds();
        drop(low.commit()?);
        let commit = cpu_seconds() - start;
        let start = cpu_seconds();
        drop(std::fs::read(&baked)?);
        let read = (cpu_seconds() - start) / f64::from(SAMPLES);
        if frame > 0 {
            times.iter_mut().zip([set, commit, read]).for_each(|(list, time)| list.push(time));
        }
    }
    let [set, commit, read] = times.map(|list| median(list) * 1e3);
    let ratio = set / (commit + read);
    println!(
        "cloth of {} triangles from a cache: setting a frame {set:.1} ms, {ratio:.2} of building it at low quality \
         ({commit:.1} ms) and reading a sample ({read:.1} ms)",
        mesh.triangle_count()
    );
    Ok(json!({"set_ms": set, "low_commit_ms": commit, "read_ms": read, "ratio": ratio}))
}
