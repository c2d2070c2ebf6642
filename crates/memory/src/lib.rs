//! How a program ends when it runs out of memory. Without this, Rust aborts and prints the stack.
//!
//! A program makes [`Allocator`] its global allocator and sets with [`end_with`] how it ends; the library marks with
//! [`tried`] where it handles failed allocations itself. A host that loads the library does neither, and is not
//! affected.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::OnceLock;

/// The system's allocator, which ends the process when it runs out of memory, if [`end_with`] has set how.
pub struct Allocator;

/// Ends the process.
static END: OnceLock<fn(usize) -> !> = OnceLock::new();

thread_local! {
    /// Whether this thread handles failed allocations itself.
    static TRIED: Cell<bool> = const { Cell::new(false) };
}

/// From now on `end` is called with the number of bytes that could not be allocated. Several threads may call it, and
/// one again from inside of it; it should not allocate.
pub fn end_with(end: fn(usize) -> !) {
    // The first one stays: a process has one program.
    let _ = END.set(end);
}

/// Does `work`, which handles failed allocations itself.
pub fn tried<R>(work: impl FnOnce() -> R) -> R {
    /// Restores the previous state, even if `work` panics.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            TRIED.set(self.0);
        }
    }
    let _before = Before(TRIED.replace(true));
    work()
}

/// Passes on the result of an allocation of `bytes`.
#[inline]
fn got(place: *mut u8, bytes: usize) -> *mut u8 {
    if place.is_null() {
        missing(bytes);
    }
    place
}

#[cold]
fn missing(bytes: usize) {
    // Nor does a thread that is ending handle it.
    let is_tried = TRIED.try_with(Cell::get).unwrap_or(false);
    if let Some(end) = END.get().filter(|_| !is_tried) {
        end(bytes);
    }
}

// SAFETY: it is the system's allocator; `got` passes on what that returns, or does not return.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        got(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises.
        got(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        // SAFETY: as the caller promises.
        got(unsafe { System.realloc(place, layout, bytes) }, bytes)
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(place, layout) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::catch_unwind;

    #[test]
    fn a_panic_restores_the_state() {
        let is_tried = || TRIED.get();
        assert!(catch_unwind(|| tried(|| panic!("{}", is_tried()))).is_err());
        assert!(!is_tried());
        assert!(tried(|| catch_unwind(|| tried(|| panic!("again"))).is_err() && is_tried()));
        assert!(!is_tried());
    }
}
