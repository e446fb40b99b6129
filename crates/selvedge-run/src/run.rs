//! A run: a scene, who moves it, and the frames that it makes.

mod gradients;

#[cfg(feature = "files")]
use std::ops::ControlFlow;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, HandleTargets, Impulse, Rigid, Snapshot, StepError, Stepper};
#[cfg(feature = "files")]
use selvedge_data::{Recording, Trajectory};
#[cfg(feature = "learned")]
use selvedge_guard::{Correction, Guard, Trust};
use selvedge_sim::{SaggedRest, Simulator, Threads};

use crate::Error;
#[cfg(feature = "learned")]
use crate::domain::{self, Beyond};
use crate::event::Listener;
#[cfg(feature = "learned")]
use crate::machine::Machine;
#[cfg(feature = "learned")]
use crate::models::Model;
use crate::scene::{Scene, ignore_events};
use crate::start::{self, Start};
use crate::strain::StrainWatch;
use crate::through::let_through;

/// A network, and how it moves a cloth.
#[cfg(feature = "learned")]
#[derive(Clone, Copy)]
pub struct Network<'a> {
    /// The network.
    pub model: &'a Model,
    /// Where it runs.
    pub machine: &'a Machine,
    /// What the guard does with frames that no cloth has.
    pub guard: Correction,
}

/// Who moves the cloth.
enum Mover {
    Solver(Box<Simulator>),
    #[cfg(feature = "learned")]
    Model(Box<Guard<crate::machine::Mover>>),
    Other(Box<dyn Stepper + Send + Sync>),
}

impl Deref for Mover {
    type Target = dyn Stepper + Send;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Solver(solver) => solver.as_ref(),
            #[cfg(feature = "learned")]
            Self::Model(model) => model.as_ref(),
            Self::Other(other) => other.as_ref(),
        }
    }
}

impl DerefMut for Mover {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Solver(solver) => solver.as_mut(),
            #[cfg(feature = "learned")]
            Self::Model(model) => model.as_mut(),
            Self::Other(other) => other.as_mut(),
        }
    }
}

/// A cloth that moves along the motion of its scene, or where it is led, one frame at a time.
///
/// Positions are in metres, `[vertices]`, and have the same bytes in every front and on any number
/// of threads. A step that fails leaves the cloth as it was.
pub struct Run {
    scene: Scene,
    mover: Mover,
    path: HandlePath,
    /// Positions one frame ago `[m]`, `[vertices]`; of no use with the solver, which has velocities.
    before: Vec<Vec3>,
    strain: StrainWatch,
    first: usize,
    beginning: Option<Snapshot>,
    rest: Option<Arc<SaggedRest>>,
    remarks: Vec<String>,
    warnings: Vec<String>,
    #[cfg(feature = "learned")]
    beyond: Vec<String>,
}

impl Run {
    /// Lets the solver move the cloth, from where the scene begins. Finding the rest pose may take
    /// a second, for a large cloth a minute.
    ///
    /// # Errors
    /// A start that cannot be had, or a scene that the solver cannot move; what helps is said.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Self::begin(scene, &mut ignore_events)
    }

    /// Lets a network move the cloth on the processor, under the usual guard, from its rest pose.
    ///
    /// # Errors
    /// As for [`Self::new`]; also a frame rate that the network was not trained at.
    #[cfg(feature = "learned")]
    pub fn of_model(scene: &Scene, model: &Model) -> Result<Self, Error> {
        let network = Network {
            model,
            machine: &Machine::Cpu,
            guard: Correction::default(),
        };
        Self::begin_model(scene, network, &mut ignore_events)
    }

    /// Lets any stepper move the cloth of `scene`, from where it is.
    ///
    /// # Errors
    /// A motion that cannot drive the handles.
    pub fn of_stepper(
        scene: &Scene,
        stepper: Box<dyn Stepper + Send + Sync>,
    ) -> Result<Self, Error> {
        Self::of(scene, Mover::Other(stepper), None)
    }

    /// As [`Self::new`], with a listener of the long work, which may stop it.
    ///
    /// # Errors
    /// As there; [`Error::is_stopped`] where the listener asked for an end.
    pub fn begin(scene: &Scene, on_event: &mut Listener<'_>) -> Result<Self, Error> {
        Self::from_start(scene, scene.start(on_event)?)
    }

    /// Lets the solver move the cloth from a start that was found.
    ///
    /// # Errors
    /// [`Error::Solver`].
    pub fn from_start(scene: &Scene, start: Start) -> Result<Self, Error> {
        let simulator = start::simulator_of_run(scene.built(), &start.state);
        let simulator = simulator.map_err(|source| Error::Solver {
            scene: scene.built().name.clone(),
            source,
        })?;
        let mut run = Self::of(scene, Mover::Solver(Box::new(simulator)), Some(start))?;
        run.warnings.extend(start::thrown(scene.built()));
        Ok(run)
    }

    /// As [`Self::of_model`], on any machine, with any guard, and a listener of the long work.
    ///
    /// # Errors
    /// As there; [`Error::is_stopped`] where the listener asked for an end.
    #[cfg(feature = "learned")]
    pub fn begin_model(
        scene: &Scene,
        network: Network<'_>,
        on_event: &mut Listener<'_>,
    ) -> Result<Self, Error> {
        let Network {
            model,
            machine,
            guard,
        } = network;
        let built = scene.built();
        let frames = built.frame_count()?;
        let beyond = match domain::of_scene(&model.model, built, frames)? {
            None => vec![format!(
                "model {}: its file does not say what it was trained on",
                model.name
            )],
            Some(Beyond { departures, .. }) => {
                let lines = departures.iter();
                lines.map(|one| format!("beyond training: {one}")).collect()
            }
        };
        let rest = scene.rest_pose(on_event)?;
        let guard = start::guarded(built, &rest.positions, model, machine, guard)?;
        let mut run = Self::of(&scene.at_rest(), Mover::Model(Box::new(guard)), None)?;
        run.rest = Some(rest);
        run.beyond = beyond;
        if !scene.begins_at_rest() {
            run.warnings.push("start: a network and what it is compared with start in the sagged rest pose, and not as the scene says: take the solver for that (`selvedge run` without --model)".to_owned());
        }
        if built.contact.is_some() && !model.model.spec().sees_bodies() {
            run.warnings.push("contact: this model does not see obstacles, nor where the cloth touches itself: its frames are pushed apart, and the guard mends those that still meet (without a guard they stay so)".to_owned());
        }
        Ok(run)
    }

    fn of(scene: &Scene, mover: Mover, start: Option<Start>) -> Result<Self, Error> {
        let (rest, remarks, warnings) = start.map_or_else(Default::default, |start| {
            (start.rest, start.remarks, start.warnings)
        });
        let mut run = Self {
            path: scene.built().handle_path()?,
            scene: scene.clone(),
            before: Vec::new(),
            strain: StrainWatch::new(scene.built()),
            mover,
            first: 0,
            beginning: None,
            rest,
            remarks,
            warnings,
            #[cfg(feature = "learned")]
            beyond: Vec::new(),
        };
        run.first = run.mover.frame();
        run.before = run.mover.positions().to_vec();
        run.strain.begin(&run.before);
        run.beginning = run.snapshot();
        Ok(run)
    }

    /// Moves the cloth by one frame along the motion of its scene; past its end the handles stay.
    ///
    /// # Errors
    /// [`StepError`] names the frame that could not be reached; the cloth is as it was.
    pub fn step(&mut self) -> Result<(), StepError> {
        let targets = self.next_targets(self.samples())?;
        self.step_to(&targets)
    }

    /// Moves the cloth by one frame, its handles to `targets` `[m]`, `[handles]`, or at several times
    /// of the frame; those that are let go are free.
    ///
    /// # Errors
    /// As for [`Self::step`].
    pub fn step_to(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let last = match &self.mover {
            Mover::Solver(_) => Vec::new(),
            _ => self.positions().to_vec(),
        };
        self.mover.step(targets)?;
        self.before = last;
        self.strain.see(self.mover.positions());
        Ok(())
    }

    /// Targets of the scene's motion for the next step, sampled `samples` times in the frame; with
    /// [`Self::samples`] of them [`Self::step_to`] does what [`Self::step`] does.
    ///
    /// # Errors
    /// [`StepError::Handles`] for a target that is not finite, or too far away.
    pub fn next_targets(&mut self, samples: usize) -> Result<HandleTargets, StepError> {
        self.path.next(&*self.mover, samples)
    }

    /// Targets per frame along the scene's motion: one per substep of the solver, else one.
    pub fn samples(&self) -> usize {
        match self.mover {
            Mover::Solver(_) => self.scene.built().physics.substeps as usize,
            _ => 1,
        }
    }

    /// Positions of the newest frame `[m]`, `[vertices]`, in single precision.
    pub fn positions(&self) -> &[Vec3] {
        self.mover.positions()
    }

    /// Positions `[m]`, `[vertices]`, in double precision where the solver moves the cloth.
    pub fn positions_f64(&self) -> Vec<DVec3> {
        match &self.mover {
            Mover::Solver(solver) => solver.positions_f64().to_vec(),
            _ => self.positions().iter().map(|p| p.as_dvec3()).collect(),
        }
    }

    /// Velocities `[m/s]`, `[vertices]`: those of the solver's state, otherwise the way of the last
    /// frame over its time.
    pub fn velocities(&self) -> Vec<DVec3> {
        if let Mover::Solver(solver) = &self.mover {
            return solver.velocities_f64().to_vec();
        }
        let rate = self.scene.built().frame_rate;
        let pairs = self.positions().iter().zip(&self.before);
        pairs
            .map(|(now, before)| (now.as_dvec3() - before.as_dvec3()) * rate)
            .collect()
    }

    /// Number of the newest frame in the motion: 0 at its beginning.
    pub fn frame(&self) -> usize {
        self.mover.frame()
    }

    /// Frames of the scene's motion after the one in which the run began.
    ///
    /// # Errors
    /// A motion that cannot drive the handles.
    pub fn frames_left(&self) -> Result<usize, Error> {
        Ok(self.path.frame_count().saturating_sub(self.frame()))
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The solver; none where something else moves the cloth.
    pub fn solver(&self) -> Option<&Simulator> {
        match &self.mover {
            Mover::Solver(solver) => Some(solver),
            _ => None,
        }
    }

    /// Sets the threads of the solver, by default those of rayon's pool; the bytes are the same.
    pub fn set_threads(&mut self, threads: Threads) {
        if let Mover::Solver(solver) = &mut self.mover {
            solver.set_threads(threads);
        }
    }

    /// The guard of a network; none where something else moves the cloth.
    #[cfg(feature = "learned")]
    pub fn guard(&self) -> Option<&Guard<crate::machine::Mover>> {
        match &self.mover {
            Mover::Model(guard) => Some(guard),
            _ => None,
        }
    }

    /// The guard's word on the newest frame; none without a guard.
    #[cfg(feature = "learned")]
    pub fn trust(&self) -> Option<&Trust> {
        self.guard().map(Guard::trust)
    }

    /// The sagged rest pose, where the run began there.
    pub fn rest(&self) -> Option<&SaggedRest> {
        self.rest.as_deref()
    }

    /// What was done to the cloth before its motion, a line each.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// All that is to be known of this run so far, a line each: warnings of the scene, of its start,
    /// of what a network does not see and was not trained on, and of its frames.
    pub fn warnings(&self) -> Vec<String> {
        let mut all = self.scene.warnings().to_vec();
        all.extend_from_slice(self.start_warnings());
        #[cfg(feature = "learned")]
        all.extend_from_slice(&self.beyond);
        all.extend(self.frame_warnings());
        all
    }

    /// Warnings of the start, and of what a network does not do of its scene.
    pub fn start_warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Warnings of the frames so far: bodies that were let through, edges strained by more than
    /// fabrics are measured for, and a guard whose solver failed.
    pub fn frame_warnings(&self) -> Vec<String> {
        let scene = self.scene.built();
        let through = self.solver().map(Simulator::yielded).unwrap_or_default();
        let through = let_through(scene, through);
        let words = through.iter().map(ToString::to_string);
        let words = words.chain(self.strain.warning(scene));
        #[cfg(feature = "learned")]
        let words = {
            let failure = self.guard().and_then(Guard::physics_failure);
            let failed = |failure| format!("the guard did without its physics: {failure}");
            words.chain(failure.map(failed))
        };
        words.collect()
    }

    /// The state now, for [`Self::restore`]; none of a stepper that cannot go back.
    pub fn snapshot(&self) -> Option<Snapshot> {
        Some(Snapshot::of(State {
            scene: self.scene.clone(),
            mover: self.mover.snapshot()?,
            path: self.path.clone(),
            before: self.before.clone(),
            strain: self.strain.clone(),
        }))
    }

    /// Goes back to a snapshot of this run, or of another one of the same scene by the same mover.
    /// The frames that follow have the bytes of those that followed then.
    ///
    /// # Errors
    /// [`StepError::Snapshot`] for one of another scene or mover; the run is as it was.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let state: &State = snapshot.get(self.frame(), |state: &State| {
            let (own, other) = (self.scene.built(), state.scene.built());
            std::ptr::eq(own, other) || own == other
        })?;
        self.mover.rewind(&state.mover)?;
        self.path.clone_from(&state.path);
        self.before.clone_from(&state.before);
        self.strain.clone_from(&state.strain);
        Ok(())
    }

    /// Goes back to where the run began.
    ///
    /// # Errors
    /// [`StepError::Snapshot`] of a stepper that cannot go back.
    pub fn reset(&mut self) -> Result<(), StepError> {
        let frame = self.frame();
        let beginning = self.beginning.clone();
        self.restore(&beginning.ok_or(StepError::Snapshot { frame })?)
    }

    /// Sets the cloth elsewhere between two frames, rigidly, and with it the obstacles of the numbers
    /// `along`, as [`Stepper::teleport`] says. The scene's own motion does not know of it: lead the
    /// handles by [`Self::step_to`].
    ///
    /// # Errors
    /// Where the cloth would meet an obstacle, for the number of none, or where a network moves it; the
    /// cloth is as it was.
    pub fn teleport(&mut self, to: Rigid, along: &[usize]) -> Result<(), StepError> {
        self.mover.teleport(to, along)?;
        self.before = self.mover.positions().to_vec();
        Ok(())
    }

    /// Leads the obstacle of this number in the next frame away from its own path, by a distance
    /// `[m]` or a rigid motion; it stays there until it is led on.
    ///
    /// # Errors
    /// [`StepError::Obstacle`] for the number of no obstacle, and for all where no solver moves the cloth.
    pub fn lead_obstacle(
        &mut self,
        number: usize,
        away: impl Into<Rigid>,
    ) -> Result<(), StepError> {
        match &mut self.mover {
            Mover::Solver(solver) => solver.lead_obstacle(number, away),
            _ => Err(StepError::Obstacle {
                frame: self.frame(),
                number,
                count: 0,
            }),
        }
    }

    /// What each obstacle received from the cloth over the last frame, `[obstacles]`: over the time of
    /// a frame, the force on it. None without a solver, or without contact.
    pub fn impulses(&self) -> &[Impulse] {
        self.solver().map_or(&[], Simulator::received)
    }

    /// Points of all obstacles now `[m]`, those of the first one first.
    pub fn obstacle_points(&self) -> Vec<DVec3> {
        let scene = self.scene.built();
        match self.solver() {
            Some(solver) if scene.contact.is_some() => solver.obstacle_points(),
            _ => {
                let time = self.frame() as f64 / scene.frame_rate;
                let bodies = scene.obstacles.iter();
                bodies.flat_map(|body| body.positions_at(time)).collect()
            }
        }
    }

    /// Steps `frames` times along the scene's motion and collects the positions, those now first.
    /// `on_frame` sees the run after every step, and may stop.
    #[cfg(feature = "files")]
    pub fn record(
        &mut self,
        frames: usize,
        on_frame: &mut dyn FnMut(&Self) -> ControlFlow<()>,
    ) -> Recording {
        selvedge_data::record_steps(self, frames, &mut Self::step, on_frame)
    }

    /// The trajectory of `positions` `[m]`, `[frames * vertices]`, that this run recorded from its
    /// beginning on.
    ///
    /// # Errors
    /// Positions that are no frames of the scene's cloth.
    #[cfg(feature = "files")]
    pub fn trajectory(&self, positions: Vec<Vec3>) -> Result<Trajectory, Error> {
        let built = self.scene.built();
        let rest = self.rest.as_ref().map(|rest| &rest.positions[..]);
        let rest = rest.unwrap_or(built.mesh.positions());
        crate::trajectory::trajectory(self.first, self.scene.spec(), built, rest, positions)
    }
}

/// A snapshot of a run.
struct State {
    scene: Scene,
    mover: Snapshot,
    path: HandlePath,
    before: Vec<Vec3>,
    strain: StrainWatch,
}

/// A run takes the place of any stepper.
impl Stepper for Run {
    selvedge_cloth::delegate_stepper!(self: self.mover);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.step_to(targets)
    }

    fn snapshot(&self) -> Option<Snapshot> {
        self.snapshot()
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        self.restore(snapshot)
    }

    fn teleport(&mut self, to: Rigid, along: &[usize]) -> Result<(), StepError> {
        self.teleport(to, along)
    }
}

#[cfg(all(test, feature = "learned"))]
pub(crate) mod tests;
