//! Errors of files with states.

use std::path::PathBuf;

use glam::DVec3;
use thiserror::Error;

use crate::formats::npz::NpzError;

/// A state that could not be read from a file.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct ReadStateError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub source: StateError,
}

/// Bytes that hold no such state.
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
