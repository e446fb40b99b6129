//! A scene made ready to move: its cloth where the motion begins, under the physics or under a
//! guarded model.
//!
//! The program and the libraries for other languages start steppers here, so that all of them move
//! a scene alike, to the bit.

use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::{Cloth, ClothError, ElasticLaw, Scene};
use selvedge_data::{LoadedScene, SavedState, StartSpec};
use selvedge_guard::{Correction, Guard, GuardError};
use selvedge_model::{ClothGraph, GraphError};
use selvedge_sim::{SagError, SaggedRest};
use thiserror::Error;

use crate::event::{OnEvent, Reporter};
use crate::fitting::{self, FittedCloth, FittingError};
use crate::machine::{self, Machine, Mover};
use crate::models::NamedModel;
use crate::physics::{self, RestPoseError};
use crate::watched::WatchError;

/// A cloth where its motion begins.
pub struct Start {
    /// The state.
    pub state: SavedState,
    /// The sagged rest pose, where the motion begins there.
    pub rest: Option<SaggedRest>,
    /// What was done to the cloth, where the motion begins at the mesh, or from there in its pattern.
    pub fitted: Option<FittedCloth>,
}

/// A scene whose start is not found.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum StartError {
    #[error(
        "scene {scene:?} has no handles, so that nothing holds the cloth: let it fall (start = \"mesh\" in the scene)"
    )]
    NothingHolds { scene: String },
    #[error(
        "the run was to start in its rest pose, and can start where the mesh stands instead (start = \"mesh\" in the scene), or relaxed from there into its pattern (start = \"fit\")"
    )]
    Rest(#[source] RestPoseError),
    #[error(transparent)]
    Stopped(RestPoseError),
    #[error(transparent)]
    Fitting(#[from] FittingError),
}

/// A model that cannot be started on the cloth of a scene.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ModelOnSceneError {
    Cloth(#[from] ClothError),
    #[error("the graph of scene {scene:?}: {source}")]
    Graph {
        scene: String,
        source: GraphError,
    },
    #[error("starting model {model}: {source}")]
    Model {
        model: String,
        source: machine::StartError,
    },
    Guard(#[from] WatchError),
}

/// Finds where the cloth of a scene starts, as the scene says. Only a start in the rest pose waits
/// for that. A cloth that nothing holds has none: it can only be let go elsewhere.
pub fn find(loaded: &LoadedScene, on_event: &mut OnEvent<'_>) -> Result<Start, StartError> {
    find_within(loaded, &Reporter::new(on_event))
}

/// As [`find`], within a longer operation.
pub(crate) fn find_within(
    loaded: &LoadedScene,
    reporter: &Reporter<'_>,
) -> Result<Start, StartError> {
    let scene = &loaded.scene;
    let only = |state| Start {
        state,
        rest: None,
        fitted: None,
    };
    match (&loaded.state, &loaded.spec.start) {
        (Some(state), _) => Ok(only(state.clone())),
        (None, StartSpec::Rest) => at_rest(scene, reporter),
        (None, _) => {
            let fitted = fitting::fit(loaded, reporter)?;
            Ok(Start {
                state: SavedState::at_rest(fitted.positions.clone()),
                rest: None,
                fitted: Some(fitted),
            })
        }
    }
}

fn at_rest(scene: &Scene, reporter: &Reporter<'_>) -> Result<Start, StartError> {
    if scene.handles.is_empty() {
        let scene = scene.name.clone();
        return Err(StartError::NothingHolds { scene });
    }
    match physics::find_rest_pose(scene, reporter) {
        Ok(rest) => Ok(Start {
            state: SavedState::at_rest(rest.positions.clone()),
            rest: Some(rest),
            fitted: None,
        }),
        Err(error) if matches!(error.source, SagError::Stopped { .. }) => {
            Err(StartError::Stopped(error))
        }
        Err(error) => Err(StartError::Rest(error)),
    }
}

/// Gives a scene the elastic law from which all models so far have learned, the measured one. They
/// know cloth by its rest pose, and that of another law is another cloth to them.
pub fn take_learned_law(loaded: &mut LoadedScene) {
    loaded.scene.physics.law = ElasticLaw::Measured;
    loaded.spec.setting.physics.law = ElasticLaw::Measured;
}

/// Lets a scene start in its sagged rest pose, the only start of a model, by the law that models
/// learned ([`take_learned_law`]). Returns what the scene
/// asks for and a model does not do; the scene's own list of warnings has it from then on.
pub fn for_model(loaded: &mut LoadedScene) -> Vec<&'static str> {
    let mut warnings = Vec::new();
    take_learned_law(loaded);
    if loaded.spec.start != StartSpec::Rest {
        warnings.push(
            "start: a rollout and its truth start in the sagged rest pose, and not as the scene says: take `selvedge run` for that",
        );
        loaded.spec.start = StartSpec::Rest;
        loaded.state = None;
    }
    if loaded.scene.contact.is_some() {
        warnings.push(
            "contact: a learned model does not see obstacles, nor where the cloth touches itself: the guard pushes its frames apart (without a guard its cloth passes through both)",
        );
    }
    let said = warnings.iter().map(ToString::to_string);
    loaded.warnings.extend(said);
    warnings
}

/// A model at work on the cloth of `scene`, which rests at `rest` `[m]`, `[vertices]`, under a
/// guard.
pub fn guarded(
    scene: &Arc<Scene>,
    rest: &[DVec3],
    model: &NamedModel,
    machine: &Machine,
    settings: Correction,
) -> Result<Guard<Mover>, ModelOnSceneError> {
    let cloth = Cloth::of_scene(scene, physics::rounded(rest))?;
    let graph = ClothGraph::new(&cloth, scene.environment, scene.frame_rate);
    let graph = graph.map_err(|source| {
        let scene = scene.name.clone();
        ModelOnSceneError::Graph { scene, source }
    })?;
    let stepper = machine.start(&model.model, graph, &[cloth.rest_positions()]);
    let stepper = stepper.map_err(|source| {
        let model = model.name.clone();
        ModelOnSceneError::Model { model, source }
    })?;
    let known = Some(Arc::clone(scene));
    let guard = Guard::new(stepper, &cloth, scene.frame_rate, known, settings);
    Ok(guard.map_err(|source: GuardError| WatchError::from(source))?)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use selvedge_cloth::ContactSettings;
    use selvedge_data::open_scene;

    use super::*;

    fn default_scene() -> LoadedScene {
        open_scene("default").unwrap()
    }

    #[test]
    fn a_scene_starts_as_it_says() {
        let mut go_on = |_: crate::Event<'_>| ControlFlow::Continue(());
        let mut loaded = default_scene();
        let start = find(&loaded, &mut go_on).unwrap();
        assert_eq!(
            start.state.positions,
            start.rest.as_ref().unwrap().positions
        );
        loaded.spec.start = StartSpec::Mesh;
        let start = find(&loaded, &mut go_on).unwrap();
        assert_eq!(start.state.positions, loaded.scene.mesh.positions());
        assert!(start.rest.is_none());
        assert_eq!(for_model(&mut loaded).len(), 1);
        assert_eq!(loaded.spec.start, StartSpec::Rest);
        assert_eq!(for_model(&mut loaded), Vec::<&str>::new());
    }

    #[test]
    fn a_model_is_said_not_to_see_obstacles() {
        let mut loaded = default_scene();
        assert_eq!(for_model(&mut loaded), Vec::<&str>::new());
        loaded.scene.contact = Some(ContactSettings::default());
        let warnings = for_model(&mut loaded);
        assert_eq!(warnings.len(), 1);
        let expected = "contact: a learned model does not see obstacles";
        assert!(warnings[0].starts_with(expected), "{warnings:?}");
        assert_eq!(loaded.warnings.last().unwrap(), warnings[0]);
    }

    #[test]
    fn a_search_that_is_stopped_says_so_and_not_how_to_do_without() {
        let stopped = find(&default_scene(), &mut |_| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(StartError::Stopped(_))));
        let mut loaded = default_scene();
        loaded.scene.handles = selvedge_cloth::Handles::new(&[], 400).unwrap();
        let mut go_on = |_: crate::Event<'_>| ControlFlow::Continue(());
        let unheld = find(&loaded, &mut go_on).err().unwrap();
        assert!(unheld.to_string().contains("start = \"mesh\""), "{unheld}");
    }
}
