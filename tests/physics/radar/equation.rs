//! Power, noise, range, angles and velocities of one target.

use super::*;

/// Check values of Skolnik's equation for 12 dBm, 10 + 10 dBi, 10 m^2 at 100 m: -119.170 dBm; with a noise figure of
/// 14 dB and 128 x 25.6 us of coherent integration, 15.960 dB above the noise. Here with 30 dB more power, so that noise
/// disturbs little.
#[test]
fn echoes_have_the_power_and_the_snr_of_the_radar_equation() {
    let gains = "radar.array.tx_pattern.gain_dbi=10 radar.array.rx_pattern.gain_dbi=10 radar.windows.range=rect \
                 radar.windows.velocity=rect";
    let sensor = radar(gains);
    // The middle of a cell.
    let range = 171.0 * STEP;
    let further = 40.0 * (range / 100.0).log10();
    // Both of 10 m^2.
    let edge = (30.0 * WAVELENGTH * WAVELENGTH / (4.0 * PI)).powf(0.25);
    let side = (10.0 * WAVELENGTH * WAVELENGTH / (4.0 * PI)).powf(0.25);
    for (name, shape, kind) in [
        ("trihedral", trihedral(edge, DVec3::X * range), PathType::Internal),
        ("plate", Shape::plate(DVec3::X * range, DVec3::NEG_X, 0.5 * side), PathType::Direct),
    ] {
        let cloud = scan(&scene([(shape, METAL)]), &sensor, &options());
        let (row, c) = (first(&cloud), cloud.columns());
        assert_near(&format!("{name}: power"), c.power()[row].into(), -119.1697 + 30.0 - further, 0.3);
        assert_near(&format!("{name}: SNR"), c.snr()[row].into(), 15.960 + 30.0 - further, 0.3);
        assert_near(&format!("{name}: RCS"), c.rcs()[row].into(), 10.0, 0.5);
        assert_near(&format!("{name}: true RCS"), c.true_rcs()[row].into(), 10.0, 0.3);
        // Without windows, the cells beside the middle of a peak hold noise only.
        assert_near(&format!("{name}: range"), c.range()[row].into(), range, 0.1 * STEP);
        assert_near(&format!("{name}: true range"), c.true_range()[row].into(), range, 0.05);
        assert_near(&format!("{name}: Doppler"), c.doppler()[row].into(), 0.0, 0.1);
        assert_eq!((path(&cloud, row), c.instance_id()[row]), (kind, 1), "{name}");
    }
}

/// The same without the 30 dB: the mean of many frames, of which a third would not be detected.
#[test]
fn weak_echoes_have_the_snr_of_the_radar_equation_on_average() {
    let more = "radar.power_dbm=32 radar.windows.range=rect radar.windows.velocity=rect";
    let (sensor, range) = (radar(more), 171.0 * STEP);
    let edge = (30.0 * WAVELENGTH * WAVELENGTH / (4.0 * PI)).powf(0.25);
    let scene = scene([(trihedral(edge, DVec3::X * range), METAL)]);
    let frames = 40;
    let sum: f64 = (0..frames).map(|seed| cell(&cube(&scene, &sensor, &options().seed(seed)), range, 0.0)).sum();
    // Boltzmann's constant times 290 K, 25.12 of noise, over the time of integration.
    let noise = 1.380_649e-23 * 290.0 * 10f64.powf(1.4) / (128.0 * 25.6e-6);
    let snr = db((sum / f64::from(frames as u32) - noise) / noise);
    // Amplitude and noise: a standard error of 2 SNR + 1 over the number of frames, 0.11 dB.
    assert_near("SNR", snr, 15.960 - 40.0 * (range / 100.0).log10(), 0.4);
}

/// A corner anywhere in the field of view, which moves; range rates are positive where it recedes.
#[test]
fn targets_are_where_they_are_and_move_as_they_move() {
    let sensor = radar(SQUARE);
    for (azimuth_deg, elevation_deg, speed) in [(0.0, 0.0, 10.0), (20.0, 5.0, -14.0), (-25.0, -8.0, 3.0)] {
        let [azimuth, elevation] = [azimuth_deg, elevation_deg].map(f64::to_radians);
        let along = DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
        let place = 60.0 * along;
        let cloud = scan(&moving(trihedral(0.12, place), speed * along), &sensor, &options());
        let (row, c) = (first(&cloud), cloud.columns());
        let what = |name: &str| format!("{name} at {azimuth_deg}, {elevation_deg} degrees");
        // A moving target appears too far by v f / S.
        let coupling = speed * 77e9 / 10e12;
        assert_near(&what("range"), c.range()[row].into(), 60.0 + coupling, 0.1);
        assert_near(&what("azimuth"), c.azimuth()[row].into(), azimuth, 0.005);
        assert_near(&what("elevation"), c.elevation()[row].into(), elevation, 0.005);
        assert_near(&what("range rate"), c.doppler()[row].into(), speed, 0.05);
        assert_near(&what("true range rate"), c.radial_velocity()[row].into(), speed, 1e-3);
        assert_near(&what("true range"), c.true_range()[row].into(), 60.0, 0.15);
        assert_eq!((path(&cloud, row), c.instance_id()[row]), (PathType::Internal, 1));
        let from = DVec3::new(c.x()[row].into(), c.y()[row].into(), c.z()[row].into());
        assert!((from - (60.0 + coupling) * along).length() < 0.5, "{from}");
    }
}

/// What stands approaches a radar that drives, by `-v cos` at every angle.
#[test]
fn what_stands_approaches_a_radar_that_drives() {
    let place = DVec3::new(50.0, 20.0, 0.0);
    let scene = scene([(trihedral(0.15, place), METAL)]);
    let start = Pose { position: DVec3::X * (-12.0 * 0.5 * 128.0 * 25.6e-6), ..Pose::IDENTITY };
    let end = Pose { position: start.position + DVec3::X * 12.0, ..Pose::IDENTITY };
    let drive = Trajectory::new(vec![(0.0, start), (1.0, end)]).unwrap();
    let cloud = scene.scan(&radar(""), &drive, &options()).unwrap();
    let (row, c) = (first(&cloud), cloud.columns());
    let rate = -12.0 * place.x / place.length();
    assert_near("range rate", c.doppler()[row].into(), rate, 0.05);
    // Of the part of the corner that scatters, a few centimetres from its apex.
    assert_near("true range rate", c.radial_velocity()[row].into(), rate, 0.01);
}

/// 1 m/s more than can be told from approaching: folded by twice the greatest range rate.
#[test]
fn velocities_fold() {
    for (speed, folded) in [(FASTEST + 1.0, 1.0 - FASTEST), (-FASTEST - 1.0, FASTEST - 1.0)] {
        let cloud = scan(&moving(trihedral(0.12, DVec3::X * 60.0), speed * DVec3::X), &radar(""), &options());
        let (row, c) = (first(&cloud), cloud.columns());
        assert_near("folded", c.doppler()[row].into(), folded, 0.05);
        assert_near("true", c.radial_velocity()[row].into(), speed, 1e-3);
        assert_eq!((path(&cloud, row), c.instance_id()[row]), (PathType::Alias, 1));
    }
}

/// The rim of a wheel of 0.3 m that rolls at 50 km/h: its top moves at twice that, 14,269 Hz, its bottom stands.
#[test]
fn wheels_roll() {
    let (speed, radius, middle) = (50.0 / 3.6, 0.3, 0.5 * 128.0 * 25.6e-6);
    // Small plates on the rim, at places of their own along y, that face the radar at the middle of the frame.
    let mut shape = Shape::default();
    let places = [(0.0, 2.0), (0.5, 1.0), (1.0, 0.0)];
    for (turn, _) in places {
        let (sin, cos) = (PI * turn).sin_cos();
        let at = DVec3::new(radius * sin, 0.0, radius * cos);
        shape = shape.and(Shape::plate(at, DVec3::NEG_X, 0.01));
    }
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let wheel = live.add_scene(&standing([(shape, METAL)])).unwrap()[0];
    let key = |time: f64| {
        let along = speed * (time - middle);
        // Rolling towards +x turns about y.
        let turn = DQuat::from_rotation_y(along / radius);
        (time, DAffine3::from_rotation_translation(turn, DVec3::new(30.0 + along, 0.0, 0.0)))
    };
    let keys: Vec<_> = (0..=20).map(|index| key(0.001 * f64::from(index) - 0.008)).collect();
    live.set_motion(wheel, &keys).unwrap();
    live.set_time(0.0, 0.0033).unwrap();
    let built = live.commit().unwrap();
    let cube = cube(&built, &radar("radar.power_dbm=60"), &options());
    // Towards the radar everything is within two cells of range.
    let spectrum = |rate: f64| {
        let range = 30.0 + rate * 77e9 / 10e12;
        (-2..=2).map(|cells| cell(&cube, range + f64::from(cells) * STEP, rate)).fold(0.0, f64::max)
    };
    for (_, part) in places {
        let rate = part * speed;
        let echo = spectrum(rate);
        for beside in [-5.0, 5.0] {
            let ratio = db(echo / spectrum(rate + beside));
            assert!(ratio > 15.0, "{rate} m/s: {ratio} dB more than at {beside} m/s beside");
        }
    }
    // Check value: 2 x 2v / lambda.
    assert_near("Doppler shift of the top, Hz", 2.0 * 2.0 * speed / WAVELENGTH, 14_269.13, 0.1);
}
