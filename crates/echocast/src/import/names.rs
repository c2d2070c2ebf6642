//! What other programs call the columns of a cloud.

use super::rows::Goal;
use crate::cloud::Field;
use crate::read::number::Number;

/// A column of a file.
pub(super) struct Named {
    pub name: String,
    /// Type of its numbers.
    pub number: Number,
}

impl Named {
    pub(super) fn new(name: &str, number: Number) -> Named {
        Named { name: name.to_owned(), number }
    }
}

/// Names without blanks, `_` and case, with the column that they mean.
const FOREIGN: &[(&str, Field)] = &[
    ("easting", Field::X),
    ("northing", Field::Y),
    ("height", Field::Z),
    ("points:0", Field::X),
    ("points:1", Field::Y),
    ("points:2", Field::Z),
    ("nx", Field::NormalX),
    ("ny", Field::NormalY),
    ("nz", Field::NormalZ),
    ("r", Field::Red),
    ("g", Field::Green),
    ("b", Field::Blue),
    ("diffusered", Field::Red),
    ("diffusegreen", Field::Green),
    ("diffuseblue", Field::Blue),
    ("i", Field::Intensity),
    ("reflectance", Field::Intensity),
    ("reflectivity", Field::Intensity),
    ("label", Field::CategoryId),
    ("class", Field::CategoryId),
    ("classification", Field::CategoryId),
    ("category", Field::CategoryId),
    ("semantic", Field::CategoryId),
    ("semclass", Field::CategoryId),
    ("instance", Field::InstanceId),
    ("instancelabel", Field::InstanceId),
    ("object", Field::InstanceId),
    ("objectid", Field::InstanceId),
    ("laserid", Field::Channel),
    ("line", Field::Ring),
    ("t", Field::Time),
    ("timestamp", Field::Time),
    ("offsettime", Field::Time),
    ("gpstime", Field::Time),
    ("distance", Field::Range),
    ("return", Field::ReturnNumber),
    ("returns", Field::ReturnCount),
    ("numberofreturns", Field::ReturnCount),
    ("numreturns", Field::ReturnCount),
];

/// Colours from 0 to 1, as CloudCompare calls them.
const PARTS: &[(&str, Field)] = &[("rf", Field::Red), ("gf", Field::Green), ("bf", Field::Blue)];

/// Units that names end in, in brackets, with what makes the unit of the column of them, and that.
const UNITS: &[(&str, f64, &str)] = &[
    ("m", 1.0, "m"),
    ("mm", 1e-3, "m"),
    ("cm", 1e-2, "m"),
    ("km", 1e3, "m"),
    ("ft", 0.3048, "m"),
    ("s", 1.0, "s"),
    ("ms", 1e-3, "s"),
    ("us", 1e-6, "s"),
    ("ns", 1e-9, "s"),
    ("rad", 1.0, "rad"),
    ("deg", std::f64::consts::PI / 180.0, "rad"),
];

/// The column that has this very name, `scalar_` before it or not.
pub(super) fn own(column: &Named) -> Option<Goal> {
    let name = column.name.strip_prefix("scalar_").unwrap_or(&column.name);
    Field::from_name(name).ok().map(|field| to(field, column.number))
}

/// The column that has this name, but for case, blanks, `_` and a unit in brackets, or another name for it.
pub(super) fn foreign(column: &Named) -> Option<Goal> {
    let named = |name: &str| {
        let plain = |name: &str| name.to_lowercase().replace(['_', ' '], "");
        let name = plain(name);
        let name = name.strip_prefix("scalar").unwrap_or(&name);
        let known = crate::cloud::FIELDS.iter().find(|info| plain(info.name) == name).map(|info| info.field);
        let other = |names: &[(&str, Field)]| names.iter().find(|(other, _)| *other == name).map(|(_, field)| *field);
        let part = || other(PARTS).map(|field| to(field, Number::F32));
        known.or_else(|| other(FOREIGN)).map(|field| to(field, column.number)).or_else(part)
    };
    named(&column.name).or_else(|| {
        let (name, unit) = column.name.trim_end().strip_suffix([')', ']'])?.rsplit_once(['(', '['])?;
        let (_, factor, of) = UNITS.iter().find(|(known, ..)| unit.trim().eq_ignore_ascii_case(known))?;
        let goal = named(name).filter(|goal| goal.field.info().unit == *of)?;
        Some(Goal::scaled(goal.field, *factor))
    })
}

/// Numbers of the type `number` in the column `field`.
fn to(field: Field, number: Number) -> Goal {
    let factor = match (field, number) {
        (Field::Red | Field::Green | Field::Blue, Number::U16) => 1.0 / 257.0,
        (Field::Red | Field::Green | Field::Blue, Number::F32 | Number::F64) => 255.0,
        // Drivers of LiDARs count nanoseconds.
        (Field::Time, Number::U32 | Number::I32 | Number::U64 | Number::I64) => 1e-9,
        _ => 1.0,
    };
    Goal::scaled(field, factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_are_known() {
        let found = |name| {
            let column = Named::new(name, Number::F32);
            own(&column).or_else(|| foreign(&column)).map(|goal| goal.field)
        };
        for (name, field) in [
            ("x", Field::X),
            ("scalar_category_id", Field::CategoryId),
            ("scalar_Intensity", Field::Intensity),
            ("Scalar_Return_Number", Field::ReturnNumber),
            ("Number Of Returns", Field::ReturnCount),
            ("easting", Field::X),
            ("northing", Field::Y),
            ("height", Field::Z),
            ("points:0", Field::X),
            ("points:1", Field::Y),
            ("points:2", Field::Z),
            ("nx", Field::NormalX),
            ("ring", Field::Ring),
            ("line", Field::Ring),
            ("laser_id", Field::Channel),
            ("GpsTime", Field::Time),
            ("X(m)", Field::X),
            ("Range [m]", Field::Range),
            ("Easting", Field::X),
            ("Gf", Field::Green),
        ] {
            assert_eq!(found(name), Some(field), "{name}");
        }
        assert_eq!(found("temperature"), None);
        let factor = |name, number| foreign(&Named::new(name, number)).map(|goal| goal.factor);
        assert_eq!(factor("t", Number::U32), Some(1e-9));
        assert_eq!(factor("Z (mm)", Number::F32), Some(1e-3));
        assert_eq!(factor("Rf", Number::U8), Some(255.0));
        // An angle is no range, and PCV (CloudCompare's sky visibility) has no column.
        assert_eq!((factor("range (deg)", Number::F32), factor("Illuminance (PCV)", Number::F32)), (None, None));
    }
}
