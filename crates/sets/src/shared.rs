//! Memory that the threads of a set share.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// The contents of `mutex`, even if another sample panicked while holding it: they are consistent at all times.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
