use super::{assert_near, scan, scan_at, vector};
use echocast::{Frame, PointCloud, Pose, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape, raster, sensor};
use glam::{DAffine3, DQuat, DVec3};

/// Checks every point of `cloud`: `expected` gives range, unit normal on the sensor's side and part number for a world
/// direction; intensity is `reflectance` times the cosine. Normals, cosine and intensity within `tolerance`, range
/// within 1e-5 of itself.
#[track_caller]
fn check(
    cloud: &PointCloud,
    sensor: &Sensor,
    pose: Pose,
    (reflectance, tolerance): (f64, f64),
    expected: impl Fn(DVec3) -> Option<(f64, DVec3, u32)>,
) {
    let (c, beams) = (cloud.columns(), sensor.beams());
    let mut row = 0;
    for beam in 0..beams.len() {
        let along = pose.orientation * vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, beam).normalize();
        let Some((range, normal, part)) = expected(along) else { continue };
        assert_eq!(c.beam()[row], beam as u32, "each beam that meets a surface has its row");
        assert_near("range", c.range()[row].into(), range, 1e-5 * range);
        let place = pose.position + range * along;
        assert!((cloud.position(row) - place).length() <= 1e-5 * range, "{} is not {place}", cloud.position(row));
        let is = vector(c.normal_x(), c.normal_y(), c.normal_z(), row);
        assert!((is - normal).length() <= tolerance, "normal {is} is not {normal}");
        let cos = -normal.dot(along);
        assert_near("cosine", c.cos_incidence()[row].into(), cos, tolerance);
        assert_near("intensity", c.intensity()[row].into(), reflectance * cos, tolerance);
        assert_eq!(c.part_id()[row], part);
        row += 1;
    }
    assert_eq!(row, cloud.len());
    assert!(row > beams.len() / 20, "{row} of {} beams meet a surface", beams.len());
}

/// A plane through `point` with unit normal `normal`: range and normal on the sensor's side along `direction`.
fn plane(point: DVec3, normal: DVec3, origin: DVec3, direction: DVec3) -> Option<(f64, DVec3)> {
    let range = (point - origin).dot(normal) / direction.dot(normal);
    (range > 0.0).then_some((range, -normal * direction.dot(normal).signum()))
}

#[test]
fn a_wall_is_met_at_its_distance_over_the_cosine() {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.6);
    scene.stand(Shape::plate(10.0 * DVec3::X, DVec3::X, 500.0), Some(paint));
    let built = scene.finish().build().unwrap();
    let sensor = sensor(&raster(64, 64, 1.5));
    let cloud = scan(&built, &sensor, ScanOptions::default());
    check(&cloud, &sensor, Pose::IDENTITY, (0.6, 1e-5), |along| Some((10.0 / along.x, -DVec3::X, 1)));
    for row in 0..cloud.len() {
        assert_near("depth", cloud.columns().depth()[row].into(), 10.0, 1e-4);
    }
}

#[test]
fn a_tilted_plane_is_met_where_its_equation_says() {
    let normal = DVec3::new(-0.6, 0.3, 0.5).normalize();
    let point = DVec3::new(7.0, -1.0, 0.5);
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.35);
    scene.stand(Shape::plate(point, normal, 100.0), Some(paint));
    let built = scene.finish().build().unwrap();
    let pose = Pose::at(1.0, 2.0, -0.5).with_rpy_deg(10.0, 10.0, -5.0);
    let sensor = sensor(&raster(64, 64, 0.8));
    let cloud = scan_at(&built, &sensor, pose, ScanOptions::default());
    check(&cloud, &sensor, pose, (0.35, 1e-5), |along| {
        plane(point, normal, pose.position, along).map(|(range, normal)| (range, normal, 1))
    });
}

/// A unit sphere and ellipsoids made from it by scaling, each once and as copies. Its facets of less than half a degree
/// keep the range to 1e-5 and the normals to 3e-5.
#[test]
fn spheres_and_scaled_spheres_are_met_where_their_equation_says() {
    let ball = || Shape::sphere(1.0, 400);
    let scale = DVec3::new(1.0, -2.0, 0.7);
    let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.2);
    for (scale, copies) in [(DVec3::ONE, 1), (DVec3::ONE, 2), (scale, 1), (scale, 2)] {
        let placed = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(10.0, 0.5, 0.2));
        let mut scene = SceneBuilder::new();
        let paint = scene.reflector(0.8);
        let mesh = scene.mesh([(ball(), Some(paint))]);
        scene.place(mesh, placed);
        for _ in 1..copies {
            scene.place(mesh, DAffine3::from_translation(-50.0 * DVec3::X));
        }
        let built = scene.finish().build().unwrap();
        // Not beyond 45 degrees: there the facets' error grows.
        let all = raster(120, 120, 0.3);
        let object_from_world = placed.inverse();
        let meet = |along: DVec3| -> Option<(f64, DVec3, u32)> {
            let (o, d) = (object_from_world.translation, object_from_world.matrix3 * along);
            let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
            let root = b * b - a * c;
            let range = (root >= 0.0).then(|| (-b - root.sqrt()) / a)?;
            let normal = (object_from_world.matrix3.transpose() * (o + range * d)).normalize();
            Some((range, normal, 1))
        };
        let steep = |along: &DVec3| meet(*along).is_some_and(|(_, normal, _)| -normal.dot(*along) > 0.7);
        let sensor = sensor(&all.into_iter().filter(steep).collect::<Vec<_>>());
        let cloud = scan(&built, &sensor, ScanOptions::default());
        check(&cloud, &sensor, Pose::IDENTITY, (0.8, 3e-5), meet);
    }
}

/// Three plates of one object, each its own part, that meet in a corner.
#[test]
fn in_a_corner_the_nearest_of_three_planes_is_met() {
    let corner = DVec3::new(6.0, 4.0, -2.0);
    let reach = 50.0;
    let faces = [
        (Shape::quad(corner, -reach * DVec3::Y, reach * DVec3::Z), DVec3::X),
        (Shape::quad(corner, reach * DVec3::Z, -reach * DVec3::X), DVec3::Y),
        (Shape::quad(corner, -reach * DVec3::X, -reach * DVec3::Y), DVec3::Z),
    ];
    let normals = [DVec3::X, DVec3::Y, DVec3::Z];
    for copies in [1, 2] {
        let mut scene = SceneBuilder::new();
        let paint = scene.reflector(0.5);
        let mesh = scene.mesh(faces.clone().map(|(shape, _)| (shape, Some(paint))));
        for copy in 0..copies {
            scene.place(mesh, DAffine3::from_translation(150.0 * f64::from(copy) * DVec3::Z));
        }
        let built = scene.finish().build().unwrap();
        let pose = Pose::at(0.3, -0.7, 0.1).with_rpy_deg(0.0, 12.0, 35.0);
        let sensor = sensor(&raster(97, 97, 0.9));
        let cloud = scan_at(&built, &sensor, pose, ScanOptions::default());
        check(&cloud, &sensor, pose, (0.5, 1e-5), |along| {
            normals
                .into_iter()
                .zip(1..)
                .filter_map(|(n, part)| plane(corner, n, pose.position, along).map(|(range, n)| (range, n, part)))
                .min_by(|a, b| a.0.total_cmp(&b.0))
        });
    }
}

/// Copies of one square, tilted, stretched, sheared and mirrored into the faces of a corridor.
#[test]
fn copies_of_a_square_are_met_where_their_transforms_put_them() {
    let square = Shape::quad(DVec3::new(-1.0, -1.0, 0.0), 2.0 * DVec3::X, 2.0 * DVec3::Y);
    let places = [
        // (where 0, x and y of the square go)
        (DVec3::new(20.0, 0.0, 0.0), DVec3::new(0.0, 30.0, 0.0), DVec3::new(2.0, 3.0, 30.0)),
        (DVec3::new(10.0, 3.0, 0.0), DVec3::new(-60.0, 1.0, 0.0), DVec3::new(4.0, 0.0, -25.0)),
        (DVec3::new(10.0, -4.0, 0.0), DVec3::new(60.0, 2.0, 5.0), DVec3::new(0.0, 1.0, 90.0)),
    ];
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(1.0);
    let mesh = scene.mesh([(square, Some(paint))]);
    for (origin, x, y) in places {
        // The scale of the third axis is arbitrary, even mirrored.
        let z = -0.3 * x.cross(y).normalize();
        scene.place(mesh, DAffine3::from_cols(x, y, z, origin));
    }
    let built = scene.finish().build().unwrap();
    let sensor = sensor(&raster(71, 71, 1.0));
    let cloud = scan(&built, &sensor, ScanOptions::default());
    check(&cloud, &sensor, Pose::IDENTITY, (1.0, 1e-5), |along| {
        places
            .into_iter()
            .filter_map(|(origin, x, y)| plane(origin, x.cross(y).normalize(), DVec3::ZERO, along))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(range, normal)| (range, normal, 1))
    });
    // The instance number tells the copies apart.
    let (c, beams) = (cloud.columns(), sensor.beams());
    for row in 0..cloud.len() {
        let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, c.beam()[row] as usize);
        let (origin, x, y) = places[c.instance_id()[row] as usize - 1];
        let (range, _) = plane(origin, x.cross(y).normalize(), DVec3::ZERO, along).unwrap();
        assert_near("range of the copy", c.range()[row].into(), range, 1e-5 * range);
    }
}

#[test]
fn survey_coordinates_keep_a_tenth_of_a_millimetre() {
    let survey = DVec3::new(500_000.123_4, 5_600_000.567_8, 100.25);
    let normal = DVec3::new(-0.8, 0.5, 0.2).normalize();
    for copies in [1, 2] {
        let mut scene = SceneBuilder::new();
        let paint = scene.reflector(0.5);
        let mesh = scene.mesh([(Shape::plate(DVec3::ZERO, normal, 60.0), Some(paint))]);
        scene.place(mesh, DAffine3::from_translation(survey));
        for _ in 1..copies {
            scene.place(mesh, DAffine3::from_translation(survey + 40.0 * DVec3::X));
        }
        let built = scene.finish().build().unwrap();
        let pose = Pose { position: survey - 20.0 * DVec3::X + 0.333 * DVec3::Y, ..Pose::IDENTITY };
        let sensor = sensor(&raster(50, 50, 0.8));
        let cloud = scan_at(&built, &sensor, pose, ScanOptions::default());
        assert_eq!(cloud.len(), 2500);
        assert_eq!(cloud.sensor_pose, pose);
        let beams = sensor.beams();
        for row in 0..cloud.len() {
            let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row);
            let (range, _) = plane(survey, normal, pose.position, along).unwrap();
            let off = (cloud.position(row) - (pose.position + range * along)).length();
            assert!(off < 1e-4, "point {row} is {off} m off");
        }
    }
}

#[test]
fn in_the_sensor_frame_points_lie_along_the_beams() {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(5.0, 8).flat(), None);
    let built = scene.finish().build().unwrap();
    let pose = Pose::at(1.0, -0.5, 0.7).with_rpy_deg(25.0, 40.0, 130.0);
    let sensor = sensor(&raster(40, 40, 3.0));
    let options = || ScanOptions::default().coordinates(Frame::Sensor);
    let (world, own) =
        (scan_at(&built, &sensor, pose, ScanOptions::default()), scan_at(&built, &sensor, pose, options()));
    assert_eq!((own.frame, own.origin, own.len()), (Frame::Sensor, DVec3::ZERO, world.len()));
    for row in 0..own.len() {
        let moved = pose.position + pose.orientation * own.position(row);
        assert!((moved - world.position(row)).length() < 1e-5);
        let normal = |cloud: &PointCloud| {
            let c = cloud.columns();
            vector(c.normal_x(), c.normal_y(), c.normal_z(), row)
        };
        assert!((pose.orientation * normal(&own) - normal(&world)).length() < 1e-6);
    }
}

/// Angles are counter-clockwise from x in [-pi, pi), and up from the horizontal plane.
#[test]
fn reported_directions_are_those_of_the_beams() {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(5.0, 8).flat(), None);
    let built = scene.finish().build().unwrap();
    let axes = [DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 1.0, -1.0)];
    let options = ScanOptions::default().organised(true);
    let cloud = scan_at(&built, &sensor(&axes), Pose::at(0.1, 0.2, 0.3), options);
    let expected = [(0.0, 0.0), (90.0, 0.0), (-90.0, 0.0), (0.0, 90.0), (-180.0, 0.0), (45.0, -35.264_389_7)];
    for (row, (azimuth, elevation)) in expected.into_iter().enumerate() {
        assert_near("azimuth", f64::from(cloud.columns().azimuth()[row]).to_degrees(), azimuth, 1e-5);
        assert_near("elevation", f64::from(cloud.columns().elevation()[row]).to_degrees(), elevation, 1e-5);
    }
}

/// Survey coordinates keep a tenth of a millimetre, though a stray object stands at the other end of the country.
#[test]
fn a_stray_object_does_not_cost_the_others_their_precision() {
    let site = DVec3::new(500_000.0, 5_600_000.0, 100.0);
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(1.0, 4).flat(), None);
    let ball = scene.mesh([(Shape::sphere(1.0, 40), None)]);
    scene.place(ball, DAffine3::from_translation(site + 10.0 * DVec3::X));
    let built = scene.finish().build().unwrap();
    assert!((built.origin() - site).length() < 20.0, "{}", built.origin());
    let [warning] = &built.report().warnings[..] else { panic!("{:?}", built.report()) };
    assert!(warning.contains("reaches 5600 km from the scene's origin") && warning.contains("500.0 mm"), "{warning}");

    let pose = Pose { position: site, ..Pose::IDENTITY };
    let cloud = scan_at(&built, &sensor(&[DVec3::X]), pose, ScanOptions::default());
    assert!((cloud.position(0) - site - 9.0 * DVec3::X).length() < 1e-4, "{}", cloud.position(0));
}
