//! The primary context of a GPU, the lock of recordings, and the errors of the driver in words.

use std::sync::{Mutex, MutexGuard, PoisonError};

use cudarc::driver::result::{self, DriverError};
use cudarc::driver::sys;

use crate::device::DeviceError;

/// Held while a schedule is recorded, and while a handle of cuBLAS is made or dropped. The latter
/// allocates, and an allocation of one thread may not enter the recording of another. One lock for
/// the process, which has one primary context.
static RECORDING: Mutex<()> = Mutex::new(());

/// Waits until no other thread records or allocates.
pub(super) fn alone() -> MutexGuard<'static, ()> {
    RECORDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The primary context of a GPU, held as long as anything uses it.
pub(super) struct Context {
    device: sys::CUdevice,
    context: sys::CUcontext,
}

// SAFETY: a context may be used by any thread that has made it current, as every call here does.
unsafe impl Send for Context {}
// SAFETY: as above.
unsafe impl Sync for Context {}

impl Context {
    /// Retains the context of a GPU.
    pub(super) fn new(device: sys::CUdevice) -> Result<Self, DeviceError> {
        // SAFETY: the device is one that the driver gave.
        let context = unsafe { result::primary_ctx::retain(device) };
        let context = context.map_err(failed("cuDevicePrimaryCtxRetain"))?;
        Ok(Self { device, context })
    }

    /// Makes it the context of the calling thread.
    pub(super) fn enter(&self) -> Result<(), DeviceError> {
        // SAFETY: the context is held.
        unsafe { result::ctx::set_current(self.context) }.map_err(failed("cuCtxSetCurrent"))
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: it was retained once. A failure cannot be reported from here.
        let _ = unsafe { result::primary_ctx::release(self.device) };
    }
}

/// The error of a failed call, in words.
pub(super) fn failed(call: &'static str) -> impl Fn(DriverError) -> DeviceError {
    move |error| DeviceError::Call {
        call,
        reason: in_words(error),
    }
}

fn in_words(error: DriverError) -> String {
    let text = |found: Result<&std::ffi::CStr, DriverError>| {
        found.map_or_else(
            |_| "?".to_owned(),
            |text| text.to_string_lossy().into_owned(),
        )
    };
    format!(
        "{} ({})",
        text(error.error_string()),
        text(error.error_name())
    )
}
