//! The one seam: whatever moves a cloth forward by one frame, given its handles.
//!
//! The physics, the learned model and a recording implement [`Stepper`]; the recorder, the
//! evaluator, the viewer and the exporters consume it and never ask which one it is.

use glam::Vec3;
use thiserror::Error;

use crate::{HandleError, HandleTargets, Handles, Topology, VertexId};

/// A cloth that moves one frame at a time.
pub trait Stepper {
    /// The connectivity of the cloth.
    fn topology(&self) -> &Topology;

    /// The handles, in the order in which [`Self::step`] expects their targets.
    fn handles(&self) -> &Handles;

    /// Positions now `[m]`, `[vertices]`.
    fn positions(&self) -> &[Vec3];

    /// Frames stepped since the start.
    fn frame(&self) -> usize;

    /// Moves the cloth by one frame, its handles to `handles`.
    ///
    /// # Errors
    /// [`StepError`]; the cloth is then left as it was before the step.
    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError>;
}

/// A [`Stepper`] that goes on from frames that somebody else has made: a guard's.
pub trait Correctable: Stepper {
    /// Puts `positions` `[m]`, `[vertices]`, in the place of the newest frame: what was stepped to
    /// is forgotten, and the next step goes on from them. The frame count stays.
    ///
    /// # Errors
    /// [`StepError::NonFinite`]; the cloth is then left as it was.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError>;

    /// Takes `positions` `[m]`, `[vertices]`, as the next frame, as if it had stepped there.
    ///
    /// # Errors
    /// As for [`Self::replace_frame`].
    ///
    /// # Panics
    /// As for [`Self::replace_frame`].
    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError>;
}

impl<S: Stepper + ?Sized> Stepper for Box<S> {
    fn topology(&self) -> &Topology {
        (**self).topology()
    }

    fn handles(&self) -> &Handles {
        (**self).handles()
    }

    fn positions(&self) -> &[Vec3] {
        (**self).positions()
    }

    fn frame(&self) -> usize {
        (**self).frame()
    }

    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        (**self).step(handles)
    }
}

impl<S: Correctable + ?Sized> Correctable for Box<S> {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        (**self).replace_frame(positions)
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        (**self).take_frame(positions)
    }
}

/// Why a step failed.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum StepError {
    #[error("frame {frame}: {source}")]
    Handles {
        frame: usize,
        #[source]
        source: HandleError,
    },
    #[error("frame {frame}: the position of vertex {vertex} is no longer finite")]
    NonFinite { frame: usize, vertex: VertexId },
    #[error("frame {frame}: a substep could not be solved ({cause}): use more substeps")]
    Solve { frame: usize, cause: String },
    #[error(
        "frame {frame}: with {substeps} substeps the edge from vertex {from} to {to} still strains by {change:.3} in one of them, bound is {bound}: raise max_substeps or max_change in physics.substepping, or move the handles more slowly"
    )]
    Strain {
        frame: usize,
        substeps: u32,
        from: VertexId,
        to: VertexId,
        change: f64,
        bound: f64,
    },
    #[error("frame {frame}: the device that computes it failed: {reason}")]
    Device { frame: usize, reason: String },
    #[error("frame {frame}: the recording has only {frames} frames")]
    EndOfRecording { frame: usize, frames: usize },
}

/// For a [`Stepper`] around another one: all but [`Stepper::step`] is as in its field `inner`.
#[macro_export]
macro_rules! looks_like {
    ($inner:ident) => {
        fn topology(&self) -> &$crate::Topology {
            self.$inner.topology()
        }

        fn handles(&self) -> &$crate::Handles {
            self.$inner.handles()
        }

        fn positions(&self) -> &[::glam::Vec3] {
            self.$inner.positions()
        }

        fn frame(&self) -> usize {
            self.$inner.frame()
        }
    };
}
