//! Ring numbers as assigned by the drivers.

use super::SensorSpec;
use cloud::Driver;
use emitter::BeamTable;
use emitter::pattern::Pattern;
use std::sync::Arc;

/// The ring of each of the `channels` of `beams`.
///
/// * Velodyne (velodyne_pointcloud, src/lib/calibration.cpp, the loop for the next-smallest vertical angle): angles are
///   counted upwards from the lowest. The driver ignores a second laser at the same angle; here it shares the ring.
/// * Ouster (ouster-ros, src/point_cloud_compose.h): the row of the image, with the highest on top.
/// * Hesai (HesaiLidar_SDK_2.0, libhesai/UdpParser/src/udp*_parser.cc): the channel of the angle file, whatever its
///   angle.
/// * RoboSense (rs_driver, driver/decoder/chan_angles.hpp, `genUserChan`): for spinning sensors, the number of channels
///   below; for the others, the channel.
/// * Livox (livox_ros_driver2, src/comm/pub_handler.cpp): the line.
pub(super) fn of_channels(spec: &SensorSpec, beams: &BeamTable, channels: usize) -> Arc<[u16]> {
    let same = || (0..channels).map(|channel| channel as u16).collect();
    let spins = matches!(spec.pattern, Pattern::Spinning(_));
    match spec.driver {
        _ if channels == 1 || !spec.kind.is_optical() => same(),
        Some(Driver::Hesai | Driver::Livox | Driver::Autoware) => same(),
        Some(Driver::Robosense) if !spins => same(),
        Some(Driver::Robosense) => rising(&heights(beams, channels), false),
        Some(Driver::Ouster) => from_top(&heights(beams, channels)),
        // Velodyne's, and without a driver.
        _ => rising(&heights(beams, channels), true),
    }
}

/// The mean sine of the elevation of each channel's beams; `None` where it has no beams.
fn heights(beams: &BeamTable, channels: usize) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0u32); channels];
    for (&channel, &up) in beams.channel.iter().zip(&beams.dir_z) {
        let (sum, count) = &mut sums[usize::from(channel)];
        // Sums of equal numbers of single precision are exact, so that channels at one angle stay equal.
        *sum += f64::from(up);
        *count += 1;
    }
    sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect()
}

/// How many of `heights` are below each one; with `once`, equal ones count once.
fn rising(heights: &[Option<f64>], once: bool) -> Arc<[u16]> {
    let mut sorted: Vec<f64> = heights.iter().flatten().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    if once {
        sorted.dedup();
    }
    let rank = |height: f64| sorted.partition_point(|other| *other < height) as u16;
    heights.iter().map(|height| height.map_or(0, rank)).collect()
}

/// The rank of each of `heights`, the highest first; equal ones stay in order.
fn from_top(heights: &[Option<f64>]) -> Arc<[u16]> {
    let mut order: Vec<usize> = (0..heights.len()).collect();
    let height = |channel: usize| heights[channel].unwrap_or(f64::NEG_INFINITY);
    order.sort_by(|&a, &b| height(b).total_cmp(&height(a)));
    let mut rings = vec![0; heights.len()];
    (0..).zip(order).for_each(|(ring, channel)| rings[channel] = ring);
    rings.into()
}

#[cfg(test)]
mod tests {
    use crate::sensor::Sensor;

    /// The rings of a preset, or of a file, by channel.
    fn rings(sensor: &Sensor) -> Vec<u16> {
        sensor.rings.to_vec()
    }

    fn preset(name: &str) -> Vec<u16> {
        rings(&Sensor::preset(name).unwrap())
    }

    fn elevations(sensor: &Sensor) -> Vec<f32> {
        let beams = sensor.beams();
        (0..beams.rows as usize).map(|row| beams.dir_z[row * beams.columns as usize].asin().to_degrees()).collect()
    }

    #[test]
    fn rings_of_presets_are_those_of_their_drivers() {
        // VLP-16: lasers 0, 2, 4 ... look down from -15, 1, 3, 5 ... up from +1 (the manual, table 9-1).
        assert_eq!(preset("velodyne_vlp16"), [0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15]);
        let hdl32: Vec<u16> = (0..16).flat_map(|k| [k, k + 16]).collect();
        // -9.33 is the 17th from below.
        assert_eq!(preset("velodyne_hdl32e"), hdl32);
        // RS16: channels 0 to 7 rise from -15, 8 to 15 fall from +15.
        assert_eq!(preset("robosense_rs16"), [0, 1, 2, 3, 4, 5, 6, 7, 15, 14, 13, 12, 11, 10, 9, 8]);
        for (name, lowest, highest) in [
            ("velodyne_vlp16", -15.0, 15.0),
            ("velodyne_vlp16_hires", -10.0, 10.0),
            ("velodyne_vlp32c", -25.0, 15.0),
            ("velodyne_hdl32e", -30.67, 10.67),
            ("velodyne_hdl64e", -24.555, 1.96),
            ("velodyne_vls128", -25.0, 15.0),
            ("robosense_rs16", -15.0, 15.0),
            ("robosense_rs32", -25.0, 15.0167),
            // From the top.
            ("ouster_os0_128", 45.75, -46.26),
            ("ouster_os1_64", 16.611, -16.611),
            ("ouster_os1_128", 21.4764, -21.4764),
            ("ouster_os2_128", 10.76, -10.5),
            // The channels of the angle files: falling, except for the QT.
            ("hesai_pandar_xt32", 15.0, -16.0),
            ("hesai_pandar64", 14.9, -24.879),
            ("hesai_pandar_qt64", -52.121, 52.133),
        ] {
            let sensor = Sensor::preset(name).unwrap();
            let elevations = elevations(&sensor);
            let mut by_ring = vec![f32::NAN; elevations.len()];
            for (&ring, &elevation) in rings(&sensor).iter().zip(&elevations) {
                by_ring[usize::from(ring)] = elevation;
            }
            let [first, last] = [by_ring[0], by_ring[by_ring.len() - 1]];
            assert!((first - lowest).abs() < 1.0 && (last - highest).abs() < 1.0, "{name}: {first} to {last}");
            let rising = lowest < highest;
            assert!(by_ring.is_sorted_by(|a, b| if rising { a < b } else { a > b }), "{name}: {by_ring:?}");
        }
        // Lines in the order of the file.
        assert_eq!(preset("livox_avia"), [0, 1, 2, 3, 4, 5]);
        // One beam that sweeps, and pixels.
        assert_eq!((preset("livox_mid40"), preset("aeva_aeries_ii"), preset("kinect_v2")), (vec![0], vec![0], vec![0]));
        assert!(preset("mbes_400").into_iter().eq(0..256));
    }

    #[test]
    fn makers_differ_in_the_order_and_in_ties() {
        let yaml = "{name: a, kind: lidar, pattern: {type: spinning, azimuth: {fov_deg: 90, step_deg: 30}, \
                    channels: {elevation_deg: [3, -1, 3, 7, -1]}}}";
        let mut sensor = Sensor::from_yaml(yaml, ".").unwrap();
        assert_eq!(sensor.driver(), None);
        for (driver, expected) in [
            ("null", [1, 0, 1, 2, 0]),
            ("velodyne", [1, 0, 1, 2, 0]),
            ("robosense", [2, 0, 2, 4, 0]),
            ("ouster", [1, 3, 2, 0, 4]),
            ("hesai", [0, 1, 2, 3, 4]),
            ("livox", [0, 1, 2, 3, 4]),
        ] {
            sensor.set("driver", driver).unwrap();
            assert_eq!(rings(&sensor), expected, "{driver}");
        }
        for (driver, fault) in [
            ("autoware", "unknown value \"autoware\"; allowed: velodyne, ouster, hesai, robosense, livox"),
            ("3", "driver"),
        ] {
            let error = sensor.set("driver", driver).unwrap_err().to_string();
            assert!(error.contains(fault), "{error}");
        }
        assert!(sensor.to_yaml().unwrap().contains("\ndriver: livox\n"));
        let mut camera = Sensor::preset("kinect_v2").unwrap();
        let error = camera.set("driver", "ouster").unwrap_err().to_string();
        assert!(error.contains("driver: is given; allowed: with kind: lidar only"), "{error}");
        let error = Sensor::preset("mbes_400").unwrap().set("driver", "ouster").unwrap_err().to_string();
        assert!(error.contains("driver"), "{error}");
    }
}
