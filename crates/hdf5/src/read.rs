//! Reading of untrusted files: the safe crate assumes without a check that names in them, and what errors quote from
//! them, are UTF-8, and its types for texts have one width. Here all of these are bytes.

use crate::{Id, error, keep_from_children};
use hdf5_sys::h5::{H5_index_t, H5_iter_order_t, HADDR_UNDEF, herr_t, hsize_t};
use hdf5_sys::h5d::{
    H5D_layout_t, H5Dget_create_plist, H5Dget_offset, H5Dget_space, H5Dget_storage_size, H5Dget_type, H5Dopen2, H5Dread,
};
use hdf5_sys::h5f::{H5F_ACC_RDONLY, H5Fopen};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5l::{H5L_info_t, H5Lexists, H5Literate};
use hdf5_sys::h5p::{
    H5P_CLS_FILE_ACCESS, H5P_DEFAULT, H5Pcreate, H5Pget_chunk, H5Pget_external_count, H5Pget_layout, H5Pset_fapl_sec2,
    H5Pset_file_locking,
};
use hdf5_sys::h5s::{
    H5S_ALL, H5S_seloper_t, H5Screate_simple, H5Sget_simple_extent_dims, H5Sget_simple_extent_ndims,
    H5Sselect_hyperslab,
};
use hdf5_sys::h5t::{
    H5T_NATIVE_DOUBLE, H5T_class_t, H5T_str_t, H5Tget_class, H5Tget_size, H5Tget_strpad, H5Tis_variable_str,
};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::ptr;

/// A file that is open for reading.
#[derive(Debug)]
pub struct Reader(Id);

/// A dataset of a file.
#[derive(Debug)]
pub struct Dataset {
    id: Id,
    of: Id,
    /// Type of its elements.
    pub kind: Kind,
    /// Size of an element in the file, bytes.
    pub size: usize,
    /// Number of elements along each axis; empty for a single one.
    pub shape: Vec<u64>,
    /// Where the elements are.
    pub place: StorageLayout,
}

/// Type of the elements of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Whole numbers or floats.
    Numbers,
    /// Texts of the same width.
    Texts,
    /// Texts of various lengths, in heaps.
    AnyTexts,
    /// Lists of various lengths.
    Lists,
    /// Something else, with its name.
    Other(&'static str),
}

/// Where a dataset is in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StorageLayout {
    /// In its header.
    Compact,
    /// Contiguous, from this byte on; `None`: nothing was ever written.
    Together(Option<u64>),
    /// In chunks of this shape.
    Chunks(Vec<u64>),
    /// In other files.
    Elsewhere,
}

/// Makes `call`, whose result is below 0 if it fails.
///
/// # Errors
/// That of HDF5.
fn checked<T: Copy + Default + PartialOrd>(call: impl FnOnce() -> T) -> io::Result<T> {
    hdf5::sync::sync(|| {
        let answer = call();
        if answer < T::default() { Err(error::last()) } else { Ok(answer) }
    })
}

fn id(call: impl FnOnce() -> hid_t) -> io::Result<Id> {
    checked(call).map(Id)
}

fn c_text(name: &str) -> io::Result<CString> {
    CString::new(name).map_err(|_| io::Error::other("HDF5: a name with a NUL byte"))
}

/// The path as the C library expects it.
#[cfg(unix)]
fn c_path(path: &Path) -> io::Result<CString> {
    use std::os::unix::ffi::OsStrExt as _;
    CString::new(path.as_os_str().as_bytes()).map_err(|_| io::Error::other("HDF5: a path with a NUL byte"))
}

#[cfg(not(unix))]
fn c_path(path: &Path) -> io::Result<CString> {
    path.to_str().map_or_else(|| Err(io::Error::other("HDF5: a path that is not UTF-8")), c_text)
}

impl Reader {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// The system's; a file that is not HDF5.
    pub fn open(path: &Path) -> io::Result<Reader> {
        let path = c_path(path)?;
        // SAFETY: called under the lock of the library, which is initialised by then, as all that follows.
        let access = id(|| unsafe { H5Pcreate(*H5P_CLS_FILE_ACCESS) })?;
        // SAFETY: the list is alive.
        checked(|| unsafe { H5Pset_fapl_sec2(access.0) })?;
        // SAFETY: as above.
        checked(|| unsafe { H5Pset_file_locking(access.0, 0, 1) })?;
        // SAFETY: the path is a C string, the list alive.
        let file = id(|| unsafe { H5Fopen(path.as_ptr(), H5F_ACC_RDONLY, access.0) })?;
        keep_from_children(file.0);
        Ok(Reader(file))
    }

    /// Whether `name` exists, and all groups of its path.
    ///
    /// # Errors
    /// A damaged file.
    pub fn has(&self, name: &str) -> io::Result<bool> {
        // The library reports an error for a name in a group that does not exist.
        if let Some((group, _)) = name.rsplit_once('/')
            && !self.has(group)?
        {
            return Ok(false);
        }
        let path = c_text(name)?;
        // SAFETY: the file is open, the name a C string.
        let there = checked(|| unsafe { H5Lexists(self.0.0, path.as_ptr(), H5P_DEFAULT) });
        // What is not a group contains nothing.
        if name.contains('/') { Ok(there.is_ok_and(|there| there > 0)) } else { there.map(|there| there > 0) }
    }

    /// The dataset `name`; `None`: there is nothing of that name.
    ///
    /// # Errors
    /// Something else of that name; a damaged file.
    pub fn dataset(&self, name: &str) -> io::Result<Option<Dataset>> {
        if !self.has(name)? {
            return Ok(None);
        }
        let name = c_text(name)?;
        // SAFETY: the file is open, the name a C string.
        let dataset = id(|| unsafe { H5Dopen2(self.0.0, name.as_ptr(), H5P_DEFAULT) })?;
        // SAFETY: the dataset is alive, here and below.
        let of = id(|| unsafe { H5Dget_type(dataset.0) })?;
        // SAFETY: as above; the type is alive as well.
        let size = checked(|| unsafe { H5Tget_size(of.0) })?;
        let (kind, shape, place) = (kind(&of)?, shape(&dataset)?, place(&dataset)?);
        Ok(Some(Dataset { id: dataset, of, kind, size, shape, place }))
    }

    /// Names of the top level of the file.
    ///
    /// # Errors
    /// A damaged file.
    pub fn names(&self) -> io::Result<Vec<String>> {
        unsafe extern "C" fn note(_: hid_t, name: *const c_char, _: *const H5L_info_t, all: *mut c_void) -> herr_t {
            // SAFETY: `all` is the list below, borrowed by nothing else during the walk; the name is a C string.
            let (all, name) = unsafe { (&mut *all.cast::<Vec<String>>(), CStr::from_ptr(name)) };
            all.push(name.to_string_lossy().into_owned());
            0
        }
        let mut all: Vec<String> = Vec::new();
        let (index, order) = (H5_index_t::H5_INDEX_NAME, H5_iter_order_t::H5_ITER_NATIVE);
        let to = (&raw mut all).cast();
        // SAFETY: the file is open, and `all` outlives the call.
        checked(|| unsafe { H5Literate(self.0.0, index, order, ptr::null_mut(), Some(note), to) })?;
        Ok(all)
    }
}

fn kind(of: &Id) -> io::Result<Kind> {
    // SAFETY: the type is alive, here and below.
    Ok(match hdf5::sync::sync(|| unsafe { H5Tget_class(of.0) }) {
        H5T_class_t::H5T_NO_CLASS => return Err(hdf5::sync::sync(error::last)),
        H5T_class_t::H5T_INTEGER | H5T_class_t::H5T_FLOAT => Kind::Numbers,
        // SAFETY: as above.
        H5T_class_t::H5T_STRING => match checked(|| unsafe { H5Tis_variable_str(of.0) })? {
            0 => Kind::Texts,
            _ => Kind::AnyTexts,
        },
        H5T_class_t::H5T_VLEN => Kind::Lists,
        H5T_class_t::H5T_COMPOUND => Kind::Other("compounds"),
        H5T_class_t::H5T_ENUM => Kind::Other("an enumeration"),
        H5T_class_t::H5T_ARRAY => Kind::Other("arrays"),
        H5T_class_t::H5T_REFERENCE => Kind::Other("references"),
        H5T_class_t::H5T_BITFIELD => Kind::Other("bit fields"),
        _ => Kind::Other("a type of its own"),
    })
}

fn shape(dataset: &Id) -> io::Result<Vec<u64>> {
    // SAFETY: the dataset is alive.
    let space = id(|| unsafe { H5Dget_space(dataset.0) })?;
    // SAFETY: the space is alive.
    let axes = checked(|| unsafe { H5Sget_simple_extent_ndims(space.0) })?;
    let mut shape: Vec<hsize_t> = vec![0; axes as usize];
    // SAFETY: as above, with room for as many lengths as there are axes.
    checked(|| unsafe { H5Sget_simple_extent_dims(space.0, shape.as_mut_ptr(), ptr::null_mut()) })?;
    Ok(shape)
}

fn place(dataset: &Id) -> io::Result<StorageLayout> {
    // SAFETY: the dataset is alive, here and below.
    let made = id(|| unsafe { H5Dget_create_plist(dataset.0) })?;
    // SAFETY: the list is alive, here and below.
    if checked(|| unsafe { H5Pget_external_count(made.0) })? > 0 {
        return Ok(StorageLayout::Elsewhere);
    }
    // SAFETY: as above.
    Ok(match hdf5::sync::sync(|| unsafe { H5Pget_layout(made.0) }) {
        H5D_layout_t::H5D_COMPACT => StorageLayout::Compact,
        H5D_layout_t::H5D_CONTIGUOUS => {
            // SAFETY: as above.
            let at = hdf5::sync::sync(|| unsafe { H5Dget_offset(dataset.0) });
            StorageLayout::Together(Some(at).filter(|&at| at != HADDR_UNDEF))
        }
        H5D_layout_t::H5D_CHUNKED => {
            // The most axes that HDF5 supports.
            let mut chunk: Vec<hsize_t> = vec![0; 32];
            // SAFETY: as above, with room for 32 lengths.
            let axes = checked(|| unsafe { H5Pget_chunk(made.0, 32, chunk.as_mut_ptr()) })?;
            chunk.truncate(axes as usize);
            StorageLayout::Chunks(chunk)
        }
        _ => StorageLayout::Elsewhere,
    })
}

impl Dataset {
    /// Number of elements; `None`: more than can be counted.
    pub fn count(&self) -> Option<u64> {
        self.shape.iter().try_fold(1_u64, |product, &length| product.checked_mul(length))
    }

    /// Size in the file, bytes.
    pub fn stored(&self) -> u64 {
        // SAFETY: the dataset is alive.
        hdf5::sync::sync(|| unsafe { H5Dget_storage_size(self.id.0) })
    }

    /// Sizes of one of its chunks and of all in memory, bytes; `None`: more than can be counted, or it has none.
    pub fn chunks(&self) -> Option<[u64; 2]> {
        let StorageLayout::Chunks(chunk) = &self.place else { return None };
        let one = chunk.iter().try_fold(self.size as u64, |product, &length| product.checked_mul(length))?;
        let along = self.shape.iter().zip(chunk).map(|(&length, &chunk)| length.div_ceil(chunk.max(1)));
        let all = along.into_iter().try_fold(one, u64::checked_mul)?;
        Some([one, all])
    }

    /// The numbers in `rows` of a dataset with one axis, or all.
    ///
    /// # Errors
    /// The system's; a damaged file; elements that are not numbers.
    pub fn numbers(&self, rows: Option<Range<u64>>) -> io::Result<Vec<f64>> {
        if self.kind != Kind::Numbers {
            return Err(io::Error::other("HDF5: a dataset that is not numeric is read as numbers"));
        }
        let count = self.room(rows.as_ref(), 1)?;
        let mut numbers = vec![0.0_f64; count];
        // SAFETY: the type is one of the library's own; there is room for as many numbers.
        unsafe { self.read(*H5T_NATIVE_DOUBLE, rows, numbers.as_mut_ptr().cast()) }?;
        Ok(numbers)
    }

    /// All its texts of one width, without padding.
    ///
    /// # Errors
    /// As [`Dataset::numbers`].
    pub fn texts(&self) -> io::Result<Vec<Vec<u8>>> {
        if self.kind != Kind::Texts {
            return Err(io::Error::other("HDF5: a dataset that is not text is read as text"));
        }
        let mut bytes = vec![0_u8; self.room(None, self.size)?];
        // SAFETY: read as it is in the file, each text has `size` bytes, for which there is room.
        unsafe { self.read(self.of.0, None, bytes.as_mut_ptr().cast()) }?;
        // SAFETY: the type is alive.
        let blanks = hdf5::sync::sync(|| unsafe { H5Tget_strpad(self.of.0) }) == H5T_str_t::H5T_STR_SPACEPAD;
        let texts = bytes.chunks_exact(self.size.max(1)).map(|text| {
            let text = text.split(|&byte| byte == 0).next().unwrap_or_default();
            if blanks { text.trim_ascii_end() } else { text }.to_vec()
        });
        Ok(texts.collect())
    }

    /// The number of elements in `rows`, or of all, times `size`.
    fn room(&self, rows: Option<&Range<u64>>, size: usize) -> io::Result<usize> {
        let count = match rows {
            Some(rows) => {
                rows.end.checked_sub(rows.start).filter(|_| self.shape.len() == 1 && rows.end <= self.shape[0])
            }
            None => self.count(),
        };
        let room = count.and_then(|count| usize::try_from(count).ok()?.checked_mul(size));
        room.ok_or_else(|| io::Error::other("HDF5: more data than there is"))
    }

    /// Reads `rows`, of a dataset with one axis, or all, as numbers or texts of the type `of`.
    ///
    /// # Safety
    /// `to` has room for as many elements of that type, which contains no pointers.
    unsafe fn read(&self, of: hid_t, rows: Option<Range<u64>>, to: *mut c_void) -> io::Result<()> {
        let (mut here, mut there) = (None, None);
        if let Some(rows) = rows {
            let (start, count) = (rows.start, rows.end - rows.start);
            // SAFETY: the dataset is alive.
            let space = id(|| unsafe { H5Dget_space(self.id.0) })?;
            // SAFETY: the space is alive and has one axis, as `room` has checked for the callers.
            checked(|| unsafe {
                H5Sselect_hyperslab(space.0, H5S_seloper_t::H5S_SELECT_SET, &start, ptr::null(), &count, ptr::null())
            })?;
            there = Some(space);
            // SAFETY: one length for one axis.
            here = Some(id(|| unsafe { H5Screate_simple(1, &count, ptr::null()) })?);
        }
        let of_space = |space: &Option<Id>| space.as_ref().map_or(H5S_ALL, |space| space.0);
        // SAFETY: all of these are alive, and `to` has the room, as the caller promises.
        let read = || unsafe { H5Dread(self.id.0, of, of_space(&here), of_space(&there), H5P_DEFAULT, to) };
        checked(read).map(|_: c_int| ())
    }
}
