//! Cloth that moves: open a scene, step it by the solver or by a network, read the positions.
//!
//! ```
//! # #[cfg(feature = "files")]
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = selvedge::Scene::named("default")?;
//! let mut run = selvedge::Run::new(&scene)?;
//! for _ in 0..10 {
//!     run.step()?;
//!     let positions = run.positions(); // [m], one per vertex
//!     assert!(positions.iter().all(|p| p.is_finite()));
//! }
//! let there = run.snapshot().expect("the solver can go back");
//! run.step()?;
//! run.restore(&there)?;
//! assert_eq!(run.frame(), 10);
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "files"))]
//! # fn main() {}
//! ```
//!
//! The program, the libraries for C, Python and WebAssembly and the viewer move cloth by this one: a
//! scene has the same bytes in all of them, on any number of threads.
//!
//! | type | what |
//! |---|---|
//! | [`Scene`] | from a file, a shipped name or parts in code: what is run, and where its motion begins |
//! | [`Run`] | a scene and who moves it: step by step, with positions, velocities, warnings and snapshots |
//! | [`step_all`] | many runs, moved side by side |
//! | [`Snapshot`] | a state of a run, to go back to |
//! | `Model` | a network with its name (feature `learned`) |
//! | `Trajectory` | recorded frames, to write and to read (feature `files`) |
//! | [`Gradient`] | derivatives of a value of a run ([`Run::backward`]) |
//! | [`parts`] | meshes, materials, obstacles and motions, of which a scene is made in code |
//! | [`HandleTargets`] | where the handles are led in the next frame |
//! | [`Error`], [`StepError`] | why there is no run, and why there is no next frame |
//! | [`Event`], [`End`] | progress of long work, and its end |
//!
//! Lengths are in metres, times in seconds, masses in kilograms; the vertical is y. A frame is a
//! step of 1/`frame_rate`, by default 1/60 s.
//!
//! # Progress and an end
//!
//! [`Run::begin`] tells a listener how far the search for the rest pose is, and stops where the
//! listener breaks. [`Stepper::stop_by`] gives a run a flag that ends its steps within a frame.
//!
//! # Features
//!
//! `files` (on by default): scenes by name and from files, trajectories. `learned`: networks and
//! their guard. `gpu`: networks on a GPU. Without any (`default-features = false`) there is the
//! solver alone, and scenes are made in code: `examples/flag.rs`.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod cause;
#[cfg(feature = "learned")]
pub mod domain;
mod error;
pub mod event;
#[cfg(feature = "files")]
mod fitting;
#[cfg(feature = "learned")]
pub mod machine;
#[cfg(feature = "learned")]
mod models;
pub mod numbers;
#[cfg(feature = "files")]
pub mod rest_pose;
mod run;
mod scene;
pub mod start;
mod strain;
mod through;
#[cfg(feature = "files")]
mod trajectory;
mod worlds;

use glam::{DVec3, Vec3};

pub use error::Error;
pub use event::{End, Event, Goal, Listener};
/// The vectors of positions; of the same version as those of [`glam`].
pub use glam;
#[cfg(feature = "learned")]
pub use models::Model;
#[cfg(feature = "learned")]
pub use run::Network;
pub use run::Run;
pub use scene::Scene;
pub use selvedge_cloth::{HandleTargets, Impulse, Rigid, Snapshot, StepError, Stepper, Stop};
#[cfg(feature = "files")]
pub use selvedge_data::{Recording, RecordingEnd, Trajectory};
#[cfg(feature = "learned")]
pub use selvedge_guard::{Correction, Trust};
pub use selvedge_sim::{
    Gradient, GradientError, GradientSettings, MaterialGradient, ObstacleSlope, StateGradient,
};
pub use through::{LetThrough, let_through};
#[cfg(feature = "files")]
pub use trajectory::{provenance, trajectory};
pub use worlds::step_all;

/// The parts of a scene that is made in code.
pub mod parts {
    pub use selvedge_cloth::generate;
    pub use selvedge_cloth::{
        Compression, ContactSettings, Environment, Handles, Isotropic, Material, Mesh, Motion,
        Obstacle, PhysicsSettings, Scene, bodies,
    };
}

/// The program, as the files that it writes name it.
#[cfg(feature = "files")]
pub(crate) const MADE_BY: &str = concat!("selvedge ", env!("CARGO_PKG_VERSION"));

/// Positions in f32, as files have them.
pub fn rounded(positions: &[DVec3]) -> Vec<Vec3> {
    positions.iter().map(|p| p.as_vec3()).collect()
}
