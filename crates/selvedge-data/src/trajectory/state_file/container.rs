//! The arrays of a file with states, from .safetensors or NumPy's archive alike.

use std::collections::HashMap;
use std::path::Path;

use safetensors::SafeTensors;
use safetensors::tensor::Dtype;

use super::error::StateError;
use crate::formats::npz::{Npz, NpzError};
use crate::formats::tensor_file::read_header;

/// The format that a file of states names in its metadata.
pub const STATES_FORMAT: &str = "selvedge-states";

/// The version of that format.
pub(super) const VERSION: &str = "1";

/// Farthest from the origin `[m]`, and fastest `[m/s]`, that a vertex of a saved state may be.
pub(super) const LARGEST: f64 = 1e6;

/// Numbers and dimensions of an array.
pub(super) struct Floats {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// Either container.
pub(super) enum Container<'a> {
    Npz(Npz<'a>),
    Safetensors(SafeTensors<'a>),
}

impl<'a> Container<'a> {
    /// Opens the file at `path`, of these `bytes`; `frame_rate` as in
    /// [`StateChoice`](super::StateChoice).
    pub(super) fn open(
        path: &Path,
        bytes: &'a [u8],
        frame_rate: Option<f64>,
    ) -> Result<Self, StateError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("npz") => Ok(Self::Npz(Npz::open(bytes)?)),
            Some("safetensors") => Self::safetensors(bytes, frame_rate),
            _ => Err(StateError::Kind),
        }
    }

    pub(super) fn safetensors(
        bytes: &'a [u8],
        frame_rate: Option<f64>,
    ) -> Result<Self, StateError> {
        let header = read_header(bytes).map_err(StateError::Container)?;
        if let Some(metadata) = header.metadata() {
            check_metadata(metadata, frame_rate)?;
        }
        let file = SafeTensors::deserialize(bytes).map_err(StateError::Container)?;
        Ok(Self::Safetensors(file))
    }

    /// Returns true if there is an array of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.names().iter().any(|found| found == name)
    }

    pub(super) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = match self {
            Self::Npz(npz) => npz.names().into_iter().map(str::to_owned).collect(),
            Self::Safetensors(file) => file.names().into_iter().map(str::to_owned).collect(),
        };
        names.sort_unstable();
        names
    }

    pub(super) fn missing(&self, name: &str) -> StateError {
        StateError::Missing {
            name: name.to_owned(),
            found: self.names().join(", "),
        }
    }

    pub(super) fn floats(&self, name: &str) -> Result<Floats, StateError> {
        match self {
            Self::Npz(npz) => {
                let array = npz.array(name)?.ok_or_else(|| self.missing(name))?;
                let values = array.floats().map_err(|source| NpzError::Array {
                    name: name.to_owned(),
                    source,
                })?;
                let shape = array.shape;
                Ok(Floats { shape, values })
            }
            Self::Safetensors(file) => {
                let tensor = file.tensor(name).map_err(|_| self.missing(name))?;
                let data = tensor.data();
                let values = match tensor.dtype() {
                    Dtype::F64 => words::<8>(data).map(f64::from_le_bytes).collect(),
                    Dtype::F32 => words::<4>(data)
                        .map(|w| f64::from(f32::from_le_bytes(w)))
                        .collect(),
                    other => return Err(wrong_type(name, "F64 or F32", other)),
                };
                let shape = tensor.shape().to_vec();
                Ok(Floats { shape, values })
            }
        }
    }

    /// The frame of each of `states` states: none twice.
    pub(super) fn frames(&self, name: &str, states: usize) -> Result<Vec<i64>, StateError> {
        let frames = self.integers(name)?;
        if frames.len() != states {
            return Err(StateError::Array {
                name: name.to_owned(),
                expected: format!("[{states}], a frame for each state"),
                found: format!("{} of them", frames.len()),
            });
        }
        let mut sorted = frames.clone();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(StateError::RepeatedFrame {
                name: name.to_owned(),
                frame: pair[0],
            }),
            None => Ok(frames),
        }
    }

    pub(super) fn integers(&self, name: &str) -> Result<Vec<i64>, StateError> {
        match self {
            Self::Npz(npz) => {
                let array = npz.array(name)?.ok_or_else(|| self.missing(name))?;
                let source = array.integers();
                Ok(source.map_err(|source| NpzError::Array {
                    name: name.to_owned(),
                    source,
                })?)
            }
            Self::Safetensors(file) => {
                let tensor = file.tensor(name).map_err(|_| self.missing(name))?;
                let data = tensor.data();
                match tensor.dtype() {
                    Dtype::U32 => Ok(words::<4>(data)
                        .map(|w| i64::from(u32::from_le_bytes(w)))
                        .collect()),
                    Dtype::I32 => Ok(words::<4>(data)
                        .map(|w| i64::from(i32::from_le_bytes(w)))
                        .collect()),
                    Dtype::I64 => Ok(words::<8>(data).map(i64::from_le_bytes).collect()),
                    other => Err(wrong_type(name, "U32, I32 or I64", other)),
                }
            }
        }
    }
}

/// Checks that a file of our own has the known version and is of a run at `frame_rate`. Files of
/// others are not checked.
pub(super) fn check_metadata(
    metadata: &HashMap<String, String>,
    frame_rate: Option<f64>,
) -> Result<(), StateError> {
    let entry = |name: &str| metadata.get(name).map_or("", String::as_str);
    if entry("format") != STATES_FORMAT {
        return Ok(());
    }
    let wrong = |name, expected| StateError::Metadata {
        name,
        expected,
        found: entry(name).to_owned(),
    };
    if entry("version") != VERSION {
        return Err(wrong("version", VERSION));
    }
    let fps = entry("fps").parse::<f64>();
    let found = fps.map_err(|_| wrong("fps", "a number of frames per second"))?;
    match frame_rate {
        Some(expected) if found != expected => Err(StateError::FrameRate { expected, found }),
        _ => Ok(()),
    }
}

pub(super) fn wrong_shape(name: &str, expected: &str, array: &Floats) -> StateError {
    StateError::Array {
        name: name.to_owned(),
        expected: expected.to_owned(),
        found: format!("{:?}", array.shape),
    }
}

pub(super) fn wrong_type(name: &str, expected: &str, found: Dtype) -> StateError {
    StateError::Array {
        name: name.to_owned(),
        expected: expected.to_owned(),
        found: found.to_string(),
    }
}

pub(super) fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    bytes.as_chunks::<N>().0.iter().copied()
}
