//! States of a simulation in files: positions and velocities in f64, from which a run can continue.
//!
//! Read from .safetensors or NumPy's .npz: a pair of arrays `[vertices, 3]` or `[states, vertices,
//! 3]` (f64, or f32, which is widened) and, where there are several states, the frame of each.
//! Unless names are given, the pairs `positions` and `velocities` (with `frames`) and `ckpt_x` and
//! `ckpt_v` (with `ckpt_frames`) are looked for. The file that is written is .safetensors with all
//! frames of a run. For such a file the version is checked too, and its frame rate against that of
//! the run that continues from it.

mod changes;
mod contact;
mod container;
mod error;

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use selvedge_cloth::ContactMemory;
use serde::{Deserialize, Serialize};

use self::changes::{CHANGES, changes, changes_of_run};
pub use self::changes::{LastChanges, RunChanges};
use self::contact::Tables;
pub use self::container::STATES_FORMAT;
use self::container::{Container, Floats, LARGEST, VERSION, wrong_shape};
pub use self::error::{ReadStateError, StateError};
use crate::formats::atomic::WriteError;
use crate::formats::hash::hash;
use crate::formats::input::read_file;
use crate::formats::tensor_file::{TensorOut, TensorValues, write_tensors};
use crate::trajectory::Provenance;

/// A state from which a run can continue.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedState {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Frames of the motion that have passed.
    pub frame: usize,
    /// State one substep before, where a run of second order left it.
    pub previous: Option<PreviousState>,
    /// Memory of contact for the next substep, where there is some.
    pub contact: Option<ContactMemory>,
    /// The last solve, from which the next one of an iterative solver begins.
    pub changes: Option<LastChanges>,
}

/// State of a cloth one substep ago.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviousState {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Length of the substep that led from there `[s]`.
    pub seconds: f64,
}

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

/// A choice of one state of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateChoice {
    /// Frames of the motion that have passed; must be given where the file has several states.
    pub frame: Option<usize>,
    /// Name of the array of positions.
    pub positions: Option<String>,
    /// Name of the array of velocities.
    pub velocities: Option<String>,
    /// Frames per second of the run that continues from the state. Where they are given, a file of
    /// our own must have as many.
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
    /// States one substep before each; empty if there are none, as in runs of first order.
    pub previous: PreviousStates,
    /// Memory of contact of each; empty if nothing ever touched.
    pub contact: Vec<ContactMemory>,
    /// The last solve of each; empty if no solver iterates.
    pub changes: RunChanges,
}

/// States one substep before those of a run. Where a state has none, its seconds are 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreviousStates {
    /// Positions `[m]`, `[states * vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[states * vertices]`.
    pub velocities: Vec<DVec3>,
    /// Lengths of the substeps that led from there `[s]`, `[states]`.
    pub seconds: Vec<f64>,
}

/// Names of the arrays of [`PreviousStates`].
const PREVIOUS: [&str; 3] = [
    "previous_positions",
    "previous_velocities",
    "previous_seconds",
];

const PAIRS: [[&str; 3]; 2] = [
    ["positions", "velocities", "frames"],
    ["ckpt_x", "ckpt_v", "ckpt_frames"],
];

impl SavedState {
    /// At `positions` `[m]`, `[vertices]`, without velocity, before the motion begins.
    #[must_use]
    pub fn at_rest(positions: Vec<DVec3>) -> Self {
        Self {
            velocities: vec![DVec3::ZERO; positions.len()],
            positions,
            frame: 0,
            previous: None,
            contact: None,
            changes: None,
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
        let bytes = read_file(&full).map_err(|e| within(StateError::Read(e)))?;
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
    /// Adds a state.
    pub fn push(&mut self, state: &SavedState) {
        self.positions.extend(&state.positions);
        self.velocities.extend(&state.velocities);
        self.frames.push(state.frame as u32);
        let previous = &mut self.previous;
        if let Some(before) = &state.previous {
            previous.positions.extend(&before.positions);
            previous.velocities.extend(&before.velocities);
            previous.seconds.push(before.seconds);
        } else {
            let still = std::iter::repeat_n(DVec3::ZERO, state.positions.len());
            previous.positions.extend(still.clone());
            previous.velocities.extend(still);
            previous.seconds.push(0.0);
        }
        self.contact.push(state.contact.clone().unwrap_or_default());
        let changes = &mut self.changes;
        if let Some(last) = &state.changes {
            changes.velocities.extend(&last.velocities);
            changes.seconds.push(last.seconds);
        } else {
            let none = std::iter::repeat_n(DVec3::ZERO, state.positions.len());
            changes.velocities.extend(none);
            changes.seconds.push(0.0);
        }
    }

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
        check_shape("velocities", &velocities, &positions.shape)?;
        let number = |frame: i64| {
            u32::try_from(frame).map_err(|_| StateError::Array {
                name: "frames".to_owned(),
                expected: "numbers from 0 to 4294967295".to_owned(),
                found: frame.to_string(),
            })
        };
        let frames = container.frames("frames", states)?;
        let frames: Vec<u32> = frames.into_iter().map(number).collect::<Result<_, _>>()?;
        let shape = &positions.shape;
        let previous = previous_of_run(&container, shape)?;
        let changes = changes_of_run(&container, shape)?;
        let tables = Tables::read(&container, states)?;
        let contact = match tables.is_empty() {
            true => Vec::new(),
            false => (0..states)
                .map(|k| Ok(tables.state(k)?.unwrap_or_default()))
                .collect::<Result<_, StateError>>()?,
        };
        Ok(Self {
            positions: vectors(positions),
            velocities: vectors(velocities),
            frames,
            previous,
            contact,
            changes,
        })
    }

    /// Writes the states as .safetensors, all or nothing: `positions` and `velocities` f64
    /// `[states, vertices, 3]`, `frames` u32 `[states]`, and the metadata of a trajectory with the
    /// format "selvedge-states". A run of second order also has `previous_positions` and
    /// `previous_velocities`, of the same shape, and `previous_seconds` f64 `[states]`. Where a
    /// solver iterates there are `changes`, of the same shape, and `changes_seconds` f64
    /// `[states]`; where something touches, the arrays of contact.
    ///
    /// # Errors
    /// [`WriteError`] names the file and what failed.
    pub fn write(&self, path: &Path, provenance: &Provenance) -> Result<(), WriteError> {
        let vertices = self.positions.len() / self.frames.len().max(1);
        let flat =
            |values: &[DVec3]| -> Vec<f64> { values.iter().flat_map(|v| v.to_array()).collect() };
        let (positions, velocities) = (flat(&self.positions), flat(&self.velocities));
        let shape = vec![self.frames.len(), vertices, 3];
        let states = vec![self.frames.len()];
        let mut tensors = vec![
            ("positions", shape.clone(), TensorValues::F64(&positions)),
            ("velocities", shape.clone(), TensorValues::F64(&velocities)),
        ];
        let previous = &self.previous;
        let (before, moved) = (flat(&previous.positions), flat(&previous.velocities));
        if previous.seconds.iter().any(|seconds| *seconds > 0.0) {
            tensors.extend([
                (PREVIOUS[0], shape.clone(), TensorValues::F64(&before)),
                (PREVIOUS[1], shape.clone(), TensorValues::F64(&moved)),
                (
                    PREVIOUS[2],
                    states.clone(),
                    TensorValues::F64(&previous.seconds),
                ),
            ]);
        }
        let changes = &self.changes;
        let changed = flat(&changes.velocities);
        if changes.seconds.iter().any(|seconds| *seconds > 0.0) {
            tensors.extend([
                (CHANGES[0], shape, TensorValues::F64(&changed)),
                (
                    CHANGES[1],
                    states.clone(),
                    TensorValues::F64(&changes.seconds),
                ),
            ]);
        }
        let tables = Tables::of(&self.contact);
        for (name, columns, values) in tables.reals() {
            let shape = vec![values.len() / columns, columns];
            tensors.push((name, shape, TensorValues::F64(values)));
        }
        tensors.push(("frames", states, TensorValues::U32(&self.frames)));
        for (name, columns, values) in tables.wholes() {
            let shape = vec![values.len() / columns, columns];
            tensors.push((name, shape, TensorValues::U32(values)));
        }
        let tensors: Vec<TensorOut<'_>> = tensors
            .into_iter()
            .map(|(name, shape, values)| TensorOut {
                name,
                shape,
                values,
            })
            .collect();
        write_tensors(path, &tensors, &metadata(provenance))
    }
}

fn metadata(provenance: &Provenance) -> BTreeMap<&'static str, String> {
    BTreeMap::from([
        ("format", STATES_FORMAT.to_owned()),
        ("version", VERSION.to_owned()),
        ("fps", provenance.frame_rate.to_string()),
        ("scene", provenance.scene.to_string()),
        ("made_by", provenance.made_by.clone()),
    ])
}

/// The entries of an array of vectors.
fn vectors(array: Floats) -> Vec<DVec3> {
    let entries = array.values.chunks_exact(3);
    entries.map(DVec3::from_slice).collect()
}

/// States one substep before those of positions of this `shape`; empty where the file has none.
fn previous_of_run(
    container: &Container<'_>,
    shape: &[usize],
) -> Result<PreviousStates, StateError> {
    if !PREVIOUS.iter().all(|name| container.has(name)) {
        return Ok(PreviousStates::default());
    }
    let [x, v, seconds] = PREVIOUS.map(|name| container.floats(name));
    let (x, v, seconds) = (x?, v?, seconds?);
    check_shape(PREVIOUS[0], &x, shape)?;
    check_shape(PREVIOUS[1], &v, shape)?;
    check_shape(PREVIOUS[2], &seconds, &shape[..1])?;
    Ok(PreviousStates {
        positions: vectors(x),
        velocities: vectors(v),
        seconds: seconds.values,
    })
}

fn select(
    container: &Container<'_>,
    choice: &StateChoice,
    vertices: usize,
) -> Result<(SavedState, [String; 2]), StateError> {
    let names = container.names();
    let has = |name: &str| container.has(name);
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
    let is_own = pair == [PAIRS[0][0], PAIRS[0][1]];
    let states = count.unwrap_or(1);
    let state = SavedState {
        positions: positions?,
        velocities: velocities?,
        frame,
        previous: match is_own {
            true => previous(container, index, states, vertices)?,
            false => None,
        },
        contact: match is_own {
            true => Tables::read(container, states)?.state(index)?,
            false => None,
        },
        changes: match is_own {
            true => changes(container, index, states, vertices)?,
            false => None,
        },
    };
    Ok((state, pair))
}

/// State one substep before state `index` of `count`; none where the file has none.
fn previous(
    container: &Container<'_>,
    index: usize,
    count: usize,
    vertices: usize,
) -> Result<Option<PreviousState>, StateError> {
    if !PREVIOUS.iter().all(|name| container.has(name)) {
        return Ok(None);
    }
    let Some(seconds) = seconds(container, PREVIOUS[2], index, count)? else {
        return Ok(None);
    };
    let array = |name: &str| {
        let values = container.floats(name)?;
        entry(name, &values, index, vertices)
    };
    Ok(Some(PreviousState {
        positions: array(PREVIOUS[0])?,
        velocities: array(PREVIOUS[1])?,
        seconds,
    }))
}

/// The time of state `index` of `count` in an array of them; none where it is 0.
fn seconds(
    container: &Container<'_>,
    name: &str,
    index: usize,
    count: usize,
) -> Result<Option<f64>, StateError> {
    let array = container.floats(name)?;
    check_shape(name, &array, &[count])?;
    let seconds = array.values[index];
    if seconds == 0.0 {
        return Ok(None);
    }
    if !(seconds.is_finite() && seconds > 0.0) {
        return Err(StateError::Array {
            name: name.to_owned(),
            expected: "finite seconds, none below 0".to_owned(),
            found: seconds.to_string(),
        });
    }
    Ok(Some(seconds))
}

fn check_shape(name: &str, array: &Floats, expected: &[usize]) -> Result<(), StateError> {
    if array.shape == expected {
        return Ok(());
    }
    Err(wrong_shape(name, &format!("{expected:?}"), array))
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

#[cfg(test)]
mod tests;
