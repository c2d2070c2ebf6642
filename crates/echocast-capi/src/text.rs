//! C's strings, arrays and structures in, text out.
//!
//! What a pointer of the caller must point to if it is not NULL. The header requires this, and it cannot be checked;
//! `SAFETY` comments of this crate refer to it by these names:
//!
//! * string: bytes that end in 0;
//! * array: the number of elements given with it;
//! * structure: as many bytes as its `struct_size` says;
//! * output: room for one value of its type;
//! * buffer: room for as many bytes as its capacity;
//! * handle slot: a handle or NULL, which the call may replace.
//!
//! Nothing else frees or changes this memory during the call, or reads what the call writes. The functions here check
//! the rest: NULL, alignment, impossible sizes.

use crate::guard::{ECHOCAST_E_MEMORY, ECHOCAST_E_VERSION, Failure, Outcome, push_lossy};
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::ops::Range;
use std::path::Path;

/// Longest string that is accepted.
const LONGEST: usize = 64 << 20;

/// The string `text`, the argument called `name`; `None` for NULL.
///
/// # Safety
/// `text` is a string (see the module) that lives as long as the result is used.
pub(crate) unsafe fn optional<'a>(text: *const c_char, name: &str) -> Outcome<Option<&'a str>> {
    // SAFETY: as the caller promises.
    let text = unsafe { bytes(text, name) }?.map(str::from_utf8).transpose();
    text.map_err(|error| Failure::argument(name, format!("not UTF-8 after byte {}", error.valid_up_to()), "UTF-8 text"))
}

/// The bytes of the string `text`; `None` for NULL.
///
/// # Safety
/// As [`optional`].
unsafe fn bytes<'a>(text: *const c_char, name: &str) -> Outcome<Option<&'a [u8]>> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller promises.
    let text = unsafe { CStr::from_ptr(text) };
    if text.count_bytes() > LONGEST {
        return Err(Failure::argument(name, format!("{} bytes long", text.count_bytes()), "up to 64 MiB"));
    }
    Ok(Some(text.to_bytes()))
}

/// The string `text`, which must not be NULL.
///
/// # Safety
/// As [`optional`].
pub(crate) unsafe fn required<'a>(text: *const c_char, name: &str) -> Outcome<&'a str> {
    // SAFETY: as the caller promises.
    unsafe { optional(text, name) }?.ok_or_else(|| Failure::argument(name, "NULL", "a string"))
}

/// The path `text`, which must be neither NULL nor empty.
///
/// # Safety
/// As [`optional`].
pub(crate) unsafe fn path<'a>(text: *const c_char, name: &str) -> Outcome<&'a Path> {
    if text.is_null() {
        return Err(Failure::argument(name, "NULL", "a string"));
    }
    // SAFETY: as the caller promises.
    let path = unsafe { optional_path(text, name) }?;
    if path.as_os_str().is_empty() { Err(Failure::argument(name, "empty", "a path")) } else { Ok(path) }
}

/// The path `text`, empty for NULL. Where file names are bytes, it need not be UTF-8.
///
/// # Safety
/// As [`optional`].
pub(crate) unsafe fn optional_path<'a>(text: *const c_char, name: &str) -> Outcome<&'a Path> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        // SAFETY: as the caller promises.
        Ok(Path::new(std::ffi::OsStr::from_bytes(unsafe { bytes(text, name) }?.unwrap_or_default())))
    }
    #[cfg(not(unix))]
    // SAFETY: as the caller promises.
    Ok(Path::new(unsafe { optional(text, name) }?.unwrap_or_default()))
}

/// The `count` elements of the array `data`, which may be NULL when there are none.
///
/// # Safety
/// `data` is an array of `count` elements (see the module) that live, unchanged, as long as the result is used.
pub(crate) unsafe fn array<'a, T>(data: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check_array(data, count, name)?;
    // SAFETY: the pointer is not NULL, aligned, and its end does not overflow; the rest is as the caller promises.
    Ok(unsafe { std::slice::from_raw_parts(data, count) })
}

/// Checks that `data` can be an array of `count` elements, as far as possible.
pub(crate) fn check_array<T>(data: *const T, count: usize, name: &str) -> Outcome {
    if data.is_null() {
        return Err(Failure::argument(name, "NULL", &format!("an array of {count}")));
    }
    check_aligned(data, name)?;
    let bytes = count.checked_mul(size_of::<T>()).filter(|&bytes| bytes <= isize::MAX as usize);
    if bytes.and_then(|bytes| data.addr().checked_add(bytes)).is_none() {
        return Err(Failure::argument(&format!("the number of {name}"), count, "what fits into memory"));
    }
    Ok(())
}

fn check_aligned<T>(pointer: *const T, name: &str) -> Outcome {
    if pointer.is_aligned() {
        return Ok(());
    }
    Err(Failure::argument(name, format!("{pointer:p}"), &format!("a multiple of {} bytes", align_of::<T>())))
}

/// Where to write a result.
///
/// # Safety
/// `to` is an output (see the module) that nothing else uses as long as the result lives.
pub(crate) unsafe fn output<'a, T>(to: *mut T, name: &str) -> Outcome<&'a mut MaybeUninit<T>> {
    if to.is_null() {
        return Err(Failure::null(name));
    }
    check_aligned(to, name)?;
    // SAFETY: not NULL, aligned; the rest is as the caller promises.
    Ok(unsafe { &mut *to.cast::<MaybeUninit<T>>() })
}

/// Structures of the header that begin with `struct_size` and may grow at their end.
///
/// # Safety
/// The type is `repr(C)`, begins with its size as a `usize`, has no padding except padding that may hold anything, and
/// any bits are a valid value of it.
pub(crate) unsafe trait Versioned: Copy + Default {
    /// Where each field begins and ends, bytes from the start.
    const FIELDS: &'static [Range<usize>];
}

/// Implements [`Versioned`] for a structure of the header that has these fields.
macro_rules! versioned {
    ($name:ident { $($field:ident),* $(,)? }) => {
        // SAFETY: plain numbers and pointers, the size first.
        unsafe impl $crate::text::Versioned for $name {
            const FIELDS: &'static [std::ops::Range<usize>] = &[$({
                let start = std::mem::offset_of!($name, $field);
                start..start + $crate::text::size_of_field(|it: &$name| &it.$field)
            }),*];
        }
        // No field is left out.
        const _: fn(&$name) = |$name { $($field: _),* }| ();
    };
}
pub(crate) use versioned;

/// Size of the field that the function returns, bytes.
pub(crate) const fn size_of_field<S, F>(_: fn(&S) -> &F) -> usize {
    size_of::<F>()
}

/// Largest structure that is accepted.
const LARGEST_STRUCT: usize = 4096;

/// Reads a structure that may be shorter or longer than this library knows: fields that an older header lacks get their
/// defaults, fields that a newer one adds must be 0. So 0 must be the default of every field that is added.
///
/// # Safety
/// `from` is a structure (see the module).
pub(crate) unsafe fn structure<T: Versioned>(from: *const T, name: &str) -> Outcome<T> {
    if from.is_null() {
        return Err(Failure::null(name));
    }
    check_aligned(from, name)?;
    // SAFETY: aligned, and every such structure begins with its size.
    let size = unsafe { from.cast::<usize>().read() };
    // Every version of the header has whole fields.
    let cuts = T::FIELDS.iter().any(|field| field.start < size && size < field.end);
    if cuts || !(size_of::<usize>()..=LARGEST_STRUCT).contains(&size) {
        let allowed = format!("sizeof(*{name}), as the INIT macro of the structure has it");
        return Err(Failure::argument(&format!("{name}->struct_size"), size, &allowed));
    }
    let mut value = T::default();
    let known = size.min(size_of::<T>());
    // SAFETY: both have `known` bytes; any bits make a value.
    unsafe { std::ptr::copy_nonoverlapping(from.cast::<u8>(), std::ptr::from_mut(&mut value).cast::<u8>(), known) };
    for offset in known..size {
        // SAFETY: within the `size` bytes that the caller promises.
        if unsafe { from.cast::<u8>().add(offset).read() } != 0 {
            let text =
                format!("{name} has something set at byte {offset}, which this version of echocast does not know");
            return Err(Failure::new(ECHOCAST_E_VERSION, text));
        }
    }
    Ok(value)
}

/// Writes as much of a structure as that of the caller, whose header may be older or newer, has room for;
/// `to->struct_size` is unchanged.
///
/// # Safety
/// `to` is a structure (see the module) that nothing else uses meanwhile.
pub(crate) unsafe fn put_structure<T: Versioned>(value: T, to: *mut T, name: &str) -> Outcome {
    // SAFETY: as the caller promises. Its contents do not matter, but its size must be valid.
    match unsafe { structure(to, name) } {
        Err(failure) if failure.status != ECHOCAST_E_VERSION => return Err(failure),
        _ => {}
    }
    // SAFETY: it has been read just now.
    let size = unsafe { to.cast::<usize>().read() };
    let fields = size_of::<usize>()..size.min(size_of::<T>());
    // SAFETY: both have so many bytes.
    unsafe {
        let from = std::ptr::from_ref(&value).cast::<u8>();
        std::ptr::copy_nonoverlapping(from.add(fields.start), to.cast::<u8>().add(fields.start), fields.len());
        if size > size_of::<T>() {
            to.cast::<u8>().add(size_of::<T>()).write_bytes(0, size - size_of::<T>());
        }
    }
    Ok(())
}

/// A vector of `count` elements, or an error if there is no memory for them; `name` is the argument they come from.
pub(crate) fn collect<T>(elements: impl Iterator<Item = T>, count: usize, name: &str) -> Outcome<Vec<T>> {
    let mut all = Vec::new();
    all.try_reserve_exact(count)
        .map_err(|_| Failure::new(ECHOCAST_E_MEMORY, format!("no memory for {count} elements of {name}")))?;
    all.extend(elements.take(count));
    Ok(all)
}

/// Copies `text` and a 0 to `to`, cut off to fit its `capacity` bytes; `needed`: bytes of the whole text with the 0.
///
/// # Safety
/// `to` is a buffer of `capacity` bytes and `needed` an output (see the module).
pub(crate) unsafe fn put(text: &str, to: *mut c_char, capacity: usize, needed: *mut usize) -> Outcome {
    if to.is_null() && needed.is_null() {
        return Err(Failure::argument("text and needed", "NULL", "at least one of them"));
    }
    let mut bytes = Vec::with_capacity(text.len() + 1);
    push_lossy(&mut bytes, text);
    if !needed.is_null() {
        // SAFETY: as the caller promises; it need not be aligned.
        unsafe { needed.write_unaligned(bytes.len()) };
    }
    if !to.is_null() && capacity > 0 {
        // Not in the middle of a character.
        let mut length = (bytes.len() - 1).min(capacity - 1);
        while length < bytes.len() - 1 && bytes[length] & 0xc0 == 0x80 {
            length -= 1;
        }
        // SAFETY: as the caller promises.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr().cast(), to, length);
            to.add(length).write(0);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[repr(C)]
    #[derive(Clone, Copy, Default)]
    struct Sample {
        struct_size: usize,
        number: i32,
        list: [u8; 3],
        other: f64,
    }
    versioned!(Sample { struct_size, number, list, other });

    #[test]
    fn sizes_end_where_fields_end() {
        let given = |struct_size| Sample { struct_size, number: 1, list: [2; 3], other: 4.0 };
        // SAFETY: the structure is as large as any of these sizes.
        let read = |size| unsafe { structure(&raw const *Box::leak(Box::new(given(size))), "desc") };
        for size in [8, 12, 15, 16, 24] {
            let found = read(size).unwrap();
            let expected = (i32::from(size >= 12), u8::from(size >= 15) * 2, f64::from(u8::from(size >= 24)) * 4.0);
            assert_eq!((found.number, found.list[2], found.other), expected, "{size}");
        }
        for size in [0, 7, 9, 11, 13, 14, 17, 23, 4097] {
            let failure = read(size).err().unwrap();
            assert_eq!(failure.status, crate::ECHOCAST_E_ARGUMENT);
            assert!(failure.text.starts_with(&format!("desc->struct_size is {size}; allowed: sizeof(*desc)")));
        }
    }
}
