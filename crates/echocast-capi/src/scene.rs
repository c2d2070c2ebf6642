//! Scenes and snapshots of them.

use crate::context::{Context, ECHOCAST_LOG_INFO, echocast_context};
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::label::put_label_number;
use crate::pose::echocast_pose;
use crate::text;
use crate::time::seconds;
use echocast::{BuiltScene, LiveScene, LoadOptions, Scene};
use glam::DVec3;
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::{Arc, RwLock};

/// Instances that are added, removed and moved. One thread at a time may edit it; another gets ECHOCAST_E_BUSY.
pub struct echocast_scene(());

/// A scene as it was when it was committed; immutable. Any number of threads may scan it.
pub struct echocast_snapshot(());

handles! {
    echocast_scene: (Arc<Context>, RwLock<LiveScene>), "scene", 4;
    echocast_snapshot: (Arc<Context>, BuiltScene), "snapshot", 5;
}

/// A new scene; ECHOCAST_SCENE_DESC_INIT has the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_scene_desc {
    /// sizeof(echocast_scene_desc).
    pub struct_size: usize,
    /// World position, three numbers, metres, that the single-precision coordinates of results are relative to. NULL:
    /// the first commit with an instance chooses it, the world's own origin for scenes within a kilometre of it. For
    /// survey coordinates, choose one near the vehicle: 8 km from it, coordinates are rounded to half a millimetre.
    pub origin: *const f64,
}

impl Default for echocast_scene_desc {
    fn default() -> Self {
        echocast_scene_desc { struct_size: size_of::<Self>(), origin: ptr::null() }
    }
}

text::versioned!(echocast_scene_desc { struct_size, origin });

/// The contents of a scene; ECHOCAST_SCENE_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_scene_info {
    /// sizeof(echocast_scene_info).
    pub struct_size: usize,
    /// Number of instances.
    pub instances: usize,
    /// Number of triangles, each mesh counted as often as it is placed.
    pub triangles: usize,
    /// Lowest corner of the box around all instances, in the world, metres; all 0 without instances.
    pub low: [f64; 3],
    /// Highest corner of that box.
    pub high: [f64; 3],
    /// Number of camera nodes of the loaded files.
    pub cameras: usize,
}

impl Default for echocast_scene_info {
    fn default() -> Self {
        echocast_scene_info {
            struct_size: size_of::<Self>(),
            instances: 0,
            triangles: 0,
            low: [0.0; 3],
            high: [0.0; 3],
            cameras: 0,
        }
    }
}

text::versioned!(echocast_scene_info { struct_size, instances, triangles, low, high, cameras });

/// Creates a scene without instances. `desc`: NULL for the defaults.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_create(
    context: *const echocast_context,
    desc: *const echocast_scene_desc,
    out: *mut *mut echocast_scene,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        let mut scene = LiveScene::new(&context.engine);
        if !desc.is_null() {
            // SAFETY: `desc` is a structure (see `text`).
            let desc = unsafe { text::structure(desc, "desc") }?;
            if !desc.origin.is_null() {
                // SAFETY: `desc.origin` is an array of three numbers (see `text`).
                let origin = unsafe { text::array(desc.origin, 3, "desc->origin") }?;
                scene.set_origin(DVec3::from_slice(origin))?;
            }
        }
        *out = handle::create((context, RwLock::new(scene)))?;
        Ok(())
    })
}

/// Releases a scene; its snapshots stay. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_release(scene: *mut echocast_scene) {
    guard(|| {
        handle::release(scene);
        Ok(())
    });
}

/// Runs `edit` on the scene while no other thread uses it.
pub(crate) fn edit<T>(
    scene: *mut echocast_scene,
    edit: impl FnOnce(&Arc<Context>, &mut LiveScene) -> Outcome<T>,
) -> Outcome<T> {
    let scene = handle::get(scene, "scene")?;
    let mut live = handle::write(&scene.1, "scene")?;
    edit(&scene.0, &mut live)
}

/// Runs `look` on the scene while no thread edits it.
pub(crate) fn look<T>(scene: *const echocast_scene, look: impl FnOnce(&LiveScene) -> Outcome<T>) -> Outcome<T> {
    let scene = handle::get(scene, "scene")?;
    look(&*handle::read(&scene.1, "scene")?)
}

/// # Safety
/// `options` is a string, as [`text`] describes.
unsafe fn load_options(options: *const c_char) -> Outcome<LoadOptions> {
    // SAFETY: as the caller promises.
    match unsafe { text::optional(options, "options") }? {
        None => Ok(LoadOptions::default()),
        Some(options) if options.trim().is_empty() => Ok(LoadOptions::default()),
        Some(options) => Ok(LoadOptions::from_yaml(options)?),
    }
}

fn add_scene(context: &Context, live: &mut LiveScene, file: &Scene) -> Outcome {
    context.warn(&file.report);
    let objects = live.add_scene(file)?.len();
    context.log_message(ECHOCAST_LOG_INFO, format_args!("objects: {objects}, triangles: {}", file.triangle_count()));
    Ok(())
}

/// Adds the contents of a scene file (glTF, GLB, OBJ, FBX): its objects as fixed instances with their labels, and its
/// cameras. `options`: NULL, or YAML with `up` (y or z) and `scale` (metres per unit) for formats that do not define
/// them; `labels`, a label file, its contents or the name of built-in rules (`street`); `texture_limit_mib` (1024), the
/// most memory for all images; `animation`, the name of the only one to play instead of all; `loop` (false), whether
/// animations start again at their ends; and `allow_outside_paths` (false), whether the scene may refer to files
/// outside of its own folder. Categories and parts whose name is already in the scene get its number there; instances
/// are numbered on from the greatest number that has a name, from 1 if there is none.
///
/// Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT,
/// ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the scene is then unchanged.
///
/// ```c
/// echocast_scene_load(scene, "street.glb", "labels: {numbers: {car: 10, road: 40}}");
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_load(
    scene: *mut echocast_scene,
    path: *const c_char,
    options: *const c_char,
) -> echocast_status {
    guard(|| {
        edit(scene, |context, live| {
            // SAFETY: `path` and `options` are strings (see `text`).
            let (path, options) = unsafe { (text::path(path, "path")?, load_options(options)?) };
            let file = Scene::load_with(path, &options)?;
            add_scene(context, live, &file)
        })
    })
}

/// Like echocast_scene_load, from the bytes of a GLB file, or of a glTF file with embedded buffers and images.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_load_memory(
    scene: *mut echocast_scene,
    data: *const c_void,
    size: usize,
    options: *const c_char,
) -> echocast_status {
    guard(|| {
        edit(scene, |context, live| {
            // SAFETY: `data` is an array and `options` a string (see `text`).
            let (bytes, options) = unsafe { (text::array(data.cast::<u8>(), size, "data")?, load_options(options)?) };
            let file = Scene::from_glb_bytes(bytes, &options)?;
            add_scene(context, live, &file)
        })
    })
}

/// Gets the pose of a camera node of a loaded file by its name, as the pose of a sensor: x along its view, z up.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_camera(
    scene: *const echocast_scene,
    name: *const c_char,
    out: *mut echocast_pose,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output and `name` a string (see `text`).
        let (out, name) = unsafe { (text::output(out, "out")?, text::required(name, "name")?) };
        look(scene, |live| {
            out.write(echocast_pose::of(&live.camera(name)?));
            Ok(())
        })
    })
}

/// Gets the name of camera node `number` of the loaded files, counted from 0, and its pose at time 0, as the pose of a
/// sensor; echocast_scene_get_info gives their number. `name` has room for `capacity` bytes, a longer name is cut off;
/// `*needed`: bytes of the whole name, including the 0 at its end. One of `name` and `needed` may be NULL, and so may
/// `pose`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_get_camera(
    scene: *const echocast_scene,
    number: usize,
    name: *mut c_char,
    capacity: usize,
    needed: *mut usize,
    pose: *mut echocast_pose,
) -> echocast_status {
    guard(|| {
        look(scene, |live| {
            let cameras = live.cameras();
            let Some(camera) = cameras.get(number) else {
                let allowed = format!("less than the {} cameras there are", cameras.len());
                return Err(Failure::argument("number", number, &allowed));
            };
            if !pose.is_null() {
                // SAFETY: `pose` is an output (see `text`).
                unsafe { text::output(pose, "pose") }?.write(echocast_pose::of(&camera.pose));
            }
            // SAFETY: `name` is a buffer and `needed` an output (see `text`).
            unsafe { text::put(&camera.name, name, capacity, needed) }
        })
    })
}

/// Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
/// with the name counts.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_label_number(
    scene: *const echocast_scene,
    table: *const c_char,
    name: *const c_char,
    number: *mut u32,
) -> echocast_status {
    // SAFETY: `table` and `name` are strings and `number` an output (see `text`).
    unsafe { put_label_number(table, name, number, |put| look(scene, |live| put(live.labels()))) }
}

/// Gets the contents of a scene. The caller sets struct_size of `*info`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_get_info(
    scene: *const echocast_scene,
    info: *mut echocast_scene_info,
) -> echocast_status {
    guard(|| {
        look(scene, |live| {
            let (low, high) = live.bounds().unwrap_or_default();
            let found = echocast_scene_info {
                struct_size: size_of::<echocast_scene_info>(),
                instances: live.objects().count(),
                triangles: live.triangle_count(),
                low: low.to_array(),
                high: high.to_array(),
                cameras: live.cameras().len(),
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// Sets the time span of the next snapshots: in them, everything that moves by itself, by the animations of files,
/// echocast_scene_set_motion or echocast_scene_set_vertex_motion, has its motion from `start_ns` to
/// `start_ns + length_ns`. A scan of such a snapshot must be within that span. With a length of 0 everything stands
/// still where it is at `start_ns`, whatever the time of a scan; a new scene stands still at time 0.
///
/// Errors: ECHOCAST_E_ARGUMENT (a negative length), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_time(
    scene: *mut echocast_scene,
    start_ns: i64,
    length_ns: i64,
) -> echocast_status {
    guard(|| {
        if length_ns < 0 {
            return Err(Failure::argument("length_ns", length_ns, "0 or more"));
        }
        edit(scene, |_, live| Ok(live.set_time(seconds(start_ns), seconds(length_ns))?))
    })
}

/// Names a number in a label column; files contain the names. `table`: "category", "part" or "instance".
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_name_label(
    scene: *mut echocast_scene,
    table: *const c_char,
    number: u32,
    name: *const c_char,
) -> echocast_status {
    guard(|| {
        edit(scene, |_, live| {
            // SAFETY: `table` and `name` are strings (see `text`).
            let (table, name) = unsafe { (text::required(table, "table")?, text::required(name, "name")?) };
            Ok(live.name_label(table, number, name)?)
        })
    })
}

/// Builds what has changed. `*out` is a snapshot of the scene as it is now, which can be scanned while the scene is
/// edited further; release it with echocast_snapshot_release.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_commit(
    scene: *mut echocast_scene,
    out: *mut *mut echocast_snapshot,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        edit(scene, |context, live| {
            let built = live.commit()?;
            context.warn(built.report());
            *out = handle::create((Arc::clone(context), built))?;
            Ok(())
        })
    })
}

/// Releases a snapshot. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_snapshot_release(snapshot: *mut echocast_snapshot) {
    guard(|| {
        handle::release(snapshot);
        Ok(())
    });
}
