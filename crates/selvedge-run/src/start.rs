//! A scene made ready to move: where its motion begins, and the solver or a guarded network there.

use std::sync::Arc;

use selvedge_cloth::Scene as Built;
use selvedge_sim::{Checkpoint, SagError, SaggedRest, Simulator, SimulatorError};

use crate::Error;
use crate::event::{Event, Goal, Listener};
#[cfg(feature = "learned")]
pub use learned::{WITHOUT_GUARD, guarded};

/// A cloth where its motion begins.
#[derive(Clone, Debug)]
pub struct Start {
    /// The state.
    pub state: Checkpoint,
    /// The sagged rest pose, where the motion begins there.
    pub rest: Option<Arc<SaggedRest>>,
    /// What was done to the cloth, where it was made ready from its mesh.
    pub remarks: Vec<String>,
    /// A warning of the strain that is left.
    pub warnings: Vec<String>,
}

impl Start {
    pub(crate) fn at(state: Checkpoint) -> Self {
        Self {
            state,
            rest: None,
            remarks: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// Finds the sagged rest pose of a scene: by a search, or where it is known from before.
///
/// # Errors
/// [`Error::Rest`] names the scene and what is in the way.
pub fn rest_pose(scene: &Built, on_event: &mut Listener<'_>) -> Result<SaggedRest, Error> {
    // Whoever wants to stop says so again at the first solve.
    let _ = on_event(Event::Begun {
        task: "sagging to rest",
        goal: Goal::Open,
        unit: "solves",
    });
    let mut hear = |now: selvedge_sim::SagProgress| {
        let (left, wanted) = (now.residual, now.tolerance);
        let note = format!("{left:.1e} m/s² left, to be {wanted:.0e}");
        let _ = on_event(Event::Noted(&note));
        on_event(Event::Advanced)
    };
    #[cfg(feature = "files")]
    let found = crate::rest_pose::found(scene, &mut hear);
    #[cfg(not(feature = "files"))]
    let found = selvedge_sim::sag_with_progress(scene, &mut hear).map(|rest| (rest, None::<f64>));
    let _ = on_event(Event::Ended);
    let found = found.map_err(|source| Error::Rest {
        scene: scene.name.clone(),
        source,
    })?;
    #[cfg(feature = "files")]
    if let Some(remark) = crate::rest_pose::remark(&found) {
        let _ = on_event(Event::Remarked(&remark));
    }
    let (rest, _) = found;
    tracing::info!(
        solves = rest.solves,
        residual = rest.residual,
        "found the rest pose"
    );
    Ok(rest)
}

/// What to say of a rest pose in which a run was to start and which cannot be had.
pub(crate) fn without_rest(error: Error) -> Error {
    match error {
        Error::Rest { ref source, .. } if !matches!(source, SagError::Stopped { .. }) => {
            Error::NoRest(Box::new(error))
        }
        other => other,
    }
}

/// The solver in the run of `scene` from `state` on: handles and obstacles where the motion has
/// them by then.
///
/// # Errors
/// A scene or a state that cannot be used.
pub fn simulator_of_run(scene: &Built, state: &Checkpoint) -> Result<Simulator, SimulatorError> {
    Simulator::from_checkpoint(scene, state)?.taken_up_at(state.frame)
}

/// Length of an edge times substeps, in ways of a free fall from rest in a frame, below which contact
/// throws what lies down: a sheet of 400 vertices on a ball was thrown off with edges of 2.9 mm and two
/// substeps, of 1.7 mm and three, and stayed with 4.0 mm and two, 2.9 mm and three, 1.7 mm and eight.
const FINE: f64 = 2.75;

/// A warning of edges that are short for the substeps, where there is contact.
pub(crate) fn thrown(scene: &Built) -> Option<String> {
    scene.contact.as_ref()?;
    let lengths = scene.mesh.pattern().edge_lengths();
    let edge = lengths.iter().sum::<f64>() / lengths.len() as f64;
    let fall = scene.environment.gravity.length() / (scene.frame_rate * scene.frame_rate);
    let substeps = FINE * fall / edge;
    (f64::from(scene.physics.substeps) < substeps).then(|| {
        format!(
            "contact: edges of {:.1} mm are short beside a fall of {:.1} mm in a frame: contact may throw the cloth off what it lies on; set physics.substeps to {:.0} or more",
            1e3 * edge,
            1e3 * fall,
            substeps.ceil()
        )
    })
}

/// Networks.
#[cfg(feature = "learned")]
mod learned {
    use std::sync::Arc;

    use glam::DVec3;
    use selvedge_cloth::{Cloth, Scene};
    use selvedge_guard::{Correction, Guard};
    use selvedge_model::ClothGraph;

    use crate::machine::{Machine, Mover};
    use crate::models::Model;
    use crate::{Error, rounded};

    /// What helps where there is no guard to be had.
    pub const WITHOUT_GUARD: &str = "the guard (the guard \"none\" does without)";

    /// A network at work on the cloth of `scene`, which rests at `rest` `[m]`, `[vertices]`, under
    /// a guard.
    ///
    /// # Errors
    /// A scene that the network or the guard cannot move.
    pub fn guarded(
        scene: &Arc<Scene>,
        rest: &[DVec3],
        model: &Model,
        machine: &Machine,
        settings: Correction,
    ) -> Result<Guard<Mover>, Error> {
        let graph_of = format!("the graph of scene {:?}", scene.name);
        let cloth = Cloth::of_scene(scene, rounded(rest));
        let cloth = cloth.map_err(|error| Error::network(&*graph_of, error))?;
        let graph = ClothGraph::of_scene(&cloth, scene);
        let graph = graph.map_err(|error| Error::network(&*graph_of, error))?;
        let stepper = machine.start(&model.model, graph, &[cloth.rest_positions()]);
        let stepper = stepper.map_err(|error| match error {
            Error::Network { source, .. } => {
                Error::network(format!("starting model {}", model.name), source)
            }
            other => other,
        })?;
        let known = Some(Arc::clone(scene));
        let guard = Guard::new(stepper, &cloth, scene.frame_rate, known, settings);
        guard.map_err(|error| Error::network(WITHOUT_GUARD, error))
    }
}
