//! The seam of the workspace: anything that moves a cloth forward by one frame, given targets for
//! its handles.
//!
//! The physics, the learned model and a recording implement [`Stepper`]; the recorder, the
//! evaluator, the viewer and the exporters consume it and never ask which one it is.
//! `tests/conformance` of this crate checks an implementation.

use std::any::Any;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use thiserror::Error;

use crate::{HandleError, HandleTargets, Handles, Rigid, Stop, Topology, VertexId};

/// A cloth that moves one frame at a time.
///
/// Frame 0 is the start. A step leads from frame [`Self::frame`] to the frame after it. Every
/// [`StepError`] names the frame that could not be reached: `frame() + 1`, 1 for the first step.
pub trait Stepper {
    /// The connectivity of the cloth. It stays the same.
    fn topology(&self) -> &Topology;

    /// The handles, in the order in which [`Self::step`] expects their targets. They stay the same.
    fn handles(&self) -> &Handles;

    /// Positions now `[m]`, `[vertices]`, all finite.
    fn positions(&self) -> &[Vec3];

    /// Frames stepped since the start.
    fn frame(&self) -> usize;

    /// Places of the handles now `[m]`, `[handles]`, as exactly as they are known.
    fn handle_places(&self) -> Vec<DVec3> {
        let places = self.handles().of(self.positions());
        places.map(|p| p.as_dvec3()).collect()
    }

    /// Moves the cloth by one frame, its handles to `targets`: places, also of a handle that takes hold
    /// again ([`crate::HandlePath::follow`] gives those of a path).
    ///
    /// # Errors
    /// [`StepError`], which names the frame that could not be reached. The cloth is left as it was
    /// before the step: the frames that follow are those of a cloth whose step was never tried.
    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError>;

    /// Lets steps end with [`StepError::Stopped`] from when `stop` is wanted, within a frame where
    /// a frame takes long. A stepper whose frames are short need not hear it.
    fn stop_by(&mut self, stop: Stop) {
        let _ = stop;
    }

    /// The state now, for [`Self::rewind`]; none of a stepper that cannot go back.
    fn snapshot(&self) -> Option<Snapshot> {
        None
    }

    /// Goes back to a snapshot of this stepper, or of one that was made alike. The frames that
    /// follow have the bytes of those that followed then.
    ///
    /// # Errors
    /// [`StepError::Snapshot`], with the frame now, for a snapshot of another kind or cloth; the
    /// cloth is left as it was.
    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let _ = snapshot;
        Err(StepError::Snapshot {
            frame: self.frame(),
        })
    }

    /// Sets the cloth elsewhere between two frames, as a character is that appears in another place:
    /// rigidly, its velocities turned along, and with it the obstacles of the numbers `along`. The
    /// next targets begin from there.
    ///
    /// # Errors
    /// [`StepError`], with the frame now, where the cloth would meet an obstacle, for the number of no
    /// obstacle, or of a stepper that cannot be set elsewhere; the cloth is left as it was.
    fn teleport(&mut self, to: Rigid, along: &[usize]) -> Result<(), StepError> {
        let _ = (to, along);
        let what = "only the solver can teleport a cloth, and not a network or a recording";
        Err(HandleError::Unusable(what.to_owned()).at(self.frame()))
    }
}

/// A state of a stepper in memory. Clones share it.
#[derive(Clone, Debug)]
pub struct Snapshot(Arc<dyn Any + Send + Sync>);

impl Snapshot {
    /// A snapshot of this state, whose type only its stepper knows.
    pub fn of<T: Any + Send + Sync>(state: T) -> Self {
        Self(Arc::new(state))
    }

    /// The state, where it is of this type and `fits`.
    ///
    /// # Errors
    /// [`StepError::Snapshot`] of `frame`, that of the stepper now.
    pub fn get<T: Any>(&self, frame: usize, fits: impl Fn(&T) -> bool) -> Result<&T, StepError> {
        let state = self.0.downcast_ref().filter(|state| fits(state));
        state.ok_or(StepError::Snapshot { frame })
    }
}

/// A [`Stepper`] that continues from frames made elsewhere. A guard corrects through it.
pub trait Correctable: Stepper {
    /// Replaces the newest frame by `positions` `[m]`, `[vertices]`. The next step starts from
    /// them. The frame count stays.
    ///
    /// # Errors
    /// [`StepError::NonFinite`], [`StepError::Intersections`] or [`StepError::Device`], with the
    /// number of the newest frame; the cloth is left as it was.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError>;

    /// Takes `positions` `[m]`, `[vertices]`, as the next frame, in place of a step.
    ///
    /// # Errors
    /// As for [`Self::replace_frame`], with the number of the next frame.
    ///
    /// # Panics
    /// As for [`Self::replace_frame`].
    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError>;

    /// Undoes the last [`Stepper::step`], also if its frame was replaced since: the cloth is as it
    /// was before that step. Does nothing unless that step came last and succeeded.
    fn undo_step(&mut self);

    /// True if edges of the newest frame were beyond [`crate::Cloth::edge_bounds`] before the stepper itself
    /// brought them back.
    fn is_strained(&self) -> bool {
        false
    }
}

/// Implements the methods of [`Stepper`] that say what moves and where it is, and `stop_by`, by
/// another stepper, as `self: self.inner`; `but stop_by` leaves that out.
#[macro_export]
macro_rules! delegate_stepper {
    ($self:ident: $inner:expr) => {
        $crate::delegate_stepper!($self: $inner, but stop_by);

        fn stop_by(&mut $self, stop: $crate::Stop) {
            $inner.stop_by(stop);
        }
    };
    ($self:ident: $inner:expr, but stop_by) => {
        fn topology(&$self) -> &$crate::Topology {
            $inner.topology()
        }

        fn handles(&$self) -> &$crate::Handles {
            $inner.handles()
        }

        fn positions(&$self) -> &[::glam::Vec3] {
            $inner.positions()
        }

        fn frame(&$self) -> usize {
            $inner.frame()
        }

        fn handle_places(&$self) -> ::std::vec::Vec<::glam::DVec3> {
            $inner.handle_places()
        }
    };
}

impl<S: Stepper + ?Sized> Stepper for Box<S> {
    delegate_stepper!(self: (**self));

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        (**self).step(targets)
    }

    fn snapshot(&self) -> Option<Snapshot> {
        (**self).snapshot()
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        (**self).rewind(snapshot)
    }

    fn teleport(&mut self, to: Rigid, along: &[usize]) -> Result<(), StepError> {
        (**self).teleport(to, along)
    }
}

impl<S: Correctable + ?Sized> Correctable for Box<S> {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        (**self).replace_frame(positions)
    }

    fn is_strained(&self) -> bool {
        (**self).is_strained()
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        (**self).take_frame(positions)
    }

    fn undo_step(&mut self) {
        (**self).undo_step();
    }
}

/// Reason for a failed step; `frame` is the frame that could not be reached.
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
        "frame {frame}: {pair} cannot be kept apart (gap {gap:.1e} m){}: {}{}",
        squeezing(squeezed_by),
        if squeezed_by.is_empty() { "use more substeps, or move handles and obstacles more slowly and nowhere so close that the cloth has no room, or teleport the cloth where its handles are set elsewhere at once" } else { "keep them apart" },
        if *may_yield { ", or write contact.squeezed = \"yield\"" } else { "" }
    )]
    Contact {
        frame: usize,
        pair: String,
        gap: f64,
        /// Names of the obstacles that leave the cloth no room there: two, or one that passes
        /// through itself.
        squeezed_by: Vec<String>,
        /// True if the scene could let one of them through.
        may_yield: bool,
    },
    #[error(
        "frame {frame}: the cloth meets in {count} places ({pairs}): give a frame in which nothing meets, or remove `contact` from the scene"
    )]
    Intersections {
        frame: usize,
        count: usize,
        pairs: String,
    },
    #[error(
        "frame {frame}: {distance:.0} m from the origin the positions in single precision meet in {count} places ({pairs}), where the cloth itself does not: move the scene to the origin"
    )]
    Rounded {
        frame: usize,
        distance: f64,
        count: usize,
        pairs: String,
    },
    #[error(
        "frame {frame}: with {substeps} substeps the edge from vertex {from} to {to} is strained by {strain:.3}, bound is {bound}{}: cloth does not stretch so far; use less wind, slower handles or handles closer together{}, teleport the cloth where its handles are set elsewhere at once, or raise physics.max_strain",
        pushing(pushed_by),
        if pushed_by.is_empty() { "" } else { ", slower obstacles" }
    )]
    Overstretched {
        frame: usize,
        substeps: u32,
        from: VertexId,
        to: VertexId,
        strain: f64,
        bound: f64,
        /// Names of the obstacles that push the cloth in this frame.
        pushed_by: Vec<String>,
    },
    #[error("frame {frame}: the device that computes it failed: {reason}")]
    Device { frame: usize, reason: String },
    #[error("frame {frame}: stopped, as was asked, before it was reached")]
    Stopped { frame: usize },
    #[error("frame {frame}: the recording has only {frames} frames")]
    EndOfRecording { frame: usize, frames: usize },
    #[error(
        "frame {frame}: there is no going back to this snapshot: it is of another kind of stepper, or of another scene; take one of this stepper"
    )]
    Snapshot { frame: usize },
    #[error(
        "frame {frame}: there is no obstacle {number}: {count} can be led, numbered from 0 in the order of the scene; only the solver leads any, of a scene with contact"
    )]
    Obstacle {
        frame: usize,
        number: usize,
        count: usize,
    },
}

/// Obstacles that push, as a part of a message.
fn pushing(names: &[String]) -> String {
    let each: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
    match each.len() {
        0 => String::new(),
        1 => format!(", while obstacle {} pushes the cloth", each[0]),
        _ => format!(", while obstacles {} push the cloth", each.join(", ")),
    }
}

/// Obstacles that squeeze the cloth, as a part of a message.
fn squeezing(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => format!(", since obstacle {one:?} comes too near to itself there"),
        [one, other, ..] => format!(", since obstacles {one:?} and {other:?} leave it no room"),
    }
}

impl StepError {
    /// The frame that could not be reached.
    pub fn frame(&self) -> usize {
        match *self {
            Self::Handles { frame, .. }
            | Self::NonFinite { frame, .. }
            | Self::Solve { frame, .. }
            | Self::Contact { frame, .. }
            | Self::Intersections { frame, .. }
            | Self::Rounded { frame, .. }
            | Self::Overstretched { frame, .. }
            | Self::Device { frame, .. }
            | Self::Stopped { frame }
            | Self::Snapshot { frame }
            | Self::Obstacle { frame, .. }
            | Self::EndOfRecording { frame, .. } => frame,
        }
    }
}

/// Checks that `targets` has one target per handle of `stepper`, which is about to step.
///
/// # Errors
/// [`StepError::Handles`] with [`HandleError::Count`].
pub fn check_target_count(
    stepper: &(impl Stepper + ?Sized),
    targets: &HandleTargets,
) -> Result<(), StepError> {
    let (expected, found) = (stepper.handles().len(), targets.handle_count());
    if expected == found {
        return Ok(());
    }
    Err(HandleError::Count { expected, found }.at(stepper.frame() + 1))
}

/// Checks `targets` for a `stepper` that cannot let handles go: one target per handle, and all
/// handles hold.
///
/// # Errors
/// [`StepError::Handles`] names the count or the handle that is let go.
pub fn check_targets_hold(
    stepper: &(impl Stepper + ?Sized),
    targets: &HandleTargets,
) -> Result<(), StepError> {
    check_target_count(stepper, targets)?;
    let hold = targets.require_all_hold();
    hold.map_err(|error| error.at(stepper.frame() + 1))
}
