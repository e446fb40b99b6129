//! The laboratory: cloths that are run, timed, guarded, measured and compared.
//!
//! A **machine** ([`machine`]) runs models, on the processor or on a GPU. The two engines are the
//! physics ([`physics`]) and a **model** with its name ([`models`]); [`watched`] sums up the word of
//! its guard. [`start`] makes a scene ready for either. An
//! **evaluation** ([`evaluation`]) runs **methods** (models, physics, baselines) on **cases**:
//! recorded trajectories, scenes against their own converged physics, random motions. A **report**
//! ([`report`]) makes a page, plots and one table of it. A **study** ([`study`]) is a file with a
//! list of trainings and one evaluation; its folder keeps what is done. [`generation`] makes data
//! sets.
//!
//! Long operations call a listener ([`OnEvent`]) for every [`Event`] and stop when it breaks. Errors
//! are those of `anyhow`: a message and its causes, which [`cause::chain`] tells in one line.
//!
//! ```
//! use std::{ops::ControlFlow, sync::Arc};
//!
//! use selvedge_data::{DatasetPreset, Split};
//! use selvedge_guard::Correction;
//! use selvedge_lab::machine::Machine;
//! use selvedge_lab::models::NamedModel;
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
//! let run = physics::drive(&mut stepper, &path, 5, &mut |_| ControlFlow::Continue(()))?;
//! assert_eq!(run.positions.len(), 6 * rest.positions.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The laboratory prints nothing, draws no progress bar, hears no Ctrl-C and reads no command line:
//! the program `selvedge` does. It does not know the viewer.

pub mod assets;
pub mod cause;
pub mod domain;
pub mod evaluation;
pub mod event;
pub mod expert;
pub mod fitting;
pub mod folder;
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
pub mod study;
#[cfg(test)]
mod test_scene;
pub mod training;
pub mod watched;
mod workers;

pub use event::{End, Event, Goal, OnEvent};
