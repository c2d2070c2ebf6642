//! What the numbers of a file become in a cloud.

use crate::{Field, FieldSet};

/// Farthest position, metres: as in scenes.
pub(super) const FARTHEST: f64 = 1e18;

/// The target of a number of a file: the number times `factor` plus `shift` is a value of the column, or a coordinate
/// of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FieldTarget {
    pub field: Field,
    pub factor: f64,
    pub shift: f64,
}

impl FieldTarget {
    pub(super) fn scaled(field: Field, factor: f64) -> FieldTarget {
        FieldTarget { factor, ..field.into() }
    }
}

impl From<Field> for FieldTarget {
    fn from(field: Field) -> FieldTarget {
        // Adding -0 changes no number, not even -0.
        FieldTarget { field, factor: 1.0, shift: -0.0 }
    }
}

/// The axis along which `field` is a position, if it is one.
pub(super) fn axis(field: Field) -> Option<usize> {
    match field {
        Field::X | Field::TrueX | Field::CorrectedX => Some(0),
        Field::Y | Field::TrueY | Field::CorrectedY => Some(1),
        Field::Z | Field::TrueZ | Field::CorrectedZ => Some(2),
        _ => None,
    }
}

/// Columns that `goals` fill.
pub(super) fn fields(goals: &[Option<FieldTarget>]) -> FieldSet {
    goals.iter().flatten().map(|goal| goal.field).collect()
}
