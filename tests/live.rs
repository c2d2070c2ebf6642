//! Scenes that are edited while they are scanned.

use echocast::cloud::FIELDS;
use echocast::material::Reflectance;
use echocast::scene::{Array, Material, Mesh, Object, Part};
use echocast::{
    BuiltScene, Engine, FieldSet, LiveScene, ObjectId, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory,
};
use echocast_tests::reference::{Random, Shape};
use glam::{DAffine3, DQuat, DVec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn mesh(shape: Shape, material: Option<Arc<Material>>) -> Arc<Mesh> {
    let part = Part::default()
        .positions(shape.positions.into())
        .normals(shape.normals.map(Into::into))
        .triangles(shape.triangles.into())
        .material(material);
    Arc::new(Mesh::new("shape", vec![part]).unwrap())
}

fn paint(reflectance: f32) -> Arc<Material> {
    let reflectance = Some(Reflectance::Constant(reflectance));
    Arc::new(Material::default().name(format!("paint {reflectance:?}")).reflectance(reflectance))
}

fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

fn ball() -> Arc<Mesh> {
    mesh(Shape::sphere(1.0, 16), Some(paint(0.5)))
}

/// A beam at every degree, all round and 20 degrees up and down.
fn sensor() -> Sensor {
    let yaml = "
name: all around
kind: lidar
pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 1}, elevation: {fov_deg: 40, step_deg: 2}}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

fn scan(scene: &BuiltScene) -> PointCloud {
    let options = ScanOptions::default().fields(FieldSet::all());
    scene.scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap()
}

fn assert_same(a: &PointCloud, b: &PointCloud) {
    assert_eq!((a.len(), a.origin), (b.len(), b.origin));
    for info in FIELDS {
        assert!(a.column(info.field).bytes() == b.column(info.field).bytes(), "{}", info.name);
    }
    assert_eq!(a.labels, b.labels);
}

/// Range of the only object, which a beam straight ahead meets; `None`: nothing there.
fn ahead(scene: &BuiltScene) -> Option<f32> {
    let yaml = "{name: one, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 1, step_deg: 2}, elevation: {fov_deg: 1, step_deg: 2}}}";
    let mut one = Sensor::from_yaml(yaml, "").unwrap();
    one.set("pattern.azimuth", "{fov_deg: 0.002, step_deg: 0.001}").unwrap();
    one.set("pattern.elevation", "{fov_deg: 0.002, step_deg: 0.001}").unwrap();
    let cloud = scene.scan(&one, &Trajectory::fixed(Pose::IDENTITY), &ScanOptions::default()).unwrap();
    (!cloud.is_empty()).then(|| cloud.columns().range()[cloud.len() / 2])
}

fn close(found: Option<f32>, expected: f32) -> bool {
    found.is_some_and(|range| (range - expected).abs() < 1e-3)
}

/// The objects of `live` in a scene without a history.
fn anew(live: &LiveScene, fixed: &[ObjectId]) -> LiveScene {
    let mut scene = LiveScene::new(live.engine());
    for (id, object) in live.objects() {
        let object = object.clone();
        if fixed.contains(&id) {
            scene.add_fixed(object).unwrap()
        } else {
            scene.add(object).unwrap()
        };
    }
    scene
}

#[test]
fn edits_lead_to_the_scene_that_has_no_past() {
    for seed in 0..6 {
        let random = &mut Random::new(seed);
        let paints = [0.1, 0.4, 0.9].map(paint);
        let shared = [ball(), mesh(Shape::cuboid(-DVec3::ONE, DVec3::ONE), None)];
        let mut live = LiveScene::new(&Engine::with_threads(1 + seed as usize % 2).unwrap());
        live.set_origin(DVec3::ZERO).unwrap();
        let (mut ids, mut fixed) = (Vec::new(), Vec::new());
        let mut number = 0;
        let place = |random: &mut Random| {
            let far = DVec3::new(random.between(3.0, 20.0), random.between(-20.0, 20.0), random.between(-4.0, 4.0));
            // Some are squeezed flat.
            let squeeze = if random.below(8) == 0 { DVec3::new(1.0, 1.0, 0.0) } else { DVec3::ONE };
            DAffine3::from_mat3_translation(random.linear_map() * glam::DMat3::from_diagonal(squeeze), far)
        };
        for _ in 0..25 {
            for _ in 0..random.below(6) {
                number += 1;
                let name = format!("object {number}");
                let stays = random.below(3) == 0;
                let shape = if stays && random.below(2) == 0 { ball() } else { shared[random.below(2)].clone() };
                let object = Object::new(name, shape)
                    .world_from_object(place(random))
                    .category_id(random.below(5) as u32)
                    .instance_id(number)
                    .mask(if random.below(5) == 0 { 2 } else { u32::MAX });
                let id = if stays { live.add_fixed(object).unwrap() } else { live.add(object).unwrap() };
                ids.push(id);
                if stays {
                    fixed.push(id);
                }
            }
            for _ in 0..random.below(6) {
                if ids.is_empty() {
                    continue;
                }
                let which = random.below(ids.len());
                let id = ids[which];
                match random.below(7) {
                    0 | 1 => {
                        live.set_pose(id, place(random)).unwrap();
                        fixed.retain(|&one| one != id);
                    }
                    2 => {
                        live.remove(id).unwrap();
                        ids.swap_remove(which);
                        fixed.retain(|&one| one != id);
                    }
                    3 => live.set_material(id, Some(paints[random.below(3)].clone())).unwrap(),
                    4 => {
                        number += 1;
                        live.set_labels(id, 7, number, &[9]).unwrap();
                    }
                    5 => live.set_mask(id, [1, 2, u32::MAX][random.below(3)]).unwrap(),
                    _ => {
                        let positions = &live.object(id).unwrap().mesh.parts[0].positions;
                        let wider: Vec<_> = positions.iter().map(|p| p.map(|x| 1.1 * x)).collect();
                        live.set_vertices(id, wider.into(), None).unwrap();
                        fixed.retain(|&one| one != id);
                    }
                }
            }
            let (edited, fresh) = (live.commit().unwrap(), anew(&live, &fixed).commit().unwrap());
            for mask in [u32::MAX, 1, 2] {
                let options = ScanOptions::default().fields(FieldSet::all()).mask(mask);
                let scan = |scene: &BuiltScene| scene.scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options);
                let (a, b) = (scan(&edited).unwrap(), scan(&fresh).unwrap());
                assert_eq!((a.len(), &a.labels.instance), (b.len(), &b.labels.instance));
                for info in FIELDS.iter().filter(|info| info.name != "material_id") {
                    assert!(a.column(info.field).bytes() == b.column(info.field).bytes(), "{}, seed {seed}", info.name);
                }
            }
        }
        assert!(scan(&live.commit().unwrap()).len() > 100);
    }
}

#[test]
fn a_built_scene_never_changes() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let car = live.add(Object::new("car", ball()).world_from_object(at(5.0, 0.0, 0.0))).unwrap();
    let house = live.add_fixed(Object::new("house", ball()).world_from_object(at(9.0, 4.0, 0.0))).unwrap();
    let first = live.commit().unwrap();
    let before = scan(&first);
    live.set_pose(car, at(7.0, 0.0, 0.0)).unwrap();
    live.set_pose(house, at(7.0, 7.0, 0.0)).unwrap();
    live.set_labels(car, 3, 9, &[4]).unwrap();
    let second = live.commit().unwrap();
    let moved = scan(&second);
    let positions = ball().parts[0].positions.iter().map(|p| p.map(|x| 2.0 * x)).collect::<Vec<_>>();
    live.set_vertices(car, positions.into(), None).unwrap();
    live.remove(house).unwrap();
    let third = live.commit().unwrap();
    drop(live);
    assert_same(&before, &scan(&first));
    assert_same(&moved, &scan(&second));
    assert!(close(ahead(&first), 4.0) && close(ahead(&second), 6.0) && close(ahead(&third), 5.0));
    assert_eq!(before.labels.instance.names(), [""; 0], "an object without a number has no row in the table of names");
    assert_eq!(moved.labels.instance.name(9), Some("car"));
}

#[test]
fn ids_of_objects_that_are_gone_are_found_out() {
    let engine = Engine::new().unwrap();
    let mut live = LiveScene::new(&engine);
    let first = live.add(Object::new("first", ball())).unwrap();
    live.remove(first).unwrap();
    let second = live.add(Object::new("second", ball())).unwrap();
    assert_ne!(first.to_u64(), second.to_u64());
    assert_ne!(first.to_u64(), 0);
    assert_eq!(ObjectId::from_u64(second.to_u64()), second);
    for stale in [first, ObjectId::from_u64(0), ObjectId::from_u64(u64::MAX), ObjectId::from_u64(1 << 32 | 7)] {
        let errors = [
            live.set_pose(stale, DAffine3::IDENTITY),
            live.remove(stale),
            live.set_labels(stale, 1, 1, &[1]),
            live.set_mask(stale, 1),
            live.set_material(stale, None),
            live.set_vertices(stale, Vec::new().into(), None),
            live.object(stale).map(drop),
        ];
        for error in errors {
            let text = error.unwrap_err().to_string();
            assert!(text.contains("objects of this scene that have not been removed"), "{text}");
        }
    }
    assert_eq!(live.object(second).unwrap().name, "second");
    assert_eq!(live.find("second").unwrap(), second);
    let error = live.find("secund").unwrap_err().to_string();
    assert_eq!(error, "there is no object named \"secund\"; near: second");
}

#[test]
fn what_is_wrong_is_refused_and_changes_nothing() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let car = live.add(Object::new("car", ball()).world_from_object(at(5.0, 0.0, 0.0))).unwrap();
    let text = |error: echocast::Error| error.to_string();
    for pose in [at(f64::NAN, 0.0, 0.0), at(f64::INFINITY, 0.0, 0.0), at(2e18, 0.0, 0.0)] {
        assert!(text(live.set_pose(car, pose).unwrap_err()).starts_with("pose of object \"car\" is "));
        assert!(live.add(Object::new("far", ball()).world_from_object(pose)).is_err());
    }
    let error = live.set_labels(car, 1, 1, &[]).unwrap_err();
    assert_eq!(text(error), "part numbers is 0; allowed: one for each part of the mesh, 1");
    let error = live.set_vertices(car, vec![[0.0; 3]; 4].into(), None).unwrap_err();
    assert!(text(error).starts_with("positions is 4; allowed: as many as before, "));
    let mut positions = ball().parts[0].positions.to_vec();
    positions[3][1] = f32::NAN;
    let error = live.set_vertices(car, positions.into(), None).unwrap_err();
    assert!(text(error).starts_with("part 0: vertex 3 is ["));
    assert!(live.set_origin(DVec3::NAN).is_err());
    assert_eq!(
        text(live.name_label("category", 0, "none").unwrap_err()),
        "number is 0; allowed: 1 to 4294967295: 0 means unlabelled"
    );
    assert_eq!(
        text(live.name_label("colour", 1, "red").unwrap_err()),
        "table is \"colour\"; allowed: category, part, instance"
    );
    assert!(close(ahead(&live.commit().unwrap()), 4.0));

    let part = |positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>| {
        Part::default().positions(positions.into()).triangles(triangles.into())
    };
    let corners = || vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (parts, expected) in [
        (vec![], "parts is none; allowed: at least one"),
        (vec![part(corners(), vec![])], "part 0: triangles is none; allowed: at least one"),
        (
            vec![part(corners(), vec![[0, 1, 2]]), part(corners(), vec![[0, 1, 3]])],
            "part 1: index is 3; allowed: below the number of vertices, 3",
        ),
        (
            vec![part(corners(), vec![[0, 1, 2]]).normals(Some(vec![[0.0; 3]].into()))],
            "part 0: normals is 1 elements long; allowed: as many as vertices, 3",
        ),
    ] {
        assert_eq!(text(Mesh::new("bad", parts).unwrap_err()), expected);
    }
}

#[test]
fn masks_and_materials_belong_to_objects() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let shape = ball();
    let near = Object::new("near", shape.clone()).world_from_object(at(3.0, 0.0, 0.0)).mask(0b01);
    let far = Object::new("far", shape).world_from_object(at(9.0, 0.0, 0.0)).mask(0b10);
    let (near, _) = (live.add(near).unwrap(), live.add_fixed(far).unwrap());
    let built = live.commit().unwrap();
    let seen = |scene: &BuiltScene, mask: u32| {
        let options = ScanOptions::default().mask(mask);
        let cloud = scene.scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
        cloud.columns().range().iter().copied().fold(f32::INFINITY, f32::min).round()
    };
    assert_eq!([0b01, 0b10, 0b11, u32::MAX, 0b100].map(|mask| seen(&built, mask)), [2.0, 8.0, 2.0, 2.0, f32::INFINITY]);
    live.set_mask(near, 0b100).unwrap();
    assert_eq!([0b01, 0b10, 0b100].map(|mask| seen(&live.commit().unwrap(), mask)), [f32::INFINITY, 8.0, 2.0]);

    live.set_mask(near, u32::MAX).unwrap();
    let brightest = |live: &mut LiveScene| {
        let cloud = scan(&live.commit().unwrap());
        let names = cloud.columns().material_id().iter().map(|&id| cloud.labels.material.name(id).unwrap().to_owned());
        (cloud.columns().intensity().iter().copied().fold(0.0, f32::max), names.max().unwrap())
    };
    let (before, _) = brightest(&mut live);
    assert!((before - 0.5).abs() < 0.01, "{before}");
    live.set_material(near, Some(Arc::new(Material::default().name("zinc").reflectance(Reflectance::Constant(0.9)))))
        .unwrap();
    let (after, name) = brightest(&mut live);
    assert!((after - 0.9).abs() < 0.01, "{after}");
    assert_eq!(name, "zinc");
    live.set_material(near, None).unwrap();
    assert_eq!(brightest(&mut live).0, before);
}

#[test]
fn scenes_of_files_join_with_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, material: &str, x: f64| {
        let path = folder.path().join(format!("{name}.obj"));
        let text = format!("o {name}\nv {x} -1 -1\nv {x} 1 -1\nv {x} 0 1\nusemtl {material}\nf 1 2 3\n");
        std::fs::write(&path, text).unwrap();
        Scene::load(path).unwrap()
    };
    let engine = Engine::new().unwrap();
    let mut live = LiveScene::new(&engine);
    live.name_label("category", 1, "car").unwrap();
    let walls = live.add_scene(&file("wall", "brick", 8.0)).unwrap();
    let doors = live.add_scene(&file("door", "brick", 4.0)).unwrap();
    let again = live.add_scene(&file("wall", "stone", 6.0)).unwrap();
    let object = |id: ObjectId| live.object(id).unwrap();
    // 1 was taken; names keep their numbers; instances count on.
    assert_eq!([walls[0], doors[0], again[0]].map(|id| object(id).category_id), [2, 3, 2]);
    assert_eq!([walls[0], doors[0], again[0]].map(|id| object(id).instance_id), [1, 2, 3]);
    assert_eq!([walls[0], doors[0], again[0]].map(|id| object(id).part_ids[0]), [1, 1, 2]);
    let cloud = scan(&live.commit().unwrap());
    let names =
        |table: &echocast::scene::NameTable| table.iter().map(|(id, name)| format!("{id} {name}")).collect::<Vec<_>>();
    assert_eq!(names(&cloud.labels.category), ["1 car", "2 wall", "3 door"]);
    assert_eq!(names(&cloud.labels.part), ["1 brick", "2 stone"]);
    assert_eq!(names(&cloud.labels.material), ["1 brick", "2 stone"]);
    assert_eq!(names(&cloud.labels.instance), ["1 wall", "2 door", "3 wall"]);
    assert!(close(ahead(&live.commit().unwrap()), 4.0));
    live.remove(doors[0]).unwrap();
    assert!(close(ahead(&live.commit().unwrap()), 6.0));
    // A fixed object that moves is free from then on.
    live.set_pose(walls[0], at(5.0, 0.0, 0.0)).unwrap();
    assert!(close(ahead(&live.commit().unwrap()), 5.0));
    assert!(live.camera("eye").unwrap_err().to_string().starts_with("there is no camera node named \"eye\""));
}

#[test]
fn numbers_of_instances_are_not_given_twice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wall.obj");
    std::fs::write(&path, "o wall\nv 8 -1 -1\nv 8 1 -1\nv 8 0 1\nf 1 2 3\n").unwrap();
    let file = Scene::load(path).unwrap();
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.name_label("instance", 5, "my car").unwrap();
    let numbered = |name: &str, instance_id| Object::new(name, ball()).instance_id(instance_id);
    let car = live.add(numbered("", 5)).unwrap();
    let other = live.add(numbered("other", 5)).unwrap();
    let wall = live.add_scene(&file).unwrap()[0];
    assert_eq!(live.object(wall).unwrap().instance_id, 6);
    let names = |live: &mut LiveScene| {
        let labels = live.commit().unwrap().labels().instance.clone();
        labels.iter().map(|(id, name)| format!("{id} {name}")).collect::<Vec<_>>()
    };
    assert_eq!(names(&mut live), ["5 my car", "6 wall"]);
    live.set_labels(car, 0, 9, &[0]).unwrap();
    live.set_labels(car, 0, 5, &[0]).unwrap();
    assert_eq!(names(&mut live), ["5 my car", "6 wall"], "what has no name names nothing");
    live.remove(car).unwrap();
    assert_eq!(names(&mut live), ["5 my car", "6 wall"], "another one has the number");
    live.remove(other).unwrap();
    assert_eq!(names(&mut live), ["6 wall"]);
    live.add(numbered("last", u32::MAX)).unwrap();
    let error = live.add_scene(&file).unwrap_err().to_string();
    assert!(error.starts_with("the greatest instance number is 4294967295;"), "{error}");
    assert_eq!(live.objects().count(), 2);
}

#[test]
fn the_origin_is_chosen_once_there_is_something() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.commit().unwrap();
    live.add(Object::new("ball", ball()).world_from_object(at(7000.0, 0.0, 0.0))).unwrap();
    assert_eq!(live.commit().unwrap().origin().x, 7000.0);
}

#[test]
fn far_scenes_are_relative_to_an_origin_near_them() {
    let (x, y) = (500_000.0, 5_600_000.0);
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let wall = Shape::cuboid(DVec3::new(0.0, -2.0, -2.0), DVec3::new(1.0, 2.0, 2.0));
    let wall = Object::new("wall", mesh(wall, None)).world_from_object(at(x + 5.0, y, 0.0));
    let wall = live.add(wall).unwrap();
    let from = |scene: &BuiltScene, x: f64| {
        let pose = Trajectory::fixed(Pose::at(x, y, 0.0));
        let cloud = scene.scan(&sensor(), &pose, &ScanOptions::default()).unwrap();
        (0..cloud.len()).map(|row| cloud.position(row).x).fold(f64::INFINITY, f64::min)
    };
    let built = live.commit().unwrap();
    assert_eq!(built.origin().y, y);
    assert!((from(&built, x) - (x + 5.0)).abs() < 1e-4);
    // The origin stays where it is; what goes too far is reported.
    live.set_pose(wall, at(x + 20_005.0, y, 0.0)).unwrap();
    let moved = live.commit().unwrap();
    assert_eq!(moved.origin(), built.origin());
    let [warning] = &moved.report().warnings[..] else { panic!("one warning") };
    assert!(warning.starts_with("object \"wall\" reaches 20 km from the scene's origin"), "{warning}");
    assert!((from(&moved, x + 20_000.0) - (x + 20_005.0)).abs() < 4e-3);
    live.set_origin(DVec3::new(x + 20_000.0, y, 0.0)).unwrap();
    let near = live.commit().unwrap();
    assert!((from(&near, x + 20_000.0) - (x + 20_005.0)).abs() < 1e-4 && near.report().warnings.is_empty());
}

#[test]
fn absurd_numbers_of_threads_are_refused() {
    let error = Engine::with_threads(100_000).unwrap_err().to_string();
    assert_eq!(error, "threads is 100000; allowed: 0 to 1024");
}

/// Scans from threads of another pool, and nested work, never wait in vain.
#[test]
fn scans_of_many_threads_follow_each_other() {
    for engine in [Engine::new().unwrap(), Engine::with_threads(2).unwrap(), Engine::with_threads(1).unwrap()] {
        let mut live = LiveScene::new(&engine);
        live.add(Object::new("ball", ball()).world_from_object(at(5.0, 0.0, 0.0))).unwrap();
        let built = live.commit().unwrap();
        let expected = scan(&built);
        engine.install(|| engine.install(|| assert_same(&expected, &scan(&built))));
        std::thread::scope(|scope| {
            for _ in 0..48 {
                scope.spawn(|| assert_same(&expected, &scan(&built)));
            }
        });
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        pool.install(|| (0..1000).into_par_iter().for_each(|_| assert_same(&expected, &scan(&built))));
        (0..1000).into_par_iter().for_each(|_| assert_same(&expected, &scan(&built)));
    }
}

/// Eight threads scan one scene while a ninth edits and commits.
#[test]
fn scans_and_edits_run_beside_each_other() {
    let engine = Engine::with_threads(2).unwrap();
    let mut live = LiveScene::new(&engine);
    let shape = ball();
    let ids: Vec<ObjectId> = (0..20)
        .map(|i| {
            let angle = f64::from(i) / 20.0 * std::f64::consts::TAU;
            let pose = DAffine3::from_rotation_translation(
                DQuat::from_rotation_z(angle),
                DVec3::new(6.0 * angle.cos(), 6.0 * angle.sin(), 0.0),
            );
            live.add(Object::new(format!("ball {i}"), shape.clone()).world_from_object(pose)).unwrap()
        })
        .collect();
    let built = live.commit().unwrap();
    let expected = scan(&built);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let scanners: Vec<_> = (0..8)
            .map(|_| {
                scope.spawn(|| {
                    for _ in 0..30 {
                        assert_same(&expected, &scan(&built));
                    }
                })
            })
            .collect();
        scope.spawn(|| {
            let mut turn = 0;
            while !done.load(Ordering::Relaxed) {
                turn += 1;
                for (i, &id) in ids.iter().enumerate() {
                    live.set_pose(id, at(5.0 + (turn % 7) as f64, i as f64 - 10.0, 0.0)).unwrap();
                }
                assert!(scan(&live.commit().unwrap()).len() > 100);
            }
        });
        for scanner in scanners {
            scanner.join().unwrap();
        }
        done.store(true, Ordering::Relaxed);
    });
}

/// Corners of a ball whose centre is at `x`.
fn ball_at(x: f32) -> Array<[f32; 3]> {
    let corners = Shape::sphere(1.0, 16).positions;
    corners.into_iter().map(|[from, y, z]| [from + x, y, z]).collect::<Vec<_>>().into()
}

/// Lowest and highest value of a column.
fn ends(column: &[f32]) -> [f32; 2] {
    column.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

#[test]
fn vertices_move_while_they_are_scanned() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let object = live.add(Object::new("ball", ball())).unwrap();
    let options = ScanOptions::default().frame_period(0.5);
    let motion = |live: &mut LiveScene, start: f64| {
        live.set_time(start, 0.1).unwrap();
        let options = options.clone().start_time(start).fields(FieldSet::all());
        live.commit().unwrap().scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap().into_columns()
    };
    // Twice: the second time begins where the first ended, with other vertices.
    for (start, speed) in [(0.0, 2.0), (1.0, -3.0)] {
        let keys = [start, start + 1.0].map(|time| (time, ball_at(5.0 + ((time - start) * speed) as f32)));
        live.set_vertex_motion(object, &keys).unwrap();
        live.set_time(start + 0.25, 0.0).unwrap();
        assert!(close(ahead(&live.commit().unwrap()), (4.0 + 0.25 * speed) as f32));
        let columns = motion(&mut live, start + 0.25);
        for (column, expected) in [(columns.velocity_x(), speed), (columns.flow_x(), 0.5 * speed)] {
            assert!(ends(column).iter().all(|value| (value - expected as f32).abs() < 1e-4), "{:?}", ends(column));
        }
        assert!(ends(columns.velocity_y()).iter().all(|value| value.abs() < 1e-4));
        // It has stopped, at its last key.
        let columns = motion(&mut live, start + 2.0);
        assert_eq!((ends(columns.velocity_x()), ends(columns.flow_x())), ([0.0; 2], [0.0; 2]));
    }
    // Elsewhere its vertices go on to move, and on its way too.
    live.set_pose(object, at(10.0, 0.0, 0.0)).unwrap();
    live.set_time(1.25, 0.0).unwrap();
    assert!(close(ahead(&live.commit().unwrap()), 14.0 - 0.75));
    live.set_motion(object, &[(0.0, at(0.0, 0.0, 0.0)), (2.0, at(0.0, 2.0, 0.0))]).unwrap();
    let columns = motion(&mut live, 1.25);
    assert!(ends(columns.velocity_x()).iter().all(|value| (value + 3.0).abs() < 1e-4));
    assert!(ends(columns.velocity_y()).iter().all(|value| (value - 1.0).abs() < 1e-4));
    // What is wrong changes nothing.
    let keys = |times: &[f64]| times.iter().map(|&time| (time, ball_at(9.0))).collect::<Vec<_>>();
    let mut other = keys(&[0.0, 1.0]);
    other[1].1 = vec![[0.0; 3]; 3].into();
    let mut nowhere = keys(&[0.0]);
    nowhere[0].1 = nowhere[0].1.iter().map(|_| [f32::NAN; 3]).collect::<Vec<_>>().into();
    for (wrong, expected) in [
        (vec![], "keys"),
        (keys(&[0.0, 0.0]), "time of key 1"),
        (keys(&[f64::NAN]), "time of key 0"),
        (other, "positions of key 1"),
        (nowhere, "vertex 0 of key 0"),
    ] {
        let error = live.set_vertex_motion(object, &wrong).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert_eq!(motion(&mut live, 1.25).velocity_x(), columns.velocity_x());
}

#[test]
fn what_stands_now_may_flow() {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let objects = [0.0, 180.0_f64].map(|side| {
        let place = DVec3::new(8.0 * side.to_radians().cos(), 0.0, 0.0);
        let object = live.add(Object::new("ball", ball())).unwrap();
        (object, place)
    });
    for ((object, place), way) in objects.into_iter().zip([10.0, 0.0]) {
        let keys = [(0.0, 0.0), (1.0, 0.0), (2.0, way)].map(|(time, y)| (time, at(place.x, y, 0.0)));
        live.set_motion(object, &keys).unwrap();
    }
    live.set_time(0.85, 0.1).unwrap();
    let options = ScanOptions::default().start_time(0.85).frame_period(0.1).fields(FieldSet::all());
    let built = live.commit().unwrap();
    let columns = built.scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap().into_columns();
    for row in 0..columns.x().len() {
        let flow = [columns.flow_x()[row], columns.flow_y()[row], columns.flow_z()[row]];
        let expected =
            if columns.x()[row] > 0.0 { 10.0 * (columns.time()[row] + 0.1 - 1.0).max(0.0) as f32 } else { 0.0 };
        assert!((flow[1] - expected).abs() < 1e-4 && flow[0].abs() < 1e-5 && flow[2] == 0.0, "{flow:?} {expected}");
        assert_eq!(columns.velocity_y()[row], 0.0);
    }
}

/// Cubes ahead: a wall, one that drives away, through others and at last behind the wall, and some that come and go. The
/// nearest is seen, whatever moves and whatever is new.
#[test]
fn what_stands_and_what_moves_hide_each_other() {
    const WALL: u32 = 1;
    const MOVER: u32 = 2;
    let cube = || mesh(Shape::cuboid(-DVec3::ONE, DVec3::ONE), None);
    let shared = cube();
    let mut live = LiveScene::new(&Engine::with_threads(1).unwrap());
    live.add_fixed(Object::new("wall", cube()).world_from_object(at(30.0, 0.0, 0.0)).category_id(WALL)).unwrap();
    let mover = live.add(Object::new("mover", shared.clone()).category_id(MOVER)).unwrap();
    live.set_motion(mover, &[0.0, 10.0].map(|time| (time, at(4.1 + 4.0 * time, 0.0, 0.0)))).unwrap();
    let mut standing: Vec<(ObjectId, f64, u32)> = Vec::new();
    let mut seen = [0; 3];
    for step in 0..40 {
        let time = 0.25 * f64::from(step);
        match step % 4 {
            1 => {
                let (place, category) = (40.3 - f64::from(step), 10 + step as u32);
                let object = Object::new("cube", shared.clone()).category_id(category);
                let id = live.add(object.world_from_object(at(place, 0.0, 0.0))).unwrap();
                standing.push((id, place, category));
            }
            3 => {
                let (id, ..) = standing.remove(0);
                live.remove(id).unwrap();
            }
            _ => {}
        }
        for length in [0.0, 0.1] {
            live.set_time(time, length).unwrap();
            let options = ScanOptions::default().start_time(time).fields(FieldSet::all());
            let cloud = live.commit().unwrap().scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
            let columns = cloud.columns();
            // The beam that is the most nearly straight ahead.
            let off = |row: &usize| columns.y()[*row].hypot(columns.z()[*row]);
            let row = (0..cloud.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            let then = if length > 0.0 { columns.time()[row] } else { time };
            let all = standing.iter().map(|&(_, place, category)| (place, category));
            let all = all.chain([(30.0, WALL), (4.1 + 4.0 * then, MOVER)]);
            let (place, category) = all.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            assert!((f64::from(columns.x()[row]) - (place - 1.0)).abs() < 1e-3, "{} {place}", columns.x()[row]);
            assert_eq!(columns.category_id()[row], category, "{time} s");
            seen[category.min(3) as usize - 1] += 1;
        }
    }
    assert!(seen.iter().all(|count| *count >= 10), "{seen:?}");
}
