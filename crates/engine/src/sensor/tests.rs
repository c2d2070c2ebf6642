use super::*;
use crate::detect::Detection;
use ground::read::bounds::{ABOVE_ZERO, Parameter};
use ground::read::presets;
use std::collections::HashSet;

const MINIMAL: &str = "
name: mini
kind: lidar
pattern:
  type: spinning
  azimuth: {fov_deg: 90, rate_hz: 10, step_deg: 1}
  elevation: {fov_deg: 10, step_deg: 1}
";

fn message(text: &str) -> String {
    Sensor::from_yaml(text, "").unwrap_err().to_string()
}

#[test]
fn what_is_left_out_is_ideal() {
    let sensor = Sensor::from_yaml(MINIMAL, "").unwrap();
    assert_eq!((sensor.name(), sensor.kind(), sensor.beams().len()), ("mini", SensorKind::Lidar, 91 * 11));
    assert_eq!((sensor.range_min_m, sensor.range_max_m, sensor.range_resolution_m), (0.0, f64::INFINITY, 0.0));
    assert_eq!(
        (sensor.wavelength_nm, &sensor.detection, &sensor.noise),
        (905.0, &DetectionSpec::default(), &Noise::default())
    );
    assert_eq!(sensor.intensity, IntensitySpec::default());
}

#[test]
fn presets_are_found_by_name() {
    let sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    assert_eq!((sensor.name(), sensor.beams().rows), ("velodyne_vlp32c", 32));
    assert_eq!(sensor.range_max_m, 200.0);
    assert_eq!(sensor.detection.model, Detection::RadarEquation { reflectance: 0.8, at_m: 200.0 });
    let error = Sensor::preset("velodyne_vlp42c").unwrap_err().to_string();
    assert!(error.starts_with("there is no sensor preset named \"velodyne_vlp42c\"; near: velodyne_vlp32c"), "{error}");
    assert_eq!(Sensor::presets().len(), presets::sensors().count());
}

#[test]
fn names_of_presets_are_lenient() {
    for (name, found) in [
        ("VLP-16", "velodyne_vlp16"),
        ("vlp16", "velodyne_vlp16"),
        ("Velodyne VLP16", "velodyne_vlp16"),
        ("velodyne-vlp-16", "velodyne_vlp16"),
        ("lidar/VLP 16", "velodyne_vlp16"),
        ("VLP-16 hires", "velodyne_vlp16_hires"),
        ("velodyne vlp32", "velodyne_vlp32c"),
        ("RealSense D435", "realsense_d435"),
        ("avia", "livox_avia"),
        ("kinect_v1", "kinect_v1"),
        ("tof/kinect_v1", "kinect_v1"),
    ] {
        assert_eq!(Sensor::open(name).unwrap().name(), found, "{name}");
    }
    for (name, says) in [
        ("OS1", "the sensor preset is \"OS1\", which matches several; allowed: ouster_os1_128, ouster_os1_64"),
        ("kinect", "kinect_v1, "),
        ("velodyne", "velodyne_vlp16, velodyne_vlp16_hires"),
        ("16", "there is no sensor preset named"),
        ("", "there is no sensor preset named"),
        ("a/vlp16", "there is no sensor preset named"),
    ] {
        let error = Sensor::preset(name).unwrap_err().to_string();
        assert!(error.contains(says) && error.len() < 500, "{name}: {error}");
    }
    // Every preset is found under its own name, whatever others contain it.
    for preset in presets::sensors() {
        for name in [preset.name.to_owned(), preset.name.to_uppercase().replace('_', "-")] {
            assert_eq!(Sensor::preset(&name).unwrap().name(), preset.name);
        }
    }
}

#[test]
fn errors_name_line_and_key() {
    let cases = [
        ("noise: {range_sigma: 1}", "line 8: noise.range_sigma: unknown key \"range_sigma\"; near: range_sigma_m"),
        ("nois: {}", "line 8: nois: unknown key \"nois\"; near: noise; allowed: name, title, kind"),
        (
            "noise:\n  range_sigma_m: lots",
            "line 9: noise.range_sigma_m: invalid type: string \"lots\", expected a number",
        ),
        ("doppler: {sigma_m_s: -1}", "line 8: doppler.sigma_m_s: is -1; allowed: 0 to 1000"),
        ("doppler: {ambiguity_m_s: 0}", "line 8: doppler.ambiguity_m_s: is 0; allowed: 0.001 to 1000000"),
        ("doppler: {sigma: 1}", "line 8: doppler.sigma: unknown key \"sigma\"; near: sigma_m_s"),
        ("noise:\n  range_sigma_m: -1", "line 9: noise.range_sigma_m: is -1; allowed: 0 to 1000000000"),
        ("noise:\n  range_sigma_m: .nan", "line 9: "),
        ("noise:\n  range_sigma_per_m: 2", "line 9: noise.range_sigma_per_m: is 2; allowed: 0 to 1"),
        ("noise:\n  instrument: -1", "line 9: noise.instrument: invalid value: integer `-1`, expected a whole number"),
        (
            "noise:\n  range_table: [{at_m: 3, sigma_m: 0.1}, {at_m: 2, sigma_m: 0.1}]",
            "line 9: noise.range_table[1].at_m: is 2; allowed: above noise.range_table[0].at_m (3)",
        ),
        (
            "noise:\n  range_table:\n    - {at_m: 3, sigma_m: -0.1}",
            "line 10: noise.range_table[0].sigma_m: is -0.1; allowed: 0 to",
        ),
        ("noise:\n  range_table: [{at_m: 3}]", "line 9: noise.range_table[0]: the key `sigma_m` is missing"),
        (
            "noise:\n  dropout_weak: {below: 0, at_zero: 0.4}",
            "line 9: noise.dropout_weak.below: is 0; allowed: above 0, at most 1000",
        ),
        ("noise: {dropout_weak: 0.4}", "line 8: noise.dropout_weak: invalid type"),
        ("noise: {azimuth_step_deg: 11}", "line 8: noise.azimuth_step_deg: is 11; allowed: 0, or 0.0001 to 10"),
        ("noise: {azimuth_step_deg: 1e-9}", "line 8: noise.azimuth_step_deg: is 0.000000001; allowed: 0, or 0.0001 to"),
        ("noise: {pointing_sigma_deg: -1}", "line 8: noise.pointing_sigma_deg: is -1; allowed: 0 to 10"),
        ("noise:\n  range_snr_sigma_m: 1", "line 9: noise.range_snr_sigma_m: is 1; allowed: 0, or above with"),
        ("range: {min_m: 5, max_m: 4}", "line 8: range.max_m: is 4; allowed: above range.min_m (5)"),
        ("returns: {mode: best}", "line 8: returns.mode: unknown value \"best\"; allowed: strongest, first, last"),
        (
            "returns: {max: 256}",
            "line 8: returns.max: invalid value: integer `256`, expected a whole number from 0 to 255",
        ),
        (
            "detection:\n  model: radar_equation\n  reflectance: 2\n  at_m: 1",
            "line 10: detection.reflectance: is 2; allowed: above 0, at most 1",
        ),
        (
            "detection:\n  model: radar_equation\n  reflectance: x\n  at_m: 1",
            "line 10: detection.reflectance: invalid type: string \"x\"",
        ),
        ("detection:\n  model: radar_equation\n  reflectance: 1", "line 8: detection: the key `at_m` is missing"),
        (
            "detection:\n  model: radar_equation\n  reflectance: 1\n  at_n: 1",
            "line 11: detection.at_n: unknown key \"at_n\"; near: at_m",
        ),
        ("detection: {model: radar}", "line 8: detection.model: unknown value \"radar\"; near: radar_equation"),
        ("detection: {reflectance: 1}", "line 8: detection: the key `model` is missing"),
        (
            "detection: {model: reflectivity_limit, lower: {reflectance: 0, at_m: 5}, upper: {reflectance: 1, at_m: 5}}",
            "line 8: detection.upper.at_m: is 5; allowed: above detection.lower.at_m (5)",
        ),
        (
            "beam: {divergence_mrad: 3}",
            "line 8: beam.pulse_ns: is 0; allowed: above 0 with a beam.divergence_mrad: without a pulse",
        ),
        ("beam: {sub_rays: 19}", "line 8: beam.pulse_ns: is 0; allowed: above 0 with beam.sub_rays above 1"),
        ("beam: {sub_rays: 0}", "line 8: beam.sub_rays: is 0; allowed: 1 to 1024"),
        (
            "beam: {sub_rays: some}",
            "line 8: beam.sub_rays: invalid value: string \"some\", expected a whole number from 1 to 1024, `adaptive` or `{adaptive: N}`",
        ),
        ("beam: {sub_rays: -1}", "line 8: beam.sub_rays: invalid value: integer `-1`, expected a whole number"),
        ("beam: {sub_rays: adaptive}", "line 8: beam.pulse_ns: is 0; allowed: above 0 with beam.sub_rays above 1"),
        ("returns: {mode: both}", "line 8: returns.mode: unknown value \"both\"; allowed: strongest, first, last"),
        ("detection: {model: table}", "line 8: detection: the key `points` is missing"),
        ("detection: {model: table, points: []}", "line 8: detection.points: is a list of 0; allowed: 1 to 1000"),
        (
            "detection:\n  model: table\n  points:\n    - {reflectance: 0.1, at_m: 5}\n    - {reflectance: 0.2, at_m: 5}",
            "line 12: detection.points[1].at_m: is 5; allowed: above detection.points[0].at_m (5)",
        ),
        (
            "detection:\n  model: table\n  points:\n    - {reflectance: 1.1, at_m: 5}",
            "line 11: detection.points[0].reflectance: is 1.1; allowed: 0 to 1",
        ),
        (
            "detection:\n  model: table\n  points:\n    - {reflectance: 0.1, range_m: 5}",
            "line 11: detection.points[0].range_m: unknown key \"range_m\"",
        ),
        ("detection: {model: statistical, reflectance: 0.1, at_m: 9}", "line 8: detection: the key `tnr` is missing"),
        (
            "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 0.5}",
            "line 8: detection.tnr: is 0.5; allowed: 1 to 100",
        ),
        (
            "detection: {model: statistical, reflectance: 0, at_m: 9, tnr: 5}",
            "line 8: detection.reflectance: is 0; allowed: above 0, at most 1",
        ),
        (
            "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, probability: 1}",
            "line 8: detection.probability: is 1; allowed: 0.5 to 0.999",
        ),
        (
            "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, bandwidth_mhz: 100}",
            "line 8: detection.bandwidth_mhz: is 100; allowed: 0, or above with range.max_m",
        ),
        (
            "detection:\n  model: statistical\n  reflectance: 0.1\n  at_m: 9\n  tnr: 5\n  sunlight: {pulse_uj: 1}",
            "line 13: detection.sunlight: the key `aperture_mm` is missing",
        ),
        (
            "beam: {pulse_ns: 5}\ndetection:\n  model: statistical\n  reflectance: 0.1\n  at_m: 9\n  tnr: 5\n  \
             sunlight: {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 0], filter_nm: 20}",
            "line 14: detection.sunlight.field_of_view_mrad[1]: is 0; allowed: 0.001 to 1000",
        ),
        (
            "beam: {pulse_ns: 0}\ndetection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, sunlight: \
             {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 3], filter_nm: 20}}",
            "line 8: beam.pulse_ns: is 0; allowed: above 0 with detection.sunlight",
        ),
        (
            "detection: {model: none, channel_efficiency: [1, 0.5]}",
            "line 8: detection.channel_efficiency: is a list of 2; allowed: as many as there are channels (11)",
        ),
        (
            "detection:\n  model: none\n  channel_efficiency: [1, 1.5]",
            "line 10: detection.channel_efficiency[1]: is 1.5; allowed: 0 to 1",
        ),
        (
            "detection:\n  model: none\n  channel_efficiency: all",
            "line 10: detection.channel_efficiency: invalid type: string \"all\", expected a list",
        ),
        (
            "detection:\n  model: none\n  saturation: 100",
            "line 10: detection.saturation: is 100; allowed: a value with detection.model: radar_equation or",
        ),
        (
            "detection: {model: none, timing: leading_edge}",
            "line 8: detection.timing: is leading_edge; allowed: peak, or with detection.model: radar_equation or",
        ),
        (
            "beam: {pulse_ns: 0}\ndetection: {model: radar_equation, reflectance: 0.1, at_m: 9, timing: leading_edge}",
            "line 8: beam.pulse_ns: is 0; allowed: above 0 with detection.timing: leading_edge",
        ),
        (
            "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, timing: edge}",
            "line 8: detection.timing: unknown value \"edge\"; near: leading_edge; allowed: peak, leading_edge",
        ),
        (
            "detection: {model: none, blooming: {weight: 0.1, width_deg: 1}}",
            "line 8: detection.blooming: is given; allowed: with detection.model: radar_equation or statistical only",
        ),
        (
            "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 0.1, width_deg: 1}}",
            "line 2: beam.pulse_ns: is 0; allowed: above 0 with detection.blooming",
        ),
        (
            "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 2, width_deg: 1}}",
            "line 8: detection.blooming.weight: is 2; allowed: 0 to 1",
        ),
        (
            "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 0.1, width_deg: 0}}",
            "line 8: detection.blooming.width_deg: is 0; allowed: above 0, at most 90",
        ),
        (
            "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, saturation: 0.5}",
            "line 8: detection.saturation: is 0.5; allowed: 1 to 1000000000000",
        ),
        ("beam: {overlap_m: [2, 1]}", "line 8: beam.overlap_m[1]: is 1; allowed: above beam.overlap_m[0] (2)"),
        ("beam: {near_range_m: -1}", "line 8: beam.near_range_m: is -1; allowed: 0 to 1000"),
        ("noise: {intensity_percent: -1}", "line 8: noise.intensity_percent: is -1; allowed: 0 to 1000"),
        ("beam: {aperture_mm: 0}", "line 8: beam.aperture_mm: is 0; allowed: above 0, at most 1000"),
        ("beam: {divergence_mrad: [1, 2, 3]}", "line 8: beam.divergence_mrad"),
        (
            "beam: {divergence_mrad: wide}",
            "line 8: beam.divergence_mrad: invalid type: string \"wide\", expected a number or a pair of numbers",
        ),
        ("name: again", "line 8: duplicate"),
        ("title: [", "line 8: unclosed bracket"),
        ("noise:", "line 8: noise: invalid type: null, expected a section of keys"),
    ];
    for (text, expected) in cases {
        let error = message(&format!("{MINIMAL}{text}\n"));
        assert!(error.starts_with(&format!("YAML text: {expected}")), "{text}\n  gives {error}\n  not   {expected}");
    }
}

#[test]
fn errors_of_depth_cameras_name_line_and_key() {
    const CAMERA: &str = "name: mini\nkind: tof\npattern: {type: pinhole, resolution: [4, 4], fov_deg: [60, 60]}\n";
    let cases = [
        ("{frequency_mhz: 20}", "tof.frequency_mhz: unknown key \"frequency_mhz\"; near: frequencies_mhz"),
        ("{frequencies_mhz: 20}", "tof.frequencies_mhz: invalid type: integer `20`"),
        ("{frequencies_mhz: [20, 0]}", "tof.frequencies_mhz[1]: is 0; allowed: 0.1 to 10000"),
        ("{frequencies_mhz: [20.0001]}", "tof.frequencies_mhz[0]: is 20.0001; allowed: whole kHz"),
        ("{frequencies_mhz: [1, 2, 3, 4]}", "tof.frequencies_mhz: is a list of 4; allowed: up to 3"),
        (
            "{frequencies_mhz: [100, 20.001]}",
            "tof.frequencies_mhz: is [100.0, 20.001], the highest 100000 times their common divisor; allowed: at most",
        ),
        ("{wiggle_residual: 2}", "tof.wiggle_residual: is 2; allowed: 0 to 1"),
        ("{inconsistency_m: 0.1}", "tof.inconsistency_m: is given; allowed: with tof.frequencies_mhz only"),
        (
            "{shot_noise: {sigma_m: 0.01, reflectance: 0.5, at_m: 1}}",
            "tof.shot_noise: is given; allowed: with tof.frequencies_mhz only",
        ),
        ("{shot_noise: {sigma_m: 0.01}}", "tof.shot_noise: the key `reflectance` is missing"),
        (
            "{frequencies_mhz: [20], shot_noise: {sigma_m: 0, reflectance: 0.5, at_m: 1}}",
            "tof.shot_noise.sigma_m: is 0; allowed: 0.000000001 to 1000",
        ),
        ("{saturation: {reflectance: 0, at_m: 1}}", "tof.saturation.reflectance: is 0; allowed: above 0, at most 1"),
        ("{vignetting: cos3}", "tof.vignetting: unknown value \"cos3\"; near: cos4"),
        (
            "{illumination: [{angle_deg: 5, value: 1}, {angle_deg: 5, value: 0}]}",
            "tof.illumination[1].angle_deg: is 5; allowed: above tof.illumination[0].angle_deg (5)",
        ),
        ("{depth_noise: {model: khosh}}", "tof.depth_noise.model: unknown value \"khosh\"; near: khoshelham"),
        ("{depth_noise: {model: nguyen, sigma_m: 1}}", "tof.depth_noise.sigma_m: unknown key \"sigma_m\""),
        (
            "{depth_noise: {model: disparity, sigma_px: 0.1}}",
            "tof.depth_noise.model: is disparity; allowed: with tof.second_eye_m only",
        ),
        (
            "{depth_noise: {model: polynomial, sigma_m: [0, 1001, 0]}}",
            "tof.depth_noise.sigma_m[1]: is 1001; allowed: -1000 to 1000",
        ),
        ("{lateral_sigma_px: 11}", "tof.lateral_sigma_px: is 11; allowed: 0 to 10"),
        ("{multipath_rays: 8}", "tof.multipath_rays: is given; allowed: with tof.frequencies_mhz only"),
        ("{multipath_rays: 257}", "tof.multipath_rays: is 257; allowed: 0 to 256"),
        ("{second_eye_m: [0, 0, 0]}", "tof.second_eye_m: is where the camera is; allowed: 1e-6 m or more away from it"),
    ];
    for (section, expected) in cases {
        let error = message(&format!("{CAMERA}tof: {section}\n"));
        let expected = format!("YAML text: line 4: {expected}");
        assert!(error.starts_with(&expected), "{section}\n  gives {error}\n  not   {expected}");
    }
    assert!(message(&format!("{MINIMAL}tof: {{}}\n")).contains("tof: is given; allowed: with kind: tof only"));
    let spinning = MINIMAL.replace("lidar", "tof");
    let error = message(&format!("{spinning}tof: {{lateral_sigma_px: 1}}\n"));
    assert!(error.contains("tof.lateral_sigma_px: is given; allowed: with pattern.type: pinhole only"), "{error}");
}

#[test]
fn errors_in_patterns_name_line_and_key() {
    let cases = [
        (
            "azimuth: {fov_deg: 90,",
            "azimuth: {fov: 90,",
            "line 6: pattern.azimuth.fov: unknown key \"fov\"; near: fov_deg",
        ),
        ("step_deg: 1}\n  e", "step_deg: 0}\n  e", "line 6: pattern.azimuth.step_deg: is 0; allowed: above 0"),
        ("fov_deg: 90, ", "", "line 6: pattern.azimuth: the key `fov_deg` is missing"),
        (
            "rate_hz: 10",
            "rate_hz: fast",
            "line 6: pattern.azimuth.rate_hz: invalid type: string \"fast\", expected a number",
        ),
        ("fov_deg: 90", "fov_deg: 361", "line 6: pattern.azimuth.fov_deg: is 361; allowed: above 0, at most 360"),
        (
            "step_deg: 1}\n  e",
            "step_deg: 1e-9}\n  e",
            "line 6: pattern.azimuth: is 11 x 90000000001 beams; allowed: at most",
        ),
        (
            ", step_deg: 1}\n  e",
            "}\n  e",
            "line 6: pattern.azimuth.step_deg: is missing; allowed: a value here or pattern.cycle_us",
        ),
        (
            ", step_deg: 1}\n  e",
            ", cycle_us: 50}\n  e",
            "line 6: pattern.azimuth.cycle_us: the key is not one of this section: it is pattern.cycle_us; allowed here: fov",
        ),
        ("fov_deg: 10", "fov_deg: 190", "line 7: pattern.elevation.fov_deg: is 190; allowed: above 0, at most 180"),
        (
            "type: spinning",
            "type: spining",
            "line 5: pattern.type: unknown value \"spining\"; near: spinning; allowed:",
        ),
        ("type: spinning", "type: custom", "line 5: pattern.type: is custom; allowed: spinning, raster"),
        ("  type: spinning\n", "", "line 4: pattern: the key `type` is missing"),
        (
            "elevation: {fov_deg: 10, step_deg: 1}",
            "channels: {}",
            "line 7: pattern.channels.elevation_deg: is a list of 0; allowed: 1 to",
        ),
        (
            "elevation: {fov_deg: 10, step_deg: 1}",
            "channels: {elevation_deg: [1, 91]}",
            "line 7: pattern.channels.elevation_deg[1]: is 91; allowed: -90 to 90",
        ),
        (
            "elevation: {fov_deg: 10, step_deg: 1}",
            "channels:\n    elevation_deg:\n      [1,\n      up]",
            "line 10: pattern.channels.elevation_deg[1]: invalid type: string \"up\"",
        ),
        (
            "elevation: {fov_deg: 10, step_deg: 1}",
            "channels: {elevation_deg: [1, 2], fire_time_us: [1]}",
            "line 7: pattern.channels.fire_time_us: is a list of 1; allowed: as many as elevation_deg (2)",
        ),
        ("kind: lidar", "kind: radio", "line 3: kind: unknown value \"radio\"; allowed: lidar, tof, sonar, radar"),
    ];
    for (old, new, expected) in cases {
        assert!(MINIMAL.contains(old), "{old}");
        let error = message(&MINIMAL.replace(old, new));
        assert!(error.starts_with(&format!("YAML text: {expected}")), "{new}\n  gives {error}\n  not   {expected}");
    }
    let risley = "{type: risley, pulse_rate_hz: 10, prisms: [{wedge_deg: 9, ior: 1.5, rpm: 60, first_face: flat}]}";
    let risley = format!("name: mini\nkind: lidar\npattern: {risley}");
    Sensor::from_yaml(&risley, "").unwrap();
    let cases = [
        ("wedge_deg: 9", "wedge_deg: 61", "pattern.prisms[0].wedge_deg: is 61; allowed: -60 to 60"),
        ("ior: 1.5", "ior: 0.9", "pattern.prisms[0].ior: is 0.9; allowed: 1 to 4"),
        ("rpm: 60", "rpm: 1e7", "pattern.prisms[0].rpm: is 10000000; allowed: -1000000 to 1000000"),
        ("rpm: 60", "rpm: 60, phase_deg: 400", "pattern.prisms[0].phase_deg: is 400; allowed: -360 to 360"),
        ("rpm", "rpn", "pattern.prisms[0].rpn: unknown key \"rpn\"; near: rpm"),
        (
            "first_face: flat",
            "first_face: round",
            "pattern.prisms[0].first_face: unknown value \"round\"; allowed: flat",
        ),
        (", first_face: flat", "", "pattern.prisms[0]: the key `first_face` is missing"),
        ("pulse_rate_hz: 10", "pulse_rate_hz: 0", "pattern.pulse_rate_hz: is 0; allowed: above 0"),
        (
            "pulse_rate_hz: 10",
            "pulse_rate_hz: 1e10",
            "pattern.pulse_rate_hz: is 1 x 1000000000 beams; allowed: at most",
        ),
        (
            "prisms: [{wedge_deg: 9, ior: 1.5, rpm: 60, first_face: flat}]",
            "prisms: []",
            "pattern.prisms: is a list of 0; allowed: 1 to 8",
        ),
        (
            "pulse_rate_hz",
            "line_elevation_deg: [0, 46], pulse_rate_hz",
            "pattern.line_elevation_deg[1]: is 46; allowed: -45 to 45",
        ),
        ("wedge_deg: 9", "wedge_deg: 50", "pattern.prisms: is prisms that reflect beams totally; allowed: wedges"),
    ];
    for (old, new, expected) in cases {
        assert!(risley.contains(old), "{old}");
        let error = message(&risley.replace(old, new));
        assert!(error.starts_with(&format!("YAML text: line 3: {expected}")), "{new}\n  gives {error}");
    }
    assert_eq!(message(""), "YAML text: line 1: invalid type: null, expected a section of keys");
}

#[test]
fn errors_of_sonars_name_line_and_key() {
    const SONAR: &str = "\
name: mini
kind: sonar
pattern: {type: sidescan}
acoustics: {frequency_khz: 450, bandwidth_khz: 30}
range: {max_m: 50}
";
    Sensor::from_yaml(SONAR, "").unwrap();
    let acoustics = "acoustics: {frequency_khz: 450, bandwidth_khz: 30}\n";
    let cases = [
        (acoustics, "", "line 1: acoustics: is missing; allowed: a section with kind: sonar"),
        ("frequency_khz: 450, ", "", "line 4: acoustics: the key `frequency_khz` is missing"),
        ("30}", "0}", "line 4: acoustics.bandwidth_khz: is 0; allowed: above 0 to twice acoustics.frequency_khz"),
        ("30}", "901}", "line 4: acoustics.bandwidth_khz: is 901; allowed: above 0 to twice"),
        (", bandwidth_khz: 30", "", "line 4: acoustics.bandwidth_khz: is missing; allowed: this or acoustics.pulse_ms"),
        ("bandwidth_khz: 30", "bandwidth_khz: 1e-300", "line 4: acoustics.bandwidth_khz: is 1e-300; allowed: at least"),
        ("bandwidth_khz: 30", "bandwidth_khz: 0.001", "line 4: acoustics.bandwidth_khz: is 0.001; allowed: at least"),
        ("bandwidth_khz: 30", "pulse_ms: 9000", "line 4: acoustics.pulse_ms: is 9000; allowed: at most"),
        ("bandwidth_khz: 30", "pulse_ms: 0.001", "line 4: acoustics.pulse_ms: is 0.001; allowed: at least 0.00111"),
        (
            "frequency_khz",
            "frequency_hz",
            "line 4: acoustics.frequency_hz: unknown key \"frequency_hz\"; near: frequency_khz",
        ),
        ("30}", "30, bounces: 9}", "line 4: acoustics.bounces: is 9; allowed: 0 to 8"),
        ("30}", "30, speckle: on}", "line 4: acoustics.speckle: unknown value \"on\"; allowed: frozen, off"),
        ("30}", "30, array_speed_m_s: 1480}", "line 4: acoustics.array_speed_m_s: is given; allowed: with pattern"),
        ("bandwidth_khz: 30", "pulse_ms: 1, taper: hamming", "line 4: acoustics.taper: is given; allowed: with ac"),
        ("sidescan", "sidescan, down_fov_deg: 90, step_deg: 2, rays: 9", "line 3: pattern.rays: is 9; allowed: no"),
        ("sidescan", "multibeam, beams: 4000, swath_deg: 9, rays: 1001", "line 3: pattern.rays: is 1001; allowed: "),
        (
            "sidescan",
            "multibeam, beams: 4000, swath_deg: 120, across_deg: 90, rays: 1000",
            "line 3: pattern.rays: is too many for these beams, which overlap: 1.6e10 beams that receive a ray, over all rays",
        ),
        ("30}", "30, tvg: {spreading: 61}}", "line 4: acoustics.tvg.spreading: is 61; allowed: 0 to 60"),
        ("range: {max_m: 50}\n", "", "line 1: range.max_m: is missing; allowed: a value with kind: sonar"),
        (
            "max_m: 50",
            "max_m: 50, resolution_m: 0.1",
            "line 5: range.resolution_m: is 0.1; allowed: 0 with kind: sonar, whose range bins are acoustics.bin_m",
        ),
        ("range", "beam: {pulse_ns: 5}\nrange", "line 5: beam: is given; allowed: with other kinds than sonar"),
        (
            "range",
            "detection: {model: none, timing: leading_edge}\nrange",
            "line 5: detection: is given; allowed: with",
        ),
        ("range", "returns: {mode: all}\nrange", "line 5: returns: is given; allowed: with other kinds than sonar"),
        ("range", "noise: {dropout: 0.1}\nrange", "line 5: noise: is given; allowed: with other kinds than sonar"),
        ("range", "intensity: {encoding: power}\nrange", "line 5: intensity: is given; allowed: with other"),
        ("range", "tof: {frequencies_mhz: [20]}\nrange", "line 5: tof: is given; allowed: with other kinds than sonar"),
        ("kind: sonar", "kind: lidar", "line 3: pattern.type: is that of a sonar; allowed: with kind: sonar only"),
        (
            "{type: sidescan}",
            "{type: raster, azimuth: {fov_deg: 9, step_deg: 1}, elevation: {fov_deg: 9, step_deg: 1}}",
            "line 3: pattern.type: is that of another kind of sensor; allowed: sidescan, multibeam, imaging,",
        ),
        ("sidescan", "sidescann", "line 3: pattern.type: unknown value \"sidescann\"; near: sidescan"),
        ("sidescan", "sidescan, down_fov_deg: 90", "line 3: pattern.step_deg: is missing; allowed: a value with"),
        (
            "sidescan",
            "sidescan, step_deg: 1",
            "line 3: pattern.step_deg: is 1; allowed: with pattern.down_fov_deg only",
        ),
        ("sidescan", "sidescan, sides: left", "line 3: pattern.sides: unknown value \"left\"; allowed: both, port"),
        ("sidescan", "sidescan, flat: map", "line 3: pattern.flat: unknown value \"map\"; allowed: waterfall, plan"),
        ("sidescan", "sidescan, tilt_deg: 91", "line 3: pattern.tilt_deg: is 91; allowed: 0 to 90"),
        ("sidescan", "sidescan, along_deg: wide", "line 3: pattern.along_deg: invalid type: string \"wide\", expected"),
        ("sidescan", "multibeam, beams: 1, swath_deg: 120", "line 3: pattern.beams: is 1; allowed: 2 to 4096"),
        ("sidescan", "multibeam, beams: 9, swath_deg: 171", "line 3: pattern.swath_deg: is 171; allowed: above 0, at"),
        ("sidescan", "imaging, beams: 9, fov_deg: 181", "line 3: pattern.fov_deg: is 181; allowed: above 0, at most"),
        ("sidescan", "imaging, beams: 9", "line 3: pattern: the key `fov_deg` is missing"),
        ("sidescan", "single_beam, beam_deg: 0", "line 3: pattern.beam_deg: is 0; allowed: 0.001 to 180"),
        (
            "sidescan",
            "single_beam, beam_deg: 3, turn: {fov_deg: 361, step_deg: 1}",
            "line 3: pattern.turn.fov_deg: is 361; allowed: above 0, at most 360",
        ),
    ];
    for (old, new, expected) in cases {
        assert!(SONAR.contains(old), "{old}");
        let error = message(&SONAR.replacen(old, new, 1));
        assert!(error.starts_with(&format!("YAML text: {expected}")), "{new}\n  gives {error}\n  not   {expected}");
    }
    let error = message(&format!("{MINIMAL}acoustics: {{frequency_khz: 450, bandwidth_khz: 30}}\n"));
    assert_eq!(error, "YAML text: line 8: acoustics: is given; allowed: with kind: sonar only");
}

#[test]
fn sonars_show_nothing_of_light() {
    let mut sensor = Sensor::preset("sss_450").unwrap();
    let text = sensor.to_yaml().unwrap();
    let sections: Vec<_> = text.lines().filter(|line| !line.starts_with(' ')).collect();
    let names: Vec<_> = sections.iter().map(|line| line.split(':').next().unwrap_or_default()).collect();
    assert_eq!(names, ["name", "title", "kind", "source", "pattern", "range", "acoustics", "expect"], "{text}");
    for key in ["noise.range_sigma_m", "beam.sub_rays", "detection.saturation", "tof.second_eye_m[0]"] {
        let error = sensor.parameter(key).unwrap_err().to_string();
        assert!(error.starts_with(&format!("there is no numeric parameter named {key:?}")), "{error}");
    }
    assert!(sensor.parameter("acoustics.bin_m").unwrap().value.is_nan());
    let error = sensor.set("noise.range_sigma_m", "1").unwrap_err().to_string();
    assert!(error.starts_with("noise.range_sigma_m=1: noise: is given; allowed: with other kinds"), "{error}");
    assert_eq!(sensor.to_yaml().unwrap(), text);
    sensor.set("acoustics.bin_m", "0.1").unwrap();
    sensor.set("pattern.along_deg", "1").unwrap();
    assert_eq!(sensor.parameter("acoustics.bin_m").unwrap(), Parameter { value: 0.1, min: 1e-3, max: 1000.0 });
    // The band is around the frequency, and half a period is the shortest pulse.
    assert_eq!(sensor.parameter("acoustics.bandwidth_khz").unwrap().max, 900.0);
    assert_eq!(sensor.parameter("acoustics.frequency_khz").unwrap().min, 15.0);
    sensor.set("acoustics.bandwidth_khz", "null").unwrap();
    assert_eq!(sensor.parameter("acoustics.pulse_ms").unwrap().min, 1.0 / 900.0);
}

#[test]
fn parameters_are_set_by_path() {
    let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    let beams = sensor.beams.clone();
    sensor.set("noise.range_sigma_m", "0").unwrap();
    assert_eq!(sensor.noise.range_sigma_m, 0.0);
    sensor.set("range.max_m", "null").unwrap();
    assert_eq!(sensor.range_max_m, f64::INFINITY);
    sensor.set("range.max_m", "50").unwrap();
    sensor.set("detection.model", "none").unwrap();
    assert_eq!((sensor.range_max_m, &sensor.detection.model), (50.0, &Detection::None));
    assert!(Arc::ptr_eq(&beams, &sensor.beams), "the pattern is not drawn again");
    sensor.set("pattern.azimuth.rate_hz", "20").unwrap();
    assert_eq!((sensor.beams().columns, sensor.beams().period), (904, 0.05));
    sensor.set("pattern.channels.elevation_deg[0]", "-30").unwrap();
    assert!((sensor.beams().dir_z[0] + 0.5).abs() < 1e-7);
}

#[test]
fn a_wrong_setting_changes_nothing() {
    let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    let before = sensor.to_yaml().unwrap();
    let cases = [
        (
            "noise.range_sigma",
            "0",
            "noise.range_sigma=0: noise.range_sigma: unknown key \"range_sigma\"; near: range_sigma_m",
        ),
        (
            "noise.range_sigma_m",
            "x",
            "noise.range_sigma_m=x: noise.range_sigma_m: invalid type: string \"x\", expected a number",
        ),
        ("noise.range_sigma_m", "-1", "noise.range_sigma_m=-1: noise.range_sigma_m: is -1; allowed: 0 to"),
        ("noise.range_sigma_m", "[", "noise.range_sigma_m=[: line 1: "),
        (
            "noise.range_sigma_m.x",
            "1",
            "noise.range_sigma_m.x=1: noise.range_sigma_m has no key \"x\": it is not a section",
        ),
        (
            "beam.divergence_mrad[2]",
            "1",
            "beam.divergence_mrad[2]=1: beam.divergence_mrad[2] is past the end of the list of 2",
        ),
        ("noise[0]", "1", "noise[0]=1: noise is not a list"),
        ("noise..x", "1", "noise..x=1: the key has an empty part"),
        ("", "1", "=1: the key has an empty part"),
        ("noise.range_sigma_m", " ", "noise.range_sigma_m= : has no value; `null` removes a key"),
        ("noise.rnage_sigma_m", "null", "noise.rnage_sigma_m=null: noise.rnage_sigma_m: unknown key"),
        (
            "range.resolution_m",
            "1e-7",
            "range.resolution_m=1e-7: range.resolution_m: is 0.0000001; allowed: 0, or 0.000001 to",
        ),
        ("weather.rain", "1", "weather.rain=1: weather: unknown key \"weather\""),
        ("pattern.type", "raster", "pattern.type=raster: pattern: the key `azimuth` is missing"),
        (
            "pattern.azimuth.step_deg",
            "0.4",
            "pattern.azimuth.step_deg=0.4: pattern.azimuth.step_deg: is 0.4; allowed: one of",
        ),
        ("kind", "sonar", "kind=sonar: acoustics: is missing; allowed: a section with kind: sonar"),
    ];
    for (key, value, expected) in cases {
        let error = sensor.set(key, value).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{key}={value}\n  gives {error}\n  not   {expected}");
    }
    assert_eq!(sensor.to_yaml().unwrap(), before);
}

#[test]
fn parameters_lie_within_bounds_that_hold() {
    for preset in presets::sensors() {
        let sensor = Sensor::preset(preset.name).unwrap();
        let tree = sensor.tree().unwrap();
        let keys = yaml::numbers(&tree);
        // A sonar has fewer.
        let least = if sensor.kind() == SensorKind::Sonar { 12 } else { 16 };
        assert!(keys.len() >= least, "{keys:?}");
        for key in keys {
            let number = yaml::lookup(&tree, &key).unwrap();
            let Parameter { value, min, max } = sensor.parameter(&key).unwrap();
            assert_eq!(Some(value), number.as_f64());
            assert!(min <= value && value <= max, "{}: {key} {value} {min} {max}", preset.name);
            assert_eq!(min.is_finite() && max.is_finite(), !key.starts_with("expect."), "{key}");
            let outside = if number.is_u64() { [min - 1.0, max + 1.0] } else { [min.next_down(), max.next_up()] };
            for value in outside.into_iter().filter(|value| value.abs() < 1e300) {
                let text = if number.is_u64() { format!("{value}") } else { format!("{value:e}") };
                assert!(sensor.clone().set(&key, &text).is_err(), "{}: {key}={text}", preset.name);
            }
        }
    }
}

#[test]
fn allowed_values_are_accepted() {
    // Making a radar takes longer than other sensors; all of one kind have the same keys.
    const RADARS: [&str; 3] = ["ti_awr1843", "navtech_cts350x", "marine_x_band"];
    // Within the same bounds a key is the same in all presets of a kind.
    let mut tested = HashSet::new();
    for preset in presets::sensors().filter(|it| it.folder != "radar" || RADARS.contains(&it.name)) {
        let sensor = Sensor::preset(preset.name).unwrap();
        let keys = yaml::numbers(&sensor.tree().unwrap());
        // Generating other patterns takes long; elements of arrays are all alike.
        let alike = |key: &str| {
            key.starts_with("pattern.")
                || key.starts_with("radar.array.") && key.contains("x[") && !key.contains("x[0]")
        };
        for key in keys.iter().filter(|key| !alike(key)) {
            let Parameter { min, max, .. } = sensor.parameter(key).unwrap();
            if !tested.insert((preset.folder, key.clone(), min.to_bits(), max.to_bits())) {
                continue;
            }
            for value in [min, max, 0.5 * (min + max), -1.0, 0.0, 1e-9, 1.0, 2000.0, 1e12, 1e300] {
                let Err(error) = sensor.clone().set(key, &format!("{value:e}")) else { continue };
                let error = error.to_string();
                let Some((_, allowed)) = error.split_once("; allowed: ") else { continue };
                // `1 to 5`, and `0, or 1 to 5`; others contain words.
                let ranges = allowed.split(", or ").map(|range| range.split_once(" to ").unwrap_or((range, range)));
                let within = |(low, high): (&str, &str)| match (low.parse::<f64>(), high.parse::<f64>()) {
                    (Ok(low), Ok(high)) => (low..=high).contains(&value),
                    _ => false,
                };
                assert!(!ranges.into_iter().any(within), "{}: {error}", preset.name);
            }
        }
    }
}

#[test]
fn bounds_follow_the_other_keys() {
    let mut sensor = Sensor::from_yaml(MINIMAL, "").unwrap();
    let bounds = |sensor: &Sensor, key: &str| {
        let Parameter { min, max, .. } = sensor.parameter(key).unwrap();
        (min, max)
    };
    assert_eq!(bounds(&sensor, "noise.range_snr_sigma_m"), (0.0, 0.0));
    assert_eq!(sensor.parameter("range.max_m").unwrap(), Parameter { value: f64::INFINITY, min: ABOVE_ZERO, max: 1e9 });
    sensor.set("range", "{min_m: 2, max_m: 5}").unwrap();
    assert_eq!(bounds(&sensor, "range.max_m"), (2f64.next_up(), 1e9));
    assert_eq!(bounds(&sensor, "range.min_m"), (0.0, 5f64.next_down()));
    sensor.set("range.min_m", &format!("{:e}", 5f64.next_down())).unwrap();
    sensor.set("range.max_m", "5").unwrap();
    sensor.set("detection", "{model: radar_equation, reflectance: 1, at_m: 9}").unwrap();
    assert_eq!(bounds(&sensor, "noise.range_snr_sigma_m"), (0.0, 1e9));
    assert_eq!(bounds(&sensor, "detection.reflectance"), (ABOVE_ZERO, 1.0));
    let limits = "{model: reflectivity_limit, lower: {reflectance: 0, at_m: 3}, upper: {reflectance: 1, at_m: 9}}";
    sensor.set("detection", limits).unwrap();
    assert_eq!(bounds(&sensor, "detection.upper.at_m"), (3f64.next_up(), 1e9));
    assert_eq!(bounds(&sensor, "detection.lower.at_m"), (0.0, 9f64.next_down()));
    assert_eq!(bounds(&sensor, "returns.max"), (1.0, 255.0));
    let yaml = "{name: a, kind: tof, pattern: {type: pinhole, resolution: [640, 480], fov_deg: [90, 60]}}";
    let camera = Sensor::from_yaml(yaml, "").unwrap();
    assert_eq!(bounds(&camera, "pattern.resolution[1]"), (1.0, 100_000.0));
    assert_eq!(bounds(&camera, "pattern.fov_deg[0]"), (ABOVE_ZERO, 180f64.next_down()));
}

#[test]
fn parameters_are_numbers_that_there_are() {
    let sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    // A key that stands for another, one that the file leaves out, one without bounds.
    assert_eq!(sensor.parameter("pattern.channels.elevation_deg[00]").unwrap().min, -90.0);
    let step = sensor.parameter("pattern.azimuth.step_deg").unwrap();
    assert!(step.value.is_nan() && (step.min, step.max) == (1e-9, 1e12), "{step:?}");
    let points = sensor.parameter("expect.points_per_s").unwrap();
    assert_eq!((points.min, points.max), (f64::NEG_INFINITY, f64::INFINITY));
    let mine = Sensor::from_yaml(MINIMAL, "").unwrap();
    assert!(mine.parameter("expect.beams").unwrap().value.is_nan());
    let cases = [
        ("noise.range_sigma", "there is no numeric parameter named \"noise.range_sigma\"; near: noise.range_sigma_m"),
        ("range.mx_m", "there is no numeric parameter named \"range.mx_m\"; near: range.max_m, range.min_m"),
        ("detection.at_m", "there is no numeric parameter named \"detection.at_m\""),
        ("noise.dropout.x", "there is no numeric parameter named \"noise.dropout.x\"; near: noise.dropout"),
        ("pattern.channels", "there is no numeric parameter named \"pattern.channels\""),
        ("", "there is no numeric parameter named \"\""),
        ("kind", "kind is a word; allowed: the keys of numbers, such as range.min_m or pattern.fov_deg[0]"),
        ("beam.divergence_mrad", "beam.divergence_mrad is a list; allowed: the keys of numbers"),
        ("beam", "beam is a section of keys; allowed: the keys of numbers"),
    ];
    for (key, expected) in cases {
        let error = mine.parameter(key).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{key}\n  gives {error}\n  not   {expected}");
    }
}

#[test]
fn written_yaml_reads_back_the_same() {
    for preset in presets::sensors() {
        let sensor = Sensor::preset(preset.name).unwrap();
        let text = sensor.to_yaml().unwrap();
        let again = Sensor::from_yaml(&text, "").unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(again.spec, sensor.spec, "{text}");
        assert!(text.lines().all(|line| line.len() <= 120 || line.starts_with("source:")), "{text}");
    }
}

/// With every key of detection and noise.
#[test]
fn what_noise_needs_is_written_and_has_bounds() {
    let detection = "{model: statistical, reflectance: 0.1, at_m: 90, probability: 0.5, tnr: 5, bandwidth_mhz: 200, \
                     channel_efficiency: [1, 0.9, 1, 1, 1, 1, 1, 1, 1, 1, 0], saturation: 1000, blooming: {weight: 1e-4, width_deg: 0.5}, \
                     sunlight: {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 1.5], filter_nm: 20, adaptive: false}}";
    let noise = "{range_table: [{at_m: 2, mean_m: 0.1, sigma_m: 0.01}, {at_m: 9, sigma_m: 0.1}], instrument: 7, \
                 channel_bias_sigma_m: 0.04, dropout_weak: {below: 0.8, at_zero: 0.4}, range_snr_sigma_m: 0.02}";
    let doppler = "{sigma_m_s: 0.1, ambiguity_m_s: 80}";
    let sections = format!(
        "range: {{max_m: 200}}\nbeam: {{pulse_ns: 5}}\ndetection: {detection}\nnoise: {noise}\ndoppler: {doppler}\n"
    );
    let mut sensor = Sensor::from_yaml(&format!("{MINIMAL}{sections}"), "").unwrap();
    let text = sensor.to_yaml().unwrap();
    assert_eq!(Sensor::from_yaml(&text, "").unwrap().spec, sensor.spec, "{text}");
    let bounds = |sensor: &Sensor, key: &str| {
        let Parameter { value, min, max } = sensor.parameter(key).unwrap();
        (value, min, max)
    };
    assert_eq!(bounds(&sensor, "noise.range_table[0].at_m"), (2.0, 0.0, 9f64.next_down()));
    assert_eq!(bounds(&sensor, "noise.range_table[1].mean_m"), (0.0, -1e9, 1e9));
    assert_eq!(bounds(&sensor, "noise.dropout_weak.below"), (0.8, ABOVE_ZERO, 1000.0));
    assert_eq!(bounds(&sensor, "doppler.ambiguity_m_s"), (80.0, 1e-3, 1e6));
    assert_eq!(bounds(&sensor, "noise.instrument"), (7.0, 0.0, f64::from(u32::MAX)));
    assert_eq!(bounds(&sensor, "detection.channel_efficiency[1]"), (0.9, 0.0, 1.0));
    assert_eq!(bounds(&sensor, "detection.saturation"), (1000.0, 1.0, 1e12));
    assert_eq!(bounds(&sensor, "detection.blooming.floor"), (0.0, 0.0, 1.0));
    assert_eq!(bounds(&sensor, "detection.sunlight.incidence_deg"), (45.0, 0.0, 90.0));
    // Another pattern has other channels, another model no sun.
    let error = sensor.set("pattern.elevation.fov_deg", "5").unwrap_err().to_string();
    assert!(
        error.contains("detection.channel_efficiency: is a list of 11; allowed: as many as there are channels (6)")
    );
    assert!(sensor.set("range.max_m", "null").unwrap_err().to_string().contains("bandwidth_mhz: is 200; allowed: 0,"));
    assert_eq!(sensor.to_yaml().unwrap(), text);
    sensor.set("detection", "{model: radar_equation, reflectance: 0.1, at_m: 9}").unwrap();
    assert!(sensor.parameter("detection.saturation").unwrap().value.is_nan());
    assert!(sensor.parameter("detection.sunlight.incidence_deg").is_err());
}

#[test]
fn sensors_are_made_of_beams() {
    let beams = Sensor::from_yaml(MINIMAL, "").unwrap().beams().clone();
    let mut sensor = Sensor::from_beams("mine", beams.clone()).unwrap();
    sensor.set("range.max_m", "10").unwrap();
    assert_eq!((sensor.name(), sensor.range_max_m, sensor.beams()), ("mine", 10.0, &beams));
    let mut slack = beams.clone();
    slack.dir_x.iter_mut().chain(&mut slack.dir_y).chain(&mut slack.dir_z).for_each(|value| *value *= 1.00009);
    let tight = Sensor::from_beams("tight", slack).unwrap();
    assert!(tight.beams().dir_x.iter().zip(&beams.dir_x).all(|(is, exact)| (is - exact).abs() < 2e-7));
    let mut short = beams.clone();
    short.time.pop();
    let error = Sensor::from_beams("mine", short).unwrap_err().to_string();
    assert_eq!(error, "time is 1000 beams long; allowed: 1001 beams");
    let mut long = beams.clone();
    long.dir_x[3] = 2.0;
    assert!(Sensor::from_beams("mine", long).unwrap_err().to_string().starts_with("direction of beam 3 is (2, "));
    let mut nan = beams;
    nan.period = f64::NAN;
    assert!(Sensor::from_beams("mine", nan).is_err());
}

#[test]
fn tables_are_found_beside_the_sensor_file() {
    let folder = tempfile::tempdir().unwrap();
    let csv = "channel,elevation_deg,azimuth_deg,time_us,range_max_m\n# two beams\n3,30,0,5,10\n4,0,90,7.5,20\n";
    std::fs::write(folder.path().join("rays.csv"), csv).unwrap();
    let file = folder.path().join("mine.yaml");
    std::fs::write(&file, "name: mine\nkind: lidar\npattern: {type: table, file: rays.csv, rate_hz: 10}\n").unwrap();
    let mut sensor = Sensor::load(&file).unwrap();
    sensor.set("pattern.rate_hz", "20").unwrap();
    let table = sensor.beams();
    assert_eq!((table.rows, table.columns, table.period, table.firing(1)), (1, 2, 0.05, 1));
    assert!((table.dir_z[0] - 0.5).abs() < 1e-7 && (table.dir_y[1] - 1.0).abs() < 1e-7);
    assert_eq!((&table.channel[..], &table.time[..]), (&[3, 4][..], &[5e-6, 7.5e-6][..]));
    assert_eq!((&table.range_max[..], table.range_min.len()), (&[10.0, 20.0][..], 0));
    table.check().unwrap();
    let cases = [
        ("azimuth_deg\n", "line 1: the column elevation_deg is missing"),
        ("azimuth_deg,elevation_deg,colour\n", "line 1: unknown column \"colour\"; allowed: azimuth_deg"),
        ("azimuth_deg,elevation_deg,azimuth_deg\n", "line 1: has two columns of one name"),
        ("azimuth_deg,elevation_deg\n", "has no beams"),
        ("", "is empty; expected a header"),
        ("azimuth_deg,elevation_deg\n0,0\n0,inf\n", "line 3: elevation_deg is \"inf\"; expected a finite number"),
        ("azimuth_deg,elevation_deg\n0,91\n", "line 2: elevation_deg is 91; allowed: -90 to 90"),
        ("azimuth_deg,elevation_deg\n0\n", "line 2: has 1 numbers; the header has 2"),
        ("azimuth_deg,elevation_deg\n0,0,0\n", "line 2: has 3 numbers; the header has 2"),
        ("azimuth_deg,elevation_deg,channel\n0,0,1.5\n", "line 2: channel is 1.5; allowed: whole numbers"),
        ("azimuth_deg,elevation_deg,range_max_m\n0,0,0\n", "line 2: range_max_m is 0; allowed: above range_min_m"),
    ];
    for (csv, expected) in cases {
        std::fs::write(folder.path().join("rays.csv"), csv).unwrap();
        let error = Sensor::load(&file).unwrap_err().to_string();
        assert!(error.contains(&format!("rays.csv: {expected}")), "{csv}  gives {error}");
    }
    std::fs::remove_file(folder.path().join("rays.csv")).unwrap();
    let error = Sensor::load(&file).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    let error = error.to_string();
    assert!(error.contains("rays.csv: No such file"), "{error}");
    assert!(error.ends_with("mine.yaml: line 3: pattern.file"), "{error}");
    let error = sensor.set("pattern.file", "other.csv").unwrap_err().to_string();
    assert!(error.contains("other.csv: No such file") && error.ends_with(": pattern.file"), "{error}");
}

#[test]
fn sensors_without_rows_have_no_image() {
    let error = Sensor::preset("livox_avia").unwrap().image_grid().unwrap_err().to_string();
    assert!(error.contains("no rows and columns") && error.contains("pinhole"), "{error}");
    let error = Sensor::preset("sss_450").unwrap().image_grid().unwrap_err().to_string();
    assert!(error.contains("pings"), "{error}");
    assert!(Sensor::preset("vlp16").unwrap().image_grid().is_ok());
}
