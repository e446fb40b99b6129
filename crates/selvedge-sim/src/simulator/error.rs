//! Why a simulator cannot be made or resumed.

use glam::DVec3;
use selvedge_cloth::{SceneError, VertexId};
use thiserror::Error;

/// Reason why a simulator cannot be made or resumed.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SimulatorError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("expected {what} of {expected} vertices, found {found}")]
    Count {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("the {what} of vertex {vertex} is not finite in f32: {value}")]
    NonFinite {
        what: &'static str,
        vertex: VertexId,
        value: DVec3,
    },
    #[error("the length of the previous substep must be finite and positive, found {seconds} s")]
    PreviousSubstep { seconds: f64 },
    #[error(
        "the cloth starts with {count} intersections ({pairs}): start it where nothing meets, or remove `contact`"
    )]
    Intersections { count: usize, pairs: String },
    #[error(
        "contact.thickness is {thickness} m, but the shortest edge of the cloth has {edge:.2e} m: use at most a quarter of that, or a coarser mesh"
    )]
    Thickness { thickness: f64, edge: f64 },
    #[error("the system of {vertices} vertices cannot be set up ({cause}): use a smaller mesh")]
    Analysis { vertices: usize, cause: String },
}
