//! What is one for the whole process, or for a thread: version, words of errors, threads, a cache.
#![allow(unsafe_code, reason = "exported to C, with pointers of the caller")]

use std::ffi::{CStr, c_char};
use std::path::PathBuf;

use selvedge::rest_pose;
use selvedge_data::RestPoseFolder;

use crate::border::{call, text};
use crate::fault::{self, Fault};
use crate::status::{self, SelvedgeStatus};

/// Number of this interface; another number has other functions or structures.
pub const SELVEDGE_INTERFACE: u32 = 1;

/// Returns the number of the interface that this library has, to be compared with
/// `SELVEDGE_INTERFACE` of the header.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_interface() -> u32 {
    SELVEDGE_INTERFACE
}

/// Returns the version of Selvedge, a text for as long as the library is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    let text = CStr::from_bytes_with_nul(VERSION.as_bytes()).unwrap_or(c"");
    text.as_ptr()
}

/// Returns the words for the last call of this thread that failed: what of which file, field, frame
/// or vertex was wrong, and what to do. They stay until the next call of this thread fails.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_last_error() -> *const c_char {
    fault::last()
}

/// Returns the words for a `SelvedgeStatus` alone, a text for as long as the library is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_status_text(status: i32) -> *const c_char {
    status::words(status).unwrap_or(c"no status").as_ptr()
}

/// Threads beyond which a number is a mistake: all of them would be started.
const MOST_THREADS: usize = 4096;

/// Sets the number of threads on which all steppers work together; as many as the machine has,
/// where nothing is said. Results are the same for any number. Only possible before the first
/// stepper is made, and once.
#[unsafe(no_mangle)]
pub extern "C" fn selvedge_set_threads(threads: usize) -> SelvedgeStatus {
    call(|| {
        if !(1..=MOST_THREADS).contains(&threads) {
            let text = format!("threads: expected 1 to {MOST_THREADS}, found {threads}");
            return Err(Fault::argument(text));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build_global().map_err(|error| {
            Fault::argument(format!(
                "threads: {error}; say how many before anything else"
            ))
        })
    })
}

/// Keeps rest poses that took a while in a folder, from now on: the same cloth then starts at once
/// another time, with the same bytes. Without it, nothing is kept. Only the first call counts. The
/// folder is created if it is not there; one that cannot be written is an argument error.
///
/// # Safety
/// `folder` is a text that ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn selvedge_keep_rest_poses(folder: *const c_char) -> SelvedgeStatus {
    call(|| {
        // SAFETY: as for this function.
        let folder = PathBuf::from(unsafe { text(folder, "folder") }?);
        let folder = RestPoseFolder::new(folder);
        let checked = folder.check();
        checked.map_err(|error| Fault::of(SelvedgeStatus::Argument, error))?;
        rest_pose::keep_in(folder);
        Ok(())
    })
}
