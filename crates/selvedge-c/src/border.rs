//! The border to C: panics end here, and pointers are read and written here alone.
#![allow(
    unsafe_code,
    reason = "the caller's pointers are read and written, within the lengths that come with them"
)]

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::fault::Fault;
use crate::registry::Registry;
use crate::status::SelvedgeStatus;

/// Runs a call: an error keeps its words for this thread, a panic becomes one.
pub(crate) fn call(work: impl FnOnce() -> Result<(), Fault>) -> SelvedgeStatus {
    // A panic leaves nothing of ours half done but what a lock guards, which is poisoned then.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => SelvedgeStatus::Ok,
        Ok(Err(fault)) => fault.keep(),
        Err(payload) => Fault::panic(&*payload).keep(),
    }
}

fn check<T>(pointer: *const T, name: &str) -> Result<(), Fault> {
    if pointer.is_null() {
        return Err(Fault::argument(format!("{name} is null")));
    }
    if !pointer.is_aligned() {
        let align = align_of::<T>();
        let text = format!("{name}: expected an address that {align} divides, found {pointer:p}");
        return Err(Fault::argument(text));
    }
    Ok(())
}

/// Reads a text that ends with a zero byte.
///
/// # Errors
/// A null pointer, bytes that are not UTF-8.
///
/// # Safety
/// `pointer` is null or that of such a text, which stays as it is during the call.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Fault> {
    check(pointer, name)?;
    // SAFETY: not null, and the caller says that a text ends there.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|_| Fault::argument(format!("{name} is not UTF-8")))
}

/// Writes `value`.
///
/// # Errors
/// A pointer that is null or not aligned.
///
/// # Safety
/// `out` is null or that of a `T` that may be written.
pub(crate) unsafe fn put<T>(out: *mut T, name: &str, value: T) -> Result<(), Fault> {
    check(out, name)?;
    // SAFETY: aligned, not null, and the caller says that it may be written. What stands there may
    // be uninitialised and is not dropped.
    unsafe { out.write(value) };
    Ok(())
}

/// Keeps what `make` makes, and puts its handle into `out`, which is 0 until then.
///
/// # Safety
/// `out` may be written.
pub(crate) unsafe fn keep<T>(
    registry: &Registry<T>,
    out: *mut u64,
    make: impl FnOnce() -> Result<T, Fault>,
) -> SelvedgeStatus {
    call(|| {
        // SAFETY: as for this function.
        unsafe { put(out, "out", 0) }?;
        let handle = registry.keep(make()?);
        // SAFETY: likewise.
        unsafe { put(out, "out", handle) }
    })
}

/// Writes `values` to an array of as many.
///
/// # Errors
/// A pointer that is null or not aligned.
///
/// # Safety
/// `out` is null or that of an array of as many `T` as there are values, which may be written.
pub(crate) unsafe fn put_all<T>(
    out: *mut T,
    name: &str,
    values: impl ExactSizeIterator<Item = T>,
) -> Result<(), Fault> {
    let count = values.len();
    if count == 0 {
        return Ok(());
    }
    check(out, name)?;
    for (index, value) in values.enumerate().take(count) {
        // SAFETY: aligned, not null, and `index` is below the length that the caller vouches for.
        unsafe { out.add(index).write(value) };
    }
    Ok(())
}

/// Copies an array of `count` values.
///
/// # Errors
/// A pointer that is null or not aligned, an array larger than memory can be.
///
/// # Safety
/// `pointer` is null or that of an array of `count` values, which stay as they are during the call.
pub(crate) unsafe fn values<T: Copy>(
    pointer: *const T,
    count: usize,
    name: &str,
) -> Result<Vec<T>, Fault> {
    if count == 0 {
        return Ok(Vec::new());
    }
    check(pointer, name)?;
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(Fault::argument(format!(
            "{name} cannot have {count} entries"
        )));
    }
    // SAFETY: aligned, not null, no larger than memory, and the caller vouches for the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) }.to_vec())
}

/// Writes `text` with a zero byte to an array of `room` bytes, and to `needed` how many it takes.
/// Either may be null: a caller asks for the length first.
///
/// # Errors
/// A text that does not fit, of which nothing is written.
///
/// # Safety
/// `out` is null or that of `room` bytes that may be written, `needed` null or that of a number.
pub(crate) unsafe fn put_text(
    text: &str,
    out: *mut c_char,
    room: usize,
    needed: *mut usize,
) -> Result<(), Fault> {
    let bytes = text.bytes().filter(|byte| *byte != 0).chain([0]);
    let bytes: Vec<c_char> = bytes.map(|byte| byte.cast_signed() as c_char).collect();
    if !needed.is_null() {
        // SAFETY: not null, and the caller says that it may be written.
        unsafe { put(needed, "needed", bytes.len()) }?;
    }
    if out.is_null() {
        return Ok(());
    }
    if room < bytes.len() {
        return Err(Fault::count("text", "bytes", bytes.len(), room));
    }
    // SAFETY: there is room for as many bytes.
    unsafe { put_all(out, "text", bytes.into_iter()) }
}
