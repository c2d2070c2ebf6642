//! Whether the program was started with a standard output.
//!
//! Rust replaces a closed one by the null device before `main`, where everything that is written is lost. So this
//! checks before that. It is a crate of its own, on which the library and its C ABI do not depend: hosts that load them
//! are not affected.

use std::sync::atomic::{AtomicBool, Ordering};

static OPEN: AtomicBool = AtomicBool::new(true);

/// Whether standard output was open when the program was started.
pub fn is_open() -> bool {
    OPEN.load(Ordering::Relaxed)
}

#[allow(unsafe_code)] // it only makes a system call, because the standard library of Rust is not ready
#[ctor::ctor(unsafe)]
fn check() {
    let is_open = rustix::io::fcntl_getfd(rustix::stdio::stdout()).is_ok();
    OPEN.store(is_open, Ordering::Relaxed);
}
