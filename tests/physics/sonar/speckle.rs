//! What random scatterers make of echoes.

use super::*;

/// Side-scan with speckle, thin along the track, so that neighbouring places are heard separately.
fn speckled(more: &str) -> Sensor {
    sidescan(&format!("acoustics.speckle=frozen pattern.along_deg=0.25 {more}"))
}

/// Powers of distant cells, over the mean at their range: of `count` pings along the track, every fourth resolution.
fn powers(scene: &BuiltScene, sensor: &Sensor, count: u32) -> Vec<f64> {
    let plain = set(sensor.clone(), "acoustics.speckle=off");
    let options = options(water("")).fields(FieldSet::default());
    let means = ping(scene, &plain, Pose::at(0.0, 0.0, 20.0), &options);
    let mut powers = Vec::new();
    for number in 0..count {
        let found = ping(scene, sensor, Pose::at(0.8 * f64::from(number) - 40.0, 0.0, 20.0), &options);
        // From 25 m on: the bottom.
        let cells = (1000..found.layout().bins - 40).step_by(8);
        powers.extend(cells.map(|bin| power(f64::from(found.levels(0)[bin]) - f64::from(means.levels(0)[bin]))));
    }
    powers
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

/// Probability that a sample of `n` is at least this far (`distance`) from its distribution: Kolmogorov's series.
fn kolmogorov(distance: f64, n: usize) -> f64 {
    let x = (n as f64).sqrt() * distance;
    2.0 * (1..100).map(|k| (-1f64).powi(k - 1) * (-2.0 * f64::from(k * k) * x * x).exp()).sum::<f64>()
}

#[test]
fn speckle_is_rayleigh_and_keeps_the_mean() {
    let table: serde_json::Value =
        serde_json::from_str(include_str!("../../data/sonar/speckle_statistics.json")).unwrap();
    let unsorted = powers(&flat(100.0), &speckled(""), 60);
    let mut powers = unsorted.clone();
    powers.sort_by(f64::total_cmp);
    let n = powers.len();
    assert!(n > 20_000, "{n}");
    let standard_error = 4.343 / (n as f64).sqrt();
    assert_near("mean, dB", db(mean(powers.iter().copied())), 0.0, 0.05 + 3.0 * standard_error);
    // Amplitudes of sigma 1 are Rayleigh's: 1 - exp(-a^2 / 2).
    let over = mean(powers.iter().copied());
    let amplitudes: Vec<f64> = powers.iter().map(|power| (2.0 * power / over).sqrt()).collect();
    let distance = amplitudes.iter().enumerate().fold(0f64, |most, (index, a)| {
        let expected = 1.0 - (-0.5 * a * a).exp();
        let [before, after] = [index, index + 1].map(|count| (count as f64 / n as f64 - expected).abs());
        most.max(before).max(after)
    });
    let p = kolmogorov(distance, n);
    assert!(p > 0.01, "amplitudes are {distance} from Rayleigh's, p = {p}");
    for (part, expected) in table["rayleigh_amplitude_sigma1"]["quantiles"].as_object().unwrap() {
        let part: f64 = part.parse().unwrap();
        let expected = expected.as_f64().unwrap();
        // Standard error of a quantile: sqrt(p (1 - p) / n) over the density there.
        let density = expected * (-0.5 * expected * expected).exp();
        let tolerance = 4.0 * (part * (1.0 - part) / n as f64).sqrt() / density;
        assert_near(&format!("quantile {part}"), amplitudes[(part * n as f64) as usize], expected, tolerance);
    }
    let index = mean(powers.iter().map(|p| p * p)) / (over * over) - 1.0;
    assert_near("scintillation index", index, 1.0, 0.05);
    // Whoever draws pictures averages looks: the mean of L of them is gamma-distributed.
    for (looks, gamma) in table["gamma_multilook"].as_object().unwrap() {
        let looks: usize = looks.parse().unwrap();
        // In an order without neighbours: sorted ones would be alike.
        let count = n / looks;
        let mut means: Vec<f64> =
            (0..count).map(|at| mean((0..looks).map(|look| unsorted[at + look * count])) / over).collect();
        means.sort_by(f64::total_cmp);
        let rows: Vec<(f64, f64)> = gamma["quantiles"]
            .as_object()
            .unwrap()
            .iter()
            .map(|(part, value)| (part.parse().unwrap(), value.as_f64().unwrap()))
            .collect();
        for pair in rows.windows(3) {
            let (part, expected) = pair[1];
            let density = (pair[2].0 - pair[0].0) / (pair[2].1 - pair[0].1);
            let tolerance = 5.0 * (part * (1.0 - part) / count as f64).sqrt() / density + 0.01 * expected;
            let found = means[(part * count as f64) as usize];
            assert_near(&format!("quantile {part} of {looks} looks"), found, expected, tolerance);
        }
        let index = mean(means.iter().map(|p| p * p)) / mean(means.iter().copied()).powi(2) - 1.0;
        assert_near(&format!("scintillation of {looks} looks"), index, gamma["SI"].as_f64().unwrap(), 0.05);
    }
    let levels = powers.iter().map(|p| db(p / over));
    let level = mean(levels.clone());
    let sigma = mean(levels.map(|db| (db - level).powi(2))).sqrt();
    let expected = ["mean_dB", "std_dB"].map(|key| table["exponential_dB"][key].as_f64().unwrap());
    assert_near("mean of the levels", level, expected[0], 0.15);
    assert_near("sigma of the levels", sigma, expected[1], 0.15);
}

/// `1 + 2 / nu`, where a place of one texture is wider than a cell.
#[test]
fn texture_makes_k_distributions() {
    let scene = flat(100.0);
    for (shape, tolerance) in [("8", 0.1), ("2", 0.3)] {
        let sensor = speckled(&format!("acoustics.texture_shape={shape} pattern.along_deg=0.1 range.max_m=50"));
        let powers = powers(&scene, &sensor, 120);
        let over = mean(powers.iter().copied());
        let index = mean(powers.iter().map(|p| p * p)) / (over * over) - 1.0;
        let expected = 1.0 + 2.0 / shape.parse::<f64>().unwrap();
        assert_near(&format!("scintillation index with {shape}"), index, expected, tolerance);
        assert_near("mean, dB", db(over), 0.0, 0.15);
    }
}

/// Straight down many rays meet the places that scatter as one; yet they are as loud as those places.
#[test]
fn speckle_keeps_the_mean_whatever_the_rays() {
    let scene = flat(100.0);
    for rays in ["256", "16384"] {
        let sensor = sonar(&format!("type: single_beam, beam_deg: 8, rays: {rays}"), "range.max_m=5");
        let options = options(water("")).fields(FieldSet::default());
        let total = |sensor: &Sensor, x: f64| -> f64 {
            let found = ping(&scene, sensor, Pose::at(x, 0.0, 3.0), &options);
            found.levels(0).iter().map(|&level| power(level.into())).sum()
        };
        let without = total(&sensor, 0.0);
        let speckled = set(sensor, "acoustics.speckle=frozen");
        let count = 200;
        let with = (0..count).map(|at| total(&speckled, f64::from(at) * 0.9 - 90.0)).sum::<f64>() / f64::from(count);
        // A ping has one resolution cell.
        assert_near(&format!("mean of {rays} rays, dB"), db(with / without), 0.0, 0.9);
    }
}

/// Correlation of the intensities of many cells of a flat bottom 20 m below, of pairs of pings at `poses`.
fn correlation(scene: &BuiltScene, sensor: &Sensor, poses: impl IntoIterator<Item = [Pose; 2]>) -> f64 {
    let options = options(water("")).fields(FieldSet::default());
    let plain = set(sensor.clone(), "acoustics.speckle=off");
    let mut means = None;
    let mut pairs = Vec::new();
    for poses in poses {
        let means = means.get_or_insert_with(|| ping(scene, &plain, poses[0], &options));
        let [here, there] = poses.map(|pose| ping(scene, sensor, pose, &options));
        let over = |ping: &Ping, bin: usize| power(f64::from(ping.levels(0)[bin]) - f64::from(means.levels(0)[bin]));
        let cells = (1000..here.layout().bins - 40).step_by(4);
        pairs.extend(cells.map(|bin| [over(&here, bin), over(&there, bin)]));
    }
    let means = [0, 1].map(|of| mean(pairs.iter().map(|pair| pair[of])));
    let covariance = |i: usize, j: usize| mean(pairs.iter().map(|pair| (pair[i] - means[i]) * (pair[j] - means[j])));
    covariance(0, 1) / (covariance(0, 0) * covariance(1, 1)).sqrt()
}

/// Poses far from each other, each with where it `moved` to.
fn pairs(moved: impl Fn(Pose) -> Pose) -> impl Iterator<Item = [Pose; 2]> {
    (0..30).map(move |number| {
        let pose = Pose::at(3.1 * f64::from(number) - 45.0, 0.0, 20.0);
        [pose, moved(pose)]
    })
}

/// While the sonar moves along its array its echoes stay as alike as the theorem of van Cittert and Zernike has it: the
/// correlation of pressures is the transform of the power that is sent and heard, that of intensities its square.
#[test]
fn speckle_while_moving() {
    let scene = flat(100.0);
    let wavelength = 1500.0 / 450e3;
    for (name, keys, heard, tolerance) in [
        ("uniform line of 0.68 m", "pattern.along_deg=0.25", 0.25, 0.16),
        ("uniform line of 0.28 m", "pattern.along_deg=0.6", 0.6, 0.16),
        ("line of 0.34 m that sends only", "pattern.along_deg=0.5 pattern.heard_along_deg=60", 60.0, 0.1),
    ] {
        let sensor = sidescan(&format!("acoustics.speckle=frozen {keys}"));
        let sent = keys.split(['=', ' ']).nth(1).unwrap().parse().unwrap();
        let [sends, hears] = [sent, heard].map(|width| Lobe::Width(width).at(wavelength));
        let length = 0.8859 * wavelength / f64::to_radians(sent);
        let rho = |way: f64| {
            let step = 1e-5;
            let sum = |way: f64| -> f64 {
                let sines = (-60_000..60_000).map(|index| (f64::from(index) + 0.5) * step);
                let power = |sine: f64| (sends.amplitude(sine) * hears.amplitude(sine)).powi(2);
                sines.map(|u| power(u) * (4.0 * std::f64::consts::PI * u * way / wavelength).cos()).sum()
            };
            sum(way) / sum(0.0)
        };
        for part in [0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2] {
            let t: f64 = part;
            let closed = match heard == sent {
                true if t <= 0.5 => 1.0 - 6.0 * t * t + 6.0 * t * t * t,
                true => 2.0 * (1.0 - t).max(0.0).powi(3),
                false => (1.0 - 2.0 * t).max(0.0),
            };
            assert_near("closed form", rho(part * length), closed, 0.02);
            let along = |pose: Pose| Pose { position: pose.position + DVec3::X * part * length, ..pose };
            let found = correlation(&scene, &sensor, pairs(along));
            assert_near(&format!("{name}, {part} lengths on"), found, closed * closed, tolerance);
        }
    }
}

/// A turn by the width of the beam, or a resolution aside: other scatterers.
#[test]
fn speckle_is_new_after_a_turn_or_aside() {
    let (scene, sensor) = (flat(100.0), speckled(""));
    for (what, by) in [
        ("aside", Pose::at(0.0, 0.06, 0.0)),
        ("up", Pose::at(0.0, 0.0, 0.06)),
        ("turned", Pose::IDENTITY.with_rpy_deg(0.0, 0.0, 0.25)),
        ("pitched", Pose::IDENTITY.with_rpy_deg(0.0, 0.25, 0.0)),
    ] {
        let moved = |pose: Pose| Pose { position: pose.position + by.position, orientation: by.orientation };
        let found = correlation(&scene, &sensor, pairs(moved));
        assert!(found.abs() < 0.05, "{what}: {found}");
    }
}

/// Where the bottom falls along the track, rays get into other bins: a tenth of the length on, intensities on a flat bottom
/// have the correlation 0.77.
#[test]
fn speckle_on_slopes() {
    for (slope, expected) in [(0.5f64, 0.74), (2.0, 0.69), (5.0, 0.38)] {
        let mut scene = SceneBuilder::new();
        let paint = scene.material(sounding_material(Sound::Lambert { mu_db: -10.0 }));
        let mesh = scene.mesh([(square(100.0), Some(paint))]);
        scene.place(mesh, glam::DAffine3::from_rotation_y(slope.to_radians()));
        let scene = scene.finish().build().unwrap();
        let poses = (0..30).map(|number| {
            let pose = Pose::at(0.0, 3.1 * f64::from(number) - 45.0, 20.0);
            [pose, Pose { position: pose.position + DVec3::X * 0.068, ..pose }]
        });
        let found = correlation(&scene, &speckled(""), poses);
        assert_near(&format!("on a slope of {slope} degrees"), found, expected, 0.06);
    }
}

/// On any course, and far from the origin.
#[test]
fn speckle_stays_on_any_course() {
    let sensor = speckled("");
    for (course, origin) in [(33.0, DVec3::ZERO), (-117.3, DVec3::new(4.1e5, 5.2e6, 0.0))] {
        let mut scene = SceneBuilder::new();
        let paint = scene.material(sounding_material(Sound::Lambert { mu_db: -10.0 }));
        let mesh = scene.mesh([(square(100.0), Some(paint))]);
        scene.place(mesh, glam::DAffine3::from_translation(origin));
        let scene = scene.finish().build().unwrap();
        let along = |way: f64| {
            let pose = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, course);
            Pose { position: origin + DVec3::new(3.0, 1.0, 20.0) + pose.orientation * DVec3::X * way, ..pose }
        };
        // Of a line of 0.68 m.
        for (way, expected) in [(0.2, 0.39), (1.0, 0.0)] {
            let found = correlation(&scene, &sensor, [[along(0.0), along(way)]]);
            assert_near(&format!("{way} m on at {course} degrees"), found, expected, 0.12);
        }
    }
}

#[test]
fn speckle_is_frozen_to_the_bottom() {
    let scene = flat(100.0);
    let pose = Pose::at(3.0, 1.0, 20.0).with_rpy_deg(1.0, 2.0, 33.0);
    let hear = |sensor: &Sensor, seed: u64, frame: u32| {
        ping(&scene, sensor, pose, &options(water("")).seed(seed).frame(frame))
    };
    let bits = |ping: &Ping| -> Vec<u32> { ping.levels(0).iter().map(|level| level.to_bits()).collect() };
    // With and without audible noise.
    let [quiet, noisy] = ["-200", "70"].map(|noise| speckled(&format!("acoustics.noise_level_db={noise}")));
    for sensor in [&quiet, &noisy] {
        assert!(bits(&hear(sensor, 0, 4)) == bits(&hear(sensor, 0, 4)));
    }
    let echoes = |ping: &Ping| -> Vec<u32> { bits(ping).split_off(900) };
    assert!(echoes(&hear(&quiet, 0, 4)) == echoes(&hear(&quiet, 0, 5)), "another ping has another bottom");
    assert!(echoes(&hear(&noisy, 0, 4)) != echoes(&hear(&noisy, 0, 5)), "noise is the same in two pings");
    let other = hear(&quiet, 1, 4);
    let same = echoes(&hear(&quiet, 0, 4)).iter().zip(echoes(&other)).filter(|(a, b)| **a == *b).count();
    assert!(same < 30, "{same} cells are the same with another seed");
    // A step along the track larger than the beam's width: another bottom.
    let along = |x: f64| {
        let found = ping(&scene, &quiet, Pose::at(x, 0.0, 20.0), &options(water("")));
        found.levels(0)[900..].iter().map(|&level| f64::from(level)).collect::<Vec<_>>()
    };
    let correlation = |a: &[f64], b: &[f64]| {
        let slope = |values: &[f64]| -> Vec<f64> {
            // The level falls with the range.
            values
                .chunks_exact(50)
                .flat_map(|part| {
                    let mean = part.iter().sum::<f64>() / 50.0;
                    part.iter().map(move |value| value - mean).collect::<Vec<_>>()
                })
                .collect()
        };
        let (a, b) = (slope(a), slope(b));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt()
    };
    let here = along(0.0);
    // As long as rays stay on their places, a third of a resolution wide.
    assert!(correlation(&here, &along(0.0003)) > 0.9);
    let far = correlation(&here, &along(2.0));
    assert!(far.abs() < 0.1, "{far}");
}
