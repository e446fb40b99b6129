//! The workshop: makes the cloths of a session ready, and starts their movers. The program behind
//! this crate implements it.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::{Cloth, Environment, HandlePath};
use selvedge_data::Provenance;

use crate::body::Body;
use crate::mover::{Influences, LiveError, LiveStepper, Mover, MoverKind, Start};
use crate::order::{Catalogue, Order};

/// A cloth that is ready to be moved: its mesh is made, its rest pose found.
pub struct ReadyCloth {
    /// The constant part of the cloth, with the handles of the scene.
    pub cloth: Arc<Cloth>,
    /// Frames per second.
    pub frame_rate: f64,
    /// Gravity and air of the scene.
    pub environment: Environment,
    /// The way of the handles along the scene's own motion, from its start.
    pub scene_path: HandlePath,
    /// Frames of that motion that have passed at the start of the cloth.
    pub start_frame: usize,
    /// Remarks for people, such as parts of the scene that are not available here.
    pub remarks: Vec<String>,
    /// The bodies beside the cloth.
    pub bodies: Vec<Body>,
    /// What moves the cloth.
    pub movers: Box<dyn Movers>,
}

/// The movers of a cloth that is ready.
pub trait Movers: Send {
    /// Starts a mover. This must be quick: the session waits.
    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        influences: &Influences,
    ) -> Result<Box<dyn LiveStepper>, LiveError>;

    /// A remark for people on what moves the cloth now, such as a model in a wind that it has not
    /// learned; none where there is nothing to say. The held vertices are at `places` `[m]`. What
    /// is said anew is shown anew: a remark has no numbers that change with every frame.
    fn remark_on(&self, _mover: Mover, _hold: &Influences, _places: &[DVec3]) -> Option<String> {
        None
    }

    /// The provenance of a recording of this cloth with its handles at `handles` `[m]`,
    /// `[frames][handles]`.
    fn provenance(
        &self,
        influences: &Influences,
        handles: Vec<Vec<DVec3>>,
    ) -> Result<Provenance, LiveError>;
}

/// Makes cloths ready, on a thread of its own.
pub trait Workshop: Send {
    /// The names that an order may use.
    fn catalogue(&self) -> Catalogue;

    /// Makes a cloth ready. This may take seconds, and `progress` is told how far it is. Where
    /// `progress` breaks, nobody waits for this cloth any more, and the work stops.
    fn prepare(
        &mut self,
        order: &Order,
        progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    ) -> Result<Box<ReadyCloth>, LiveError>;
}
