//! Why a simulator cannot be made or resumed.

use glam::DVec3;
use selvedge_cloth::{SceneError, VertexId};
use thiserror::Error;

use crate::solver::SolveError;

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
        "the cloth starts with {count} intersections ({pairs}): {}",
        match body {
            None => "write start = \"untangle\" to move it apart where it meets itself, or contact.self = false".to_owned(),
            Some(body) => format!("start it where nothing meets, write dress = {body:?} to put it onto that body, or take the obstacle away"),
        }
    )]
    Intersections {
        count: usize,
        pairs: String,
        /// The first obstacle that the cloth meets; none if it meets only itself.
        body: Option<String>,
    },
    #[error(
        "contact.thickness is {thickness} m and may be a quarter of an edge, but {short} of {edges} edges of the cloth are shorter than {} m; the shortest, from vertex {} to {}, has {edge:.2e} m: write contact.thickness = {:.1e}, or merge such vertices",
        4.0 * thickness, ends[0], ends[1], 0.24 * edge
    )]
    Thickness {
        thickness: f64,
        /// Length of the shortest edge `[m]`, and its ends.
        edge: f64,
        ends: [VertexId; 2],
        /// Edges that are too short, and all.
        short: usize,
        edges: usize,
    },
    #[error("the system of {vertices} vertices cannot be set up ({cause}): use a smaller mesh")]
    Analysis { vertices: usize, cause: String },
}

impl SimulatorError {
    /// A system that cannot be set up.
    pub(super) fn analysis(vertices: usize, cause: &SolveError) -> Self {
        let cause = cause.to_string();
        Self::Analysis { vertices, cause }
    }
}
