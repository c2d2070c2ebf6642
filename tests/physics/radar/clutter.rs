//! Echoes of rough ground.

use super::*;

/// A rough plane of constant gamma, -15 dB, 10 m below the radar.
const GROUND: &str = "law: permittivity, eps: 5, rms_height_mm: 4, clutter: {gamma_db: -15}";

fn ground() -> BuiltScene {
    scene([(Shape::quad(DVec3::new(-50.0, -150.0, -10.0), 300.0 * DVec3::X, 300.0 * DVec3::Y), GROUND)])
}

fn sensor() -> Sensor {
    radar(
        "radar.clutter=true radar.array.tx_pattern.azimuth_deg=10 radar.array.rx_pattern.azimuth_deg=10 \
         pattern.azimuth_deg=[-20,20] radar.windows.range=rect radar.windows.velocity=rect radar.power_dbm=60",
    )
}

/// Powers of the cells of ground from 40 to 80 m over `sigma0 A` in the radar equation: `gamma sin g` times the area of
/// the cell, `R w sqrt(pi / (8 ln 2)) h / cos g` with Gaussian beams of width `w`, which count twice, and cells of `h`.
fn powers(cube: &RadarCube) -> Vec<f64> {
    let width = 10f64.to_radians() * (PI / (8.0 * 2f64.ln())).sqrt();
    let of = |column: i32| {
        let range = f64::from(column) * STEP;
        let (sin, cos) = (10.0 / range, (1.0 - (10.0 / range).powi(2)).sqrt());
        let area = 10f64.powf(-1.5) * sin * range * width * STEP / cos;
        cell(cube, range, 0.0) / echo(60.0, area, range)
    };
    (69..137).map(of).collect()
}

#[test]
fn rough_ground_returns_its_backscatter_with_speckle() {
    let (scene, sensor, frames) = (ground(), sensor(), 12);
    let all: Vec<f64> = (0..frames).flat_map(|seed| powers(&cube(&scene, &sensor, &options().seed(seed)))).collect();
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    assert_near("mean over sigma0 A, dB", db(mean), 0.0, 1.0);
    // Exponentially distributed: the mean square is 2, with an error of sqrt(20 / n); an n-th of e exceeds the mean.
    let square = all.iter().map(|power| power * power).sum::<f64>() / n / (mean * mean);
    assert_near("mean square", square, 2.0, 4.0 * (20.0 / n).sqrt());
    let above = all.iter().filter(|&&power| power > mean).count() as f64 / n;
    assert_near("part above the mean", above, (-1f64).exp(), 0.06);
}

/// What stands still looks the same in the next frame, but for the noise, and differs with the seed.
#[test]
fn speckle_is_frozen() {
    let (scene, mut sensor) = (ground(), sensor());
    // Noise is 60 dB below the echoes.
    sensor.set("radar.power_dbm", "90").unwrap();
    let [first, next, other] = [(1, 0), (1, 5), (2, 0)]
        .map(|(seed, frame)| powers(&cube(&scene, &sensor, &options().seed(seed).frame(frame))));
    let off = |a: &[f64], b: &[f64]| {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
        sum / a.iter().sum::<f64>()
    };
    assert!(off(&first, &next) < 0.02, "{}", off(&first, &next));
    assert!(off(&first, &other) > 0.3, "{}", off(&first, &other));
}
