//! Beam patterns of apertures: tables made elsewhere, and known widths, sidelobes and directivities.

use super::assert_near;
use echocast::emitter::lobe::{
    BeamPattern, Lobe, directivity, equivalent_width, line_directivity, piston_directivity, rectangle_directivity,
};
use echocast_tests::reference::Table;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// A pattern at a wavelength of 1 m.
fn pattern(yaml: &str) -> BeamPattern {
    Lobe::from_yaml(yaml).unwrap().at(1.0)
}

fn line(length: f64) -> BeamPattern {
    pattern(&format!("{{shape: line, length_m: {length}}}"))
}

fn piston(ka: f64) -> BeamPattern {
    pattern(&format!("{{shape: piston, diameter_m: {}}}", ka / PI))
}

/// 32 elements half a wavelength apart.
fn array(shading: &str) -> BeamPattern {
    pattern(&format!("{{shape: array, elements: 32, pitch_m: 0.5, {shading}}}"))
}

/// One of each shape.
fn all() -> Vec<(&'static str, BeamPattern)> {
    [
        "2",
        "{shape: line, length_m: 30}",
        "{shape: gaussian, width_deg: 2}",
        "{shape: box, width_deg: 2}",
        "{shape: piston, width_deg: 2}",
        "{shape: array, elements: 32, pitch_m: 0.5}",
        "{shape: array, elements: 48, pitch_m: 0.5, shading: hamming, element_m: 0.4}",
        "{shape: array, elements: 31, pitch_m: 0.5, shading: chebyshev, sidelobe_db: 40}",
        "{shape: table, rows: [{angle_deg: 0, db: 0}, {angle_deg: 1, db: -2}, {angle_deg: 2, db: -9}, {angle_deg: 9, db: -40}]}",
    ]
    .map(|yaml| (yaml, pattern(yaml)))
    .into()
}

fn db(amplitude: f64) -> f64 {
    20.0 * amplitude.abs().log10()
}

/// Level of the highest sidelobe up to the u `reach`: beyond the first place where the level rises again.
fn sidelobe(pattern: &BeamPattern, reach: f64) -> f64 {
    let step = reach / 1e5;
    let levels: Vec<f64> = (0..=100_000).map(|i| db(pattern.amplitude(step * f64::from(i)))).collect();
    let null = levels.windows(2).position(|pair| pair[1] > pair[0]).unwrap();
    levels[null..].iter().copied().fold(f64::MIN, f64::max)
}

/// The sine, between `inside` and `outside`, at which a beam steered to the sine `axis` has half its power.
fn half_power(pattern: &BeamPattern, axis: f64, mut inside: f64, mut outside: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        let loud = pattern.amplitude_steered(middle, axis) > FRAC_1_SQRT_2;
        *(if loud { &mut inside } else { &mut outside }) = middle;
    }
    inside
}

#[test]
fn rectangles_are_those_of_the_table() {
    let table = Table::parse(include_str!("../data/sonar/rect_beampattern_openstb.csv"), ',');
    assert_eq!(table.len(), 205);
    let (across, up) = (line(180.0), line(6.0));
    for row in 0..table.len() {
        let angle = |column| table.number(row, column).to_radians().sin_cos();
        let ((az, _), (el, cos_el)) = (angle("azimuth_deg"), angle("elevation_deg"));
        let found = across.amplitude(cos_el * az) * up.amplitude(el);
        assert_near(&format!("row {row}"), found, table.number(row, "amplitude"), 1e-12);
    }
}

#[test]
fn pistons_are_those_of_the_table() {
    let table = Table::parse(include_str!("../data/sonar/piston_beampattern.csv"), ',');
    assert_eq!(table.len(), 70);
    for row in 0..table.len() {
        let (ka, theta) = (table.number(row, "ka"), table.number(row, "theta_deg"));
        let found = piston(ka).amplitude(theta.to_radians().sin());
        for column in ["dB_beamshapes", "dB_2J1(x)/x_scipy"] {
            let expected = 10f64.powf(table.number(row, column) / 20.0);
            assert_near(&format!("ka {ka} at {theta}"), found.abs(), expected, 1e-6);
            assert_near(&format!("ka {ka} at {theta}, dB"), db(found), table.number(row, column), 1e-3);
        }
    }
}

#[test]
fn directivity_and_widths_are_those_of_the_table() {
    let table = Table::parse(include_str!("../data/sonar/directivity_index.csv"), ',');
    assert_eq!(table.len(), 15);
    for row in 0..table.len() {
        let size = table.number(row, "L/lambda or ka");
        let is_line = table.text(row, "array") == "line";
        let found = if is_line { line_directivity(size) } else { piston_directivity(size) };
        let what = format!("{} of {size}", table.text(row, "array"));
        assert_near(&what, found, table.number(row, "DI_dB_exact_quadrature"), 1e-4);
        let width = if is_line { line(size) } else { piston(size) }.width();
        match table.number(row, "HPBW_deg_exact") {
            none if none.is_nan() => assert_eq!(width, PI),
            degrees => assert_near(&what, width.to_degrees(), degrees, 1e-5),
        }
    }
    // Without an aperture there is no direction, and wide ones continue where the quadrature ends.
    assert_near("a short line", line_directivity(1e-3), 0.0, 1e-4);
    assert_near("a small piston", piston_directivity(1e-3), 10.0 * 2f64.log10(), 1e-4);
    for (below, above, growth) in [
        (line_directivity(999.999), line_directivity(1000.001), 10.0),
        (piston_directivity(999.999), piston_directivity(1000.001), 20.0),
    ] {
        assert_near("DI at the seam", above - below, growth * (1000.001f64 / 999.999).log10(), 2e-4);
    }
}

#[test]
fn directivity_of_two_planes_is_that_of_known_apertures() {
    // A wall silences half of what a line hears.
    let all_around = pattern("{shape: box, width_deg: 180}");
    let wall = 10.0 * 2f64.log10();
    for length in [0.7, 5.0, 50.0, 700.0] {
        let expected = line_directivity(length) + wall;
        assert_near("line across", directivity(&line(length), &all_around), expected, 1e-3);
        assert_near("line up", directivity(&all_around, &line(length)), expected, 1e-3);
    }
    for (across, up, tolerance) in [(180.0, 6.0, 0.1), (60.0, 60.0, 0.01), (400.0, 300.0, 0.01)] {
        let found = directivity(&line(across), &line(up));
        assert_near("rectangle", found, rectangle_directivity(across, up), tolerance);
    }
    // Narrow Gaussians: the integral is that over a plane, of width sqrt(pi / ln 2) / 2 times that at half the power.
    let gaussian = |degrees: f64| pattern(&format!("{{shape: gaussian, width_deg: {degrees}}}"));
    let solid = PI / (4.0 * 2f64.ln()) * 1f64.to_radians() * 3f64.to_radians();
    assert_near("Gaussian", directivity(&gaussian(1.0), &gaussian(3.0)), 10.0 * (4.0 * PI / solid).log10(), 2e-3);
    // Boxes: a window of w x h in direction cosines.
    let window = |degrees: f64| pattern(&format!("{{shape: box, width_deg: {degrees}}}"));
    let solid = 4.0 * 0.5f64.to_radians().sin() * 1.5f64.to_radians().sin();
    assert_near("box", directivity(&window(1.0), &window(3.0)), 10.0 * (4.0 * PI / solid).log10(), 2e-3);
}

/// `10 log(2 L / lambda)` plus the gain of a wall, for lobes as narrow as a file may specify.
#[test]
fn narrow_lobes_have_the_directivity_of_long_lines() {
    let all_around = pattern("{shape: box, width_deg: 180}");
    let wall = 10.0 * 2f64.log10();
    for degrees in [0.05, 0.02, 0.0137, 0.005, 0.001] {
        let lobe = Lobe::Width(degrees).at(1.0);
        // Where sinc^2 is a half.
        let length = 0.442_946_470_689 / (0.5 * degrees).to_radians().sin();
        let expected = 10.0 * (2.0 * length).log10() + wall;
        assert_near(&format!("{degrees} deg across"), directivity(&lobe, &all_around), expected, 1e-3);
        assert_near(&format!("{degrees} deg up"), directivity(&all_around, &lobe), expected, 1e-3);
        let both = directivity(&lobe, &lobe);
        assert_near(&format!("{degrees} deg both"), both, rectangle_directivity(length, length), 2e-3);
    }
    // An array with grating lobes on each side: 5 lobes share its power.
    let sparse = "{shape: array, elements: 4096, pitch_m: 2.5}";
    let dense = "{shape: array, elements: 4096, pitch_m: 0.5}";
    let [sparse, dense] = [sparse, dense].map(|text| directivity(&pattern(text), &all_around));
    assert_near("elements alone count", sparse, dense, 0.02);
}

#[test]
fn sidelobes_are_as_low_as_is_known() {
    assert_near("line", sidelobe(&line(10.0), 1.0), -13.26, 0.01);
    assert_near("piston", sidelobe(&piston(30.0), 1.0), -17.57, 0.01);
    // Up to the middle between two main lobes.
    assert_near("many elements", sidelobe(&array(""), 1.0), -13.23, 0.05);
    let many = pattern("{shape: array, elements: 400, pitch_m: 0.5, shading: hamming}");
    assert_near("Hamming", sidelobe(&many, 0.2), -42.7, 0.1);
    for below in [20.0, 30.0, 55.0] {
        let shaded = array(&format!("shading: chebyshev, sidelobe_db: {below}"));
        assert_near("Chebyshev", sidelobe(&shaded, 1.0), -below, 1e-3);
    }
}

#[test]
fn shading_trades_width_for_sidelobes() {
    let shaded = ["", "shading: chebyshev, sidelobe_db: 20", "shading: chebyshev, sidelobe_db: 30", "shading: hamming"];
    let [width, level] = [BeamPattern::width, |pattern: &BeamPattern| sidelobe(pattern, 1.0)]
        .map(|of: fn(&BeamPattern) -> f64| shaded.map(|shading| of(&array(shading))));
    assert!(width.is_sorted_by(|a, b| a < b), "{width:?}");
    assert!(level.is_sorted_by(|a, b| a > b), "{level:?}");
    // Of all weights with such sidelobes Chebyshev's have the narrowest lobe.
    let same = array(&format!("shading: chebyshev, sidelobe_db: {}", -level[3]));
    assert!(same.width() < width[3], "{} {}", same.width(), width[3]);
}

#[test]
fn every_lobe_has_the_width_it_is_given() {
    for shape in ["line", "gaussian", "box", "piston"] {
        for degrees in [0.2, 1.0, 40.0, 150.0] {
            let pattern = pattern(&format!("{{shape: {shape}, width_deg: {degrees}}}"));
            assert_near(shape, pattern.width().to_degrees(), degrees, 1e-9);
        }
    }
    assert_eq!(pattern("2"), pattern("{shape: line, width_deg: 2}"));
    // 0.6 m at 450 kHz: 0.28 degrees.
    let side_scan = Lobe::from_yaml("{shape: line, length_m: 0.6}").unwrap().at(1500.0 / 450e3);
    assert_near("side scan", side_scan.width(), 0.8859 / 180.0, 1e-6);
    for (yaml, pattern) in all() {
        assert_near(yaml, pattern.amplitude(0.0), 1.0, 1e-12);
        let half = (0.5 * pattern.width()).sin();
        assert!(
            pattern.amplitude(0.999 * half).powi(2) > 0.5 && pattern.amplitude(1.001 * half).powi(2) < 0.5,
            "{yaml}"
        );
    }
    // Elements have patterns of their own.
    let elements = pattern("{shape: array, elements: 2, pitch_m: 1, element_m: 1}");
    let whole = line(2.0);
    for u in [0.1, 0.3, 0.77, 1.0] {
        assert_near("two halves of a line", elements.amplitude(u), whole.amplitude(u), 1e-12);
    }
    assert_near("their width", elements.width(), whole.width(), 1e-9);
}

#[test]
fn steered_beams_widen_as_the_aperture_shrinks() {
    for (yaml, pattern) in all() {
        // Steered elements do not turn.
        if yaml.contains("element_m") {
            continue;
        }
        for degrees in [20f64, 45.0, 60.0] {
            let (axis, cos) = degrees.to_radians().sin_cos();
            let half = (0.5 * pattern.width()).sin();
            let [left, right] = [-2.0, 2.0].map(|side| half_power(&pattern, axis, axis, axis + side * half).asin());
            assert_near(yaml, right - left, (axis + half).asin() - (axis - half).asin(), 1e-9);
            // The cosine is that of the axis: accurate for narrow lobes.
            let expected = pattern.width() / cos;
            assert_near(yaml, right - left, expected, (half / cos.powi(2)).powi(2) * expected);
        }
    }
}

#[test]
fn steered_arrays_have_grating_lobes_where_their_pitch_is_long() {
    let array = pattern("{shape: array, elements: 16, pitch_m: 0.8, element_m: 0.7}");
    let axis = 40f64.to_radians().sin();
    let grating = axis - 1.0 / 0.8;
    let element = line(0.7);
    for (what, sin) in [("axis", axis), ("grating lobe", grating)] {
        assert_near(what, array.amplitude_steered(sin, axis).abs(), element.amplitude(sin).abs(), 1e-12);
    }
    let points = pattern("{shape: array, elements: 16, pitch_m: 0.8}");
    assert!(points.extent(0.1) < 0.2);
    assert!(points.extent_within(0.1, 1.0 + axis) > 1.25);
}

#[test]
fn beyond_its_extent_a_lobe_is_faint() {
    for (yaml, pattern) in all() {
        let mut last = 0.0;
        for power in [0.5, 0.05, 0.01, 1e-3, 1e-5] {
            let extent = pattern.extent(power);
            assert!(extent >= last && extent <= 1.0, "{yaml} {power}: {extent} after {last}");
            last = extent;
            if extent == 1.0 {
                continue;
            }
            for step in 1..=50_000 {
                let u = extent + (1.0 - extent) * f64::from(step) / 50_000.0;
                let found = [u, -u].map(|u| pattern.amplitude(u).powi(2));
                assert!(found.into_iter().all(|found| found <= power), "{yaml} {power} {extent} {u}: {found:?}");
            }
            if !yaml.contains("element_m") {
                // And no more is left out than necessary.
                let (from, to) = (extent - 0.06, extent);
                let loudest = (0..=10_000).map(|i| pattern.amplitude(from + (to - from) * f64::from(i) / 1e4).powi(2));
                assert!(loudest.fold(0.0, f64::max) > 0.99 * power, "{yaml} {power} {extent}");
            }
        }
        assert_eq!((pattern.extent(1.0), pattern.extent(0.0)), (0.0, 1.0), "{yaml}");
    }
    // The last lobe of a sinc above a thousandth is the one beyond 9 nulls: 1 / (pi 9.5)^2 = 1.12e-3.
    let extent = 50.0 * line(50.0).extent(1e-3);
    assert!(extent > 9.5 && extent < 10.0, "{extent}");
}

#[test]
fn equivalent_widths_are_the_integrals() {
    let of = |pattern: &BeamPattern| equivalent_width(|psi| pattern.amplitude(psi.sin()).powi(2));
    assert_near("box", of(&pattern("{shape: box, width_deg: 3}")), 3f64.to_radians(), 1e-7);
    let gaussian = 0.5 * (PI / 2f64.ln()).sqrt() * 3f64.to_radians();
    assert_near("Gaussian", of(&pattern("{shape: gaussian, width_deg: 3}")), gaussian, 1e-7);
    // lambda / L, plus the loss where sin is not the angle.
    for length in [20.0, 200.0, 1000.0] {
        assert_near("line", of(&line(length)) * length, 1.0, 0.1 / length);
    }
    // There and back: the integral of sinc^4 is 2/3.
    let two_way = |psi: f64| line(200.0).amplitude(psi.sin()).powi(4);
    assert_near("line, two-way", 200.0 * equivalent_width(two_way), 2.0 / 3.0, 1e-4);
}

#[test]
fn tables_are_linear_in_db() {
    let rows = "[{angle_deg: -10, db: -20}, {angle_deg: -2, db: 0}, {angle_deg: 4, db: -6}, {angle_deg: 30, db: -12}]";
    let table = pattern(&format!("{{shape: table, rows: {rows}}}"));
    for (degrees, expected) in
        [(-10.1, -200.0), (-10.0 + 1e-9, -20.0), (-6.0, -10.0), (-2.0, 0.0), (0.0, -2.0), (17.0, -9.0), (31.0, -200.0)]
    {
        assert_near("level", db(table.amplitude(f64::to_radians(degrees).sin())), expected, 1e-6);
    }
    // About its loudest row.
    let half = 10.0 * 2f64.log10();
    assert_near("width", table.width().to_degrees(), half / 2.5 + half, 1e-9);
    let mirrored = pattern("{shape: table, rows: [{angle_deg: 0, db: 0}, {angle_deg: 10, db: -20}]}");
    for degrees in [-9.0, -5.0, 5.0, 9.0] {
        let expected = -2.0 * f64::abs(degrees);
        assert_near("mirrored", db(mirrored.amplitude(f64::to_radians(degrees).sin())), expected, 1e-9);
    }
}
