//! Errors of meshes in files.

use std::fmt::Display;

use selvedge_cloth::MeshError;
use thiserror::Error;

use crate::formats::file_error::FileError;

/// A file that is not a cloth.
pub type ReadMeshError = FileError<MeshFileError>;

/// Content that is not a cloth. Lines and vertices of an OBJ count from 1, as in the file; in other
/// formats vertices and faces count from 0.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says all")]
pub enum MeshFileError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("{0}")]
    Content(String),
    #[error("has no mesh, only nodes")]
    NoMesh,
    /// Faces that do not make one sheet.
    #[error("{0}")]
    Faces(String),
    #[error("{0} (numbers from 0)")]
    Mesh(#[from] MeshError),
}

impl MeshFileError {
    pub(crate) fn content(problem: impl Display) -> Self {
        Self::Content(problem.to_string())
    }

    /// The same error, of a mesh whose borders `were_sewn`, if it can be theirs.
    #[must_use]
    pub(crate) fn of_sewn(self, were_sewn: bool) -> Self {
        match self {
            Self::Faces(problem) if were_sewn => Self::Faces(format!(
                "{problem}. That is so once the seams are sewn: name borders of panels that lie along each other, each in one seam"
            )),
            other => other,
        }
    }
}
