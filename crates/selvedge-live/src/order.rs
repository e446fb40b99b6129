//! What a session needs from outside: someone who makes cloths and who moves them. The session never
//! asks whether it is the physics or a model; the program that composes them implements these traits.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Environment, HandlePath, Handles, Stepper};
use selvedge_data::Provenance;
use serde::{Deserialize, Serialize};

/// Which cloth is to be shown; each part by its name in the [`Catalogue`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// The scene.
    pub scene: String,
    /// Another mesh than the scene's.
    pub mesh: Option<MeshOrder>,
    /// Another material than the scene's.
    pub material: Option<String>,
    /// The model.
    pub model: String,
}

/// A mesh by the name of its shape and its number of vertices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshOrder {
    /// The shape.
    pub name: String,
    /// About so many vertices.
    pub vertices: usize,
}

/// What there is to choose from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Catalogue {
    /// Scenes.
    pub scenes: Vec<String>,
    /// Shapes of meshes.
    pub meshes: Vec<String>,
    /// Numbers of vertices to suggest.
    pub vertices: Vec<usize>,
    /// Materials.
    pub materials: Vec<String>,
    /// Models.
    pub models: Vec<String>,
    /// Motions.
    pub motions: Vec<String>,
}

/// Who moves the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mover {
    /// The learned model.
    Model,
    /// The simulator.
    Physics,
    /// Each its own cloth, side by side, under the same hands.
    Both,
}

impl Mover {
    /// One by one.
    #[must_use]
    pub fn kinds(self) -> &'static [MoverKind] {
        match self {
            Self::Model => &[MoverKind::Model],
            Self::Physics => &[MoverKind::Physics],
            Self::Both => &[MoverKind::Model, MoverKind::Physics],
        }
    }
}

/// Who moves one cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MoverKind {
    /// The learned model.
    Model,
    /// The simulator.
    Physics,
}

/// What acts on a cloth from outside, and may change while it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// The held vertices.
    pub handles: Handles,
    /// Gravity and air.
    pub environment: Environment,
}

/// Where a cloth starts to move.
#[derive(Clone, Copy, Debug)]
pub enum Start<'a> {
    /// Where the scene says, by default the rest pose.
    Beginning,
    /// From the last frames before now, oldest first `[m]`, `[frames][vertices]`; at least one.
    Frames(&'a [Vec<Vec3>]),
}

/// A [`Stepper`] that can go on under other handles and in another wind.
pub trait LiveStepper: Stepper + Send {
    /// The same cloth in the same motion, under `hold`.
    ///
    /// # Errors
    /// Why it cannot, for people.
    fn changed(&self, hold: &Hold) -> Result<Box<dyn LiveStepper>, String>;
}

/// A cloth that is ready to be moved: its mesh is made, its rest pose found.
pub trait Bench: Send {
    /// What does not change, with the handles of the scene.
    fn cloth(&self) -> &Cloth;

    /// Frames per second.
    fn frame_rate(&self) -> f64;

    /// Gravity and air as the scene has them.
    fn environment(&self) -> Environment;

    /// Where the scene's own motion leads its handles, from the start.
    fn scene_path(&self) -> Result<HandlePath, String>;

    /// How many frames of that motion have passed where the cloth starts.
    fn start_frame(&self) -> usize;

    /// What people should know about it, as what of the scene cannot be had here.
    fn remarks(&self) -> &[String];

    /// Someone who moves it. This must be quick: the session waits.
    ///
    /// # Errors
    /// Why it cannot, for people.
    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        hold: &Hold,
    ) -> Result<Box<dyn LiveStepper>, String>;

    /// Where a recording of it comes from, whose handles were at `handles` `[m]`,
    /// `[frames][handles]`.
    ///
    /// # Errors
    /// Why it cannot be said, for people.
    fn provenance(&self, hold: &Hold, handles: Vec<Vec<DVec3>>) -> Result<Provenance, String>;
}

/// Makes cloths ready, on a thread of its own.
pub trait Workshop: Send {
    /// What can be ordered.
    fn catalogue(&self) -> Catalogue;

    /// Makes a cloth ready; may take seconds, and says how far it has come. Where `progress` breaks, nobody
    /// waits for this cloth any more: to go on is no use.
    ///
    /// # Errors
    /// What of the order cannot be had, for people; also where it was stopped.
    fn prepare(
        &mut self,
        order: &Order,
        progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    ) -> Result<Box<dyn Bench>, String>;
}
