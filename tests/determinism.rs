//! The same scan gives the same bits: for any number of threads, in every run, in reused memory; and options that do
//! not affect a column leave it unchanged.

use echocast::cloud::FIELDS;
use echocast::emitter::pattern::Pattern;
use echocast::material::{Alpha, RetroSample, Scattering};
use echocast::radar::{RadarCube, RadarRecord};
use echocast::scene::Material;
use echocast::{
    BoxAxes, BuiltScene, Cause, Engine, Environment, Field, FieldSet, Frame, LiveScene, Order, Ping, PointCloud, Pose,
    Profile, ReturnMode, ScanOptions, Scene, Sensor, Track, Trajectory,
};
use echocast_kernels::{Level, limit_level};
use echocast_tests::reference::{Moving, Random, SceneBuilder, Shape};
use echocast_tests::run_at_other_levels;
use glam::{DAffine3, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// Balls, smooth and flat, single and as copies; between them mirrors, panes, veils, and balls of glass.
fn scene() -> BuiltScene {
    scene_with(&Engine::new().unwrap())
}

fn scene_with(engine: &Engine) -> BuiltScene {
    scene_of(engine, true)
}

/// Without veils, what a beam meets is not up to chance.
fn scene_of(engine: &Engine, has_veils: bool) -> BuiltScene {
    let random = &mut Random::new(5);
    let mut scene = SceneBuilder::new();
    let paints = [0.2, 0.5, 0.9].map(|reflectance| scene.reflector(reflectance));
    scene.stand(Shape::plate(-2.0 * DVec3::Z, DVec3::Z, 200.0), Some(paints[0]));
    let smooth = |name: &str| Material::default().name(name).roughness(0.0);
    let mirror = scene.material(smooth("mirror").metallic(0.8).base_color([0.9; 4]));
    let pane = scene.material(smooth("pane").transmission(1.0).pane_m(0.004).dirt(0.02));
    let glass = scene.material(smooth("glass").transmission(1.0).thickness_m(1.0));
    let samples = vec![RetroSample { angle_deg: 70.0, cd_lx_m2: 250.0 }];
    let sign = scene.material(smooth("sign").scattering(Scattering::RetroReflector { samples }));
    for (shape, material) in [
        (Shape::plate(DVec3::ZERO, DVec3::X, 1.0), mirror),
        (Shape::plate(DVec3::ZERO, DVec3::X, 1.0), pane),
        (Shape::sphere(0.7, 12), glass),
    ] {
        let mesh = scene.mesh([(shape, Some(material))]);
        for _ in 0..6 {
            let place = DAffine3::from_translation(random.in_cube(5.0));
            scene.place(mesh, place * DAffine3::from_quat(random.rotation()));
        }
    }
    for copies in [1, 40] {
        let mesh =
            scene.mesh([(Shape::sphere(1.2, 8), Some(paints[1])), (Shape::sphere(1.0, 4).flat(), Some(paints[2]))]);
        for _ in 0..copies {
            scene.place(mesh, DAffine3::from_mat3_translation(random.linear_map(), random.in_cube(15.0)));
        }
    }
    for y in [-4.0, 4.0] {
        scene.stand(Shape::plate(DVec3::new(4.5, y, 0.0), DVec3::new(-1.0, -0.5 * y, 0.0), 0.05), Some(sign));
    }
    if has_veils {
        let veil = smooth("veil").alpha(Alpha::Coverage).base_color([0.4, 0.4, 0.4, 0.5]);
        let veil = scene.material(veil);
        let mesh = scene.mesh([(Shape::plate(DVec3::ZERO, DVec3::X, 1.0), Some(veil))]);
        for _ in 0..6 {
            let place = DAffine3::from_translation(random.in_cube(5.0));
            scene.place(mesh, place * DAffine3::from_quat(random.rotation()));
        }
    }
    scene.finish().build_with(engine).unwrap()
}

fn lidar() -> Sensor {
    let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    sensor.set("noise.range_sigma_m", "0.03").unwrap();
    sensor
}

/// A camera with more beams than a scan keeps in flight at once.
fn camera() -> Sensor {
    let yaml = "
name: camera
kind: tof
pattern: {type: pinhole, resolution: [640, 480], fov_deg: [100, 80]}
range: {max_m: 14, resolution_m: 0.001}
detection: {model: radar_equation, reflectance: 0.9, at_m: 12}
noise: {range_sigma_m: 0.01, range_snr_sigma_m: 0.02}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

/// The same with fewer beams, the last block of which is not full.
fn small_camera() -> Sensor {
    let mut sensor = camera();
    sensor.set("pattern.resolution", "[400, 200]").unwrap();
    sensor
}

/// The same with every kind of error.
fn noisy() -> Sensor {
    let mut sensor = small_camera();
    sensor.set("beam.pulse_ns", "3").unwrap();
    let detection = "{model: statistical, reflectance: 0.9, at_m: 12, tnr: 4, bandwidth_mhz: 500, saturation: 50, \
                     channel_efficiency: [0.9], blooming: {weight: 1e-3, width_deg: 2}}";
    let noise = "{range_sigma_m: 0.01, range_sigma_per_m: 0.001, range_snr_sigma_m: 0.02, range_table: [{at_m: 1, \
                 mean_m: 0.1, sigma_m: 0.01}, {at_m: 9, sigma_m: 0.1}], channel_bias_sigma_m: 0.1, channel_gain_sigma: \
                 0.01, instrument: 5, temperature_m_per_k: 0.01, temperature_offset_k: 3, azimuth_sigma_deg: 0.1, \
                 azimuth_step_deg: 0.05, pointing_sigma_deg: 0.05, time_sigma_us: 3, dropout: 0.1, dropout_weak: {below: \
                 0.8, at_zero: 0.4}}";
    sensor.set("detection", detection).unwrap();
    sensor.set("noise", noise).unwrap();
    sensor.set("kind", "lidar").unwrap();
    sensor.set("doppler", "{sigma_m_s: 0.2, ambiguity_m_s: 9}").unwrap();
    sensor
}

/// Several rays per beam, several returns, and every error.
fn many() -> Sensor {
    let mut sensor = noisy();
    sensor.set("beam", "{divergence_mrad: 9, pulse_ns: 3, sub_rays: 7}").unwrap();
    sensor.set("returns", "{mode: all, max: 3, separation_m: 0.2}").unwrap();
    sensor
}

/// The same, with several rays for beams that meet more than one place alone, and so with one return or several.
fn adaptive(returns: &str) -> Sensor {
    let mut sensor = many();
    sensor.set("beam.sub_rays", "adaptive").unwrap();
    sensor.set("returns", returns).unwrap();
    sensor
}

/// The small camera with everything specific to a depth camera.
fn depth_camera() -> Sensor {
    let mut sensor = small_camera();
    let tof = "{frequencies_mhz: [16, 80, 120], shot_noise: {sigma_m: 0.01, reflectance: 0.5, at_m: 2}, vignetting: cos4, \
               depth_noise: {model: nguyen}, lateral_sigma_px: 0.8, second_eye_m: [0, -0.1, 0], multipath_rays: 2}";
    sensor.set("tof", tof).unwrap();
    sensor.set("detection.at_m", "40").unwrap();
    sensor
}

fn drive() -> Trajectory {
    let turned = Pose::at(2.0, 1.0, 0.5).with_rpy_deg(3.0, -4.0, 70.0);
    Trajectory::new(vec![(0.0, Pose::at(0.0, 0.0, 0.0)), (0.15, turned)]).unwrap()
}

fn all() -> ScanOptions {
    ScanOptions::default().fields(FieldSet::all()).seed(11).frame(3)
}

/// In all kinds of weather.
fn wet() -> ScanOptions {
    let weather = "{rain: {rate_mm_h: 30, range_noise: true}, snow: {rate_mm_h: 3}, fog: {visibility_m: 90}, dust: \
                   {radius_um: 50, per_m3: 1e7, box: {min_m: [1, -9, -2], max_m: [9, 9, 9]}}}";
    all().environment(Environment::from_yaml(weather).unwrap())
}

/// The names of the columns that differ in any bit.
fn differences(a: &PointCloud, b: &PointCloud) -> Vec<&'static str> {
    assert_eq!((a.len(), a.fields(), a.organised(), a.origin), (b.len(), b.fields(), b.organised(), b.origin));
    let differ = |field: Field| a.column(field).bytes() != b.column(field).bytes();
    FIELDS.iter().filter(|info| differ(info.field)).map(|info| info.name).collect()
}

/// Threads keep their working memory: sensors that use much of it, and sensors that rely on its initial state, follow
/// each other on one thread.
#[test]
fn what_a_thread_did_before_does_not_change_a_bit() {
    let built = scene_with(&Engine::with_threads(1).unwrap());
    let few: FieldSet =
        [Field::X, Field::Range, Field::ReturnNumber, Field::Cause, Field::Azimuth].into_iter().collect();
    let mut sensors = vec![
        lidar(),
        Sensor::preset("velodyne_vlp16").unwrap(),
        camera(),
        noisy(),
        many(),
        adaptive("{mode: strongest}"),
        adaptive("{mode: all, max: 3}"),
        depth_camera(),
    ];
    for sensor in &mut sensors[2..] {
        // The last lanes of the last block have no beams.
        sensor.set("pattern.resolution", "[61, 43]").unwrap();
    }
    let mut cases = Vec::new();
    for sensor in &sensors {
        for options in [all(), wet(), all().fields(few), all().organised(true)] {
            if !(options.organised && sensor.spec().returns.mode == ReturnMode::All) {
                cases.push((sensor, options));
            }
        }
    }
    let scan = |(sensor, options): &(&Sensor, ScanOptions)| built.scan(sensor, &drive(), options).unwrap();
    let expected: Vec<PointCloud> =
        cases.iter().map(|case| std::thread::scope(|scope| scope.spawn(|| scan(case)).join().unwrap())).collect();
    let random = &mut Random::new(9);
    for _ in 0..3 * cases.len() {
        let case = random.below(cases.len());
        assert_eq!(differences(&expected[case], &scan(&cases[case])), [""; 0], "case {case}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let [one, seven] = [1, 7].map(|threads| scene_with(&Engine::with_threads(threads).unwrap()));
    let all_threads = scene();
    let mut causes = BTreeSet::new();
    for sensor in [lidar(), camera(), noisy(), many(), adaptive("{mode: strongest}"), depth_camera()] {
        for path in [Trajectory::fixed(Pose::IDENTITY), drive()] {
            let single = sensor.spec().returns.mode != ReturnMode::All;
            for options in [all(), all().organised(single), wet()] {
                let alone = one.scan(&sensor, &path, &options).unwrap();
                causes.extend(alone.columns().cause());
                assert!(alone.len() > 10_000, "{} points", alone.len());
                for (scene, threads) in [(&seven, "7 threads"), (&all_threads, "rayon's threads")] {
                    let cloud = scene.scan(&sensor, &path, &options).unwrap();
                    assert_eq!(differences(&alone, &cloud), [""; 0], "{threads}");
                }
            }
        }
    }
    // Points of all kinds were among them.
    assert_eq!(causes, (0..=Cause::Multipath as u8).collect());
}

/// Things that turn, bend, morph and come from caches, all of it four times.
fn moving(folder: &std::path::Path) -> Vec<Scene> {
    let load = |seed: u64| {
        let own = folder.join(seed.to_string());
        std::fs::create_dir(&own).unwrap();
        Moving::random(&mut Random::new(seed)).load(&own)
    };
    (0..4).map(load).collect()
}

/// Three frames of `scenes` that move, with boxes and flow.
fn moving_clouds(scenes: &[Scene], engine: &Engine) -> Vec<PointCloud> {
    let mut live = LiveScene::new(engine);
    for scene in scenes {
        live.add_scene(scene).unwrap();
    }
    let mut camera = camera();
    camera.set("pattern.resolution", "[160, 120]").unwrap();
    camera.set("pattern.fov_deg", "[160, 120]").unwrap();
    let mut clouds = Vec::new();
    for (frame, sensor) in [lidar(), many(), camera].into_iter().enumerate() {
        let start_time = 0.09 * frame as f64;
        live.set_time(start_time, 0.1).unwrap();
        let options = all().start_time(start_time).boxes(BoxAxes::Object);
        clouds.push(live.commit().unwrap().scan(&sensor, &drive(), &options).unwrap());
    }
    clouds
}

/// Clouds of what moves, boxes included.
#[track_caller]
fn assert_same(a: &[PointCloud], b: &[PointCloud], what: &str) {
    for (number, (a, b)) in a.iter().zip(b).enumerate() {
        assert_eq!(differences(a, b), [""; 0], "{what}, frame {number}");
        assert_eq!(a.boxes, b.boxes, "{what}, frame {number}");
    }
}

#[test]
fn threads_do_not_change_a_bit_of_what_moves() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = moving(folder.path());
    let clouds = |threads: usize| moving_clouds(&scenes, &Engine::with_threads(threads).unwrap());
    let alone = clouds(1);
    for cloud in &alone {
        let flows = cloud.columns().flow_x().iter().filter(|flow| **flow != 0.0 && !flow.is_nan()).count();
        let boxes = cloud.boxes.as_ref().unwrap();
        assert!(
            flows > 1000 && boxes.len() == 20 && boxes.iter().any(|found| found.velocity != DVec3::ZERO),
            "{flows}"
        );
    }
    for threads in [1, 2, 8] {
        assert_same(&alone, &clouds(threads), &format!("{threads} threads"));
    }
}

/// In one test, since the level applies to the whole process.
#[test]
fn vector_levels_do_not_change_a_bit() {
    let built = scene();
    let folder = tempfile::tempdir().unwrap();
    let moving = moving(folder.path());
    let of_all = || {
        // Built at each level, too.
        let mut clouds = moving_clouds(&moving, &Engine::new().unwrap());
        for sensor in [lidar(), camera(), noisy(), many(), adaptive("{mode: strongest}"), depth_camera()] {
            for (path, options) in [(Trajectory::fixed(Pose::IDENTITY), wet()), (drive(), all())] {
                clouds.push(built.scan(&sensor, &path, &options).unwrap());
            }
        }
        let place = Trajectory::fixed(Pose::at(0.0, 0.0, 8.0));
        let pings = sonars().iter().map(|sonar| built.ping(sonar, &place, &sea()).unwrap()).collect::<Vec<_>>();
        (clouds, pings, radars().iter().map(|radar| radar_frame(&built, radar, &wet())).collect::<Vec<_>>())
    };
    assert_eq!(limit_level(Level::Plain), Level::Plain);
    let (clouds, pings, frames) = of_all();
    for level in [Level::Avx2, Level::Avx512] {
        if limit_level(level) == level {
            let (others, other_pings, other_frames) = of_all();
            for (index, (cloud, other)) in clouds.iter().zip(&others).enumerate() {
                assert_eq!(differences(cloud, other), [""; 0], "{level:?} case {index}");
                assert_eq!(cloud.boxes, other.boxes, "{level:?} case {index}");
            }
            for (index, (ping, other)) in pings.iter().zip(&other_pings).enumerate() {
                assert_eq!(ping_differences(ping, other), [""; 0], "{level:?} ping {index}");
            }
            for (index, (frame, other)) in frames.iter().zip(&other_frames).enumerate() {
                assert_same_frame(frame, other, &format!("{level:?} radar {index}"));
            }
        }
    }
    limit_level(Level::Avx512);
}

/// Embree's hits differ from level to level, but not with the number of threads.
#[test]
fn threads_do_not_change_a_bit_at_other_vector_levels() {
    run_at_other_levels(&["two_runs_give_the_same_bits", "threads_do_not_change_a_bit_of_what_moves"]);
}

/// The scene is built identically twice, too.
#[test]
fn two_runs_give_the_same_bits() {
    let path = drive();
    for sensor in [lidar(), camera(), depth_camera()] {
        let run = || scene().scan(&sensor, &path, &all()).unwrap();
        assert_eq!(differences(&run(), &run()), [""; 0]);
    }
}

#[test]
fn reused_memory_gives_the_same_bits() {
    let (scene, path) = (scene(), drive());
    let mut reused = PointCloud::default();
    let few = all().fields(FieldSet::default()).coordinates(Frame::Sensor);
    let kept = all().organised(true);
    let sorted = all().order(Order::Time);
    for (sensor, options) in [
        (camera(), all()),
        (lidar(), all()),
        (lidar(), wet()),
        (noisy(), all()),
        (noisy(), wet()),
        (lidar(), few.clone()),
        (camera(), kept.clone()),
        (lidar(), sorted),
        (camera(), few),
        (lidar(), kept),
        (camera(), all()),
    ] {
        scene.scan_into(&sensor, &path, &options, &mut reused).unwrap();
        let fresh = scene.scan(&sensor, &path, &options).unwrap();
        assert_eq!(differences(&fresh, &reused), [""; 0]);
        for info in FIELDS {
            let length = if options.fields.contains(info.field) { fresh.len() } else { 0 };
            assert_eq!(reused.column(info.field).len(), length, "{}", info.name);
        }
    }
}

/// Each column alone, or left out, is the same as among all.
#[test]
fn columns_do_not_depend_on_which_are_asked_for() {
    let (scene, path) = (scene(), drive());
    let profiles = [Profile::Physical, Profile::Paper, Profile::Blainder];
    for (mut sensor, profiles) in [(camera(), &profiles[..]), (noisy(), &profiles[..1])] {
        // Quick, and with everything that detection needs.
        sensor.set("pattern.resolution", "[160, 120]").unwrap();
        for (&profile, coordinates) in profiles.iter().flat_map(|p| [(p, Frame::World), (p, Frame::Sensor)]) {
            let scan = |fields| {
                let options = all().fields(fields).profile(profile).coordinates(coordinates);
                scene.scan(&sensor, &path, &options).unwrap()
            };
            let together = scan(FieldSet::all());
            for info in FIELDS {
                let alone = scan(FieldSet::EMPTY.with(info.field));
                assert_eq!(alone.len(), together.len(), "{} alone", info.name);
                let bytes = together.column(info.field).bytes();
                assert!(alone.column(info.field).bytes() == bytes, "{} alone, {profile:?}, {coordinates:?}", info.name);
            }
        }
    }
}

/// Within a time budget a scan is that of a sensor whose beams have as many rays at most as it reports, whatever time
/// there was.
#[test]
fn a_time_budget_only_limits_rays() {
    let built = scene();
    let mut pixels = camera();
    pixels.set("beam", "{pulse_ns: 5, sub_rays: adaptive}").unwrap();
    for sensor in [lidar(), adaptive("{mode: all, max: 3}"), adaptive("{mode: first}"), pixels] {
        let unlimited = built.scan(&sensor, &drive(), &all()).unwrap();
        let mut reused = PointCloud::default();
        for (budget, expected) in [(1e-9, Some(1)), (1e3, Some(unlimited.most_rays)), (0.02, None), (0.1, None)] {
            built.scan_into(&sensor, &drive(), &all().time_budget(budget), &mut reused).unwrap();
            assert!(expected.is_none_or(|most| reused.most_rays == most), "{budget} s: {}", reused.most_rays);
            let mut limited = sensor.clone();
            limited.set("beam.sub_rays", &format!("{{adaptive: {}}}", reused.most_rays)).unwrap();
            let expected = built.scan(&limited, &drive(), &all()).unwrap();
            assert_eq!(differences(&reused, &expected), [""; 0], "{}: {budget} s", sensor.name());
            assert_eq!((reused.rays, reused.most_rays), (expected.rays, expected.most_rays));
        }
    }
}

/// Another seed or frame changes only what is measured with noise, and the frame's own number.
#[test]
fn seeds_and_frames_change_only_what_has_noise() {
    let (scene, path) = (scene_of(&Engine::new().unwrap(), false), drive());
    let mut sensor = lidar();
    // Several rays are turned at random about their beam.
    sensor.set("beam.sub_rays", "1").unwrap();
    let scan = |seed, frame| scene.scan(&sensor, &path, &all().seed(seed).frame(frame)).unwrap();
    let first = scan(11, 3);
    let noisy = ["x", "y", "z", "range", "intensity", "depth", "reflectance_db", "amplitude_db"];
    assert_eq!(differences(&first, &scan(12, 3)), noisy);
    assert_eq!(
        differences(&first, &scan(11, 4)),
        ["x", "y", "z", "range", "intensity", "frame", "depth", "reflectance_db", "amplitude_db"]
    );
}

/// Bits of each row by its beam.
fn rows_by_beam(cloud: &PointCloud) -> BTreeMap<u32, Vec<u64>> {
    let row = |index: usize| FIELDS.iter().map(|info| cloud.column(info.field).get_f64(index).to_bits()).collect();
    (0..cloud.len()).map(|index| (cloud.columns().beam()[index], row(index))).collect()
}

#[test]
fn order_by_time_is_the_same_set_of_points() {
    let (scene, path) = (scene(), drive());
    let by_beam = scene.scan(&lidar(), &path, &all()).unwrap();
    let by_time = scene.scan(&lidar(), &path, &all().order(Order::Time)).unwrap();
    assert!(by_beam.columns().beam().is_sorted() && !by_beam.columns().time().is_sorted());
    assert!(by_time.columns().time().is_sorted() && !by_time.columns().beam().is_sorted());
    assert_eq!(by_beam.len(), by_time.len());
    assert!(rows_by_beam(&by_beam) == rows_by_beam(&by_time));
}

/// An organised cloud has the same points, with one row for each beam.
#[test]
fn organised_clouds_hold_the_same_points() {
    let (scene, path) = (scene(), drive());
    for sensor in [lidar(), camera(), depth_camera()] {
        let loose = scene.scan(&sensor, &path, &all()).unwrap();
        let organised = scene.scan(&sensor, &path, &all().organised(true)).unwrap();
        let beams = sensor.beams();
        assert_eq!(organised.organised(), Some([beams.rows, beams.columns]));
        assert_eq!((organised.len(), loose.organised()), (beams.len(), None));
        let c = organised.columns();
        assert!(c.beam().iter().copied().eq(0..beams.len() as u32));
        assert!(loose.len() < organised.len(), "some beams miss");
        let found = rows_by_beam(&loose);
        for (beam, row) in rows_by_beam(&organised) {
            if let Some(expected) = found.get(&beam) {
                assert_eq!(&row, expected);
            } else {
                let beam = beam as usize;
                assert!(c.range()[beam].is_nan() && c.x()[beam].is_nan() && c.return_number()[beam] == 0);
                assert_eq!(c.channel()[beam], beams.channel[beam]);
                assert_eq!(c.time()[beam], beams.time[beam]);
            }
        }
    }
}

/// One of each pattern, with everything that draws random numbers.
fn sonars() -> Vec<Sensor> {
    let sonar = |pattern: &str| {
        let yaml = format!(
            "
name: sonar
kind: sonar
pattern: {{{pattern}, rate_hz: 10}}
acoustics: {{frequency_khz: 300, bandwidth_khz: 20, noise_level_db: 60, texture_shape: 3, bounces: 2}}
range: {{max_m: 60}}
"
        );
        Sensor::from_yaml(&yaml, "").unwrap()
    };
    [
        "type: sidescan, tilt_deg: 20, rays: 3000",
        "type: multibeam, beams: 70, swath_deg: 120, rays: 40",
        "type: imaging, beams: 70, fov_deg: 90, tilt_deg: 10, rays: 64",
        "type: single_beam, beam_deg: 20, rays: 5000",
        "type: dvl, beam_deg: 6, rays: 3000",
    ]
    .map(sonar)
    .map(|mut sensor| {
        if matches!(sensor.spec().pattern, Pattern::Dvl(_)) {
            let log = "{sigma_m_s: 0.01, scale_sigma: 0.01, water: {from_m: 1, to_m: 4, sigma_m_s: 0.03}}";
            sensor.set("dvl", log).unwrap();
        }
        sensor
    })
    .into()
}

/// Ten layers, volume backscatter, waves.
fn sea() -> ScanOptions {
    let row = |row: u32| format!("{{depth_m: {}, speed_m_s: {}}}", 3 * row, 1500 + 7 * (row * row % 5));
    let rows: Vec<String> = (0..10).map(row).collect();
    let yaml =
        format!("water: {{surface_z_m: 12, volume_backscatter_db: -70, profile: {{layers: [{}]}}}}", rows.join(", "));
    all().environment(Environment::from_yaml(&yaml).unwrap())
}

/// The names of what differs in any bit between two pings.
fn ping_differences(a: &Ping, b: &Ping) -> Vec<&'static str> {
    assert_eq!((a.fields(), &a.layout(), a.origin), (b.fields(), &b.layout(), b.origin));
    let bits = |ping: &Ping| -> Vec<[u32; 5]> {
        let bits =
            |s: &echocast::Sounding| [s.beam, s.range.to_bits(), s.cell, s.level_db.to_bits(), s.quality.to_bits()];
        ping.soundings().iter().map(bits).collect()
    };
    let differ = |field: Field| a.column(field).bytes() != b.column(field).bytes();
    let columns = FIELDS.iter().filter(|info| differ(info.field)).map(|info| info.name);
    let tracks = |ping: &Ping| {
        let bits = |track: Track| {
            let Track { radial, velocity, error, .. } = track;
            [radial[0], radial[1], radial[2], radial[3], velocity.x, velocity.y, velocity.z, error].map(f32::to_bits)
        };
        [ping.bottom_track, ping.water_track].map(|track| track.map(bits))
    };
    let more = [(bits(a) != bits(b)).then_some("soundings"), (tracks(a) != tracks(b)).then_some("tracks")];
    columns.chain(more.into_iter().flatten()).collect()
}

#[test]
fn threads_do_not_change_a_bit_of_a_ping() {
    let [one, two, seven] = [1, 2, 7].map(|threads| scene_with(&Engine::with_threads(threads).unwrap()));
    let mut causes = BTreeSet::new();
    let mut sensors = sonars();
    let mut without_speckle = sensors[2].clone();
    without_speckle.set("acoustics.speckle", "off").unwrap();
    sensors.push(without_speckle);
    let mut reused = Ping::default();
    for sensor in sensors {
        for path in [Trajectory::fixed(Pose::at(0.0, 0.0, 8.0)), drive()] {
            for options in [sea(), sea().environment(Environment::default())] {
                // The second has its surface above everything.
                let environment = if options.environment.is_empty() {
                    Environment::from_yaml("water: {surface_z_m: 20}").unwrap()
                } else {
                    options.environment.clone()
                };
                let options = options.environment(environment);
                let alone = one.ping(&sensor, &path, &options).unwrap();
                causes.extend(alone.cells().cause());
                for (scene, threads) in [(&seven, "7 threads"), (&one, "the same again")] {
                    let ping = scene.ping(&sensor, &path, &options).unwrap();
                    assert_eq!(ping_differences(&alone, &ping), [""; 0], "{threads}");
                }
                // Memory from another sensor or pose, and other water.
                two.ping_into(&sensor, &path, &options, &mut reused).unwrap();
                assert_eq!(ping_differences(&alone, &reused), [""; 0], "reused");
                let few = options.clone().fields(FieldSet::default());
                let level = two.ping(&sensor, &path, &few).unwrap();
                assert!(level.cells().intensity() == alone.cells().intensity(), "levels depend on the columns");
            }
        }
    }
    let causes: Vec<u8> = causes.into_iter().collect();
    assert_eq!(
        causes,
        [Cause::Surface, Cause::FalseAlarm, Cause::Multipath, Cause::SeaSurface].map(|cause| cause as u8)
    );
}

/// Three transmitters that take turns, by paths and by samples.
fn radars() -> [(Sensor, RadarRecord); 2] {
    let yaml = "
name: radar
kind: radar
pattern: {type: radar, rate_hz: 20}
range: {max_m: 12}
radar:
  power_dbm: 45
  mirrors: 1
  waveform: {type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 128, sample_rate_mhz: 10, ramp_us: 15, chirps: 32}
  array: {tx: [[0, 0], [4, 0], [2, 1]], rx: {count: 4}}
  leakage: {power_dbm: -20}
  detection: {method: os, pfa: 1e-3}
";
    let sensor = Sensor::from_yaml(yaml, "").unwrap();
    let mut sampled = sensor.clone();
    // Paths do not depend on what is made of them.
    sampled.set("radar.mirrors", "0").unwrap();
    let record = |samples| RadarRecord { cube: true, samples };
    [(sensor, record(false)), (sampled, record(true))]
}

/// Detections, cube and samples of a frame.
type FrameOfRadar = (PointCloud, RadarCube, Option<Vec<i16>>);

fn radar_frame(scene: &BuiltScene, (sensor, record): &(Sensor, RadarRecord), options: &ScanOptions) -> FrameOfRadar {
    let mut cloud = PointCloud::default();
    let frame = scene.radar_frame(sensor, &drive(), options, *record, &mut cloud).unwrap();
    (cloud, frame.cube.unwrap(), frame.samples.map(|samples| samples.values))
}

fn cell_bits(cube: &RadarCube) -> Vec<[u32; 2]> {
    cube.cells.iter().map(|cell| [cell.re.to_bits(), cell.im.to_bits()]).collect()
}

#[track_caller]
fn assert_same_frame(a: &FrameOfRadar, b: &FrameOfRadar, what: &str) {
    assert_eq!(differences(&a.0, &b.0), [""; 0], "{what}");
    assert!(cell_bits(&a.1) == cell_bits(&b.1), "{what}: cubes differ");
    assert!(a.2 == b.2, "{what}: samples differ");
}

#[test]
fn threads_do_not_change_a_bit_of_a_radar() {
    let [one, two, eight] = [1, 2, 8].map(|threads| scene_with(&Engine::with_threads(threads).unwrap()));
    for radar in radars() {
        for options in [all(), wet()] {
            let alone = radar_frame(&one, &radar, &options);
            assert!(!alone.0.is_empty());
            for (scene, what) in [(&two, "2 threads"), (&eight, "8 threads")] {
                assert_same_frame(&alone, &radar_frame(scene, &radar, &options), what);
            }
            for other in [options.clone().seed(12), options.clone().frame(4)] {
                assert!(cell_bits(&alone.1) != cell_bits(&radar_frame(&one, &radar, &other).1), "noise is the same");
            }
            // Detections alone, in memory of another scan, with few columns.
            let few: FieldSet = [Field::Range, Field::Snr].into_iter().collect();
            let mut reused = one.scan(&lidar(), &drive(), &all()).unwrap();
            let (sensor, record) = &radar;
            if !record.samples {
                one.scan_into(sensor, &drive(), &options.clone().fields(few), &mut reused).unwrap();
                assert_eq!(reused.columns().snr(), alone.0.columns().snr());
                assert_eq!(reused.columns().range(), alone.0.columns().range());
            }
        }
    }
}
