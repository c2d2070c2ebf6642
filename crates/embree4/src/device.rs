use std::ffi::CString;
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::{fmt, thread};

use embree4_sys as sys;

use crate::error::{Error, OLDEST_MINOR, OUT_OF_MEMORY};
use crate::library::{self, embree};

/// An Embree device: the factory of meshes and scenes. Clones are handles of the same device; what it created keeps it
/// alive.
#[derive(Clone)]
pub struct Device(Arc<OwnedDevice>);

struct OwnedDevice {
    raw: sys::RTCDevice,
    version: (u32, u32, u32),
    packet_width: usize,
    slots: BuilderSlots,
}

// SAFETY: Embree's device is reference counted and may be used from any number of threads at once (its error state is
// per thread).
unsafe impl Send for OwnedDevice {}
// SAFETY: as above.
unsafe impl Sync for OwnedDevice {}

impl Device {
    /// A device for the CPU's best instruction set. It starts no thread, now or later: scenes are built by the threads
    /// that commit them.
    ///
    /// # Errors
    /// [`Error::Library`] and [`Error::Unusable`] if there is no library of Embree, or none that can be opened;
    /// [`Error::Version`] if it is older than 4.3 or newer than 4.x; [`Error::Embree`] if Embree cannot run on this CPU or
    /// is out of memory.
    pub fn new() -> Result<Device, Error> {
        Self::with_config("")
    }

    /// A device with a custom configuration, such as `"isa=avx2"`. Keys are those of `rtcNewDevice`; Embree ignores
    /// unknown ones, and `threads` and `user_threads` are reserved.
    ///
    /// # Errors
    /// As [`Device::new`], and [`Error::Config`] when `config` contains a NUL character.
    pub fn with_config(config: &str) -> Result<Device, Error> {
        // As many threads as TBB has places for, all of them reserved for callers: TBB starts none of its own, which
        // would end the process if the system refused, and does not limit other users of TBB in this process.
        let places = "threads=65536,user_threads=65536";
        let text = CString::new(format!("{places},{config}")).map_err(|_| Error::Config { config: config.into() })?;
        library::open()?;
        // SAFETY: `text` is a C string that outlives the call; Embree copies what it needs.
        let raw = unsafe { embree().rtcNewDevice(text.as_ptr()) };
        if raw.is_null() {
            check(None, "rtcNewDevice")?;
            return Err(Error::Embree { call: "rtcNewDevice", reason: "no device and no error returned" });
        }
        let mut owned = OwnedDevice { raw, version: (0, 0, 0), packet_width: 4, slots: BuilderSlots::new() }; // released by Drop from here on
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

    /// Major, minor and patch number of the running library.
    pub fn version(&self) -> (u32, u32, u32) {
        self.0.version
    }

    /// The widest ray packet this machine traces natively: 16 (AVX-512), 8 (AVX) or 4. Wider packets work, but run no
    /// faster than single rays.
    pub fn packet_width(&self) -> usize {
        self.0.packet_width
    }

    /// Threads that can build at the same time.
    pub fn build_threads(&self) -> usize {
        self.0.slots.count
    }

    pub(crate) fn slots(&self) -> &BuilderSlots {
        &self.0.slots
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

impl OwnedDevice {
    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: `self.raw` is a live device; an unknown property sets an error and returns 0.
        unsafe { embree().rtcGetDeviceProperty(self.raw, property) }
    }
}

impl Drop for OwnedDevice {
    fn drop(&mut self) {
        // SAFETY: we own one reference, given by rtcNewDevice, and give it back once.
        unsafe { embree().rtcReleaseDevice(self.raw) }
    }
}

/// The places for threads that build a device's scenes, as many as TBB has for them. With one more, TBB would start a
/// thread to make room.
pub(crate) struct BuilderSlots {
    count: usize,
    free: Mutex<usize>,
    freed: Condvar,
}

impl BuilderSlots {
    fn new() -> BuilderSlots {
        /// TBB counts cores only once, too.
        static COUNT: OnceLock<usize> = OnceLock::new();
        let count = *COUNT.get_or_init(|| thread::available_parallelism().map_or(1, usize::from));
        BuilderSlots { count, free: Mutex::new(count), freed: Condvar::new() }
    }

    /// Does `work` in a place, for which it waits; `spare` others stay free, if there are that many.
    pub fn with<R>(&self, spare: usize, work: impl FnOnce() -> R) -> R {
        let spare = spare.min(self.count - 1);
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut free = self.freed.wait_while(free, |free| *free <= spare).unwrap_or_else(PoisonError::into_inner);
        *free -= 1;
        drop(free);
        self.leave_after(work)
    }

    /// [`BuilderSlots::with`] if a place is free right now.
    pub fn try_with<R>(&self, spare: usize, work: impl FnOnce() -> R) -> Option<R> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        if *free <= spare {
            return None;
        }
        *free -= 1;
        drop(free);
        Some(self.leave_after(work))
    }

    fn leave_after<R>(&self, work: impl FnOnce() -> R) -> R {
        /// Frees the place, even if `work` panics.
        struct Leave<'a>(&'a BuilderSlots);
        impl Drop for Leave<'_> {
            fn drop(&mut self) {
                *self.0.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
                // Waiting threads may require different numbers of free places.
                self.0.freed.notify_all();
            }
        }
        let _leave = Leave(self);
        work()
    }
}

/// Reads and clears the calling thread's error, the first since the last read. `device` is `None` if there is no device
/// because its creation failed.
pub(crate) fn check(device: Option<&Device>, call: &'static str) -> Result<(), Error> {
    let raw = device.map_or(std::ptr::null_mut(), Device::raw);
    // SAFETY: `raw` is null, which Embree allows here, or a live device.
    let code = unsafe { embree().rtcGetDeviceError(raw) };
    let reason = match code {
        sys::RTC_ERROR_NONE => return Ok(()),
        sys::RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        sys::RTC_ERROR_INVALID_OPERATION => "invalid operation",
        sys::RTC_ERROR_OUT_OF_MEMORY => OUT_OF_MEMORY,
        sys::RTC_ERROR_UNSUPPORTED_CPU => "this CPU is not supported",
        sys::RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    };
    Err(Error::Embree { call, reason })
}

/// 4.2 has smaller hits (80 bytes instead of 96 for one ray); 5.0 is unknown.
fn check_version(found: (u32, u32, u32)) -> Result<(), Error> {
    if found.0 == 4 && found.1 >= OLDEST_MINOR {
        Ok(())
    } else {
        Err(Error::Version { found, path: library::path().to_path_buf() })
    }
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
            let refused = check_version(other);
            assert!(matches!(refused, Err(Error::Version { found, .. }) if found == other), "{refused:?}");
        }
        let sentence = check_version((4, 2, 1)).unwrap_err().to_string();
        assert!(sentence.ends_with("is Embree 4.2.1, but 4.3 or a later 4.x is needed"), "{sentence}");
    }
}
