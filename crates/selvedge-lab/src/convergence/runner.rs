//! A cloth by one of the methods that are compared: physics, physics that a model corrects, or a
//! model alone.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, HandleTargets, Scene, StepError, Stepper};
use selvedge_corrected::{CorrectedStepper, FrameState};
use selvedge_data::{Drive, SavedState};
use selvedge_model::{ClothGraph, LearnedStepper, Model};
use selvedge_sim::{Simulator, Threads};

use super::method::Method;
use super::reference::start_simulator;
use crate::physics::rounded;

/// True positions `[m]`, `[vertices]`, that a model alone begins with.
#[derive(Clone, Copy)]
pub(super) struct KnownFrames<'k, 't> {
    /// Those of a frame, where there is one.
    pub(super) truth: &'k dyn Fn(usize) -> Option<&'t [DVec3]>,
    /// The frame in which the cloth hangs at rest, where the run has one.
    pub(super) rest: Option<usize>,
}

/// A cloth on its way from a true state.
pub(super) struct Runner {
    mover: Mover,
    frame: usize,
}

#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
enum Mover {
    Physics(Simulator),
    Corrected(CorrectedStepper),
    Learned {
        stepper: LearnedStepper,
        /// Positions one frame before the last `[m]`, `[vertices]`.
        before: Vec<Vec3>,
        rate: f64,
    },
}

impl Runner {
    /// Starts `method` on `scene`, which is by its integrator, in the state `start`, with
    /// the frames before it that are `known`.
    ///
    /// # Errors
    /// A state or a scene that cannot be run, in words.
    pub(super) fn start(
        method: &Method,
        scene: &Scene,
        start: SavedState,
        known: KnownFrames<'_, '_>,
    ) -> Result<Self, String> {
        let frame = start.frame;
        let instructions = method.integrator.instructions();
        let mover = match method.integrator.model() {
            None => Mover::Physics(start_simulator(scene, start)?),
            Some(model) if model.spec().base.is_some() => {
                let state = FrameState {
                    positions: start.positions,
                    velocities: start.velocities,
                };
                let stepper = CorrectedStepper::new(Arc::clone(model), scene, state)
                    .and_then(|stepper| stepper.taken_up_at(frame));
                let mut stepper = stepper.map_err(|error| error.to_string())?;
                stepper = stepper.with_instructions(instructions);
                stepper.set_threads(Threads::One);
                Mover::Corrected(stepper)
            }
            Some(model) => {
                let stepper = learned(model, scene, &start, known)?;
                Mover::Learned {
                    before: stepper.positions().to_vec(),
                    rate: scene.frame_rate,
                    stepper: stepper.with_instructions(instructions),
                }
            }
        };
        Ok(Self { mover, frame })
    }

    /// Moves the cloth by a frame.
    ///
    /// # Errors
    /// The step that failed, in words.
    pub(super) fn step(&mut self, drive: Drive<'_>) -> Result<(), String> {
        let targets = drive.path.targets(self.frame, drive.samples_per_frame);
        let targets = targets.map_err(|error| error.to_string())?;
        self.mover
            .step(&targets)
            .map_err(|error| error.to_string())?;
        self.frame += 1;
        Ok(())
    }

    /// The part of the last frame's vertices that a model that corrects physics knew; none for
    /// others.
    pub(super) fn familiar(&self) -> Option<f64> {
        match &self.mover {
            Mover::Corrected(stepper) => Some(stepper.familiarity().familiar),
            _ => None,
        }
    }

    /// The state now; a model alone moves as it came from the frame before.
    pub(super) fn state(&self) -> FrameState {
        match &self.mover {
            Mover::Physics(simulator) => FrameState {
                positions: simulator.positions_f64().to_vec(),
                velocities: simulator.velocities_f64().to_vec(),
            },
            Mover::Corrected(stepper) => stepper.state().clone(),
            Mover::Learned {
                stepper,
                before,
                rate,
            } => {
                let frames = [before.clone(), stepper.positions().to_vec()];
                FrameState::of_frames(&frames, *rate)
            }
        }
    }
}

impl Mover {
    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        match self {
            Self::Physics(simulator) => simulator.step(targets),
            Self::Corrected(stepper) => stepper.step(targets),
            Self::Learned {
                stepper, before, ..
            } => {
                before.copy_from_slice(stepper.positions());
                stepper.step(targets)
            }
        }
    }
}

/// A model that moves the cloth alone, from the last true frames.
fn learned(
    model: &Arc<Model>,
    scene: &Scene,
    start: &SavedState,
    known: KnownFrames<'_, '_>,
) -> Result<LearnedStepper, String> {
    let needed = model.spec().history();
    let first = (start.frame + 1).saturating_sub(needed);
    let frames = (first..=start.frame).filter_map(known.truth);
    let frames: Vec<Vec<Vec3>> = frames.map(rounded).collect();
    let frames: Vec<&[Vec3]> = frames.iter().map(Vec::as_slice).collect();
    // The rest pose that features compare with: the model's own scene begins in it.
    let rest = match known.rest.and_then(known.truth) {
        Some(positions) => rounded(positions),
        None => {
            let found = selvedge_sim::sag(scene).map_err(|error| error.to_string())?;
            rounded(&found.positions)
        }
    };
    let cloth = Cloth::of_scene(scene, rest).map_err(|error| error.to_string())?;
    let graph = ClothGraph::new(&cloth, scene.environment, scene.frame_rate);
    let graph = graph.map_err(|error| error.to_string())?;
    let stepper = LearnedStepper::new(Arc::clone(model), graph, &frames);
    stepper.map_err(|error| error.to_string())
}
