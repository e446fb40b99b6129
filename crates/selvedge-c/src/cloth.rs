//! A scene that was opened, and a cloth that moves: what handles stand for, without C.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use glam::DVec3;
use selvedge_cloth::{HandlePath, HandleTargets, PhysicsSettings, Scene, Stepper};
use selvedge_data::{LoadedScene, SavedState, StartSpec};
use selvedge_guard::{Correction, Guard, Trust};
use selvedge_lab::machine::{Machine, Mover};
use selvedge_lab::models::NamedModel;
use selvedge_lab::start::simulator_of_run;
use selvedge_lab::{domain, start};
use selvedge_sim::{Simulator, Threads};

use crate::fault::Fault;
use crate::listener::Ear;
use crate::registry::{Kind, Registry};
use crate::status::SelvedgeStatus;

/// Scenes by their handles.
pub(crate) static SCENES: Registry<Mutex<OpenScene>> = Registry::new(Kind::Scene);
/// Models by their handles.
pub(crate) static MODELS: Registry<NamedModel> = Registry::new(Kind::Model);
/// Steppers by their handles.
pub(crate) static STEPPERS: Registry<KeptCloth> = Registry::new(Kind::Stepper);

/// A scene, and its newest rest pose with the physics that it is of: a model has another law.
pub(crate) struct OpenScene {
    loaded: LoadedScene,
    rest: Option<(PhysicsSettings, Vec<DVec3>)>,
}

/// A cloth that moves, and beside its lock the wish that its steps stop.
pub(crate) struct KeptCloth {
    pub(crate) cloth: Mutex<MovingCloth>,
    pub(crate) stop: Arc<AtomicBool>,
}

pub(crate) struct MovingCloth {
    pub(crate) scene: Arc<Scene>,
    pub(crate) path: HandlePath,
    engine: Engine,
    /// A line each.
    pub(crate) warnings: Vec<String>,
}

#[allow(clippy::large_enum_variant, reason = "each is behind a pointer anyway")]
enum Engine {
    Physics(Simulator),
    Model(Guard<Mover>),
    #[cfg(test)]
    Other(Box<dyn Stepper + Send>),
}

impl OpenScene {
    pub(crate) fn new(loaded: LoadedScene) -> Self {
        Self { loaded, rest: None }
    }

    pub(crate) fn warnings(&self) -> &[String] {
        &self.loaded.warnings
    }

    /// The sagged rest pose `[m]`, `[vertices]`; searched for once as long as the physics is the same.
    fn rest(&mut self, at_rest: &LoadedScene, ear: &mut Ear) -> Result<Vec<DVec3>, Fault> {
        let physics = at_rest.scene.physics;
        if let Some((known, rest)) = &self.rest
            && *known == physics
        {
            return Ok(rest.clone());
        }
        let found = find(at_rest, ear)?.state.positions;
        self.rest = Some((physics, found.clone()));
        Ok(found)
    }

    /// The physics of the scene, where the scene starts.
    pub(crate) fn physics(&mut self, ear: &mut Ear) -> Result<MovingCloth, Fault> {
        let loaded = self.loaded.clone();
        let mut warnings = loaded.warnings.clone();
        let state = if loaded.spec.start == StartSpec::Rest && loaded.state.is_none() {
            SavedState::at_rest(self.rest(&loaded, ear)?)
        } else {
            let start = find(&loaded, ear)?;
            warnings.extend(start.fitted.and_then(|fitted| fitted.warning));
            start.state
        };
        let scene = Arc::new(loaded.scene);
        let simulator = simulator_of_run(&scene, state);
        let mut simulator = simulator.map_err(Fault::start)?;
        simulator.set_threads(Threads::Pool);
        MovingCloth::new(scene, Engine::Physics(simulator), warnings)
    }

    /// A model at work on the cloth of the scene, from its rest pose on.
    pub(crate) fn model(
        &mut self,
        model: &NamedModel,
        settings: Correction,
        ear: &mut Ear,
    ) -> Result<MovingCloth, Fault> {
        let mut loaded = self.loaded.clone();
        start::for_model(&mut loaded);
        let mut warnings = loaded.warnings.clone();
        let frames = loaded.scene.frame_count().map_err(Fault::start)?;
        let beyond = domain::of_scene(&model.model, &loaded.scene, frames);
        match beyond.map_err(Fault::start)? {
            None => warnings.push(format!(
                "model {}: its file does not say what it was trained on",
                model.name
            )),
            Some(beyond) => warnings.extend(
                beyond
                    .departures
                    .iter()
                    .map(|departure| format!("beyond training: {departure}")),
            ),
        }
        let rest = self.rest(&loaded, ear)?;
        let scene = Arc::new(loaded.scene);
        let guard = start::guarded(&scene, &rest, model, &Machine::Cpu, settings);
        let guard = guard.map_err(Fault::start)?;
        MovingCloth::new(scene, Engine::Model(guard), warnings)
    }
}

fn find(loaded: &LoadedScene, ear: &mut Ear) -> Result<start::Start, Fault> {
    start::find(loaded, &mut |event| ear.tell(event)).map_err(|error| {
        let status = match ear.was_stopped() {
            true => SelvedgeStatus::Stopped,
            false => SelvedgeStatus::Start,
        };
        Fault::of(status, error)
    })
}

impl From<MovingCloth> for KeptCloth {
    fn from(mut cloth: MovingCloth) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        cloth.stepper_mut().stop_by(Arc::clone(&stop).into());
        let cloth = Mutex::new(cloth);
        Self { cloth, stop }
    }
}

impl MovingCloth {
    fn new(scene: Arc<Scene>, engine: Engine, warnings: Vec<String>) -> Result<Self, Fault> {
        let path = scene.handle_path().map_err(Fault::start)?;
        Ok(Self {
            scene,
            path,
            engine,
            warnings,
        })
    }

    #[cfg(test)]
    pub(crate) fn other(scene: Scene, stepper: Box<dyn Stepper + Send>) -> Self {
        Self::new(Arc::new(scene), Engine::Other(stepper), Vec::new()).unwrap()
    }

    pub(crate) fn stepper(&self) -> &dyn Stepper {
        match &self.engine {
            Engine::Physics(simulator) => simulator,
            Engine::Model(guard) => guard,
            #[cfg(test)]
            Engine::Other(stepper) => stepper,
        }
    }

    fn stepper_mut(&mut self) -> &mut dyn Stepper {
        match &mut self.engine {
            Engine::Physics(simulator) => simulator,
            Engine::Model(guard) => guard,
            #[cfg(test)]
            Engine::Other(stepper) => stepper,
        }
    }

    /// Targets per frame with which the command line drives such a stepper.
    pub(crate) fn samples(&self) -> usize {
        match &self.engine {
            Engine::Physics(_) => self.scene.physics.substeps as usize,
            _ => 1,
        }
    }

    /// Targets of the scene's motion for the next step.
    pub(crate) fn targets(&mut self, samples: usize) -> Result<HandleTargets, Fault> {
        let (frame, places) = (self.stepper().frame(), self.stepper().handle_places());
        self.path.follow(frame, &places);
        let targets = self.path.targets(frame, samples);
        targets.map_err(Fault::targets)
    }

    pub(crate) fn step(&mut self, targets: &HandleTargets) -> Result<(), Fault> {
        self.stepper_mut().step(targets).map_err(Fault::step)
    }

    /// Positions in f64 `[m]`, `[vertices]`: those of the state, where the stepper has one.
    pub(crate) fn positions_f64(&self) -> Vec<DVec3> {
        match &self.engine {
            Engine::Physics(simulator) => simulator.positions_f64().to_vec(),
            _ => {
                let positions = self.stepper().positions().iter();
                positions.map(|p| p.as_dvec3()).collect()
            }
        }
    }

    /// The guard's word on the newest frame; none for physics.
    pub(crate) fn trust(&self) -> Option<&Trust> {
        match &self.engine {
            Engine::Model(guard) => Some(guard.trust()),
            _ => None,
        }
    }
}
