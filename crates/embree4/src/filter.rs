//! Which hits count: rays may pass through others.

use embree4_sys as sys;

use crate::INVALID;

/// A hit at which a ray may end or which it may pass through, see
/// [`CommittedScene::intersect_where`](crate::CommittedScene::intersect_where); the fields are
/// those of [`crate::Ray`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Number of the ray: its `id`.
    pub ray: u32,
    /// Distance of the hit, in lengths of the ray's direction.
    pub far: f32,
    /// Barycentric weight of the triangle's second corner.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner.
    pub v: f32,
    /// Triangle in the mesh.
    pub prim_id: u32,
    /// Mesh in its scene.
    pub geom_id: u32,
    /// Instance in the scene that was traced, or [`INVALID`].
    pub inst_id: u32,
}

/// Data that every query carries, for Embree's filter and for shapes.
#[repr(C)]
pub(crate) struct QueryFilter {
    /// First, so that a pointer to it is one to the whole.
    context: sys::RTCRayQueryContext,
    /// Calls `counts`; `None`: every hit counts.
    call_filter: Option<unsafe fn(*const (), &Candidate) -> bool>,
    counts: *const (),
}

impl QueryFilter {
    /// Every hit counts.
    pub const ALL: QueryFilter = QueryFilter {
        context: sys::RTCRayQueryContext { instID: [INVALID], instPrimID: [INVALID] },
        call_filter: None,
        counts: std::ptr::null(),
    };

    /// Only hits that `counts` does not reject count; it must outlive the query.
    pub fn new<F: Fn(&Candidate) -> bool>(counts: &F) -> QueryFilter {
        /// # Safety
        /// `counts` points to an `F`.
        unsafe fn call<F: Fn(&Candidate) -> bool>(counts: *const (), hit: &Candidate) -> bool {
            // SAFETY: as the caller promises.
            unsafe { (*counts.cast::<F>())(hit) }
        }
        QueryFilter { call_filter: Some(call::<F>), counts: std::ptr::from_ref(counts).cast(), ..QueryFilter::ALL }
    }

    /// Whether some hits may not count.
    pub fn refuses(&self) -> bool {
        self.call_filter.is_some()
    }

    /// Whether a hit counts.
    pub fn counts(&self, hit: &Candidate) -> bool {
        // SAFETY: both were set together, and `counts` outlives the query that carries this.
        self.call_filter.is_none_or(|call_filter| unsafe { call_filter(self.counts, hit) })
    }
}

/// The filter that calls back.
///
/// # Safety
/// Only for Embree to call, in a query whose context is that of a [`QueryFilter`].
pub(crate) unsafe extern "C" fn call_filter(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes its arguments for the time of the call, with the query's context.
    let (arguments, query_filter) = unsafe {
        let arguments = &*arguments;
        (arguments, &*arguments.context.cast::<QueryFilter>())
    };
    let lanes = arguments.N as usize;
    for lane in 0..lanes {
        // SAFETY: `valid` has a number for each lane.
        let valid = unsafe { &mut *arguments.valid.add(lane) };
        if *valid != -1 {
            continue;
        }
        // SAFETY: an RTCHitN is, for one level of instances, nine rows of `lanes` 32-bit numbers: the normal, u, v,
        // primID, geomID, instID and instPrimID, as RTCHit4, 8 and 16 have them (rtcore_ray.h, `RTCHitN_u` and others).
        let row = |row: usize| unsafe { *arguments.hit.cast::<u32>().add(row * lanes + lane) };
        // SAFETY: an RTCRayN is twelve such rows, of which the ninth is tfar, here that of the hit, and the eleventh
        // id.
        let ray = |row: usize| unsafe { *arguments.ray.cast::<u32>().add(row * lanes + lane) };
        let candidate = Candidate {
            ray: ray(10),
            far: f32::from_bits(ray(8)),
            u: f32::from_bits(row(3)),
            v: f32::from_bits(row(4)),
            prim_id: row(5),
            geom_id: row(6),
            inst_id: row(7),
        };
        if !query_filter.counts(&candidate) {
            *valid = 0;
        }
    }
}
