//! The explanation of a beam of a ping.

use super::*;
use echocast::medium::{Absorption, Fluid};

/// Of the sonar above the bottom, m.
const HEIGHT: f64 = 20.0;

/// The numbers of the line of `text` that starts with `name`.
fn numbers(text: &str, name: &str) -> Vec<f64> {
    let line = text.lines().find(|line| line.trim_start().starts_with(name));
    let line = line.unwrap_or_else(|| panic!("no line of {name} in\n{text}"));
    let word = |word: &str| word.trim_matches(|c: char| !c.is_ascii_digit() && c != '-').parse().ok();
    line.trim_start()[name.len()..].split_whitespace().filter_map(word).collect()
}

/// From, to, speed, angle, angle there, length, time and loss of each layer.
fn layers(text: &str) -> Vec<[f64; 8]> {
    let row = |line: &str| -> Option<[f64; 8]> {
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        numbers.ok()?.try_into().ok()
    };
    text.lines().filter_map(row).collect()
}

/// Layer by layer: times add up, Snell's law holds, and boundaries take what the paper's eq. 13 says.
#[test]
fn the_ray_of_an_echo_is_told_layer_by_layer() {
    let scene = flat(100.0);
    let (speeds, depths) = ([1500.0, 1450.0, 1520.0], [0.0, 32.0, 41.0]);
    let densities = [1025.0, 1000.0, 1060.0];
    let rows: Vec<String> = (0..3)
        .map(|i| {
            let (depth, speed, density) = (depths[i], speeds[i], densities[i]);
            format!("{{depth_m: {depth}, speed_m_s: {speed}, density_kg_m3: {density}}}")
        })
        .collect();
    let yaml = format!("water: {{surface_z_m: 50, absorption: thorp, profile: {{layers: [{}]}}}}", rows.join(", "));
    let options = options(Environment::from_yaml(&yaml).unwrap());
    let sensor = sonar("type: single_beam, beam_deg: 2, tilt_deg: 40, rays: 512", "");
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, HEIGHT));
    let text = scene.explain(&sensor, &trajectory, &options, 0).unwrap();
    let rows = layers(&text);
    assert_eq!(rows.len(), 3, "{text}");
    let met = numbers(&text, "hit:");
    assert_near("time", rows.iter().map(|row| row[6]).sum(), met[met.len() - 1], 2e-3);
    assert_near("way", rows.iter().map(|row| row[5]).sum(), met[met.len() - 2], 2e-3);
    assert_near("depth of the bottom", rows[2][1], 50.0, 0.01);
    let snell = |row: &[f64; 8]| row[3].to_radians().cos() / row[2];
    for (index, row) in rows.iter().enumerate() {
        assert_near("speed", row[2], speeds[index], 0.0);
        assert_near("Snell", snell(row) / snell(&rows[0]), 1.0, 2e-5);
        let absorption = Absorption::Thorp.db_per_km(450e3, 10.0, 35.0, 8.0, 40.0) * 1e-3;
        assert_near("absorption", row[7], absorption * row[5], 0.01);
        assert_near("time of a layer", row[6], 1e3 * row[5] / row[2], 1e-3);
    }
    for pair in 0..2 {
        let found = numbers(&text, &format!("boundary at {:.2} m:", depths[pair + 1]));
        let [here, there] = [pair, pair + 1].map(|i| Fluid::new(densities[i], speeds[i]));
        let part = here.transmittance(&there, rows[pair][4].to_radians().sin());
        assert_near("boundary", found[0], -db(part), 1e-4);
    }
}

/// Term by term: the echo level is the known level of a flat bottom, and the noise terms add up.
#[test]
fn the_sonar_equation_is_told_term_by_term() {
    let scene = flat(100.0);
    let sensor = sidescan("acoustics.noise_level_db=60 acoustics.directivity_index_db=21 acoustics.pulse_ms=2");
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, HEIGHT));
    let text = scene.explain(&sensor, &trajectory, &options(water("")), 0).unwrap();
    let term = |name: &str| numbers(&text, name)[0];
    let range = numbers(&text, "reported range")[0];
    assert_near("mean level", term("EL "), flat_level(HEIGHT, range), 0.25);
    assert_near("its terms", term("SL ") + term("-2TL ") + term("S ") + term("A "), term("EL "), 0.03);
    assert_near("spreading", -0.5 * term("-2TL "), 20.0 * range.log10(), 0.02);
    // Lambert's law with mu of -10 dB.
    assert_near("backscatter", term("S "), -10.0 + 20.0 * (HEIGHT / range).log10(), 0.02);
    // The footprint: half a degree two-way by a resolution cell on the bottom, by the vertical pattern.
    assert!(term("A ") < db(range * 0.5f64.to_radians() * 0.05 / (1.0 - (HEIGHT / range).powi(2)).sqrt()), "{text}");
    assert_near("noise", term("NL "), 60.0, 0.0);
    assert_near("directivity", term("-DI "), -21.0, 0.0);
    assert_near("gain", term("-PG "), -db(30.0), 0.01);
    assert_near("noise in the cell", term("N "), 60.0 - 21.0 - db(30.0), 0.01);
    let heard = text.lines().find(|line| line.ends_with("level of the cell, with speckle and noise")).unwrap();
    let heard: f64 = heard.split_whitespace().next().unwrap().parse().unwrap();
    assert_near("level of the cell", heard, term("EL "), 0.1);
    assert_near("signal excess", term("SE "), heard - (term("N ") + 10.0), 0.02);
    assert!(text.contains("signal excess: it is reported"), "{text}");
    // Half a degree at 450 kHz: 0.886 wavelengths over the width, and its square over the wavelength.
    assert!(text.contains("a transducer of 0.338 m: far-field beams, valid from 34.3"), "{text}");

    // Total reflection, as sound that leaves at a low angle meets faster water below and rises to the surface.
    let fast = "{layers: [{depth_m: 0, speed_m_s: 1450}, {depth_m: 35, speed_m_s: 1550}]}";
    let yaml = format!("water: {{surface_z_m: 50, absorption: none, wind_m_s: 10, profile: {fast}}}");
    let flat_beam =
        sonar("type: single_beam, beam_deg: 2, tilt_deg: 18, rays: 512", "acoustics.bounces=1 range.max_m=190");
    let flat_beam = set(flat_beam, "pattern.rate_hz=3");
    let text = nothing().explain(&flat_beam, &trajectory, &options(Environment::from_yaml(&yaml).unwrap()), 0).unwrap();
    assert!(text.contains("reflected totally at 35.00 m"), "{text}");
}
