//! Beam patterns: the response of a sonar aperture in directions off its axis, in one plane.
//!
//! Amplitudes are signed and 1 on the axis; powers are their squares (one way). An aperture of two planes, such as a
//! rectangular face, has the product of two patterns, each at the direction cosine along its own edge.

mod array;
mod bessel;
mod directivity;
mod integral;
mod pattern;

pub use directivity::{directivity, line_directivity, piston_directivity, rectangle_directivity};
pub use directivity::{round_directivity, wall_directivity};
pub use pattern::BeamPattern;

use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml;
use ground::read::yaml::{Document, join};
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use std::fmt;

/// The pattern of an aperture in one plane, as written in a file: a number, or a section with a `shape`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Lobe {
    /// A uniform line of this full width at -3 dB, degrees, 0.001 to 180.
    Width(f64),
    /// The pattern that `shape` selects.
    Shape(Shape),
}

/// Shapes of patterns. All widths are full widths at -3 dB (half the power), degrees, 0.001 to 180.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Shape {
    /// A line that transmits and receives uniformly along its length: `sin(x) / x`.
    Line(Line),
    /// Without sidelobes: the power in dB falls with the square of the angle.
    Gaussian {
        /// Full width, degrees.
        width_deg: f64,
    },
    /// 1 within its width, nothing (-200 dB) outside.
    Box {
        /// Full width, degrees.
        width_deg: f64,
    },
    /// A round face that moves as one, in a baffle: `2 J1(x) / x`.
    Piston(Piston),
    /// Equal elements in a row.
    Array(Array),
    /// A measured pattern.
    Table {
        /// 2 to 1000 rows in rising order, linear in dB between them, nothing (-200 dB) outside; mirrored if all angles
        /// are at least 0.
        rows: Vec<Row>,
    },
}

/// Size of a uniform line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Line {
    /// Full width of its lobe, degrees: the line has the length that gives this width at its wavelength.
    #[serde(rename = "width_deg")]
    Width(f64),
    /// Length, m, 1e-6 to 1000.
    #[serde(rename = "length_m")]
    Length(f64),
}

/// Size of a round piston.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Piston {
    /// Full width of its lobe, degrees: the piston has the diameter that gives this width at its wavelength.
    #[serde(rename = "width_deg")]
    Width(f64),
    /// Diameter, m, 1e-6 to 1000.
    #[serde(rename = "diameter_m")]
    Diameter(f64),
}

/// Equal elements in a row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Array {
    /// Number of elements, 2 to 4096.
    pub elements: u32,
    /// From the middle of one element to that of the next, m, 1e-6 to 1000.
    pub pitch_m: f64,
    /// Weights of the elements.
    #[serde(flatten)]
    pub shading: Shading,
    /// Length of an element, a uniform line, m, at most the pitch; none: elements are points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element_m: Option<f64>,
}

/// Weights of the elements of an array: lower sidelobes for a wider main lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "shading", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Shading {
    /// All equal: sidelobes of -13.3 dB.
    Uniform,
    /// `0.54 - 0.46 cos(2 pi n / (N - 1))`: sidelobes of -42.7 dB.
    Hamming,
    /// Dolph-Chebyshev: all sidelobes equal, with the narrowest main lobe for that level.
    Chebyshev {
        /// How far the sidelobes are below the main lobe, dB, 10 to 150.
        sidelobe_db: f64,
    },
}

/// A row of a measured pattern.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Angle off the axis, degrees, -90 to 90.
    pub angle_deg: f64,
    /// Level there, dB, -200 to 0; the highest row has 0.
    pub db: f64,
}

/// Narrowest lobe, degrees.
const NARROWEST_DEG: f64 = 0.001;
/// Smallest and greatest apertures, m.
const SIZES_M: [f64; 2] = [1e-6, 1000.0];
/// Level of nothing, dB.
const NOTHING_DB: f64 = -200.0;

impl Lobe {
    /// Reads a lobe from YAML: a number, or a section with a `shape`.
    ///
    /// # Errors
    /// Line and key of what is wrong.
    pub fn from_yaml(text: &str) -> Result<Lobe> {
        let document = Document::parse("YAML text", text)?;
        let lobe: Lobe = document.read()?;
        lobe.check(&mut Bounds::none(), "").map_err(|error| document.locate(error))?;
        Ok(lobe)
    }

    /// Checks that all values, which are at `key`, are allowed; reports those that have bounds to `bounds`.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds, key: &str) -> Result<()> {
        let width = |bounds: &mut Bounds, key: String, deg: f64| bounds.within(key, deg, NARROWEST_DEG, 180.0);
        let size = |bounds: &mut Bounds, name: &str, m: f64| bounds.within(join(key, name), m, SIZES_M[0], SIZES_M[1]);
        match self {
            Lobe::Width(deg) => width(bounds, key.to_owned(), *deg),
            Lobe::Shape(shape) => match shape {
                Shape::Line(Line::Width(deg))
                | Shape::Piston(Piston::Width(deg))
                | Shape::Gaussian { width_deg: deg }
                | Shape::Box { width_deg: deg } => width(bounds, join(key, "width_deg"), *deg),
                Shape::Line(Line::Length(m)) => size(bounds, "length_m", *m),
                Shape::Piston(Piston::Diameter(m)) => size(bounds, "diameter_m", *m),
                Shape::Array(array) => array.check(bounds, key),
                Shape::Table { rows } => check_rows(rows, bounds, &join(key, "rows")),
            },
        }
    }

    /// The pattern at `wavelength_m`, m, above 0.
    pub fn at(&self, wavelength_m: f64) -> BeamPattern {
        match self {
            Lobe::Width(deg) => BeamPattern::line_of_width(deg.to_radians()),
            Lobe::Shape(shape) => match shape {
                Shape::Line(Line::Width(deg)) => BeamPattern::line_of_width(deg.to_radians()),
                Shape::Line(Line::Length(m)) => BeamPattern::line(m / wavelength_m),
                Shape::Gaussian { width_deg } => BeamPattern::gaussian(width_deg.to_radians()),
                Shape::Box { width_deg } => BeamPattern::boxed(width_deg.to_radians()),
                Shape::Piston(Piston::Width(deg)) => BeamPattern::piston_of_width(deg.to_radians()),
                Shape::Piston(Piston::Diameter(m)) => BeamPattern::piston(m / wavelength_m),
                Shape::Array(array) => BeamPattern::array(array, wavelength_m),
                Shape::Table { rows } => BeamPattern::table(rows),
            },
        }
    }
}

impl Array {
    fn check(&self, bounds: &mut Bounds, key: &str) -> Result<()> {
        let Array { elements, pitch_m, shading, element_m } = *self;
        let [least, most] = SIZES_M;
        let (pitch_key, element_key) = (join(key, "pitch_m"), join(key, "element_m"));
        bounds.within(join(key, "elements"), f64::from(elements), 2.0, 4096.0)?;
        bounds.within(&pitch_key, pitch_m, least, most)?;
        if let Shading::Chebyshev { sidelobe_db } = shading {
            bounds.within(join(key, "sidelobe_db"), sidelobe_db, 10.0, 150.0)?;
        }
        let allowed = format!("{least} to the pitch_m ({pitch_m})");
        bounds.number(element_key, element_m, [least, pitch_m], allowed)?;
        match element_m {
            Some(element) => bounds.number(pitch_key, pitch_m, [element, most], format!("at least {element}")),
            None => Ok(()),
        }
    }
}

fn check_rows(rows: &[Row], bounds: &mut Bounds, key: &str) -> Result<()> {
    const MOST: usize = 1000;
    if !(2..=MOST).contains(&rows.len()) {
        return Err(Error::invalid(key, format!("a list of {}", rows.len()), format!("2 to {MOST} rows")));
    }
    let angle = |index: usize| format!("{key}[{index}].angle_deg");
    for (index, row) in rows.iter().enumerate() {
        bounds.within(angle(index), row.angle_deg, -90.0, 90.0)?;
        bounds.within(format!("{key}[{index}].db"), row.db, NOTHING_DB, 0.0)?;
    }
    for (index, pair) in rows.windows(2).enumerate() {
        bounds.rising((angle(index), pair[0].angle_deg), (angle(index + 1), pair[1].angle_deg))?;
    }
    let highest = rows.iter().map(|row| row.db).fold(NOTHING_DB, f64::max);
    if highest < 0.0 {
        return Err(Error::invalid(key, format!("a list of at most {highest} dB"), "levels whose highest is 0 dB"));
    }
    Ok(())
}

/// Width of the rectangle of height 1 with the same integral: the integral over the angle off the axis, rad, from -pi/2
/// to pi/2, of `power`, a power pattern (1 on its axis).
///
/// Anything narrower than 1e-4 rad (0.006 deg) is certain to be seen only where `power` is sampled at a multiple of
/// that.
pub fn equivalent_width(power: impl Fn(f64) -> f64) -> f64 {
    /// A power of 2, so that the axis is among the samples.
    const PANELS: usize = 8192;
    integral::integral(&power, [-FRAC_PI_2, FRAC_PI_2], PANELS, 1e-10)
}

impl<'de> Deserialize<'de> for Lobe {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrShape;

        impl<'de> Visitor<'de> for NumberOrShape {
            type Value = Lobe;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number (full width at -3 dB, degrees) or a section with a shape")
            }
            fn visit_i64<E>(self, value: i64) -> Result<Lobe, E> {
                Ok(Lobe::Width(value as f64))
            }
            fn visit_u64<E>(self, value: u64) -> Result<Lobe, E> {
                Ok(Lobe::Width(value as f64))
            }
            fn visit_f64<E>(self, value: f64) -> Result<Lobe, E> {
                Ok(Lobe::Width(value))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Lobe, A::Error> {
                Shape::deserialize(de::value::MapAccessDeserializer::new(map)).map(Lobe::Shape)
            }
        }
        deserializer.deserialize_any(NumberOrShape)
    }
}

impl<'de> Deserialize<'de> for Shape {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct LineKeys {
            width_deg: Option<f64>,
            length_m: Option<f64>,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct PistonKeys {
            width_deg: Option<f64>,
            diameter_m: Option<f64>,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct WidthKeys {
            width_deg: f64,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct RowKeys {
            rows: Vec<Row>,
        }
        const SHAPES: &[&str] = &["line", "gaussian", "box", "piston", "array", "table"];
        let (word, section) = yaml::split_tag(deserializer, "shape")?;
        Ok(match word.as_str() {
            "line" => {
                let LineKeys { width_deg, length_m } = section.read()?;
                Shape::Line(match one_of(width_deg, ("length_m", length_m))? {
                    Ok(deg) => Line::Width(deg),
                    Err(m) => Line::Length(m),
                })
            }
            "gaussian" => Shape::Gaussian { width_deg: section.read::<WidthKeys, _>()?.width_deg },
            "box" => Shape::Box { width_deg: section.read::<WidthKeys, _>()?.width_deg },
            "piston" => {
                let PistonKeys { width_deg, diameter_m } = section.read()?;
                Shape::Piston(match one_of(width_deg, ("diameter_m", diameter_m))? {
                    Ok(deg) => Piston::Width(deg),
                    Err(m) => Piston::Diameter(m),
                })
            }
            "array" => Shape::Array(section.read()?),
            "table" => Shape::Table { rows: section.read::<RowKeys, _>()?.rows },
            _ => return Err(section.unknown(&word, SHAPES)),
        })
    }
}

/// The width (`Ok`) or the size (`Err`); a section must have exactly one.
fn one_of<E: de::Error>(width_deg: Option<f64>, (name, size): (&str, Option<f64>)) -> Result<Result<f64, f64>, E> {
    match (width_deg, size) {
        (Some(deg), None) => Ok(Ok(deg)),
        (None, Some(m)) => Ok(Err(m)),
        (Some(_), Some(m)) => Err(E::custom(format!("{name}: is {m}; allowed: none together with width_deg"))),
        (None, None) => Err(E::custom(format!("is without width_deg and {name}; allowed: one of them"))),
    }
}

impl<'de> Deserialize<'de> for Array {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Word {
            Uniform,
            Hamming,
            Chebyshev,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct ArrayKeys {
            elements: u32,
            pitch_m: f64,
            shading: Option<Word>,
            sidelobe_db: Option<f64>,
            element_m: Option<f64>,
        }
        let ArrayKeys { elements, pitch_m, shading, sidelobe_db, element_m } = ArrayKeys::deserialize(deserializer)?;
        let shading = match (shading.unwrap_or(Word::Uniform), sidelobe_db) {
            (Word::Chebyshev, Some(sidelobe_db)) => Shading::Chebyshev { sidelobe_db },
            (Word::Chebyshev, None) => return Err(de::Error::missing_field("sidelobe_db")),
            (_, Some(db)) => {
                let message = format!("sidelobe_db: is {db}; allowed: with shading: chebyshev only");
                return Err(de::Error::custom(message));
            }
            (Word::Uniform, None) => Shading::Uniform,
            (Word::Hamming, None) => Shading::Hamming,
        };
        Ok(Array { elements, pitch_m, shading, element_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_are_written_back_as_they_are_read() {
        let sections = [
            "1.5",
            r#"{"shape":"line","width_deg":1.5}"#,
            r#"{"shape":"line","length_m":0.6}"#,
            r#"{"shape":"gaussian","width_deg":10.0}"#,
            r#"{"shape":"box","width_deg":180.0}"#,
            r#"{"shape":"piston","width_deg":7.0}"#,
            r#"{"shape":"piston","diameter_m":0.06}"#,
            r#"{"shape":"array","elements":64,"pitch_m":0.001,"shading":"uniform"}"#,
            r#"{"shape":"array","elements":64,"pitch_m":0.001,"shading":"hamming","element_m":0.0009}"#,
            r#"{"shape":"array","elements":64,"pitch_m":0.001,"shading":"chebyshev","sidelobe_db":30.0}"#,
            r#"{"shape":"table","rows":[{"angle_deg":0.0,"db":0.0},{"angle_deg":5.0,"db":-20.0}]}"#,
        ];
        for text in sections {
            let lobe = Lobe::from_yaml(text).unwrap();
            assert_eq!(serde_json::to_string(&lobe).unwrap(), text);
        }
        let uniform = Lobe::from_yaml("{shape: array, elements: 8, pitch_m: 0.01}").unwrap();
        assert!(matches!(uniform, Lobe::Shape(Shape::Array(Array { shading: Shading::Uniform, element_m: None, .. }))));
        assert_eq!(Lobe::from_yaml("3").unwrap(), Lobe::Width(3.0));
    }

    #[test]
    fn errors_name_their_key() {
        let table = |rows: &str| format!("{{shape: table, rows: [{rows}]}}");
        for (text, expected) in [
            ("0".to_owned(), "line 1: is 0; allowed: 0.001 to 180"),
            (
                "wide".into(),
                "line 1: invalid type: string \"wide\", expected a number (full width at -3 dB, degrees) or a section with a shape",
            ),
            ("{width_deg: 3}".into(), "line 1: the key `shape` is missing"),
            (
                "{shape: cone}".into(),
                "line 1: shape: unknown value \"cone\"; allowed: line, gaussian, box, piston, array, table",
            ),
            ("{shape: line}".into(), "line 1: is without width_deg and length_m; allowed: one of them"),
            (
                "{shape: line, width_deg: 1, length_m: 2}".into(),
                "line 1: length_m: is 2; allowed: none together with width_deg",
            ),
            ("{shape: piston}".into(), "line 1: is without width_deg and diameter_m; allowed: one of them"),
            ("{shape: piston, diameter_m: 0}".into(), "line 1: diameter_m: is 0; allowed: 0.000001 to 1000"),
            ("{shape: box, width_deg: 181}".into(), "line 1: width_deg: is 181; allowed: 0.001 to 180"),
            (
                "{shape: box, width: 1}".into(),
                "line 1: width: unknown key \"width\"; near: width_deg; allowed: width_deg",
            ),
            ("{shape: array, elements: 1, pitch_m: 1}".into(), "line 1: elements: is 1; allowed: 2 to 4096"),
            (
                "{shape: array, elements: 2, pitch_m: 1, element_m: 2}".into(),
                "line 1: element_m: is 2; allowed: 0.000001 to the pitch_m (1)",
            ),
            (
                "{shape: array, elements: 2, pitch_m: 1, sidelobe_db: 30}".into(),
                "line 1: sidelobe_db: is 30; allowed: with shading: chebyshev only",
            ),
            (
                "{shape: array, elements: 2, pitch_m: 1, shading: chebyshev}".into(),
                "line 1: the key `sidelobe_db` is missing",
            ),
            (
                "{shape: array, elements: 2, pitch_m: 1, shading: chebyshev, sidelobe_db: -30}".into(),
                "line 1: sidelobe_db: is -30; allowed: 10 to 150",
            ),
            (table("{angle_deg: 0, db: 0}"), "line 1: rows: is a list of 1; allowed: 2 to 1000 rows"),
            (
                table("{angle_deg: 5, db: 0}, {angle_deg: 5, db: -1}"),
                "line 1: rows[1].angle_deg: is 5; allowed: above rows[0].angle_deg (5)",
            ),
            (table("{angle_deg: 0, db: 0}, {angle_deg: 5, db: 1}"), "line 1: rows[1].db: is 1; allowed: -200 to 0"),
            (
                table("{angle_deg: 0, db: -3}, {angle_deg: 5, db: -6}"),
                "line 1: rows: is a list of at most -3 dB; allowed: levels whose highest is 0 dB",
            ),
        ] {
            let error = Lobe::from_yaml(&text).unwrap_err().to_string();
            assert_eq!(error, format!("YAML text: {expected}"), "{text}");
        }
    }

    #[test]
    fn bounds_of_keys_are_reported() {
        let bounds = |text: &str, key: &str| {
            let mut bounds = Bounds::of(key);
            Lobe::from_yaml(text).unwrap().check(&mut bounds, "send.along").unwrap();
            (bounds.min, bounds.max)
        };
        let array = "{shape: array, elements: 8, pitch_m: 0.01, element_m: 0.004}";
        assert_eq!(bounds("3", "send.along"), (0.001, 180.0));
        assert_eq!(bounds("{shape: box, width_deg: 3}", "send.along.width_deg"), (0.001, 180.0));
        assert_eq!(bounds(array, "send.along.pitch_m"), (0.004, 1000.0));
        assert_eq!(bounds(array, "send.along.element_m"), (1e-6, 0.01));
        let table = "{shape: table, rows: [{angle_deg: -5, db: -9}, {angle_deg: 1, db: 0}, {angle_deg: 8, db: -9}]}";
        assert_eq!(bounds(table, "send.along.rows[1].angle_deg"), ((-5f64).next_up(), 8f64.next_down()));
    }

    /// Values that no check has seen: no panic, no hang.
    #[test]
    fn any_lobe_has_a_pattern() {
        let array = |elements, pitch_m, sidelobe_db| {
            let shading = Shading::Chebyshev { sidelobe_db };
            Lobe::Shape(Shape::Array(Array { elements, pitch_m, shading, element_m: Some(f64::NAN) }))
        };
        for lobe in [
            Lobe::Width(0.0),
            Lobe::Width(f64::NAN),
            Lobe::Shape(Shape::Line(Line::Length(-1.0))),
            Lobe::Shape(Shape::Piston(Piston::Diameter(f64::INFINITY))),
            Lobe::Shape(Shape::Table { rows: vec![] }),
            Lobe::Shape(Shape::Gaussian { width_deg: 0.0 }),
            array(0, 0.0, f64::NAN),
            array(1, f64::NAN, -30.0),
        ] {
            for wavelength in [1.0, 0.0, f64::NAN] {
                let pattern = lobe.at(wavelength);
                pattern.amplitude(0.1);
                pattern.width();
                pattern.extent(1e-3);
                pattern.extent_within(f64::NAN, 2.0);
            }
        }
    }
}
