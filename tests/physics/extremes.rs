//! Numbers at the ends of what is allowed: they make points, or an error, but no points that are nowhere.

use echocast::cloud::FIELDS;
use echocast::scene::Material;
use echocast::{BuiltScene, Environment, Field, FieldSet, Pose, ScanOptions, Sensor, SensorKind, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;
use serde_json::Value;
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// More beams or rays than these are not scanned, which would take too long for what it shows.
const MOST_RAYS: usize = 30_000;

/// With all keys that a sensor can have, in as many files as that takes.
const SENSORS: [&str; 13] = [
    "{name: spinning, kind: lidar, pattern: {type: spinning, azimuth: {fov_deg: 360, rate_hz: 10}, cycle_us: 2000,
      channels: {elevation_deg: [-15, 1], fire_time_us: [0, 2], azimuth_offset_deg: [0, 1]}},
      beam: {wavelength_nm: 903, divergence_mrad: [3, 1.5], pulse_ns: 6, exit_diameter_mm: 12, aperture_mm: 50, overlap_m: [0.4, 1.5],
      near_range_m: 25, sub_rays: adaptive}, range: {min_m: 0.5, max_m: 100, resolution_m: 0.002},
      detection: {model: radar_equation, reflectance: 0.1, at_m: 50, saturation: 100, channel_efficiency: [1, 0.9],
      blooming: {weight: 1e-3, width_deg: 2, floor: 1e-4}}, returns: {mode: all, max: 3, separation_m: 0.2},
      noise: {range_sigma_m: 0.03, range_sigma_per_m: 1e-3, range_snr_sigma_m: 0.01, channel_bias_sigma_m: 0.01,
      channel_gain_sigma: 0.01, instrument: 5, temperature_m_per_k: 0.01, temperature_offset_k: 3, azimuth_sigma_deg: 0.1,
      azimuth_step_deg: 0.05, pointing_sigma_deg: 0.05, time_sigma_us: 3, dropout: 0.1, dropout_weak: {below: 0.8, at_zero: 0.4},
      intensity_percent: 3, intensity_snr_percent: 20}, intensity: {encoding: reflectivity8, white_count: 100},
      doppler: {sigma_m_s: 0.2, ambiguity_m_s: 9}}",
    "{name: risley, kind: lidar, pattern: {type: risley, pulse_rate_hz: 5000, rate_hz: 10, prisms: [{wedge_deg: -18, ior: 1.5,
      rpm: 7294, first_face: flat}, {wedge_deg: 18, ior: 1.5, rpm: -4664, first_face: tilted}]},
      beam: {divergence_mrad: [0.9, 8], pulse_ns: 4, sub_rays: 4}, range: {min_m: 0.1, max_m: 260},
      detection: {model: statistical, reflectance: 0.2, at_m: 130, tnr: 5.2, bandwidth_mhz: 87, probability: 0.5, sunlight: {
      pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 1.5], filter_nm: 20, adaptive: false}}, returns: {mode: first}}",
    "{name: raster, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 60, step_deg: 3}, elevation: {fov_deg: 30, step_deg: 3},
      rate_hz: 10}, range: {max_m: 50}, detection: {model: reflectivity_limit, lower: {reflectance: 0.01, at_m: 3}, upper:
      {reflectance: 1, at_m: 90}}, noise: {range_table: [{at_m: 2, mean_m: 0.1, sigma_m: 0.01}, {at_m: 9, sigma_m: 0.1}]},
      intensity: {encoding: power}}",
    "{name: table, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 60, step_deg: 3}, elevation: {fov_deg: 30, step_deg: 3},
      rate_hz: 10}, detection: {model: table, points: [{reflectance: 0.1, at_m: 9}, {reflectance: 0.9, at_m: 30}]}}",
    "{name: camera, kind: tof, pattern: {type: pinhole, resolution: [24, 16], fov_deg: [70, 60], rate_hz: 30}, beam: {wavelength_nm:
      860, sub_rays: 1}, range: {min_m: 0.1, max_m: 14, resolution_m: 0.001}, detection: {model: radar_equation, reflectance: 0.1,
      at_m: 9}, tof: {frequencies_mhz: [16, 80, 120], vignetting: cos4, shot_noise: {sigma_m: 0.01, reflectance: 0.5, at_m: 2},
      depth_noise: {model: fankhauser}, lateral_sigma_px: 0.3, multipath_rays: 2}}",
    "{name: eyes, kind: tof, pattern: {type: pinhole, resolution: [24, 16], fov_deg: [70, 60], rate_hz: 30}, range: {max_m: 10},
      detection: {model: radar_equation, reflectance: 0.1, at_m: 9}, tof: {depth_noise: {model: disparity, sigma_px: 0.08},
      second_eye_m: [0, -0.05, 0], illumination: [{angle_deg: 0, value: 1}, {angle_deg: 40, value: 0.1}]}}",
    "{name: sides, kind: sonar, pattern: {type: sidescan, tilt_deg: 25, vertical_deg: 50, along_deg: {shape: line, length_m: 0.6},
      rays: 200, rate_hz: 4}, acoustics: {frequency_khz: 450, source_level_db: 220, bandwidth_khz: 30, pulse_ms: 1, noise_level_db: 60,
      directivity_index_db: 20, processing_gain_db: 10, detection_threshold_db: 10, texture_shape: 3, bounces: 1, bin_m: 0.1,
      tvg: {spreading: 30, absorption_db_m: 0.1, gain_db: 0}}, range: {min_m: 1, max_m: 30}}",
    "{name: swath, kind: sonar, pattern: {type: multibeam, beams: 16, swath_deg: 120, along_deg: 2, across_deg: 8, rays: 16, rate_hz: 4},
      acoustics: {frequency_khz: 400, pulse_ms: 0.1, array_speed_m_s: 1500}, range: {min_m: 0.5, max_m: 30}}",
    "{name: ahead, kind: sonar, pattern: {type: imaging, beams: 16, fov_deg: 90, beam_deg: 6, vertical_deg: 20, tilt_deg: 40, rays: 16,
      rate_hz: 4}, acoustics: {frequency_khz: 900, bandwidth_khz: 30}, range: {min_m: 0.5, max_m: 30}}",
    "{name: turns, kind: sonar, pattern: {type: single_beam, beam_deg: 20, vertical_deg: 30, tilt_deg: 60, turn: {fov_deg: 360,
      step_deg: 0.9}, rays: 200, rate_hz: 4}, acoustics: {frequency_khz: 675, pulse_ms: 0.02}, range: {min_m: 0.5, max_m: 30}}",
    "{name: log, kind: sonar, pattern: {type: dvl, janus_deg: 22.5, beam_deg: 4.4, rays: 100, rate_hz: 4}, acoustics: {frequency_khz:
      1000, bandwidth_khz: 40, pulse_ms: 2}, range: {min_m: 0.1, max_m: 30}, dvl: {sigma_m_s: 0.002, bias_sigma_m_s: 0.0005,
      scale_sigma: 0.01, water: {from_m: 1.5, to_m: 4.5, sigma_m_s: 0.03}}}",
    "{name: chirps, kind: radar, pattern: {type: radar, azimuth_deg: [-60, 60], elevation_deg: [-30, 30], rate_hz: 20},
      range: {min_m: 0.5, max_m: 20}, radar: {power_dbm: 12, noise_figure_db: 14, loss_db: 1, wet_radome_mm: 0.1, instrument: 3,
      mirrors: 1, waveform: {type: fmcw, start_ghz: 77, slope_mhz_per_us: 15, samples: 64, sample_rate_mhz: 2, idle_us: 5,
      adc_start_us: 3, ramp_us: 40, chirps: 16, multiplex: ddm, bands: 4, anti_alias_db: 40}, array: {design_ghz: 77,
      tx: [[0, 0], [4, 1]], rx: {count: 4, step: 1, rows: 1, row_step: 1, at: [0, 0]}, tx_pattern: {gain_dbi: 10, azimuth_deg: 80,
      elevation_table: [[-30, -10], [0, 0], [30, -10]]}, rx_pattern: {gain_dbi: 10, shape: cosine, azimuth_deg: 80,
      elevation_deg: 40}, gain_error_db: 0.5, phase_error_deg: 5}, windows: {range: {chebyshev: {sidelobe_db: 60}},
      velocity: {taylor: {nbar: 4, sidelobe_db: 30}}}, leakage: {power_dbm: -20, length_m: 0.05}, detection: {method: os,
      pfa: 1e-2, dims: cross, guard_cells: [2, 1], reference_cells: [8, 4], os_rank: 0.75, targets_per_cell: 2,
      second_target: 0.3, min_snr_db: 3, limits: {range_m: [0.5, 19], velocity_m_s: [-9, 9], azimuth_deg: [-50, 50],
      elevation_deg: [-20, 20]}, steps: {range_m: 0.01, velocity_m_s: 0.01, azimuth_deg: 0.1, elevation_deg: 0.1},
      max_detections: 100}}}",
    "{name: turn, kind: radar, pattern: {type: radar_rotor, azimuths: 16, rate_hz: 0.5}, range: {min_m: 1, max_m: 20}, radar:
      {power_dbm: 20, mirrors: 0, waveform: {type: pulse, frequency_ghz: 9.41, pulse_us: 0.01, repetition_khz: 3, pulses: 4,
      sample_rate_mhz: 200, samples: 64}, array: {rx_pattern: {gain_dbi: 20, azimuth_deg: 20}}, detection: {pfa: 1e-3, dims: range,
      reference_cells: [8, 1]}}}",
];

const AIR: &str = "{clear_air: {visibility_m: 23000}, rain: {rate_mm_h: 20, mu: 2, forward_recovery: 0.1, drops: true},
    fog: {visibility_m: 60, lidar_ratio_sr: 20, half_space: {point_m: [0, 0, 3], normal: [0, 0, 1]}}, snow: {rate_mm_h: 3,
    density_kg_m3: 100, flakes: true, sphere: {center_m: [1, 2, 3], radius_m: 9}}, dust: {radius_um: 50, per_m3: 1e6, q_ext: 2,
    lidar_ratio_sr: 30, start_m: 2, length_m: 9}, spray: {spectrum: {gamma: {per_cm3: 20, a: 3, g: 1, mode_radius_um: 10}}}}";

const WATER: &str = "{water: {surface_z_m: 20, temperature_c: 12, salinity_psu: 30, ph: 8, latitude_deg: 54, volume_backscatter_db: -70,
    wind_m_s: 5, current_m_s: [0.4, 0.2, 0], shipping: 0.2, spreading: hybrid, spreading_from_m: 20, assumed_speed_m_s: 1490}}";

/// Water that says how fast sound is.
const PROFILE: &str =
    "{water: {surface_z_m: 20, profile: {layers: [{depth_m: 0, speed_m_s: 1500, density_kg_m3: 1000}, {depth_m: 21,
    speed_m_s: 1480, density_kg_m3: 1025}]}}}";

/// With all ways to scatter light and sound.
const MATERIALS: [&str; 7] = [
    "{name: paint, base_color: [0.5, 0.4, 0.3, 1], reflectance: 0.5, roughness: 0.5, metallic: 0.2, transmission: 0.1, ior: 1.5}",
    "{name: pane, transmission: 1, ior: 1.5, group_index: 1.6, pane_m: 0.004, dirt: 0.02, roughness: 0, extinction_index: 0}",
    "{name: glass, transmission: 1, ior: 1.5, thickness_m: 1, attenuation_distance_m: 2, attenuation_color: [0.9, 0.8, 0.7],
      roughness: 0}",
    "{name: mirror, ior: 0.2, extinction_index: 3, roughness: 0, metallic: 1}",
    "{name: sign, reflectance: 0.3, scattering: {model: retro_reflector, samples: [{angle_deg: 5, cd_lx_m2: 250}, {angle_deg: 70,
      cd_lx_m2: 100}]}}",
    "{name: gloss, reflectance: 0.3, scattering: {model: phong, specular: 0.2, exponent: 20}}",
    "{name: rough, reflectance: 0.3, scattering: {model: oren_nayar, slope_sigma_deg: 20}}",
];

/// Paths of all numbers below `value`.
fn numbers(value: &Value, path: &str, paths: &mut Vec<String>) {
    let join = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Number(_) => paths.push(path.to_owned()),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, item)| numbers(item, &format!("{path}[{index}]"), paths));
        }
        Value::Object(map) => map.iter().for_each(|(key, item)| numbers(item, &join(key), paths)),
        _ => {}
    }
}

/// Sizes of all kinds.
fn sizes() -> Vec<f64> {
    let sizes = [1e-300, 1e-40, 1e-12, 1e-3, 1.0, 1e3, 1e9, 1e30, 1e300];
    sizes.into_iter().flat_map(|size| [size, -size]).chain([0.0]).collect()
}

/// Walls, a floor, something in the middle; the floor and what is there are of `material`.
fn scene(material: Option<Material>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = match material {
        Some(material) => scene.material(material),
        None => scene.reflector(0.5),
    };
    scene.stand(Shape::plate(DVec3::Z * -3.0, DVec3::Z, 100.0), Some(paint));
    scene.stand(Shape::plate(DVec3::X * 8.0, -DVec3::X, 100.0), Some(paint));
    scene.stand(Shape::plate(DVec3::X * 4.0, -DVec3::X, 1.0), Some(paint));
    scene.finish().build().unwrap()
}

/// How many scans there were, and how many points of them: most numbers are no error, and show something.
#[derive(Default)]
struct Made {
    scans: usize,
    points: usize,
}

/// What is wrong with a scan; an error is nothing wrong.
fn fault(scene: &BuiltScene, sensor: &Sensor, environment: &Environment, made: &mut Made) -> Option<String> {
    let options = ScanOptions::default().fields(FieldSet::all()).environment(environment.clone());
    let place = Trajectory::fixed(Pose::at(0.0, 0.0, 0.0));
    let scanned = catch_unwind(AssertUnwindSafe(|| scene.scan(sensor, &place, &options)));
    let Ok(scanned) = scanned else { return Some("panics".into()) };
    let cloud = scanned.ok()?;
    (made.scans, made.points) = (made.scans + 1, made.points + cloud.len());
    // Some columns say of themselves when they are no numbers.
    let sure = FIELDS.iter().filter(|info| cloud.fields().contains(info.field) && !info.meaning.contains("NaN"));
    for (info, row) in sure.flat_map(|info| (0..cloud.len()).map(move |row| (info, row))) {
        let value = cloud.column(info.field).get_f64(row);
        if value.is_nan() || value.is_infinite() && info.field != Field::Intensity {
            return Some(format!("{} of row {row} of {} is {value}", info.name, cloud.len()));
        }
    }
    None
}

fn environment_of(sensor: &Sensor) -> Environment {
    Environment::from_yaml(if sensor.kind() == SensorKind::Sonar { WATER } else { AIR }).unwrap()
}

/// Scans with one of each `part` numbers that the keys of sensors can have.
fn check_sensors(part: usize) {
    let scene = scene(None);
    let (mut faults, mut count, mut tried, mut made) = (String::new(), 0, 0, Made::default());
    for text in SENSORS {
        let sensor = Sensor::from_yaml(text, "").unwrap_or_else(|error| panic!("{error}"));
        let environment = environment_of(&sensor);
        assert_eq!(fault(&scene, &sensor, &environment, &mut made), None, "{}", sensor.name());
        let (tree, mut keys) = (serde_json::to_value(sensor.spec()).unwrap(), Vec::new());
        numbers(&tree, "", &mut keys);
        assert!(keys.len() > 5, "{keys:?}");
        for key in keys {
            let bounds = sensor.parameter(&key).unwrap();
            let whole = tree.pointer(&format!("/{}", key.replace(['.', '['], "/").replace(']', ""))).unwrap().is_u64();
            let (min, max) = (bounds.min, bounds.max);
            let ends = [min, min.next_up(), max, max.next_down()];
            // What a pattern has between its ends is millions of beams, which take a while to be made, too.
            let between = if key.starts_with("pattern.") { Vec::new() } else { sizes() };
            let mut values = [&ends[..], &between].concat();
            values.retain(|value| (min..=max).contains(value) && (!whole || value.fract() == 0.0));
            values.sort_by(f64::total_cmp);
            values.dedup();
            for value in values {
                count += 1;
                if count % part != 0 {
                    continue;
                }
                tried += 1;
                let text = if whole { format!("{value}") } else { format!("{value:e}") };
                let mut other = sensor.clone();
                if other.set(&key, &text).is_err() || other.ray_count() > MOST_RAYS {
                    continue;
                }
                if let Some(fault) = fault(&scene, &other, &environment, &mut made) {
                    writeln!(faults, "{}: {key}={text}: {fault}", sensor.name()).unwrap();
                }
            }
        }
    }
    assert!(faults.is_empty(), "{} faults:\n{faults}", faults.lines().count());
    assert!(
        made.scans * 2 > tried && made.points > 20 * tried,
        "{} scans and {} points of {tried}",
        made.scans,
        made.points
    );
}

#[test]
fn no_number_of_a_sensor_makes_points_nowhere() {
    check_sensors(23);
}

/// `cargo test --release --test physics -- --ignored every_number`
#[test]
#[ignore = "takes half a minute: the same with every number"]
fn every_number_of_a_sensor_makes_points_somewhere() {
    check_sensors(1);
}

/// Texts like `text`, a YAML section, each with one of its numbers replaced by something else.
fn with_other_numbers(text: &str) -> Vec<String> {
    let starts = |(at, c): &(usize, char)| {
        let before = text[..*at].chars().next_back().unwrap_or(' ');
        (c.is_ascii_digit() || *c == '-') && matches!(before, ' ' | '[')
    };
    let mut texts = Vec::new();
    for (at, _) in text.char_indices().filter(starts) {
        let end = at + text[at..].find([',', '}', ']']).unwrap();
        texts.extend(sizes().iter().map(|size| format!("{}{size:e}{}", &text[..at], &text[end..])));
    }
    assert!(texts.len() > 15);
    texts
}

#[test]
fn no_number_of_an_environment_makes_points_nowhere() {
    let scene = scene(None);
    let (mut faults, mut tried, mut made) = (String::new(), 0, Made::default());
    for text in [SENSORS[0], SENSORS[4], SENSORS[7], SENSORS[8]] {
        let sensor = Sensor::from_yaml(text, "").unwrap();
        let texts: &[&str] = if sensor.kind() == SensorKind::Sonar { &[WATER, PROFILE] } else { &[AIR] };
        for text in texts.iter().flat_map(|text| with_other_numbers(text)) {
            tried += 1;
            let Ok(environment) = Environment::from_yaml(&text) else { continue };
            if let Some(fault) = fault(&scene, &sensor, &environment, &mut made) {
                writeln!(faults, "{}: {text}: {fault}", sensor.name()).unwrap();
            }
        }
    }
    assert!(faults.is_empty(), "{} faults:\n{faults}", faults.lines().count());
    assert!(
        made.scans * 4 > tried && made.points > 20 * tried,
        "{} scans and {} points of {tried}",
        made.scans,
        made.points
    );
}

#[test]
fn no_number_of_a_material_makes_points_nowhere() {
    let sensors = [SENSORS[0], SENSORS[4], SENSORS[8]].map(|text| Sensor::from_yaml(text, "").unwrap());
    let (mut faults, mut tried, mut made) = (String::new(), 0, Made::default());
    for text in MATERIALS {
        Material::from_yaml(text).unwrap_or_else(|error| panic!("{error}"));
        for text in with_other_numbers(text) {
            tried += sensors.len();
            let Ok(material) = Material::from_yaml(&text) else { continue };
            let scene = scene(Some(material));
            for sensor in &sensors {
                if let Some(fault) = fault(&scene, sensor, &environment_of(sensor), &mut made) {
                    writeln!(faults, "{}: {text}: {fault}", sensor.name()).unwrap();
                }
            }
        }
    }
    assert!(faults.is_empty(), "{} faults:\n{faults}", faults.lines().count());
    assert!(
        made.scans * 4 > tried && made.points > 20 * tried,
        "{} scans and {} points of {tried}",
        made.scans,
        made.points
    );
}
