//! Result, progress and errors of the search for a rest pose.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{SceneError, VertexId};
use thiserror::Error;

/// A cloth in static equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct SaggedRest {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Number of solves.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex `[m/s²]`.
    pub residual: f64,
}

/// Progress of a search for a rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SagProgress {
    /// Solves so far.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex now `[m/s²]`.
    pub residual: f64,
    /// The vertex that has it.
    pub vertex: VertexId,
    /// Residual at which the search ends `[m/s²]`.
    pub tolerance: f64,
}

/// Reason why no rest pose was found.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SagError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("the scene has no handles: nothing holds the cloth, so it has no sagged rest pose")]
    NoHandles,
    #[error(
        "no equilibrium after {solves} solves: vertex {vertex} is still accelerated by {residual:e} m/s², sag.tolerance is {tolerance:e}; raise sag.max_steps or sag.tolerance"
    )]
    NotConverged {
        solves: u32,
        vertex: VertexId,
        residual: f64,
        tolerance: f64,
    },
    #[error("stopped, as was asked, before an equilibrium was found ({solves} solves)")]
    Stopped { solves: u32 },
    #[error("solve {solves} of the sag failed: {cause}")]
    Solve { solves: u32, cause: String },
}

impl SagError {
    /// The error of a solve that failed after `solves` others.
    pub(super) fn failed_solve(solves: u32, cause: &dyn std::error::Error) -> Self {
        Self::Solve {
            solves,
            cause: cause.to_string(),
        }
    }
}

impl SagProgress {
    /// Returns true if the search has come to its end.
    pub(super) fn is_reached(&self) -> bool {
        self.residual <= self.tolerance
    }

    /// The rest pose at `positions` `[m]`, `[vertices]`.
    pub(super) fn rest(&self, positions: Vec<DVec3>) -> SaggedRest {
        SaggedRest {
            positions,
            solves: self.solves,
            residual: self.residual,
        }
    }

    /// The error of a search that gives up.
    pub(super) fn not_converged(&self) -> SagError {
        SagError::NotConverged {
            solves: self.solves,
            vertex: self.vertex,
            residual: self.residual,
            tolerance: self.tolerance,
        }
    }
}

/// The largest of the vertices' accelerations.
#[derive(Clone, Copy)]
pub(super) struct Largest {
    /// `[m/s²]`; not a number where one of them is not.
    pub(super) value: f64,
    /// The first vertex that has it.
    pub(super) vertex: VertexId,
}

impl Largest {
    /// The largest of `values`, each after its vertex.
    pub(super) fn of(values: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut largest = Self {
            value: 0.0,
            vertex: VertexId(0),
        };
        for (vertex, value) in values {
            if value > largest.value || (value.is_nan() && !largest.value.is_nan()) {
                let vertex = VertexId(vertex as u32);
                largest = Self { value, vertex };
            }
        }
        largest
    }
}

/// A callback that sees every solve and may stop the search.
pub(super) type Listener<'a> = &'a mut dyn FnMut(SagProgress) -> ControlFlow<()>;

/// Reports `now` to `progress`.
///
/// # Errors
/// [`SagError::Stopped`] if `progress` stops the search.
pub(super) fn tell(progress: Listener<'_>, now: SagProgress) -> Result<(), SagError> {
    match progress(now) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(SagError::Stopped { solves: now.solves }),
    }
}
