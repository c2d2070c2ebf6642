//! Scenarios and their samples.

use crate::context::{Context, echocast_context};
use crate::guard::{Outcome, echocast_status, guard, numbered};
use crate::handle::{self, handles};
use crate::ping::{PingList, echocast_pings};
use crate::result::{ResultPoints, echocast_result};
use crate::reuse::fill;
use crate::scan;
use crate::sensor::echocast_sensor;
use crate::text;
use crate::time::nanoseconds;
use echocast::scenario::{FrameTime, Sample, Scan};
use echocast::{BoxAxes, FieldSet, ScanOptions, Scenario};
use std::ffi::c_char;
use std::ptr;
use std::sync::{Arc, RwLock};

/// A file that makes samples: a scene, a rig of sensors, and what varies from sample to sample. Any number of threads
/// may make samples of it; only one at a time may change it.
pub struct echocast_scenario(());

/// A sample of a scenario: its scene with the values drawn for it, and the scans of its sensors. Any number of threads
/// may read it; only one at a time may scan it.
pub struct echocast_sample(());

handles! {
    echocast_scenario: (Arc<Context>, RwLock<Scenario>), "scenario", 9;
    echocast_sample: (Arc<Context>, RwLock<Drawn>), "sample", 10;
}

/// A sample, and the boxes requested for its scans.
pub struct Drawn {
    sample: Sample,
    boxes: Option<BoxAxes>,
    image_boxes: bool,
}

/// The scan of one sensor of the rig in a sample; ECHOCAST_SCAN_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_scan_info {
    /// sizeof(echocast_scan_info).
    pub struct_size: usize,
    /// Number of its frames; for a sonar, of its pings.
    pub frames: usize,
    /// Buffer for the name of the sensor in the rig, which ends in 0 and is cut off if it is too long; NULL if not
    /// needed. Set by the caller.
    pub name: *mut c_char,
    /// Capacity of `name`, bytes. Set by the caller.
    pub name_capacity: usize,
}

impl Default for echocast_scan_info {
    fn default() -> Self {
        echocast_scan_info { struct_size: size_of::<Self>(), frames: 0, name: ptr::null_mut(), name_capacity: 0 }
    }
}

text::versioned!(echocast_scan_info { struct_size, frames, name, name_capacity });

/// The time of a frame; ECHOCAST_FRAME_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_frame_info {
    /// sizeof(echocast_frame_info).
    pub struct_size: usize,
    /// Its start, ns since the start of the run, from which the column `time` counts.
    pub start_ns: i64,
    /// Longest duration of the scan, ns.
    pub duration_ns: i64,
    /// Number of the frame, as in the column `frame`.
    pub number: u32,
    /// 0.
    pub reserved: u32,
}

impl Default for echocast_frame_info {
    fn default() -> Self {
        echocast_frame_info { struct_size: size_of::<Self>(), start_ns: 0, duration_ns: 0, number: 0, reserved: 0 }
    }
}

text::versioned!(echocast_frame_info { struct_size, start_ns, duration_ns, number, reserved });

/// Reads a scenario file, or the report of `echocast scan --json`. File names in it are relative to its folder, or to
/// its key `folder`. Scenes and models are read with the first sample that needs them, and kept for the others. Its
/// `outputs` are for the program and not used here.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file, line, key), ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may
/// call this.
///
/// ```c
/// echocast_scenario *drive;
/// echocast_scenario_load(context, "drive.yaml", &drive);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_load(
    context: *const echocast_context,
    path: *const c_char,
    out: *mut *mut echocast_scenario,
) -> echocast_status {
    create(context, out, || {
        // SAFETY: `path` is a string (see `text`).
        let path = unsafe { text::path(path, "path") }?;
        Ok(Scenario::load(path)?)
    })
}

/// Like echocast_scenario_load, from YAML text with the contents of a scenario file. `folder`: the folder that paths in
/// it are relative to; NULL for the working folder.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (line and key), ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may call
/// this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_from_text(
    context: *const echocast_context,
    yaml: *const c_char,
    folder: *const c_char,
    out: *mut *mut echocast_scenario,
) -> echocast_status {
    create(context, out, || {
        // SAFETY: `yaml` and `folder` are strings (see `text`).
        let (yaml, folder) = unsafe { (text::required(yaml, "yaml")?, text::optional_path(folder, "folder")?) };
        Ok(Scenario::from_yaml(yaml, folder)?)
    })
}

fn create(
    context: *const echocast_context,
    out: *mut *mut echocast_scenario,
    read: impl FnOnce() -> Outcome<Scenario>,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        let scenario = read()?.with_engine(&context.engine);
        *out = handle::create((context, RwLock::new(scenario)))?;
        Ok(())
    })
}

/// Changes a key of a scenario: `key` is its path (`frames.last`, `sensors.top.rate_hz`, `sensors[0].mount`), `value`
/// YAML. Existing samples stay as they are; the next one reads its scene and models again.
///
/// Errors: ECHOCAST_E_PARSE (key, what was found, what is allowed), ECHOCAST_E_IO, ECHOCAST_E_ARGUMENT,
/// ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY (another thread makes a sample); the scenario is then unchanged.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_set(
    scenario: *mut echocast_scenario,
    key: *const c_char,
    value: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `key` and `value` are strings (see `text`).
        let (key, value) = unsafe { (text::required(key, "key")?, text::required(value, "value")?) };
        let scenario = handle::get(scenario, "scenario")?;
        Ok(handle::write(&scenario.1, "scenario")?.set(key, value)?)
    })
}

/// Writes the number of samples of a scenario to `*out`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_samples(
    scenario: *const echocast_scenario,
    out: *mut u64,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(0);
        let scenario = handle::get(scenario, "scenario")?;
        *out = handle::read(&scenario.1, "scenario")?.samples();
        Ok(())
    })
}

/// Makes a sample, counted from 0: draws what varies and sets up its scene and scans. It is the same whether it is made
/// alone, in any order or on any thread, and the one that `echocast run` writes; the number may exceed the samples of
/// the scenario, up to 4294967295. `*out` is the new sample; release it with echocast_sample_release. Warnings are
/// reported to the context's log: objects for which there was no room, what scene files lack.
///
/// Any number of threads may make samples of one scenario: with a context of one thread in parallel; a context of
/// several threads uses all of them for one sample after the other.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT (a drawn value
/// that is not allowed, no room for what must be placed), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY
/// (another thread changes the scenario).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_sample(
    scenario: *const echocast_scenario,
    sample: u64,
    out: *mut *mut echocast_sample,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let scenario = handle::get(scenario, "scenario")?;
        let (context, scenario) = (&scenario.0, handle::read(&scenario.1, "scenario")?);
        let made = scenario.sample(sample)?;
        context.warn(made.report());
        let drawn = Drawn { sample: made, boxes: None, image_boxes: false };
        *out = handle::create((Arc::clone(context), RwLock::new(drawn)))?;
        Ok(())
    })
}

/// Releases a scenario; its samples stay. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_release(scenario: *mut echocast_scenario) {
    guard(|| {
        handle::release(scenario);
        Ok(())
    });
}

/// Runs `look` on the sample while no thread scans it.
fn look<T>(sample: *const echocast_sample, look: impl FnOnce(&Arc<Context>, &Sample) -> Outcome<T>) -> Outcome<T> {
    let sample = handle::get(sample, "sample")?;
    look(&sample.0, &handle::read(&sample.1, "sample")?.sample)
}

/// The scan with this number.
fn scan_of(sample: &Sample, scan: usize) -> Outcome<&Scan> {
    numbered(sample.scans(), scan, "scan")
}

/// The frame with this number.
fn frame_of(scan: &Scan, frame: usize) -> Outcome<&FrameTime> {
    numbered(scan.frames(), frame, "frame")
}

/// Writes the number of scans of a sample, one for each sensor of the rig, to `*out`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_scans(sample: *const echocast_sample, out: *mut usize) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(0);
        look(sample, |_, sample| {
            *out = sample.scans().len();
            Ok(())
        })
    })
}

/// Gets information on a scan, counted from 0 in the order of the rig. The caller sets struct_size of `*info`, and the
/// buffer for the name.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_get_scan(
    sample: *const echocast_sample,
    scan: usize,
    info: *mut echocast_scan_info,
) -> echocast_status {
    guard(|| {
        look(sample, |_, sample| {
            let scan = scan_of(sample, scan)?;
            // SAFETY: `info` is a structure (see `text`).
            let given = unsafe { text::structure(info, "info") }?;
            if !given.name.is_null() {
                // SAFETY: `given.name` is a buffer (see `text`).
                unsafe { text::put(scan.name(), given.name, given.name_capacity, ptr::null_mut()) }?;
            }
            let found = echocast_scan_info { frames: scan.frames().len(), ..given };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Gets the time of a frame of a scan, counted from 0. The caller sets struct_size of `*info`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_get_frame(
    sample: *const echocast_sample,
    scan: usize,
    frame: usize,
    info: *mut echocast_frame_info,
) -> echocast_status {
    guard(|| {
        look(sample, |_, sample| {
            let scan = scan_of(sample, scan)?;
            let frame = frame_of(scan, frame)?;
            let found = echocast_frame_info {
                start_ns: nanoseconds(frame.start),
                duration_ns: nanoseconds(scan.sensor().scan_time()),
                number: frame.number,
                ..echocast_frame_info::default()
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Gets a copy of the sensor of a scan, with the values drawn for it: `*out` is a sensor like any other, to be released
/// with echocast_sensor_release.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_sensor(
    sample: *const echocast_sample,
    scan: usize,
    out: *mut *mut echocast_sensor,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        look(sample, |context, sample| {
            let sensor = Arc::clone(scan_of(sample, scan)?.sensor());
            *out = handle::create((Arc::clone(context), RwLock::new(sensor)))?;
            Ok(())
        })
    })
}

/// Writes what was drawn for a sample, in the order of the rules, as JSON to `json`, which has room for `capacity`
/// bytes; longer text is cut off. It is the list `drawn` of the files samples/NUMBER.json that `echocast run` writes.
/// `*needed`: bytes of the whole text, including the 0 at its end. One of `json` and `needed` may be NULL.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_drawn(
    sample: *const echocast_sample,
    json: *mut c_char,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let entries: Vec<String> =
            look(sample, |_, sample| Ok(sample.drawn().iter().map(ToString::to_string).collect()))?;
        // SAFETY: `json` is a buffer and `needed` an output (see `text`).
        unsafe { text::put(&format!("[{}]", entries.join(",")), json, capacity, needed) }
    })
}

/// Sets which boxes the following scans of a sample have: `boxes` and `image_boxes` as in echocast_scan_desc; none by
/// default. The time for which they are valid is set by the scenario (`boxes`).
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_sample_set_boxes(sample, ECHOCAST_BOXES_OBJECT, 0);
/// echocast_sample_scan(sample, 0, 0, NULL, &result);
/// echocast_box_view boxes;
/// echocast_result_boxes(result, &boxes);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_set_boxes(
    sample: *mut echocast_sample,
    boxes: i32,
    image_boxes: i32,
) -> echocast_status {
    guard(|| {
        let sample = handle::get(sample, "sample")?;
        let (axes, in_image) = scan::boxes((boxes, "boxes"), (image_boxes, "image_boxes"))?;
        let mut drawn = handle::write(&sample.1, "sample")?;
        (drawn.boxes, drawn.image_boxes) = (axes, in_image);
        Ok(())
    })
}

/// Scans a frame of a sample as the scenario specifies: scan and frame are counted from 0; a sonar sends the ping with
/// that number. `columns`: NULL for those of the scenario (`fields`); else names as in echocast_scan_desc, where
/// "default" stands for these. `*io`: NULL, which is replaced by a new result, or a result, whose memory is reused, as
/// for echocast_scan. Frames may be scanned in any order and repeatedly: the points are the same.
///
/// One thread at a time may scan a sample; several threads may each scan their own.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY. On an error in the arguments, an
/// existing result is unchanged; if memory runs out, it is empty.
///
/// ```c
/// uint64_t samples;
/// echocast_scenario_samples(scenario, &samples);
/// for (uint64_t i = 0; i < samples; ++i) {
///     echocast_sample *sample;
///     echocast_scenario_sample(scenario, i, &sample);
///     echocast_sample_scan(sample, 0, 0, NULL, &result);
///     echocast_sample_release(sample);
/// }
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_scan(
    sample: *mut echocast_sample,
    scan: usize,
    frame: usize,
    columns: *const c_char,
    io: *mut *mut echocast_result,
) -> echocast_status {
    guard(|| {
        // SAFETY: `columns` is a string (see `text`).
        let columns = unsafe { text::optional(columns, "columns") }?;
        let sample = handle::get(sample, "sample")?;
        let (context, mut drawn) = (&sample.0, handle::write(&sample.1, "sample")?);
        let Drawn { sample, boxes, image_boxes } = &mut *drawn;
        let mut options = options(sample, scan, frame, columns)?;
        (options.boxes, options.image_boxes) = (*boxes, *image_boxes);
        let sensor = Arc::clone(sample.scans()[scan].sensor());
        let scan_into = |points: &mut ResultPoints| {
            points.scanned(&sensor, |points| {
                let built = sample.built(scan, frame)?;
                context.warn(built.report());
                let trajectory = sample.scans()[scan].trajectory();
                Ok(built.scan_into(&sensor, trajectory, &options, &mut points.cloud)?)
            })
        };
        // SAFETY: `io` is a handle slot (see `text`).
        unsafe { fill(io, context, scan_into) }
    })
}

/// Sends a ping of a sonar of a sample as the scenario specifies: like echocast_sample_scan, but into a list of pings,
/// as echocast_ping does.
///
/// Errors: ECHOCAST_E_ARGUMENT (a scan whose sensor is not a sonar), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
/// ECHOCAST_E_BUSY. On an error in the arguments, an existing list is unchanged; if memory runs out, it is empty.
///
/// ```c
/// echocast_pings *pings = NULL;
/// echocast_sample_ping(sample, 0, 0, NULL, &pings);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_ping(
    sample: *mut echocast_sample,
    scan: usize,
    frame: usize,
    columns: *const c_char,
    io: *mut *mut echocast_pings,
) -> echocast_status {
    guard(|| {
        // SAFETY: `columns` is a string (see `text`).
        let columns = unsafe { text::optional(columns, "columns") }?;
        let sample = handle::get(sample, "sample")?;
        let (context, mut drawn) = (&sample.0, handle::write(&sample.1, "sample")?);
        let sample = &mut drawn.sample;
        let options = options(sample, scan, frame, columns)?;
        let sent = |pings: &mut PingList| {
            pings.sent(|_, ping| {
                let built = sample.built(scan, frame)?;
                context.warn(built.report());
                let scan = &sample.scans()[scan];
                Ok(built.ping_into(scan.sensor(), scan.trajectory(), &options, ping)?)
            })
        };
        // SAFETY: `io` is a handle slot (see `text`).
        unsafe { fill(io, context, sent) }
    })
}

/// The options of a frame, with other columns than the scenario's if any are given.
fn options(sample: &Sample, scan: usize, frame: usize, columns: Option<&str>) -> Outcome<ScanOptions> {
    let scan = scan_of(sample, scan)?;
    frame_of(scan, frame)?;
    let mut options = scan.options(frame);
    if let Some(names) = columns {
        options.fields = FieldSet::parse_with(names, options.fields)?;
    }
    Ok(options)
}

/// Releases a sample. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_release(sample: *mut echocast_sample) {
    guard(|| {
        handle::release(sample);
        Ok(())
    });
}
