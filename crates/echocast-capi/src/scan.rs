//! Scans.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle;
use crate::pose::{ECHOCAST_COORDINATES_WORLD, echocast_pose_key};
use crate::result::{ResultPoints, echocast_result};
use crate::reuse::{Inputs, fill};
use crate::scene::echocast_snapshot;
use crate::sensor::echocast_sensor;
use crate::text;
use crate::time::{optional_seconds, seconds};
use echocast::{BoxAxes, BoxTime, BuiltScene, FieldSet, Named, ScanOptions, Sensor, Trajectory};
use std::ffi::{c_char, c_void};
use std::ops::ControlFlow;
use std::{mem, ptr};

/// Points are in order of rising beam.
pub const ECHOCAST_ORDER_BEAM: i32 = 0;
/// Points are in order of rising time.
pub const ECHOCAST_ORDER_TIME: i32 = 1;

/// The physical models.
pub const ECHOCAST_PROFILE_PHYSICAL: i32 = 0;
/// The equations of the paper as printed.
pub const ECHOCAST_PROFILE_PAPER: i32 = 1;
/// The equations as computed by the paper's program.
pub const ECHOCAST_PROFILE_BLAINDER: i32 = 2;

/// As the profile defines.
pub const ECHOCAST_REFLECTANCE_DEFAULT: i32 = 0;
/// Surfaces without a given reflectance use the luminance of their linear base colour, whatever the wavelength.
pub const ECHOCAST_REFLECTANCE_LUMINANCE: i32 = 1;
/// Surfaces without a given reflectance use the alpha of their base colour.
pub const ECHOCAST_REFLECTANCE_ALPHA: i32 = 2;
/// Surfaces without a given reflectance use that of the library material that their name suggests; else an estimate
/// from their base colour for the wavelength. The physical profile's default.
pub const ECHOCAST_REFLECTANCE_LIBRARY: i32 = 3;

/// No boxes.
pub const ECHOCAST_BOXES_NONE: i32 = 0;
/// Boxes along the axes of each object, z up as it was modelled.
pub const ECHOCAST_BOXES_OBJECT: i32 = 1;
/// Boxes along the axes of the frame of the points.
pub const ECHOCAST_BOXES_FRAME: i32 = 2;

/// Boxes are valid for the time at which their objects are scanned: the mean time of the points on each, without points
/// the middle of the scan. With scan_desc.deskew, which brings points to the start of the scan: the start.
pub const ECHOCAST_BOX_TIME_SCAN: i32 = 0;
/// Boxes are valid for the start of the scan.
pub const ECHOCAST_BOX_TIME_START: i32 = 1;
/// Boxes are valid for the time at which the last beam of the scan fires.
pub const ECHOCAST_BOX_TIME_END: i32 = 2;

/// Progress callback: receives the fraction of the work that is done, 0 to 1; returning anything but 0 ends the scan,
/// unless it is complete. Called on the scanning thread, every 2048 beams of each thread; not for sonars. It must not
/// throw, and the result is in use during the call.
pub type echocast_progress_fn = Option<unsafe extern "C" fn(user: *mut c_void, fraction: f64) -> i32>;

/// Options of a scan; ECHOCAST_SCAN_DESC_INIT has the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_scan_desc {
    /// sizeof(echocast_scan_desc).
    pub struct_size: usize,
    /// The sensor to scan with.
    pub sensor: *const echocast_sensor,
    /// Where the sensor is: one pose, or several at rising times, between which it moves uniformly and rotates the
    /// shorter way; before the first and after the last it stands still. Each beam is cast from the pose at the time of
    /// its own firing.
    pub poses: *const echocast_pose_key,
    /// Number of poses, 1 or more.
    pub pose_count: usize,
    /// Start time of the scan, ns, from the same zero as the times of the poses. The column `time` counts from this
    /// zero too, in seconds: there, times since 1970 are rounded to 0.2 microseconds.
    pub t0_ns: i64,
    /// Seed of all random draws: equal seeds, frames and inputs give equal bits, for any number of threads.
    pub seed: u64,
    /// Index of the frame; it changes the random draws and fills the column `frame`.
    pub frame: u32,
    /// Instances whose mask shares a bit with this are seen.
    pub mask: u32,
    /// Columns to compute: comma-separated names ("x,y,z,range,category_id"), "all", or NULL for the default columns
    /// ("default" in a list), which include `doppler` if the sensor measures it.
    pub columns: *const c_char,
    /// 1: every beam has a row, with NaN or 0 if it has no return. 0: only returns have rows.
    pub organised: i32,
    /// Frame of the points: an ECHOCAST_COORDINATES_ number.
    pub coordinates: i32,
    /// Order of the points: an ECHOCAST_ORDER_ number.
    pub order: i32,
    /// Which models are used: an ECHOCAST_PROFILE_ number.
    pub profile: i32,
    /// Source of the reflectance where no material gives one: an ECHOCAST_REFLECTANCE_ number.
    pub reflectance: i32,
    /// 0.
    pub reserved: i32,
    /// Receives the progress of the scan and may end it; may be NULL.
    pub progress: echocast_progress_fn,
    /// First argument of `progress`.
    pub progress_user: *mut c_void,
    /// Weather, and for sonars the water, as YAML with the keys of a scenario's section `environment` ("{rain:
    /// {rate_mm_h: 10}}", "{water: {temperature_c: 8}}"), or NULL: clear air, and for sonars the sea below z =
    /// 0. A text that is the same as in the result's last scan is not parsed again.
    pub environment: *const c_char,
    /// 1: what moves stands still during the scan, where it is at t0_ns. 0: every beam hits it where it is at the
    /// beam's own time.
    pub freeze: i32,
    /// 0.
    pub reserved_2: i32,
    /// Time from one frame to the next, ns, over which the columns `flow_x` to `flow_z` are measured; 0: the sensor's
    /// period.
    pub frame_period_ns: i64,
    /// Boxes around the labelled instances, for echocast_result_boxes: an ECHOCAST_BOXES_ number. All beams are then
    /// traced once more.
    pub boxes: i32,
    /// 1: the boxes also have their extent in the image of the sensor, including what is hidden, which takes a pass
    /// over every triangle: the amodal boxes of echocast_result_image_boxes.
    pub image_boxes: i32,
    /// Time for which boxes are valid: an ECHOCAST_BOX_TIME_ number. For programs compiled before this field existed it
    /// is the start, as was documented then.
    pub box_time: i32,
    /// 1: positions and normals are brought to t0_ns: what moves is where it was then, with all points on it, and
    /// ECHOCAST_COORDINATES_SENSOR is the sensor frame at that time. The other columns, including `true_x`, `true_y`
    /// and `true_z`, are as of the firing of the beam. Not for sonars.
    pub deskew: i32,
    /// Wall-clock time that the scan may take, ns; 0: no limit. Beams of as many rays as it takes (beam.sub_rays:
    /// adaptive) get no more than fit into it, at least one, as found by scanning a few beams first; most_rays of
    /// echocast_result_info is how many. Other sensors take what they take.
    pub time_budget_ns: i64,
}

impl Default for echocast_scan_desc {
    fn default() -> Self {
        echocast_scan_desc {
            struct_size: size_of::<Self>(),
            sensor: ptr::null(),
            poses: ptr::null(),
            pose_count: 0,
            t0_ns: 0,
            seed: 0,
            frame: 0,
            mask: u32::MAX,
            columns: ptr::null(),
            organised: 0,
            coordinates: ECHOCAST_COORDINATES_WORLD,
            order: ECHOCAST_ORDER_BEAM,
            profile: ECHOCAST_PROFILE_PHYSICAL,
            reflectance: ECHOCAST_REFLECTANCE_DEFAULT,
            reserved: 0,
            progress: None,
            progress_user: ptr::null_mut(),
            environment: ptr::null(),
            freeze: 0,
            reserved_2: 0,
            frame_period_ns: 0,
            boxes: ECHOCAST_BOXES_NONE,
            image_boxes: 0,
            box_time: ECHOCAST_BOX_TIME_SCAN,
            deskew: 0,
            time_budget_ns: 0,
        }
    }
}

text::versioned!(echocast_scan_desc {
    struct_size,
    sensor,
    poses,
    pose_count,
    t0_ns,
    seed,
    frame,
    mask,
    columns,
    organised,
    coordinates,
    order,
    profile,
    reflectance,
    reserved,
    progress,
    progress_user,
    environment,
    freeze,
    reserved_2,
    frame_period_ns,
    boxes,
    image_boxes,
    box_time,
    deskew,
    time_budget_ns,
});

/// Scans once; a sonar sends one ping, whose echoes are the points. `*io`: NULL, which is replaced by a new result, to
/// be released with echocast_result_release; or a result, whose memory is reused: after the first few of their kind,
/// scans in beam order of lidars and depth cameras allocate nothing, whatever the sensor, in any weather and in front
/// of mirrors and glass; with a profile other than the physical one, or with boxes, they allocate some small blocks, a
/// ping of a sonar up to 20.
///
/// Points of a sonar: for multibeam and single-beam sonars the depth of each beam; for side-scan and imaging sonars the
/// range bins with an echo. Their `intensity` is a level in dB re 1 uPa. Sonars must be in the water. echocast_ping
/// gives whole pings.
///
/// On an error in the arguments, an existing result is unchanged; after a cancelled scan, or if memory runs out, it is
/// empty.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_CANCELLED, ECHOCAST_E_BUSY (another
/// thread uses the result, or changes the sensor). Any number of threads may scan one snapshot with one sensor, each
/// with its own result.
///
/// ```c
/// echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
/// echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
/// desc.sensor = sensor;
/// desc.poses = &here;
/// desc.pose_count = 1;
/// echocast_result *result = NULL;
/// echocast_scan(snapshot, &desc, &result);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scan(
    snapshot: *const echocast_snapshot,
    desc: *const echocast_scan_desc,
    io: *mut *mut echocast_result,
) -> echocast_status {
    guard(|| {
        let snapshot = handle::get(snapshot, "snapshot")?;
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        let sensor = handle::get(desc.sensor, "desc->sensor")?;
        snapshot.0.check(&sensor.0, "desc->sensor")?;
        let sensor = handle::read(&sensor.1, "desc->sensor")?;
        let made = |points: &mut ResultPoints| {
            // SAFETY: the arrays and strings of `desc` are as `text` describes.
            points.scanned(&sensor, |points| unsafe { scan(&snapshot.1, &sensor, &desc, points) })
        };
        // SAFETY: `io` is a handle slot (see `text`).
        unsafe { fill(io, &snapshot.0, made) }
    })
}

/// # Safety
/// The arrays and strings of `desc` are as [`text`] describes.
unsafe fn scan(scene: &BuiltScene, sensor: &Sensor, desc: &echocast_scan_desc, points: &mut ResultPoints) -> Outcome {
    let cloud = &mut points.cloud;
    let scan = |trajectory: &Trajectory, options: &ScanOptions| match desc.progress {
        None => scene.scan_into(sensor, trajectory, options, cloud),
        Some(progress) => {
            let user = desc.progress_user;
            let mut on_progress = |fraction: f64| {
                // SAFETY: the header requires that the host's function can be called with its argument on the scanning
                // thread.
                if unsafe { progress(user, fraction) } == 0 {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            };
            scene.scan_with_progress(sensor, trajectory, options, cloud, &mut on_progress)
        }
    };
    // SAFETY: as the caller promises.
    unsafe { points.inputs.with(desc, sensor, scan) }
}

impl Inputs {
    /// Runs `scan` on the trajectory and the options of `desc`.
    ///
    /// # Safety
    /// The arrays and strings of `desc` are as [`text`] describes.
    pub unsafe fn with(
        &mut self,
        desc: &echocast_scan_desc,
        sensor: &Sensor,
        scan: impl FnOnce(&Trajectory, &ScanOptions) -> echocast::Result<()>,
    ) -> Outcome {
        // SAFETY: as the caller promises.
        let mut options = unsafe { scan_options(desc, sensor) }?;
        // SAFETY: as the caller promises.
        self.weather.read(unsafe { text::optional(desc.environment, "desc->environment") }?)?;
        // SAFETY: as the caller promises.
        let poses = unsafe { text::array(desc.poses, desc.pose_count, "desc->poses") }?;
        if poses.is_empty() {
            return Err(Failure::argument("desc->pose_count", 0, "1 or more"));
        }
        let mut keys = mem::take(&mut self.keys);
        keys.clear();
        keys.try_reserve(poses.len())
            .map_err(|_| Failure::new(crate::ECHOCAST_E_MEMORY, format!("no memory for {} poses", poses.len())))?;
        for (number, key) in poses.iter().enumerate() {
            if number > 0 && key.t_ns <= poses[number - 1].t_ns {
                let name = format!("desc->poses[{number}].t_ns");
                let allowed = format!("above that of the pose before it, {}", poses[number - 1].t_ns);
                return Err(Failure::argument(&name, key.t_ns, &allowed));
            }
            let pose = key.pose.rigid("desc->poses[i].pose").map_err(|failure| failure.at("[i]", number))?;
            // Relative to the start of the scan, so that nothing is rounded away, whatever the zero of times.
            let Some(since) = key.t_ns.checked_sub(desc.t0_ns) else {
                let name = format!("desc->poses[{number}].t_ns");
                return Err(Failure::argument(&name, key.t_ns, "less than 292 years from desc->t0_ns"));
            };
            keys.push((seconds(since), pose));
        }
        let trajectory = Trajectory::new(keys)?;
        options.environment = mem::take(&mut self.weather.environment);
        let done = scan(&trajectory, &options);
        self.keys = trajectory.into_keys();
        self.weather.environment = options.environment;
        Ok(done?)
    }
}

/// # Safety
/// The strings of `desc` are as [`text`] describes.
unsafe fn scan_options(desc: &echocast_scan_desc, sensor: &Sensor) -> Outcome<ScanOptions> {
    // SAFETY: as the caller promises.
    let fields = match unsafe { text::optional(desc.columns, "desc->columns") }? {
        None => sensor.default_fields(),
        Some(names) => FieldSet::parse_with(names, sensor.default_fields())?,
    };
    if desc.mask == 0 {
        return Err(Failure::argument("desc->mask", 0, "at least one bit; otherwise nothing would be seen"));
    }
    for (name, reserved) in [("desc->reserved", desc.reserved), ("desc->reserved_2", desc.reserved_2)] {
        if reserved != 0 {
            return Err(Failure::argument(name, reserved, "0"));
        }
    }
    let (boxes, image_boxes) = boxes((desc.boxes, "desc->boxes"), (desc.image_boxes, "desc->image_boxes"))?;
    Ok(ScanOptions::default()
        .fields(fields)
        .seed(desc.seed)
        .frame(desc.frame)
        .start_time(seconds(desc.t0_ns))
        .trajectory_time(0.0)
        .freeze(flag(desc.freeze, "desc->freeze")?)
        .frame_period(optional_seconds(desc.frame_period_ns, "desc->frame_period_ns")?)
        .time_budget(optional_seconds(desc.time_budget_ns, "desc->time_budget_ns")?)
        .organised(flag(desc.organised, "desc->organised")?)
        .coordinates(named(desc.coordinates, "desc->coordinates")?)
        .order(named(desc.order, "desc->order")?)
        .profile(named(desc.profile, "desc->profile")?)
        // 0 leaves it to the profile.
        .reflectance_source(optional(desc.reflectance, "desc->reflectance")?)
        .boxes(boxes)
        .image_boxes(image_boxes)
        .box_time(if desc.struct_size > mem::offset_of!(echocast_scan_desc, box_time) {
            named(desc.box_time, "desc->box_time")?
        } else {
            BoxTime::Start
        })
        .deskew(flag(desc.deskew, "desc->deskew")?)
        .mask(desc.mask))
}

/// The argument as a boolean.
fn flag(number: i32, argument: &str) -> Outcome<bool> {
    match number {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Failure::argument(argument, other, "0 to 1")),
    }
}

/// The axes of boxes, if any are requested, and whether they include their extent in the image: from the numbers, each
/// with the name of its argument.
pub(crate) fn boxes(boxes: (i32, &str), image_boxes: (i32, &str)) -> Outcome<(Option<BoxAxes>, bool)> {
    let (axes, in_image) = (optional(boxes.0, boxes.1)?, flag(image_boxes.0, image_boxes.1)?);
    if in_image && axes.is_none() {
        return Err(Failure::argument(image_boxes.1, 1, "0 without boxes"));
    }
    Ok((axes, in_image))
}

/// The value whose number, counted from 0, is the argument.
fn named<T: Named>(number: i32, argument: &str) -> Outcome<T> {
    let found = usize::try_from(number).ok().and_then(|place| T::NAMES.get(place));
    found
        .map(|&(_, value)| value)
        .ok_or_else(|| Failure::argument(argument, number, &format!("0 to {}", T::NAMES.len() - 1)))
}

/// [`named`], counted from 1; 0 is none.
fn optional<T: Named>(number: i32, argument: &str) -> Outcome<Option<T>> {
    match number.checked_sub(1) {
        Some(-1) => Ok(None),
        Some(place) if (place as usize) < T::NAMES.len() => Ok(Some(T::NAMES[place as usize].1)),
        _ => Err(Failure::argument(argument, number, &format!("0 to {}", T::NAMES.len()))),
    }
}
