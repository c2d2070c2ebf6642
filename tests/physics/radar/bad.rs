//! What cannot be: errors that say what is allowed, and scenes that must neither hang nor give what is not a number.

use super::*;
use echocast::Field;
use echocast::cloud::{ColumnType, FIELDS};

/// What a sensor with a change to it is refused with.
fn refused(key: &str, value: &str) -> String {
    radar("").set(key, value).unwrap_err().to_string()
}

#[test]
fn errors_say_what_is_allowed() {
    let chirp = |more: &str| {
        let yaml = format!("{{type: fmcw, start_ghz: 76.872, slope_mhz_per_us: 10, sample_rate_mhz: 10, {more}}}");
        refused("radar.waveform", &yaml)
    };
    for (found, words) in [
        (chirp("samples: 256, ramp_us: 20, chirps: 128"), &["radar.waveform.ramp_us", "is 20", "25.6"][..]),
        (chirp("samples: 65536, ramp_us: 6554, chirps: 65536"), &["65536 samples of 65536 chirps", "together up to"]),
        (refused("radar.array.rx", "[[0, 0], [1, 0], [0, 0]]"), &["radar.array.rx[2]", "twice", "[0]"]),
        (refused("radar.array.rx", "{count: 1024, rows: 1024}"), &["radar.array.rx", "1 to 1024"]),
        (refused("radar.detection.pfa", "0"), &["radar.detection.pfa: is 0", "1e-12 to 0.5"]),
        (refused("radar.power_dbm", "121"), &["radar.power_dbm: is 121", "-100 to 120"]),
        (refused("radar.power_dbm", ".nan"), &["radar.power_dbm", ".nan is not a finite number"]),
        (refused("radar.mirrors", "4"), &["radar.mirrors: is 4", "0 to 3"]),
    ] {
        assert!(words.iter().all(|word| found.contains(word)), "{found}: {words:?}");
    }
}

/// Brick is known up to 40 GHz.
#[test]
fn laws_of_materials_end_where_they_were_measured() {
    let wall = || Shape::plate(DVec3::X * 20.0, DVec3::NEG_X, 2.0);
    let pose = Trajectory::fixed(Pose::IDENTITY);
    let error = scene([(wall(), "law: itu, material: brick")]).scan(&radar(""), &pose, &options()).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("\"surface\"") && error.contains("40"), "{error}");
    let extrapolated = scene([(wall(), "law: itu, material: brick, extrapolate: true")]);
    assert!(!scan(&extrapolated, &radar(""), &options()).is_empty());
}

#[test]
fn other_sensors_are_no_radars() {
    let lidar = Sensor::preset("velodyne_vlp16").unwrap();
    let (pose, mut cloud) = (Trajectory::fixed(Pose::IDENTITY), PointCloud::default());
    let error = scene([(trihedral(0.1, DVec3::X * 20.0), METAL)])
        .radar_frame(&lidar, &pose, &options(), RadarRecord::default(), &mut cloud)
        .unwrap_err();
    assert!(error.to_string().contains("kind: radar"), "{error}");
}

/// Columns of a detection that are numbers whatever it is of.
const ALWAYS: [Field; 9] = [
    Field::X,
    Field::Y,
    Field::Z,
    Field::Range,
    Field::Azimuth,
    Field::Elevation,
    Field::Doppler,
    Field::Snr,
    Field::Power,
];

/// Columns of a detection of a surface that are.
const OF_SURFACES: [Field; 7] = [
    Field::Rcs,
    Field::TrueRcs,
    Field::TrueRange,
    Field::RadialVelocity,
    Field::CosIncidence,
    Field::RangeSigma,
    Field::VelocitySigma,
];

/// Nothing that must be a number is not.
fn assert_numbers(cloud: &PointCloud, what: &str) {
    for info in FIELDS.iter().filter(|info| info.kind == ColumnType::F32) {
        let (always, of_surfaces) = (ALWAYS.contains(&info.field), OF_SURFACES.contains(&info.field));
        let bytes = cloud.column(info.field).bytes();
        for (row, bytes) in bytes.chunks_exact(4).enumerate() {
            let value = f32::from_ne_bytes(bytes.try_into().unwrap());
            let must = always || (of_surfaces && path(cloud, row) != PathType::Noise);
            assert!(!(value.is_infinite() || must && value.is_nan()), "{what}: {} is {value} in row {row}", info.name);
        }
    }
}

/// In a closed room of metal, in a room so small that nothing is farther than a cell, inside a body, in the plane of a
/// triangle, at one of its corners.
#[test]
fn radars_are_anywhere() {
    let room = |half: f64| Shape::cuboid(DVec3::splat(-half), DVec3::splat(half));
    let flat = Shape::triangle([DVec3::new(1.0, 0.0, 0.0), DVec3::new(20.0, -3.0, 0.0), DVec3::new(20.0, 3.0, 0.0)]);
    let corner = Shape::triangle([DVec3::ZERO, DVec3::new(9.0, -3.0, -1.0), DVec3::new(9.0, 3.0, 2.0)]);
    let none = Shape::triangle([DVec3::X * 5.0; 3]).and(Shape::plate(DVec3::X * 9.0, DVec3::NEG_X, 0.3));
    for (what, shape) in [
        ("a room", room(4.0)),
        ("a small room", room(0.05)),
        ("a ball", Shape::sphere(2.0, 24)),
        ("a plane", flat),
        ("a corner", corner),
        ("a triangle without an area", none),
    ] {
        for material in [METAL, "law: itu, material: concrete, rms_height_mm: 1, clutter: {gamma_db: -20}"] {
            for mirrors in [0, 3] {
                let sensor = radar(&format!("{SQUARE} radar.clutter=true radar.mirrors={mirrors}"));
                let cloud = scan(&scene([(shape.clone(), material)]), &sensor, &options());
                assert_numbers(&cloud, what);
            }
        }
    }
}

#[test]
fn scenes_are_empty() {
    // Either is said.
    match Scene::default().build() {
        Ok(scene) => assert_numbers(&scan(&scene, &radar(""), &options()), "nothing"),
        Err(error) => assert!(error.to_string().contains("scene"), "{error}"),
    }
}

/// Rough ground of a million triangles, with a corner reflector on it.
#[test]
fn a_million_triangles_are_few() {
    let side = 710;
    let mut shape = Shape::default();
    let mut random = echocast_tests::reference::Random::new(1);
    for i in 0..=side {
        for j in 0..=side {
            let [x, y] = [i, j].map(|index| f64::from(index) * 0.2);
            shape.positions.push([x as f32, (y - 71.0) as f32, random.between(-2.02, -1.98) as f32]);
        }
    }
    for i in 0..side {
        for j in 0..side {
            let corner: u32 = i * (side + 1) + j;
            let (right, up) = (corner + side + 1, corner + 1);
            shape.triangles.extend([[corner, right, up], [right, right + 1, up]]);
        }
    }
    assert!(shape.triangles.len() > 1_000_000);
    let ground = "law: permittivity, eps: 5, rms_height_mm: 2, clutter: {gamma_db: -25}";
    let scene = scene([(shape, ground), (trihedral(0.3, DVec3::X * 40.0), METAL)]);
    let cloud = scan(&scene, &radar(&format!("{SQUARE} radar.clutter=true")), &options());
    assert_numbers(&cloud, "a million triangles");
    let row = first(&cloud);
    assert_eq!(cloud.columns().instance_id()[row], 2);
    assert_near("range", cloud.columns().range()[row].into(), 40.0, 0.2);
}
