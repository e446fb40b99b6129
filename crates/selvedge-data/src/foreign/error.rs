//! Errors of foreign data: always with the file.

use std::path::PathBuf;

use glam::DVec3;
use selvedge_cloth::{ClothError, HandleError, MeshError};
use thiserror::Error;

use crate::formats::polygons::ReadMeshError;
use crate::trajectory::TrajectoryError;

/// Foreign data that cannot be imported.
#[derive(Debug, Error)]
#[error("{}: {problem}", path.display())]
pub struct ForeignError {
    /// The file or folder.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub problem: ForeignProblem,
}

/// A problem of foreign data.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ForeignProblem {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("{0}")]
    Layout(String),
    #[error("the data do not say {what}: give {option} ({hint})")]
    Missing {
        what: &'static str,
        option: &'static str,
        hint: &'static str,
    },
    #[error("{option} must be {expected}, found {found}")]
    Option {
        option: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error("{what} is for {found} {unit}, but there are {expected}")]
    Count {
        what: String,
        unit: &'static str,
        expected: usize,
        found: usize,
    },
    #[error(
        "face {face} names vertex {vertex}, but there are {vertices} vertices, numbered from 0"
    )]
    FaceVertex {
        face: usize,
        vertex: u32,
        vertices: usize,
    },
    #[error(
        "{place}: vertex {vertex} is at {position} m, more than {farthest} m from the origin: positions must be in metres"
    )]
    Far {
        place: String,
        vertex: usize,
        position: DVec3,
        farthest: f64,
    },
    #[error("face {face} is clockwise in material space, others are not: turn all one way")]
    Orientation { face: usize },
    #[error(
        "the faces have {found} m² in all, but {expected} m² in material space: texture coordinates must be in metres"
    )]
    Area { expected: f64, found: f64 },
    #[error("the mesh: {0}")]
    Mesh(#[from] MeshError),
    #[error("the handles: {0}")]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    Cloth(#[from] ClothError),
    #[error(transparent)]
    Obj(#[from] ReadMeshError),
}
