//! Selvedge inside Python: the module `selvedge._native`, which the package `selvedge` wraps.
//!
//! It composes the same library calls as the program, so that the same work gives the same bytes.
//! Long work releases the interpreter's lock and hears Ctrl-C ([`long`]); arrays are shared where
//! nothing changes them ([`arrays`]); errors keep their words ([`errors`]).
#![allow(
    clippy::too_many_arguments,
    reason = "each has a name and a default in Python"
)]

mod arrays;
mod dataset;
mod errors;
mod evaluation;
mod exporting;
mod guarding;
mod json;
mod log;
mod long;
mod model;
mod pickling;
mod picture;
mod rollout;
mod scene;
mod simulator;
mod stepper;
mod training;
mod trajectory;
mod worlds;

use pyo3::prelude::*;

/// The native part of the package `selvedge`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    log::begin();
    selvedge::rest_pose::keep_in_cache();
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SelvedgeError", py.get_type::<errors::SelvedgeError>())?;
    module.add("FrameError", py.get_type::<errors::FrameError>())?;
    module.add_class::<scene::Mesh>()?;
    module.add_class::<scene::Material>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<stepper::Snapshot>()?;
    module.add_class::<stepper::Stepper>()?;
    module.add_class::<simulator::Simulator>()?;
    module.add_class::<stepper::LearnedStepper>()?;
    module.add_class::<stepper::PlaybackStepper>()?;
    module.add_class::<stepper::RigidStepper>()?;
    module.add_class::<worlds::Worlds>()?;
    module.add_class::<trajectory::Trajectory>()?;
    module.add_class::<picture::Picture>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<rollout::Rollout>()?;
    module.add_class::<dataset::Dataset>()?;
    module.add_class::<dataset::Split>()?;
    module.add_class::<evaluation::Evaluation>()?;
    module.add_function(wrap_pyfunction!(rollout::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(rollout::rollout, module)?)?;
    module.add_function(wrap_pyfunction!(training::train, module)?)?;
    module.add_function(wrap_pyfunction!(training::training_presets, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(model::layout, module)?)?;
    module.add_function(wrap_pyfunction!(model::columns, module)?)?;
    pickling::add(module)?;
    Ok(())
}
