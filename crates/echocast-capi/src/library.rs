//! The version and the capabilities of the library.

use crate::guard::{Outcome, guard_or};
use crate::text;
use echocast::cloud::FIELDS;
use echocast::export::FORMATS;
use echocast::{Sensor, scene};
use std::ffi::{CStr, CString, c_char};
use std::ptr;
use std::sync::OnceLock;

const fn number(text: &str) -> u32 {
    let bytes = text.as_bytes();
    let (mut value, mut at) = (0, 0);
    while at < bytes.len() {
        value = 10 * value + (bytes[at] - b'0') as u32;
        at += 1;
    }
    value
}

const MAJOR: u32 = number(env!("CARGO_PKG_VERSION_MAJOR"));
const MINOR: u32 = number(env!("CARGO_PKG_VERSION_MINOR"));
const PATCH: u32 = number(env!("CARGO_PKG_VERSION_PATCH"));

/// Version of the loaded library: major << 24 | minor << 12 | patch. That of the header is ECHOCAST_VERSION.
#[unsafe(no_mangle)]
pub extern "C" fn echocast_version() -> u32 {
    MAJOR << 24 | MINOR << 12 | PATCH
}

/// The version and the optional features of this build as text: "echocast 0.1.0 (fbx, hdf5, mcap)".
///
/// Static, never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn echocast_version_string() -> *const c_char {
    static TEXT: OnceLock<CString> = OnceLock::new();
    let text = || {
        let all = [("fbx", cfg!(feature = "fbx")), ("hdf5", cfg!(feature = "hdf5")), ("mcap", cfg!(feature = "mcap"))];
        let built: Vec<&str> = all.iter().filter(|(_, built)| *built).map(|(name, _)| *name).collect();
        let version = env!("CARGO_PKG_VERSION");
        let text = if built.is_empty() {
            format!("echocast {version}")
        } else {
            format!("echocast {version} ({})", built.join(", "))
        };
        CString::new(text).unwrap_or_default()
    };
    TEXT.get_or_init(text).as_ptr()
}

/// Whether the library has a feature: a format that clouds are written in ("las", "hdf5") or scenes are read from
/// ("gltf", "obj", "fbx"), a column ("true_range"). 1 or 0; 0 for unknown names and for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_has_feature(name: *const c_char) -> i32 {
    guard_or(0, || {
        // SAFETY: `name` is a string (see `text`).
        let name = unsafe { text::required(name, "name") }?;
        let known = ["formats", "scene_formats", "columns"]
            .iter()
            .any(|list| names(list).iter().any(|known| known.to_bytes() == name.as_bytes()));
        Ok(i32::from(known))
    })
}

/// Names that functions accept, one by one: `list` is "presets" (sensors), "columns", "formats" (of clouds),
/// "scene_formats"; `index` counts from 0. NULL after the last, and for an unknown list.
///
/// Static: valid as long as the library is loaded.
///
/// ```c
/// const char *name;
/// for (size_t i = 0; (name = echocast_name("presets", i)) != NULL; ++i)
///     puts(name);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_name(list: *const c_char, index: usize) -> *const c_char {
    guard_or(ptr::null(), || -> Outcome<*const c_char> {
        // SAFETY: `list` is a string (see `text`).
        let list = unsafe { text::required(list, "list") }?;
        Ok(names(list).get(index).map_or(ptr::null(), |name| name.as_ptr()))
    })
}

/// The names of a list, made once.
fn names(list: &str) -> &'static [Name] {
    static LISTS: [OnceLock<Vec<Name>>; 4] = [const { OnceLock::new() }; 4];
    fn all(names: impl IntoIterator<Item = impl Into<Vec<u8>>>) -> Vec<Name> {
        names.into_iter().filter_map(|name| CString::new(name).ok().map(Name)).collect()
    }
    match list {
        "presets" => LISTS[0].get_or_init(|| all(Sensor::presets().into_iter().map(|preset| preset.name))),
        "columns" => LISTS[1].get_or_init(|| all(FIELDS.iter().map(|info| info.name))),
        "formats" => LISTS[2].get_or_init(|| all(FORMATS.iter().map(|format| format.name()))),
        "scene_formats" => LISTS[3].get_or_init(|| all(scene::FORMATS.iter().map(|format| format.name))),
        _ => &[],
    }
}

struct Name(CString);

impl std::ops::Deref for Name {
    type Target = CStr;

    fn deref(&self) -> &CStr {
        &self.0
    }
}
