//! Rain, wet radomes and panes.

use super::super::nothing;
use super::*;
use echocast::Environment;

/// Power of the strongest detection, dBm.
fn power(scene: &BuiltScene, sensor: &Sensor, options: &ScanOptions) -> f64 {
    let cloud = scan(scene, sensor, options);
    cloud.columns().power()[first(&cloud)].into()
}

fn raining() -> ScanOptions {
    options().environment(Environment::from_yaml("rain: {rate_mm_h: 25}").unwrap())
}

/// Gaussian beams of 3 degrees.
const NARROW: &str = "radar.array.tx_pattern={azimuth_deg:3,elevation_deg:3} \
                      radar.array.rx_pattern={azimuth_deg:3,elevation_deg:3}";

/// Check value: 11.405 dB/km of level waves one way in 25 mm/h at 77 GHz.
#[test]
fn rain_attenuates() {
    // Narrow beams, in which little of the rain is.
    let sensor = radar(&format!("{NARROW} radar.array.polarisation=horizontal radar.power_dbm=60"));
    for range in [40.0, 120.0] {
        let scene = scene([(trihedral(0.2, DVec3::X * range), METAL)]);
        let lost = power(&scene, &sensor, &options()) - power(&scene, &sensor, &raining());
        assert_near(&format!("dB lost over {range} m"), lost, 2.0 * 11.405e-3 * range, 0.1);
    }
}

/// Echoes of rain fill beams: `P G^2 lambda^2 theta phi h eta / (512 pi^2 R^2 ln 2)` with Gaussian beams of the widths
/// `theta` and `phi` and cells of `h` (Probert-Jones 1962, Q. J. R. Meteorol. Soc. 88, 485), dimmed by the way there
/// and back. `eta` is the Mie sum over the drops of Marshall and Palmer, 1.27074e-3 m^2/m^3.
#[test]
fn rain_returns_what_its_drops_do() {
    let beams = "radar.array.tx_pattern={azimuth_deg:10,elevation_deg:10} \
                 radar.array.rx_pattern={azimuth_deg:10,elevation_deg:10} radar.array.polarisation=horizontal \
                 pattern.azimuth_deg=[-10,10] pattern.elevation_deg=[-10,10] radar.windows.range=rect \
                 radar.windows.velocity=rect radar.power_dbm=60";
    let (sensor, scene, frames) = (radar(beams), nothing(), 30);
    let width = 10f64.to_radians();
    let (mut found, mut expected) = (0.0, 0.0);
    for seed in 0..frames {
        let cube = cube(&scene, &sensor, &raining().seed(seed));
        for column in 35..100 {
            let range = cube.axes.range.at(f64::from(column));
            let echo = 1e3 * WAVELENGTH * WAVELENGTH * width * width * STEP * 1.270_74e-3
                / (512.0 * PI * PI * 2f64.ln() * range * range);
            let rows = 0..cube.axes.velocity.len;
            let power = |row: usize| f64::from(cube.cells[row * cube.axes.range.len + column as usize].norm_sqr());
            // Each cell as much as any other, whose power falls with its range.
            found += rows.map(power).sum::<f64>() / echo;
            expected += 10f64.powf(-2.0 * 11.405e-4 * range);
        }
    }
    assert_near("dB more than expected", db(found / expected), 0.0, 0.5);
}

/// 0.1 mm of water of 8.80591 - j15.9018 (ITU-R P.840, 77 GHz, 20 degrees C) on the radome, both ways, as a slab
/// (ITU-R P.2040-3 eq. 43).
#[test]
fn wet_radomes_dim() {
    let scene = scene([(trihedral(0.2, DVec3::X * 40.0), METAL)]);
    let lost = power(&scene, &radar(""), &options()) - power(&scene, &radar("radar.wet_radome_mm=0.1"), &options());
    assert_near("dB lost", lost, -2.0 * slab_db([8.805_91, -15.901_8], 1e-4), 0.05);
}

/// Power that passes a slab at right angles, dB: `|(1 - G^2) e^-jq / (1 - G^2 e^-2jq)|^2`, `q = 2 pi d sqrt(eta) / lambda`.
fn slab_db([re, im]: [f64; 2], thickness: f64) -> f64 {
    let mul = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let div = |a: [f64; 2], b: [f64; 2]| {
        let n = b[0] * b[0] + b[1] * b[1];
        [(a[0] * b[0] + a[1] * b[1]) / n, (a[1] * b[0] - a[0] * b[1]) / n]
    };
    let exp = |[re, im]: [f64; 2]| [re.exp() * im.cos(), re.exp() * im.sin()];
    // The root in the fourth quadrant.
    let size = re.hypot(im);
    let n = [((size + re) / 2.0).sqrt(), -((size - re) / 2.0).sqrt()];
    let gamma = div([1.0 - n[0], -n[1]], [1.0 + n[0], n[1]]);
    let square = mul(gamma, gamma);
    let k = 2.0 * PI * thickness / WAVELENGTH;
    let once = exp([k * n[1], -k * n[0]]);
    let below = mul(square, mul(once, once));
    let through = div(mul([1.0 - square[0], -square[1]], once), [1.0 - below[0], -below[1]]);
    db(through[0] * through[0] + through[1] * through[1])
}

/// Check value: 4 mm of glass take 4.578 dB one way at 77 GHz.
#[test]
fn panes_dim_what_is_behind_them() {
    assert_near("the slab's formula", slab_db([6.31, -0.282_65], 4e-3), -4.578, 1e-3);
    let corner = || (trihedral(0.2, DVec3::X * 40.0), METAL);
    // Its mirror image is not the strongest echo: it is turned away by ten degrees.
    let normal = DVec3::new(-10f64.to_radians().cos(), 10f64.to_radians().sin(), 0.0);
    let behind = |normal: DVec3| {
        let pane = (
            Shape::plate(DVec3::X * 8.0, normal, 2.0),
            "law: layers, layers: [{law: itu, material: glass, thickness_mm: 4}]",
        );
        let (scene, sensor) = (scene([pane, corner()]), radar(""));
        let cloud = scan(&scene, &sensor, &options());
        let row = strongest(&cloud, |row| cloud.columns().instance_id()[row] == 2).expect("the corner");
        f64::from(cloud.columns().power()[row])
    };
    let free = power(&scene([corner()]), &radar(""), &options());
    assert_near("dB lost", free - behind(DVec3::NEG_X), 2.0 * 4.578, 0.1);
    assert!((free - behind(normal)).is_finite());
}
