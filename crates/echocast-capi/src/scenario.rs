//! Scenarios and their samples.

use crate::context::{Context, echocast_context};
use crate::guard::{Outcome, echocast_status, guard, numbered};
use crate::handle::{self, handles};
use crate::ping::{Pings, echocast_pings};
use crate::result::{Points, echocast_result};
use crate::scan::{self, fill};
use crate::sensor::{echocast_sensor, nanoseconds};
use crate::text;
use echocast::scenario::{FrameTime, Sample, Scan};
use echocast::{BoxAxes, FieldSet, ScanOptions, Scenario};
use std::ffi::c_char;
use std::ptr;
use std::sync::{Arc, RwLock};

/// A file that makes samples: a scene, a rig of sensors, and what differs from sample to sample. Any number of threads
/// may make samples of it; only one at a time may change it.
pub struct echocast_scenario(());

/// A sample of a scenario: its scene as it was drawn, and the scans of its sensors. Any number of threads may read it;
/// only one at a time may scan it.
pub struct echocast_sample(());

handles! {
    echocast_scenario: (Arc<Context>, RwLock<Scenario>), "scenario", 9;
    echocast_sample: (Arc<Context>, RwLock<Drawn>), "sample", 10;
}

/// A sample, and the boxes that its scans are to have.
pub struct Drawn {
    sample: Sample,
    boxes: Option<BoxAxes>,
    image_boxes: bool,
}

/// What one sensor of the rig does in a sample; ECHOCAST_SCAN_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_scan_info {
    /// sizeof(echocast_scan_info).
    pub struct_size: usize,
    /// Its frames; of a sonar, its pings.
    pub frames: usize,
    /// Where the name of the sensor in the rig is written, ending in 0, cut off if it is too long; NULL if not wanted.
    /// Set by the caller.
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

/// When a frame is scanned; ECHOCAST_FRAME_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_frame_info {
    /// sizeof(echocast_frame_info).
    pub struct_size: usize,
    /// Its start, ns since the start of the run, from which the column `time` counts.
    pub start_ns: i64,
    /// How long the sensor looks at the scene at most, ns.
    pub duration_ns: i64,
    /// Its number, as in the column `frame`.
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

/// Reads a scenario file, or the report of `echocast scan --json`. Names of files in it are relative to its folder, or
/// to its `folder`. Scenes and models are read with the first sample that needs them, and kept for the others. What it
/// says under `outputs` is for the program and not used here.
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
        // SAFETY: as the header asks.
        let path = unsafe { text::path(path, "path") }?;
        Ok(Scenario::load(path)?)
    })
}

/// Like echocast_scenario_load, from YAML text with the contents of a scenario file. `folder`: where relative paths in
/// it start; NULL for the working folder.
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
        // SAFETY: as the header asks.
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
        // SAFETY: as the header asks.
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        let scenario = read()?.with_engine(&context.engine);
        *out = handle::create((context, RwLock::new(scenario)))?;
        Ok(())
    })
}

/// Changes a key of a scenario: `key` is its path (`frames.last`, `sensors.top.rate_hz`, `sensors[0].mount`), `value`
/// YAML. Samples that were made stay as they are; the next one reads its scene and models again.
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
        // SAFETY: as the header asks.
        let (key, value) = unsafe { (text::required(key, "key")?, text::required(value, "value")?) };
        let scenario = handle::get(scenario, "scenario")?;
        Ok(handle::write(&scenario.1, "scenario")?.set(key, value)?)
    })
}

/// Writes the number of samples that a scenario asks for to `*out`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_samples(
    scenario: *const echocast_scenario,
    out: *mut u64,
) -> echocast_status {
    guard(|| {
        // SAFETY: as the header asks.
        let out = unsafe { text::output(out, "out") }?.write(0);
        let scenario = handle::get(scenario, "scenario")?;
        *out = handle::read(&scenario.1, "scenario")?.samples();
        Ok(())
    })
}

/// Makes a sample, counted from 0: draws what varies and sets up its scene and scans. It is the same alone, in any
/// order, on any thread, and the one that `echocast run` writes; there may be more than the scenario asks for, up to
/// number 4294967295. `*out` is the new sample; release it with echocast_sample_release. What was noticed is reported
/// to the context's log: objects that found no room, what scene files lack.
///
/// Any number of threads may make samples of one scenario: in a context of one thread side by side; a context of
/// several gives all its threads to one sample after the other.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT (a value that
/// was drawn and is not allowed, no room for what must be placed), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
/// ECHOCAST_E_BUSY (another thread changes the scenario).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scenario_sample(
    scenario: *const echocast_scenario,
    sample: u64,
    out: *mut *mut echocast_sample,
) -> echocast_status {
    guard(|| {
        // SAFETY: as the header asks.
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

/// Runs `look` on the sample, while nobody scans it.
fn look<T>(sample: *const echocast_sample, look: impl FnOnce(&Arc<Context>, &Sample) -> Outcome<T>) -> Outcome<T> {
    let sample = handle::get(sample, "sample")?;
    look(&sample.0, &handle::read(&sample.1, "sample")?.sample)
}

/// The scan of this number.
fn scan_of(sample: &Sample, scan: usize) -> Outcome<&Scan> {
    numbered(sample.scans(), scan, "scan")
}

/// The frame of this number.
fn frame_of(scan: &Scan, frame: usize) -> Outcome<&FrameTime> {
    numbered(scan.frames(), frame, "frame")
}

/// Writes the number of scans of a sample, one for each sensor of the rig, to `*out`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_scans(sample: *const echocast_sample, out: *mut usize) -> echocast_status {
    guard(|| {
        // SAFETY: as the header asks.
        let out = unsafe { text::output(out, "out") }?.write(0);
        look(sample, |_, sample| {
            *out = sample.scans().len();
            Ok(())
        })
    })
}

/// Gets information on a scan, counted from 0 in the order of the rig. The caller sets struct_size of `*info`, and
/// where the name is to go.
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
            // SAFETY: as the header asks.
            let asked = unsafe { text::structure(info, "info") }?;
            if !asked.name.is_null() {
                // SAFETY: as the header asks.
                unsafe { text::put(scan.name(), asked.name, asked.name_capacity, ptr::null_mut()) }?;
            }
            let found = echocast_scan_info { frames: scan.frames().len(), ..asked };
            // SAFETY: as the header asks.
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
            // SAFETY: as the header asks.
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Gives a copy of the sensor of a scan, with all that was drawn for it: `*out` is a sensor like any other, to be
/// released with echocast_sensor_release.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sample_sensor(
    sample: *const echocast_sample,
    scan: usize,
    out: *mut *mut echocast_sensor,
) -> echocast_status {
    guard(|| {
        // SAFETY: as the header asks.
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
        // SAFETY: as the header asks.
        unsafe { text::put(&format!("[{}]", entries.join(",")), json, capacity, needed) }
    })
}

/// Says which boxes the following scans of a sample have: `boxes` and `image_boxes` as in echocast_scan_desc; at first
/// none. When they hold, the scenario says (`boxes`).
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

/// Scans a frame of a sample as the scenario says: scan and frame are counted from 0; a sonar sends the ping of that
/// number. `columns`: NULL for those that the scenario asks for (`fields`); else names as in echocast_scan_desc, where
/// "default" stands for these. `*io`: NULL, and it becomes a new result, or a result, whose memory is reused, as for
/// echocast_scan. Frames may be scanned in any order and again: the points are the same.
///
/// One thread at a time may scan a sample; each may scan one of its own.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY. On an error in the arguments, an
/// old result stays as it was; when there was no memory for a scan, it is empty.
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
        // SAFETY: as the header asks.
        let columns = unsafe { text::optional(columns, "columns") }?;
        let sample = handle::get(sample, "sample")?;
        let (context, mut drawn) = (&sample.0, handle::write(&sample.1, "sample")?);
        let Drawn { sample, boxes, image_boxes } = &mut *drawn;
        let mut options = options(sample, scan, frame, columns)?;
        (options.boxes, options.image_boxes) = (*boxes, *image_boxes);
        let sensor = Arc::clone(sample.scans()[scan].sensor());
        let scan_into = |points: &mut Points| {
            points.scanned(&sensor, |points| {
                let built = sample.built(scan, frame)?;
                context.warn(built.report());
                let trajectory = sample.scans()[scan].trajectory();
                Ok(built.scan_into(&sensor, trajectory, &options, &mut points.cloud)?)
            })
        };
        // SAFETY: as the header asks.
        unsafe { fill(io, context, scan_into) }
    })
}

/// Sends a ping of a sonar of a sample as the scenario says: as echocast_sample_scan, but into a list of pings, as
/// echocast_ping does.
///
/// Errors: ECHOCAST_E_ARGUMENT (a scan whose sensor is not a sonar), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
/// ECHOCAST_E_BUSY. On an error in the arguments, an old list stays as it was; one for which there was no memory is
/// empty.
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
        // SAFETY: as the header asks.
        let columns = unsafe { text::optional(columns, "columns") }?;
        let sample = handle::get(sample, "sample")?;
        let (context, mut drawn) = (&sample.0, handle::write(&sample.1, "sample")?);
        let sample = &mut drawn.sample;
        let options = options(sample, scan, frame, columns)?;
        let sent = |pings: &mut Pings| {
            pings.sent(|_, ping| {
                let built = sample.built(scan, frame)?;
                context.warn(built.report());
                let scan = &sample.scans()[scan];
                Ok(built.ping_into(scan.sensor(), scan.trajectory(), &options, ping)?)
            })
        };
        // SAFETY: as the header asks.
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
