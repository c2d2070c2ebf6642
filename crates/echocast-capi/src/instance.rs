//! Instances of meshes in scenes.

use crate::context::Context;
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle;
use crate::material::echocast_material;
use crate::mesh::echocast_mesh;
use crate::pose::{echocast_pose, echocast_pose_key};
use crate::scene::{echocast_scene, edit, look};
use crate::text;
use crate::time::seconds;
use echocast::scene::{Array, Material, Object};
use echocast::{LiveScene, ObjectId};
use std::ffi::c_char;
use std::ptr;
use std::sync::Arc;

/// An instance of a mesh in a scene: a number that is never reused. 0 means none.
pub type echocast_instance = u64;

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

fn nonzero_mask(mask: u32, name: &str) -> Outcome<u32> {
    if mask == 0 { Err(Failure::argument(name, 0, "at least one bit; otherwise no scan sees it")) } else { Ok(mask) }
}

fn material_of(
    context: &Arc<Context>,
    material: *const echocast_material,
    name: &str,
) -> Outcome<Option<Arc<Material>>> {
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
            let object = Object::new(name, mesh.mesh.clone())
                .world_from_object(desc.pose.placement("desc->pose")?)
                .category_id(desc.category_id)
                .part_ids(mesh.part_ids.clone())
                .instance_id(desc.instance_id)
                .mask(nonzero_mask(desc.mask, "desc->mask")?)
                .material(material_of(context, desc.material, "desc->material")?);
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
