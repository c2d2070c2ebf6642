//! Contexts: everything else belongs to one.

use crate::guard::{Failure, Outcome, guard};
use crate::handle::{self, handles};
use crate::text;
use echocast::{Engine, Report};
use std::ffi::{CString, c_char, c_void};
use std::fmt::Display;
use std::ptr;
use std::sync::Arc;

/// Threads and Embree's device; everything else belongs to a context. Contexts are independent of each other.
pub struct echocast_context(());

handles! {
    echocast_context: Context, "context", 1;
}

/// No messages. 1 is reserved.
pub const ECHOCAST_LOG_OFF: i32 = 0;
/// Done, but something was left out or looks wrong.
pub const ECHOCAST_LOG_WARN: i32 = 2;
/// What was done.
pub const ECHOCAST_LOG_INFO: i32 = 3;

/// Receives a message of one sentence, valid during the call. It may be called on any thread, on several at once, and
/// must neither throw nor call the library.
pub type echocast_log_fn = Option<unsafe extern "C" fn(user: *mut c_void, level: i32, text: *const c_char)>;

/// Options of a context; ECHOCAST_CONTEXT_DESC_INIT has the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_context_desc {
    /// sizeof(echocast_context_desc).
    pub struct_size: usize,
    /// Threads that scan, up to 1024: the calling thread, which needs 256 KiB of stack, and threads of the context,
    /// which help all callers at once, those with the fewest rays first. 0 for as many as the machine has cores, 1 for
    /// the calling thread only. One fewer, up to one per core, help to build large meshes. All are started with the
    /// context; neither the library nor Embree's TBB starts threads later.
    pub threads: i32,
    /// Least important messages for `log`: an ECHOCAST_LOG_ number.
    pub log_level: i32,
    /// Receives messages; may be NULL.
    pub log: echocast_log_fn,
    /// First argument of `log`.
    pub log_user: *mut c_void,
}

impl Default for echocast_context_desc {
    fn default() -> Self {
        echocast_context_desc {
            struct_size: size_of::<Self>(),
            threads: 0,
            log_level: ECHOCAST_LOG_WARN,
            log: None,
            log_user: ptr::null_mut(),
        }
    }
}

text::versioned!(echocast_context_desc { struct_size, threads, log_level, log, log_user });

/// What the objects of a context share.
pub struct Context {
    pub(crate) engine: Engine,
    level: i32,
    log: echocast_log_fn,
    user: *mut c_void,
}

// SAFETY: `user` is only passed to `log`, which the header allows to be called on any thread.
unsafe impl Send for Context {}
// SAFETY: as above.
unsafe impl Sync for Context {}

impl Context {
    pub(crate) fn log_message(&self, level: i32, text: impl Display) {
        let Some(log) = self.log.filter(|_| level <= self.level) else { return };
        let text = CString::new(text.to_string().replace('\0', "?")).unwrap_or_default();
        // SAFETY: the header requires that the host's function can be called with its argument on any thread; the text
        // lives during the call.
        unsafe { log(self.user, level, text.as_ptr()) };
    }

    pub(crate) fn warn(&self, report: &Report) {
        report.warnings.iter().for_each(|warning| self.log_message(ECHOCAST_LOG_WARN, warning));
    }

    /// Checks that `other`, of the argument `name`, is this context.
    pub(crate) fn check(self: &Arc<Self>, other: &Arc<Self>, name: &str) -> Outcome {
        if Arc::ptr_eq(self, other) {
            return Ok(());
        }
        Err(Failure::new(crate::ECHOCAST_E_HANDLE, format!("{name} belongs to another context")))
    }
}

/// Creates a context: starts its threads, which inherit the signal mask of the calling thread, and loads Embree. A
/// process forked afterwards does not have these threads: create contexts after a fork. `desc`: NULL for the defaults.
/// `*out` is the new context; release it with echocast_context_release.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_UNSUPPORTED (Embree is not found, or is too old, or the processor is),
/// ECHOCAST_E_MEMORY (out of memory, or of threads). Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_context_create(
    desc: *const echocast_context_desc,
    out: *mut *mut echocast_context,
) -> crate::echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let desc = if desc.is_null() {
            echocast_context_desc::default()
        } else {
            // SAFETY: `desc` is a structure (see `text`).
            unsafe { text::structure(desc, "desc") }?
        };
        let threads =
            usize::try_from(desc.threads).map_err(|_| Failure::argument("desc->threads", desc.threads, "0 to 1024"))?;
        if !matches!(desc.log_level, ECHOCAST_LOG_OFF | ECHOCAST_LOG_WARN | ECHOCAST_LOG_INFO) {
            return Err(Failure::argument("desc->log_level", desc.log_level, "0, 2 or 3, an ECHOCAST_LOG_ number"));
        }
        let engine = Engine::with_threads(threads)?;
        let context = Context { engine, level: desc.log_level, log: desc.log, user: desc.log_user };
        let (major, minor, patch) = context.engine.embree_version();
        context.log_message(
            ECHOCAST_LOG_INFO,
            format_args!("Embree {major}.{minor}.{patch}, threads: {}", context.engine.threads()),
        );
        *out = handle::create(context)?;
        Ok(())
    })
}

/// Releases a context. What was made with it stays usable; its threads end when the last of these is released. NULL is
/// allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_context_release(context: *mut echocast_context) {
    guard(|| {
        handle::release(context);
        Ok(())
    });
}
