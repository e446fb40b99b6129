//! What the driver gives and takes back: memory, streams, modules, graphs. Each goes when its owner does.

use cudarc::driver::result::{self, DriverError};
use cudarc::driver::sys;

use super::failed;
use crate::device::DeviceError;

/// Memory on the GPU.
pub(super) struct Memory(pub(super) sys::CUdeviceptr);

impl Memory {
    /// So many bytes; their contents are whatever they are.
    pub(super) fn new(bytes: usize) -> Result<Self, DriverError> {
        // SAFETY: what is in it is written before it is read, which schedules are checked for.
        unsafe { result::malloc_sync(bytes.max(1)) }.map(Self)
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: it was allocated and not freed. Nobody is left to be told of a failure.
        let _ = unsafe { result::free_sync(self.0) };
    }
}

/// Compiled kernels.
pub(super) struct Module(pub(super) sys::CUmodule);

impl Drop for Module {
    fn drop(&mut self) {
        // SAFETY: it was loaded, and nothing uses it any more. Nobody is left to be told of a failure.
        let _ = unsafe { result::module::unload(self.0) };
    }
}

/// Where calls queue up.
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
        // SAFETY: it was created, and nothing uses it any more. Nobody is left to be told of a failure.
        let _ = unsafe { result::stream::destroy(self.0) };
    }
}

/// What a recording gives; none where it is null.
pub(super) struct Graph(pub(super) sys::CUgraph);

impl Drop for Graph {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: it was made and not destroyed. Nobody is left to be told of a failure.
            let _ = unsafe { result::graph::destroy(self.0) };
        }
    }
}
