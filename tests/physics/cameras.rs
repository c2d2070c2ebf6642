use super::{assert_near, scan, scan_at, vector};
use echocast::{BuiltScene, Cause, Frame, PointCloud, Pose, Profile, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// Walls across the x axis or not, all of reflectance 0.5.
fn walls(shapes: impl IntoIterator<Item = Shape>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    for shape in shapes {
        scene.stand(shape, Some(paint));
    }
    scene.finish().build().unwrap()
}

/// A wall head-on at `depth` m that fills every view.
fn wall(depth: f64) -> BuiltScene {
    walls([Shape::plate(depth * DVec3::X, -DVec3::X, 200.0)])
}

/// A camera of 200 x 200 pixels and 60 degrees with the section `tof`.
fn camera(tof: &str) -> Sensor {
    camera_with(&format!("tof: {tof}"))
}

fn camera_with(sections: &str) -> Sensor {
    let pattern = "name: camera\nkind: tof\npattern: {type: pinhole, resolution: [200, 200], fov_deg: [60, 60]}\n";
    Sensor::from_yaml(&format!("{pattern}{sections}\n"), "").unwrap()
}

/// Size of its pixels in units of the focal length.
fn pixel() -> f64 {
    2.0 * 30f64.to_radians().tan() / 200.0
}

fn sigma(sample: &[f64]) -> f64 {
    let mean = sample.iter().sum::<f64>() / sample.len() as f64;
    (sample.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / sample.len() as f64).sqrt()
}

/// Checks that `sample` has mean 0 and standard deviation `expected`, within 3 standard errors of each.
#[track_caller]
fn assert_sigma(sample: &[f64], expected: f64) {
    let n = sample.len() as f64;
    assert_near("mean", sample.iter().sum::<f64>() / n, 0.0, 3.0 * expected / n.sqrt());
    assert_near("sigma", sigma(sample), expected, 3.0 * expected / (2.0 * n).sqrt());
}

/// Measured minus true value of each point, from two columns.
fn errors(measured: &[f32], truth: &[f32]) -> Vec<f64> {
    measured.iter().zip(truth).map(|(&is, &truth)| f64::from(is) - f64::from(truth)).collect()
}

/// True depth of each point.
fn true_depths(cloud: &PointCloud) -> Vec<f32> {
    assert_eq!(cloud.frame, Frame::World);
    cloud.columns().true_x().to_vec()
}

/// A wall at 10 m in light of 20 MHz, whose phase wraps at 7.49481 m: points lie at the remainder, the truth stays.
#[test]
fn ranges_wrap() {
    let cloud = scan(&wall(10.0), &camera("{frequencies_mhz: [20], wiggle_residual: 0}"), ScanOptions::default());
    let c = cloud.columns();
    assert_eq!(cloud.len(), 40_000);
    for row in 0..cloud.len() {
        assert_near("range", c.range()[row].into(), f64::from(c.true_range()[row]) % 7.494_811_45, 2e-6);
        let along = vector(c.true_x(), c.true_y(), c.true_z(), row).normalize();
        assert!((cloud.position(row) - along * f64::from(c.range()[row])).length() < 1e-5);
    }
    // Reported ranges keep to the limits, though the wall is beyond them.
    let limited = camera_with("range: {max_m: 4}\ntof: {frequencies_mhz: [20], wiggle_residual: 0}");
    let near = scan(&wall(10.0), &limited, ScanOptions::default());
    assert!(near.len() > 20_000 && near.len() < 40_000);
    assert!(near.columns().range().iter().all(|&range| range <= 4.0));
}

#[test]
fn three_frequencies_see_to_the_range_of_their_divisor() {
    let sensor = camera("{frequencies_mhz: [16, 80, 120], wiggle_residual: 0}");
    for (depth, wrap) in [(2.0, 0.0), (9.0, 0.0), (20.0, 18.737_028_6)] {
        let cloud = scan(&wall(depth), &sensor, ScanOptions::default());
        for (&is, &truth) in cloud.columns().range().iter().zip(cloud.columns().true_range()) {
            let past_the_wrap = f64::from(truth) >= 18.737_028_6;
            assert_near("range", is.into(), f64::from(truth) - if past_the_wrap { wrap } else { 0.0 }, 4e-6);
        }
    }
}

/// Four taps at 20 MHz, uncalibrated and not: the error of 0.5 m, computed with numpy.
#[test]
fn ranges_wiggle() {
    for (residual, expected) in [(1.0, -0.085_570_6), (0.1, -0.008_557_06)] {
        let sensor = camera(&format!("{{frequencies_mhz: [20], wiggle_residual: {residual}}}"));
        let cloud = scan(&wall(0.5), &sensor, ScanOptions::default());
        let c = cloud.columns();
        // The pixel nearest to the axis, 0.5 m and a few micrometres away.
        let centre = (0..cloud.len()).min_by(|&a, &b| c.true_range()[a].total_cmp(&c.true_range()[b])).unwrap();
        let error = f64::from(c.range()[centre]) - f64::from(c.true_range()[centre]);
        assert_near("error", error, expected, 1e-4 * expected.abs());
    }
}

/// The target of the data sheet has its sigma, a darker one more: by the root of the light alone, in full under the
/// sun.
#[test]
fn shot_noise_is_that_of_the_target() {
    // Head-on within a degree: the light is even to 1e-3.
    let narrow = "name: camera\nkind: tof\npattern: {type: pinhole, resolution: [200, 200], fov_deg: [1, 1]}\n";
    for (ambient, depth, expected) in
        [(0.0, 2.0, 0.004), (0.0, 4.0, 0.008), (1.0, 4.0, 0.016 * (0.625f64).sqrt()), (1e9, 4.0, 0.016)]
    {
        let noise = format!("{{sigma_m: 0.004, reflectance: 0.5, at_m: 2, ambient: {ambient}}}");
        let tof = format!("tof: {{frequencies_mhz: [16, 80, 120], wiggle_residual: 0, shot_noise: {noise}}}");
        let sensor = Sensor::from_yaml(&format!("{narrow}{tof}\n"), "").unwrap();
        let cloud = scan(&wall(depth), &sensor, ScanOptions::default().seed(1));
        assert_sigma(&errors(cloud.columns().range(), cloud.columns().true_range()), expected);
    }
}

/// cos^4 of the lens, and what the projector leaves at its edges; pixels below the threshold are invalid.
#[test]
fn lens_and_projector_dim_the_corners() {
    let radar = "detection: {model: radar_equation, reflectance: 0.5, at_m: 4}\n";
    let light = "illumination: [{angle_deg: 0, value: 1}, {angle_deg: 20, value: 1}, {angle_deg: 30, value: 0.5}]";
    let cloud = scan(
        &wall(3.0),
        &camera_with(&format!("{radar}tof: {{vignetting: cos4, {light}}}")),
        ScanOptions::default().organised(true),
    );
    let c = cloud.columns();
    let (mut seen, mut lost) = (0, 0);
    for row in 0..cloud.len() {
        let (y, z) = ((row % 200) as f64, (row / 200) as f64);
        let off = [y, z].map(|index| (99.5 - index) * pixel());
        let tan = off[0].hypot(off[1]);
        let cos = 1.0 / (1.0 + tan * tan).sqrt();
        let out = 1.0 - 0.05 * (tan.atan().to_degrees() - 20.0).clamp(0.0, 10.0);
        // Wall, then lens, then projector.
        let expected = 0.5 * cos * cos.powi(4) * out;
        let power = expected / (3.0 / cos).powi(2) / (0.5 / 16.0);
        if (power - 1.0).abs() < 1e-4 {
            continue;
        }
        assert_eq!(c.range()[row].is_nan(), power < 1.0, "row {row}: power {power}");
        if power > 1.0 {
            assert_near("intensity", c.intensity()[row].into(), expected, 1e-5);
            seen += 1;
        } else {
            lost += 1;
        }
    }
    assert!(seen > 5000 && lost > 5000, "{seen} {lost}");
}

#[test]
fn bright_targets_overdrive_pixels() {
    let sensor = camera("{saturation: {reflectance: 0.5, at_m: 2}}");
    assert_eq!(scan(&wall(1.0), &sensor, ScanOptions::default()).len(), 0);
    assert_eq!(scan(&wall(2.1), &sensor, ScanOptions::default()).len(), 40_000);
}

/// Published laws at 2 m and others, head-on where they have an incidence; points move along their rays.
#[test]
fn depths_err_as_their_laws_say() {
    let laws = [
        ("{model: khoshelham}", 3.0, 1.425e-3 * 9.0),
        ("{model: nguyen}", 2.0, 6.064e-3),
        ("{model: fankhauser}", 4.5, 5.325e-3),
        ("{model: polynomial, sigma_m: [0.005, 0.001, 0]}", 9.0, 0.014),
        ("{model: disparity, sigma_px: 0.08}", 2.0, 4.0 * 0.08 * pixel() / 0.05),
    ];
    for (law, depth, expected) in laws {
        let mut sensor = camera(&format!("{{depth_noise: {law}, second_eye_m: [0, -0.05, 0]}}"));
        // Head-on within two degrees, where the addition for slanted surfaces is below 1e-3 of it.
        if law.contains("nguyen") || law.contains("fankhauser") {
            sensor.set("pattern.fov_deg", "[2, 2]").unwrap();
        }
        // Khoshelham's steps are uniform over a range of depths: a slightly leaning wall.
        let lean = if law.contains("khoshelham") { 0.1 } else { 0.0 };
        let leaning = Shape::plate(depth * DVec3::X, DVec3::new(-1.0, 0.0, lean).normalize(), 200.0);
        let cloud = scan(&walls([leaning]), &sensor, ScanOptions::default().seed(5));
        assert_eq!(cloud.len(), 40_000);
        let c = cloud.columns();
        let truth = true_depths(&cloud);
        let scaled: Vec<f64> = errors(c.depth(), &truth)
            .iter()
            .zip(&truth)
            .map(|(error, &truth)| if lean > 0.0 { error * (depth / f64::from(truth)).powi(2) } else { *error })
            .collect();
        assert_sigma(&scaled, expected);
        for row in (0..cloud.len()).step_by(37) {
            let along = vector(c.true_x(), c.true_y(), c.true_z(), row).normalize();
            assert!((cloud.position(row) - along * f64::from(c.range()[row])).length() < 1e-5);
        }
    }
}

/// A head-on wall has one depth wherever a pixel looks. On a leaning one the depth errs by the deviation of the pixel's
/// direction; the true point is where it looked.
#[test]
fn pixels_look_aside() {
    let sensor = camera("{lateral_sigma_px: 0.8}");
    let cloud = scan(&wall(3.0), &sensor, ScanOptions::default());
    assert!(cloud.columns().depth().iter().all(|depth| (depth - 3.0).abs() < 1e-5));
    assert_eq!(cloud.len(), 40_000);

    for frame in [Frame::World, Frame::Sensor] {
        let pose = Pose::at(1.0, -2.0, 0.5).with_rpy_deg(10.0, -20.0, 30.0);
        let normal = DVec3::new(-1.0, 0.5, 0.0).normalize();
        let (to_world, at) = (pose.orientation, pose.position);
        let leaning = walls([Shape::plate(at + to_world * (3.0 * DVec3::X), to_world * normal, 200.0)]);
        let cloud = scan_at(&leaning, &sensor, pose, ScanOptions::default().coordinates(frame));
        assert_eq!(cloud.len(), 40_000);
        let c = cloud.columns();
        let to_sensor = |point: DVec3| match frame {
            Frame::World => to_world.inverse() * (point - at),
            Frame::Sensor => point,
        };
        let (mut aside, mut down) = (Vec::new(), Vec::new());
        for row in 0..cloud.len() {
            let measured = to_sensor(cloud.position(row));
            let truth = to_sensor(cloud.origin + vector(c.true_x(), c.true_y(), c.true_z(), row));
            assert_near("truth is on the wall", (truth - 3.0 * DVec3::X).dot(normal), 0.0, 1e-4);
            assert_near("depth", measured.x, truth.x, 1e-4);
            assert_near("depth", c.depth()[row].into(), truth.x, 1e-4);
            let beam = c.beam()[row] as f64;
            let place = [(99.5 - beam % 200.0) * pixel(), (99.5 - (beam / 200.0).floor()) * pixel()];
            assert_near("reported place", measured.y / measured.x, place[0], 1e-4);
            assert_near("reported place", measured.z / measured.x, place[1], 1e-4);
            aside.push((truth.y / truth.x - place[0]) / pixel());
            down.push((truth.z / truth.x - place[1]) / pixel());
        }
        assert_sigma(&aside, 0.8);
        assert_sigma(&down, 0.8);
    }
}

/// A board before a wall, seen from the origin and from an eye 75 mm to its right: the wall has a shadow of width
/// B (z2 / z1 - 1) = B z2 (1/z1 - 1/z2) on the left of the board, away from that eye, and none on the right.
#[test]
fn boards_cast_a_shadow_away_from_the_second_eye() {
    let (near, far, half, baseline) = (1.0, 2.0, 0.2, 0.075);
    let board = Shape::plate(near * DVec3::X, -DVec3::X, half);
    let built = walls([board, Shape::plate(far * DVec3::X, -DVec3::X, 50.0)]);
    let sensor = camera(&format!("{{second_eye_m: [0, -{baseline}, 0]}}"));
    let options = ScanOptions::default().organised(true);
    let cloud = scan(&built, &sensor, options.clone());
    let mut shadow = 0;
    for beam in 0..cloud.len() {
        let [y, z] = [beam % 200, beam / 200].map(|index| (99.5 - index as f64) * pixel());
        let on_board = y.abs() < half / near && z.abs() < half / near;
        // Where the line from the eye to the wall passes the board's depth.
        let part = near / far;
        let passes = [(1.0 - part) * -baseline + part * far * y, part * far * z];
        let edge = passes.iter().any(|place| (place.abs() - half).abs() < 1e-4);
        if edge {
            continue;
        }
        let hidden = !on_board && passes.iter().all(|place| place.abs() < half);
        assert_eq!(cloud.columns().range()[beam].is_nan(), hidden, "{y} {z}");
        assert!(!hidden || y > 0.0, "on the left");
        shadow += usize::from(hidden);
    }
    // Width times height of the board, in pixels.
    let width = baseline * (1.0 / near - 1.0 / far) / pixel();
    let expected = width * 2.0 * half / near / pixel();
    // Whole columns and rows: one more or one fewer of each.
    assert_near("pixels in the shadow", shadow as f64, expected, width + 2.0 * half / near / pixel() + 1.0);

    // A second eye above casts it downwards; a mask that hides the board from the camera hides its shadow too.
    let above = scan(&built, &camera("{second_eye_m: [0, 0, 0.075]}"), options.clone());
    let lost: Vec<usize> = (0..above.len()).filter(|&beam| above.columns().range()[beam].is_nan()).collect();
    assert!(!lost.is_empty() && lost.iter().all(|beam| beam / 200 >= 100), "below the middle row");
    let open = scan(&wall(far), &sensor, options);
    assert!(open.columns().range().iter().all(|range| !range.is_nan()), "a wall does not hide itself");
}

/// Walls met at a grazing angle do not hide themselves, even far from the world's origin.
#[test]
fn surfaces_do_not_hide_themselves() {
    let ball = Shape::sphere(1.0, 24);
    let floor = Shape::plate(-0.4 * DVec3::Z, DVec3::Z, 300.0);
    let sensor = camera("{second_eye_m: [0, -0.075, 0]}");
    for pose in [Pose::IDENTITY, Pose::at(250.0, 100.0, 0.0).with_rpy_deg(0.0, 0.0, 50.0)] {
        let open = camera_with("");
        let built = walls([floor.clone()]);
        let all = scan_at(&built, &open, pose, ScanOptions::default()).len();
        assert_eq!(scan_at(&built, &sensor, pose, ScanOptions::default()).len(), all);
    }
    // An eye 1 m to the side misses a sliver of a ball 3 m away, 1 - cos(1/3) of its radius wide.
    let mut scene = SceneBuilder::new();
    let mesh = scene.mesh([(ball, None)]);
    scene.place(mesh, glam::DAffine3::from_translation(3.0 * DVec3::X));
    let built = scene.finish().build().unwrap();
    let all = scan(&built, &camera_with(""), ScanOptions::default()).len();
    let seen = scan(&built, &camera("{second_eye_m: [0, -1, 0]}"), ScanOptions::default()).len();
    assert!(seen < all * 99 / 100 && seen > all * 95 / 100, "{seen} of {all}");
}

/// Two square walls of half `half` m that meet at a right angle 2 m ahead, like the corner of a room.
fn corner(half: f64) -> BuiltScene {
    let along = |sign: f64| DVec3::new(-1.0, sign, 0.0).normalize();
    // Each begins at the corner.
    let wall = |sign: f64| Shape::plate(2.0 * DVec3::X + half * along(sign), along(-sign), half);
    walls([wall(1.0), wall(-1.0)])
}

/// A few pixels that look at one place of a corner see it too far, by the effect of light over the other wall: its
/// phasors summed over that wall, square by square.
#[test]
fn light_over_two_walls_makes_corners_round() {
    let (half, frequency) = (1.5, 20e6);
    let built = corner(half);
    // 100 beams within a twentieth of a degree, 3 degrees left of the corner.
    let pattern = "name: camera\nkind: tof\npattern: {type: raster, azimuth: {fov_deg: 0.045, step_deg: 0.005, \
                   centre_deg: 3}, elevation: {fov_deg: 0.045, step_deg: 0.005}}\n";
    let tof = "tof: {frequencies_mhz: [20], wiggle_residual: 0, multipath_rays: 256}\n";
    let sensor = Sensor::from_yaml(&format!("{pattern}{tof}"), "").unwrap();
    let cloud = scan(&built, &sensor, ScanOptions::default().seed(3));
    let c = cloud.columns();
    assert_eq!(cloud.len(), 100);
    let found = errors(c.range(), c.true_range());

    // Light goes out at the origin; T lies on the left wall, M on the right one. Powers as `rho cos / R^2`.
    let target = DVec3::new(3f64.to_radians().cos(), 3f64.to_radians().sin(), 0.0);
    let (to_left, to_right) = (DVec3::new(-1.0, 1.0, 0.0).normalize(), DVec3::new(-1.0, -1.0, 0.0).normalize());
    let target = target * (2.0 * DVec3::X.dot(to_right) / target.dot(to_right));
    let wavenumber = 4.0 * std::f64::consts::PI * frequency / 299_792_458.0;
    let range = target.length();
    let direct = 0.5 * -target.normalize().dot(to_right) / (range * range);
    let mut sum = [direct * (wavenumber * range).cos(), direct * (wavenumber * range).sin()];
    let cells = 1000;
    let size = 2.0 * half / f64::from(cells);
    for i in 0..cells {
        for j in 0..cells {
            let [a, b] = [i, j].map(|index| (f64::from(index) + 0.5) * size);
            let place = 2.0 * DVec3::X + a * to_right + (b - half) * DVec3::Z;
            let (out, back) = (place.length(), target - place);
            let cosines =
                [-place.normalize().dot(to_left), back.normalize().dot(to_left), -back.normalize().dot(to_right)];
            let shape = cosines.iter().product::<f64>() / (std::f64::consts::PI * back.length_squared());
            let power = 0.25 * shape / (out * out) * size * size;
            let way = 0.5 * (out + back.length() + range);
            sum = [sum[0] + power * (wavenumber * way).cos(), sum[1] + power * (wavenumber * way).sin()];
        }
    }
    let expected = sum[1].atan2(sum[0]) / wavenumber - range;
    assert!(expected > 0.01, "{expected}");
    let n = found.len() as f64;
    let mean = found.iter().sum::<f64>() / n;
    assert_near("error", mean, expected, 3.0 * sigma(&found) / n.sqrt());
    assert!(c.cause().iter().all(|&cause| cause == echocast::Cause::Multipath as u8));
}

/// In the image of a corner all points lie behind the walls, most in its middle; on a single wall none does.
#[test]
fn corners_bend_away_and_walls_stay() {
    let tof = "{frequencies_mhz: [16, 80, 120], wiggle_residual: 0, multipath_rays: 16}";
    let mut sensor = camera(tof);
    sensor.set("pattern.resolution", "[60, 20]").unwrap();
    sensor.set("pattern.fov_deg", "[60, 20]").unwrap();
    let cloud = scan(&corner(1.5), &sensor, ScanOptions::default());
    let c = cloud.columns();
    let error = |beam: u32| errors(c.range(), c.true_range())[beam as usize];
    assert_eq!(cloud.len(), 60 * 20);
    let column = |x: u32| (0..20).map(|row| error(row * 60 + x)).sum::<f64>() / 20.0;
    assert!(column(29) > 1.5 * column(2) && column(30) > 1.5 * column(57), "{} {}", column(29), column(2));
    assert!((0..60).all(|x| column(x) > 0.0));
    let alone = scan(&wall(2.0), &sensor, ScanOptions::default());
    let plain = scan(&wall(2.0), &camera("{frequencies_mhz: [20]}"), ScanOptions::default());
    assert!(errors(alone.columns().range(), alone.columns().true_range()).iter().all(|error| error.abs() < 1e-5));
    assert!(alone.columns().cause().iter().chain(plain.columns().cause()).all(|&cause| cause == 0));
}

/// The paper's profiles know none of this.
#[test]
fn other_profiles_have_ideal_cameras() {
    let sensor = camera("{frequencies_mhz: [20], vignetting: cos4, lateral_sigma_px: 1, second_eye_m: [0, 1, 0]}");
    for profile in [Profile::Paper, Profile::Blainder] {
        let options = ScanOptions::default().profile(profile);
        let is = scan(&wall(10.0), &sensor, options.clone());
        let ideal = scan(&wall(10.0), &camera_with(""), options);
        assert_eq!(
            (is.columns().range(), is.columns().intensity()),
            (ideal.columns().range(), ideal.columns().intensity())
        );
    }
}

/// A pixel half on a board at 1 m and half on a wall at 4 m, 16 MHz: the phasors of both with 1/d^2 amplitudes give
/// 1.086479 m. Computed with numpy. The light is mostly the board's, and the pixel is mixed.
#[test]
fn pixels_fly_between_what_they_see() {
    let board = Shape::quad([1.0, 0.0, -2.0].into(), 4.0 * DVec3::Y, 4.0 * DVec3::Z);
    let built = walls([board, Shape::plate(4.0 * DVec3::X, -DVec3::X, 50.0)]);
    let pattern = "name: pixel\nkind: tof\npattern: {type: pinhole, resolution: [1, 1], fov_deg: [2, 2]}\n";
    let tof = "tof: {frequencies_mhz: [16], wiggle_residual: 0}\nbeam: {sub_rays: 256}\n";
    let sensor = Sensor::from_yaml(&format!("{pattern}{tof}"), "").unwrap();
    let cloud = scan(&built, &sensor, ScanOptions::default());
    let c = cloud.columns();
    assert_eq!((cloud.len(), c.cause()[0]), (1, Cause::Mixed as u8));
    assert_near("range", c.range()[0].into(), 1.086_479, 0.003);
    assert_near("true range", c.true_range()[0].into(), 1.0, 3e-4);
    // A pixel that lies on one of them does not fly.
    let near = scan_at(&built, &sensor, Pose::at(0.0, 0.5, 0.0), ScanOptions::default());
    assert_near("on the board", near.columns().range()[0].into(), 1.0, 3e-4);
    assert_eq!(near.columns().cause()[0], Cause::Surface as u8);
    // If one ray represents the pixel it cannot.
    for (key, value, expected) in [
        ("tof.multipath_rays", "4", "beam.sub_rays: is 256; allowed: 1 with tof.multipath_rays"),
        ("tof.second_eye_m", "[0, 0.1, 0]", "beam.sub_rays: is 256; allowed: 1 with tof.second_eye_m"),
    ] {
        let error = sensor.clone().set(key, value).unwrap_err().to_string();
        assert!(error.ends_with(expected), "{error}");
    }
}
