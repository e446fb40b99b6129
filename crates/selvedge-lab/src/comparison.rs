//! Two trajectories of one mesh, compared.

use selvedge_data::Trajectory;
use selvedge_data::metrics::{self, Comparison, MetricError};
use thiserror::Error;

/// Trajectories that cannot be compared.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum CompareError {
    #[error("they are of different meshes: {first} and {second} vertices")]
    Vertices { first: usize, second: usize },
    #[error("they are of different meshes: as many vertices, but other faces")]
    Faces,
    #[error(
        "they have {first} and {second} frames per second: a frame of one is no frame of the other"
    )]
    Rates { first: f64, second: f64 },
    #[error(transparent)]
    Metric(#[from] MetricError),
}

/// The measures of `b` against `a`.
pub fn compare(a: &Trajectory, b: &Trajectory) -> Result<Comparison, CompareError> {
    let (first, second) = (a.vertex_count(), b.vertex_count());
    if first != second {
        return Err(CompareError::Vertices { first, second });
    }
    if a.topology() != b.topology() {
        return Err(CompareError::Faces);
    }
    let (first, second) = (a.frame_rate(), b.frame_rate());
    if first != second {
        return Err(CompareError::Rates { first, second });
    }
    Ok(metrics::compare(a.frames(), b.frames(), a.topology())?)
}
