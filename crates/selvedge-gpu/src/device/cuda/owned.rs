//! Owners of what the driver allocates: memory, streams, modules, graphs. Each frees its own on
//! drop.

use cudarc::driver::result::{self, DriverError};
use cudarc::driver::sys;

use super::context::failed;
use crate::device::DeviceError;

/// Memory on the GPU.
pub(super) struct Memory(pub(super) sys::CUdeviceptr);

impl Memory {
    /// Uninitialised memory.
    pub(super) fn new(bytes: usize) -> Result<Self, DriverError> {
        // SAFETY: schedules are checked to write memory before they read it.
        unsafe { result::malloc_sync(bytes.max(1)) }.map(Self)
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: it was allocated and not freed. A failure cannot be reported from here.
        let _ = unsafe { result::free_sync(self.0) };
    }
}

/// Compiled kernels.
pub(super) struct Module(pub(super) sys::CUmodule);

impl Module {
    /// Loads an image that NVRTC has made for the GPU of the current context.
    pub(super) fn new(image: &[u8]) -> Result<Self, DeviceError> {
        // SAFETY: the image comes from NVRTC.
        let module = unsafe { result::module::load_data(image.as_ptr().cast()) };
        module.map(Self).map_err(failed("cuModuleLoadData"))
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        // SAFETY: it was loaded, and nothing uses it any more. A failure cannot be reported from
        // here.
        let _ = unsafe { result::module::unload(self.0) };
    }
}

/// A queue of calls.
pub(super) struct Stream(pub(super) sys::CUstream);

impl Stream {
    pub(super) fn new() -> Result<Self, DeviceError> {
        let stream = result::stream::create(result::stream::StreamKind::NonBlocking);
        stream.map(Self).map_err(failed("cuStreamCreate"))
    }

    pub(super) fn wait(&self) -> Result<(), DeviceError> {
        // SAFETY: the stream is alive.
        unsafe { result::stream::synchronize(self.0) }.map_err(failed("cuStreamSynchronize"))
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // SAFETY: it was created, and nothing uses it any more. A failure cannot be reported from
        // here.
        let _ = unsafe { result::stream::destroy(self.0) };
    }
}

/// A recorded graph of calls; null where there is none.
pub(super) struct Graph(pub(super) sys::CUgraph);

impl Drop for Graph {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: it was made and not destroyed. A failure cannot be reported from here.
            let _ = unsafe { result::graph::destroy(self.0) };
        }
    }
}
