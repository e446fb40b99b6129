//! States of a simulation in files: positions and velocities in f64, from which a run can continue.
//!
//! Read from .safetensors or NumPy's .npz: a pair of arrays `[vertices, 3]` or `[states, vertices,
//! 3]` (f64, or f32, which is widened) and, where there are several states, the frame of each.
//! Unless names are given, the pairs `positions` and `velocities` (with `frames`) and `ckpt_x` and
//! `ckpt_v` (with `ckpt_frames`) are looked for. The file that is written is .safetensors with all
//! frames of a run. For such a file the version is checked too, and its frame rate against that of
//! the run that continues from it.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use selvedge_cloth::{Checkpoint, ContactMemory, PreviousSubstep};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::formats::arrays::{Array, ArrayFile};
use crate::formats::atomic::WriteError;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{check_hash, ending_of, hash, read_file};
use crate::formats::tensor_file::{TensorOut, TensorValues, write_tensors};
use crate::trajectory::Provenance;
use crate::trajectory::file::wrong;

/// The format that a file of states names in its metadata, and its version.
pub const STATES_FORMAT: &str = "selvedge-states";
const VERSION: &str = "1";

/// Farthest from the origin `[m]`, and fastest `[m/s]`, that a vertex of a saved state may be.
const LARGEST: f64 = 1e6;

/// Names of the arrays of positions, velocities and frames: ours, and those of other programs.
const PAIRS: [[&str; 3]; 2] = [
    ["positions", "velocities", "frames"],
    ["ckpt_x", "ckpt_v", "ckpt_frames"],
];
/// Names of the arrays of [`PreviousSubstep`]; where a state has none, its seconds are 0.
const PREVIOUS: [&str; 3] = [
    "previous_positions",
    "previous_velocities",
    "previous_seconds",
];
/// Names of the arrays of [`Checkpoint::changes`]; where a state has none, its seconds are 0.
const CHANGES: [&str; 2] = ["changes", "changes_seconds"];
/// What contact has left in each state, as JSON.
const CONTACT: &str = "contact";
/// Size that a number of it may have.
const MOST: f64 = u32::MAX as f64;

/// A state of a file, resolved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateSpec {
    /// Path of the file, as the scene names it: relative to the scene's folder.
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

impl StateSpec {
    /// Reads the state of a cloth of `vertices` again.
    pub(crate) fn read(&self, folder: &Path, vertices: usize) -> Result<Checkpoint, Problem> {
        let choice = StateChoice {
            file: self.path.clone(),
            frame: Some(self.frame),
            positions: Some(self.positions.clone()),
            velocities: Some(self.velocities.clone()),
            frame_rate: None,
        };
        let read = choice.read(folder, vertices);
        let (state, found) = read.map_err(|error| Problem(error.to_string()))?;
        check_hash(&self.path, &self.blake3, &found.blake3).map_err(Problem)?;
        Ok(state)
    }
}

/// A choice of one state of a file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateChoice {
    /// Path of the file.
    pub file: String,
    /// Frames of the motion that have passed; must be given where the file has several states.
    pub frame: Option<usize>,
    /// Name of the array of positions.
    pub positions: Option<String>,
    /// Name of the array of velocities.
    pub velocities: Option<String>,
    /// Frames per second of the run that continues from the state. Where they are given, a file of
    /// our own must have as many.
    #[serde(skip)]
    pub frame_rate: Option<f64>,
}

/// All states of a run, of the same vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateRun {
    /// The states, in order.
    pub states: Vec<Checkpoint>,
}

impl StateChoice {
    /// Reads the state of `vertices` vertices that is meant, whose file is relative to `folder`; also
    /// how it was found.
    ///
    /// # Errors
    /// [`FileError<Problem>`] names the file, the array and what is wrong with it.
    pub fn read(
        &self,
        folder: &Path,
        vertices: usize,
    ) -> Result<(Checkpoint, StateSpec), FileError<Problem>> {
        let full = folder.join(&self.file);
        let within = FileError::at(&full);
        let bytes = read_file(&full).map_err(FileError::unread(&full))?;
        let file = open(&full, &bytes, self.frame_rate).map_err(&within)?;
        let (state, [positions, velocities]) = select(&file, self, vertices).map_err(&within)?;
        let spec = StateSpec {
            path: self.file.clone(),
            blake3: hash(&bytes),
            frame: state.frame,
            positions,
            velocities,
        };
        Ok((state, spec))
    }
}

impl StateRun {
    /// Reads the states that [`Self::write`] wrote.
    ///
    /// # Errors
    /// [`Problem`] names the array and what is wrong with it.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Problem> {
        let (file, metadata) = ArrayFile::safetensors(bytes)?;
        check_metadata(&metadata, None)?;
        let [positions, velocities, frames] = PAIRS[0];
        let pair = [positions, velocities].map(str::to_owned);
        let arrays = Arrays::read(&file, &pair, None, None)?;
        if arrays.count.is_none() {
            return Err(arrays.positions.wrong("[states, vertices, 3]"));
        }
        let frames = read_frames(&file, frames, arrays.count)?;
        let numbered = frames.into_iter().enumerate();
        let states = numbered.map(|(index, frame)| arrays.state(index, frame as usize));
        Ok(Self {
            states: states.collect::<Result<_, _>>()?,
        })
    }

    /// Writes the states as .safetensors (docs/src/reference/files.md), all or nothing.
    ///
    /// # Errors
    /// [`WriteError`] names the file and what failed.
    pub fn write(&self, path: &Path, provenance: &Provenance) -> Result<(), WriteError> {
        let states = &self.states;
        let vertices = states.first().map_or(0, |state| state.positions.len());
        let none = vec![DVec3::ZERO; vertices];
        let vectors = |name: &'static str, of: fn(&Checkpoint) -> Option<&Vec<DVec3>>| {
            let all = states.iter().flat_map(|state| of(state).unwrap_or(&none));
            let values = all.flat_map(|v| v.to_array()).collect();
            TensorOut::new(
                name,
                &[states.len(), vertices, 3],
                TensorValues::F64(values),
            )
        };
        let seconds = |name: &'static str, of: fn(&Checkpoint) -> Option<f64>| {
            let values = states.iter().map(|state| of(state).unwrap_or(0.0));
            TensorOut::new(name, &[states.len()], TensorValues::F64(values.collect()))
        };
        let mut tensors = vec![
            vectors(PAIRS[0][0], |state| Some(&state.positions)),
            vectors(PAIRS[0][1], |state| Some(&state.velocities)),
        ];
        if states.iter().any(|state| state.previous.is_some()) {
            tensors.extend([
                vectors(PREVIOUS[0], |s| Some(&s.previous.as_ref()?.positions)),
                vectors(PREVIOUS[1], |s| Some(&s.previous.as_ref()?.velocities)),
                seconds(PREVIOUS[2], |s| Some(s.previous.as_ref()?.seconds)),
            ]);
        }
        if states.iter().any(|state| state.changes.is_some()) {
            tensors.extend([
                vectors(CHANGES[0], |s| Some(&s.changes.as_ref()?.0)),
                seconds(CHANGES[1], |s| Some(s.changes.as_ref()?.1)),
            ]);
        }
        let frames = states.iter().map(|state| state.frame as u32).collect();
        let frames = TensorValues::U32(frames);
        tensors.push(TensorOut::new(PAIRS[0][2], &[states.len()], frames));
        if states.iter().any(|state| state.contact.is_some()) {
            let memories: Vec<_> = states.iter().map(|state| &state.contact).collect();
            let text = serde_json::to_vec(&memories);
            let text =
                text.map_err(|error| WriteError::when(path, "write the contact")(error.into()))?;
            let shape = [text.len()];
            tensors.push(TensorOut::new(
                CONTACT,
                &shape,
                TensorValues::U8(text.into()),
            ));
        }
        write_tensors(path, &tensors, &provenance.metadata(STATES_FORMAT, VERSION))
    }
}

/// Opens the file at `path`, of these `bytes`; `frame_rate` as in [`StateChoice`].
fn open<'a>(
    path: &Path,
    bytes: &'a [u8],
    frame_rate: Option<f64>,
) -> Result<ArrayFile<'a>, Problem> {
    match ending_of(path).as_str() {
        "npz" => ArrayFile::npz(bytes),
        "safetensors" => {
            let (file, metadata) = ArrayFile::safetensors(bytes)?;
            check_metadata(&metadata, frame_rate)?;
            Ok(file)
        }
        _ => {
            let problem = "a state is read from .npz or .safetensors";
            Err(Problem(problem.to_owned()))
        }
    }
}

/// Checks that a file of our own has the known version and is of a run at `frame_rate`. Files of
/// others are not checked.
fn check_metadata(
    metadata: &HashMap<String, String>,
    frame_rate: Option<f64>,
) -> Result<(), Problem> {
    let entry = |name: &str| metadata.get(name).map_or("", String::as_str);
    if entry("format") != STATES_FORMAT {
        return Ok(());
    }
    let version = entry("version");
    if version != VERSION {
        return Err(wrong("version", VERSION, version));
    }
    let fps = entry("fps");
    let found = fps.parse::<f64>();
    let found = found.map_err(|_| wrong("fps", "a number of frames per second", fps))?;
    match frame_rate {
        Some(expected) if found != expected => Err(Problem(format!(
            "was saved at {found} frames per second, but the scene has {expected}, and the motion would jump: set frame_rate = {found} in the scene, or save the states of a run at {expected}"
        ))),
        _ => Ok(()),
    }
}

/// The arrays of a file with states.
struct Arrays {
    vertices: usize,
    /// Number of states; none where there is one without a number.
    count: Option<usize>,
    positions: Array<f64>,
    velocities: Array<f64>,
    frames: Option<Vec<u32>>,
    previous: Option<[Array<f64>; 3]>,
    changes: Option<[Array<f64>; 2]>,
    contact: Vec<Option<ContactMemory>>,
}

impl Arrays {
    /// The arrays of positions and velocities of these `names`, of `vertices` vertices where it is
    /// said how many, with all that belongs to them.
    fn read(
        file: &ArrayFile<'_>,
        names: &[String; 2],
        frames: Option<&str>,
        vertices: Option<usize>,
    ) -> Result<Self, Problem> {
        let positions = file.floats(&names[0])?;
        let fits = |found: usize| found > 0 && vertices.is_none_or(|expected| expected == found);
        let (count, vertices) = match positions.shape[..] {
            [found, 3] if fits(found) => (None, found),
            [states, found, 3] if fits(found) => (Some(states), found),
            _ => {
                return Err(match vertices {
                    Some(n) => positions.wrong(&format!("[{n}, 3] or [states, {n}, 3]")),
                    None => positions.wrong("[states, vertices, 3] with a vertex at least"),
                });
            }
        };
        let shape: Vec<Option<usize>> = positions.shape.iter().copied().map(Some).collect();
        let like = |name: &str| file.floats(name)?.of_shape(&shape);
        let seconds = |name: &str| file.floats(name)?.of_shape(&[Some(count.unwrap_or(1))]);
        let is_own = names[..] == PAIRS[0][..2];
        let has = |names: &[&str]| is_own && names.iter().all(|name| file.has(name));
        Ok(Self {
            velocities: like(&names[1])?,
            frames: match frames.filter(|name| count.is_some() && file.has(name)) {
                Some(name) => Some(read_frames(file, name, count)?),
                None => None,
            },
            previous: if has(&PREVIOUS) {
                Some([
                    like(PREVIOUS[0])?,
                    like(PREVIOUS[1])?,
                    seconds(PREVIOUS[2])?,
                ])
            } else {
                None
            },
            changes: if has(&CHANGES) {
                Some([like(CHANGES[0])?, seconds(CHANGES[1])?])
            } else {
                None
            },
            contact: if is_own {
                read_contact(file, count.unwrap_or(1))?
            } else {
                vec![None; count.unwrap_or(1)]
            },
            vertices,
            count,
            positions,
        })
    }

    /// State `index`, in which `frame` frames have passed.
    fn state(&self, index: usize, frame: usize) -> Result<Checkpoint, Problem> {
        let own = |array| self.entry(array, index);
        let mut state = Checkpoint {
            contact: self.contact[index].clone(),
            ..Checkpoint::of(frame, own(&self.positions)?, own(&self.velocities)?)
        };
        if let Some([x, v, seconds]) = &self.previous
            && let Some(seconds) = seconds_of(seconds, index)?
        {
            state.previous = Some(PreviousSubstep {
                positions: own(x)?,
                velocities: own(v)?,
                seconds,
            });
        }
        if let Some([v, seconds]) = &self.changes
            && let Some(seconds) = seconds_of(seconds, index)?
        {
            state.changes = Some((own(v)?, seconds));
        }
        Ok(state)
    }

    /// The entry of state `index` in an array of vectors.
    fn entry(&self, array: &Array<f64>, index: usize) -> Result<Vec<DVec3>, Problem> {
        let length = 3 * self.vertices;
        let own = array.values[index * length..(index + 1) * length].chunks_exact(3);
        let state: Vec<DVec3> = own.map(DVec3::from_slice).collect();
        let is_usable = |value: &DVec3| (0.0..=LARGEST).contains(&value.length());
        match state.iter().position(|value| !is_usable(value)) {
            Some(vertex) => Err(Problem(format!(
                "array {}: the entry of vertex {vertex} must be finite and at most 1e6 long, found {}",
                array.name, state[vertex]
            ))),
            None => Ok(state),
        }
    }

    /// Place of the wanted state, and the frames that have passed in it.
    fn place(&self, wanted: Option<usize>) -> Result<(usize, usize), Problem> {
        let Some(count) = self.count else {
            return Ok((0, wanted.unwrap_or(0)));
        };
        let frames: Vec<usize> = match &self.frames {
            Some(frames) => frames.iter().map(|&frame| frame as usize).collect(),
            None => (0..count).collect(),
        };
        let wanted = match frames[..] {
            [only] => wanted.or(Some(only)),
            _ => wanted,
        };
        let index = frames.iter().position(|&frame| Some(frame) == wanted);
        index.map(|index| (index, frames[index])).ok_or_else(|| {
            let known: Vec<String> = match frames[..] {
                [first, second, third, .., last] if frames.len() > 12 => {
                    vec![format!("{first}, {second}, {third} … {last}")]
                }
                _ => frames.iter().map(usize::to_string).collect(),
            };
            let known = known.join(", ");
            Problem(format!(
                "has the states of frames {known}: say which, as frame"
            ))
        })
    }
}

/// What contact left in each of `states`.
fn read_contact(
    file: &ArrayFile<'_>,
    states: usize,
) -> Result<Vec<Option<ContactMemory>>, Problem> {
    if !file.has(CONTACT) {
        return Ok(vec![None; states]);
    }
    let wrong =
        |found: String| Problem::array(CONTACT, "the contact of each state, as JSON", found);
    let text = file.bytes(CONTACT)?.values;
    let all: Value = serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))?;
    if !is_usable(&all) {
        return Err(wrong(format!("a number beyond {MOST}")));
    }
    let read: Vec<_> = serde_json::from_value(all).map_err(|error| wrong(error.to_string()))?;
    if read.len() != states {
        return Err(wrong(format!("{} for {states} states", read.len())));
    }
    Ok(read)
}

fn is_usable(value: &Value) -> bool {
    match value {
        Value::Number(number) => number.as_f64().is_some_and(|n| n.abs() <= MOST),
        Value::Array(items) => items.iter().all(is_usable),
        Value::Object(fields) => fields.values().all(is_usable),
        _ => true,
    }
}

/// The frame of each of `count` states: none twice.
fn read_frames(
    file: &ArrayFile<'_>,
    name: &str,
    count: Option<usize>,
) -> Result<Vec<u32>, Problem> {
    let frames = file.wholes(name)?.of_shape(&[count])?.values;
    let mut sorted = frames.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Problem(format!(
            "array {name}: frame {} stands twice: which state is meant cannot be told",
            pair[0]
        ))),
        None => Ok(frames),
    }
}

/// The time of state `index` in an array of them; none where it is 0.
fn seconds_of(array: &Array<f64>, index: usize) -> Result<Option<f64>, Problem> {
    match array.values[index] {
        0.0 => Ok(None),
        seconds if seconds.is_finite() && seconds > 0.0 => Ok(Some(seconds)),
        _ => Err(array.wrong("finite seconds, none below 0")),
    }
}

fn select(
    file: &ArrayFile<'_>,
    choice: &StateChoice,
    vertices: usize,
) -> Result<(Checkpoint, [String; 2]), Problem> {
    let no_pair = || {
        Problem(format!(
            "has no velocities beside positions (found {}): name both arrays, as positions = \"x\" and velocities = \"v\"",
            file.names().join(", ")
        ))
    };
    let (pair, frames) = match (&choice.positions, &choice.velocities) {
        (Some(positions), Some(velocities)) => {
            let known = PAIRS.iter().find(|pair| pair[0] == positions);
            ([positions.clone(), velocities.clone()], known.map(|p| p[2]))
        }
        (None, None) => {
            let mut known = PAIRS.iter();
            let found = known.find(|pair| file.has(pair[0]) && file.has(pair[1]));
            let pair = found.ok_or_else(no_pair)?;
            ([pair[0].to_owned(), pair[1].to_owned()], Some(pair[2]))
        }
        _ => return Err(no_pair()),
    };
    let arrays = Arrays::read(file, &pair, frames, Some(vertices))?;
    let (index, frame) = arrays.place(choice.frame)?;
    Ok((arrays.state(index, frame)?, pair))
}

#[cfg(test)]
mod tests;
