//! Objects that calls fill again and again, and what they keep from one call to the next.

use crate::context::Context;
use crate::guard::{Failure, Outcome};
use crate::handle::{self, Handle};
use echocast::{Environment, Pose};
use std::sync::{Arc, RwLock};

/// An object that calls fill again and again, reusing its memory.
pub(crate) trait Reused {
    /// An empty one that belongs to a context.
    fn new(context: &Arc<Context>) -> Self;
    fn context(&self) -> &Arc<Context>;
}

/// Runs `fill` on the object whose handle is at `io`, or on a new one if that is NULL, and then writes its handle
/// there.
///
/// # Safety
/// `io` is a handle slot, as [`text`](crate::text) describes.
pub(crate) unsafe fn fill<T: Reused, H: Handle<Object = RwLock<T>>>(
    io: *mut *mut H,
    context: &Arc<Context>,
    fill: impl FnOnce(&mut T) -> Outcome,
) -> Outcome {
    if io.is_null() || !io.is_aligned() {
        return Err(Failure::argument("io", format!("{io:p}"), &format!("the address of a pointer to a {}", H::NAME)));
    }
    // SAFETY: as the caller promises.
    let old = unsafe { io.read() };
    if old.is_null() {
        let mut object = T::new(context);
        fill(&mut object)?;
        let new = handle::create(RwLock::new(object))?;
        // SAFETY: as the caller promises.
        unsafe { io.write(new) };
        Ok(())
    } else {
        let object = handle::get(old, "*io")?;
        let mut object = handle::write(&object, "*io")?;
        context.check(object.context(), "*io")?;
        fill(&mut object)
    }
}

/// The inputs of the last scan, and memory for those of the next one.
#[derive(Default)]
pub(crate) struct Inputs {
    pub keys: Vec<(f64, Pose)>,
    pub weather: ResultWeather,
}

/// The environment of a result's last scan and its text.
#[derive(Default)]
pub(crate) struct ResultWeather {
    text: String,
    pub environment: Environment,
}

impl ResultWeather {
    /// Parses `text`, unless it is the one that was parsed last.
    pub fn read(&mut self, text: Option<&str>) -> Outcome {
        let text = text.unwrap_or_default();
        if text != self.text {
            self.environment =
                if text.trim().is_empty() { Environment::default() } else { Environment::from_yaml(text)? };
            text.clone_into(&mut self.text);
        }
        Ok(())
    }
}
