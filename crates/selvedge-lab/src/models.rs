//! The learned simulator as commands use it: a model from its file, the graph of a scene or of a
//! trajectory, and a run that is driven by a path of handles.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use glam::Vec3;
use selvedge_cloth::{Cloth, HandlePath, Scene, Stepper};
use selvedge_data::{Drive, record};
use selvedge_model::{ClothGraph, Model};

use crate::assets;
use crate::machine::{Machine, Mover};
use crate::physics::{self, Run};

/// A model and what people call it.
pub struct NamedModel {
    /// Its file, or the name of the shipped one.
    pub name: String,
    /// Ready to run.
    pub model: Arc<Model>,
}

/// Opens the model in `file`, or the shipped one.
///
/// # Errors
/// When the file cannot be read or is no model of this version.
pub fn open(file: Option<&Path>) -> anyhow::Result<NamedModel> {
    let (name, model) = match file {
        Some(path) => {
            let name = path.display().to_string();
            let bytes =
                std::fs::read(path).with_context(|| format!("{name}: could not be read"))?;
            (name, Model::from_bytes(&bytes))
        }
        None => (
            assets::MODEL.0.to_owned(),
            Model::from_bytes(assets::MODEL.1),
        ),
    };
    let model = model.with_context(|| name.clone())?;
    Ok(NamedModel {
        name,
        model: Arc::new(model),
    })
}

/// The graph of the cloth of `scene` with its `cloth`, which knows its rest pose.
///
/// # Errors
/// When the parts do not fit.
pub fn graph_of_scene(scene: &Scene, cloth: &Cloth) -> anyhow::Result<ClothGraph> {
    ClothGraph::new(cloth, scene.environment, scene.frame_rate)
        .with_context(|| format!("the graph of scene {:?}", scene.name))
}

/// `model` at `start` `[m]`, `[vertices]`, at rest, on a machine.
///
/// # Errors
/// A start that does not fit the cloth, or a machine that cannot run it.
pub fn stepper(
    model: &NamedModel,
    graph: ClothGraph,
    start: &[Vec3],
    machine: &Machine,
) -> anyhow::Result<Mover> {
    machine
        .start(&model.model, graph, &[start])
        .with_context(|| format!("starting model {}", model.name))
}

/// Steps `stepper` for `frames` along `path`, with one target per frame.
///
/// # Errors
/// A step that fails.
pub fn drive(
    stepper: &mut dyn Stepper,
    path: &HandlePath,
    frames: usize,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> anyhow::Result<Run> {
    let vertices = stepper.positions().len();
    let drive = Drive {
        path,
        samples_per_frame: 1,
    };
    let started = Instant::now();
    let recording = record(stepper, drive, frames, &mut |_| on_frame());
    physics::timed(recording, vertices, started)
}
