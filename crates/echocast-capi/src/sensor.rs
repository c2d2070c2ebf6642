//! Sensors.

use crate::context::{Context, echocast_context};
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::text;
use crate::time::{nanoseconds, seconds};
use echocast::Sensor;
use echocast::emitter::{BeamTable, FiringOrder};
use std::ffi::c_char;
use std::ptr;
use std::sync::{Arc, RwLock};

/// An instrument: its beams, its detection and its errors. Any number of threads may scan with it; only one at a time
/// may change it.
pub struct echocast_sensor(());

handles! {
    echocast_sensor: (Arc<Context>, RwLock<Arc<Sensor>>), "sensor", 6;
}

/// A beam of a sensor: a ray with its own origin, direction and time.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_beam {
    /// Time of its firing since the start of the scan, ns.
    pub t_ns: i64,
    /// Direction in the sensor frame, of length 1: x forward, y left, z up.
    pub direction: [f32; 3],
    /// Nearest range that is reported, metres.
    pub range_min_m: f32,
    /// Farthest range that is reported, metres; 0 for the sensor's own limit only.
    pub range_max_m: f32,
    /// Emitter index, 0 to 65535.
    pub channel: u32,
    /// Where it starts in the sensor frame, metres; its ranges count from there. 0 for the origin of the frame.
    pub origin: [f32; 3],
    /// 0.
    pub reserved: u32,
}

/// Every beam is its own firing.
pub const ECHOCAST_FIRING_BEAMS: i32 = 0;
/// All beams of a column belong to one firing.
pub const ECHOCAST_FIRING_COLUMNS: i32 = 1;
/// All beams belong to one firing.
pub const ECHOCAST_FIRING_FRAME: i32 = 2;

/// The shape of a sensor; ECHOCAST_SENSOR_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_sensor_info {
    /// sizeof(echocast_sensor_info).
    pub struct_size: usize,
    /// Rows of its range image: channels of a spinning sensor, pixel rows of a camera, 1 for a sonar.
    pub rows: u32,
    /// Columns of its range image. The sensor has rows * columns beams; the index of a beam is row * columns + column.
    pub columns: u32,
    /// Time from the start of one scan to the start of the next, ns.
    pub period_ns: i64,
    /// Width of the images that echocast_result_image makes of its scans, pixels; 0 if it makes none.
    pub image_width: u32,
    /// Height of these images, pixels.
    pub image_height: u32,
    /// Focal lengths of a camera along columns and rows, pixels; 0 for other sensors.
    pub focal: [f64; 2],
    /// Principal point of a camera, column and row; whole numbers are pixel centres, as in OpenCV.
    pub centre: [f64; 2],
    /// The ROS 2 driver of its maker, which defines the numbers of rings: an ECHOCAST_DRIVER_ number; 0 if unknown.
    pub driver: i32,
    /// 0.
    pub reserved: i32,
}

impl Default for echocast_sensor_info {
    fn default() -> Self {
        echocast_sensor_info {
            struct_size: size_of::<Self>(),
            rows: 0,
            columns: 0,
            period_ns: 0,
            image_width: 0,
            image_height: 0,
            focal: [0.0; 2],
            centre: [0.0; 2],
            driver: 0,
            reserved: 0,
        }
    }
}

text::versioned!(echocast_sensor_info {
    struct_size,
    rows,
    columns,
    period_ns,
    image_width,
    image_height,
    focal,
    centre,
    driver,
    reserved,
});

/// Creates a sensor. `sensor`: the name of a preset ("velodyne_vlp32c", see echocast_name) or the path of a sensor
/// file.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such preset; similar names are listed), ECHOCAST_E_IO, ECHOCAST_E_PARSE (file, line,
/// key). Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_create(
    context: *const echocast_context,
    sensor: *const c_char,
    out: *mut *mut echocast_sensor,
) -> echocast_status {
    create(context, out, || {
        // SAFETY: `sensor` is a string (see `text`).
        let name = unsafe { text::path(sensor, "sensor") }?;
        Ok(Sensor::open(name)?)
    })
}

/// Creates a sensor from YAML text with the contents of a sensor file. `folder`: the folder that paths in it are
/// relative to; NULL for the working folder.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO, ECHOCAST_E_PARSE (line and key). Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_from_text(
    context: *const echocast_context,
    yaml: *const c_char,
    folder: *const c_char,
    out: *mut *mut echocast_sensor,
) -> echocast_status {
    create(context, out, || {
        // SAFETY: `yaml` and `folder` are strings (see `text`).
        let (yaml, folder) = unsafe { (text::required(yaml, "yaml")?, text::optional_path(folder, "folder")?) };
        Ok(Sensor::from_yaml(yaml, folder)?)
    })
}

/// A sensor made of beams; ECHOCAST_BEAMS_DESC_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_beams_desc {
    /// sizeof(echocast_beams_desc).
    pub struct_size: usize,
    /// Name.
    pub name: *const c_char,
    /// rows * columns beams, row by row. Neighbours in a row should be neighbours in angle: scans are then several
    /// times as fast.
    pub beams: *const echocast_beam,
    /// Rows of its range image.
    pub rows: u32,
    /// Columns of its range image.
    pub columns: u32,
    /// Time from the start of one scan to the start of the next, ns, above 0.
    pub period_ns: i64,
    /// How beams are grouped into firings: an ECHOCAST_FIRING_ number.
    pub firing: i32,
    /// 0.
    pub reserved: i32,
}

impl Default for echocast_beams_desc {
    fn default() -> Self {
        echocast_beams_desc {
            struct_size: size_of::<Self>(),
            name: ptr::null(),
            beams: ptr::null(),
            rows: 0,
            columns: 0,
            period_ns: 0,
            firing: ECHOCAST_FIRING_BEAMS,
            reserved: 0,
        }
    }
}

text::versioned!(echocast_beams_desc { struct_size, name, beams, rows, columns, period_ns, firing, reserved });

/// Creates an ideal lidar from beams, each a ray with its own origin and time: no noise, no threshold, no range limits
/// other than those of the beams; echocast_sensor_set adds them. Rays without rows and columns form 1 row of many
/// columns.
///
/// Errors: ECHOCAST_E_ARGUMENT (the beam that is wrong), ECHOCAST_E_MEMORY. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_from_beams(
    context: *const echocast_context,
    desc: *const echocast_beams_desc,
    out: *mut *mut echocast_sensor,
) -> echocast_status {
    create(context, out, || {
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        // SAFETY: `desc.name` is a string (see `text`).
        let name = unsafe { text::required(desc.name, "desc->name") }?;
        if desc.reserved != 0 {
            return Err(Failure::argument("desc->reserved", desc.reserved, "0"));
        }
        // The product of two 32-bit numbers does not overflow; an array of too many elements is refused.
        let count = desc.rows as usize * desc.columns as usize;
        // SAFETY: `desc.beams` is an array (see `text`).
        let beams = unsafe { text::array(desc.beams, count, "desc->beams") }?;
        Ok(Sensor::from_beams(name, table(&desc, beams)?)?)
    })
}

fn create(
    context: *const echocast_context,
    out: *mut *mut echocast_sensor,
    make: impl FnOnce() -> Outcome<Sensor>,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        *out = handle::create((context, RwLock::new(Arc::new(make()?))))?;
        Ok(())
    })
}

fn table(desc: &echocast_beams_desc, beams: &[echocast_beam]) -> Outcome<BeamTable> {
    let firing_order = match desc.firing {
        ECHOCAST_FIRING_BEAMS => FiringOrder::Beams,
        ECHOCAST_FIRING_COLUMNS => FiringOrder::Columns,
        ECHOCAST_FIRING_FRAME => FiringOrder::Frame,
        other => return Err(Failure::argument("desc->firing", other, "0 to 2, an ECHOCAST_FIRING_ number")),
    };
    if let Some(number) = beams.iter().position(|beam| beam.channel > u32::from(u16::MAX)) {
        let name = format!("desc->beams[{number}].channel");
        return Err(Failure::argument(&name, beams[number].channel, "0 to 65535"));
    }
    if let Some(number) = beams.iter().position(|beam| beam.reserved != 0) {
        return Err(Failure::argument(&format!("desc->beams[{number}].reserved"), "not 0", "0"));
    }
    let limited = |limit: fn(&echocast_beam) -> f32| beams.iter().any(|beam| limit(beam) != 0.0);
    let far = |beam: &echocast_beam| if beam.range_max_m == 0.0 { f32::INFINITY } else { beam.range_max_m };
    let mut table = BeamTable::default();
    (table.rows, table.columns) = (desc.rows, desc.columns);
    (table.firing_order, table.period) = (firing_order, seconds(desc.period_ns));
    table.dir_x = column(beams, |beam| beam.direction[0])?;
    table.dir_y = column(beams, |beam| beam.direction[1])?;
    table.dir_z = column(beams, |beam| beam.direction[2])?;
    table.time = column(beams, |beam| seconds(beam.t_ns))?;
    table.channel = column(beams, |beam| beam.channel as u16)?;
    if limited(|beam| beam.range_min_m) {
        table.range_min = column(beams, |beam| beam.range_min_m)?;
    }
    if limited(|beam| beam.range_max_m) {
        table.range_max = column(beams, far)?;
    }
    if beams.iter().any(|beam| beam.origin != [0.0; 3]) {
        for (axis, values) in table.origin.iter_mut().enumerate() {
            *values = column(beams, |beam| beam.origin[axis])?;
        }
    }
    Ok(table)
}

fn column<T>(beams: &[echocast_beam], of: impl Fn(&echocast_beam) -> T) -> Outcome<Vec<T>> {
    text::collect(beams.iter().map(of), beams.len(), "desc->beams")
}

fn look<T>(sensor: *const echocast_sensor, look: impl FnOnce(&Sensor) -> Outcome<T>) -> Outcome<T> {
    let sensor = handle::get(sensor, "sensor")?;
    look(&*handle::read(&sensor.1, "sensor")?)
}

/// Changes a parameter: `key` is its path in the sensor file ("noise.range_sigma_m"), `value` YAML: a number, a word, a
/// list or a whole section; "null" removes an optional one.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_PARSE (key, what was found, what is allowed), ECHOCAST_E_BUSY (a scan is
/// using the sensor); the sensor is then unchanged.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_set(
    sensor: *mut echocast_sensor,
    key: *const c_char,
    value: *const c_char,
) -> echocast_status {
    guard(|| {
        // SAFETY: `key` and `value` are strings (see `text`).
        let (key, value) = unsafe { (text::required(key, "key")?, text::required(value, "value")?) };
        let sensor = handle::get(sensor, "sensor")?;
        let mut sensor = handle::write(&sensor.1, "sensor")?;
        // Results keep the sensor that they were made with.
        Ok(Arc::make_mut(&mut sensor).set(key, value)?)
    })
}

/// Reads a numeric parameter with the lowest and highest allowed value (infinite if unbounded). `value`, `min` and
/// `max` may each be NULL.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such key, or not a number), ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_get(
    sensor: *const echocast_sensor,
    key: *const c_char,
    value: *mut f64,
    min: *mut f64,
    max: *mut f64,
) -> echocast_status {
    guard(|| {
        // SAFETY: `key` is a string (see `text`).
        let key = unsafe { text::required(key, "key") }?;
        let found = look(sensor, |sensor| Ok(sensor.parameter(key)?))?;
        for (to, name, number) in [(value, "value", found.value), (min, "min", found.min), (max, "max", found.max)] {
            if !to.is_null() {
                // SAFETY: `to` is an output (see `text`).
                unsafe { text::output(to, name) }?.write(number);
            }
        }
        Ok(())
    })
}

/// Writes the sensor as YAML, every key that has a value, to `yaml`, which has room for `capacity` bytes; longer text
/// is cut off. `*needed`: bytes of the whole text, including the 0 at its end. One of `yaml` and `needed` may be NULL.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_describe(
    sensor: *const echocast_sensor,
    yaml: *mut c_char,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let described = look(sensor, |sensor| Ok(sensor.to_yaml()?))?;
        // SAFETY: `yaml` is a buffer and `needed` an output (see `text`).
        unsafe { text::put(&described, yaml, capacity, needed) }
    })
}

/// Gets the shape of a sensor. The caller sets struct_size of `*info`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_get_info(
    sensor: *const echocast_sensor,
    info: *mut echocast_sensor_info,
) -> echocast_status {
    guard(|| {
        look(sensor, |sensor| {
            let beams = sensor.beams();
            let mut found = echocast_sensor_info {
                rows: beams.rows,
                columns: beams.columns,
                period_ns: nanoseconds(beams.period),
                driver: crate::driver::number_of(sensor.driver()),
                ..echocast_sensor_info::default()
            };
            if let Ok(grid) = sensor.image_grid() {
                (found.image_width, found.image_height) = (grid.width as u32, grid.height as u32);
                if let Some(lens) = grid.intrinsics {
                    (found.focal, found.centre) = (lens.focal, lens.centre);
                }
            }
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Writes beams `first` to `first + count - 1` to `beams`, to inspect the pattern.
///
/// Errors: ECHOCAST_E_ARGUMENT (more than there are), ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_get_beams(
    sensor: *const echocast_sensor,
    first: usize,
    count: usize,
    beams: *mut echocast_beam,
) -> echocast_status {
    guard(|| {
        look(sensor, |sensor| {
            let table = sensor.beams();
            if first.checked_add(count).is_none_or(|end| end > table.len()) {
                let found = format!("{first} + {count}");
                return Err(Failure::argument(
                    "first + count",
                    found,
                    &format!("up to the {} beams there are", table.len()),
                ));
            }
            if count > 0 {
                text::check_array(beams, count, "beams")?;
            }
            for (to, beam) in (first..first + count).enumerate() {
                let described = echocast_beam {
                    t_ns: nanoseconds(table.time[beam]),
                    direction: [table.dir_x[beam], table.dir_y[beam], table.dir_z[beam]],
                    range_min_m: table.range_min.get(beam).copied().unwrap_or(0.0),
                    range_max_m: table.range_max.get(beam).copied().filter(|far| far.is_finite()).unwrap_or(0.0),
                    channel: table.channel[beam].into(),
                    origin: table.origin.each_ref().map(|axis| axis.get(beam).copied().unwrap_or(0.0)),
                    reserved: 0,
                };
                // SAFETY: `beams` is an array with room for `count` elements (see `text`); its pointer was checked.
                unsafe { beams.add(to).write(described) };
            }
            Ok(())
        })
    })
}

/// Releases a sensor. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_sensor_release(sensor: *mut echocast_sensor) {
    guard(|| {
        handle::release(sensor);
        Ok(())
    });
}
