//! Frames of radars: cubes, samples and polar images.

use crate::context::Context;
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::pose::echocast_pose;
use crate::result::{ResultPoints, echocast_result};
use crate::reuse::{Inputs, Reused, fill};
use crate::scan::echocast_scan_desc;
use crate::scene::echocast_snapshot;
use crate::text;
use crate::time::nanoseconds;
use echocast::preview::{self, PreviewOptions};
use echocast::radar::{RadarCube, RadarFrame, RadarRecord};
use echocast::{PointCloud, Sensor};
use std::ffi::c_char;
use std::ptr;
use std::sync::{Arc, RwLock};

/// The frame of a radar. Any number of threads may read it; only one at a time may change it.
pub struct echocast_radar(());

handles! {
    echocast_radar: RwLock<RadarSlot>, "frame of a radar", 12;
}

/// A frame, and what the next one reuses.
pub struct RadarSlot {
    context: Arc<Context>,
    frame: RadarFrame,
    inputs: Inputs,
}

impl Reused for RadarSlot {
    fn new(context: &Arc<Context>) -> RadarSlot {
        RadarSlot { context: context.clone(), frame: RadarFrame::default(), inputs: Inputs::default() }
    }

    fn context(&self) -> &Arc<Context> {
        &self.context
    }
}

/// The cube: amplitudes of every channel, velocity and range.
pub const ECHOCAST_RADAR_CUBE: u32 = 1;
/// The samples of the converters. The cube is then made from them.
pub const ECHOCAST_RADAR_SAMPLES: u32 = 2;

/// Simulates one frame of a radar; of a rotating one, a turn. `*io`: NULL, which is replaced by a new frame, to be
/// released with echocast_radar_release; or a frame, which is replaced by this one. `record`: what is kept, a sum of
/// ECHOCAST_RADAR_ numbers; 0: of rotating radars the polar image, of others nothing. `detections`: NULL, or what
/// echocast_scan takes: receives the detections.
///
/// `desc` is as for echocast_scan, which gives the detections of the same frame; boxes and progress are not used.
///
/// On an error, an existing frame is unchanged, and existing detections are unchanged or empty.
///
/// Errors: ECHOCAST_E_ARGUMENT (a sensor that is not a radar, another profile than the physical one, an unknown number
/// in `record`), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY (another thread uses the frame or the
/// detections, or changes the sensor). Any number of threads may use one snapshot with one sensor, each with its own
/// frame.
///
/// ```c
/// echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
/// echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
/// desc.sensor = sensor;
/// desc.poses = &here;
/// desc.pose_count = 1;
/// echocast_radar *radar = NULL;
/// echocast_radar_frame(snapshot, &desc, ECHOCAST_RADAR_CUBE, &radar, &result);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_radar_frame(
    snapshot: *const echocast_snapshot,
    desc: *const echocast_scan_desc,
    record: u32,
    io: *mut *mut echocast_radar,
    detections: *mut *mut echocast_result,
) -> echocast_status {
    guard(|| {
        let snapshot = handle::get(snapshot, "snapshot")?;
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        let sensor = handle::get(desc.sensor, "desc->sensor")?;
        snapshot.0.check(&sensor.0, "desc->sensor")?;
        let sensor: Arc<Sensor> = handle::read(&sensor.1, "desc->sensor")?.clone();
        if record & !(ECHOCAST_RADAR_CUBE | ECHOCAST_RADAR_SAMPLES) != 0 {
            return Err(Failure::argument("record", record, "0 or a sum of ECHOCAST_RADAR_ numbers"));
        }
        let record =
            RadarRecord { cube: record & ECHOCAST_RADAR_CUBE != 0, samples: record & ECHOCAST_RADAR_SAMPLES != 0 };
        let made = |slot: &mut RadarSlot| {
            let RadarSlot { frame, inputs, .. } = slot;
            let mut simulate = |cloud: &mut PointCloud| {
                // SAFETY: the arrays and strings of `desc` are as `text` describes.
                unsafe {
                    inputs.with(&desc, &sensor, |trajectory, options| {
                        *frame = snapshot.1.radar_frame(&sensor, trajectory, options, record, cloud)?;
                        (cloud.boxes, cloud.time_zero) = (None, trajectory.time_zero());
                        Ok(())
                    })
                }
            };
            if detections.is_null() {
                return simulate(&mut PointCloud::default());
            }
            let scanned = |points: &mut ResultPoints| points.scanned(&sensor, |points| simulate(&mut points.cloud));
            // SAFETY: `detections` is a handle slot (see `text`).
            unsafe { fill(detections, &snapshot.0, scanned) }
        };
        // SAFETY: `io` is a handle slot (see `text`).
        unsafe { fill(io, &snapshot.0, made) }
    })
}

/// Runs `look` on the frame while no thread changes it.
fn look<T>(radar: *const echocast_radar, look: impl FnOnce(&RadarSlot) -> Outcome<T>) -> Outcome<T> {
    let radar = handle::get(radar, "radar")?;
    look(&*handle::read(&radar, "radar")?)
}

/// What a frame of a radar holds; ECHOCAST_RADAR_INFO_INIT is empty. Arrays are in place, NULL where the frame does not
/// have them.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_radar_info {
    /// sizeof(echocast_radar_info).
    pub struct_size: usize,
    /// Number of the frame: scan_desc.frame.
    pub number: u32,
    /// Channels of the cube and of `elements`.
    pub channels: u32,
    /// Start of the frame, ns. Times since 1970 are rounded to 0.2 microseconds.
    pub t_ns: i64,
    /// Pose of the radar in the world.
    pub sensor_pose: echocast_pose,
    /// Wavelength in the middle of a chirp, metres.
    pub wavelength_m: f64,
    /// Places of the virtual elements of the channels, metres, x, y, z in the axes of the radar: 3 * channels numbers.
    pub elements: *const f64,
    /// Amplitudes at the receiver, square roots of watts, real and imaginary parts interleaved: 2 * channels *
    /// velocities * ranges numbers, range by range. A longer way makes the phase more negative.
    pub cube: *const f32,
    /// Velocities of the cube.
    pub velocities: u32,
    /// Ranges of the cube.
    pub ranges: u32,
    /// The lowest velocity, m/s; positive velocities recede.
    pub first_velocity: f64,
    /// From one velocity to the next, m/s.
    pub velocity_step: f64,
    /// The lowest range, metres.
    pub first_range_m: f64,
    /// From one range to the next, metres.
    pub range_step_m: f64,
    /// What the converters sampled, chirp by chirp, transmitter by transmitter, receiver by receiver, sample by sample,
    /// in phase and in quadrature interleaved.
    pub samples: *const i16,
    /// Numbers of chirps of each transmitter, of transmitters, of receivers, and of samples in a chirp.
    pub sample_shape: [u32; 4],
    /// Power at the receiver in a turn of a rotating radar, dBm, azimuth by azimuth: azimuths * polar_ranges numbers.
    pub polar_dbm: *const f32,
    /// Direction of each azimuth, rad, counter-clockwise from ahead.
    pub polar_azimuth: *const f64,
    /// When each azimuth was measured, seconds, from the same zero as t_ns.
    pub polar_time: *const f64,
    /// Azimuths of the polar image.
    pub azimuths: u32,
    /// Ranges of the polar image.
    pub polar_ranges: u32,
    /// Its lowest range, metres.
    pub polar_first_range_m: f64,
    /// From one of its ranges to the next, metres.
    pub polar_range_step_m: f64,
}

impl Default for echocast_radar_info {
    fn default() -> Self {
        echocast_radar_info {
            struct_size: size_of::<Self>(),
            number: 0,
            channels: 0,
            t_ns: 0,
            sensor_pose: echocast_pose::IDENTITY,
            wavelength_m: 0.0,
            elements: ptr::null(),
            cube: ptr::null(),
            velocities: 0,
            ranges: 0,
            first_velocity: 0.0,
            velocity_step: 0.0,
            first_range_m: 0.0,
            range_step_m: 0.0,
            samples: ptr::null(),
            sample_shape: [0; 4],
            polar_dbm: ptr::null(),
            polar_azimuth: ptr::null(),
            polar_time: ptr::null(),
            azimuths: 0,
            polar_ranges: 0,
            polar_first_range_m: 0.0,
            polar_range_step_m: 0.0,
        }
    }
}

text::versioned!(echocast_radar_info {
    struct_size,
    number,
    channels,
    t_ns,
    sensor_pose,
    wavelength_m,
    elements,
    cube,
    velocities,
    ranges,
    first_velocity,
    velocity_step,
    first_range_m,
    range_step_m,
    samples,
    sample_shape,
    polar_dbm,
    polar_azimuth,
    polar_time,
    azimuths,
    polar_ranges,
    polar_first_range_m,
    polar_range_step_m,
});

impl echocast_radar_info {
    fn of(frame: &RadarFrame) -> echocast_radar_info {
        let mut info = echocast_radar_info {
            number: frame.number,
            channels: frame.elements.len() as u32,
            t_ns: nanoseconds(frame.time),
            sensor_pose: echocast_pose::of(&frame.pose),
            wavelength_m: frame.wavelength,
            elements: first(frame.elements.as_flattened()),
            ..echocast_radar_info::default()
        };
        if let Some(RadarCube { axes, cells, .. }) = &frame.cube {
            info.cube = first(cells).cast();
            (info.velocities, info.ranges) = (axes.velocity.len as u32, axes.range.len as u32);
            (info.first_velocity, info.velocity_step) = (axes.velocity.first, axes.velocity.step);
            (info.first_range_m, info.range_step_m) = (axes.range.first, axes.range.step);
        }
        if let Some(samples) = &frame.samples {
            info.samples = first(&samples.values);
            info.sample_shape = samples.shape.map(|count| count as u32);
        }
        if let Some(image) = &frame.polar {
            info.polar_dbm = first(&image.levels);
            (info.polar_azimuth, info.polar_time) = (first(&image.azimuths), first(&image.times));
            (info.azimuths, info.polar_ranges) = (image.azimuths.len() as u32, image.range.len as u32);
            (info.polar_first_range_m, info.polar_range_step_m) = (image.range.first, image.range.step);
        }
        info
    }
}

/// The address of the first of `numbers`; NULL if there are none.
fn first<T>(numbers: &[T]) -> *const T {
    numbers.first().map_or(ptr::null(), ptr::from_ref)
}

/// Gets what a frame holds. The caller sets struct_size of `*info`; what it points to is valid until the handle is used
/// for another frame or released.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_radar_info info = ECHOCAST_RADAR_INFO_INIT;
/// echocast_radar_get_info(radar, &info);
/// size_t cell = ((size_t)0 * info.velocities + info.velocities / 2) * info.ranges; // channel 0, near 0 m/s
/// for (uint32_t range = 0; range < info.ranges; ++range)
///     printf("%g m: %g + %gj\n", info.first_range_m + range * info.range_step_m, info.cube[2 * (cell + range)],
///            info.cube[2 * (cell + range) + 1]);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_radar_get_info(
    radar: *const echocast_radar,
    info: *mut echocast_radar_info,
) -> echocast_status {
    guard(|| {
        look(radar, |radar| {
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(echocast_radar_info::of(&radar.frame), info, "info") }
        })
    })
}

/// Writes a frame to a file, by the ending of `path`: NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`), arrays with their axes; or
/// the samples alone in the layout of TI's capture card DCA1000 (`.bin`). The file appears under its name only when it
/// is complete and on the disk.
///
/// Errors: ECHOCAST_E_ARGUMENT (`.bin` without samples), ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED (another
/// ending; HDF5 that is not built in), ECHOCAST_E_MEMORY, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_radar_write(radar, "frame.npz");
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_radar_write(radar: *const echocast_radar, path: *const c_char) -> echocast_status {
    guard(|| {
        // SAFETY: `path` is a string (see `text`).
        let path = unsafe { text::path(path, "path") }?;
        look(radar, |radar| {
            let report = radar.context.engine.install(|| radar.frame.write(path))?;
            radar.context.warn(&report);
            Ok(())
        })
    })
}

/// Writes a picture of a frame as PNG (`.png`), with scale and legend. `options`: YAML with `view`: "range_doppler" or
/// "range_azimuth" of the cube, "polar" of the polar image; and `width` (1600), 320 to 4096 pixels.
///
/// Errors: ECHOCAST_E_ARGUMENT (another view, a frame without what it shows, a width out of bounds), ECHOCAST_E_PARSE,
/// ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_radar_preview(radar, "doppler.png", "{view: range_doppler}");
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_radar_preview(
    radar: *const echocast_radar,
    path: *const c_char,
    options: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `path` and `options` are strings (see `text`).
        let (path, options) = unsafe { (text::path(path, "path")?, text::required(options, "options")?) };
        let options = PreviewOptions::from_yaml(options)?;
        look(radar, |radar| Ok(radar.context.engine.install(|| preview::write_frame(&radar.frame, path, &options))?))
    })
}

/// Releases a frame. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_radar_release(radar: *mut echocast_radar) {
    guard(|| {
        handle::release(radar);
        Ok(())
    });
}
