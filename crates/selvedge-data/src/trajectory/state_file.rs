//! States of a simulation in files: positions and velocities in f64, from which a run can go on.
//!
//! Read from .safetensors or NumPy's .npz: a pair of arrays `[vertices, 3]` or `[states, vertices,
//! 3]` (f64, or f32, which is widened) and, where there are several states, the frame of each.
//! Unless names are given, the pairs `positions` and `velocities` (with `frames`) and `ckpt_x` and
//! `ckpt_v` (with `ckpt_frames`) are looked for. Written is .safetensors, with all frames of a run;
//! of such a file the version is checked too, and that its frames are as long as those of the run
//! that goes on from it.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use glam::DVec3;
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::formats::atomic::WriteError;
use crate::formats::hash::hash;
use crate::formats::npz::{Npz, NpzError};
use crate::formats::tensor_file::{TensorOut, TensorValues, write_tensors};
use crate::trajectory::Provenance;

/// A state to go on from.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedState {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Frames of the motion that have passed.
    pub frame: usize,
}

/// A state of a file, resolved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateSpec {
    /// Its path, as the scene names it: relative to the scene's folder.
    pub path: String,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub blake3: String,
    /// Frames of the motion that have passed.
    pub frame: usize,
    /// Name of the array of positions.
    pub positions: String,
    /// Name of the array of velocities.
    pub velocities: String,
}

/// A choice of one state of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateChoice {
    /// Frames of the motion that have passed; must be given where the file has several states.
    pub frame: Option<usize>,
    /// Name of the array of positions.
    pub positions: Option<String>,
    /// Name of the array of velocities.
    pub velocities: Option<String>,
    /// Frames per second of the run that goes on from it; where it is given, a file of our own must
    /// have as many.
    pub frame_rate: Option<f64>,
}

/// All states of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateRun {
    /// Positions `[m]`, `[states * vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[states * vertices]`.
    pub velocities: Vec<DVec3>,
    /// Frames of the motion that have passed in each state, `[states]`.
    pub frames: Vec<u32>,
}

/// Why a state could not be read from a file.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct ReadStateError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub source: StateError,
}

/// Why bytes hold no such state.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum StateError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("a state is read from .npz or .safetensors")]
    Kind,
    #[error("is no complete safetensors file: {0}")]
    Container(#[source] safetensors::SafeTensorError),
    #[error(transparent)]
    Npz(#[from] NpzError),
    #[error("has no array named {name} (found {found})")]
    Missing { name: String, found: String },
    #[error(
        "has no velocities beside positions (found {found}): name both arrays, as positions = \"x\" and velocities = \"v\""
    )]
    NoPair { found: String },
    #[error("array {name}: expected {expected}, found {found}")]
    Array {
        name: String,
        expected: String,
        found: String,
    },
    #[error("has the states of frames {known}: say which, as frame")]
    Frame { known: String },
    #[error(
        "array {name}: the entry of vertex {vertex} must be finite and at most 1e6 long, found {found}"
    )]
    Value {
        name: String,
        vertex: usize,
        found: DVec3,
    },
    #[error("array {name}: frame {frame} stands twice: which state is meant cannot be told")]
    RepeatedFrame { name: String, frame: i64 },
    #[error("has changed since the scene was resolved (hash {found}, expected {expected})")]
    Changed { expected: String, found: String },
    #[error("metadata {name}: expected {expected}, found {found:?}")]
    Metadata {
        name: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error(
        "was saved at {found} frames per second, but the scene has {expected}, and the motion would jump: set frame_rate = {found} in the scene, or save the states of a run at {expected}"
    )]
    FrameRate { expected: f64, found: f64 },
}

/// The format that a file of states names in its metadata.
pub const STATES_FORMAT: &str = "selvedge-states";

/// The version of that format.
const VERSION: &str = "1";

/// Farthest from the origin `[m]`, and fastest `[m/s]`, that a vertex of a saved state may be.
const LARGEST: f64 = 1e6;

const PAIRS: [[&str; 3]; 2] = [
    ["positions", "velocities", "frames"],
    ["ckpt_x", "ckpt_v", "ckpt_frames"],
];

/// Numbers and dimensions of an array.
struct Floats {
    shape: Vec<usize>,
    values: Vec<f64>,
}

/// Either container.
enum Container<'a> {
    Npz(Npz<'a>),
    Safetensors(SafeTensors<'a>),
}

impl SavedState {
    /// At `positions` `[m]`, `[vertices]`, without velocity, before the motion begins.
    #[must_use]
    pub fn at_rest(positions: Vec<DVec3>) -> Self {
        Self {
            velocities: vec![DVec3::ZERO; positions.len()],
            positions,
            frame: 0,
        }
    }

    /// Reads the state of `vertices` vertices that `choice` means from the file at `path`, which is
    /// relative to `folder`; also how it was found.
    ///
    /// # Errors
    /// [`ReadStateError`] names the file, the array and what is wrong with it.
    pub fn read(
        folder: &Path,
        path: &str,
        choice: &StateChoice,
        vertices: usize,
    ) -> Result<(Self, StateSpec), ReadStateError> {
        let full = folder.join(path);
        let within = |source| ReadStateError {
            path: full.clone(),
            source,
        };
        let bytes = std::fs::read(&full).map_err(|e| within(StateError::Read(e)))?;
        let container = Container::open(&full, &bytes, choice.frame_rate).map_err(within)?;
        let (state, [positions, velocities]) =
            select(&container, choice, vertices).map_err(within)?;
        let spec = StateSpec {
            path: path.to_owned(),
            blake3: hash(&bytes),
            frame: state.frame,
            positions,
            velocities,
        };
        Ok((state, spec))
    }

    /// Reads the state again that `spec` tells of.
    ///
    /// # Errors
    /// As for [`Self::read`]; also [`StateError::Changed`].
    pub fn reread(
        folder: &Path,
        spec: &StateSpec,
        vertices: usize,
    ) -> Result<Self, ReadStateError> {
        let choice = StateChoice {
            frame: Some(spec.frame),
            positions: Some(spec.positions.clone()),
            velocities: Some(spec.velocities.clone()),
            frame_rate: None,
        };
        let (state, now) = Self::read(folder, &spec.path, &choice, vertices)?;
        if now.blake3 == spec.blake3 {
            return Ok(state);
        }
        Err(ReadStateError {
            path: folder.join(&spec.path),
            source: StateError::Changed {
                expected: spec.blake3.clone(),
                found: now.blake3,
            },
        })
    }
}

impl StateRun {
    /// Reads the states that [`Self::write`] wrote.
    ///
    /// # Errors
    /// [`StateError`] names the array and what is wrong with it.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StateError> {
        let container = Container::safetensors(bytes, None)?;
        let positions = container.floats("positions")?;
        let states = match positions.shape[..] {
            [states, vertices, 3] if vertices > 0 => states,
            _ => {
                let expected = "[states, vertices, 3] with a vertex at least";
                return Err(wrong_shape("positions", expected, &positions));
            }
        };
        let velocities = container.floats("velocities")?;
        if velocities.shape != positions.shape {
            let expected = format!("{:?}", positions.shape);
            return Err(wrong_shape("velocities", &expected, &velocities));
        }
        let number = |frame: i64| {
            u32::try_from(frame).map_err(|_| StateError::Array {
                name: "frames".to_owned(),
                expected: "numbers from 0 to 4294967295".to_owned(),
                found: frame.to_string(),
            })
        };
        let frames = container.frames("frames", states)?;
        let frames: Vec<u32> = frames.into_iter().map(number).collect::<Result<_, _>>()?;
        let vectors = |array: Floats| {
            let entries = array.values.chunks_exact(3);
            entries.map(DVec3::from_slice).collect()
        };
        Ok(Self {
            positions: vectors(positions),
            velocities: vectors(velocities),
            frames,
        })
    }

    /// Writes the states as .safetensors, all or nothing: `positions` and `velocities` f64
    /// `[states, vertices, 3]`, `frames` u32 `[states]`, and the metadata of a trajectory with the
    /// format "selvedge-states".
    ///
    /// # Errors
    /// [`WriteError`] names the file and what failed.
    pub fn write(&self, path: &Path, provenance: &Provenance) -> Result<(), WriteError> {
        let vertices = self.positions.len() / self.frames.len().max(1);
        let flat =
            |values: &[DVec3]| -> Vec<f64> { values.iter().flat_map(|v| v.to_array()).collect() };
        let (positions, velocities) = (flat(&self.positions), flat(&self.velocities));
        let shape = vec![self.frames.len(), vertices, 3];
        let tensors = [
            ("positions", shape.clone(), TensorValues::F64(&positions)),
            ("velocities", shape, TensorValues::F64(&velocities)),
            (
                "frames",
                vec![self.frames.len()],
                TensorValues::U32(&self.frames),
            ),
        ]
        .map(|(name, shape, values)| TensorOut {
            name,
            shape,
            values,
        });
        let metadata = BTreeMap::from([
            ("format", STATES_FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("fps", provenance.frame_rate.to_string()),
            ("scene", provenance.scene.to_string()),
            ("made_by", provenance.made_by.clone()),
        ]);
        write_tensors(path, &tensors, &metadata)
    }
}

fn select(
    container: &Container<'_>,
    choice: &StateChoice,
    vertices: usize,
) -> Result<(SavedState, [String; 2]), StateError> {
    let names = container.names();
    let has = |name: &str| names.iter().any(|n| n == name);
    let (pair, frames_name) = match (&choice.positions, &choice.velocities) {
        (Some(positions), Some(velocities)) => {
            let known = PAIRS.iter().find(|pair| pair[0] == positions);
            ([positions.clone(), velocities.clone()], known.map(|p| p[2]))
        }
        (None, None) => PAIRS
            .iter()
            .find(|pair| has(pair[0]) && has(pair[1]))
            .map(|pair| ([pair[0].to_owned(), pair[1].to_owned()], Some(pair[2])))
            .ok_or_else(|| StateError::NoPair {
                found: names.join(", "),
            })?,
        _ => {
            let found = names.join(", ");
            return Err(StateError::NoPair { found });
        }
    };
    let arrays = [container.floats(&pair[0])?, container.floats(&pair[1])?];
    let count = states_in(&pair[0], &arrays[0], vertices)?;
    let frames = match (frames_name.filter(|name| has(name)), count) {
        (Some(name), Some(count)) => Some(container.frames(name, count)?),
        _ => None,
    };
    let (index, frame) = place(choice.frame, count, frames.as_deref())?;
    let [positions, velocities] = [0, 1].map(|k| entry(&pair[k], &arrays[k], index, vertices));
    let state = SavedState {
        positions: positions?,
        velocities: velocities?,
        frame,
    };
    Ok((state, pair))
}

/// Number of states of `vertices` vertices in an array; none where it is one state without a
/// number. There are no more states than numbers in the file.
fn states_in(name: &str, array: &Floats, vertices: usize) -> Result<Option<usize>, StateError> {
    let fits = |found: usize| found == vertices && found > 0;
    match array.shape[..] {
        [found, 3] if fits(found) => Ok(None),
        [states, found, 3] if fits(found) => Ok(Some(states)),
        _ => {
            let expected = format!("[{vertices}, 3] or [states, {vertices}, 3]");
            Err(wrong_shape(name, &expected, array))
        }
    }
}

/// Place of the wanted state among `count`, and the frames that have passed in it.
fn place(
    wanted: Option<usize>,
    count: Option<usize>,
    frames: Option<&[i64]>,
) -> Result<(usize, usize), StateError> {
    let Some(count) = count else {
        return Ok((0, wanted.unwrap_or(0)));
    };
    let frames: Vec<i64> = match frames {
        Some(frames) => frames.to_vec(),
        None => (0..count as i64).collect(),
    };
    let wanted = match (wanted, frames.as_slice()) {
        (Some(wanted), _) => Some(wanted as i64),
        (None, &[only]) => Some(only),
        (None, _) => None,
    };
    let index = frames.iter().position(|frame| Some(*frame) == wanted);
    match index {
        Some(index) if frames[index] >= 0 => Ok((index, frames[index] as usize)),
        _ => {
            let known: Vec<String> = match frames[..] {
                [first, second, third, .., last] if frames.len() > 12 => {
                    vec![format!("{first}, {second}, {third} … {last}")]
                }
                _ => frames.iter().map(i64::to_string).collect(),
            };
            let known = known.join(", ");
            Err(StateError::Frame { known })
        }
    }
}

/// State `index` of an array.
fn entry(
    name: &str,
    array: &Floats,
    index: usize,
    vertices: usize,
) -> Result<Vec<DVec3>, StateError> {
    let count = states_in(name, array, vertices)?.unwrap_or(1);
    if index >= count {
        let expected = format!("a state for each of the positions, {} at least", index + 1);
        return Err(wrong_shape(name, &expected, array));
    }
    let start = 3 * vertices * index;
    let state: Vec<DVec3> = array.values[start..start + 3 * vertices]
        .chunks_exact(3)
        .map(DVec3::from_slice)
        .collect();
    let is_usable = |value: &DVec3| (0.0..=LARGEST).contains(&value.length());
    match state.iter().position(|value| !is_usable(value)) {
        Some(vertex) => Err(StateError::Value {
            name: name.to_owned(),
            vertex,
            found: state[vertex],
        }),
        None => Ok(state),
    }
}

impl<'a> Container<'a> {
    /// The file at `path`, of these `bytes`; `frame_rate` as in [`StateChoice`].
    fn open(path: &Path, bytes: &'a [u8], frame_rate: Option<f64>) -> Result<Self, StateError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("npz") => Ok(Self::Npz(Npz::open(bytes)?)),
            Some("safetensors") => Self::safetensors(bytes, frame_rate),
            _ => Err(StateError::Kind),
        }
    }

    fn safetensors(bytes: &'a [u8], frame_rate: Option<f64>) -> Result<Self, StateError> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(StateError::Container)?;
        if let Some(metadata) = header.metadata() {
            check_metadata(metadata, frame_rate)?;
        }
        let file = SafeTensors::deserialize(bytes).map_err(StateError::Container)?;
        Ok(Self::Safetensors(file))
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = match self {
            Self::Npz(npz) => npz.names().into_iter().map(str::to_owned).collect(),
            Self::Safetensors(file) => file.names().into_iter().map(str::to_owned).collect(),
        };
        names.sort_unstable();
        names
    }

    fn missing(&self, name: &str) -> StateError {
        StateError::Missing {
            name: name.to_owned(),
            found: self.names().join(", "),
        }
    }

    fn floats(&self, name: &str) -> Result<Floats, StateError> {
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
    fn frames(&self, name: &str, states: usize) -> Result<Vec<i64>, StateError> {
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

    fn integers(&self, name: &str) -> Result<Vec<i64>, StateError> {
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

/// That a file of our own is of the version that is known, and of a run at `frame_rate`. Files of
/// others are taken at the word of who names them.
fn check_metadata(
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

fn wrong_shape(name: &str, expected: &str, array: &Floats) -> StateError {
    StateError::Array {
        name: name.to_owned(),
        expected: expected.to_owned(),
        found: format!("{:?}", array.shape),
    }
}

fn wrong_type(name: &str, expected: &str, found: Dtype) -> StateError {
    StateError::Array {
        name: name.to_owned(),
        expected: expected.to_owned(),
        found: found.to_string(),
    }
}

fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    bytes.as_chunks::<N>().0.iter().copied()
}

#[cfg(test)]
mod tests;
