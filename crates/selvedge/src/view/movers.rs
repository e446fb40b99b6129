//! The physics and the learned model as the viewer drives them: they go on in the same motion when what
//! holds the cloth, or the wind, changes.

use std::collections::VecDeque;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandleTargets, Handles, Scene, StepError, Stepper, Topology};
use selvedge_data::Cloth;
use selvedge_live::{Hold, LiveStepper};
use selvedge_model::{LearnedStepper, Model};
use selvedge_sim::Simulator;

use crate::learned;

/// The simulator, with the scene that it was made from.
pub(super) struct LivePhysics {
    scene: Arc<Scene>,
    simulator: Simulator,
}

impl LivePhysics {
    /// Starts at `positions` `[m]` with `velocities` `[m/s]`, `[vertices]`, frames counted from `frame`.
    pub(super) fn start(
        scene: &Arc<Scene>,
        hold: &Hold,
        state: (Vec<DVec3>, Vec<DVec3>),
        frame: usize,
    ) -> Result<Self, String> {
        let held = Scene {
            handles: hold.handles.clone(),
            environment: hold.environment,
            ..(**scene).clone()
        };
        let simulator = Simulator::with_state(&held, state.0, state.1);
        Ok(Self {
            scene: Arc::clone(scene),
            simulator: simulator
                .map_err(|error| error.to_string())?
                .at_frame(frame),
        })
    }
}

impl Stepper for LivePhysics {
    fn topology(&self) -> &Topology {
        self.simulator.topology()
    }

    fn handles(&self) -> &Handles {
        self.simulator.handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.simulator.positions()
    }

    fn frame(&self) -> usize {
        self.simulator.frame()
    }

    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        self.simulator.step(handles)
    }
}

impl LiveStepper for LivePhysics {
    fn changed(&self, hold: &Hold) -> Result<Box<dyn LiveStepper>, String> {
        let simulator = &self.simulator;
        let state = (
            simulator.positions_f64().to_vec(),
            simulator.velocities_f64().to_vec(),
        );
        let changed = Self::start(&self.scene, hold, state, simulator.frame())?;
        Ok(Box::new(changed))
    }
}

/// A model, with the last frames, from which it goes on when its graph changes.
pub(super) struct LiveModel {
    model: Arc<Model>,
    scene: Arc<Scene>,
    cloth: Arc<Cloth>,
    stepper: LearnedStepper,
    /// As many as the model looks at, oldest first.
    recent: VecDeque<Vec<Vec3>>,
}

impl LiveModel {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. The rest pose
    /// that the model compares with stays that of the scene's own handles in the scene's own wind.
    pub(super) fn start(
        model: &Arc<Model>,
        scene: &Arc<Scene>,
        cloth: &Arc<Cloth>,
        hold: &Hold,
        frames: &[&[Vec3]],
    ) -> Result<Self, String> {
        let held = Cloth {
            handles: hold.handles.clone(),
            ..(**cloth).clone()
        };
        let aired = Scene {
            environment: hold.environment,
            ..(**scene).clone()
        };
        let text = |error: anyhow::Error| crate::failure::chain(&error);
        let graph = learned::graph_of_scene(&aired, &held).map_err(text)?;
        let stepper = LearnedStepper::new(Arc::clone(model), graph, frames);
        let needed = model.spec().history();
        let first = frames.len().saturating_sub(needed);
        Ok(Self {
            model: Arc::clone(model),
            scene: Arc::clone(scene),
            cloth: Arc::clone(cloth),
            stepper: stepper.map_err(|error| error.to_string())?,
            recent: frames[first..].iter().map(|frame| frame.to_vec()).collect(),
        })
    }
}

impl Stepper for LiveModel {
    fn topology(&self) -> &Topology {
        self.stepper.topology()
    }

    fn handles(&self) -> &Handles {
        self.stepper.handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.stepper.positions()
    }

    fn frame(&self) -> usize {
        self.stepper.frame()
    }

    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        self.stepper.step(handles)?;
        if self.recent.len() >= self.model.spec().history() {
            self.recent.pop_front();
        }
        self.recent.push_back(self.stepper.positions().to_vec());
        Ok(())
    }
}

impl LiveStepper for LiveModel {
    fn changed(&self, hold: &Hold) -> Result<Box<dyn LiveStepper>, String> {
        let frames: Vec<&[Vec3]> = self.recent.iter().map(Vec::as_slice).collect();
        let (model, scene, cloth) = (&self.model, &self.scene, &self.cloth);
        Ok(Box::new(Self::start(model, scene, cloth, hold, &frames)?))
    }
}
