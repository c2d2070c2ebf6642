use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use embree4_sys as sys;

use crate::device::check;
use crate::error::Error;
use crate::filter::{Candidate, QueryFilter, call_filter};
use crate::library::embree;
use crate::mesh::Geometry;
use crate::{Coherence, Custom, Device, Mesh, Packet, Ray};

/// How much work goes into building the acceleration structure of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Built four times as fast as medium, traced up to twice as slowly: for what is rebuilt every frame.
    Low,
    /// Fastest to trace.
    #[default]
    Medium,
}

/// A scene being assembled from meshes and instances. [`Scene::commit`] makes it ready to trace.
#[derive(Debug)]
pub struct Scene(OwnedScene);

/// A finished scene: immutable, shared by threads, ready to trace. Clones are handles of the same scene.
#[derive(Clone, Debug)]
pub struct CommittedScene(Arc<OwnedScene>);

/// One reference to an Embree scene, and what it depends on. Embree counts references of scenes to their geometries
/// and, though only its source says so, of instances to their scenes; we do not rely on the latter.
#[derive(Debug)]
struct OwnedScene {
    raw: sys::RTCScene,
    device: Device,
    instances: Vec<Instance>,
    customs: Vec<Custom>,
}

/// A scene placed in another one, ready to be attached to any number of scenes. Clones are handles of the same
/// instance.
#[derive(Clone, Debug)]
pub struct Instance(Arc<PlacedScene>);

#[derive(Debug)]
struct PlacedScene {
    geometry: Geometry,
    /// What Embree's geometry refers to; dropped after it.
    of: CommittedScene,
}

// SAFETY: Embree's scenes are reference counted and not bound to a thread.
unsafe impl Send for OwnedScene {}
// SAFETY: what changes a scene takes `&mut self` or consumes it; a shared one is only built and then traced, which
// Embree allows from any number of threads.
unsafe impl Sync for OwnedScene {}

impl Scene {
    /// An empty scene.
    ///
    /// # Errors
    /// [`Error::Embree`] when memory runs out.
    pub fn new(device: &Device, quality: Quality) -> Result<Scene, Error> {
        // SAFETY: the device is alive.
        let raw = unsafe { embree().rtcNewScene(device.raw()) };
        check(Some(device), "rtcNewScene")?;
        if raw.is_null() {
            return Err(Error::Embree { call: "rtcNewScene", reason: "no scene and no error returned" });
        }
        let scene = Scene(OwnedScene { raw, device: device.clone(), instances: Vec::new(), customs: Vec::new() });
        let quality = match quality {
            Quality::Low => sys::RTC_BUILD_QUALITY_LOW,
            Quality::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
        };
        // SAFETY: the scene is alive and ours alone.
        unsafe { embree().rtcSetSceneBuildQuality(raw, quality) };
        check(Some(device), "rtcSetSceneBuildQuality")?;
        // No ray passes between triangles that share an edge; one that is aimed exactly at a corner still may, if
        // rarely (Embree's issues 174 and 181). And `intersect_where` may call back, which without a filter has no
        // measurable cost.
        let flags = sys::RTC_SCENE_FLAG_ROBUST | sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
        // SAFETY: as above.
        unsafe { embree().rtcSetSceneFlags(raw, flags) };
        check(Some(device), "rtcSetSceneFlags")?;
        Ok(scene)
    }

    /// Adds a mesh and returns its geometry id, the least that is free: 0, 1, 2 ... in the order of attachment.
    ///
    /// # Errors
    /// [`Error::OtherDevice`]; [`Error::Embree`] when memory runs out.
    pub fn attach_mesh(&mut self, mesh: &Mesh) -> Result<u32, Error> {
        self.check_device(mesh.geometry())?;
        // SAFETY: both handles are alive and of one device; the scene takes a reference of its own.
        let id = unsafe { embree().rtcAttachGeometry(self.0.raw, mesh.geometry().raw()) };
        check(Some(&self.0.device), "rtcAttachGeometry")?;
        Ok(id)
    }

    /// Adds an instance with the geometry id `id`, which hits report as `inst_id`. Every id below the greatest costs a
    /// slot.
    ///
    /// # Errors
    /// [`Error::OtherDevice`]; [`Error::Embree`] when memory runs out, or if something has this id already.
    pub fn attach_instance(&mut self, instance: &Instance, id: u32) -> Result<(), Error> {
        // First, so that Embree never holds an instance of a scene that we do not.
        self.0.instances.push(instance.clone());
        self.attach(&instance.0.geometry, id)
    }

    /// Adds a shape with the geometry id `id`, as [`Scene::attach_instance`].
    ///
    /// # Errors
    /// As [`Scene::attach_instance`].
    pub fn attach_shape(&mut self, shape: &Custom, id: u32) -> Result<(), Error> {
        // First, so that Embree never holds a shape that we do not.
        self.0.customs.push(shape.clone());
        self.attach(shape.geometry(), id)
    }

    fn check_device(&self, geometry: &Geometry) -> Result<(), Error> {
        if geometry.device().is(&self.0.device) { Ok(()) } else { Err(Error::OtherDevice) }
    }

    fn attach(&mut self, geometry: &Geometry, id: u32) -> Result<(), Error> {
        self.check_device(geometry)?;
        // SAFETY: both handles are alive and of one device; the scene takes a reference of its own.
        unsafe { embree().rtcAttachGeometryByID(self.0.raw, geometry.raw(), id) };
        check(Some(&self.0.device), "rtcAttachGeometryByID")
    }

    /// Builds what is needed to trace the scene, on the calling thread.
    ///
    /// # Errors
    /// [`Error::Embree`] when memory runs out.
    pub fn commit(self) -> Result<CommittedScene, Error> {
        self.commit_with(Pace::Now, |_| ())
    }

    /// [`Scene::commit`] with the help of other threads: `call` makes each of them run [`Joint::help`]. It need not
    /// wait for them, and they may come too late or never.
    ///
    /// # Errors
    /// As [`Scene::commit`].
    pub fn commit_with(self, pace: Pace, call: impl FnOnce(&Arc<Joint>)) -> Result<CommittedScene, Error> {
        let scene = Arc::new(self.0);
        let spare = match pace {
            Pace::Now => 0,
            Pace::Aside => 1,
        };
        let open = OpenScene { scene: Some(scene.clone()), inside: 0, error: None };
        let joint = Arc::new(Joint { spare, open: Mutex::new(open), left: Condvar::new() });
        call(&joint);
        let own = scene.device.slots().with(spare, || scene.build());
        joint.close(own)?;
        Ok(CommittedScene(scene))
    }
}

/// Priority of a scene when several scenes of one device are built at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As fast as possible.
    Now,
    /// In the background: leaves a thread for others that build, if the machine has more than one.
    Aside,
}

/// A scene that several threads build together.
pub struct Joint {
    /// Places left free for other builds.
    spare: usize,
    open: Mutex<OpenScene>,
    /// Signals that a helper has left.
    left: Condvar,
}

struct OpenScene {
    /// `None`: it has been built.
    scene: Option<Arc<OwnedScene>>,
    /// Helpers at work.
    inside: usize,
    error: Option<Error>,
}

impl Joint {
    /// Helps build until nothing is left to do; does nothing if there is no free place.
    pub fn help(&self) {
        let Some(scene) = self.enter() else { return };
        let built = scene.device.slots().try_with(self.spare, || scene.build());
        drop(scene);
        let mut open = self.lock();
        open.inside -= 1;
        if let Some(Err(error)) = built {
            open.error.get_or_insert(error);
        }
        self.left.notify_all();
    }

    fn enter(&self) -> Option<Arc<OwnedScene>> {
        let mut open = self.lock();
        let scene = open.scene.clone()?;
        open.inside += 1;
        Some(scene)
    }

    /// Admits no more helpers and waits for those at work; `own` is the committing thread's result.
    fn close(&self, own: Result<(), Error>) -> Result<(), Error> {
        let mut open = self.lock();
        open.scene = None;
        let mut open = self.left.wait_while(open, |open| open.inside > 0).unwrap_or_else(PoisonError::into_inner);
        own.and(open.error.take().map_or(Ok(()), Err))
    }

    fn lock(&self) -> MutexGuard<'_, OpenScene> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Joint").field("spare", &self.spare).finish_non_exhaustive()
    }
}

impl OwnedScene {
    /// Builds the scene with all threads that call this at the same time.
    fn build(&self) -> Result<(), Error> {
        // SAFETY: the scene is alive, everything attached to it is committed, and nothing else is done with it before
        // all calls have returned. Embree lets any number of threads join; late ones find nothing to do.
        unsafe { embree().rtcJoinCommitScene(self.raw) };
        check(Some(&self.device), "rtcJoinCommitScene")
    }
}

impl Instance {
    /// Places `of` in the world. Rays whose mask shares a bit with `mask` hit it.
    ///
    /// `world_from_object` is the 3x4 matrix column by column: the images of x, y and z, then the translation. It may
    /// scale, shear and mirror.
    ///
    /// # Errors
    /// [`Error::NestedInstance`] if `of` contains instances; [`Error::Transform`] if the matrix is not finite or has no
    /// inverse in f32; [`Error::Embree`] when memory runs out.
    pub fn new(of: &CommittedScene, world_from_object: [f32; 12], mask: u32) -> Result<Instance, Error> {
        if !(of.0.instances.is_empty() && of.0.customs.is_empty()) {
            return Err(Error::NestedInstance);
        }
        if !is_invertible(&world_from_object) {
            return Err(Error::Transform { transform: world_from_object });
        }
        let device = &of.0.device;
        let mut geometry = Geometry::new(device, sys::RTC_GEOMETRY_TYPE_INSTANCE)?;
        // SAFETY: both handles are alive and of one device, and the geometry is ours alone. `PlacedScene` keeps the
        // scene alive as long as the geometry.
        unsafe { embree().rtcSetGeometryInstancedScene(geometry.raw(), of.0.raw) };
        check(Some(device), "rtcSetGeometryInstancedScene")?;
        // SAFETY: the format names 12 floats without padding, and Embree copies them.
        unsafe {
            embree().rtcSetGeometryTransform(
                geometry.raw(),
                0,
                sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                world_from_object.as_ptr().cast(),
            );
        }
        check(Some(device), "rtcSetGeometryTransform")?;
        geometry.commit(mask)?;
        Ok(Instance(Arc::new(PlacedScene { geometry, of: of.clone() })))
    }

    /// The scene that is placed.
    pub fn of(&self) -> &CommittedScene {
        &self.0.of
    }
}

/// Handles of the same instance are equal.
impl PartialEq for Instance {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl CommittedScene {
    pub(crate) fn raw(&self) -> sys::RTCScene {
        self.0.raw
    }

    /// Whether it was created with `device`.
    pub fn is_of(&self, device: &Device) -> bool {
        self.0.device.is(device)
    }

    /// Lowest and highest x, y, z of its contents; if empty the lowest are +infinity, the highest -infinity.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let mut bounds = sys::RTCBounds {
            lower_x: 0.0,
            lower_y: 0.0,
            lower_z: 0.0,
            align0: 0.0,
            upper_x: 0.0,
            upper_y: 0.0,
            upper_z: 0.0,
            align1: 0.0,
        };
        // SAFETY: the scene is alive and committed, and Embree writes one RTCBounds, which is aligned as its type says.
        unsafe { embree().rtcGetSceneBounds(self.0.raw, &raw mut bounds) };
        [[bounds.lower_x, bounds.lower_y, bounds.lower_z], [bounds.upper_x, bounds.upper_y, bounds.upper_z]]
    }

    /// Finds the closest hit of each ray whose lane in `valid` is -1; lanes where it is 0 stay as they are.
    ///
    /// `W` is 4, 8 or 16 (anything else does not compile); [`Device::packet_width`] gives the fastest. A lane with a
    /// coordinate that is not finite, or with neither -1 nor 0 in `valid`, gives a meaningless hit or none.
    #[inline]
    pub fn intersect<const W: usize>(&self, valid: &[i32; W], rays: &mut Packet<W>, coherence: Coherence) {
        let mut query_filter = QueryFilter::ALL;
        let mut arguments = arguments(coherence.flags(), &mut query_filter);
        // SAFETY: the context outlives the call, and there is no filter.
        unsafe { self.intersect_with(valid, rays, &mut arguments) }
    }

    /// [`CommittedScene::intersect`] of rays that pass through every hit that `counts` rejects. It is called for hits
    /// in any order, for some more than once and for some that are not the closest, so it must decide by the hit alone.
    /// A panic in it ends the process.
    #[inline]
    pub fn intersect_where<const W: usize, F: Fn(&Candidate) -> bool>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        coherence: Coherence,
        counts: &F,
    ) {
        let mut query_filter = QueryFilter::new(counts);
        let flags = coherence.flags() | sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        let mut arguments =
            sys::RTCIntersectArguments { filter: Some(call_filter), ..arguments(flags, &mut query_filter) };
        // SAFETY: `call_filter` may be called with this context: it begins a `QueryFilter` that outlives the call, and
        // the pointer to it is one to the whole of it.
        unsafe { self.intersect_with(valid, rays, &mut arguments) }
    }

    /// # Safety
    /// The filter of `arguments`, if any, may be called with their context.
    #[inline]
    unsafe fn intersect_with<const W: usize>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        arguments: &mut sys::RTCIntersectArguments,
    ) {
        const { assert!(W == 4 || W == 8 || W == 16, "Embree traces packets of 4, 8 and 16 rays") };
        let valid = Aligned(*valid);
        let (valid, scene, rays) = (valid.0.as_ptr(), self.0.raw, std::ptr::from_mut(rays));
        // SAFETY: the scene is alive and committed. `valid` has W lanes, aligned to 64 bytes. `rays` has the size,
        // alignment and fields of RTCRayHitW (proved where Packet is defined), and Embree writes nothing else.
        unsafe {
            match W {
                4 => embree().rtcIntersect4(valid, scene, rays.cast(), arguments),
                8 => embree().rtcIntersect8(valid, scene, rays.cast(), arguments),
                _ => embree().rtcIntersect16(valid, scene, rays.cast(), arguments),
            }
        }
    }

    /// Finds which rays hit anything at all, of those whose lane in `valid` is -1: their `tfar` becomes -infinity, all
    /// else stays. Faster than [`CommittedScene::intersect`]; the same conditions apply.
    #[inline]
    pub fn occlude<const W: usize>(&self, valid: &[i32; W], rays: &mut Packet<W>, coherence: Coherence) {
        let mut query_filter = QueryFilter::ALL;
        let mut arguments = occlusion(coherence.flags(), &mut query_filter);
        // SAFETY: the context outlives the call, and there is no filter.
        unsafe { self.occlude_with(valid, rays, &mut arguments) }
    }

    /// [`CommittedScene::occlude`] by hits that `counts` does not reject, see [`CommittedScene::intersect_where`].
    #[inline]
    pub fn occlude_where<const W: usize, F: Fn(&Candidate) -> bool>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        coherence: Coherence,
        counts: &F,
    ) {
        let mut query_filter = QueryFilter::new(counts);
        let flags = coherence.flags() | sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        let mut arguments =
            sys::RTCOccludedArguments { filter: Some(call_filter), ..occlusion(flags, &mut query_filter) };
        // SAFETY: as in `intersect_where`.
        unsafe { self.occlude_with(valid, rays, &mut arguments) }
    }

    /// # Safety
    /// The filter of `arguments`, if any, may be called with their context.
    #[inline]
    unsafe fn occlude_with<const W: usize>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        arguments: &mut sys::RTCOccludedArguments,
    ) {
        const { assert!(W == 4 || W == 8 || W == 16, "Embree traces packets of 4, 8 and 16 rays") };
        let valid = Aligned(*valid);
        let (valid, scene, rays) = (valid.0.as_ptr(), self.0.raw, std::ptr::from_mut(rays));
        // SAFETY: as in `intersect_with`: an RTCRayHitW begins with an RTCRayW (proved where Packet is defined), and
        // Embree writes nothing but its tfar.
        unsafe {
            match W {
                4 => embree().rtcOccluded4(valid, scene, rays.cast(), arguments),
                8 => embree().rtcOccluded8(valid, scene, rays.cast(), arguments),
                _ => embree().rtcOccluded16(valid, scene, rays.cast(), arguments),
            }
        }
    }

    /// Finds the closest hit of one ray.
    #[inline]
    pub fn intersect1(&self, ray: &mut Ray) {
        let mut query_filter = QueryFilter::ALL;
        let mut arguments = arguments(Coherence::Incoherent.flags(), &mut query_filter);
        // SAFETY: the context outlives the call; the scene is alive and committed; `ray` has the size, alignment and
        // fields of RTCRayHit (proved where Ray is defined), and Embree writes nothing else.
        unsafe { embree().rtcIntersect1(self.0.raw, std::ptr::from_mut(ray).cast(), &mut arguments) }
    }
}

/// Embree loads the lanes of `valid` as one vector, which must be aligned to its size.
#[repr(align(64))]
struct Aligned<const W: usize>([i32; W]);

/// What `rtcInitIntersectArguments` sets, `flags`, and the context of `query_filter`.
#[inline]
fn arguments(flags: sys::RTCRayQueryFlags, query_filter: &mut QueryFilter) -> sys::RTCIntersectArguments {
    sys::RTCIntersectArguments {
        flags,
        feature_mask: sys::RTC_FEATURE_FLAG_ALL,
        context: std::ptr::from_mut(query_filter).cast(),
        filter: None,
        intersect: None,
    }
}

/// What `rtcInitOccludedArguments` sets, `flags`, and the context of `query_filter`.
#[inline]
fn occlusion(flags: sys::RTCRayQueryFlags, query_filter: &mut QueryFilter) -> sys::RTCOccludedArguments {
    sys::RTCOccludedArguments {
        flags,
        feature_mask: sys::RTC_FEATURE_FLAG_ALL,
        context: std::ptr::from_mut(query_filter).cast(),
        filter: None,
        occluded: None,
    }
}

/// Whether [`Instance::new`] accepts the transform `m`: Embree inverts it in f32, and without an inverse every ray
/// would become NaN.
pub fn is_invertible(m: &[f32; 12]) -> bool {
    let [a, b, c, d, e, f, g, h, i] = std::array::from_fn(|k| f64::from(m[k]));
    let determinant = (a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)) as f32;
    m.iter().all(|x| x.is_finite()) && determinant.is_normal() && determinant.recip().is_normal()
}

impl Drop for OwnedScene {
    fn drop(&mut self) {
        // SAFETY: we own one reference, given by rtcNewScene. The fields dropped after this outlive it.
        unsafe { embree().rtcReleaseScene(self.raw) }
    }
}
