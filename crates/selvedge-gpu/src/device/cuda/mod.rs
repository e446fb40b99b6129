//! The CUDA device: an NVIDIA GPU through its driver, NVRTC and cuBLAS. These libraries are loaded
//! at run time; none of them is needed to build.
//!
//! The libraries, the version of the driver and the GPU are checked before anything is called, so
//! that an error names what is missing. Kernels are compiled for the card at hand.
//!
//! `unsafe` in this module: calls of a C library, with handles that live as long as their owners
//! and pointers into one arena. Every schedule that passes [`crate::schedule::Trace::fits`] stays
//! within it.
#![allow(unsafe_code)]

mod compile;
mod context;
mod loaded;
mod owned;
mod product;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use cudarc::driver::result;
use cudarc::driver::sys::{self, CUdevice_attribute, CUresult};

use crate::device::{Device, DeviceError, Loaded, Precision, in_bytes};
use crate::kernels::{Dialect, Program};
use crate::schedule::plan::Plan;

pub use compile::{Architecture, compile};
use context::{Context, failed};
use loaded::CudaLoaded;
use owned::Module;

/// The oldest version of CUDA that a driver must support, as 1000 major + 10 minor.
const LEAST_VERSION: i32 = 12_000;

/// Bytes left free for the driver and the libraries.
const RESERVE: usize = 256 << 20;

/// An NVIDIA GPU.
pub struct Cuda {
    context: Arc<Context>,
    name: String,
    architecture: Architecture,
    /// Compiled programs by their source.
    images: Mutex<HashMap<String, Arc<Vec<u8>>>>,
}

impl Cuda {
    /// GPU number `number`, counted from 0 as CUDA does (`CUDA_VISIBLE_DEVICES` hides some).
    ///
    /// # Errors
    /// A missing library or GPU, or a driver that is too old, with a remedy.
    pub fn new(number: usize) -> Result<Self, DeviceError> {
        let count = Self::count()?;
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
        Ok(Self {
            context: Arc::new(Context::new(device)?),
            name: format!("{name}, {}", in_bytes(memory)),
            architecture,
            images: Mutex::default(),
        })
    }

    /// GPUs that this process can see, at least one.
    ///
    /// # Errors
    /// A missing library or GPU, or a driver that is too old, with a remedy.
    pub fn count() -> Result<usize, DeviceError> {
        require_libraries()?;
        result::init().map_err(|error| match error.0 {
            CUresult::CUDA_ERROR_NO_DEVICE => DeviceError::NoDevice,
            _ => failed("cuInit")(error),
        })?;
        require_version()?;
        let count = result::device::get_count().map_err(failed("cuDeviceGetCount"))?;
        match usize::try_from(count) {
            Ok(count) if count > 0 => Ok(count),
            _ => Err(DeviceError::NoDevice),
        }
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
    // SAFETY: loading these libraries runs their initialisers, as in any program that links them.
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

/// Checks that a driver supports CUDA well enough, for itself and for libraries of CUDA `major`.
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

    fn load(
        &self,
        program: &Program,
        plan: &Plan,
        precision: Precision,
    ) -> Result<Box<dyn Loaded>, DeviceError> {
        self.context.enter()?;
        let image = self.image(program.text(Dialect::Cuda))?;
        let context = Arc::clone(&self.context);
        let module = Module::new(&image)?;
        let loaded = CudaLoaded::new(context, module, program, plan, precision)?;
        Ok(Box::new(loaded))
    }
}

#[cfg(test)]
mod tests;
