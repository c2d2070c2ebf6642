//! Water and its boundaries, as computed by other programs.

use super::assert_near;
use echocast::material::{Sediment, Sound};
use echocast::medium::{Absorption, AmbientNoise, Fluid, Sea, SoundSpeed, pressure_bar, unesco_speed};
use echocast::scene::Material;
use echocast_tests::reference::Table;

/// One of the programs converts temperatures to the scale of 1968 for formulas of that time; we, like the others, do so
/// only for UNESCO's, which requires it.
fn scale(temperature_c: f64, column: &str) -> f64 {
    let as_in_1968 = column.contains("_swp") && column != "leroy2008_swp_lat45";
    if as_in_1968 { 1.000_24 * temperature_c } else { temperature_c }
}

#[test]
fn speeds_of_sound_are_those_of_other_programs() {
    let table = Table::parse(include_str!("../data/sonar/sound_speed.csv"), ',');
    assert_eq!(table.len(), 100);
    for row in 0..table.len() {
        let [t, s, z, dbar] = ["T_C", "S", "z_m", "p_dbar_gsw"].map(|column| table.number(row, column));
        for (formula, columns) in [
            (SoundSpeed::Medwin, &["paper_eq8", "medwin_swp"][..]),
            (SoundSpeed::Mackenzie, &["mackenzie_arlpy", "mackenzie_uwacan", "mackenzie_echopype", "mackenzie_swp"]),
            (SoundSpeed::Leroy, &["leroy2008_swp_lat45"]),
        ] {
            for column in columns {
                let what = format!("{formula:?} ({column}) at {t} C, {s} PSU, {z} m");
                assert_near(&what, formula.speed(scale(t, column), s, z, 45.0), table.number(row, column), 1e-4);
            }
        }
        let what = format!("UNESCO at {t} C, {s} PSU, {z} m");
        let expected = table.number(row, "chenmillero_seawater");
        assert_near(&what, unesco_speed(t, s, dbar / 10.0), expected, 1e-3);
        // By depth the pressure is that of another standard ocean, at most 0.13 dbar apart.
        assert_near("pressure", 10.0 * pressure_bar(z, 45.0), dbar, 0.14);
        assert_near(&what, SoundSpeed::Unesco.speed(t, s, z, 45.0), expected, 4e-3);
    }
}

#[test]
fn absorption_is_that_of_other_programs() {
    let table = Table::parse(include_str!("../data/sonar/absorption_db_per_km.csv"), ',');
    assert_eq!(table.len(), 945);
    for row in 0..table.len() {
        let [t, s, ph, z, f] = ["T_C", "S", "pH", "z_m", "f_Hz"].map(|column| table.number(row, column));
        for (law, columns) in [
            (Absorption::FrancoisGarrison, &["fg_arlpy", "fg_echopype", "fg_swp(T68)"][..]),
            (Absorption::AinslieMccolm, &["am_openstb", "am_swp"]),
        ] {
            for column in columns {
                let expected = table.number(row, column);
                // At 20 C two branches of the law meet, and programs differ in which they use.
                let tolerance = if t == 20.0 { 1e-3 } else { 1e-5 };
                let what = format!("{law:?} ({column}) at {f} Hz, {t} C, {s} PSU, pH {ph}, {z} m");
                assert_near(&what, law.db_per_km(f, scale(t, column), s, ph, z) / expected, 1.0, tolerance);
            }
        }
    }
}

#[test]
fn what_two_fluids_reflect_is_that_of_another_program() {
    let table = Table::parse(include_str!("../data/sonar/reflection.csv"), ',');
    assert_eq!(table.len(), 105);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (here, there) = (Fluid::new(number("rho1"), number("c1")), Fluid::new(number("rho2"), number("c2")));
        let sin_grazing = number("incidence_from_normal_deg").to_radians().cos();
        let [re, im] = here.reflection(&there, sin_grazing);
        let what = format!("{}, {} degrees", table.text(row, "case"), number("incidence_from_normal_deg"));
        assert_near(&what, re, number("V_re_arlpy"), 1e-9);
        assert_near(&what, im, number("V_im_arlpy"), 1e-9);
        let expected = if number("total_internal_reflection") == 1.0 { 0.0 } else { number("paper_eq13_alpha") };
        assert_near(&what, here.transmittance(&there, sin_grazing), expected, 1e-9);
    }
}

#[test]
fn noise_is_that_of_the_table() {
    let table = Table::parse(include_str!("../data/sonar/ambient_noise.csv"), ',');
    assert_eq!(table.len(), 27);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let noise = AmbientNoise { wind_m_s: number("wind_m_s"), shipping: number("shipping_s") };
        let frequency = number("f_kHz") * 1e3;
        // Half of the last printed digit.
        let tolerance = 0.5e-4 + 1e-9;
        assert_near("level", noise.level_db(frequency), number("NL_total_dB_re_1uPa2_per_Hz"), tolerance);
        for (part, column) in noise.parts_db(frequency).into_iter().zip(["turbulence", "shipping", "wind", "thermal"]) {
            assert_near(column, part, number(column), tolerance);
        }
    }
}

#[test]
fn seabeds_are_those_of_jacksons_model() {
    let table = Table::parse(include_str!("../data/sonar/bottom_backscatter.csv"), ',');
    assert_eq!(table.len(), 8 * 4 * 22);
    for row in 0..table.len() {
        let name = match table.text(row, "sediment") {
            "ROUGH_ROCK" => Sediment::RoughRock,
            "ROCK" => Sediment::Rock,
            "COBBLE" => Sediment::Cobble,
            "SANDY_GRAVEL" => Sediment::SandyGravel,
            "COARSE_SAND" => Sediment::CoarseSand,
            "MEDIUM_SAND" => Sediment::MediumSand,
            "FINE_SAND" => Sediment::FineSand,
            "SILT" => Sediment::Silt,
            other => panic!("{other}"),
        };
        let yaml =
            format!("{{name: a, sound: {{law: sediment, name: {}}}}}", table.text(row, "sediment").to_lowercase());
        let material = Material::from_yaml(&yaml).unwrap();
        let sound = Sound::Sediment { name };
        assert_eq!(material.sound_law(), Some(&sound));
        let (frequency, degrees) = (table.number(row, "f_Hz"), table.number(row, "grazing_deg"));
        let sin = degrees.to_radians().sin();
        let what = format!("{name:?} at {frequency} Hz and {degrees} degrees");
        let found = 10.0 * sound.backscatter(sin, frequency).log10();
        assert_near(&what, found, table.number(row, "Sb_total_dB"), 1e-6);
        assert_near(&what, sound.reflection_loss_db(sin), table.number(row, "reflection_loss_dB"), 1e-6);
    }
}

/// Between the rows, and below the first, there are no steps.
#[test]
fn seabeds_are_smooth_between_the_rows() {
    for name in [Sediment::CoarseSand, Sediment::MediumSand, Sediment::FineSand, Sediment::Silt] {
        let sound = Sound::Sediment { name };
        for frequency in [20e3, 70e3, 200e3, 450e3] {
            let db = |degrees: f64| 10.0 * sound.backscatter(degrees.to_radians().sin(), frequency).log10();
            for step in 10..900 {
                let degrees = f64::from(step) / 10.0;
                // Where it grows with the fourth power of the angle a tenth of a degree makes 1.74 dB / angle; and
                // head-on there is a lobe.
                let change = (db(degrees + 0.1) - db(degrees)).abs();
                assert!(change < 2.0 / degrees + 0.6, "{name:?} {frequency} {degrees}: {change}");
            }
        }
    }
}

/// The surface of a calm sea is a mirror; wind makes it scatter instead.
#[test]
fn what_the_sea_does_not_mirror_it_scatters() {
    let (calm, rough) = (Sea { wind_m_s: 0.0 }, Sea { wind_m_s: 10.0 });
    for sin in [0.1, 0.5, 1.0] {
        assert_eq!(calm.mirror_loss_db(sin, 100e3, 1500.0), 0.0);
        assert!(rough.mirror_loss_db(sin, 100e3, 1500.0) > 20.0);
    }
    assert!(rough.backscatter(0.3, 5e3) > calm.backscatter(0.3, 5e3));
    // In wind facets lean more, so fewer of them face an instrument below.
    assert!(rough.backscatter(1.0, 100e3) < Sea { wind_m_s: 2.0 }.backscatter(1.0, 100e3));
}
