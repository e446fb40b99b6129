//! Errors of foreign data: always with the file.

use selvedge_cloth::{ClothError, HandleError, MeshError};
use thiserror::Error;

use crate::formats::file_error::FileError;
use crate::formats::polygons::ReadMeshError;
use crate::trajectory::TrajectoryError;

/// Foreign data that cannot be imported, with the file or folder.
pub type ForeignError = FileError<ForeignProblem>;

/// A problem of foreign data.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ForeignProblem {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("{0}")]
    Layout(String),
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
