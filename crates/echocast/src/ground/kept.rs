//! Results that are kept for whoever asks for the same again.

use std::sync::{Arc, Mutex, PoisonError};

/// Most results kept at once, of which the oldest go first: a scan whose wavelength or weather keeps changing must not fill
/// the memory.
const MOST: usize = 16;

/// The one of `all` that fits, or a new one that is kept.
pub(crate) fn kept<T>(all: &Mutex<Vec<Arc<T>>>, fits: impl Fn(&T) -> bool, make: impl FnOnce() -> T) -> Arc<T> {
    let mut known = all.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known.iter().find(|it| fits(it)) {
        return found.clone();
    }
    let made = Arc::new(make());
    if known.len() == MOST {
        known.remove(0);
    }
    known.push(made.clone());
    made
}
