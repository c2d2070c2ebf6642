//! Scenes, their instances, and snapshots of them.

use crate::context::{Context, ECHOCAST_LOG_INFO, echocast_context};
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::material::echocast_material;
use crate::mesh::echocast_mesh;
use crate::sensor::seconds;
use crate::text;
use echocast::scene::{Array, Labels, NameTable, Object};
use echocast::{BuiltScene, LiveScene, LoadOptions, ObjectId, Pose, Scene};
use glam::{DAffine3, DMat3, DQuat, DVec3};
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

/// An instance of a mesh in a scene: a number that is never reused. 0 means none.
pub type echocast_instance = u64;

/// A placement: the upper three rows of the 4x4 matrix, row after row, that takes points of the child (an instance, a
/// sensor) to the parent (the world); the fourth column is the position in metres. Instances may be scaled, sheared and
/// mirrored; sensors are only rotated and translated.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_pose {
    /// Row after row.
    pub m: [f64; 12],
}

/// A pose at a time.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_pose_key {
    /// Time, ns.
    pub t_ns: i64,
    /// Where the sensor or instance is at that time, in the world.
    pub pose: echocast_pose,
}

impl echocast_pose {
    pub(crate) const IDENTITY: echocast_pose =
        echocast_pose { m: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0] };

    fn affine(&self) -> DAffine3 {
        let column = |c: usize| DVec3::new(self.m[c], self.m[4 + c], self.m[8 + c]);
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
    }

    /// As the placement of an instance.
    fn placement(&self, name: &str) -> Outcome<DAffine3> {
        if self.m == [0.0; 12] {
            return Err(Failure::argument(name, "all 0", "a matrix, such as ECHOCAST_POSE_IDENTITY"));
        }
        Ok(self.affine())
    }

    /// As the pose of a sensor.
    pub(crate) fn rigid(&self, name: &str) -> Outcome<Pose> {
        /// Tolerance of the entries of the rotation: one made from a quaternion in single precision passes.
        const TOLERANCE: f64 = 1e-4;
        let DAffine3 { matrix3, translation } = self.placement(name)?;
        let product = matrix3.transpose() * matrix3;
        let is_rotation = product.abs_diff_eq(DMat3::IDENTITY, TOLERANCE) && matrix3.determinant() > 0.0;
        if !is_rotation || !translation.is_finite() {
            let allowed = "finite numbers, a rotation and a position: the axes of a sensor are of length 1, at right angles and right-handed";
            return Err(Failure::argument(name, format!("{:?}", self.m), allowed));
        }
        Ok(Pose { position: translation, orientation: DQuat::from_mat3(&matrix3).normalize() })
    }

    pub(crate) fn of(pose: &Pose) -> echocast_pose {
        echocast_pose::of_placement(&DAffine3 { matrix3: pose.rotation(), translation: pose.position })
    }

    fn of_placement(placement: &DAffine3) -> echocast_pose {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = placement.matrix3;
        let p = placement.translation;
        echocast_pose { m: [x.x, y.x, z.x, p.x, x.y, y.y, z.y, p.y, x.z, y.z, z.z, p.z] }
    }
}

/// A new instance; ECHOCAST_INSTANCE_DESC_INIT has the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_instance_desc {
    /// sizeof(echocast_instance_desc).
    pub struct_size: usize,
    /// Its mesh, from the scene's context.
    pub mesh: *const echocast_mesh,
    /// Where it is in the world.
    pub pose: echocast_pose,
    /// Number in the column category_id; 0 = unlabelled.
    pub category_id: u32,
    /// Number in the column instance_id; 0 = unlabelled. Instances may share a number; the first to have it
    /// names it.
    pub instance_id: u32,
    /// Scans whose mask shares a bit with this see it; not 0.
    pub mask: u32,
    /// 1: it does not move. Fixed instances with a mesh of their own are built together, which is the fastest to trace;
    /// whenever one is added, removed or changed, all are rebuilt. 0: it may move, at a cost of a few microseconds per
    /// commit.
    pub fixed: i32,
    /// Replaces the materials of the mesh; NULL to keep them.
    pub material: *const echocast_material,
    /// Name, for echocast_scene_find, messages and the table of instances in files; NULL for none.
    pub name: *const c_char,
}

impl Default for echocast_instance_desc {
    fn default() -> Self {
        echocast_instance_desc {
            struct_size: size_of::<Self>(),
            mesh: ptr::null(),
            pose: echocast_pose::IDENTITY,
            category_id: 0,
            instance_id: 0,
            mask: u32::MAX,
            fixed: 0,
            material: ptr::null(),
            name: ptr::null(),
        }
    }
}

text::versioned!(echocast_instance_desc {
    struct_size,
    mesh,
    pose,
    category_id,
    instance_id,
    mask,
    fixed,
    material,
    name,
});

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
fn edit<T>(scene: *mut echocast_scene, edit: impl FnOnce(&Arc<Context>, &mut LiveScene) -> Outcome<T>) -> Outcome<T> {
    let scene = handle::get(scene, "scene")?;
    let mut live = handle::write(&scene.1, "scene")?;
    edit(&scene.0, &mut live)
}

/// Runs `look` on the scene while no thread edits it.
fn look<T>(scene: *const echocast_scene, look: impl FnOnce(&LiveScene) -> Outcome<T>) -> Outcome<T> {
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

/// Adds an instance of a mesh. `*out` is its number; `out` may be NULL.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the scene is then unchanged.
///
/// ```c
/// echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
/// desc.mesh = car_mesh;
/// desc.category_id = 10;
/// desc.instance_id = 1;
/// desc.name = "car 1";
/// echocast_instance car;
/// echocast_scene_add(scene, &desc, &car);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_add(
    scene: *mut echocast_scene,
    desc: *const echocast_instance_desc,
    out: *mut echocast_instance,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = if out.is_null() { None } else { Some(unsafe { text::output(out, "out") }?.write(0)) };
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        edit(scene, |context, live| {
            let mesh = handle::get(desc.mesh, "desc->mesh")?;
            context.check(&mesh.context, "desc->mesh")?;
            // SAFETY: `desc.name` is a string (see `text`).
            let name = unsafe { text::optional(desc.name, "desc->name") }?.unwrap_or_default();
            let object = Object {
                world_from_object: desc.pose.placement("desc->pose")?,
                category_id: desc.category_id,
                part_ids: mesh.part_ids.clone(),
                instance_id: desc.instance_id,
                mask: nonzero_mask(desc.mask, "desc->mask")?,
                material: material_of(context, desc.material, "desc->material")?,
                ..Object::new(name, mesh.mesh.clone())
            };
            let id = match desc.fixed {
                0 => live.add(object)?,
                1 => live.add_fixed(object)?,
                other => return Err(Failure::argument("desc->fixed", other, "0 or 1")),
            };
            if let Some(out) = out {
                *out = id.to_u64();
            }
            Ok(())
        })
    })
}

fn nonzero_mask(mask: u32, name: &str) -> Outcome<u32> {
    if mask == 0 { Err(Failure::argument(name, 0, "at least one bit; otherwise no scan sees it")) } else { Ok(mask) }
}

fn material_of(
    context: &Arc<Context>,
    material: *const echocast_material,
    name: &str,
) -> Outcome<Option<Arc<echocast::scene::Material>>> {
    if material.is_null() {
        return Ok(None);
    }
    let material = handle::get(material, name)?;
    context.check(&material.0, name)?;
    Ok(Some(material.1.clone()))
}

/// The instance with this number.
fn instance(live: &LiveScene, number: echocast_instance, name: &str) -> Outcome<ObjectId> {
    let id = ObjectId::from_u64(number);
    match live.object(id) {
        Ok(_) => Ok(id),
        Err(_) => Err(Failure::new(
            crate::ECHOCAST_E_HANDLE,
            format!("{name} is {number:#x}, which is not an existing instance of this scene"),
        )),
    }
}

/// Removes an instance. Its number is never reused.
///
/// Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_remove(scene: *mut echocast_scene, id: echocast_instance) -> echocast_status {
    guard(|| edit(scene, |_, live| Ok(live.remove(instance(live, id, "id")?)?)))
}

/// Finds the first instance with a name; instances of loaded files keep their names.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_find(
    scene: *const echocast_scene,
    name: *const c_char,
    out: *mut echocast_instance,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output and `name` a string (see `text`).
        let (out, name) = unsafe { (text::output(out, "out")?.write(0), text::required(name, "name")?) };
        look(scene, |live| {
            *out = live.find(name)?.to_u64();
            Ok(())
        })
    })
}

/// Writes the numbers of instances to `ids`, which has room for `capacity` of them, in a fixed order, starting at index
/// `first`. `*count` (may be NULL): the total number of instances.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_get_instances(
    scene: *const echocast_scene,
    first: usize,
    capacity: usize,
    ids: *mut echocast_instance,
    count: *mut usize,
) -> echocast_status {
    guard(|| {
        if capacity > 0 {
            text::check_array(ids, capacity, "ids")?;
        }
        look(scene, |live| {
            if !count.is_null() {
                // SAFETY: `count` is an output (see `text`).
                unsafe { text::output(count, "count") }?.write(live.objects().count());
            }
            for (number, (id, _)) in live.objects().skip(first).take(capacity).enumerate() {
                // SAFETY: `ids` is an array with room for `capacity` elements (see `text`); its pointer was checked.
                unsafe { ids.add(number).write(id.to_u64()) };
            }
            Ok(())
        })
    })
}

/// The current state of an instance; ECHOCAST_INSTANCE_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_instance_info {
    /// sizeof(echocast_instance_info).
    pub struct_size: usize,
    /// Where it is in the world.
    pub pose: echocast_pose,
    /// Number in the column category_id.
    pub category_id: u32,
    /// Number in the column instance_id.
    pub instance_id: u32,
    /// Scans whose mask shares a bit with this see it.
    pub mask: u32,
    /// Parts of its mesh.
    pub part_count: u32,
    /// Triangles of its mesh.
    pub triangle_count: usize,
    /// Buffer for its name, which ends in 0 and is cut off if it is too long; NULL if not needed. Set by the caller.
    pub name: *mut c_char,
    /// Capacity of `name`, bytes. Set by the caller.
    pub name_capacity: usize,
}

impl Default for echocast_instance_info {
    fn default() -> Self {
        echocast_instance_info {
            struct_size: size_of::<Self>(),
            pose: echocast_pose::IDENTITY,
            category_id: 0,
            instance_id: 0,
            mask: 0,
            part_count: 0,
            triangle_count: 0,
            name: ptr::null_mut(),
            name_capacity: 0,
        }
    }
}

text::versioned!(echocast_instance_info {
    struct_size,
    pose,
    category_id,
    instance_id,
    mask,
    part_count,
    triangle_count,
    name,
    name_capacity,
});

/// Gets the state of an instance. The caller sets struct_size of `*info`, and the buffer for its name.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_get_instance(
    scene: *const echocast_scene,
    id: echocast_instance,
    info: *mut echocast_instance_info,
) -> echocast_status {
    guard(|| {
        look(scene, |live| {
            let object = live.object(instance(live, id, "id")?)?;
            // SAFETY: `info` is a structure (see `text`).
            let given = unsafe { text::structure(info, "info") }?;
            if !given.name.is_null() {
                // SAFETY: `given.name` is a buffer (see `text`).
                unsafe { text::put(&object.name, given.name, given.name_capacity, ptr::null_mut()) }?;
            }
            let found = echocast_instance_info {
                pose: echocast_pose::of_placement(&object.world_from_object),
                category_id: object.category_id,
                instance_id: object.instance_id,
                mask: object.mask,
                part_count: object.mesh.parts.len() as u32,
                triangle_count: object.mesh.triangle_count(),
                ..given
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
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

/// Writes the number of `name` in a table of the labels that `with_labels` passes.
///
/// # Safety
/// `table` and `name` are strings and `number` an output, as [`text`] describes.
pub(crate) unsafe fn put_label_number(
    table: *const c_char,
    name: *const c_char,
    number: *mut u32,
    with_labels: impl FnOnce(&mut dyn FnMut(&Labels) -> Outcome<()>) -> Outcome<()>,
) -> echocast_status {
    guard(|| {
        // SAFETY: as the caller promises.
        let number = unsafe { text::output(number, "number") }?.write(0);
        // SAFETY: as the caller promises.
        let (table, name) = unsafe { (text::required(table, "table")?, text::required(name, "name")?) };
        with_labels(&mut |labels| {
            let (_, names) = label_table(labels, table)?;
            *number = match names.id(name) {
                0 => return Err(echocast::Error::missing("label", name, &names.names).into()),
                known => known,
            };
            Ok(())
        })
    })
}

/// The stem and the names of one of the tables of `labels`.
pub(crate) fn label_table<'a>(labels: &'a Labels, table: &str) -> Outcome<(&'static str, &'a NameTable)> {
    let tables = labels.tables();
    let found = tables.into_iter().find(|(stem, _)| *stem == table);
    found.ok_or_else(|| Failure::argument("table", format!("{table:?}"), "category, part, material, instance"))
}

/// Makes a pose from a position, metres, and a unit quaternion x, y, z, w: the real part last, as in ROS. The
/// quaternion is normalised.
///
/// Errors: ECHOCAST_E_ARGUMENT (numbers that are not finite, a quaternion whose length is not near 1). Any thread may
/// call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pose_from_quaternion(
    position: *const f64,
    xyzw: *const f64,
    pose: *mut echocast_pose,
) -> echocast_status {
    guard(|| {
        // SAFETY: `pose` is an output (see `text`).
        let pose = unsafe { text::output(pose, "pose") }?;
        // SAFETY: `position` and `xyzw` are arrays of three and four numbers (see `text`).
        let (p, q) = unsafe { (text::array(position, 3, "position")?, text::array(xyzw, 4, "xyzw")?) };
        if !p.iter().all(|x| x.is_finite()) {
            return Err(Failure::argument("position", format!("{p:?}"), "finite numbers"));
        }
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        // A quaternion that was rounded to single precision or averaged passes; one that was never filled in does not.
        if !(0.9..=1.1).contains(&length) {
            return Err(Failure::argument("xyzw", format!("{q:?}"), "x, y, z, w of a unit quaternion"));
        }
        pose.write(echocast_pose::of(&Pose::at(p[0], p[1], p[2]).with_quaternion(q[0], q[1], q[2], q[3])));
        Ok(())
    })
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

/// Moves instances: `ids[i]` to `poses[i]`, all or, on an error, none. Fixed instances become movable.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_poses(
    scene: *mut echocast_scene,
    count: usize,
    ids: *const echocast_instance,
    poses: *const echocast_pose,
) -> echocast_status {
    guard(|| {
        // SAFETY: `ids` and `poses` are arrays (see `text`).
        let (ids, poses) = unsafe { (text::array(ids, count, "ids")?, text::array(poses, count, "poses")?) };
        edit(scene, |_, live| {
            for check in [true, false] {
                for (number, (&id, pose)) in ids.iter().zip(poses).enumerate() {
                    // Names are formatted only for errors: a loop of frames allocates nothing here.
                    let id = instance(live, id, "ids[i]").map_err(|failure| failure.at("[i]", number))?;
                    let pose = pose.placement("poses[i]").map_err(|failure| failure.at("[i]", number))?;
                    if check {
                        let named = |error: echocast::Error| Failure::argument_of(error, &format!("poses[{number}]"));
                        live.check_pose(id, &pose).map_err(named)?;
                    } else {
                        live.set_pose(id, pose)?;
                    }
                }
            }
            Ok(())
        })
    })
}

/// Moves an instance during the scans that follow: through `count` poses at times that never decrease, between which it
/// moves in straight lines and rotates uniformly; before the first and after the last it stands still. Times count from
/// the same zero as echocast_scan_desc.t0_ns. The poses may scale along the instance's own axes, but not shear. The
/// keys are copied; echocast_scene_set_time selects the part of the motion that the next snapshot shows, and
/// echocast_scene_set_poses ends it.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the instance then moves as before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_motion(
    scene: *mut echocast_scene,
    id: echocast_instance,
    keys: *const echocast_pose_key,
    count: usize,
) -> echocast_status {
    guard(|| {
        // SAFETY: `keys` is an array (see `text`).
        let keys = unsafe { text::array(keys, count, "keys") }?;
        edit(scene, |_, live| {
            let id = instance(live, id, "id")?;
            let place = |(number, key): (usize, &echocast_pose_key)| {
                let pose = key.pose.placement("keys[i].pose").map_err(|failure| failure.at("[i]", number))?;
                Ok((seconds(key.t_ns), pose))
            };
            let keys = keys.iter().enumerate().map(place).collect::<Outcome<Vec<_>>>()?;
            Ok(live.set_motion(id, &keys)?)
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

/// Gives the vertices of an instance new positions: `count` times x, y, z, as many as its mesh has, and shading
/// normals, or NULL for flat triangles. It then has its own mesh; others that share the mesh keep theirs. The arrays
/// are copied. The parts of its mesh must share their vertices, as those of echocast_mesh_create do; those of files may
/// not.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY; the instance is then unchanged.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_vertices(
    scene: *mut echocast_scene,
    id: echocast_instance,
    positions: *const f32,
    normals: *const f32,
    count: usize,
) -> echocast_status {
    guard(|| {
        let copy = |data: *const f32, name: &str| -> Outcome<Array<[f32; 3]>> {
            // SAFETY: `data` is an array (see `text`).
            let from = unsafe { text::array(data.cast::<[f32; 3]>(), count, name) }?;
            Ok(text::collect(from.iter().copied(), count, name)?.into())
        };
        edit(scene, |_, live| {
            let id = instance(live, id, "id")?;
            let vertices = live.object(id)?.mesh.parts[0].positions.len();
            if count != vertices {
                return Err(Failure::argument("count", count, &format!("the vertices of its mesh, {vertices}")));
            }
            let positions = copy(positions, "positions")?;
            let normals = if normals.is_null() { None } else { Some(copy(normals, "normals")?) };
            Ok(live.set_vertices(id, positions, normals)?)
        })
    })
}

/// Moves the vertices of an instance during the scans that follow: `keys` rising times, ns, as for
/// echocast_scene_set_motion, and for each of them in order `count` times x, y, z, as many as its mesh has, in its own
/// frame. Between keys they move in straight lines; before the first and after the last they stand still. The triangles
/// remain the same, and are flat. The arrays are copied. The parts of its mesh must share their vertices, as for
/// echocast_scene_set_vertices, which ends the motion.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY; the instance then moves as
/// before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_vertex_motion(
    scene: *mut echocast_scene,
    id: echocast_instance,
    times_ns: *const i64,
    keys: usize,
    positions: *const f32,
    count: usize,
) -> echocast_status {
    guard(|| {
        // SAFETY: `times_ns` is an array (see `text`).
        let times = unsafe { text::array(times_ns, keys, "times_ns") }?;
        edit(scene, |_, live| {
            let id = instance(live, id, "id")?;
            let vertices = live.object(id)?.mesh.parts[0].positions.len();
            if count != vertices {
                return Err(Failure::argument("count", count, &format!("the vertices of its mesh, {vertices}")));
            }
            let all =
                keys.checked_mul(count).ok_or_else(|| Failure::argument("keys", keys, "as many as fit in memory"))?;
            // SAFETY: `positions` is an array (see `text`).
            let all = unsafe { text::array(positions.cast::<[f32; 3]>(), all, "positions") }?;
            let sample = |(&time, from): (&i64, &[[f32; 3]])| {
                let positions = text::collect(from.iter().copied(), count, "positions")?;
                Ok((seconds(time), Array::from(positions)))
            };
            let samples = times.iter().zip(all.chunks(count.max(1))).map(sample).collect::<Outcome<Vec<_>>>()?;
            Ok(live.set_vertex_motion(id, &samples)?)
        })
    })
}

/// Sets the labels of an instance: its category, its instance number, and those of the parts of its mesh, or NULL to
/// keep these.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_labels(
    scene: *mut echocast_scene,
    id: echocast_instance,
    category_id: u32,
    instance_id: u32,
    part_ids: *const u32,
    part_count: usize,
) -> echocast_status {
    guard(|| {
        edit(scene, |_, live| {
            let id = instance(live, id, "id")?;
            let kept;
            let parts = if part_ids.is_null() {
                kept = live.object(id)?.part_ids.clone();
                &kept[..]
            } else {
                // SAFETY: `part_ids` is an array (see `text`).
                unsafe { text::array(part_ids, part_count, "part_ids") }?
            };
            Ok(live.set_labels(id, category_id, instance_id, parts)?)
        })
    })
}

/// Sets which scans see an instance: those whose mask shares a bit with `mask`, which may be 0.
///
/// Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_mask(
    scene: *mut echocast_scene,
    id: echocast_instance,
    mask: u32,
) -> echocast_status {
    guard(|| edit(scene, |_, live| Ok(live.set_mask(instance(live, id, "id")?, mask)?)))
}

/// Gives an instance one material instead of those of its mesh; NULL restores those of its mesh.
///
/// Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_scene_set_material(
    scene: *mut echocast_scene,
    id: echocast_instance,
    material: *const echocast_material,
) -> echocast_status {
    guard(|| {
        edit(scene, |context, live| {
            let id = instance(live, id, "id")?;
            Ok(live.set_material(id, material_of(context, material, "material")?)?)
        })
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
