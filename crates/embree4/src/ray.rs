use embree4_sys as sys;

/// The id for none: `geom_id` of a ray that hits nothing, and `inst_id` of a hit outside of instances.
pub const INVALID: u32 = u32::MAX;

/// How similar the rays of a packet are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Neighbours with nearly the same origin and direction: traced together, two to six times as fast as one by one.
    Coherent,
    /// Anything else. Tracing such rays as coherent gives the same hits at half the speed or less.
    Incoherent,
}

impl Coherence {
    pub(crate) fn flags(self) -> sys::RTCRayQueryFlags {
        match self {
            Coherence::Coherent => sys::RTC_RAY_QUERY_FLAG_COHERENT,
            Coherence::Incoherent => sys::RTC_RAY_QUERY_FLAG_INCOHERENT,
        }
    }
}

/// One ray and its hit, in Embree's layout (`RTCRayHit`).
///
/// Before tracing: origin, direction, `tnear <= tfar` in units of the direction's length, `mask` (not 0), and
/// `geom_id`, `inst_id` = [`INVALID`]. On a hit Embree sets `tfar` and everything from `ng_x` on; otherwise it changes
/// nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub struct Ray {
    /// Origin.
    pub org_x: f32,
    /// Origin.
    pub org_y: f32,
    /// Origin.
    pub org_z: f32,
    /// Where the ray starts, in direction lengths from the origin; at least 0.
    pub tnear: f32,
    /// Direction, preferably of unit length.
    pub dir_x: f32,
    /// Direction.
    pub dir_y: f32,
    /// Direction.
    pub dir_z: f32,
    /// Time for motion blur, 0 to 1; not used by what this crate builds.
    pub time: f32,
    /// Where the ray ends; the hit's distance afterwards.
    pub tfar: f32,
    /// Meshes and instances are hit when their mask shares a bit with this.
    pub mask: u32,
    /// The caller's own number.
    pub id: u32,
    /// Reserved by Embree; 0.
    pub flags: u32,
    /// Geometric normal: not of unit length, in the space of the mesh, by the right-hand rule around its corners.
    pub ng_x: f32,
    /// Geometric normal.
    pub ng_y: f32,
    /// Geometric normal.
    pub ng_z: f32,
    /// Barycentric weight of the triangle's second corner.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner.
    pub v: f32,
    /// Triangle in the mesh.
    pub prim_id: u32,
    /// Mesh in its scene, or [`INVALID`].
    pub geom_id: u32,
    /// Instance in the scene that was traced, or [`INVALID`].
    pub inst_id: u32,
    /// Instance in an instance array; with plain instances 0.
    pub inst_prim_id: u32,
}

impl Ray {
    /// A ray from `org` along `dir`, from 0 to infinity, ready to be traced.
    pub fn new(org: [f32; 3], dir: [f32; 3]) -> Ray {
        Ray {
            org_x: org[0],
            org_y: org[1],
            org_z: org[2],
            tnear: 0.0,
            dir_x: dir[0],
            dir_y: dir[1],
            dir_z: dir[2],
            time: 0.0,
            tfar: f32::INFINITY,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            ng_x: 0.0,
            ng_y: 0.0,
            ng_z: 0.0,
            u: 0.0,
            v: 0.0,
            prim_id: INVALID,
            geom_id: INVALID,
            inst_id: INVALID,
            inst_prim_id: INVALID,
        }
    }
}

/// `W` rays and their hits, lane by lane, in Embree's layout (`RTCRayHit4`, `8`, `16`). The fields are those of
/// [`Ray`].
///
/// A reused packet needs new `tfar`, `geom_id` and `inst_id`; write whole arrays, not lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
#[allow(missing_docs)] // the fields of Ray
pub struct Packet<const W: usize> {
    pub org_x: [f32; W],
    pub org_y: [f32; W],
    pub org_z: [f32; W],
    pub tnear: [f32; W],
    pub dir_x: [f32; W],
    pub dir_y: [f32; W],
    pub dir_z: [f32; W],
    pub time: [f32; W],
    pub tfar: [f32; W],
    pub mask: [u32; W],
    pub id: [u32; W],
    pub flags: [u32; W],
    pub ng_x: [f32; W],
    pub ng_y: [f32; W],
    pub ng_z: [f32; W],
    pub u: [f32; W],
    pub v: [f32; W],
    pub prim_id: [u32; W],
    pub geom_id: [u32; W],
    pub inst_id: [u32; W],
    pub inst_prim_id: [u32; W],
}

impl<const W: usize> Packet<W> {
    /// Rays without origin and direction (both 0), from 0 to infinity, ready otherwise.
    pub fn new() -> Self {
        Packet {
            org_x: [0.0; W],
            org_y: [0.0; W],
            org_z: [0.0; W],
            tnear: [0.0; W],
            dir_x: [0.0; W],
            dir_y: [0.0; W],
            dir_z: [0.0; W],
            time: [0.0; W],
            tfar: [f32::INFINITY; W],
            mask: [u32::MAX; W],
            id: [0; W],
            flags: [0; W],
            ng_x: [0.0; W],
            ng_y: [0.0; W],
            ng_z: [0.0; W],
            u: [0.0; W],
            v: [0.0; W],
            prim_id: [INVALID; W],
            geom_id: [INVALID; W],
            inst_id: [INVALID; W],
            inst_prim_id: [INVALID; W],
        }
    }
}

impl<const W: usize> Default for Packet<W> {
    fn default() -> Self {
        Self::new()
    }
}

/// Proves at compile time that `$ours` begins with the fields of `$theirs`, at the same offsets, and is at least as
/// large and as strictly aligned.
macro_rules! same_layout {
    ($ours:ty, $theirs:ident, $ray:ident, $hit:ident) => {
        const _: () = {
            use std::mem::offset_of;
            assert!(size_of::<$ours>() >= size_of::<sys::$theirs>());
            assert!(align_of::<$ours>() >= align_of::<sys::$theirs>());
            same_layout!(@ray $ours, $theirs, $ray: org_x org_y org_z tnear dir_x dir_y dir_z time tfar mask id flags);
            same_layout!(@hit $ours, $theirs, $hit: ng_x Ng_x, ng_y Ng_y, ng_z Ng_z, u u, v v, prim_id primID,
                geom_id geomID, inst_id instID, inst_prim_id instPrimID);
        };
    };
    (@ray $ours:ty, $theirs:ident, $ray:ident: $($field:ident)*) => {
        $(assert!(offset_of!($ours, $field) == offset_of!(sys::$theirs, ray) + offset_of!(sys::$ray, $field));)*
    };
    (@hit $ours:ty, $theirs:ident, $hit:ident: $($field:ident $name:ident),*) => {
        $(assert!(offset_of!($ours, $field) == offset_of!(sys::$theirs, hit) + offset_of!(sys::$hit, $name));)*
    };
}

same_layout!(Ray, RTCRayHit, RTCRay, RTCHit);
same_layout!(Packet<4>, RTCRayHit4, RTCRay4, RTCHit4);
same_layout!(Packet<8>, RTCRayHit8, RTCRay8, RTCHit8);
same_layout!(Packet<16>, RTCRayHit16, RTCRay16, RTCHit16);
