//! Detections without targets.

use super::super::nothing;
use super::*;
use echocast::Cause;

/// Noise alone exceeds the threshold in one cell of a thousand, within three standard deviations, and is called noise.
#[test]
fn noise_alone_is_detected_as_often_as_designed() {
    let detection = "radar.detection={pfa:1e-3,dims:range,local_maxima:false} radar.windows.range=rect \
                     radar.windows.velocity=rect range.min_m=0 range.max_m=200";
    let (sensor, scene) = (radar(detection), nothing());
    let frames = 40;
    let mut found = 0;
    for seed in 0..frames {
        let cloud = scan(&scene, &sensor, &options().seed(seed));
        found += cloud.len();
        let c = cloud.columns();
        for row in 0..cloud.len() {
            assert_eq!((path(&cloud, row), c.cause()[row]), (PathType::Noise, Cause::FalseAlarm as u8));
            assert!(c.true_range()[row].is_nan() && c.true_rcs()[row].is_nan() && c.instance_id()[row] == 0);
        }
    }
    let expected = 1e-3 * (256 * 128 * frames) as f64;
    assert_near("false alarms", found as f64, expected, 3.0 * expected.sqrt());
}

/// Mean power of the cells of a cube without echoes: `k T F B`, exponentially distributed.
#[test]
fn noise_has_its_power() {
    let cube = cube(&nothing(), &radar("radar.windows.range=rect radar.windows.velocity=rect"), &options());
    let powers: Vec<f64> = cube.cells.iter().map(|cell| f64::from(cell.norm_sqr())).collect();
    let mean = powers.iter().sum::<f64>() / powers.len() as f64;
    let noise = 1.380_649e-23 * 290.0 * 10f64.powf(1.4) / (128.0 * 25.6e-6);
    // 32,768 cells: a standard error of 0.55 %.
    assert_near("mean over k T F B", mean / noise, 1.0, 0.017);
    let square = powers.iter().map(|power| power * power).sum::<f64>() / powers.len() as f64;
    assert_near("mean square over the square of the mean", square / (mean * mean), 2.0, 0.1);
}

/// A radar of 50 dBm 100 m away whose ramps fall as fast as this one's rise, over the same 256 MHz: the received power
/// (Friis) for the part of the time in which the difference of both is within the 10 MHz that are sampled, over noise of
/// `k T F` times 10 MHz. What is detected then is interference.
#[test]
fn other_radars_raise_the_noise() {
    let other = "radar.interferers=[{eirp_dbm:50,distance_m:100,start_ghz:77.128,slope_mhz_per_us:-10,ramp_us:25.6,\
                 period_us:25.6}]";
    let rect = "radar.windows.range=rect radar.windows.velocity=rect";
    let sensor = radar(&format!("{rect} {other} radar.detection={{pfa:1e-3,dims:doppler,local_maxima:false}}"));
    let mean = |sensor: &Sensor| {
        let cells = cube(&nothing(), sensor, &options()).cells;
        cells.iter().map(|cell| f64::from(cell.norm_sqr())).sum::<f64>() / cells.len() as f64
    };
    let received = 1e2 * (WAVELENGTH / (4.0 * PI * 100.0)).powi(2);
    let noise = 1.380_649e-23 * 290.0 * 10f64.powf(1.4) * 10e6;
    let expected = 1.0 + received * (10.0 / 256.0) / noise;
    assert_near("dB over the noise", db(mean(&sensor) / mean(&radar(rect))), db(expected), 0.5);
    // Along range, what lasts for an instant is as strong in all cells.
    let (mut disturbed, mut all) = (0, 0);
    for seed in 0..20 {
        let cloud = scan(&nothing(), &sensor, &options().seed(seed));
        disturbed += (0..cloud.len()).filter(|&row| path(&cloud, row) == PathType::Interference).count();
        all += cloud.len();
        assert!(cloud.columns().cause().iter().all(|&cause| cause == Cause::FalseAlarm as u8));
    }
    assert!(disturbed > 50 && 100 * disturbed > 98 * all, "{disturbed} of {all}");
}

/// Phase noise of -80 dBc/Hz beside a strong echo at 60 m, times `4 sin^2(pi f t)` of what an oscillator shares with its own
/// echo of `t`: `P L / T`, in cells at an offset `f` of range, `T` long chirps.
#[test]
fn phase_noise_stands_beside_strong_echoes() {
    let strong = "radar.power_dbm=60 radar.windows.range=rect radar.windows.velocity=rect radar.noise_figure_db=0";
    let range = 102.0 * STEP;
    let scene = scene([(trihedral(0.3, DVec3::X * range), METAL)]);
    let mean = |sensor: &Sensor, column: usize| {
        let cube = cube(&scene, sensor, &options());
        let (rows, cells) = (cube.axes.velocity.len, cube.axes.range.len);
        (0..rows).map(|row| f64::from(cube.cells[row * cells + column].norm_sqr())).sum::<f64>() / rows as f64
    };
    let noisy = radar(&format!("{strong} radar.phase_noise={{levels:[[1,-80],[10000,-80]]}}"));
    let peak = cell(&cube(&scene, &radar(strong), &options()), range, 0.0);
    let delay = 2.0 * range / 299_792_458.0;
    for aside in [20.0, 40.0, 60.0] {
        let column = (102.0 + aside) as usize;
        let offset = aside / 25.6e-6;
        // Of each chirp; 128 of them are averaged coherently.
        let density = 1e-8 * 4.0 * (PI * offset * delay).sin().powi(2);
        let expected = peak * density / (128.0 * 25.6e-6);
        let found = mean(&noisy, column) - mean(&radar(strong), column);
        assert_near(&format!("phase noise {aside} cells aside, dB"), db(found / expected), 0.0, 1.0);
    }
}
