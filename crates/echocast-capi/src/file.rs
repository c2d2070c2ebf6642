//! Files of points and pings.

use crate::context::{Context, echocast_context};
use crate::guard::{Failure, echocast_status, guard};
use crate::handle::{self, handles};
use crate::ping::{self, echocast_pings};
use crate::result::{echocast_result, look};
use crate::text;
use echocast::export::{self, FramesFile};
use echocast::preview::{self, PreviewOptions};
use std::ffi::c_char;
use std::ptr;
use std::sync::{Arc, Mutex};

/// An HDF5 file that grows by one scan at a time.
pub struct echocast_frames(());

handles! {
    echocast_frames: Frames, "frames file", 8;
}

/// The growing file, until it is finished.
pub struct Frames {
    context: Arc<Context>,
    file: Mutex<Option<FramesFile>>,
}

/// Writes the points to a file, which appears under its name only when it is complete and on the disk. `format`: a name
/// from the list "formats"; NULL: chosen by the ending of `path`. Label names are in the file, or in NAME.labels.json
/// beside it, which appears just before; an error leaves both as they were. What a format cannot hold is reported to
/// the context's log.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_HANDLE,
/// ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_write(
    result: *const echocast_result,
    path: *const c_char,
    format: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `path` and `format` are strings (see `text`).
        let (path, format) = unsafe { (text::path(path, "path")?, text::optional(format, "format")?) };
        look(result, |points| {
            let report = points.context.engine.install(|| export::write(&points.cloud, path, format))?;
            points.context.warn(&report);
            Ok(())
        })
    })
}

/// Writes a picture of the points as PNG (`.png`). `options`: NULL, or YAML with `view` (top, perspective, range),
/// `color` (label, cause, intensity, range, height, velocity, radial_velocity, doppler, density) and `width` in pixels.
/// The result needs the columns that the colours show; without them other colours are used, with a warning in the log.
/// With the column `cause`, points of rain, fog and the like have their own colours.
///
/// Errors: ECHOCAST_E_ARGUMENT (a view that is not available for points, a width out of bounds), ECHOCAST_E_PARSE,
/// ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_preview(
    result: *const echocast_result,
    path: *const c_char,
    options: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `path` and `options` are strings (see `text`).
        let (path, options) = unsafe { (text::path(path, "path")?, text::optional(options, "options")?) };
        let options = match options.filter(|options| !options.trim().is_empty()) {
            None => PreviewOptions::default(),
            Some(options) => PreviewOptions::from_yaml(options)?,
        };
        look(result, |points| {
            let report = points.context.engine.install(|| preview::write(&points.cloud, path, &options))?;
            points.context.warn(&report);
            Ok(())
        })
    })
}

/// Writes the pings to a file, as NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`) by the ending of `path`: arrays of pings x
/// beams x bins, soundings, and what all pings have in common. The file appears under its name only when it is complete
/// and on the disk. What the format cannot hold is reported to the context's log.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED (another ending; HDF5 that is not
/// built in), ECHOCAST_E_MEMORY, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_pings_write(pings, "survey.npz");
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_write(pings: *const echocast_pings, path: *const c_char) -> echocast_status {
    guard(|| {
        // SAFETY: `path` is a string (see `text`).
        let path = unsafe { text::path(path, "path") }?;
        ping::look(pings, |pings| {
            let report = pings.context.engine.install(|| pings.pings.write(path))?;
            pings.context.warn(&report);
            Ok(())
        })
    })
}

/// Writes a picture of the pings as PNG (`.png`), with scales and a legend. `options`: YAML with `view`, `width` and
/// `ground` as for echocast_pings_image, and `color` (label, intensity); pings without labels are coloured by
/// intensity, with a warning in the log.
///
/// Errors: ECHOCAST_E_ARGUMENT (a view that this sonar does not have, a width out of bounds), ECHOCAST_E_PARSE,
/// ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_pings_preview(pings, "fan.png", "{view: fan, color: intensity}");
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_preview(
    pings: *const echocast_pings,
    path: *const c_char,
    options: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `path` and `options` are strings (see `text`).
        let (path, options) = unsafe { (text::path(path, "path")?, text::required(options, "options")?) };
        let options = PreviewOptions::from_yaml(options)?;
        ping::look(pings, |pings| {
            let report = pings.context.engine.install(|| preview::write_pings(&pings.pings, path, &options))?;
            pings.context.warn(&report);
            Ok(())
        })
    })
}

/// Starts an HDF5 file that takes scans one by one, each as one row of every dataset; only one is in memory at a time.
/// The file appears under its name with echocast_frames_finish; if released before, it leaves nothing behind.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO, ECHOCAST_E_UNSUPPORTED (built without HDF5), ECHOCAST_E_HANDLE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_frames_create(
    context: *const echocast_context,
    path: *const c_char,
    out: *mut *mut echocast_frames,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        // SAFETY: `path` is a string (see `text`).
        let path = unsafe { text::path(path, "path") }?;
        let file = Mutex::new(Some(FramesFile::create(path)?));
        *out = handle::create(Frames { context, file })?;
        Ok(())
    })
}

/// Appends the points of a scan as the next row.
///
/// Errors: ECHOCAST_E_ARGUMENT (a scan that does not fit the first), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_frames_add(
    frames: *mut echocast_frames,
    result: *const echocast_result,
) -> echocast_status {
    guard(|| {
        let frames = handle::get(frames, "frames")?;
        look(result, |points| {
            frames.context.check(&points.context, "result")?;
            let mut file = handle::lock(&frames.file, "frames")?;
            match &mut *file {
                None => Err(finished()),
                Some(file) => Ok(file.add(&points.cloud)?),
            }
        })
    })
}

/// Completes the file and gives it its name; late disk errors appear here.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_ARGUMENT (it is already finished), ECHOCAST_E_HANDLE,
/// ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_frames_finish(frames: *mut echocast_frames) -> echocast_status {
    guard(|| {
        let frames = handle::get(frames, "frames")?;
        let file = handle::lock(&frames.file, "frames")?.take();
        match file {
            None => Err(finished()),
            Some(file) => {
                frames.context.warn(&file.finish()?);
                Ok(())
            }
        }
    })
}

fn finished() -> Failure {
    Failure::argument("frames", "finished", "a file that is not")
}

/// Releases a frames file. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_frames_release(frames: *mut echocast_frames) {
    guard(|| {
        handle::release(frames);
        Ok(())
    });
}
