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

/// The column that has this very name, `scalar_` before it or not.
pub(super) fn own(column: &Named) -> Option<Goal> {
    let name = column.name.strip_prefix("scalar_").unwrap_or(&column.name);
    Field::from_name(name).ok().map(|field| to(field, column.number))
}

/// The column that has this name, but for case, blanks and `_`, or another name for it.
pub(super) fn foreign(column: &Named) -> Option<Goal> {
    let plain = |name: &str| name.to_lowercase().replace(['_', ' '], "");
    let name = plain(&column.name);
    let name = name.strip_prefix("scalar").unwrap_or(&name);
    let known = crate::cloud::FIELDS.iter().find(|info| plain(info.name) == name).map(|info| info.field);
    let other = || FOREIGN.iter().find(|(other, _)| *other == name).map(|(_, field)| *field);
    known.or_else(other).map(|field| to(field, column.number))
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
            ("nx", Field::NormalX),
            ("ring", Field::Ring),
            ("line", Field::Ring),
            ("laser_id", Field::Channel),
            ("GpsTime", Field::Time),
        ] {
            assert_eq!(found(name), Some(field), "{name}");
        }
        assert_eq!(found("temperature"), None);
        assert_eq!(foreign(&Named::new("t", Number::U32)).unwrap().factor, 1e-9);
    }
}
