//! Arrays of rows.

use crate::error::{Failure, Outcome};
use numpy::{Element, PyReadonlyArray2};

/// The rows of `array`, which the argument `name` is: `N` numbers each.
pub fn rows<T: Element + Copy, const N: usize>(name: &str, array: &PyReadonlyArray2<'_, T>) -> Outcome<Vec<[T; N]>> {
    let array = array.as_array();
    if array.ncols() != N {
        return Err(Failure::argument(name, format!("n x {}", array.ncols()), format!("n x {N}")));
    }
    Ok(array.rows().into_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}
