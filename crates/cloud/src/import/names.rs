//! Names of columns in files, and the columns of a cloud that they stand for.

use super::target::FieldTarget;
use crate::{Field, FieldSet};
use ground::read::number::Number;
use ground::report::Report;
use ground::shown;

/// A column of a file.
pub(super) struct NamedColumn {
    pub name: String,
    /// Type of its numbers.
    pub number: Number,
}

impl NamedColumn {
    pub(super) fn new(name: &str, number: Number) -> NamedColumn {
        NamedColumn { name: name.to_owned(), number }
    }
}

/// Names without blanks, `_` and case, with the column that they stand for.
const FOREIGN: &[(&str, Field)] = &[
    ("pointx", Field::X),
    ("pointy", Field::Y),
    ("pointz", Field::Z),
    ("points0", Field::X),
    ("points1", Field::Y),
    ("points2", Field::Z),
    ("xcoord", Field::X),
    ("ycoord", Field::Y),
    ("zcoord", Field::Z),
    ("xcoordinate", Field::X),
    ("ycoordinate", Field::Y),
    ("zcoordinate", Field::Z),
    ("coordx", Field::X),
    ("coordy", Field::Y),
    ("coordz", Field::Z),
    ("positionx", Field::X),
    ("positiony", Field::Y),
    ("positionz", Field::Z),
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

/// Colours from 0 to 1, as named by CloudCompare.
const PARTS: &[(&str, Field)] = &[("rf", Field::Red), ("gf", Field::Green), ("bf", Field::Blue)];

/// Units that names end with, or that are on a line of their own, with the factor to the unit of the column, and that
/// unit.
const UNITS: &[(&[&str], f64, &str)] = &[
    (&["m", "meter", "meters", "metre", "metres"], 1.0, "m"),
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 1e-3, "m"),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 1e-2, "m"),
    (&["km", "kilometer", "kilometers", "kilometre", "kilometres"], 1e3, "m"),
    (&["ft", "foot", "feet"], 0.3048, "m"),
    (&["s", "sec", "second", "seconds"], 1.0, "s"),
    (&["ms", "millisecond", "milliseconds"], 1e-3, "s"),
    (&["us", "\u{b5}s", "\u{3bc}s", "microsecond", "microseconds"], 1e-6, "s"),
    (&["ns", "nanosecond", "nanoseconds"], 1e-9, "s"),
    (&["rad", "radian", "radians"], 1.0, "rad"),
    (&["deg", "degree", "degrees", "\u{b0}"], std::f64::consts::PI / 180.0, "rad"),
];

/// The factor from the unit `name`, in brackets or not, to the unit of columns, and that unit.
fn unit(name: &str) -> Option<(f64, &'static str)> {
    let name = name.trim().trim_start_matches(['(', '[']).trim_end_matches([')', ']']).trim().to_lowercase();
    UNITS.iter().find(|(names, ..)| names.contains(&&*name)).map(|(_, factor, of)| (*factor, *of))
}

/// Whether `word` is the name of a unit.
pub(super) fn is_unit(word: &str) -> bool {
    unit(word).is_some()
}

/// The name of the column `name` with `unit` added if it can have that unit.
pub(super) fn with_unit(name: &str, unit: &str) -> String {
    let both = format!("{name} ({})", unit.trim_matches(['(', ')', '[', ']', ' ']));
    if foreign(&NamedColumn::new(&both, Number::U8)).is_some() { both } else { name.to_owned() }
}

/// The column of exactly this name, with or without the prefix `scalar_`.
pub(super) fn own(column: &NamedColumn) -> Option<FieldTarget> {
    let name = column.name.strip_prefix("scalar_").unwrap_or(&column.name);
    Field::from_name(name).ok().map(|field| to(field, column.number))
}

/// The column of this name, ignoring case, blanks, `_` and a unit at the end, or of a synonym.
pub(super) fn foreign(column: &NamedColumn) -> Option<FieldTarget> {
    let named = |name: &str| {
        let plain = |name: &str| name.to_lowercase().replace(['_', ' '], "");
        let name = plain(name);
        let name = name.strip_prefix("scalar").unwrap_or(&name);
        let known = crate::FIELDS.iter().find(|info| plain(info.name) == name).map(|info| info.field);
        let other = |names: &[(&str, Field)]| names.iter().find(|(other, _)| *other == name).map(|(_, field)| *field);
        let part = || other(PARTS).map(|field| to(field, Number::F32));
        known.or_else(|| other(FOREIGN)).map(|field| to(field, column.number)).or_else(part)
    };
    named(&column.name).or_else(|| {
        let name = column.name.trim_end();
        let (name, last) = name.strip_suffix([')', ']']).unwrap_or(name).rsplit_once(['(', '[', '_', '/', ' '])?;
        let (factor, of) = unit(last)?;
        let goal = named(name).filter(|goal| goal.field.info().unit == of)?;
        Some(FieldTarget::scaled(goal.field, factor))
    })
}

/// Numbers of the type `number` in the column `field`.
fn to(field: Field, number: Number) -> FieldTarget {
    let factor = match (field, number) {
        (Field::Red | Field::Green | Field::Blue, Number::U16) => 1.0 / 257.0,
        (Field::Red | Field::Green | Field::Blue, Number::F32 | Number::F64) => 255.0,
        // Drivers of LiDARs count nanoseconds.
        (Field::Time, Number::U32 | Number::I32 | Number::U64 | Number::I64) => 1e-9,
        _ => 1.0,
    };
    FieldTarget::scaled(field, factor)
}

/// The target of each named column of a file, if a cloud can hold it. The names of the others are added to `report`.
pub(super) fn goals(columns: &[NamedColumn], name: &str, report: &mut Report) -> Vec<Option<FieldTarget>> {
    let mut goals: Vec<Option<FieldTarget>> = vec![None; columns.len()];
    let mut taken = FieldSet::EMPTY;
    // Our own names take precedence over synonyms.
    for find in [own as fn(&NamedColumn) -> Option<FieldTarget>, foreign] {
        for (goal, column) in goals.iter_mut().zip(columns) {
            if goal.is_none()
                && let Some(found) = find(column)
                && !taken.contains(found.field)
            {
                taken = taken.with(found.field);
                *goal = Some(found);
            }
        }
    }
    let left = columns.iter().zip(&goals).filter(|(column, goal)| goal.is_none() && !matches!(&*column.name, "_" | ""));
    lost(left.map(|(column, _)| column.name.as_str()), name, report);
    goals
}

/// Maximum number of column names that a warning lists.
const LISTED: usize = 12;

/// Reports the columns that a cloud cannot hold.
pub(super) fn lost<'a>(left: impl Iterator<Item = &'a str>, name: &str, report: &mut Report) {
    let left: Vec<&str> = left.collect();
    let more = left.len().saturating_sub(LISTED);
    let listed: Vec<_> = left.iter().take(LISTED).map(|column| shown::name(column)).collect();
    if !listed.is_empty() {
        let more = if more == 0 { String::new() } else { format!(" and {more} more") };
        report.warn(format!("{name}: a cloud cannot hold {}{more}", listed.join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_list_a_dozen_columns() {
        let warned = |count: usize| {
            let names: Vec<String> = (0..count).map(|k| format!("n{k}")).collect();
            let mut report = Report::default();
            lost(names.iter().map(String::as_str), "csv", &mut report);
            report.warnings.concat()
        };
        assert_eq!(warned(0), "");
        assert_eq!(warned(2), "csv: a cloud cannot hold n0, n1");
        assert!(warned(12).ends_with("n10, n11") && warned(20_000).ends_with("n10, n11 and 19988 more"));
    }

    #[test]
    fn names_of_other_programs_are_known() {
        let found = |name| {
            let column = NamedColumn::new(name, Number::F32);
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
            ("X(m)", Field::X),
            ("Y[m]", Field::Y),
            ("Z (meters)", Field::Z),
            ("x_m", Field::X),
            ("POINT_Y", Field::Y),
            ("Points_2", Field::Z),
            ("Range [m]", Field::Range),
            ("Easting", Field::X),
            ("Gf", Field::Green),
        ] {
            assert_eq!(found(name), Some(field), "{name}");
        }
        assert_eq!(found("temperature"), None);
        let factor = |name, number| foreign(&NamedColumn::new(name, number)).map(|goal| goal.factor);
        assert_eq!(factor("t", Number::U32), Some(1e-9));
        assert_eq!(factor("Z (mm)", Number::F32), Some(1e-3));
        assert_eq!(factor("Rf", Number::U8), Some(255.0));
        // An angle is not a range, and PCV (CloudCompare's sky visibility) has no column.
        assert_eq!((factor("range (deg)", Number::F32), factor("Illuminance (PCV)", Number::F32)), (None, None));
    }
}
