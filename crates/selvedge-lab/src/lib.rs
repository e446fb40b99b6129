//! The laboratory: cloths that are run, timed, guarded, measured and compared.
//!
//! Runs themselves are those of the library `selvedge` ([`selvedge::Run`]): the solver, or a network
//! on a **machine** ([`machine`]), the processor or a GPU. [`physics`] times them; [`watched`] sums up
//! the word of a guard. An **evaluation** ([`evaluation`]) runs **methods** (models, physics,
//! baselines) on **cases**: recorded trajectories, scenes against their own converged physics, random
//! motions. A **report** ([`report`]) makes a page and one table of it. [`generation`] makes
//! data sets.
//!
//! Long operations call a listener ([`OnEvent`]) for every [`Event`] and stop when it breaks. Errors
//! are those of `anyhow`: a message and its causes, which [`selvedge::cause::chain`] tells in one line.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use selvedge_data::{DatasetPreset, Split};
//! use selvedge_lab::physics;
//!
//! let preset = DatasetPreset::open("tiny")?;
//! let scene = preset.scene(&preset.motions(Split::Test)[0])?;
//! let mut run = selvedge::Run::of_model(&scene.into(), &selvedge::Model::open(None)?)?;
//! let made = physics::simulate(&mut run, 5, false, &mut |_| ControlFlow::Continue(()));
//! let (timed, _) = made.whole()?;
//! assert_eq!(timed.positions.len(), 6 * run.positions().len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The laboratory prints nothing, draws no progress bar, hears no Ctrl-C and reads no command line:
//! the program `selvedge` does. It does not know the viewer.

pub mod assets;
#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
pub mod domain;
pub mod drape;
pub mod evaluation;
pub mod event;
pub mod expert;
pub mod fit;
pub mod folder;
pub mod generation;
pub mod machine;
pub mod physics;
pub mod pictures;
pub mod report;
pub mod rigid;
pub mod span;
#[cfg(test)]
mod test_scene;
pub mod training;
pub mod watched;
mod workers;

pub use event::{End, Event, Goal, OnEvent};
pub(crate) use selvedge::{cause, numbers};
