//! The device of CUDA: an NVIDIA GPU through its driver, NVRTC and cuBLAS, all of which are loaded when
//! they are asked for. Nothing of them is needed to build.
//!
//! What is there is looked at before anything is called, so that what is missing is said in words: the
//! driver, a driver of CUDA 12 at least, a GPU, NVRTC, cuBLAS. Kernels are compiled for the very card.
//!
//! `unsafe` in this module: calls of a C library, with handles that live as long as what holds them and
//! pointers into one arena, within which every schedule stays that [`crate::schedule::Trace::fits`].
#![allow(unsafe_code)]

mod compile;
mod loaded;
mod narrow;
mod owned;
mod product;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use cudarc::driver::result::{self, DriverError};
use cudarc::driver::sys::{self, CUdevice_attribute, CUresult};

use crate::device::{Device, DeviceError, Loaded, Precision, in_bytes};
use crate::kernels::{Dialect, Program};
use crate::schedule::plan::Plan;

pub use compile::{Architecture, compile};
use loaded::CudaLoaded;

/// The oldest CUDA that a driver must know, as the driver says it: 1000 major + 10 minor.
const LEAST_VERSION: i32 = 12_000;

/// Bytes that are left free for what the driver and the libraries take for themselves.
const RESERVE: usize = 256 << 20;

/// Held while a schedule is recorded, and while a handle of cuBLAS is made or dropped, which allocates: one thread's
/// allocation may not come into another's recording. For the whole process, as the primary context is.
static RECORDING: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    RECORDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An NVIDIA GPU.
pub struct Cuda {
    context: Arc<Context>,
    name: String,
    architecture: Architecture,
    /// What was compiled, by its source.
    images: Mutex<HashMap<String, Arc<Vec<u8>>>>,
}

/// The primary context of a GPU, held as long as anything uses it.
struct Context {
    device: sys::CUdevice,
    context: sys::CUcontext,
}

// SAFETY: a context may be used by any thread that has made it current, as every call here does.
unsafe impl Send for Context {}
// SAFETY: as above.
unsafe impl Sync for Context {}

impl Context {
    /// Makes it that of the calling thread.
    fn enter(&self) -> Result<(), DeviceError> {
        // SAFETY: the context is held.
        unsafe { result::ctx::set_current(self.context) }.map_err(failed("cuCtxSetCurrent"))
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: it was retained once. Nobody is left to be told of a failure.
        let _ = unsafe { result::primary_ctx::release(self.device) };
    }
}

/// A failed call in words.
fn failed(call: &'static str) -> impl Fn(DriverError) -> DeviceError {
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

impl Cuda {
    /// GPU number `number`, counted from 0 as CUDA does (`CUDA_VISIBLE_DEVICES` hides some).
    ///
    /// # Errors
    /// What is missing, and what to do about it.
    pub fn new(number: usize) -> Result<Self, DeviceError> {
        require_libraries()?;
        result::init().map_err(|error| match error.0 {
            CUresult::CUDA_ERROR_NO_DEVICE => DeviceError::NoDevice,
            _ => failed("cuInit")(error),
        })?;
        require_version()?;
        let count = result::device::get_count().map_err(failed("cuDeviceGetCount"))?;
        let count = usize::try_from(count).unwrap_or(0);
        if count == 0 {
            return Err(DeviceError::NoDevice);
        }
        if number >= count {
            return Err(DeviceError::NoSuchDevice { number, count });
        }
        let device = result::device::get(number as i32).map_err(failed("cuDeviceGet"))?;
        let attribute = |attribute| {
            // SAFETY: the device is one that the driver gave.
            let found = unsafe { result::device::get_attribute(device, attribute) };
            found.map_err(failed("cuDeviceGetAttribute"))
        };
        let architecture = Architecture {
            major: attribute(CUdevice_attribute::CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR)?,
            minor: attribute(CUdevice_attribute::CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR)?,
        };
        let name = result::device::get_name(device).map_err(failed("cuDeviceGetName"))?;
        // SAFETY: as above.
        let memory = unsafe { result::device::total_mem(device) };
        let memory = memory.map_err(failed("cuDeviceTotalMem"))?;
        // SAFETY: as above.
        let context = unsafe { result::primary_ctx::retain(device) };
        let context = context.map_err(failed("cuDevicePrimaryCtxRetain"))?;
        Ok(Self {
            context: Arc::new(Context { device, context }),
            name: format!("{name}, {}", in_bytes(memory)),
            architecture,
            images: Mutex::default(),
        })
    }

    /// The machine code of a source, which is compiled once.
    fn image(&self, text: String) -> Result<Arc<Vec<u8>>, DeviceError> {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = images.get(&text) {
            return Ok(Arc::clone(known));
        }
        let image = Arc::new(compile(&text, self.architecture)?);
        images.insert(text, Arc::clone(&image));
        Ok(image)
    }
}

fn require_libraries() -> Result<(), DeviceError> {
    // SAFETY: loading these libraries runs what their makers run on loading, as any program does that is
    // linked with them.
    let found = unsafe {
        [
            sys::is_culib_present(),
            cudarc::nvrtc::sys::is_culib_present(),
            cudarc::cublas::sys::is_culib_present(),
        ]
    };
    let needed = [
        (
            "the driver of an NVIDIA GPU (libcuda)",
            "install the card's driver, or leave out --device to use the processor",
        ),
        (
            "NVRTC, the compiler of CUDA's kernels (libnvrtc)",
            "install CUDA 12 or 13, or Python's package nvidia-cuda-nvrtc-cu12 (of CUDA 13: nvidia-cuda-nvrtc), and put \
             its folder into LD_LIBRARY_PATH",
        ),
        (
            "cuBLAS, CUDA's products of matrices (libcublas)",
            "install CUDA 12 or 13, or Python's package nvidia-cublas-cu12 (of CUDA 13: nvidia-cublas), and put its \
             folder into LD_LIBRARY_PATH",
        ),
    ];
    match found.into_iter().zip(needed).find(|(found, _)| !found) {
        Some((_, (library, remedy))) => Err(DeviceError::Library { library, remedy }),
        None => Ok(()),
    }
}

fn require_version() -> Result<(), DeviceError> {
    let mut version = 0;
    // SAFETY: it writes one integer.
    let asked = unsafe { sys::cuDriverGetVersion(&raw mut version) }.result();
    asked.map_err(failed("cuDriverGetVersion"))?;
    check_version(version, compile::major()?.max(product::major()?))
}

/// That a driver knows CUDA well enough, for itself and for libraries of CUDA `major`.
fn check_version(version: i32, major: i32) -> Result<(), DeviceError> {
    let in_words = |version: i32| format!("{}.{}", version / 1000, version % 1000 / 10);
    let too_old = |needed: i32, remedy: &'static str| DeviceError::OldDriver {
        found: in_words(version),
        needed: in_words(needed),
        remedy,
    };
    if version < LEAST_VERSION {
        return Err(too_old(LEAST_VERSION, "install a newer driver"));
    }
    if version / 1000 < major {
        return Err(too_old(
            1000 * major,
            "NVRTC and cuBLAS as they were found are of that; install a newer driver, or put the folders of older \
             ones first in LD_LIBRARY_PATH",
        ));
    }
    Ok(())
}

impl Device for Cuda {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn free_bytes(&self) -> Result<usize, DeviceError> {
        self.context.enter()?;
        let (free, _) = result::mem_get_info().map_err(failed("cuMemGetInfo"))?;
        Ok(free.saturating_sub(RESERVE))
    }

    fn narrow_products(&self, side: usize) -> Result<Option<f64>, DeviceError> {
        self.context.enter()?;
        narrow::products(side).map(Some)
    }

    fn load(
        &self,
        program: &Program,
        plan: &Plan,
        precision: Precision,
    ) -> Result<Box<dyn Loaded>, DeviceError> {
        self.context.enter()?;
        let image = self.image(program.text(Dialect::Cuda))?;
        let context = Arc::clone(&self.context);
        let loaded = CudaLoaded::new(context, &image, (program, plan), precision)?;
        Ok(Box::new(loaded))
    }
}

#[cfg(test)]
mod tests;
