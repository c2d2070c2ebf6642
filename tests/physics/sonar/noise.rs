//! What is heard besides echoes of surfaces.

use super::*;
use echocast::medium::AmbientNoise;

const SIDES: &str = "pattern.sides=both acoustics.noise_level_db=80 acoustics.pulse_ms=2";

fn empty(sensor: &Sensor, frame: u32, more: &str) -> Ping {
    let options = options(water(more)).frame(frame);
    // No surface either: the sonar is deeper than its range.
    ping(&nothing(), sensor, Pose::at(0.0, 0.0, -300.0), &options)
}

fn powers(ping: &Ping, beam: usize) -> Vec<f64> {
    ping.levels(beam).iter().map(|&level| power(level.into())).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn an_empty_sea_is_as_loud_as_its_noise() {
    for speckle in ["off", "frozen"] {
        for (more, level) in [
            ("acoustics.directivity_index_db=20 acoustics.processing_gain_db=7", 80.0 - 20.0 - 7.0),
            // The gain of a chirp: 15 kHz x 2 ms.
            ("acoustics.directivity_index_db=20", 80.0 - 20.0 - db(30.0)),
            ("acoustics.directivity_index_db=0 acoustics.bin_m=0.01", 80.0 - db(30.0)),
            ("acoustics.directivity_index_db=0 acoustics.bin_m=0.2", 80.0 - db(30.0)),
            // The equivalent noise bandwidth of a Hamming window, Harris 1978.
            ("acoustics.directivity_index_db=0 acoustics.taper=hamming", 80.0 - db(30.0) + db(1.3628)),
        ] {
            let found = empty(&sidescan(&format!("{SIDES} {more} acoustics.speckle={speckle}")), 0, "");
            assert_near("what the layout says", found.layout().noise_db.into(), level, 1e-3);
            for beam in [0, 1] {
                // Neighbouring short bins are heard together: fewer than all of them are independent.
                let powers = powers(&found, beam);
                let error = 4.343 / (100.0 / 0.05f64.max(found.layout().bin_m)).sqrt();
                assert_near(&format!("{more} {speckle}"), db(mean(&powers)), level, 4.0 * error);
            }
        }
    }
    // Without a directivity, 10 log(4 pi L H / lambda^2) of the face that makes the beam, here widths of 0.5 and 50
    // degrees; H is hardly longer than a wavelength.
    let found = empty(&sidescan(SIDES), 0, "");
    let length = |degrees: f64| 0.442_946_47 / (0.5 * degrees).to_radians().sin();
    let face = db(4.0 * std::f64::consts::PI * length(0.5) * length(50.0));
    assert_near("directivity", 80.0 - db(30.0) - f64::from(found.layout().noise_db), face, 0.6);
}

#[test]
fn sides_and_pings_have_their_own_noise() {
    let sensor = sidescan(SIDES);
    let (one, two) = (empty(&sensor, 0, ""), empty(&sensor, 1, ""));
    let all = [powers(&one, 0), powers(&one, 1), powers(&two, 0), powers(&two, 1)];
    for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        let (a, b) = (&all[a], &all[b]);
        let (over_a, over_b) = (mean(a), mean(b));
        let product = a.iter().zip(b).map(|(x, y)| (x / over_a - 1.0) * (y / over_b - 1.0)).sum::<f64>();
        let correlation = product / a.len() as f64;
        assert!(correlation.abs() < 0.1, "{correlation}");
    }
    let scintillation = mean(&all[0].iter().map(|p| p * p).collect::<Vec<_>>()) / mean(&all[0]).powi(2) - 1.0;
    assert_near("scintillation of noise", scintillation, 1.0, 0.15);
}

/// Each cell is above the threshold with probability `exp(-10^(threshold / 10))`.
#[test]
fn false_alarms_are_as_many_as_the_threshold_lets() {
    for threshold in [3.0, 6.0, 9.0] {
        let sensor = sidescan(&format!("{SIDES} acoustics.detection_threshold_db={threshold}"));
        let fields = FieldSet::all();
        let (mut count, mut cells) = (0, 0);
        for frame in 0..20 {
            let found = empty(&sensor, frame, "");
            let cloud = found.cloud(&options(water("")).frame(frame).fields(fields)).unwrap();
            assert!(cloud.columns().cause().iter().all(|&cause| cause == 7));
            assert!(cloud.columns().category_id().iter().all(|&id| id == 0));
            assert!(cloud.columns().true_range().iter().all(|range| range.is_nan()));
            let above = (0..found.layout().cells()).filter(|&cell| {
                found.cells().intensity()[cell] > found.layout().threshold_db[cell % found.layout().bins]
            });
            assert_eq!(cloud.len(), above.count());
            count += cloud.len();
            cells += found.layout().cells();
        }
        let expected = cells as f64 * (-power(threshold)).exp();
        // Neighbours come together.
        let tolerance = 4.0 * (2.0 * expected).sqrt();
        assert_near(&format!("false alarms at {threshold} dB"), count as f64, expected, tolerance);
    }
}

#[test]
fn the_sea_is_heard_where_no_noise_is_given() {
    for (wind, frequency) in [(0.0, 450.0), (12.0, 30.0)] {
        let mut sensor = sidescan("pattern.along_deg=3");
        let sound =
            format!("{{frequency_khz: {frequency}, bandwidth_khz: 15, directivity_index_db: 10, speckle: off}}");
        sensor.set("acoustics", &sound).unwrap();
        let yaml = format!("water: {{surface_z_m: 50, wind_m_s: {wind}, shipping: 0.5}}");
        let options = options(Environment::from_yaml(&yaml).unwrap());
        let found = ping(&nothing(), &sensor, Pose::at(0.0, 0.0, -300.0), &options);
        let level = AmbientNoise { wind_m_s: wind, shipping: 0.5 }.level_db(1e3 * frequency) + db(15e3) - 10.0;
        assert_near("noise of the sea", found.layout().noise_db.into(), level, 1e-3);
        assert_near("what is heard", db(mean(&powers(&found, 0))), level, 0.4);
    }
}

/// `SL + S_v + 10 log(V) - 40 log r - 2 a r`, and nothing behind what no sound passes.
#[test]
fn what_floats_in_the_water_is_heard_before_the_bottom() {
    let strength = -60.0;
    let more = format!(", volume_backscatter_db: {strength}");
    let wavelength = 1500.0 / 450e3;
    let piston = Lobe::from_yaml("{shape: piston, width_deg: 6}").unwrap().at(wavelength);
    let steps = 20_000;
    let solid: f64 = (0..steps)
        .map(|step| {
            let width = std::f64::consts::FRAC_PI_2 / f64::from(steps);
            let angle: f64 = (f64::from(step) + 0.5) * width;
            piston.amplitude(angle.sin()).powi(4) * angle.sin() * width * std::f64::consts::TAU
        })
        .sum();
    for speckle in ["off", "frozen"] {
        let sounder = sonar(
            "type: single_beam, beam_deg: 6, rays: 4096",
            &format!("acoustics.speckle={speckle} acoustics.noise_level_db=-100"),
        );
        let hear = |scene: &BuiltScene, z: f64| -> Vec<f64> {
            let mut sums = vec![0.0; 4000];
            for frame in 0..20 {
                let options = options(water(&more)).frame(frame);
                let found = ping(scene, &sounder, Pose::at(0.0, 0.0, z), &options);
                sums.iter_mut().zip(found.levels(0)).for_each(|(sum, &level)| *sum += power(level.into()) / 20.0);
            }
            sums
        };
        let around = |powers: &[f64], range: f64| db(mean(&powers[((range - 2.0) / 0.025) as usize..][..160]));
        let open = hear(&nothing(), -300.0);
        for range in [10.0, 30.0, 60.0, 95.0f64] {
            let expected = 220.0 + strength + db(solid * 0.05) - 20.0 * range.log10();
            assert_near(&format!("volume at {range} m, {speckle}"), around(&open, range), expected, 0.6);
        }
        // Cylindrical spreading costs half as many dB on each path.
        let law = |law: &str| {
            let options = options(water(&format!("{more}, spreading: {law}")));
            around(&powers(&ping(&nothing(), &sounder, Pose::at(0.0, 0.0, -300.0), &options), 0), 60.0)
        };
        assert_near("cylindrical", law("cylindrical") - law("spherical"), 20.0 * 60f64.log10(), 0.05);
        let closed = hear(&flat(100.0), 30.0);
        assert_near("before the bottom", around(&closed, 20.0), around(&open, 20.0), 0.9);
        // Sidelobes still look past it, far to the side.
        assert!(
            around(&closed, 60.0) < around(&open, 60.0) - 25.0,
            "{} {}",
            around(&closed, 60.0),
            around(&open, 60.0)
        );
    }
    // Thresholds rise above volume backscatter: soundings are of the bottom.
    let sounder = sonar("type: single_beam, beam_deg: 6, rays: 1024", "acoustics.noise_level_db=-100");
    let found = ping(&nothing(), &sounder, Pose::at(0.0, 0.0, -300.0), &options(water(&more)));
    let level = 220.0 + strength + db(solid * 0.05) - 40.0;
    assert_near("threshold at 100 m", found.layout().threshold_db[3999].into(), level + 10.0, 0.05);
}
