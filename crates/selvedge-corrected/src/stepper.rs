//! Corrected physics as a [`Stepper`].

use std::mem;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    Cloth, ClothError, Correctable, HandleTargets, Handles, Scene, StepError, Stepper, Stop,
    Topology,
};
use selvedge_model::{
    Aspect, ClothGraph, Corrector, Domain, DomainWatch, Familiarity, FrameSubsteps, GraphError,
    Model, MotionState, NoBase, PhysicsBase, PredictedFrame, Stopped, rough_fields,
};
use selvedge_sim::{Simulator, SimulatorError, Threads};
use thiserror::Error;

use crate::base::{base_scene, cloth_graph, face_stiffness};

/// A state between two frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameState {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
}

/// A model, a scene or a start that corrected physics cannot be made of.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum CorrectedError {
    Base(#[from] NoBase),
    Physics(#[from] SimulatorError),
    Cloth(#[from] ClothError),
    Graph(#[from] GraphError),
}

/// Returns true if frames beyond a model's training in this aspect are not corrected: physics
/// alone moves them, and the network is not run.
///
/// Handles that move apart are left to the network's columns, vertex by vertex.
#[must_use]
pub fn goes_without(aspect: Aspect) -> bool {
    aspect != Aspect::Apart
}

/// The domain of a model, and hands and wind beside it.
struct Watched {
    trained: Domain,
    watch: DomainWatch,
    /// As it was before the newest frame.
    before: DomainWatch,
    /// True for each handle that holds now, `[handles]`.
    holds: Vec<bool>,
}

/// Returns true if the scene's own motion goes beyond `trained` somewhere. A motion that does not
/// fit the scene's handles, as where hands move them, says nothing.
fn is_beyond(trained: &Domain, scene: &Scene) -> bool {
    let frames = scene.frame_count();
    let found = frames.and_then(|frames| Domain::of_scene(scene, frames));
    found.is_ok_and(|found| {
        let departures = trained.departures(&found);
        departures.iter().any(|found| goes_without(found.aspect))
    })
}

/// A cloth that cheap physics moves and a network corrects.
///
/// Where the scene's own motion goes beyond what the model was trained on ([`goes_without`]), the
/// physics moves all of the run: a cloth still swings as it was never seen to when its hands are
/// slow again. Hands that go elsewhere are watched frame by frame.
pub struct CorrectedStepper {
    base: PhysicsBase,
    scene: Scene,
    simulator: Simulator,
    corrector: Corrector,
    /// The state before the next step.
    now: FrameState,
    /// The state one frame before, while the last step can be undone; the next one is made in it.
    spare: FrameState,
    /// The state one substep before that of now, as the physics has it while it makes a frame.
    earlier: FrameState,
    /// True where there is one.
    knows_earlier: bool,
    /// Differences of the frame through the matrix of its last solve.
    smoothed: [Vec<DVec3>; 2],
    /// Part of the substeps of the frame that fell back to first order.
    fell_back: f32,
    /// True where there was a factor of that.
    is_smoothed: bool,
    /// True while the last step can be undone.
    can_undo: bool,
    /// True for each vertex that a handle holds, `[vertices]`.
    held: Vec<bool>,
    /// True where the scene's own motion goes beyond what the model was trained on: physics moves
    /// all of it.
    beyond: bool,
    /// Bounds of what the model was trained on, where its file has them, beside the scene so far.
    watched: Option<Box<Watched>>,
    /// The last frame's.
    familiarity: Familiarity,
    stop: Stop,
}

impl CorrectedStepper {
    /// Moves the cloth of `scene` by `model` from `start`.
    ///
    /// # Errors
    /// A model that corrects no physics, or a scene or a start that physics cannot run.
    pub fn new(
        model: Arc<Model>,
        scene: &Scene,
        start: FrameState,
    ) -> Result<Self, CorrectedError> {
        let base = model.spec().base.ok_or(NoBase)?;
        let scene = base_scene(scene, base);
        let rest = scene.mesh.positions().iter().map(|p| p.as_vec3());
        let cloth = Cloth::of_scene(&scene, rest.collect())?;
        let domain = model.domain();
        let beyond = domain
            .as_ref()
            .is_some_and(|trained| is_beyond(trained, &scene));
        let graph = cloth_graph(&scene, &cloth)?;
        let of_face = face_stiffness(&scene);
        let corrector = Corrector::of_faces(model, graph, |face| of_face[face.index()])?;
        let FrameState {
            positions,
            velocities,
        } = start.clone();
        Ok(Self {
            base,
            simulator: Simulator::with_state(&scene, positions, velocities)?,
            corrector,
            spare: start.clone(),
            earlier: start.clone(),
            knows_earlier: false,
            smoothed: Default::default(),
            fell_back: 0.0,
            is_smoothed: false,
            now: start,
            can_undo: false,
            beyond,
            watched: domain.map(|trained| {
                let watch = DomainWatch::of_scene(&scene);
                Box::new(Watched {
                    trained,
                    before: watch.clone(),
                    watch,
                    holds: Vec::new(),
                })
            }),
            held: scene.handles.mask(scene.mesh.positions().len()),
            familiarity: Familiarity::default(),
            stop: Stop::default(),
            scene,
        })
    }

    /// The same cloth with frames counted from `frame`: the next step has the wind of that frame.
    #[must_use]
    pub fn at_frame(mut self, frame: usize) -> Self {
        self.simulator = self.simulator.at_frame(frame);
        self
    }

    /// Takes up a run along the scene's own motion again, with frames counted from `frame`: handles
    /// hold as [`Simulator::taken_up_at`] says.
    ///
    /// # Errors
    /// As for [`Simulator::taken_up_at`].
    pub fn taken_up_at(mut self, frame: usize) -> Result<Self, CorrectedError> {
        self.simulator = self.simulator.taken_up_at(frame)?;
        Ok(self)
    }

    /// The graph of the cloth, as the network sees it.
    #[must_use]
    pub fn graph(&self) -> &ClothGraph {
        self.corrector.graph()
    }

    /// Sets the threads of the physics; those of the network are the pool's.
    pub fn set_threads(&mut self, threads: Threads) {
        self.simulator.set_threads(threads);
    }

    /// The state now.
    #[must_use]
    pub fn state(&self) -> &FrameState {
        &self.now
    }

    /// The part of the last frame that was like what the model was trained on.
    #[must_use]
    pub fn familiarity(&self) -> Familiarity {
        self.familiarity
    }

    /// Predicts a frame by physics.
    fn predict(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let earlier = self.simulator.substep_before();
        self.knows_earlier = earlier.is_some();
        if let Some((positions, velocities)) = earlier {
            self.earlier.positions.copy_from_slice(positions);
            self.earlier.velocities.copy_from_slice(velocities);
        }
        let before = self.simulator.stats().substeps;
        self.simulator.step(targets)?;
        let after = self.simulator.stats().substeps;
        let all = (after.all - before.all).max(1) as f32;
        self.fell_back = (after.fell_back - before.fell_back) as f32 / all;
        self.smooth();
        Ok(())
    }

    /// Finds the differences that are smoothed by the matrix of the last solve.
    fn smooth(&mut self) {
        let end = MotionState {
            positions: self.simulator.positions_f64(),
            velocities: self.simulator.velocities_f64(),
        };
        let start = self.now.as_motion();
        let middle = self.simulator.substep_before();
        let middle = middle.map_or(start, |(positions, velocities)| MotionState {
            positions,
            velocities,
        });
        let times = self.base.times(self.scene.frame_rate);
        rough_fields([start, middle, end], times, &mut self.smoothed);
        self.is_smoothed = true;
        for field in &mut self.smoothed {
            self.is_smoothed &= self.simulator.smooth(field);
        }
    }

    /// Returns true where this frame is of a kind that the model was trained on, as far as that
    /// matters to its corrections.
    fn is_within(&mut self, targets: &HandleTargets, frame: usize) -> bool {
        let Some(watched) = &mut self.watched else {
            return true;
        };
        if self.beyond {
            return false;
        }
        let Watched {
            trained,
            watch,
            before,
            holds,
        } = watched.as_mut();
        before.copy_frames_of(watch);
        let environment = self.scene.environment;
        let environment = environment.during_step(frame, self.scene.frame_rate);
        holds.clear();
        holds.extend((0..self.scene.handles.len()).map(|handle| targets.holds(handle)));
        watch.see(targets.end(), holds, environment.wind);
        let departures = trained.departures(watch.now());
        !departures.iter().any(|found| goes_without(found.aspect))
    }

    /// Takes back the frame that physics has just made, and what was seen in it.
    fn take_back(&mut self) {
        self.simulator.undo_step();
        if let Some(watched) = &mut self.watched {
            mem::swap(&mut watched.watch, &mut watched.before);
        }
    }

    /// Makes the next state in `spare`, of the one that physics predicted: its own where there is a
    /// substep that the physics did not take, because strain limits or contact divided the frame
    /// otherwise.
    fn correct(&mut self, frame: usize) -> Result<(), Stopped> {
        self.spare.copy_of(&self.simulator);
        self.familiarity = Familiarity::default();
        let Some((positions, velocities)) = self.simulator.substep_before() else {
            return Ok(());
        };
        if !self.is_smoothed {
            return Ok(());
        }
        let environment = self.scene.environment;
        let environment = environment.during_step(frame, self.scene.frame_rate);
        let predicted = PredictedFrame {
            substeps: FrameSubsteps {
                earlier: self.knows_earlier.then(|| self.earlier.as_motion()),
                middle: MotionState {
                    positions,
                    velocities,
                },
                part: 1.0 / f64::from(self.base.substeps),
                smoothed: &self.smoothed,
                fell_back: self.fell_back,
            },
            last: self.now.as_motion(),
            predicted: MotionState {
                positions: self.simulator.positions_f64(),
                velocities: self.simulator.velocities_f64(),
            },
            wind: environment.wind,
            gravity: environment.gravity,
            held: &self.held,
        };
        let next = &mut self.spare;
        self.familiarity =
            self.corrector
                .correct(&predicted, &mut next.positions, &mut next.velocities)?;
        Ok(())
    }

    fn hold(&mut self, targets: &HandleTargets) {
        for (handle, vertex) in self.scene.handles.vertices().iter().enumerate() {
            self.held[vertex.index()] = targets.holds(handle);
        }
    }
}

impl FrameState {
    /// The state at the last of `frames`, oldest first `[m]`, `[frames][vertices]`, of which there
    /// are `rate` per second: at rest where there is one.
    #[must_use]
    pub fn of_frames(frames: &[Vec<Vec3>], rate: f64) -> Self {
        let wide = |frame: &Vec<Vec3>| frame.iter().map(|p| p.as_dvec3()).collect();
        let positions: Vec<DVec3> = frames.last().map_or_else(Vec::new, wide);
        let before: Vec<DVec3> = match frames {
            [.., before, _] => wide(before),
            _ => positions.clone(),
        };
        let moves = positions.iter().zip(before);
        Self {
            velocities: moves.map(|(p, q)| rate * (*p - q)).collect(),
            positions,
        }
    }

    /// Takes the state of a simulator of as many vertices.
    fn copy_of(&mut self, simulator: &Simulator) {
        self.positions.copy_from_slice(simulator.positions_f64());
        self.velocities.copy_from_slice(simulator.velocities_f64());
    }

    /// As the columns of a model take it.
    #[must_use]
    pub fn as_motion(&self) -> MotionState<'_> {
        MotionState {
            positions: &self.positions,
            velocities: &self.velocities,
        }
    }
}

impl Stepper for CorrectedStepper {
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

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.can_undo = false;
        let frame = self.frame();
        self.predict(targets)?;
        self.hold(targets);
        if !self.is_within(targets, frame) {
            self.spare.copy_of(&self.simulator);
            self.familiarity = Familiarity::default();
        } else if self.correct(frame).is_err() {
            self.take_back();
            return Err(StepError::Stopped { frame: frame + 1 });
        }
        if self.stop.is_wanted() {
            self.take_back();
            return Err(StepError::Stopped { frame: frame + 1 });
        }
        let next = &self.spare;
        if let Err(error) = self.simulator.correct(&next.positions, &next.velocities) {
            self.take_back();
            let frame = frame + 1;
            return Err(match error {
                SimulatorError::NonFinite { vertex, .. } => StepError::NonFinite { frame, vertex },
                other => StepError::Solve {
                    frame,
                    cause: other.to_string(),
                },
            });
        }
        mem::swap(&mut self.now, &mut self.spare);
        self.can_undo = true;
        Ok(())
    }

    /// Heard within the physics and within the network.
    fn stop_by(&mut self, stop: Stop) {
        self.simulator.stop_by(stop.clone());
        self.corrector.stop_by(stop.clone());
        self.stop = stop;
    }
}

impl Correctable for CorrectedStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.simulator.replace_frame(positions)?;
        self.now.copy_of(&self.simulator);
        Ok(())
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.simulator.take_frame(positions)?;
        self.can_undo = false;
        self.now.copy_of(&self.simulator);
        Ok(())
    }

    fn undo_step(&mut self) {
        if mem::take(&mut self.can_undo) {
            self.take_back();
            mem::swap(&mut self.now, &mut self.spare);
        }
    }
}

#[cfg(test)]
mod tests;
