//! Movers: the steppers of a session, as the program behind this crate supplies them. A session
//! never asks whether a mover is the physics or a model.

use std::error::Error;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Environment, Handles, Stepper};
use serde::{Deserialize, Serialize};

/// The movers that a page asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mover {
    /// The learned model.
    Model,
    /// The solver.
    Physics,
    /// Each its own cloth, side by side, with the same handles.
    Both,
}

impl Mover {
    /// The single movers, one per cloth.
    pub fn kinds(self) -> &'static [MoverKind] {
        match self {
            Self::Model => &[MoverKind::Model],
            Self::Physics => &[MoverKind::Physics],
            Self::Both => &[MoverKind::Model, MoverKind::Physics],
        }
    }
}

/// The mover of one cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MoverKind {
    /// The learned model.
    Model,
    /// The solver.
    Physics,
}

/// The influences on a cloth from outside, which may change while it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Influences {
    /// The held vertices.
    pub handles: Handles,
    /// Gravity and air.
    pub environment: Environment,
}

/// The frames from which a mover starts.
#[derive(Clone, Copy, Debug)]
pub enum Start<'a> {
    /// The start of the scene, by default the rest pose.
    Beginning,
    /// The last frames before now, oldest first `[m]`, `[frames][vertices]`; at least one.
    Frames(&'a [Vec<Vec3>]),
}

/// A [`Stepper`] that can continue under other handles and in another wind.
pub trait LiveStepper: Stepper + Send {
    /// Returns the same cloth in the same motion, under `influences`.
    fn changed(&self, influences: &Influences) -> Result<Box<dyn LiveStepper>, LiveError>;

    /// Targets that a frame of a motion has for this mover: one for each of its substeps.
    fn samples(&self) -> usize {
        1
    }

    /// Whether a person leads the handles from now on. A hand is stopped before cloth without room is
    /// let through a body; a motion goes as the scene says.
    fn led_by_hand(&mut self, _by_hand: bool) {}

    /// Leads body `number` over the next step, straight, to `offset` `[m]` from its own path. A
    /// mover that does not see bodies has nothing to do.
    fn lead_body(&mut self, _number: usize, _offset: DVec3) {}

    /// Puts body `number` at `offset` `[m]` from its own path at once.
    fn put_body(&mut self, _number: usize, _offset: DVec3) -> Result<(), LiveError> {
        Err(LiveError::new("this mover does not see bodies"))
    }

    /// Points of all bodies now `[m]`, those of the first body first.
    fn body_points(&self) -> Vec<Vec3> {
        Vec::new()
    }

    /// Distances of the bodies from their own paths `[m]`, `[bodies]`, where the last step had no
    /// room for what was led, so that all of it stayed where it was; none where it had.
    fn blocked(&self) -> Option<Vec<DVec3>> {
        None
    }

    /// Momentum that each body received from the cloth in the last step `[N s]`, `[bodies]`; empty
    /// where there are none.
    fn impulses(&self) -> Vec<DVec3> {
        Vec::new()
    }

    /// What moved the cloth in the last step in the place of a model whose frame was lost; none where
    /// the mover did.
    fn stand_in(&self) -> Option<&'static str> {
        None
    }

    /// Smallest gap of each vertex to what it may touch `[m]`, `[vertices]`; none where nothing
    /// touches.
    fn gaps(&self) -> Option<Vec<f32>> {
        None
    }
}

/// The reason why a cloth cannot be made ready, moved or recorded, in words for people.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct LiveError(Reason);

/// The reason why a request is not met or a recording is lost, as pages are told it; everything
/// goes on as before.
pub(crate) type Reason = Box<dyn Error + Send + Sync>;

impl LiveError {
    /// An error with the message of `cause`.
    pub fn new(cause: impl Into<Reason>) -> Self {
        Self(cause.into())
    }
}
