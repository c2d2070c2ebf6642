//! Embree's library, opened at run time and for this program alone: no function of it is bound from or into what else
//! is in the process, which may have an Embree of its own.

use std::ffi::{CStr, OsString, c_void};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::{env, fs};

use embree4_sys::Functions;
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};

use crate::error::Error;

/// File or folder of the library; where it is set, nothing else is tried.
const VARIABLE: &str = "ECHOCAST_EMBREE";

const NAME: &str = "libembree4.so.4";

/// Embree's functions and where they come from.
struct Opened {
    functions: Functions,
    path: PathBuf,
}

static OPENED: OnceLock<Opened> = OnceLock::new();

/// Embree's functions.
///
/// # Panics
/// Before [`open`] has succeeded, so never where there is a device.
#[inline]
pub(crate) fn embree() -> &'static Functions {
    &OPENED.get().expect("a device exists, so the library is open").functions
}

/// Where the open library comes from.
pub(crate) fn path() -> &'static Path {
    OPENED.get().map_or(Path::new(NAME), |opened| &opened.path)
}

/// Opens the library, once.
pub(crate) fn open() -> Result<(), Error> {
    static OPENING: Mutex<()> = Mutex::new(());
    let _one_at_a_time = OPENING.lock().unwrap_or_else(PoisonError::into_inner);
    if OPENED.get().is_none() {
        let opened = find()?;
        OPENED.get_or_init(|| opened);
    }
    Ok(())
}

fn find() -> Result<Opened, Error> {
    if let Some(given) = env::var_os(VARIABLE) {
        let given = PathBuf::from(given);
        let file = if given.is_dir() { libraries_in(&given).into_iter().next() } else { Some(given.clone()) };
        let file = file.ok_or(Error::Library { searched: format!("{}, the folder in {VARIABLE}", given.display()) })?;
        return open_file(&file).map_err(|reason| Error::Unusable { path: file, reason });
    }
    let folders = folders();
    let mut unusable = None;
    // The last is the loader's own search, by name.
    for file in folders.iter().flat_map(|folder| libraries_in(folder)).chain([NAME.into()]) {
        match open_file(&file) {
            Ok(opened) => return Ok(opened),
            Err(reason) if file.is_file() => unusable = unusable.or(Some(Error::Unusable { path: file, reason })),
            Err(_) => {}
        }
    }
    let searched = || folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ");
    Err(unusable.unwrap_or_else(|| Error::Library { searched: searched() }))
}

/// The folders that are searched, in order.
fn folders() -> Vec<PathBuf> {
    let mut folders = Vec::new();
    // Beside the program or library that this code is in, where installing it puts an Embree of its own.
    let own = own_file();
    if let Some(folder) = own.as_deref().and_then(Path::parent) {
        folders.extend([folder.to_path_buf(), folder.join("echocast"), folder.join("../lib/echocast")]);
    }
    // While it is developed: where `scripts/setup` puts one, above the program or the package that cargo runs.
    let package = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    for below in own.as_deref().into_iter().chain(package.as_deref()) {
        folders.extend(below.ancestors().map(|above| above.join(".embree/lib")).filter(|folder| folder.is_dir()));
    }
    // Of the user, also where pip put the package embreex.
    let home = || Some(PathBuf::from(env::var_os("HOME")?).join(".local/share"));
    if let Some(data) = env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|data| data.is_absolute()).or_else(home)
    {
        folders.extend([data.join("echocast"), data.join("echocast/embreex.libs")]);
    }
    let multiarch = format!("/usr/lib/{}-linux-gnu", env::consts::ARCH);
    folders.extend([format!("{multiarch}/echocast"), multiarch].map(PathBuf::from));
    let others = ["/usr/local/lib/echocast", "/usr/lib64", "/usr/lib", "/usr/local/lib64", "/usr/local/lib"];
    folders.extend(others.map(PathBuf::from));
    folders
}

/// What may be the library in a `folder`: `libembree4.so.4`, or, of a Python wheel, `libembree4-4aef3270.so.4`.
fn libraries_in(folder: &Path) -> Vec<PathBuf> {
    let is_one = |name: &str| name == NAME || name.starts_with("libembree4-") && name.ends_with(".so.4");
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<_> =
        entries.filter(|entry| entry.file_name().to_str().is_some_and(is_one)).map(|entry| entry.path()).collect();
    found.sort_unstable();
    found
}

fn open_file(path: &Path) -> Result<Opened, String> {
    // SAFETY: Embree's and TBB's initializers have no conditions.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL | own_symbols_first()) };
    let library = library.map_err(|error| error.to_string())?;
    // SAFETY: functions of these names have the types of Embree's header in all versions of 4; its version is checked
    // before anything else is called.
    let functions = unsafe { Functions::from_library(library) }.map_err(|error| error.to_string())?;
    Ok(Opened { functions, path: path.to_path_buf() })
}

/// `RTLD_DEEPBIND`: Embree calls its own functions and its own TBB, even where the process has others under the same
/// names. Not under AddressSanitizer, which then ends the process.
fn own_symbols_first() -> i32 {
    // SAFETY: looks up a name, which is a C string.
    let sanitizer = unsafe { libc::dlsym(libc::RTLD_DEFAULT, c"__asan_init".as_ptr()) };
    if sanitizer.is_null() { libc::RTLD_DEEPBIND } else { 0 }
}

/// The program or library that this code is part of.
fn own_file() -> Option<PathBuf> {
    let mut info = libc::Dl_info {
        dli_fname: std::ptr::null(),
        dli_fbase: std::ptr::null_mut(),
        dli_sname: std::ptr::null(),
        dli_saddr: std::ptr::null_mut(),
    };
    let here: fn() -> Option<PathBuf> = own_file;
    // SAFETY: any address may be asked about, and `info` is written or left as it is.
    let found = unsafe { libc::dladdr(here as *const c_void, &raw mut info) } != 0 && !info.dli_fname.is_null();
    if !found {
        return None;
    }
    // SAFETY: dladdr gave a C string that lives as long as the file is loaded, which contains this function.
    let name = unsafe { CStr::from_ptr(info.dli_fname) };
    let path = PathBuf::from(OsString::from_vec(name.to_bytes().to_vec()));
    // Of a program the name is what it was called by.
    let path = if path.is_file() { path } else { env::current_exe().ok()? };
    path.canonicalize().ok()
}
