//! What a program does where the system gives no memory. Without this, Rust aborts and prints the stack.
//!
//! A program makes [`Allocator`] its global allocator and says with [`end_with`] how it ends; the library marks with
//! [`tried`] where it copes itself. A host that the library is loaded into does neither, and notices nothing.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::OnceLock;

/// The system's allocator, which ends the process where it has no memory, if somebody has said how.
pub struct Allocator;

/// Ends the process.
static END: OnceLock<fn(usize) -> !> = OnceLock::new();

thread_local! {
    /// Whether this thread copes without the memory that it asks for.
    static TRIED: Cell<bool> = const { Cell::new(false) };
}

/// From now on `end` is called with the number of bytes that there is no memory for. Many threads may call it, and one
/// again from inside of it; whatever it does, it does best without memory.
pub fn end_with(end: fn(usize) -> !) {
    // The first one stays: a process has one program.
    let _ = END.set(end);
}

/// Does `work`, which copes with memory that it does not get.
pub fn tried<R>(work: impl FnOnce() -> R) -> R {
    /// Says again what was said before, also where `work` panics.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            TRIED.set(self.0);
        }
    }
    let _before = Before(TRIED.replace(true));
    work()
}

/// Passes on what was got for `bytes`.
#[inline]
fn got(place: *mut u8, bytes: usize) -> *mut u8 {
    if place.is_null() {
        missing(bytes);
    }
    place
}

#[cold]
fn missing(bytes: usize) {
    // A thread at its end, too, copes with nothing.
    let is_tried = TRIED.try_with(Cell::get).unwrap_or(false);
    if let Some(end) = END.get().filter(|_| !is_tried) {
        end(bytes);
    }
}

// SAFETY: it is the system's allocator; `got` passes on what that returns, or does not return.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        got(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise.
        got(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        // SAFETY: the caller's promise.
        got(unsafe { System.realloc(place, layout, bytes) }, bytes)
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(place, layout) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::catch_unwind;

    #[test]
    fn what_panics_copes_no_longer() {
        let is_tried = || TRIED.get();
        assert!(catch_unwind(|| tried(|| panic!("{}", is_tried()))).is_err());
        assert!(!is_tried());
        assert!(tried(|| catch_unwind(|| tried(|| panic!("again"))).is_err() && is_tried()));
        assert!(!is_tried());
    }
}
