use std::mem::MaybeUninit;
use std::sync::Arc;

use embree4_sys as sys;

use crate::Device;
use crate::device::check;
use crate::error::Error;
use crate::library::embree;

/// A triangle mesh, ready to be attached to any number of scenes. Clones are handles of the same mesh.
#[derive(Clone, Debug)]
pub struct Mesh(Arc<Geometry>);

impl Mesh {
    /// Copies vertices and triangles into Embree's own memory. Rays whose mask shares a bit with `mask` hit it.
    ///
    /// A triangle with a coordinate that is not finite, or beyond 1.8e18, is never hit.
    ///
    /// # Errors
    /// [`Error::EmptyMesh`], [`Error::MeshTooLarge`], [`Error::IndexOutOfRange`] for the first triangle with a corner
    /// that does not exist, [`Error::Embree`] when memory runs out.
    pub fn new(
        device: &Device,
        mut positions: impl ExactSizeIterator<Item = [f32; 3]>,
        triangles: &[[u32; 3]],
        mask: u32,
    ) -> Result<Mesh, Error> {
        let vertices = positions.len();
        if vertices == 0 || triangles.is_empty() {
            return Err(Error::EmptyMesh { vertices, triangles: triangles.len() });
        }
        // The largest number means "no hit" among the ids.
        if vertices.max(triangles.len()) >= u32::MAX as usize {
            return Err(Error::MeshTooLarge { vertices, triangles: triangles.len() });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= vertices) {
                return Err(Error::IndexOutOfRange { triangle, index, vertices });
            }
        }
        let mut geometry = Geometry::new(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE)?;
        for slot in geometry.buffer(sys::RTC_BUFFER_TYPE_VERTEX, sys::RTC_FORMAT_FLOAT3, vertices)? {
            // Safe code may implement an iterator shorter than it claims: such vertices are never hit.
            slot.write(positions.next().unwrap_or([f32::NAN; 3]));
        }
        let slots = geometry.buffer(sys::RTC_BUFFER_TYPE_INDEX, sys::RTC_FORMAT_UINT3, triangles.len())?;
        for (slot, &corners) in slots.iter_mut().zip(triangles) {
            slot.write(corners);
        }
        geometry.commit(mask)?;
        Ok(Mesh(Arc::new(geometry)))
    }

    pub(crate) fn geometry(&self) -> &Geometry {
        &self.0
    }
}

/// One reference to an Embree geometry and to its device.
#[derive(Debug)]
pub(crate) struct Geometry {
    raw: sys::RTCGeometry,
    device: Device,
}

// SAFETY: Embree's geometries are reference counted and not bound to a thread.
unsafe impl Send for Geometry {}
// SAFETY: shared geometries are only read (attached to scenes, which Embree allows from several threads); everything
// that changes one takes `&mut self` and happens before it is shared.
unsafe impl Sync for Geometry {}

impl Geometry {
    pub(crate) fn new(device: &Device, kind: sys::RTCGeometryType) -> Result<Geometry, Error> {
        // SAFETY: the device is alive, and `kind` is one of the header's.
        let raw = unsafe { embree().rtcNewGeometry(device.raw(), kind) };
        check(Some(device), "rtcNewGeometry")?;
        if raw.is_null() {
            return Err(Error::Embree { call: "rtcNewGeometry", reason: "no geometry and no error returned" });
        }
        Ok(Geometry { raw, device: device.clone() })
    }

    /// Creates and returns a buffer of `count` > 0 items of three 32-bit numbers each; Embree pads it as needed.
    fn buffer<T: ThreeNumbers>(
        &mut self,
        kind: sys::RTCBufferType,
        format: sys::RTCFormat,
        count: usize,
    ) -> Result<&mut [MaybeUninit<T>], Error> {
        // SAFETY: the geometry is alive and not shared yet; slot 0 exists in both kinds of buffer.
        let data = unsafe { embree().rtcSetNewGeometryBuffer(self.raw, kind, 0, format, size_of::<T>(), count) };
        check(Some(&self.device), "rtcSetNewGeometryBuffer")?;
        if data.is_null() {
            return Err(Error::Embree { call: "rtcSetNewGeometryBuffer", reason: "no memory and no error returned" });
        }
        // SAFETY: Embree returned room for `count` items of size_of::<T>() bytes, aligned to 16 bytes, that lives as
        // long as the geometry; nothing else has the pointer, and the contents need not be initialised.
        Ok(unsafe { std::slice::from_raw_parts_mut(data.cast(), count) })
    }

    /// Prepares the geometry to be attached.
    pub(crate) fn commit(&mut self, mask: u32) -> Result<(), Error> {
        // SAFETY: the geometry is alive and not shared yet; its buffers are filled.
        unsafe {
            embree().rtcSetGeometryMask(self.raw, mask);
            embree().rtcCommitGeometry(self.raw);
        }
        check(Some(&self.device), "rtcCommitGeometry")
    }

    pub(crate) fn raw(&self) -> sys::RTCGeometry {
        self.raw
    }

    pub(crate) fn device(&self) -> &Device {
        &self.device
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: we own one reference, given by rtcNewGeometry; scenes hold their own.
        unsafe { embree().rtcReleaseGeometry(self.raw) }
    }
}

/// The two item types of buffers: 12 bytes, alignment 4.
trait ThreeNumbers {}
impl ThreeNumbers for [f32; 3] {}
impl ThreeNumbers for [u32; 3] {}
