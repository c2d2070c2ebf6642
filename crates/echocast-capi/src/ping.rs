//! Pings of sonars: cells of beams and range bins, soundings, images.

use crate::column::{ECHOCAST_TYPE_F32, ECHOCAST_TYPE_U32, computed, echocast_pack_item, echocast_view};
use crate::context::Context;
use crate::guard::{Failure, Outcome, echocast_status, guard, guard_or, numbered};
use crate::handle::{self, handles};
use crate::image::echocast_image_view;
use crate::label::{LabelStrings, put_label_number};
use crate::pack::Packing;
use crate::pose::echocast_pose;
use crate::reuse::{Inputs, Reused, fill};
use crate::scan::echocast_scan_desc;
use crate::scene::echocast_snapshot;
use crate::text;
use crate::time::nanoseconds;
use echocast::image::{Image, Place};
use echocast::preview::{self, PreviewOptions};
use echocast::{Field, PackItem, Ping, SonarView, Sounding};
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

/// Pings of one sonar in order, usually only the last one. Any number of threads may read them; only one at a time may
/// change them.
pub struct echocast_pings(());

handles! {
    echocast_pings: RwLock<PingList>, "list of pings", 11;
}

/// Pings, and memory that the next one reuses.
pub struct PingList {
    pub(crate) context: Arc<Context>,
    pub(crate) pings: echocast::Pings,
    inputs: Inputs,
    /// The soundings of each ping as structures of C.
    soundings: Vec<Vec<echocast_sounding>>,
    /// Each with the options that it was requested with.
    images: Mutex<Vec<(String, Image)>>,
    names: Mutex<LabelStrings>,
}

impl Reused for PingList {
    fn new(context: &Arc<Context>) -> PingList {
        let (pings, inputs, soundings, images, names) = Default::default();
        PingList { context: context.clone(), pings, inputs, soundings, images, names }
    }

    fn context(&self) -> &Arc<Context> {
        &self.context
    }
}

impl PingList {
    /// Runs `send`, which fills the one ping that remains. On an error the list is unchanged or empty.
    pub(crate) fn sent(&mut self, send: impl FnOnce(&mut Inputs, &mut Ping) -> Outcome) -> Outcome {
        let inputs = &mut self.inputs;
        let done = self.pings.refill(|ping| send(inputs, ping));
        if done.is_ok() || self.pings.all().is_empty() {
            self.changed();
        }
        done
    }

    /// Updates what is derived from the pings.
    fn changed(&mut self) {
        self.images.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
        self.soundings.resize_with(self.pings.all().len(), Vec::new);
        for (list, ping) in self.soundings.iter_mut().zip(self.pings.all()) {
            list.clear();
            list.extend(ping.soundings().iter().map(echocast_sounding::of));
        }
    }
}

/// Sends one ping of a sonar. `*io`: NULL, which is replaced by a new list with this ping, to be released with
/// echocast_pings_release; or a list, which then has only this ping and reuses its memory: after the first of their
/// kind, pings allocate up to 20 small blocks, whatever the number of rays and cells.
///
/// `desc` is as for echocast_scan, which gives the points of the same ping; its `frame` is the number of the ping. A
/// ping has the column `intensity`, the level, and the requested ones among `category_id`, `part_id`, `instance_id`,
/// `material_id`, `time`, `azimuth`, `elevation`, `red`, `green`, `blue`, `normal_x` to `normal_z`, `cos_incidence`,
/// `true_x` to `true_z`, `true_range`, `cause`, `bounces`, `velocity_x` to `velocity_z`, `radial_velocity`, `flow_x` to
/// `flow_z`: they describe the strongest contributor of the cell; where nothing scatters, numbers are NaN and labels 0.
/// What concerns only points in `desc` is not used: organised, coordinates, order, boxes, progress.
///
/// On an error in the arguments, an existing list is unchanged; if memory runs out, it is empty.
///
/// Errors: ECHOCAST_E_ARGUMENT (a sensor that is not a sonar, a sonar outside the water, another profile than the
/// physical one), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY (another thread uses the list, or changes the
/// sensor). Any number of threads may ping one snapshot with one sensor, each into its own list.
///
/// ```c
/// echocast_pose_key towed = {0, ECHOCAST_POSE_IDENTITY};
/// towed.pose.m[11] = -3;
/// echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
/// desc.sensor = sensor;
/// desc.poses = &towed;
/// desc.pose_count = 1;
/// desc.columns = "intensity,category_id";
/// echocast_pings *pings = NULL;
/// echocast_ping(snapshot, &desc, &pings);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_ping(
    snapshot: *const echocast_snapshot,
    desc: *const echocast_scan_desc,
    io: *mut *mut echocast_pings,
) -> echocast_status {
    guard(|| {
        let snapshot = handle::get(snapshot, "snapshot")?;
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        let sensor = handle::get(desc.sensor, "desc->sensor")?;
        snapshot.0.check(&sensor.0, "desc->sensor")?;
        let sensor = handle::read(&sensor.1, "desc->sensor")?;
        let made = |pings: &mut PingList| {
            pings.sent(|inputs, ping| {
                // SAFETY: the arrays and strings of `desc` are as `text` describes.
                unsafe {
                    inputs.with(&desc, &sensor, |trajectory, options| {
                        snapshot.1.ping_into(&sensor, trajectory, options, ping)
                    })
                }
            })
        };
        // SAFETY: `io` is a handle slot (see `text`).
        unsafe { fill(io, &snapshot.0, made) }
    })
}

/// Runs `look` on the pings while no thread changes them.
pub(crate) fn look<T>(pings: *const echocast_pings, look: impl FnOnce(&PingList) -> Outcome<T>) -> Outcome<T> {
    let pings = handle::get(pings, "pings")?;
    look(&*handle::read(&pings, "pings")?)
}

/// The number of pings: 1, or more after echocast_pings_append; 0 for an invalid handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_count(pings: *const echocast_pings) -> usize {
    guard_or(0, || look(pings, |pings| Ok(pings.pings.all().len())))
}

/// Beams to the sides: waterfall and mosaic.
pub const ECHOCAST_SONAR_SIDESCAN: i32 = 0;
/// Beams side by side, down: bathymetry and the image of the water column.
pub const ECHOCAST_SONAR_SWATH: i32 = 1;
/// Beams side by side, ahead: fan.
pub const ECHOCAST_SONAR_FAN: i32 = 2;
/// One beam.
pub const ECHOCAST_SONAR_SINGLE: i32 = 3;
/// Like ECHOCAST_SONAR_SIDESCAN: the four beams of a Doppler velocity log, down and outwards.
pub const ECHOCAST_SONAR_JANUS: i32 = 4;

/// Time and pose of a ping and its layout; ECHOCAST_PING_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_ping_info {
    /// sizeof(echocast_ping_info).
    pub struct_size: usize,
    /// Number of the ping: scan_desc.frame.
    pub number: u32,
    /// Arrangement of the beams: an ECHOCAST_SONAR_ number.
    pub view: i32,
    /// Time of transmission, ns. Times since 1970 are rounded to 0.2 microseconds.
    pub t_ns: i64,
    /// Pose of the sonar in the world at that time, including the rotation of a rotating beam.
    pub sensor_pose: echocast_pose,
    /// World position, metres, that the columns true_x, true_y, true_z are relative to.
    pub origin: [f64; 3],
    /// Number of beams.
    pub beams: u32,
    /// Range bins of a beam. A ping has beams * bins cells; the index of a cell is beam * bins + bin.
    pub bins: u32,
    /// Length of a bin, metres of reported slant range: bin k reaches from k * bin_m to (k + 1) * bin_m.
    pub bin_m: f64,
    /// Sound speed that reported ranges assume, m/s.
    pub sound_speed: f64,
    /// First bin that reports echoes: earlier ones are below the minimum range.
    pub first_bin: u32,
    /// Noise level in a cell, dB re 1 uPa.
    pub noise_db: f32,
    /// Reported azimuth and elevation of the axis of each beam, interleaved, rad, sensor frame: 2 * beams numbers. This
    /// and the following arrays are in place, like columns.
    pub axes: *const f32,
    /// Lowest level that is reported as an echo, for each bin, dB re 1 uPa.
    pub threshold_db: *const f32,
    /// Time-varied gain that pictures are drawn with, for each bin, dB; levels do not include it.
    pub tvg_db: *const f32,
}

impl Default for echocast_ping_info {
    fn default() -> Self {
        echocast_ping_info {
            struct_size: size_of::<Self>(),
            number: 0,
            view: ECHOCAST_SONAR_SIDESCAN,
            t_ns: 0,
            sensor_pose: echocast_pose::IDENTITY,
            origin: [0.0; 3],
            beams: 0,
            bins: 0,
            bin_m: 0.0,
            sound_speed: 0.0,
            first_bin: 0,
            noise_db: 0.0,
            axes: ptr::null(),
            threshold_db: ptr::null(),
            tvg_db: ptr::null(),
        }
    }
}

text::versioned!(echocast_ping_info {
    struct_size,
    number,
    view,
    t_ns,
    sensor_pose,
    origin,
    beams,
    bins,
    bin_m,
    sound_speed,
    first_bin,
    noise_db,
    axes,
    threshold_db,
    tvg_db,
});

/// Gets information on a ping, counted from 0. The caller sets struct_size of `*info`; what it points to is valid until
/// the list is used for another ping or released.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
/// echocast_pings_get_info(pings, 0, &info);
/// for (uint32_t beam = 0; beam < info.beams; ++beam)
///     printf("azimuth %g, elevation %g\n", info.axes[2 * beam], info.axes[2 * beam + 1]);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_get_info(
    pings: *const echocast_pings,
    ping: usize,
    info: *mut echocast_ping_info,
) -> echocast_status {
    guard(|| {
        look(pings, |pings| {
            let ping = numbered(pings.pings.all(), ping, "ping")?;
            let layout = ping.layout();
            let found = echocast_ping_info {
                number: ping.number,
                view: match layout.view {
                    SonarView::Sidescan => ECHOCAST_SONAR_SIDESCAN,
                    SonarView::Swath => ECHOCAST_SONAR_SWATH,
                    SonarView::Fan => ECHOCAST_SONAR_FAN,
                    SonarView::Single => ECHOCAST_SONAR_SINGLE,
                    SonarView::Janus => ECHOCAST_SONAR_JANUS,
                },
                t_ns: nanoseconds(ping.time),
                sensor_pose: echocast_pose::of(&ping.pose),
                origin: ping.origin.to_array(),
                beams: layout.beams() as u32,
                bins: layout.bins as u32,
                bin_m: layout.bin_m,
                sound_speed: layout.believed_speed,
                first_bin: layout.first_bin as u32,
                noise_db: layout.noise_db,
                axes: layout.axes.as_flattened().as_ptr(),
                threshold_db: layout.threshold_db.as_ptr(),
                tvg_db: layout.tvg_db.as_ptr(),
                ..echocast_ping_info::default()
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Gives access to a column of a ping, counted from 0, without copying it: beams * bins numbers, beam by beam.
/// `column`: "intensity" for the levels, dB re 1 uPa, as ECHOCAST_TYPE_F32, or another requested one. The view is valid
/// until the list is used for another ping or released.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such ping; no such column, or one that was not computed), ECHOCAST_E_HANDLE,
/// ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_view view;
/// echocast_pings_view(pings, 0, "intensity", &view);
/// const float *level = view.data;
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_view(
    pings: *const echocast_pings,
    ping: usize,
    column: *const c_char,
    out: *mut echocast_view,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(echocast_view::NONE);
        // SAFETY: `column` is a string (see `text`).
        let name = unsafe { text::required(column, "column") }?;
        look(pings, |pings| {
            let ping = numbered(pings.pings.all(), ping, "ping")?;
            *out = echocast_view::of(&ping.column(computed(ping.fields(), name)?));
            Ok(())
        })
    })
}

/// An echo that a sonar reports as the depth of a beam.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_sounding {
    /// Beam that received it.
    pub beam: u32,
    /// Cell at that range, or the nearest one with an echo: beam * bins + bin.
    pub cell: u32,
    /// Reported slant range.
    pub range: f32,
    /// Level of the strongest cell of the echo, dB re 1 uPa.
    pub level_db: f32,
    /// Confidence, 0 to 1; 0.5 for a standard error of 0.25 % of the range.
    pub quality: f32,
    /// Position by a ray traced through the assumed sound speed cast, relative to the origin of the ping; NaN where
    /// that ray leaves the water.
    pub corrected: [f32; 3],
}

impl echocast_sounding {
    fn of(found: &Sounding) -> echocast_sounding {
        let &Sounding { beam, cell, range, level_db, quality, corrected, .. } = found;
        echocast_sounding { beam, cell, range, level_db, quality, corrected: corrected.to_array() }
    }
}

/// The soundings of a ping, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT
/// steps by the stride.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_sounding_view {
    /// The first; NULL if there are none.
    pub data: *const echocast_sounding,
    /// Number of soundings.
    pub count: usize,
    /// Bytes from one to the next.
    pub stride: usize,
}

/// Gives access to the soundings of a ping, counted from 0, in place, in the order of beams; none for side-scan and
/// imaging sonars. The view is valid until the list is used for another ping, appended to or released.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_sounding_view depths;
/// echocast_pings_soundings(pings, 0, &depths);
/// for (size_t i = 0; i < depths.count; ++i)
///     printf("%g m\n", ECHOCAST_AT(echocast_sounding, depths, i)->range);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_soundings(
    pings: *const echocast_pings,
    ping: usize,
    out: *mut echocast_sounding_view,
) -> echocast_status {
    guard(|| {
        let none = echocast_sounding_view { data: ptr::null(), count: 0, stride: size_of::<echocast_sounding>() };
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(none);
        look(pings, |pings| {
            let found = numbered(&pings.soundings, ping, "ping")?;
            if let Some(first) = found.first() {
                *out = echocast_sounding_view { data: first, count: found.len(), ..none };
            }
            Ok(())
        })
    })
}

/// Writes the cells of a ping, counted from 0, as an image in the host's layout: a row for each range bin, the nearest
/// first, in it a pixel of `stride` bytes for each beam, and in a pixel each column converted to its type at its
/// offset. Sonar images in ROS have this layout; the columns of a ping are its transpose. Numbers are converted as in
/// echocast_result_pack, and the other arguments are the same; `*needed` is stride * beams * bins.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such ping, a wrong item, too little room), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// // 8 bits of grey: 0 at the level of the noise, 255 from 60 dB above it on.
/// echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
/// echocast_pings_get_info(pings, 0, &info);
/// const echocast_pack_item grey = {"intensity", ECHOCAST_TYPE_U8, 0, info.noise_db, 255 / 60.0};
/// echocast_pings_pack(pings, 0, &grey, 1, 1, bytes, sizeof bytes, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_pack(
    pings: *const echocast_pings,
    ping: usize,
    items: *const echocast_pack_item,
    item_count: usize,
    stride: usize,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let to = Packing { items, item_count, stride, to, capacity, needed };
        look(pings, |pings| {
            let ping = numbered(pings.pings.all(), ping, "ping")?;
            let pack =
                |items: &[PackItem], to: &mut [u8]| pings.context.engine.install(|| ping.pack(items, stride, to));
            // SAFETY: `items` is an array, `to` a buffer and `needed` an output (see `text`).
            unsafe { to.fill(ping.fields(), ping.packed_len(stride), pack) }
        })
    })
}

/// The name of a label number. `table`: "category", "part", "material" or "instance". NULL if it has none.
///
/// Valid until the list is used for another ping or released.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_label_name(
    pings: *const echocast_pings,
    table: *const c_char,
    number: u32,
) -> *const c_char {
    guard_or(ptr::null(), || {
        // SAFETY: `table` is a string (see `text`).
        let table = unsafe { text::required(table, "table") }?;
        look(pings, |pings| {
            let mut names = pings.names.lock().unwrap_or_else(PoisonError::into_inner);
            names.get(&numbered(pings.pings.all(), 0, "ping")?.labels, table, number)
        })
    })
}

/// Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
/// with the name counts.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_label_number(
    pings: *const echocast_pings,
    table: *const c_char,
    name: *const c_char,
    number: *mut u32,
) -> echocast_status {
    let with_labels = |put: &mut dyn FnMut(&echocast::scene::Labels) -> Outcome| {
        look(pings, |pings| put(&numbered(pings.pings.all(), 0, "ping")?.labels))
    };
    // SAFETY: `table` and `name` are strings and `number` an output (see `text`).
    unsafe { put_label_number(table, name, number, with_labels) }
}

/// Appends copies of other pings of the same sonar and scene with the same columns, to be written to one file, or shown
/// in one image.
///
/// Errors: ECHOCAST_E_ARGUMENT (pings that do not fit), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; nothing is then appended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_append(
    pings: *mut echocast_pings,
    other: *const echocast_pings,
) -> echocast_status {
    guard(|| {
        let (pings, other) = (handle::get(pings, "pings")?, handle::get(other, "other")?);
        if Arc::ptr_eq(&pings, &other) {
            return Err(Failure::argument("other", "the same list of pings", "another one"));
        }
        let mut pings = handle::write(&pings, "pings")?;
        // Those of one list fit together: if the first one fits, all do.
        for ping in handle::read(&other, "other")?.pings.all() {
            pings.pings.push(ping.clone())?;
        }
        pings.changed();
        Ok(())
    })
}

/// Coordinates of the pixels of an image: the centre of the pixel in column c and row r is first + {c, r} * step.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_image_place {
    /// Centre of the top left pixel: in a fan, metres to the right of the sonar and ahead of it (for a swath sonar,
    /// above it); on a track, x, y in the world; in a waterfall, metres across track (starboard is positive) and the
    /// index of the ping.
    pub first: [f64; 2],
    /// Step from column to column, and from row to row.
    pub step: [f64; 2],
}

/// Gives access to the pixels of a picture of all pings, in place. `options`: YAML with `view`: "fan" shows the last
/// ping of an imaging or swath sonar, or all pings of a rotating beam, by beam and range; "waterfall" has a row for
/// each ping; "track" is their map, for a swath sonar the map of its depths; also `width` (1600), 320 to 4096 pixels,
/// and `ground` (false), whether a waterfall shows ground range. `layer`: "values", levels with the sonar's time-varied
/// gain, dB re 1 uPa, or on the map of depths heights, metres, NaN where there is no data, as ECHOCAST_TYPE_F32; or a
/// label column of the pings, such as "category_id", 0 where there is no data, as ECHOCAST_TYPE_U32. `place` may be
/// NULL. Each picture is made when it is first requested; the view is valid until the list is used for another ping,
/// appended to or released.
///
/// Errors: ECHOCAST_E_ARGUMENT (a view that this sonar does not have, no such layer), ECHOCAST_E_PARSE,
/// ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_image_view pixels;
/// echocast_image_place place;
/// echocast_pings_image(pings, "{view: fan, width: 800}", "values", &pixels, &place);
/// printf("%u x %u pixels of %g m\n", (unsigned)pixels.width, (unsigned)pixels.height, place.step[0]);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_image(
    pings: *const echocast_pings,
    options: *const c_char,
    layer: *const c_char,
    out: *mut echocast_image_view,
    place: *mut echocast_image_place,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(echocast_image_view::NONE);
        // SAFETY: `options` and `layer` are strings (see `text`).
        let (options, layer) = unsafe { (text::required(options, "options")?, text::required(layer, "layer")?) };
        look(pings, |pings| {
            // A picture that a panic left half made has not been added.
            let mut images = pings.images.lock().unwrap_or_else(PoisonError::into_inner);
            let made = match images.iter().position(|(requested, _)| requested == options) {
                Some(made) => made,
                None => {
                    let requested = PreviewOptions::from_yaml(options)?;
                    let image = pings.context.engine.install(|| preview::image_of(&pings.pings, &requested))?;
                    images.push((options.to_owned(), image));
                    images.len() - 1
                }
            };
            let image = &images[made].1;
            let (data, kind) = pixels(image, layer)?;
            *out = echocast_image_view {
                data,
                row_stride: image.width * 4,
                width: image.width as u32,
                height: image.height as u32,
                channels: 1,
                kind,
            };
            if !place.is_null() {
                let Place { first, step, .. } = image.place;
                // SAFETY: `place` is an output (see `text`).
                unsafe { text::output(place, "place") }?.write(echocast_image_place { first, step });
            }
            Ok(())
        })
    })
}

/// The pixels of a layer, 4 bytes each, and their type.
fn pixels(image: &Image, layer: &str) -> Outcome<(*const c_void, i32)> {
    if layer == "values" {
        return Ok((image.values.as_ptr().cast(), ECHOCAST_TYPE_F32));
    }
    let labels = Field::from_name(layer).ok().and_then(|field| image.layer(field));
    let Some(ids) = labels else {
        let names = image.layers.iter().map(|layer| layer.field.info().name);
        let has: Vec<&str> = ["values"].into_iter().chain(names).collect();
        return Err(Failure::argument("layer", format!("{layer:?}"), &has.join(", ")));
    };
    Ok((ids.as_ptr().cast(), ECHOCAST_TYPE_U32))
}

/// Releases a list of pings. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pings_release(pings: *mut echocast_pings) {
    guard(|| {
        handle::release(pings);
        Ok(())
    });
}
