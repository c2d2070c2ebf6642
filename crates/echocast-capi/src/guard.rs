//! Errors, panics and the floating-point state at the boundary.

use echocast::{Error, shown};
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

/// The result of a call. The numbers never change and are never reused; more may be added.
pub type echocast_status = i32;

/// Done.
pub const ECHOCAST_OK: i32 = 0;
/// An argument is not allowed.
pub const ECHOCAST_E_ARGUMENT: i32 = 1;
/// The object can no longer be used: a call on it failed halfway because of a defect of the library.
pub const ECHOCAST_E_STATE: i32 = 2;
/// A handle or the number of an instance is invalid: released, of another kind or of another context.
pub const ECHOCAST_E_HANDLE: i32 = 3;
/// Out of memory, or of threads.
pub const ECHOCAST_E_MEMORY: i32 = 4;
/// A file could not be read or written: it is missing, not permitted, the disk is full.
pub const ECHOCAST_E_IO: i32 = 5;
/// A file or text does not have the expected contents.
pub const ECHOCAST_E_PARSE: i32 = 6;
/// This build cannot do it.
pub const ECHOCAST_E_UNSUPPORTED: i32 = 7;
/// The progress callback ended the scan.
pub const ECHOCAST_E_CANCELLED: i32 = 8;
/// The object is in use: by another thread, or by the call whose callback this call comes from. 9 is reserved.
pub const ECHOCAST_E_BUSY: i32 = 10;
/// A structure from a header newer than this library has something set that the library does not know.
pub const ECHOCAST_E_VERSION: i32 = 11;
/// A defect of the library; please report the text.
pub const ECHOCAST_E_INTERNAL: i32 = 99;

/// A status with its text.
#[derive(Debug)]
pub(crate) struct Failure {
    pub status: echocast_status,
    pub text: String,
}

pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    pub fn new(status: echocast_status, text: impl Into<String>) -> Failure {
        Failure { status, text: text.into() }
    }

    /// An argument that is not allowed.
    pub fn argument(name: &str, value: impl std::fmt::Display, allowed: &str) -> Failure {
        let value = value.to_string();
        Failure::new(ECHOCAST_E_ARGUMENT, format!("{name} is {}; allowed: {allowed}", shown::short_numbers(&value)))
    }

    /// The same for element `number` of the argument called `name`.
    pub fn at(self, name: &str, number: usize) -> Failure {
        Failure { text: self.text.replacen(name, &format!("[{number}]"), 1), ..self }
    }

    /// A wrong argument, which is called `name` in C.
    pub fn argument_of(error: Error, name: &str) -> Failure {
        match error {
            Error::InvalidParameter { value, allowed, .. } => Failure::argument(name, value, &allowed),
            other => other.into(),
        }
    }

    pub fn null(name: &str) -> Failure {
        Failure::argument(name, "NULL", "a pointer")
    }
}

/// The element with this number, the argument called `name`.
pub(crate) fn numbered<'a, T>(all: &'a [T], number: usize, name: &str) -> Outcome<&'a T> {
    all.get(number).ok_or_else(|| Failure::argument(name, number, &format!("less than the {} there are", all.len())))
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        let status = match &error {
            Error::Io { .. } => ECHOCAST_E_IO,
            Error::Parse { .. } => ECHOCAST_E_PARSE,
            Error::InvalidParameter { .. } | Error::Missing { .. } => ECHOCAST_E_ARGUMENT,
            // Embree: an old library or processor; out of memory is `Error::Memory`.
            Error::Unsupported { .. } | Error::Embree(_) => ECHOCAST_E_UNSUPPORTED,
            Error::Cancelled => ECHOCAST_E_CANCELLED,
            Error::Memory(_) | Error::Threads { .. } => ECHOCAST_E_MEMORY,
            _ => ECHOCAST_E_INTERNAL,
        };
        Failure::new(status, error.to_string())
    }
}

thread_local! {
    /// Text of this thread's last failure, ending in 0; empty if none.
    static LAST: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    /// Where and why this thread panicked.
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
    /// Whether this thread is in a call.
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// Runs the body of an exported function: catches panics, keeps the text of a failure and returns its number.
pub(crate) fn guard(body: impl FnOnce() -> Outcome) -> echocast_status {
    silence_panics();
    let _state = FloatState::of_rust();
    let outside = !INSIDE.replace(true);
    // What a panic may leave half done is behind locks, which it poisons.
    let outcome = catch_unwind(AssertUnwindSafe(body));
    // A callback may call the library in turn.
    if outside {
        INSIDE.set(false);
    }
    match outcome {
        Ok(Ok(())) => ECHOCAST_OK,
        Ok(Err(failure)) => {
            keep(&failure.text);
            failure.status
        }
        Err(panic) => {
            let here = PANIC.try_with(|text| std::mem::take(&mut *text.borrow_mut())).unwrap_or_default();
            // The panic may come from a thread that worked for this one.
            let why = if here.is_empty() { panic_message(&*panic) } else { &here };
            keep(&format!("internal error (please report): {why}"));
            ECHOCAST_E_INTERNAL
        }
    }
}

/// The message of a panic.
fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic")
}

/// [`guard`] for functions that cannot fail: a panic is kept as text, and `otherwise` is returned.
pub(crate) fn guard_or<T>(otherwise: T, body: impl FnOnce() -> Outcome<T>) -> T {
    let mut result = None;
    guard(|| {
        result = Some(body()?);
        Ok(())
    });
    result.unwrap_or(otherwise)
}

/// Appends `text` and a 0; a 0 within becomes a question mark.
pub(crate) fn push_lossy(to: &mut Vec<u8>, text: &str) {
    to.extend(text.bytes().map(|byte| if byte == 0 { b'?' } else { byte }));
    to.push(0);
}

/// Rust's own hook prints to stderr, which is the host's: it is kept for threads that are not in a call of this
/// library. There are none in a shared library, which has its own hook.
fn silence_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let others = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if INSIDE.get() {
                let _ = PANIC.try_with(|text| *text.borrow_mut() = info.to_string());
            } else if !std::thread::current().name().is_some_and(|name| name.starts_with("echocast ")) {
                others(info);
            }
        }));
    });
}

fn keep(text: &str) {
    // A thread that is ending has already destroyed it.
    let _ = LAST.try_with(|last| {
        let last = &mut *last.borrow_mut();
        last.clear();
        push_lossy(last, &shown::message(text));
    });
}

/// Why this thread's last failed call failed: one sentence that names the argument, what it was and what is allowed. ""
/// if none failed.
///
/// Valid until the next call on this thread that fails, or its end. Never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn echocast_last_error() -> *const c_char {
    let text = LAST.try_with(|last| {
        let last = last.borrow();
        if last.is_empty() { c"".as_ptr() } else { last.as_ptr().cast() }
    });
    text.unwrap_or(c"".as_ptr())
}

/// What a status means, in a few words.
///
/// Static, never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn echocast_status_string(status: echocast_status) -> *const c_char {
    let text: &CStr = match status {
        ECHOCAST_OK => c"ok",
        ECHOCAST_E_ARGUMENT => c"an argument is not allowed",
        ECHOCAST_E_STATE => c"the object cannot be used any more",
        ECHOCAST_E_HANDLE => c"the handle is invalid",
        ECHOCAST_E_MEMORY => c"no memory or threads",
        ECHOCAST_E_IO => c"a file cannot be read or written",
        ECHOCAST_E_PARSE => c"a file or text does not have the expected contents",
        ECHOCAST_E_UNSUPPORTED => c"not supported by this build",
        ECHOCAST_E_CANCELLED => c"cancelled by the progress callback",
        ECHOCAST_E_BUSY => c"the object is in use",
        ECHOCAST_E_VERSION => c"a structure of a newer header",
        ECHOCAST_E_INTERNAL => c"a defect of the library",
        _ => c"unknown status",
    };
    text.as_ptr()
}

/// The floating-point state that Rust and Embree rely on (round to nearest, no traps, denormals kept), for as long as
/// this lives; then the caller's is restored.
struct FloatState {
    callers: u64,
}

impl FloatState {
    fn of_rust() -> FloatState {
        let callers = arch::get();
        if callers != arch::DEFAULT {
            arch::set(arch::DEFAULT);
        }
        FloatState { callers }
    }
}

impl Drop for FloatState {
    fn drop(&mut self) {
        if arch::get() != self.callers {
            arch::set(self.callers);
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod arch {
    use std::arch::asm;

    /// All exceptions masked, no flag raised, round to nearest (Intel SDM volume 1, 10.2.3).
    pub const DEFAULT: u64 = 0x1f80;

    pub fn get() -> u64 {
        let mut state = 0u32;
        // SAFETY: stores 4 bytes at the address given.
        unsafe { asm!("stmxcsr [{}]", in(reg) &mut state, options(nostack, preserves_flags)) };
        u64::from(state)
    }

    pub fn set(state: u64) {
        let state = state as u32;
        // SAFETY: loads 4 bytes that were stored by stmxcsr, or the default, so no reserved bit is set.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &state, options(nostack, preserves_flags)) };
    }
}

#[cfg(target_arch = "aarch64")]
mod arch {
    use std::arch::asm;

    /// Round to nearest, no traps, denormals kept (Arm ARM, FPCR).
    pub const DEFAULT: u64 = 0;

    pub fn get() -> u64 {
        let state: u64;
        // SAFETY: reads a register that user code may read.
        unsafe { asm!("mrs {}, fpcr", out(reg) state, options(nomem, nostack, preserves_flags)) };
        state
    }

    pub fn set(state: u64) {
        // SAFETY: writes a register that user code may write, with what was read from it, or 0.
        unsafe { asm!("msr fpcr, {}", in(reg) state, options(nomem, nostack, preserves_flags)) };
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod arch {
    pub const DEFAULT: u64 = 0;

    pub fn get() -> u64 {
        0
    }

    pub fn set(_: u64) {}
}
