use std::ffi::CString;
use std::fmt;
use std::sync::Arc;

use embree4_sys as sys;

use crate::error::{Error, check};

/// First minor version of Embree 4 with the memory layout of 4.3.3, whose header the bindings come from.
pub(crate) const OLDEST_MINOR: u32 = 3;

/// An Embree device: the factory of meshes and scenes. Clones are handles of the same device; what it made keeps it
/// alive.
#[derive(Clone)]
pub struct Device(Arc<Owned>);

struct Owned {
    raw: sys::RTCDevice,
    version: (u32, u32, u32),
    packet_width: usize,
}

// SAFETY: Embree's device is reference counted and may be used from any number of threads at once (its error state is
// per thread).
unsafe impl Send for Owned {}
// SAFETY: as above.
unsafe impl Sync for Owned {}

impl Device {
    /// A device in Embree's default configuration: all cores build, the CPU's best instruction set.
    ///
    /// # Errors
    /// [`Error::Version`] when the library loaded is older than 4.3 or newer than 4.x; [`Error::Embree`] when Embree
    /// cannot run on this CPU or is out of memory.
    pub fn new() -> Result<Device, Error> {
        Self::with_config("")
    }

    /// A device in a configuration of its own, as in `"threads=1"` or `"threads=2,isa=avx2"`. Keys are those of
    /// `rtcNewDevice`; Embree ignores those it does not know.
    ///
    /// # Errors
    /// As [`Device::new`], and [`Error::Config`] when `config` contains a NUL character.
    pub fn with_config(config: &str) -> Result<Device, Error> {
        let text = CString::new(config).map_err(|_| Error::Config { config: config.into() })?;
        // SAFETY: `text` is a C string that outlives the call; Embree copies what it needs.
        let raw = unsafe { sys::rtcNewDevice(text.as_ptr()) };
        if raw.is_null() {
            check(None, "rtcNewDevice")?;
            return Err(Error::Embree { call: "rtcNewDevice", reason: "no device and no error returned" });
        }
        let mut owned = Owned { raw, version: (0, 0, 0), packet_width: 4 }; // from here on released by Drop
        let number = |property| u32::try_from(owned.property(property)).unwrap_or(0);
        owned.version = (
            number(sys::RTC_DEVICE_PROPERTY_VERSION_MAJOR),
            number(sys::RTC_DEVICE_PROPERTY_VERSION_MINOR),
            number(sys::RTC_DEVICE_PROPERTY_VERSION_PATCH),
        );
        check_version(owned.version)?;
        if owned.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0 {
            owned.packet_width = 16;
        } else if owned.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0 {
            owned.packet_width = 8;
        }
        let device = Device(Arc::new(owned));
        check(Some(&device), "rtcGetDeviceProperty")?;
        Ok(device)
    }

    /// Major, minor and patch number of the library that runs.
    pub fn version(&self) -> (u32, u32, u32) {
        self.0.version
    }

    /// The widest ray packet this machine traces natively: 16 (AVX-512), 8 (AVX) or 4. Wider packets work, but run no
    /// faster than single rays.
    pub fn packet_width(&self) -> usize {
        self.0.packet_width
    }

    pub(crate) fn raw(&self) -> sys::RTCDevice {
        self.0.raw
    }

    pub(crate) fn is(&self, other: &Device) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("version", &self.0.version).field("packet_width", &self.0.packet_width).finish()
    }
}

impl Owned {
    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: `self.raw` is a live device; an unknown property sets an error and returns 0.
        unsafe { sys::rtcGetDeviceProperty(self.raw, property) }
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        // SAFETY: we own one reference, given by rtcNewDevice, and give it back once.
        unsafe { sys::rtcReleaseDevice(self.raw) }
    }
}

/// 4.2 has smaller hits (80 bytes instead of 96 for one ray); what 5.0 will have is not known.
fn check_version(found: (u32, u32, u32)) -> Result<(), Error> {
    if found.0 == 4 && found.1 >= OLDEST_MINOR { Ok(()) } else { Err(Error::Version { found }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_with_another_layout_are_refused() {
        for fits in [(4, 3, 0), (4, 3, 3), (4, 4, 0), (4, 10, 1)] {
            assert_eq!(check_version(fits), Ok(()));
        }
        for other in [(3, 13, 5), (4, 2, 9), (5, 0, 0), (5, 3, 0), (0, 0, 0)] {
            assert_eq!(check_version(other), Err(Error::Version { found: other }));
        }
        assert_eq!(
            check_version((4, 2, 1)).unwrap_err().to_string(),
            "the Embree library loaded is version 4.2.1, but 4.3 or a later 4.x is needed"
        );
    }
}
