//! Results kept for repeated requests.

use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

/// Most results kept at once, the oldest dropped first: a scan whose wavelength or weather keeps changing must not fill
/// the memory.
const MOST: usize = 16;

/// The result in `all` that `fits`, or a new one, which is kept.
pub fn kept<T>(all: &Mutex<Vec<Arc<T>>>, fits: impl Fn(&T) -> bool, make: impl FnOnce() -> T) -> Arc<T> {
    match try_kept(all, fits, || Ok::<T, Infallible>(make())) {
        Ok(found) => found,
        Err(never) => match never {},
    }
}

/// [`kept`] where making one may fail.
pub fn try_kept<T, E>(
    all: &Mutex<Vec<Arc<T>>>,
    fits: impl Fn(&T) -> bool,
    make: impl FnOnce() -> Result<T, E>,
) -> Result<Arc<T>, E> {
    let mut known = all.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known.iter().find(|it| fits(it)) {
        return Ok(found.clone());
    }
    let made = Arc::new(make()?);
    if known.len() == MOST {
        known.remove(0);
    }
    known.push(made.clone());
    Ok(made)
}
