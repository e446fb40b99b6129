//! The laboratory: cloths that are run, timed, guarded, measured and compared.
//!
//! A **machine** ([`machine`]) runs models, on the processor or on a GPU. The two engines are the
//! physics ([`physics`]) and a **model** with its name ([`models`]); a model under a guard keeps
//! the guard's word on every frame ([`watched`]). [`start`] makes a scene ready for either. An
//! **evaluation** ([`evaluation`]) runs **methods** (models, physics, baselines) on **cases**:
//! recorded trajectories, scenes against their own converged physics, random motions. A **report**
//! ([`report`]) makes a page, plots and one table of it. A **study** ([`study`]) is a file with a
//! list of trainings and one evaluation; its folder keeps what is done. [`generation`] makes data
//! sets.
//!
//! Long operations call a listener ([`OnEvent`]) for every [`Event`] and stop when it breaks. Every
//! operation has an error type of its own; [`cause::chain`] tells an error with its causes in one
//! line.
//!
//! ```
//! use std::{ops::ControlFlow, sync::Arc};
//!
//! use selvedge_data::{DatasetPreset, Split};
//! use selvedge_guard::Correction;
//! use selvedge_lab::machine::Machine;
//! use selvedge_lab::models::{self, NamedModel};
//! use selvedge_lab::{Event, physics, start};
//!
//! let preset = DatasetPreset::open("tiny")?;
//! let scene = preset.scene(&preset.motions(Split::Test)[0])?.scene;
//! let mut solves = 0;
//! let rest = physics::rest_pose(&scene, &mut |event| {
//!     solves += u32::from(event == Event::Advanced);
//!     ControlFlow::Continue(())
//! })?;
//! assert!(solves > 0);
//! let (scene, settings) = (Arc::new(scene), Correction::default());
//! let model = NamedModel::open(None)?;
//! let mut stepper = start::guarded(&scene, &rest.positions, &model, &Machine::Cpu, settings)?;
//! let path = scene.handle_path()?;
//! let run = models::drive(&mut stepper, &path, 5, &mut || ControlFlow::Continue(()))?;
//! assert_eq!(run.positions.len(), 6 * rest.positions.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The laboratory prints nothing, draws no progress bar, hears no Ctrl-C and reads no command line:
//! the program `selvedge` does. It does not know the viewer.

pub mod assets;
pub mod cache;
pub mod cause;
pub mod comparison;
pub mod domain;
pub mod evaluation;
pub mod event;
pub mod expert;
pub mod fitting;
pub mod folder;
pub mod folder_kind;
pub mod folder_lock;
pub mod generation;
pub mod machine;
pub mod models;
pub mod numbers;
pub mod physics;
pub mod pictures;
pub mod report;
pub mod rest_pose;
pub mod rigid;
pub mod span;
pub mod start;
pub mod state_log;
pub mod study;
#[cfg(test)]
mod test_scene;
pub mod training;
pub mod watched;
pub mod workers;

pub use event::{End, Event, Goal, OnEvent};
