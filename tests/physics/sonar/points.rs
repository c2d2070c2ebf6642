//! Points of pings, and what is refused.

use super::*;
use echocast::cloud::FIELDS;
use echocast::{Error, Field, Frame, PointCloud, Profile};
use std::ops::ControlFlow;

fn swath() -> Sensor {
    sonar("type: multibeam, beams: 31, swath_deg: 90, along_deg: 1, across_deg: 3, rays: 32", "range.max_m=60")
}

fn fan() -> Sensor {
    sonar(
        "type: imaging, beams: 16, fov_deg: 40, beam_deg: 3, vertical_deg: 15, tilt_deg: 25, rays: 256",
        "range.max_m=60 acoustics.noise_level_db=60",
    )
}

fn place(cloud: &PointCloud, row: usize) -> DVec3 {
    let c = cloud.columns();
    super::super::vector(c.x(), c.y(), c.z(), row)
}

fn truth(cloud: &PointCloud, row: usize) -> DVec3 {
    let c = cloud.columns();
    super::super::vector(c.true_x(), c.true_y(), c.true_z(), row)
}

/// A pose with no component 0.
fn pose() -> Pose {
    Pose::at(3.0, -2.0, 21.0).with_rpy_deg(4.0, -3.0, 35.0)
}

#[test]
fn points_lie_along_their_direction_at_the_range_that_is_believed() {
    let scene = flat(100.0);
    let believed = options(water(", assumed_speed_m_s: 1450"));
    let trajectory = Trajectory::fixed(pose());
    for sensor in [sidescan("acoustics.noise_level_db=60"), swath(), fan(), sonar("type: single_beam, beam_deg: 5", "")]
    {
        let world = scene.scan(&sensor, &trajectory, &believed).unwrap();
        let own = believed.clone().coordinates(Frame::Sensor);
        let own = scene.scan(&sensor, &trajectory, &own).unwrap();
        let found = scene.ping(&sensor, &trajectory, &believed).unwrap();
        assert!(world.len() == own.len() && !world.is_empty());
        if sensor.spec().pattern_is_depths() {
            assert_eq!(world.len(), found.soundings().len());
        }
        let rotation = pose().rotation();
        let mut surfaces = 0;
        for row in 0..world.len() {
            let c = world.columns();
            let (azimuth, elevation) = (f64::from(c.azimuth()[row]), f64::from(c.elevation()[row]));
            let direction =
                DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            let range = f64::from(c.range()[row]);
            assert!((place(&own, row) - direction * range).length() < 1e-4 * range);
            let apparent = pose().position + rotation * direction * range;
            assert!((place(&world, row) + world.origin - apparent).length() < 1e-3);
            assert!(
                (rotation * truth(&own, row) + pose().position - truth(&world, row) - world.origin).length() < 1e-3
                    || c.cause()[row] == 7
            );
            assert_near("depth", c.depth()[row].into(), place(&own, row).x, 1e-4);
            if c.cause()[row] == 0 {
                surfaces += 1;
                // The truth is on the bottom, at the true range, and the report nearer by the assumed speed.
                let there = truth(&world, row) + world.origin;
                let far = there.distance(pose().position);
                assert_near("truth", there.z, 0.0, 0.1);
                assert_near("true range", c.true_range()[row].into(), far, 0.1);
                assert_near("a cell of it", range / far, 1450.0 / 1500.0, 5e-3);
                let normal = super::super::vector(c.normal_x(), c.normal_y(), c.normal_z(), row);
                assert!((normal - DVec3::Z).length() < 1e-5, "{normal}");
                let turned = super::super::vector(
                    own.columns().normal_x(),
                    own.columns().normal_y(),
                    own.columns().normal_z(),
                    row,
                );
                assert!((rotation * turned - DVec3::Z).length() < 1e-5, "{turned}");
                assert_eq!([c.category_id()[row], c.instance_id()[row], c.first_category_id()[row]], [1; 3]);
            }
            assert_eq!((c.frame()[row], c.firing()[row], c.time()[row]), (0, 0, 0.0));
        }
        assert!(surfaces * 2 > world.len(), "{surfaces} of {}", world.len());
        // All columns are there.
        for info in FIELDS {
            assert_eq!(world.column(info.field).len(), world.len(), "{}", info.name);
        }
        // A cell's level is its point's.
        for row in 0..world.len() {
            let cell = match found.soundings().iter().find(|s| s.beam == world.columns().beam()[row]) {
                Some(sounding) => sounding.cell,
                None => world.columns().beam()[row],
            };
            assert_eq!(world.columns().intensity()[row], found.cells().intensity()[cell as usize]);
        }
    }
}

trait Depths {
    fn pattern_is_depths(&self) -> bool;
}

impl Depths for echocast::SensorSpec {
    fn pattern_is_depths(&self) -> bool {
        use echocast::emitter::pattern::Pattern;
        matches!(self.pattern, Pattern::Multibeam(_) | Pattern::SingleBeam(_))
    }
}

#[test]
fn organised_clouds_have_the_shape_of_the_sonar() {
    let scene = flat(100.0);
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 20.0));
    for (sensor, depths) in [(sidescan("acoustics.noise_level_db=60"), false), (swath(), true), (fan(), false)] {
        let options = options(water(""));
        let loose = scene.scan(&sensor, &trajectory, &options).unwrap();
        let organised = scene.scan(&sensor, &trajectory, &options.clone().organised(true)).unwrap();
        let layout = scene.ping(&sensor, &trajectory, &options).unwrap().layout().clone();
        let (beams, bins) = (layout.beams() as u32, layout.bins as u32);
        assert_eq!(organised.organised(), Some(if depths { [1, beams] } else { [beams, bins] }));
        let rows: Vec<usize> = (0..organised.len()).filter(|&row| !organised.columns().range()[row].is_nan()).collect();
        assert_eq!(rows.len(), loose.len());
        for (at, &row) in rows.iter().enumerate() {
            for info in FIELDS {
                let [a, b] =
                    [(&loose, at), (&organised, row)].map(|(cloud, row)| cloud.column(info.field).get_f64(row));
                assert!(a.to_bits() == b.to_bits(), "{}: {a} {b}", info.name);
            }
        }
        let c = organised.columns();
        for row in (0..organised.len()).filter(|row| !rows.contains(row)) {
            assert!(c.x()[row].is_nan() && c.intensity()[row].is_nan() && c.true_x()[row].is_nan());
            assert_eq!((c.return_number()[row], c.category_id()[row], c.frame()[row]), (0, 0, 0));
        }
        // A depth is the only one of its beam, and a range bin is a separate beam.
        let c = loose.columns();
        assert!(c.return_number().iter().chain(c.return_count()).all(|&number| number == 1));
    }
}

#[test]
fn pings_are_heard_of_and_called_off() {
    let scene = flat(100.0);
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 20.0));
    let (sensor, options) = (swath(), options(water("")));
    for profile in [Profile::Physical, Profile::Paper] {
        let options = options.clone().profile(profile);
        let mut cloud = PointCloud::default();
        let mut heard = Vec::new();
        // What is finished is kept.
        let mut hear = |part: f64| {
            heard.push(part);
            if part < 1.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        scene.scan_with_progress(&sensor, &trajectory, &options, &mut cloud, &mut hear).unwrap();
        assert!(heard == [0.0, 1.0] && !cloud.is_empty(), "{heard:?} {}", cloud.len());
        let mut stop = |_: f64| ControlFlow::Break(());
        let error = scene.scan_with_progress(&sensor, &trajectory, &options, &mut cloud, &mut stop).unwrap_err();
        assert!(matches!(error, Error::Cancelled) && cloud.is_empty());
    }
}

#[test]
fn columns_do_not_depend_on_which_are_asked_for() {
    let scene = flat(100.0);
    let trajectory = Trajectory::fixed(pose());
    for sensor in [swath(), sidescan("acoustics.noise_level_db=60")] {
        for coordinates in [Frame::World, Frame::Sensor] {
            let scan = |fields| {
                let options = options(water("")).fields(fields).coordinates(coordinates);
                scene.scan(&sensor, &trajectory, &options).unwrap()
            };
            let all = scan(FieldSet::all());
            for info in FIELDS {
                let alone = scan(FieldSet::EMPTY.with(info.field));
                assert_eq!(alone.len(), all.len(), "{}", info.name);
                assert!(alone.column(info.field).bytes() == all.column(info.field).bytes(), "{}", info.name);
            }
        }
    }
}

#[test]
fn points_of_sonars_are_read_back_from_files() {
    let folder = tempfile::tempdir().unwrap();
    let scene = flat(100.0);
    let cloud = scene.scan(&swath(), &Trajectory::fixed(pose()), &options(water(""))).unwrap();
    for name in ["a.las", "a.npz", "a.csv", "a.ply", "a.h5"] {
        let path = folder.path().join(name);
        cloud.write(&path).unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() > 31 * 12, "{name}");
    }
    let text = std::fs::read_to_string(folder.path().join("a.csv")).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|&found| found == name).unwrap_or_else(|| panic!("{name}"));
    for (row, line) in lines.enumerate() {
        let values: Vec<f64> = line.split(',').map(|text| text.parse().unwrap_or(f64::NAN)).collect();
        for (name, field) in [("range", Field::Range), ("intensity", Field::Intensity), ("true_z", Field::TrueZ)] {
            let expected = cloud.column(field).get_f64(row) + if name == "true_z" { cloud.origin.z } else { 0.0 };
            assert_near(name, values[column(name)], expected, 1e-3);
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let scene = flat(100.0);
    let refused = |sensor: &Sensor, z: f64, options: &ScanOptions| {
        scene.ping(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, z)), options).unwrap_err().to_string()
    };
    let fine = options(water(""));
    let above = refused(&sidescan(""), 51.0, &fine);
    assert!(above.starts_with("the depth of the sonar is -1 m; allowed: 0 m or more"), "{above}");
    let yaml =
        "water: {surface_z_m: 50, profile: {cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 20, speed_m_s: 1490}]}}";
    let outside = refused(&sidescan(""), 20.0, &options(Environment::from_yaml(yaml).unwrap()));
    assert!(outside.contains("allowed: 0 to 20 m, which the rows of water.profile.cast cover"), "{outside}");
    let light = refused(&Sensor::preset("velodyne_vlp16").unwrap(), 20.0, &fine);
    assert!(light.contains("lidar") && light.contains("sonar"), "{light}");
    for profile in [Profile::Paper, Profile::Blainder] {
        let paper = refused(&sidescan(""), 20.0, &fine.clone().profile(profile));
        assert!(paper.starts_with("profile is ") && paper.contains("allowed: physical"), "{paper}");
    }
    let pose = refused(&sidescan(""), f64::NAN, &fine);
    assert!(pose.starts_with("pose is "), "{pose}");
    let swath = sonar("type: multibeam, beams: 4096, swath_deg: 120", "acoustics.bin_m=0.001");
    let huge = refused(&swath, 20.0, &fine);
    assert!(huge.starts_with("acoustics.bin_m is 0.001 m: 100000 bins of 4096 beams"), "{huge}");
    let fine_bins = sonar("type: single_beam, beam_deg: 2", "acoustics.bandwidth_khz=1 acoustics.bin_m=0.006");
    let fine_bins = refused(&fine_bins, 20.0, &fine);
    assert!(fine_bins.starts_with("acoustics.bin_m is 0.006 m; allowed: at least 0.0062"), "{fine_bins}");
}
