//! Whether the program was started with a standard output.
//!
//! Rust opens the null device in the place of one that is closed, before `main`, where all that is written is lost. So
//! this looks before that. A crate of its own, which the library and its C ABI do not have: hosts that load them notice
//! nothing.

use std::sync::atomic::{AtomicBool, Ordering};

static OPEN: AtomicBool = AtomicBool::new(true);

/// Whether standard output was open when the program was started.
pub fn is_open() -> bool {
    OPEN.load(Ordering::Relaxed)
}

#[allow(unsafe_code)] // it asks the system and no one else, for the library of Rust is not ready
#[ctor::ctor(unsafe)]
fn look() {
    let is_open = rustix::io::fcntl_getfd(rustix::stdio::stdout()).is_ok();
    OPEN.store(is_open, Ordering::Relaxed);
}
