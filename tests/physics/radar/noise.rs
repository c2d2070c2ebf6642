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
