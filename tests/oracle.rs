//! The library compared with the oracle of `reference/`: random scenes, random rays, every column of every hit.

use echocast::material::{Alpha, Reflectance};
use echocast::scene::Material;
use echocast::{
    BuiltScene, Engine, FieldSet, Frame, LiveScene, PointCloud, Pose, ReflectanceSource, ScanOptions, Scene, Sensor,
    Trajectory,
};
use echocast_tests::reference::{Hit, Moving, Random, SceneBuilder, Shape, Tracer, beams, philox, raster, sensor};
use echocast_tests::run_at_other_levels;
use glam::{DAffine3, DQuat, DVec3};

/// Outcome of a comparison.
#[derive(Debug, Default)]
struct Tally {
    rays: usize,
    hits: usize,
    /// Rays of which the oracle itself is unsure.
    doubtful: usize,
    wrong: Vec<String>,
}

impl Tally {
    /// Checks that nothing was wrong, that `least_hits` of the rays hit something, and few were doubtful.
    fn check(&self, least_hits: f64) {
        let share = |count: usize| count as f64 / self.rays as f64;
        assert!(
            self.wrong.is_empty(),
            "{} of {} rays differ from the oracle:\n{}",
            self.wrong.len(),
            self.rays,
            self.wrong[..self.wrong.len().min(8)].join("\n")
        );
        assert!(share(self.hits) >= least_hits, "only {} of {} rays hit", self.hits, self.rays);
        assert!(share(self.doubtful) <= 0.01, "{} of {} rays are doubtful", self.doubtful, self.rays);
    }
}

fn options(coordinates: Frame) -> ScanOptions {
    // The oracle knows nothing of names and of the infrared.
    let reflectance_source = Some(ReflectanceSource::Luminance);
    ScanOptions::default()
        .fields(FieldSet::all())
        .organised(true)
        .coordinates(coordinates)
        .reflectance_source(reflectance_source)
}

/// Scans `scene` from `pose` along `directions` (sensor frame) and asks the oracle about each ray.
fn compare(scene: &Scene, pose: Pose, directions: &[DVec3]) -> Tally {
    compare_over_time(&scene.build().unwrap(), &[0.0], |_| scene.clone(), pose, directions, Slack::default())
}

/// What is not exact where things move.
#[derive(Clone, Copy, Default)]
struct Slack {
    /// How far things may be from where they should be, m.
    place: f64,
    /// What velocities may be off, m/s, and relative to their size.
    velocity: [f64; 2],
}

/// [`compare`] of a scene that moves, where one beam after another fires at the next of `times`, s, with what the scene
/// is at a time.
fn compare_over_time(
    built: &BuiltScene,
    times: &[f64],
    scene_at: impl Fn(f64) -> Scene,
    pose: Pose,
    directions: &[DVec3],
    slack: Slack,
) -> Tally {
    /// Between the times of which velocities are differences, s.
    const STEP_S: f64 = 4e-4;
    let mut beams = beams(directions);
    beams.time = (0..beams.len()).map(|beam| times[beam % times.len()]).collect();
    let sensor = Sensor::from_beams("test", beams).unwrap();
    let beams = sensor.beams();
    let path = Trajectory::fixed(pose);
    let world = built.scan(&sensor, &path, &options(Frame::World)).unwrap();
    let own = built.scan(&sensor, &path, &options(Frame::Sensor)).unwrap();
    assert_eq!((world.len(), own.len()), (directions.len(), directions.len()));

    let stills: Vec<[Scene; 3]> =
        times.iter().map(|time| [0.0, -0.5, 0.5].map(|steps| scene_at(time + steps * STEP_S))).collect();
    let tracer = |scene| Tracer::new(scene, built.origin()).within(slack.place);
    let tracers: Vec<_> = stills.iter().map(|scenes| scenes.each_ref().map(tracer)).collect();
    let mut tally = Tally { rays: directions.len(), ..Tally::default() };
    for beam in 0..beams.len() {
        let column = [&beams.dir_x, &beams.dir_y, &beams.dir_z];
        let direction = DVec3::from_array(column.map(|c| f64::from(c[beam]))).normalize();
        let along = pose.orientation * direction;
        let [tracer, before, after] = &tracers[beam % tracers.len()];
        let answer = tracer.trace(pose.position, along, f64::INFINITY);
        tally.doubtful += usize::from(!answer.is_sure());
        let range = f64::from(world.columns().true_range()[beam]);
        let labels = (world.columns().instance_id()[beam], world.columns().part_id()[beam]);
        let verdict = if range.is_nan() {
            let missed = answer.nearest.is_none() || slack.place > 0.0 && !answer.is_sure();
            if missed { check_miss(&world, beam) } else { Err("misses".into()) }
        } else {
            tally.hits += 1;
            // Among equally good answers, one must be right in everything.
            let matching = answer.candidates().filter(|hit| {
                let surface = tracer.surface(hit);
                (surface.instance_id, surface.part_id) == labels && (hit.range - range).abs() <= hit.range_tolerance
            });
            let mut verdict = Err(format!("hits object and part {labels:?} at {range} m"));
            for hit in matching {
                let velocity = (after.place(hit) - before.place(hit)) / STEP_S;
                verdict = verdict.or_else(|_| {
                    check_velocity(&world, beam, velocity, slack.velocity)?;
                    check_hit(tracer, hit, pose, direction, [&world, &own], beam)
                });
            }
            verdict
        };
        if let Err(what) = verdict {
            let of = |hit: &Hit| format!("{:?} at {} +- {:.1e} m", tracer.address(hit), hit.range, hit.range_tolerance);
            let near: Vec<String> = answer.candidates().map(of).collect();
            tally.wrong.push(format!("beam {beam}: {what}; oracle: {}", near.join(", ")));
        }
    }
    tally
}

/// The columns of how a hit moves, in front of a sensor that stands.
fn check_velocity(cloud: &PointCloud, row: usize, velocity: DVec3, [least, part]: [f64; 2]) -> Result<(), String> {
    let c = cloud.columns();
    let found = DVec3::new(c.velocity_x()[row].into(), c.velocity_y()[row].into(), c.velocity_z()[row].into());
    let tolerance = least + part * velocity.length();
    // Written so that NaN fails too.
    if (found - velocity).length() <= tolerance {
        return Ok(());
    }
    Err(format!("velocity is {found}, not {velocity} +- {tolerance:.1e}"))
}

/// What the columns hold for a beam without a return.
fn check_miss(cloud: &PointCloud, row: usize) -> Result<(), String> {
    let c = cloud.columns();
    let floats =
        [c.x(), c.y(), c.z(), c.range(), c.intensity(), c.normal_x(), c.normal_y(), c.normal_z(), c.cos_incidence()]
            .into_iter()
            .chain([c.depth(), c.true_x(), c.true_y(), c.true_z(), c.true_range()]);
    if let Some(number) = floats.map(|column| column[row]).find(|value| !value.is_nan()) {
        return Err(format!("is a miss that holds {number}"));
    }
    let labels = [c.category_id()[row], c.part_id()[row], c.instance_id()[row], c.material_id()[row]];
    let bytes = [c.return_number()[row], c.return_count()[row], c.red()[row], c.green()[row], c.blue()[row]];
    if labels != [0; 4] || bytes != [0; 5] || c.beam()[row] != row as u32 {
        return Err(format!("is a miss with labels {labels:?}, bytes {bytes:?}, beam {}", c.beam()[row]));
    }
    Ok(())
}

/// Every column of a hit that the oracle confirms.
fn check_hit(
    tracer: &Tracer,
    hit: &Hit,
    pose: Pose,
    direction: DVec3,
    [world, own]: [&PointCloud; 2],
    row: usize,
) -> Result<(), String> {
    let near = |what: &str, is: f64, expected: f64, tolerance: f64| {
        // Written so that NaN fails too.
        if (is - expected).abs() <= tolerance {
            Ok(())
        } else {
            Err(format!("{what} is {is}, not {expected} +- {tolerance:.1e}"))
        }
    };
    let near3 = |what: &str, is: DVec3, expected: DVec3, tolerance: f64| {
        let off = (is - expected).length();
        if off <= tolerance { Ok(()) } else { Err(format!("{what} is {is}, not {expected} +- {tolerance:.1e}")) }
    };
    let vector = |x: &[f32], y: &[f32], z: &[f32]| DVec3::new(x[row].into(), y[row].into(), z[row].into());
    let (c, s) = (world.columns(), own.columns());
    let surface = tracer.surface(hit);
    let along = pose.orientation * direction;

    let tolerance = hit.range_tolerance;
    near("range", c.range()[row].into(), hit.range, tolerance)?;
    near3("position", world.position(row), pose.position + hit.range * along, 2.0 * tolerance)?;
    near3("true position", world.origin + vector(c.true_x(), c.true_y(), c.true_z()), world.position(row), 0.0)?;
    near3("position in the sensor frame", own.position(row), hit.range * direction, tolerance)?;
    near("depth", c.depth()[row].into(), hit.range * direction.x, tolerance)?;
    near("azimuth", c.azimuth()[row].into(), direction.y.atan2(direction.x), 5e-7)?;
    near("elevation", c.elevation()[row].into(), direction.z.asin(), 5e-7)?;

    // The triangle determines on which side of the surface the sensor is.
    let facing = surface.geometric_normal * -surface.geometric_normal.dot(along).signum();
    let tolerance = surface.normal_tolerance + 1e-6;
    let is = vector(c.normal_x(), c.normal_y(), c.normal_z());
    near("length of the normal", is.length(), 1.0, 1e-6)?;
    // Seen edge-on, either side may be the sensor's.
    let either = facing.dot(along).abs().min(surface.normal.dot(facing).abs()) <= tolerance;
    let turned = surface.normal * surface.normal.dot(if either { is } else { facing }).signum();
    // At least half as much of it is seen as of the triangle; of what is less, or turned away, something.
    let (half, cos) = (-0.5 * facing.dot(along), -turned.dot(along));
    let bends = half - cos > -2.0 * tolerance;
    let tolerance = if bends { 4.0 * tolerance } else { tolerance };
    let (turned, cos) = if cos < half {
        let bent = half * half / (half + (half - cos));
        let sideways = (turned + cos * along).normalize();
        (sideways * (1.0 - bent * bent).sqrt() - bent * along, bent)
    } else {
        (turned, cos)
    };
    near3("normal", is, turned, tolerance)?;
    near3("normal in the sensor frame", pose.orientation * vector(s.normal_x(), s.normal_y(), s.normal_z()), is, 1e-6)?;
    near("cosine", c.cos_incidence()[row].into(), cos, tolerance)?;

    let white = Material::default();
    let material = surface.material.unwrap_or(&white);
    let [red, green, blue, _] = material.base_color.map(f64::from);
    let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    let reflectance = material.reflectance.as_ref().map_or(luminance, |own| own.at(905.0).into());
    near("intensity", c.intensity()[row].into(), reflectance * cos, reflectance * tolerance + 1e-6)?;
    for (what, is, linear) in
        [("red", c.red()[row], red), ("green", c.green()[row], green), ("blue", c.blue()[row], blue)]
    {
        let encoded = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
        near(what, is.into(), 255.0 * encoded, 0.5001)?;
    }

    let material_id = surface.material.map_or(0, |material| world.labels.material.id(&material.name));
    let labels = [c.category_id()[row], c.part_id()[row], c.instance_id()[row], c.material_id()[row]];
    let expected = [surface.category_id, surface.part_id, surface.instance_id, material_id];
    let bytes = [c.return_number()[row], c.return_count()[row], c.cause()[row], c.bounces()[row]];
    if labels != expected || bytes != [1, 1, 0, 0] || c.beam()[row] != row as u32 {
        return Err(format!("labels {labels:?} are not {expected:?}, or bytes {bytes:?} or beam {}", c.beam()[row]));
    }
    Ok(())
}

/// Half of `count` directions (sensor frame) at random, half at random points of the scene's triangles.
fn random_rays(random: &mut Random, scene: &Scene, pose: Pose, count: usize) -> Vec<DVec3> {
    let tracer = Tracer::new(scene, DVec3::ZERO);
    (0..count)
        .map(|ray| {
            if ray % 2 == 0 {
                return random.direction();
            }
            let (u, v) = (random.unit(), random.unit());
            let weights = if u + v < 1.0 { [1.0 - u - v, u, v] } else { [u + v - 1.0, 1.0 - u, 1.0 - v] };
            let target = tracer.point(random.below(tracer.len()), weights);
            pose.orientation.inverse() * (target - pose.position).normalize()
        })
        .collect()
}

/// A random place within `half` of `centre`, from which x points to one of the scene's triangles.
fn random_pose(random: &mut Random, scene: &Scene, centre: DVec3, half: f64) -> Pose {
    let tracer = Tracer::new(scene, centre);
    let position = centre + random.in_cube(half);
    let ahead = (tracer.centre(random.below(tracer.len())) - position).normalize();
    let roll = DQuat::from_rotation_x(random.between(0.0, std::f64::consts::TAU));
    Pose { position, orientation: DQuat::from_rotation_arc(DVec3::X, ahead) * roll }
}

fn random_material(random: &mut Random, name: &str) -> Material {
    let reflectance = (random.unit() < 0.5).then(|| Reflectance::Constant(random.unit() as f32));
    let base_color = std::array::from_fn(|_| random.unit() as f32);
    Material::default().name(name.to_owned()).reflectance(reflectance).base_color(base_color)
}

/// `count` triangles with corners within `size` of places within `half` of 0.
fn random_triangles(random: &mut Random, count: usize, half: f64, size: f64) -> Vec<Shape> {
    (0..count)
        .map(|_| {
            let place = random.in_cube(half);
            Shape::triangle([place + random.in_cube(size), place + random.in_cube(size), place + random.in_cube(size)])
        })
        .collect()
}

/// Each triangle is a part of its own, so that the part number is the triangle's.
#[test]
fn triangle_soups_are_hit_as_the_oracle_says() {
    for seed in 0..4 {
        let random = &mut Random::new(seed);
        let mut scene = SceneBuilder::new();
        let materials: Vec<usize> =
            (0..5).map(|index| scene.material(random_material(random, &format!("paint {index}")))).collect();
        // From many small to few large triangles.
        let (count, size) = [(500, 1.0), (250, 3.0), (120, 8.0), (400, 0.3)][seed as usize];
        let soup = random_triangles(random, count, 10.0, size);
        let parts: Vec<_> =
            soup.into_iter().enumerate().map(|(i, shape)| (shape, (i % 6 < 5).then(|| materials[i % 5]))).collect();
        let mesh = scene.mesh(parts);
        scene.place(mesh, DAffine3::from_rotation_translation(random.rotation(), random.in_cube(3.0)));
        let scene = scene.finish();
        let pose = random_pose(random, &scene, DVec3::ZERO, 8.0);
        compare(&scene, pose, &random_rays(random, &scene, pose, 20_000)).check(0.5);
        // Close neighbours: coherent packets.
        compare(&scene, pose, &raster(100, 100, 1.2)).check(0.01);
    }
}

/// Objects that share a mesh are instances; instance and part number together are the triangle's.
#[test]
fn scaled_sheared_and_mirrored_instances_are_hit_as_the_oracle_says() {
    for seed in 10..14 {
        let random = &mut Random::new(seed);
        let mut scene = SceneBuilder::new();
        let paint = scene.material(random_material(random, "paint"));
        for _ in 0..2 {
            let soup = random_triangles(random, 20, 1.5, 1.5);
            let mesh = scene.mesh(soup.into_iter().map(|shape| (shape, Some(paint))));
            for _ in 0..8 {
                scene.place(mesh, DAffine3::from_mat3_translation(random.linear_map(), random.in_cube(9.0)));
            }
        }
        let scene = scene.finish();
        let pose = random_pose(random, &scene, DVec3::ZERO, 12.0);
        compare(&scene, pose, &random_rays(random, &scene, pose, 20_000)).check(0.5);
        compare(&scene, pose, &raster(100, 100, 1.2)).check(0.01);
    }
}

/// Boxes, flat and smooth spheres; meshes of several parts and materials; each once and many times.
#[test]
fn smooth_and_flat_solids_are_hit_as_the_oracle_says() {
    for seed in 20..24 {
        let random = &mut Random::new(seed);
        let mut scene = SceneBuilder::new();
        let paints: Vec<usize> =
            (0..4).map(|index| scene.material(random_material(random, &format!("paint {index}")))).collect();
        let cuboid = |random: &mut Random| {
            let low = random.in_cube(1.0);
            Shape::cuboid(low, low + DVec3::splat(1.1) + random.in_cube(1.0))
        };
        for copies in [1, 1, 6] {
            let box_mesh = cuboid(random);
            let ball = Shape::sphere(random.between(0.5, 1.5), 5);
            let mesh = scene.mesh([
                (box_mesh, Some(paints[0])),
                (ball, Some(paints[1])),
                (Shape::sphere(random.between(0.5, 1.5), 4).flat(), None),
                (cuboid(random), Some(paints[3])),
            ]);
            for _ in 0..copies {
                scene.place(mesh, DAffine3::from_mat3_translation(random.linear_map(), random.in_cube(8.0)));
            }
        }
        let scene = scene.finish();
        let pose = random_pose(random, &scene, DVec3::ZERO, 10.0);
        compare(&scene, pose, &random_rays(random, &scene, pose, 15_000)).check(0.5);
        compare(&scene, pose, &raster(80, 80, 1.5)).check(0.01);
    }
}

/// Every beam at a time of its own: objects that turn, fly and grow, each on a path of keys, among some that stay.
#[test]
fn what_moves_is_hit_as_the_oracle_says() {
    for seed in 60..64 {
        let random = &mut Random::new(seed);
        let mut scene = SceneBuilder::new();
        let paints: Vec<usize> =
            (0..3).map(|index| scene.material(random_material(random, &format!("paint {index}")))).collect();
        for paint in paints {
            let mesh = scene.mesh([
                (Shape::sphere(random.between(0.5, 1.5), 5), Some(paint)),
                (Shape::cuboid(-DVec3::splat(random.between(0.2, 1.2)), DVec3::splat(1.0)), None),
            ]);
            for _ in 0..3 {
                scene.place(mesh, DAffine3::from_rotation_translation(random.rotation(), random.in_cube(8.0)));
            }
        }
        let scene = scene.finish();
        // From a walk to a rotor.
        let (speed, turn) = [(1.5, 1.0), (30.0, 3.0), (5.0, 100.0), (300.0, 0.1)][(seed - 60) as usize];
        let paths: Vec<Option<[(f64, DAffine3); 4]>> = scene
            .objects
            .iter()
            .enumerate()
            .map(|(index, object)| {
                let (from, axis) = (object.world_from_object, random.direction());
                let keys = [0.0, 0.031, 0.07, 0.12].map(|time| {
                    let growth = DVec3::ONE + random.in_cube(0.3);
                    let turn = DQuat::from_axis_angle(axis, turn * time);
                    let place = from.translation + random.in_cube(speed * time);
                    let own = DQuat::from_mat3(&from.matrix3);
                    (time, DAffine3::from_scale_rotation_translation(growth, turn * own, place))
                });
                (index % 3 > 0).then_some(keys)
            })
            .collect();
        let mut live = LiveScene::new(&Engine::new().unwrap());
        let objects = live.add_scene(&scene).unwrap();
        for (object, path) in objects.iter().zip(&paths) {
            path.iter().for_each(|keys| live.set_motion(*object, keys).unwrap());
        }
        live.set_time(0.0, 0.1).unwrap();
        let scene_at = |time: f64| {
            let mut still = scene.clone();
            for (object, path) in still.objects.iter_mut().zip(&paths) {
                if let Some(keys) = path {
                    object.world_from_object = between(keys, time);
                }
            }
            still
        };
        let slack = Slack { place: 1.1e-4, velocity: [1e-3, 2e-3] };
        let pose = random_pose(random, &scene, DVec3::ZERO, 10.0);
        let built = live.commit().unwrap();
        for directions in [random_rays(random, &scene, pose, 15_000), raster(100, 100, 1.5)] {
            compare_over_time(&built, &sixteen_times(), scene_at, pose, &directions, slack).check(0.01);
        }
    }
}

/// In the first 0.1 s, apart from the keys and the samples of the moving scenes.
fn sixteen_times() -> Vec<f64> {
    (0..16).map(|k| 0.0015 + 0.0063 * f64::from(k)).collect()
}

/// The same for what changes its shape: skins, morph targets and caches, and for what turns beside them.
#[test]
fn what_changes_its_shape_is_hit_as_the_oracle_says() {
    let folder = tempfile::tempdir().unwrap();
    for (seed, tolerance, velocity) in [(70, 2e-5, 0.06), (71, 2e-5, 0.06), (72, 1e-4, 0.15)] {
        let random = &mut Random::new(seed);
        let moving = Moving::random(random);
        let scene = moving.load(folder.path());
        let mut live = LiveScene::new(&Engine::new().unwrap());
        live.add_scene(&scene).unwrap();
        live.set_motion_tolerance(tolerance).unwrap();
        live.set_time(0.0, 0.1).unwrap();
        let built = live.commit().unwrap();
        let slack = Slack { place: tolerance.max(1.1e-4), velocity: [velocity, 2e-3] };
        let first = moving.still(&scene, 0.05);
        let pose = random_pose(random, &first, DVec3::ZERO, 10.0);
        let scene_at = |time: f64| moving.still(&scene, time);
        for directions in [random_rays(random, &first, pose, 15_000), raster(100, 100, 1.5)] {
            compare_over_time(&built, &sixteen_times(), scene_at, pose, &directions, slack).check(0.02);
        }
    }
}

/// Straight and uniformly turning between keys, computed plainly.
fn between(keys: &[(f64, DAffine3)], time: f64) -> DAffine3 {
    let after = keys.iter().position(|(key, _)| *key > time).unwrap();
    let [(t0, a), (t1, b)] = [keys[after - 1], keys[after]];
    let part = (time - t0) / (t1 - t0);
    let [(scale_a, turn_a, place_a), (scale_b, turn_b, place_b)] = [a, b].map(|m| m.to_scale_rotation_translation());
    let turn = turn_a.slerp(turn_b, part);
    DAffine3::from_scale_rotation_translation(scale_a.lerp(scale_b, part), turn, place_a.lerp(place_b, part))
}

/// Sheets one behind the other that cover a part of where they are: each ray passes by a draw of its own beam, direction
/// and triangle, the same that the oracle makes.
#[test]
fn sheets_are_passed_by_the_rays_that_the_oracle_draws() {
    /// Number of these draws, and their seed and frame.
    const COVERAGE: u32 = 9;
    const SEED: u64 = 0x1234_5678_9abc;
    const FRAME: u32 = 3;
    let random = &mut Random::new(80);
    let mut scene = SceneBuilder::new();
    let opacities = [0.3f32, 0.7, 0.05, 0.9, 1.0];
    for (number, &opacity) in opacities.iter().enumerate() {
        let base_color = [0.5, 0.5, 0.5, opacity];
        let paint = Material::default().name(format!("veil {number}")).base_color(base_color).alpha(Alpha::Coverage);
        let paint = scene.material(paint);
        let centre = DVec3::X * (4.0 + 2.0 * number as f64);
        scene.stand(Shape::plate(centre, -DVec3::X + random.in_cube(0.2), 30.0), Some(paint));
    }
    let scene = scene.finish();
    let directions: Vec<DVec3> =
        (0..6_000).map(|_| DVec3::new(1.0, random.between(-0.6, 0.6), random.between(-0.6, 0.6)).normalize()).collect();
    let sensor = sensor(&directions);
    let built = scene.build().unwrap();
    let options = options(Frame::World).seed(SEED).frame(FRAME);
    let cloud = built.scan(&sensor, &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
    let tracer = Tracer::new(&scene, built.origin());
    let (beams, mut met, mut wrong) = (sensor.beams(), [0; 5], 0);
    for beam in 0..directions.len() {
        let own = [beams.dir_x[beam], beams.dir_y[beam], beams.dir_z[beam]];
        // Every object has one part, which is a row.
        let passes = |[object, _, triangle]: [usize; 3]| {
            let words = [own[0].to_bits(), own[1].to_bits(), own[2].to_bits(), object as u32, triangle as u32];
            let mixed = words.into_iter().fold(0u32, |sum, word| {
                let mut h = sum ^ word;
                h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
                h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
                h ^ (h >> 16)
            });
            let draw = philox([beam as u32, FRAME, mixed, COVERAGE], [SEED as u32, (SEED >> 32) as u32]);
            draw >= f64::from(opacities[object])
        };
        let along = DVec3::from_array(own.map(f64::from));
        let answer = tracer.trace_past(DVec3::ZERO, along, f64::INFINITY, &passes);
        let range = f64::from(cloud.columns().true_range()[beam]);
        let agrees = answer.candidates().any(|hit| (hit.range - range).abs() <= hit.range_tolerance);
        wrong += usize::from(!agrees && answer.is_sure());
        if let Some(hit) = answer.nearest {
            met[tracer.address(&hit)[0]] += 1;
        }
    }
    assert_eq!(wrong, 0, "of {} rays", directions.len());
    // What each stops of what the ones before it let pass.
    let mut left = directions.len() as f64;
    for (&opacity, &count) in opacities.iter().zip(&met) {
        let (mean, part) = (left * f64::from(opacity), f64::from(opacity));
        assert!((f64::from(count) - mean).abs() <= 4.0 * (left * part * (1.0 - part)).sqrt(), "{opacity}: {met:?}");
        left -= f64::from(count);
    }
}

/// Far from the world's origin single precision is relative to the scene's own centre.
#[test]
fn survey_coordinates_are_hit_as_the_oracle_says() {
    let random = &mut Random::new(30);
    let survey = DVec3::new(500_000.0, 5_600_000.0, 100.0);
    let mut scene = SceneBuilder::new();
    let paint = scene.material(random_material(random, "paint"));
    let soup = random_triangles(random, 40, 4.0, 2.0);
    let mesh = scene.mesh(soup.into_iter().map(|shape| (shape, Some(paint))));
    for _ in 0..4 {
        let place = survey + random.in_cube(20.0);
        scene.place(mesh, DAffine3::from_mat3_translation(random.linear_map(), place));
    }
    let ball = Shape::sphere(2.0, 6);
    let mesh = scene.mesh([(ball, Some(paint))]);
    scene.place(mesh, DAffine3::from_mat3_translation(random.linear_map(), survey));
    let scene = scene.finish();
    let pose = random_pose(random, &scene, survey, 10.0);
    compare(&scene, pose, &random_rays(random, &scene, pose, 20_000)).check(0.5);
}

/// Copies squeezed flat have no inverse, but can still be hit.
#[test]
fn copies_without_thickness_are_hit_as_the_oracle_says() {
    let random = &mut Random::new(40);
    let mut scene = SceneBuilder::new();
    let paint = scene.material(random_material(random, "paint"));
    let mesh = scene.mesh([(Shape::quad(DVec3::new(-1.0, -1.0, 0.3), 2.0 * DVec3::X, 2.0 * DVec3::Y), Some(paint))]);
    let flatten = DVec3::new(1.0, 1.0, 0.0);
    for x in [3.0, 6.0] {
        let turn = DQuat::from_rotation_y(0.3);
        scene.place(mesh, DAffine3::from_scale_rotation_translation(flatten, turn, DVec3::X * x));
    }
    let scene = scene.finish();
    let pose = Pose::at(0.0, 0.0, 4.0).with_rpy_deg(0.0, 45.0, 0.0);
    compare(&scene, pose, &raster(60, 60, 1.2)).check(0.05);
}

/// Embree traces differently at each.
#[test]
fn the_oracle_agrees_at_other_vector_levels() {
    run_at_other_levels(&[
        "triangle_soups_are_hit_as_the_oracle_says",
        "smooth_and_flat_solids_are_hit_as_the_oracle_says",
        "what_moves_is_hit_as_the_oracle_says",
    ]);
}
