//! Compilation of kernels by NVRTC: to machine code for the card at hand, or, where NVRTC is older
//! than the card, to PTX for the newest card that it knows. The driver compiles PTX further.

use std::ffi::CString;

use cudarc::nvrtc::result::{self, NvrtcError};
use cudarc::nvrtc::sys;

use crate::device::DeviceError;

/// The compute capability of a GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Architecture {
    /// 9 of compute capability 9.0.
    pub major: i32,
    /// 0 of compute capability 9.0.
    pub minor: i32,
}

impl Architecture {
    fn number(self) -> i32 {
        10 * self.major + self.minor
    }
}

/// The output of NVRTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Machine code.
    Real(i32),
    /// PTX.
    Virtual(i32),
}

/// The best output for a card, of a compiler that supports some cards (90 for 9.0).
pub(super) fn target(card: Architecture, supported: &[i32]) -> Option<Target> {
    let card = card.number();
    if supported.contains(&card) {
        return Some(Target::Real(card));
    }
    let older = supported.iter().copied().filter(|&known| known < card);
    older.max().map(Target::Virtual)
}

/// A program being compiled.
struct Source(sys::nvrtcProgram);

impl Drop for Source {
    fn drop(&mut self) {
        // SAFETY: it was created and not destroyed. A failure cannot be reported from here.
        let _ = unsafe { result::destroy_program(self.0) };
    }
}

fn failed(call: &'static str) -> impl Fn(NvrtcError) -> DeviceError {
    move |error| DeviceError::Call {
        call,
        reason: format!("{error}"),
    }
}

/// Compiles kernels for a card, to an image for the driver's `cuModuleLoadData`.
///
/// # Errors
/// The compiler's log; a card that is too old for the compiler.
pub fn compile(text: &str, card: Architecture) -> Result<Vec<u8>, DeviceError> {
    let compiler = version()?;
    let target = target(card, &supported()?).ok_or_else(|| DeviceError::Compile {
        compiler: compiler.clone(),
        log: format!(
            "it knows no GPU as old as compute capability {}.{}",
            card.major, card.minor
        ),
    })?;
    let architecture = match target {
        Target::Real(number) => format!("--gpu-architecture=sm_{number}"),
        Target::Virtual(number) => format!("--gpu-architecture=compute_{number}"),
    };
    let text = CString::new(text).map_err(|_| DeviceError::Compile {
        compiler: compiler.clone(),
        log: "a zero byte in the source".to_owned(),
    })?;
    let source = result::create_program(&text, Some(c"selvedge.cu"));
    let source = Source(source.map_err(failed("nvrtcCreateProgram"))?);
    let options = [architecture.as_str(), "--std=c++17", "--disable-warnings"];
    // SAFETY: the program is one that was created above.
    let compiled = unsafe { result::compile_program(source.0, &options) };
    compiled.map_err(|error| DeviceError::Compile {
        compiler,
        log: log(&source).unwrap_or_else(|| format!("{error}")),
    })?;
    image(&source, target).map_err(failed("nvrtcGetCUBIN"))
}

fn image(source: &Source, target: Target) -> Result<Vec<u8>, NvrtcError> {
    let mut size = 0;
    // SAFETY: the program was compiled; its image has as many bytes as it says.
    unsafe {
        match target {
            Target::Real(_) => sys::nvrtcGetCUBINSize(source.0, &raw mut size).result()?,
            Target::Virtual(_) => sys::nvrtcGetPTXSize(source.0, &raw mut size).result()?,
        }
        let mut image = vec![0_u8; size];
        let to = image.as_mut_ptr().cast();
        match target {
            Target::Real(_) => sys::nvrtcGetCUBIN(source.0, to).result()?,
            Target::Virtual(_) => sys::nvrtcGetPTX(source.0, to).result()?,
        }
        Ok(image)
    }
}

fn log(source: &Source) -> Option<String> {
    // SAFETY: the program is one that was created.
    let log = unsafe { result::get_program_log(source.0) }.ok()?;
    let bytes: Vec<u8> = log
        .into_iter()
        .map(|c| c as u8)
        .filter(|&c| c != 0)
        .collect();
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

fn numbers() -> Result<[i32; 2], DeviceError> {
    let (mut major, mut minor) = (0, 0);
    // SAFETY: it writes two integers.
    let asked = unsafe { sys::nvrtcVersion(&raw mut major, &raw mut minor) }.result();
    asked.map_err(failed("nvrtcVersion"))?;
    Ok([major, minor])
}

fn version() -> Result<String, DeviceError> {
    let [major, minor] = numbers()?;
    Ok(format!("NVRTC {major}.{minor}"))
}

/// The major version of CUDA that NVRTC belongs to: 12 of 12.9.
pub(super) fn major() -> Result<i32, DeviceError> {
    numbers().map(|[major, _]| major)
}

/// The cards that NVRTC supports, 90 for 9.0.
fn supported() -> Result<Vec<i32>, DeviceError> {
    let mut count = 0;
    // SAFETY: it writes one integer, then as many as that says.
    unsafe {
        let asked = sys::nvrtcGetNumSupportedArchs(&raw mut count).result();
        asked.map_err(failed("nvrtcGetNumSupportedArchs"))?;
        let mut all = vec![0; usize::try_from(count).unwrap_or(0)];
        let asked = sys::nvrtcGetSupportedArchs(all.as_mut_ptr()).result();
        asked.map_err(failed("nvrtcGetSupportedArchs"))?;
        Ok(all)
    }
}
