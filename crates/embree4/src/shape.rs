use std::any::Any;
use std::sync::Arc;

use embree4_sys as sys;

use crate::Device;
use crate::device::check;
use crate::error::Error;
use crate::filter::{Candidate, QueryFilter};
use crate::library::embree;
use crate::mesh::Geometry;

/// Most lanes of a packet.
pub(crate) const MOST: usize = 16;

/// A shape that finds the hits of rays on itself, such as a moving mesh.
pub trait CustomShape: Any + Send + Sync {
    /// Boxes, lowest and highest x, y, z, at evenly spaced times of rays from 0 to 1, 1 to 129 of them. What rays can
    /// hit at a time must be inside the box interpolated between the two neighbours of that time, corner by corner. A
    /// box whose lowest corner is above its highest is never hit.
    fn bounds(&self) -> Vec<[[f32; 3]; 2]>;

    /// Finds hits nearer than the far ends of the rays; a panic in it ends the process.
    fn intersect(&self, query: &mut Query);
}

/// A [`CustomShape`] as part of a scene. Clones are handles of the same one.
#[derive(Clone)]
pub struct Custom(Arc<OwnedShape>);

struct OwnedShape {
    geometry: Geometry,
    /// What Embree's geometry refers to: on the heap, so that its address stays; dropped after the geometry.
    _user_data: Box<UserData>,
}

/// The user data of Embree's callbacks.
struct UserData {
    shape: Arc<dyn CustomShape>,
    bounds: Vec<[[f32; 3]; 2]>,
}

/// Rays that come near a [`CustomShape`], lane by lane, with their hits so far.
pub struct Query<'a> {
    pub(crate) call: Call,
    /// Lanes of the packet: 1, 4, 8 or 16.
    pub(crate) lanes: usize,
    pub(crate) active: &'a [i32],
    /// The packet, as rows of `lanes` numbers in the order of [`crate::Ray`]'s fields.
    rows: *mut f32,
    context: *mut sys::RTCRayQueryContext,
    pub(crate) geometry: u32,
}

/// The callback of Embree that a query answers.
#[derive(Clone, Copy)]
pub(crate) enum Call {
    Intersect(*const sys::RTCIntersectFunctionNArguments),
    Occluded(*const sys::RTCOccludedFunctionNArguments),
}

/// Rays in a frame of their own, for [`Query::forward`]: rows of as many lanes as the query has.
#[repr(C, align(64))]
pub struct LocalRays(pub(crate) [f32; 12 * MOST]);

/// The hit of a lane, see [`crate::Ray`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub far: f32,
    /// Geometric normal, of any length.
    pub normal: [f32; 3],
    /// Barycentric weights of the second and third corner.
    pub uv: [f32; 2],
    /// Triangle in the mesh.
    pub triangle: u32,
    /// Mesh in the shape.
    pub mesh: u32,
}

impl Custom {
    /// Prepares `shape` for scenes of `device`. Rays whose mask shares a bit with `mask` hit it. Hits have its id in
    /// the scene as `inst_id`.
    ///
    /// # Errors
    /// [`Error::Embree`] when memory runs out, or for more than 129 boxes or none.
    pub fn new(device: &Device, shape: Arc<dyn CustomShape>, mask: u32) -> Result<Custom, Error> {
        let bounds = shape.bounds();
        if bounds.is_empty() {
            // Embree would request one.
            return Err(Error::Embree { call: "rtcSetGeometryTimeStepCount", reason: "invalid argument" });
        }
        let mut geometry = Geometry::new(device, sys::RTC_GEOMETRY_TYPE_USER)?;
        let mut user_data = Box::new(UserData { shape, bounds });
        let place: *mut UserData = &raw mut *user_data;
        // SAFETY: the geometry is alive and ours alone. The functions are called with `place`, which lives as long as
        // the geometry (`OwnedShape`) and is only read from now on; Embree requests as many boxes as there are steps.
        unsafe {
            embree().rtcSetGeometryUserPrimitiveCount(geometry.raw(), 1);
            embree().rtcSetGeometryTimeStepCount(geometry.raw(), user_data.bounds.len() as u32);
            embree().rtcSetGeometryUserData(geometry.raw(), place.cast());
            embree().rtcSetGeometryBoundsFunction(geometry.raw(), Some(bounds_of), place.cast());
            embree().rtcSetGeometryIntersectFunction(geometry.raw(), Some(intersect));
            embree().rtcSetGeometryOccludedFunction(geometry.raw(), Some(occluded));
        }
        check(Some(device), "rtcSetGeometryIntersectFunction")?;
        geometry.commit(mask)?;
        Ok(Custom(Arc::new(OwnedShape { geometry, _user_data: user_data })))
    }

    pub(crate) fn geometry(&self) -> &Geometry {
        &self.0.geometry
    }
}

impl std::fmt::Debug for Custom {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Custom").field(&self.0.geometry).finish()
    }
}

/// # Safety
/// Only for Embree to call, for a geometry that [`Custom::new`] made.
unsafe extern "C" fn bounds_of(arguments: *const sys::RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes its arguments for the time of the call, with the pointer it was given.
    let (user_data, step, bounds) = unsafe {
        let arguments = &*arguments;
        (&*arguments.geometryUserPtr.cast::<UserData>(), arguments.timeStep as usize, &mut *arguments.bounds_o)
    };
    let [low, high] = user_data.bounds[step];
    [bounds.lower_x, bounds.lower_y, bounds.lower_z] = low;
    [bounds.upper_x, bounds.upper_y, bounds.upper_z] = high;
}

/// # Safety
/// As [`bounds_of`].
unsafe extern "C" fn intersect(call: *const sys::RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes its arguments for the time of the call; `valid` has N numbers, the rays N lanes.
    let (user_data, mut query) = unsafe {
        let arguments = &*call;
        let query = Query {
            call: Call::Intersect(call),
            lanes: arguments.N as usize,
            active: std::slice::from_raw_parts(arguments.valid, arguments.N as usize),
            rows: arguments.rayhit.cast(),
            context: arguments.context,
            geometry: arguments.geomID,
        };
        (&*arguments.geometryUserPtr.cast::<UserData>(), query)
    };
    user_data.shape.intersect(&mut query);
}

/// # Safety
/// As [`bounds_of`].
unsafe extern "C" fn occluded(call: *const sys::RTCOccludedFunctionNArguments) {
    // SAFETY: as in `intersect`.
    let (user_data, mut query) = unsafe {
        let arguments = &*call;
        let query = Query {
            call: Call::Occluded(call),
            lanes: arguments.N as usize,
            active: std::slice::from_raw_parts(arguments.valid, arguments.N as usize),
            rows: arguments.ray.cast(),
            context: arguments.context,
            geometry: arguments.geomID,
        };
        (&*arguments.geometryUserPtr.cast::<UserData>(), query)
    };
    user_data.shape.intersect(&mut query);
}

/// Rows of a packet, see [`crate::Ray`].
#[derive(Clone, Copy)]
enum PacketRow {
    Origin = 0,
    Near = 3,
    Direction = 4,
    Time = 7,
    Far = 8,
    Id = 10,
    Normal = 12,
    U = 15,
    V = 16,
    Triangle = 17,
    Mesh = 18,
    Instance = 19,
    InstancePrimitive = 20,
}

impl Query<'_> {
    /// Lanes of the packet: 1, 4, 8 or 16.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// For each lane -1 if it is active, else 0.
    pub fn active(&self) -> &[i32] {
        self.active
    }

    /// Whether any hit will do: the nearest need not be found.
    pub fn any_hit(&self) -> bool {
        matches!(self.call, Call::Occluded(_))
    }

    fn row(&self, row: usize) -> &[f32] {
        // SAFETY: a packet of rays has twelve rows, one with hits 21, of as many 32-bit numbers as lanes; callers know
        // which (RTCRayHit4, 8 and 16; for one lane RTCRayHit has the same order).
        unsafe { std::slice::from_raw_parts(self.rows.add(row * self.lanes), self.lanes) }
    }

    /// Where rays start.
    pub fn origins(&self) -> [&[f32]; 3] {
        [0, 1, 2].map(|axis| self.row(PacketRow::Origin as usize + axis))
    }

    /// Directions of rays.
    pub fn directions(&self) -> [&[f32]; 3] {
        [0, 1, 2].map(|axis| self.row(PacketRow::Direction as usize + axis))
    }

    /// Near ends of rays, in lengths of their directions.
    pub fn near(&self) -> &[f32] {
        self.row(PacketRow::Near as usize)
    }

    /// Times of rays.
    pub fn times(&self) -> &[f32] {
        self.row(PacketRow::Time as usize)
    }

    /// Far ends of rays, or their hits so far, in lengths of their directions.
    pub fn far(&self) -> &[f32] {
        self.row(PacketRow::Far as usize)
    }

    /// Whether some hits may not count, see [`Query::counts`].
    pub fn refuses(&self) -> bool {
        // SAFETY: every query of this crate carries a `QueryFilter` that outlives it.
        unsafe { (*self.context.cast::<QueryFilter>()).refuses() }
    }

    /// Whether a hit of `lane` at `far` counts, for queries that pass through some hits
    /// ([`intersect_where`](crate::CommittedScene::intersect_where)).
    pub fn counts(&self, lane: usize, far: f32, mesh: u32, triangle: u32, [u, v]: [f32; 2]) -> bool {
        let ray = self.row(PacketRow::Id as usize)[lane].to_bits();
        let candidate = Candidate { ray, far, u, v, prim_id: triangle, geom_id: mesh, inst_id: self.geometry };
        // SAFETY: every query of this crate carries a `QueryFilter` that outlives it.
        unsafe { (*self.context.cast::<QueryFilter>()).counts(&candidate) }
    }

    /// Sets `hit` as that of `lane`; it must be nearer than its far end.
    pub fn hit(&mut self, lane: usize, hit: &Hit) {
        assert!(lane < self.lanes, "lane {lane} of {}", self.lanes);
        // SAFETY: the lane exists, and rows as in `row`: in a query for any hit only its far end is written.
        let put = |row: usize, value: f32| unsafe { *self.rows.add(row * self.lanes + lane) = value };
        if matches!(self.call, Call::Occluded(_)) {
            return put(PacketRow::Far as usize, f32::NEG_INFINITY);
        }
        put(PacketRow::Far as usize, hit.far);
        (0..3).for_each(|axis| put(PacketRow::Normal as usize + axis, hit.normal[axis]));
        put(PacketRow::U as usize, hit.uv[0]);
        put(PacketRow::V as usize, hit.uv[1]);
        let ids = [
            (PacketRow::Triangle, hit.triangle),
            (PacketRow::Mesh, hit.mesh),
            (PacketRow::Instance, self.geometry),
            (PacketRow::InstancePrimitive, 0),
        ];
        ids.into_iter().for_each(|(row, id)| put(row as usize, f32::from_bits(id)));
    }
}

impl LocalRays {
    /// All zero.
    pub fn new() -> Self {
        LocalRays([0.0; 12 * MOST])
    }

    /// Origins and directions of `lanes` lanes, axis by axis, to be written.
    pub fn rows(&mut self, lanes: usize) -> [&mut [f32]; 6] {
        let lanes = lanes.min(MOST);
        let (origins, rest) = self.0.split_at_mut(PacketRow::Direction as usize * lanes);
        let mut rows = origins[..3 * lanes].chunks_exact_mut(lanes).chain(rest[..3 * lanes].chunks_exact_mut(lanes));
        std::array::from_fn(|_| rows.next().unwrap_or_default())
    }
}

impl Default for LocalRays {
    fn default() -> Self {
        Self::new()
    }
}
