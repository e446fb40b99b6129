//! Devices: [`Device`] compiles a program and allocates an arena, [`Loaded`] runs schedules in it.
//!
//! `host` is this machine's processor, for tests; `cuda` an NVIDIA GPU. Another kind of GPU would
//! need these two traits, a matrix product, and a prelude of definitions for the kernels' source.

#[cfg(feature = "cuda")]
pub mod cuda;
#[cfg(feature = "host")]
pub mod host;

use thiserror::Error;

use crate::kernels::Program;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, ScheduleError};

/// The precision of matrix products. Sums are f32 always.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// f32 throughout.
    #[default]
    Full,
    /// Factors rounded to 10 bits (TF32).
    Tensor,
}

/// A kind of machine that runs kernels.
pub trait Device: Send + Sync {
    /// Its name and its memory, for people.
    fn name(&self) -> String;

    /// Bytes that can be allocated now.
    ///
    /// # Errors
    /// When the device does not answer.
    fn free_bytes(&self) -> Result<usize, DeviceError>;

    /// Compiles a program and allocates the arena of a plan.
    ///
    /// # Errors
    /// When a kernel does not compile, or the device has too little memory.
    fn load(
        &self,
        program: &Program,
        plan: &Plan,
        precision: Precision,
    ) -> Result<Box<dyn Loaded>, DeviceError>;
}

/// The number of a schedule that a device has prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Prepared(pub(crate) usize);

/// A program and its arena on a device.
pub trait Loaded: Send {
    /// Writes all words of a region.
    ///
    /// # Errors
    /// When the device fails.
    fn upload(&mut self, to: Region, words: &[u32]) -> Result<(), DeviceError>;

    /// Reads all words of a region, after the schedules that run.
    ///
    /// # Errors
    /// When the device fails.
    fn download(&mut self, from: Region, words: &mut [u32]) -> Result<(), DeviceError>;

    /// Prepares a schedule for many runs.
    ///
    /// # Errors
    /// When a launch is not one of the program's kernels with its arguments, or the device fails.
    fn prepare(&mut self, schedule: &Schedule) -> Result<Prepared, DeviceError>;

    /// Starts a schedule, which runs after those that were started before. Does not wait.
    ///
    /// # Errors
    /// When the device fails.
    fn run(&mut self, schedule: Prepared) -> Result<(), DeviceError>;

    /// Waits for all schedules that were started.
    ///
    /// # Errors
    /// When one of them has failed.
    fn wait(&mut self) -> Result<(), DeviceError>;

    /// The reason why a schedule is called command by command after its second run, which is slower
    /// than the replay of a recording. None where all are replayed, or where the device records
    /// nothing.
    fn unrecorded(&self) -> Option<&str> {
        None
    }
}

/// Transfers of numbers.
impl dyn Loaded + '_ {
    /// Writes `f32` to a region.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put(&mut self, to: Region, values: &[f32]) -> Result<(), DeviceError> {
        let words: Vec<u32> = values.iter().map(|x| x.to_bits()).collect();
        self.upload(to, &words)
    }

    /// Writes `f64` to a region.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put_doubles(&mut self, to: Region, values: &[f64]) -> Result<(), DeviceError> {
        let bits = values.iter().map(|x| x.to_bits());
        let words: Vec<u32> = bits.flat_map(|b| [b as u32, (b >> 32) as u32]).collect();
        self.upload(to, &words)
    }

    /// Reads a region of `f32`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn get(&mut self, from: Region) -> Result<Vec<f32>, DeviceError> {
        let mut words = vec![0; from.count()];
        self.download(from, &mut words)?;
        Ok(words.into_iter().map(f32::from_bits).collect())
    }

    /// Reads a region of `f64`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn get_doubles(&mut self, from: Region) -> Result<Vec<f64>, DeviceError> {
        let mut words = vec![0; 2 * from.count()];
        self.download(from, &mut words)?;
        let pairs = words.as_chunks::<2>().0.iter();
        Ok(pairs
            .map(|&[low, high]| f64::from_bits(u64::from(low) | u64::from(high) << 32))
            .collect())
    }
}

/// Checks that a device has the memory for `what`. The error says what would fit, by `what_fits` of
/// the free bytes.
///
/// # Errors
/// [`DeviceError::Memory`], or when the device does not answer.
pub fn require_memory(
    device: &dyn Device,
    what: &str,
    needed: usize,
    what_fits: impl FnOnce(usize) -> String,
) -> Result<(), DeviceError> {
    let free = device.free_bytes()?;
    if needed <= free {
        return Ok(());
    }
    Err(DeviceError::Memory {
        what: what.to_owned(),
        needed: in_bytes(needed),
        free: in_bytes(free),
        remedy: what_fits(free),
    })
}

/// The largest number up to `most` for which something fits, if it fits for all smaller ones; 0
/// where it does not even fit for 1. `most` itself is known not to fit.
pub(crate) fn largest_fit(most: usize, fits: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, most);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// A number of bytes for people.
pub(crate) fn in_bytes(bytes: usize) -> String {
    let units = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    let bytes = bytes as f64;
    match units.into_iter().find(|(size, _)| bytes >= *size) {
        Some((size, unit)) => format!("{:.1} {unit}", bytes / size),
        None => format!("{bytes} bytes"),
    }
}

/// Failure of a device.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum DeviceError {
    #[error("{library} was not found: {remedy}")]
    Library {
        library: &'static str,
        remedy: &'static str,
    },
    #[error("the driver is too old: it knows CUDA {found}, and {needed} is needed: {remedy}")]
    OldDriver {
        found: String,
        needed: String,
        remedy: &'static str,
    },
    #[error("there is a driver of CUDA but no GPU that it can use: see what nvidia-smi says")]
    NoDevice,
    #[error("there is no GPU number {number}: {count} are there, counted from 0")]
    NoSuchDevice { number: usize, count: usize },
    #[error("{what} needs {needed} of memory on the device, {free} are free: {remedy}")]
    Memory {
        what: String,
        needed: String,
        free: String,
        remedy: String,
    },
    #[error("the kernels do not compile with {compiler}:\n{log}")]
    Compile { compiler: String, log: String },
    #[error("a file for the compiler: {0}")]
    File(#[from] std::io::Error),
    #[error("the program has no kernel {0}")]
    NoKernel(String),
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    #[error("{call} failed on the device: {reason}")]
    Call { call: &'static str, reason: String },
}
