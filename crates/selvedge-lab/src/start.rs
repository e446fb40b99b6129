//! A scene made ready to move: its cloth where the motion begins, under the physics or under a
//! guarded model.
//!
//! The program and the libraries for other languages start steppers here, so that all of them move
//! a scene alike, to the bit.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use glam::DVec3;
use selvedge_cloth::{Cloth, Scene};
use selvedge_data::{LoadedScene, SavedState, StartSpec};
use selvedge_guard::{Correction, Guard};
use selvedge_model::ClothGraph;
use selvedge_sim::{Checkpoint, SagError, SaggedRest, Simulator, SimulatorError};

use crate::event::OnEvent;
use crate::fitting::{self, FittedCloth};
use crate::machine::{Machine, Mover};
use crate::models::NamedModel;
use crate::physics;

/// A cloth where its motion begins.
pub struct Start {
    /// The state.
    pub state: SavedState,
    /// The sagged rest pose, where the motion begins there.
    pub rest: Option<SaggedRest>,
    /// What was done to the cloth, where the motion begins at the mesh, or from there in its pattern.
    pub fitted: Option<FittedCloth>,
}

/// Finds where the cloth of a scene starts, as the scene says. Only a start in the rest pose waits
/// for that. A cloth that nothing holds has none: it can only be let go elsewhere.
pub fn find(loaded: &LoadedScene, on_event: &mut OnEvent<'_>) -> Result<Start> {
    let from = |state, rest, fitted| Start {
        state,
        rest,
        fitted,
    };
    match (&loaded.state, &loaded.spec.start) {
        (Some(state), _) => Ok(from(state.clone(), None, None)),
        (None, StartSpec::Rest) => {
            let rest = rest(&loaded.scene, on_event)?;
            let state = SavedState::at_rest(rest.positions.clone());
            Ok(from(state, Some(rest), None))
        }
        (None, _) => {
            let fitted = fitting::fit(loaded, on_event)?;
            let state = SavedState::at_rest(fitted.positions.clone());
            Ok(from(state, None, Some(fitted)))
        }
    }
}

/// The rest pose in which a run is to start; says how to start without one where none is found.
fn rest(scene: &Scene, on_event: &mut OnEvent<'_>) -> Result<SaggedRest> {
    if scene.handles.is_empty() {
        bail!(
            "scene {:?} has no handles, so that nothing holds the cloth: let it fall (start = \"mesh\" in the scene)",
            scene.name
        );
    }
    let found = physics::rest_pose(scene, on_event);
    match &found {
        Err(error) if !matches!(error.downcast_ref(), Some(SagError::Stopped { .. })) => found.context(
            "the run was to start in its rest pose, and can start where the mesh stands instead (start = \"mesh\" in the scene), or relaxed from there into its pattern (start = \"fit\")",
        ),
        _ => found,
    }
}

/// Lets a scene start in its sagged rest pose, the only start of a model. Returns what the scene
/// asks for and a model does not do; the scene's own list of warnings has it from then on.
pub fn for_model(loaded: &mut LoadedScene) -> Vec<&'static str> {
    let mut warnings = Vec::new();
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
) -> Result<Guard<Mover>> {
    let cloth = Cloth::of_scene(scene, physics::rounded(rest))?;
    let graph = ClothGraph::of_scene(&cloth, scene)
        .with_context(|| format!("the graph of scene {:?}", scene.name))?;
    let stepper = machine
        .start(&model.model, graph, &[cloth.rest_positions()])
        .with_context(|| format!("starting model {}", model.name))?;
    let known = Some(Arc::clone(scene));
    Guard::new(stepper, &cloth, scene.frame_rate, known, settings).context(WITHOUT_GUARD)
}

/// What helps where there is no guard to be had.
pub(crate) const WITHOUT_GUARD: &str = "the guard (the guard \"none\" does without)";

/// The state of `simulator` now, from which a run can go on bit for bit.
pub fn saved_state(simulator: &Simulator) -> SavedState {
    let Checkpoint {
        frame,
        positions,
        velocities,
        previous,
        changes,
        contact,
        obstacles: _,
    } = simulator.checkpoint();
    SavedState {
        positions,
        velocities,
        frame,
        previous,
        contact,
        changes,
    }
}

/// A simulator of `scene` in `state`, with frames counted from there.
pub fn simulator_in(scene: &Scene, state: SavedState) -> Result<Simulator, SimulatorError> {
    simulator_among(scene, state, &[])
}

/// The physics of a run of `scene` from `state` on: as [`simulator_in`], handles and obstacles
/// where the motion has them by then.
pub fn simulator_of_run(scene: &Scene, state: SavedState) -> Result<Simulator, SimulatorError> {
    let frame = state.frame;
    simulator_in(scene, state)?.taken_up_at(frame)
}

/// As [`simulator_in`], the first obstacles at `offsets` `[m]` from their own paths.
pub fn simulator_among(
    scene: &Scene,
    state: SavedState,
    offsets: &[DVec3],
) -> Result<Simulator, SimulatorError> {
    let checkpoint = Checkpoint {
        frame: state.frame,
        positions: state.positions,
        velocities: state.velocities,
        previous: state.previous,
        changes: state.changes,
        contact: state.contact,
        obstacles: offsets.to_vec(),
    };
    Simulator::from_checkpoint(scene, &checkpoint)
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
        let stopped = format!("{:#}", stopped.err().unwrap());
        assert!(stopped.starts_with("the rest pose of scene"), "{stopped}");
        let mut loaded = default_scene();
        loaded.scene.handles = selvedge_cloth::Handles::new(&[], 400).unwrap();
        let mut go_on = |_: crate::Event<'_>| ControlFlow::Continue(());
        let unheld = find(&loaded, &mut go_on).err().unwrap();
        assert!(unheld.to_string().contains("start = \"mesh\""), "{unheld}");
    }
}
