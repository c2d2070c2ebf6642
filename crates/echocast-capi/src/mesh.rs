//! Meshes of the host's own vertices and triangles.

use crate::context::{Context, echocast_context};
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::material::echocast_material;
use crate::text;
use echocast::scene::{Array, Mesh, Part};
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Triangles that instances place in a scene; immutable.
pub struct echocast_mesh(());

handles! {
    echocast_mesh: SharedMesh, "mesh", 3;
}

/// A mesh and the label numbers of its parts.
pub struct SharedMesh {
    pub(crate) context: Arc<Context>,
    pub(crate) mesh: Arc<Mesh>,
    pub(crate) part_ids: Vec<u32>,
}

/// The arrays of the mesh are copied by the call.
pub const ECHOCAST_MESH_COPY: i32 = 0;
/// The arrays of the mesh remain the host's, which must neither change nor free them before `released` is called.
pub const ECHOCAST_MESH_BORROW: i32 = 1;

/// Consecutive triangles of one mesh that have one material and one part label; ECHOCAST_PART_INIT has the
/// defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_part {
    /// The first triangle.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Material; NULL for the default material.
    pub material: *const echocast_material,
    /// Number in the column part_id; 0 = unlabelled.
    pub part_id: u32,
    /// 0.
    pub reserved: u32,
}

/// A mesh; ECHOCAST_MESH_DESC_INIT has the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_mesh_desc {
    /// sizeof(echocast_mesh_desc).
    pub struct_size: usize,
    /// Positions of the vertices, x, y, z in metres, -1e18 to 1e18, in the frame of the mesh.
    pub positions: *const f32,
    /// Bytes from vertex to vertex, a multiple of 4; 0 means 12, which is required for borrowed positions.
    pub position_stride: usize,
    /// Vertices, 1 to 4294967294.
    pub vertex_count: u32,
    /// Triangles, 1 to 4294967294.
    pub triangle_count: u32,
    /// Three vertex indices per triangle.
    pub indices: *const u32,
    /// A shading normal of length 1 for each vertex; NULL for flat triangles.
    pub normals: *const f32,
    /// Texture coordinates u, v of each vertex, v down from the top of the image; NULL without an image.
    pub uvs: *const f32,
    /// Parts that cover all triangles in order; NULL for one part with the default material and no label.
    pub parts: *const echocast_part,
    /// Number of parts.
    pub part_count: u32,
    /// ECHOCAST_MESH_COPY or ECHOCAST_MESH_BORROW.
    pub ownership: i32,
    /// Called once, on any thread, when nothing uses borrowed arrays any more (not for copied ones): the mesh and
    /// everything made with it have been released. It must neither throw nor call the library. Not called if the mesh
    /// could not be created. May be NULL.
    pub released: Option<unsafe extern "C" fn(user: *mut c_void)>,
    /// Argument of `released`.
    pub released_user: *mut c_void,
    /// Name, for messages; NULL for none.
    pub name: *const c_char,
}

impl Default for echocast_mesh_desc {
    fn default() -> Self {
        echocast_mesh_desc {
            struct_size: size_of::<Self>(),
            positions: ptr::null(),
            position_stride: 0,
            vertex_count: 0,
            triangle_count: 0,
            indices: ptr::null(),
            normals: ptr::null(),
            uvs: ptr::null(),
            parts: ptr::null(),
            part_count: 0,
            ownership: ECHOCAST_MESH_COPY,
            released: None,
            released_user: ptr::null_mut(),
            name: ptr::null(),
        }
    }
}

text::versioned!(echocast_mesh_desc {
    struct_size,
    positions,
    position_stride,
    vertex_count,
    triangle_count,
    indices,
    normals,
    uvs,
    parts,
    part_count,
    ownership,
    released,
    released_user,
    name,
});

/// Creates a mesh. Its acceleration structure is built when an instance is first committed, or by
/// echocast_mesh_prepare.
///
/// Errors: ECHOCAST_E_ARGUMENT (the vertex, index or part that is wrong), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any
/// thread may call this, even while scenes are edited.
///
/// ```c
/// static const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
/// static const uint32_t indices[] = {0, 1, 2};
/// echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
/// desc.positions = corners; desc.vertex_count = 3;
/// desc.indices = indices;   desc.triangle_count = 1;
/// echocast_mesh *mesh;
/// echocast_mesh_create(context, &desc, &mesh);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_mesh_create(
    context: *const echocast_context,
    desc: *const echocast_mesh_desc,
    out: *mut *mut echocast_mesh,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        // SAFETY: `desc` is a structure (see `text`).
        let desc = unsafe { text::structure(desc, "desc") }?;
        // SAFETY: the arrays and strings of `desc` are as `text` describes; borrowed ones live until `released` is
        // called.
        let (mesh, part_ids, host) = unsafe { read_mesh(&desc, &context) }?;
        *out = handle::create(SharedMesh { context, mesh: Arc::new(mesh), part_ids })?;
        if let Some(host) = host {
            host.armed.store(true, Ordering::Release);
        }
        Ok(())
    })
}

/// Builds the acceleration structure of the mesh, which the first commit of an instance would otherwise build.
///
/// Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any thread may call this, even while scenes are edited.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_mesh_prepare(mesh: *const echocast_mesh) -> echocast_status {
    guard(|| {
        let mesh = handle::get(mesh, "mesh")?;
        Ok(mesh.context.engine.prepare(&mesh.mesh)?)
    })
}

/// Releases a mesh; instances keep it. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_mesh_release(mesh: *mut echocast_mesh) {
    guard(|| {
        handle::release(mesh);
        Ok(())
    });
}

/// The host, which is notified when its arrays are no longer in use.
struct Host {
    released: Option<unsafe extern "C" fn(user: *mut c_void)>,
    user: *mut c_void,
    /// Whether a mesh was created from the arrays.
    armed: AtomicBool,
}

// SAFETY: `user` is only passed to `released`, which the header allows to be called on any thread.
unsafe impl Send for Host {}
// SAFETY: as above.
unsafe impl Sync for Host {}

impl Drop for Host {
    fn drop(&mut self) {
        if let (Some(released), true) = (self.released, self.armed.load(Ordering::Acquire)) {
            // SAFETY: the header requires a function that can be called once when no array is in use any more, which is
            // now.
            unsafe { released(self.user) };
        }
    }
}

/// An array borrowed from the host.
struct Borrowed<T> {
    data: *const T,
    count: usize,
    _host: Arc<Host>,
}

// SAFETY: the header requires that the host does not change the array while it is borrowed.
unsafe impl<T: Sync> Send for Borrowed<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Borrowed<T> {}

impl<T> AsRef<[T]> for Borrowed<T> {
    fn as_ref(&self) -> &[T] {
        // SAFETY: the header requires that the array stays alive and unchanged until `released` is called, which
        // `_host` does when dropped; pointer and count were checked.
        unsafe { std::slice::from_raw_parts(self.data, self.count) }
    }
}

/// The array `data` of `count` vectors, copied or borrowed.
///
/// # Safety
/// `data` points to `count` vectors, which live until `host` is dropped if there is one.
unsafe fn vectors<T: Copy + Send + Sync + 'static>(
    data: *const T,
    count: usize,
    name: &str,
    host: Option<&Arc<Host>>,
) -> Outcome<Array<T>> {
    text::check_array(data, count, name)?;
    match host {
        Some(host) => Ok(Array::new(Borrowed { data, count, _host: host.clone() })),
        None => {
            // SAFETY: as the caller promises; the pointer was checked.
            let from = unsafe { std::slice::from_raw_parts(data, count) };
            Ok(text::collect(from.iter().copied(), count, name)?.into())
        }
    }
}

/// Positions with any stride.
///
/// # Safety
/// `data` points to `count` positions, `stride` bytes apart.
unsafe fn strided(data: *const f32, count: usize, stride: usize) -> Outcome<Array<[f32; 3]>> {
    // SAFETY: as the caller promises; a multiple of 4 keeps it aligned.
    let positions = (0..count).map(|vertex| unsafe { data.byte_add(vertex * stride).cast::<[f32; 3]>().read() });
    Ok(text::collect(positions, count, "desc->positions")?.into())
}

/// # Safety
/// The arrays and strings of `desc` are as [`text`] describes; borrowed ones live until `released` is called.
unsafe fn read_mesh(desc: &echocast_mesh_desc, context: &Arc<Context>) -> Outcome<(Mesh, Vec<u32>, Option<Arc<Host>>)> {
    for (name, count) in [("desc->vertex_count", desc.vertex_count), ("desc->triangle_count", desc.triangle_count)] {
        if !(1..u32::MAX).contains(&count) {
            return Err(Failure::argument(name, count, "1 to 4294967294"));
        }
    }
    let borrow = match desc.ownership {
        ECHOCAST_MESH_COPY => false,
        ECHOCAST_MESH_BORROW => true,
        other => return Err(Failure::argument("desc->ownership", other, "ECHOCAST_MESH_COPY or ECHOCAST_MESH_BORROW")),
    };
    let host = borrow
        .then(|| Arc::new(Host { released: desc.released, user: desc.released_user, armed: AtomicBool::new(false) }));
    let lender = host.as_ref();
    let vertices = desc.vertex_count as usize;
    let stride = if desc.position_stride == 0 { 12 } else { desc.position_stride };
    if stride < 12 || stride % 4 != 0 || stride > 1 << 20 || (borrow && stride != 12) {
        let allowed =
            if borrow { "0 or 12 for borrowed positions" } else { "0, or a multiple of 4 from 12 to 1048576" };
        return Err(Failure::argument("desc->position_stride", stride, allowed));
    }
    let positions = if stride == 12 {
        // SAFETY: as the caller promises.
        unsafe { vectors(desc.positions.cast(), vertices, "desc->positions", lender) }?
    } else {
        text::check_array(desc.positions, 3, "desc->positions")?;
        text::check_array(desc.positions, vertices.saturating_mul(stride / 4), "desc->positions")?;
        // SAFETY: as the caller promises.
        unsafe { strided(desc.positions, vertices, stride) }?
    };
    let optional = |data: *const f32| (!data.is_null()).then_some(data);
    // SAFETY: as the caller promises.
    let normals = optional(desc.normals)
        .map(|normals| unsafe { vectors(normals.cast::<[f32; 3]>(), vertices, "desc->normals", lender) })
        .transpose()?;
    // SAFETY: as the caller promises.
    let uvs = optional(desc.uvs)
        .map(|uvs| unsafe { vectors(uvs.cast::<[f32; 2]>(), vertices, "desc->uvs", lender) })
        .transpose()?;
    let count = desc.triangle_count as usize;
    // SAFETY: as the caller promises.
    let triangles: Array<[u32; 3]> = unsafe { vectors(desc.indices.cast(), count, "desc->indices", lender) }?;
    let whole = [echocast_part {
        first_triangle: 0,
        triangle_count: desc.triangle_count,
        material: ptr::null(),
        part_id: 0,
        reserved: 0,
    }];
    // SAFETY: as the caller promises.
    let described = match unsafe { text::array(desc.parts, desc.part_count as usize, "desc->parts") }? {
        [] => &whole[..],
        parts => parts,
    };
    let mut next = 0;
    let mut parts = Vec::with_capacity(described.len());
    for (number, part) in described.iter().enumerate() {
        let name = |field: &str| format!("desc->parts[{number}].{field}");
        if part.first_triangle != next {
            let allowed = format!("{next}: parts follow each other");
            return Err(Failure::argument(&name("first_triangle"), part.first_triangle, &allowed));
        }
        let left = desc.triangle_count - next;
        if !(1..=left).contains(&part.triangle_count) {
            return Err(Failure::argument(&name("triangle_count"), part.triangle_count, &format!("1 to {left}")));
        }
        if part.reserved != 0 {
            return Err(Failure::argument(&name("reserved"), part.reserved, "0"));
        }
        next += part.triangle_count;
        let material = if part.material.is_null() {
            None
        } else {
            let material = handle::get(part.material, &name("material"))?;
            context.check(&material.0, &name("material"))?;
            Some(material.1.clone())
        };
        parts.push(
            Part::default()
                .positions(positions.clone())
                .normals(normals.clone())
                .uvs(uvs.clone())
                .triangles(triangles.range(part.first_triangle as usize..next as usize))
                .material(material),
        );
    }
    if next != desc.triangle_count {
        let allowed = format!("{}: parts cover all triangles", desc.triangle_count);
        return Err(Failure::argument("the triangles of all desc->parts", next, &allowed));
    }
    // SAFETY: as the caller promises.
    let name = unsafe { text::optional(desc.name, "desc->name") }?.unwrap_or_default();
    let part_ids = described.iter().map(|part| part.part_id).collect();
    Ok((Mesh::new(name, parts)?, part_ids, host))
}
