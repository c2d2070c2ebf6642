//! The depths that swaths report, beam by beam, beside planes that are met analytically.

use super::{ping, set, water};
use echocast::{BuiltScene, Environment, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// Height of the sonar above the bed below it, m.
const HEIGHT: f64 = 20.0;

/// A bed that rises to port by this angle.
struct Bed {
    scene: BuiltScene,
    normal: DVec3,
}

impl Bed {
    fn rising(degrees: f64) -> Bed {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let normal = DVec3::new(0.0, -sin, cos);
        let mut scene = SceneBuilder::new();
        scene.stand(Shape::plate(DVec3::ZERO, normal, 2000.0), None);
        Bed { scene: scene.finish().build().unwrap(), normal }
    }

    /// Range along the unit `axis`, m; infinite where it is not met.
    fn range(&self, axis: DVec3) -> f64 {
        let towards = -axis.dot(self.normal);
        if towards > 0.0 { HEIGHT * self.normal.z / towards } else { f64::INFINITY }
    }
}

/// How the soundings of some pings are.
#[derive(Debug, Default)]
struct Found {
    asked: usize,
    out_of_reach: usize,
    missing: usize,
    wrong: Vec<String>,
    /// Of beams that cannot hear the bed.
    invented: Vec<String>,
}

fn sound_out(sensor: &Sensor, bed: &Bed, pings: u32) -> Found {
    let mut found = Found::default();
    for frame in 0..pings {
        let options = ScanOptions::default().fields(FieldSet::all()).frame(frame).environment(water(""));
        let ping = ping(&bed.scene, sensor, Pose::at(1.7 * f64::from(frame), 0.0, HEIGHT), &options);
        let mut depths = vec![None; ping.layout().beams()];
        for sounding in ping.soundings() {
            depths[sounding.beam as usize] = Some(sounding);
        }
        for (beam, ([azimuth, elevation], sounding)) in ping.layout().axes.iter().zip(depths).enumerate() {
            let (azimuth, elevation) = (f64::from(*azimuth), f64::from(*elevation));
            let axis = DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            let angle = axis.y.asin().to_degrees();
            if angle.abs() > 70.0 {
                continue;
            }
            let truth = bed.range(axis);
            if truth > ping.layout().reach() {
                found.out_of_reach += 1;
                if let Some(sounding) = sounding {
                    found.invented.push(format!("{angle:.1} deg: {:.2} m, beyond {truth:.2}", sounding.range));
                }
                continue;
            }
            found.asked += 1;
            let Some(sounding) = sounding else {
                found.missing += 1;
                continue;
            };
            let error = (f64::from(sounding.range) - truth) * (axis.dot(bed.normal) / bed.normal.z);
            let allowed = (0.005 * HEIGHT).max(3.0 * ping.layout().bin_m);
            if error.abs() > allowed {
                found.wrong.push(format!("beam {beam}, {angle:.1} deg: {error:.3} m, quality {:.2}", sounding.quality));
            }
        }
    }
    found
}

#[test]
fn soundings_lie_on_beds_that_are_met_analytically() {
    let swaths = [
        "mbes_400",
        "kongsberg_em2040_200",
        "kongsberg_em2040_400",
        "norbit_iwbms",
        "reson_seabat_7125_200",
        "reson_seabat_7125_400",
        "reson_seabat_t50_200",
        "reson_seabat_t50_400",
    ];
    let (mut asked, mut wrong) = (0, 0);
    for name in swaths {
        let sensor = Sensor::preset(name).unwrap();
        for degrees in [0.0, 10.0, -10.0] {
            let found = sound_out(&sensor, &Bed::rising(degrees), 3);
            assert_eq!((found.missing, found.invented.len()), (0, 0), "{name}, {degrees}: {found:?}");
            // The outermost beams of one are at their limit: 11 degrees of grazing.
            assert!(found.wrong.len() as f64 <= 0.005 * found.asked as f64, "{name}, {degrees}: {found:?}");
            (asked, wrong) = (asked + found.asked, wrong + found.wrong.len());
        }
    }
    assert!(f64::from(wrong as u32) <= 0.001 * f64::from(asked as u32) && asked > 30_000, "{wrong} of {asked}");
}

/// On a slope half of the beams have none within reach.
#[test]
fn no_bed_in_reach_no_sounding() {
    let sensor = set(Sensor::preset("mbes_400").unwrap(), "range.max_m=30");
    let found = sound_out(&sensor, &Bed::rising(20.0), 4);
    assert!(found.out_of_reach > 100 && found.invented.is_empty(), "{found:?}");
    // Near the end of what is heard an echo may be cut.
    assert!(found.missing * 50 < found.asked && found.wrong.len() * 1000 < found.asked, "{found:?}");
}

/// Where the water bends sound, depths are those of the bed by the true cast, and by another those of its own rays.
#[test]
fn depths_are_corrected_by_the_assumed_cast() {
    let sensor = set(Sensor::preset("mbes_400").unwrap(), "acoustics.speckle=off acoustics.noise_level_db=-200");
    let bed = Bed::rising(0.0);
    let hear = |assumed: &str| {
        let cast = "cast: [{depth_m: 0, speed_m_s: 1540}, {depth_m: 35, speed_m_s: 1535}, {depth_m: 42, speed_m_s: 1490}, \
                    {depth_m: 60, speed_m_s: 1488}]";
        let water = format!("water: {{surface_z_m: 50, absorption: none, wind_m_s: 0, profile: {{{cast}}}{assumed}}}");
        let environment = Environment::from_yaml(&water).unwrap();
        let options = ScanOptions::default().environment(environment).fields(FieldSet::all());
        bed.scene.scan(&sensor, &Trajectory::fixed(Pose::at(3.0, -2.0, HEIGHT)), &options).unwrap()
    };
    let place = |cloud: &PointCloud, row: usize| {
        let columns = cloud.columns();
        let corrected = [columns.corrected_x()[row], columns.corrected_y()[row], columns.corrected_z()[row]];
        DVec3::from(corrected.map(f64::from)) + cloud.origin
    };
    let cloud = hear("");
    let mut straight: f64 = 0.0;
    for row in 0..cloud.len() {
        let corrected = place(&cloud, row);
        assert!(corrected.z.abs() < 0.1, "{row}: {corrected}");
        assert!(cloud.columns().quality()[row] > 0.0 && cloud.columns().quality()[row] <= 1.0);
        straight = straight.max((f64::from(cloud.columns().z()[row]) + cloud.origin.z).abs());
    }
    assert!(straight > 0.3, "{straight}");
    // In water of one speed: along the axis, as far as sound gets there.
    let cloud = hear(", assumed_profile: {constant: {speed_m_s: 1500}}");
    let speed = 1540.0 - 5.0 / 35.0 * 30.0;
    for row in 0..cloud.len() {
        let columns = cloud.columns();
        let [azimuth, elevation] = [columns.azimuth()[row], columns.elevation()[row]].map(f64::from);
        // By Snell's law from the water about the sonar, whose speed it knows.
        let level = elevation.cos() * 1500.0 / speed;
        let axis = DVec3::new(level * azimuth.cos(), level * azimuth.sin(), -(1.0 - level * level).sqrt());
        let expected = DVec3::new(3.0, -2.0, HEIGHT) + axis * f64::from(columns.range()[row]) * 1500.0 / speed;
        assert!(place(&cloud, row).distance(expected) < 1e-3, "{row}: {} {expected}", place(&cloud, row));
    }
}
