//! The reference physics as a [`Stepper`]: one step is one frame of `substeps` solves.
//!
//! The state is f64; [`Stepper::positions`] gives its f32 copies. The result depends only on scene,
//! start and targets: any number of threads gives the same bytes. The wind of a frame is held over
//! its step. Handles may let go and take hold again between frames.
//!
//! [`Stepper`]: selvedge_cloth::Stepper
//! [`Stepper::positions`]: selvedge_cloth::Stepper::positions

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandleError, HandleTargets, Scene, StepError, Stepper, Stop, VertexId};

use crate::active_handles::ActiveHandles;
use crate::contact::{Advance, Contact, ContactCounts, Span};
use crate::edges::WatchedEdges;
use crate::integrator::{History, SubstepCounts};
use crate::solver::SolveError;
use crate::state::State;
use crate::threads::Threads;
pub use error::SimulatorError;
pub use frame::DividedFrames;
pub(crate) use frame::Part;
use frame::{FRAME, Snapshot};
pub(crate) use gradient::check as check_gradient;
pub use gradient::{Gradient, GradientError, GradientSettings, StateGradient};
pub use selvedge_cloth::Checkpoint;

mod checkpoint;
mod contact;
mod error;
mod frame;
mod gradient;
mod rest;
mod stepping;

/// A cloth that moves by its measured stiffness, gravity and air.
pub struct Simulator {
    scene: Scene,
    active: ActiveHandles,
    state: State,
    history: History,
    /// The start of the frame, and that of the part of it under way, where contact may take the
    /// cloth back there.
    starts: [Snapshot; 2],
    rounded: Vec<Vec3>,
    frame: usize,
    divided: DividedFrames,
    /// Targets of the handles at the end of the last frame `[m]`, `[handles]`.
    reached: Vec<DVec3>,
    /// Targets of the active handles `[m]`.
    targets: Vec<DVec3>,
    threads: Threads,
    edges: WatchedEdges,
    stop: Stop,
    /// Contact, where the scene has it.
    contact: Option<Box<Contact>>,
    /// The steps, where someone wants their gradient.
    recording: Option<Box<gradient::Recording>>,
    /// The call that ended the last recording.
    recording_ended_by: Option<&'static str>,
}

/// Work since the start, by what it came to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepStats {
    /// Substeps; all 0 with an integrator of first order.
    pub substeps: SubstepCounts,
    /// Frames that took more substeps than the scene asks for.
    pub divided: DividedFrames,
    /// Work of contact; all 0 without contact.
    pub contact: ContactCounts,
}

impl Simulator {
    /// A simulator of `scene` from its mesh's positions, at rest.
    ///
    /// # Errors
    /// A scene that does not validate, or a system that does not fit in memory.
    pub fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let start = Checkpoint::at_rest(scene.mesh.positions().to_vec());
        Self::from_checkpoint(scene, &start)
    }

    /// A simulator of `scene` that starts at `positions` `[m]` with `velocities` `[m/s]`,
    /// `[vertices]`.
    ///
    /// # Errors
    /// As for [`Self::new`]; also a count that does not match, or a value that is not finite in
    /// f32.
    pub fn with_state(
        scene: &Scene,
        positions: Vec<DVec3>,
        velocities: Vec<DVec3>,
    ) -> Result<Self, SimulatorError> {
        Self::from_checkpoint(scene, &Checkpoint::of(0, positions, velocities))
    }

    /// A simulator of a validated scene from its mesh's positions, at rest, which is not checked.
    fn of_mesh(scene: &Scene) -> Result<Self, SimulatorError> {
        let positions = scene.mesh.positions();
        let vertices = positions.len();
        let active = ActiveHandles::all(scene)
            .map_err(|cause| SimulatorError::analysis(vertices, &cause))?;
        Ok(Self {
            rounded: vec![Vec3::ZERO; vertices],
            reached: scene.handles.select(positions),
            targets: vec![DVec3::ZERO; scene.handles.len()],
            state: State::at_rest(positions.to_vec()),
            history: History::none(vertices),
            starts: [Snapshot::new(vertices), Snapshot::new(vertices)],
            frame: 0,
            divided: DividedFrames::default(),
            threads: Threads::Pool,
            stop: Stop::default(),
            edges: WatchedEdges::new(&scene.mesh, &scene.handles),
            contact: Contact::of(scene, active.system.mass()).map(Box::new),
            recording: None,
            recording_ended_by: None,
            scene: scene.clone(),
            active,
        })
    }

    /// The same cloth with frames counted from `frame`: the next step has the targets, the wind and
    /// the releases of that frame of the scene. All handles count as on their paths; for a run that
    /// is taken up again see [`Self::taken_up_at`].
    pub fn at_frame(mut self, frame: usize) -> Self {
        self.frame = frame;
        self.update_wind();
        self
    }

    /// Takes up a run along the scene's own motion again, with frames counted from `frame`. A
    /// handle that had let go by then is free. A handle that took hold again after that holds its
    /// vertex at its present place, its spring without tension.
    ///
    /// # Errors
    /// A motion that does not fit the handles, or a system that does not fit in memory.
    pub fn taken_up_at(self, frame: usize) -> Result<Self, SimulatorError> {
        let mut simulator = self.at_frame(frame);
        let (scene, rate) = (&simulator.scene, simulator.scene.frame_rate);
        let Some(last) = frame.checked_sub(1) else {
            return Ok(simulator);
        };
        let path = scene.handle_path()?;
        // A spring handle is not where its path is.
        simulator.reached = path.at(frame as f64 / rate);
        let has_let_go = scene.schedule.let_go_by(last, rate, scene.handles.len());
        if !has_let_go.contains(&true) {
            return Ok(simulator);
        }
        for (handle, place) in simulator.handle_places().into_iter().enumerate() {
            if has_let_go[handle] {
                simulator.reached[handle] = place;
            }
        }
        let released = scene.schedule.released(last, rate, scene.handles.len());
        let holds = released.iter().map(|released| !released).collect();
        let changes = simulator.active.system.last_changes();
        let changes = changes.map(|(changes, seconds)| (changes.to_vec(), seconds));
        simulator.active = simulator
            .holding(holds, &changes)
            .map_err(|cause| SimulatorError::analysis(simulator.rounded.len(), &cause))?;
        simulator.update_wind();
        Ok(simulator)
    }

    /// The handles that hold, whose next solve begins from these changes of velocity.
    fn holding(
        &self,
        holds: Vec<bool>,
        changes: &Option<(Vec<DVec3>, f64)>,
    ) -> Result<ActiveHandles, SolveError> {
        let mut active = ActiveHandles::new(&self.scene, holds)?;
        active.system.stop_by(self.stop.clone());
        if let Some((changes, seconds)) = changes {
            active.system.put_changes(changes, *seconds);
        }
        Ok(active)
    }

    /// Sets the threads of the steps that follow. The default is [`Threads::Pool`].
    pub fn set_threads(&mut self, threads: Threads) {
        self.threads = threads;
    }

    /// Positions now `[m]`, `[vertices]`.
    pub fn positions_f64(&self) -> &[DVec3] {
        &self.state.positions
    }

    /// Velocities now `[m/s]`, `[vertices]`.
    pub fn velocities_f64(&self) -> &[DVec3] {
        &self.state.velocities
    }

    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub fn vertex_mass(&self) -> &[f64] {
        self.active.system.mass()
    }

    /// Kinetic energy Σ m |v|²/2 `[J]`.
    pub fn kinetic_energy(&self) -> f64 {
        let all = self.vertex_mass().iter().zip(&self.state.velocities);
        all.map(|(mass, velocity)| 0.5 * mass * velocity.length_squared())
            .sum()
    }

    /// Energy of the cloth in its elements and in gravity, -Σ m g·x, `[J]`; none with a law that
    /// has no energy. Contact, springs of handles and the air are not in it.
    pub fn potential_energy(&self) -> Option<f64> {
        let positions = &self.state.positions;
        let gravity = self.scene.environment.gravity;
        let masses = self.vertex_mass().iter().zip(positions);
        let lifted: f64 = masses.map(|(mass, x)| -mass * gravity.dot(*x)).sum();
        Some(self.active.system.elastic_energy(positions)? + lifted)
    }

    /// Work since the start, by what it came to.
    pub fn stats(&self) -> StepStats {
        let contact = self.contact.as_ref();
        StepStats {
            substeps: self.history.counts,
            divided: self.divided,
            contact: contact.map_or_else(ContactCounts::default, |contact| contact.counts),
        }
    }

    /// Iterations of the last linear solve; none if it was a complete factorisation.
    pub fn solver_iterations(&self) -> Option<u32> {
        self.active.system.iterations()
    }

    /// Moves the cloth by one substep over `dt` `[s]`, its active handles to `targets` `[m]`,
    /// `[handles]`. The frame count stays, and with it the wind and the obstacles.
    ///
    /// A Δv = b, v ← v + Δv, x ← x + dt v with A = M - Σ dt (dt + c) J + dt² K_handles and b = dt
    /// f_ext + Σ dt (F + (dt + c) J v) - dt (gradient of the handles' springs at x + dt v); the row
    /// of an exact handle is v = (target - x)/dt instead. `[eq:backward-euler]`
    ///
    /// # Errors
    /// As for [`step`](selvedge_cloth::Stepper::step), with the number of the frame under way; the
    /// cloth is left as it was.
    pub fn substep(&mut self, dt: f64, targets: &[DVec3]) -> Result<(), StepError> {
        let (expected, found) = (self.scene.handles.len(), targets.len());
        if expected != found {
            return Err(HandleError::Count { expected, found }.at(self.frame + 1));
        }
        self.end_recording("`substep`");
        self.wake();
        self.save(FRAME);
        self.update_wind();
        self.active.put_targets(&mut self.targets, |h| targets[h]);
        let threads = self.enter();
        self.enter_frame();
        let part = Part {
            dt,
            way: [0.0; 2],
            may_hold: true,
            may_divide: false,
            is_last: true,
        };
        if let Err(error) = threads.run(|| self.solve(part)) {
            self.put_back(FRAME);
            return Err(error);
        }
        self.round_new()?;
        self.reached.copy_from_slice(targets);
        Ok(())
    }

    /// Hands the threads of this step to the system.
    fn enter(&mut self) -> Threads {
        let threads = self.threads.for_cloth(self.rounded.len());
        self.active.system.set_threads(threads);
        threads
    }

    /// Sets the wind of the step from this frame to the next.
    fn update_wind(&mut self) {
        let environment = &self.scene.environment;
        let now = environment.during_step(self.frame, self.scene.frame_rate);
        self.active.system.set_environment(now);
    }

    /// Lets handles go and takes hold as `targets` says. Gives the active handles of before, where
    /// they were others.
    fn change_active(
        &mut self,
        targets: &HandleTargets,
    ) -> Result<Option<ActiveHandles>, StepError> {
        if self.active.fits(targets) {
            return Ok(None);
        }
        let places = self.handle_places();
        let holds: Vec<bool> = (0..places.len()).map(|h| targets.holds(h)).collect();
        // What takes hold leads its vertex from where that is.
        for (handle, held) in self.active.holds().iter().enumerate() {
            if holds[handle] && !held {
                self.reached[handle] = places[handle];
            }
        }
        let mut active =
            ActiveHandles::new(&self.scene, holds).map_err(|error| error.at(self.frame + 1))?;
        active.system.stop_by(self.stop.clone());
        active.system.tape = self.active.system.tape.as_ref().map(|_| Box::default());
        Ok(Some(std::mem::replace(&mut self.active, active)))
    }

    /// Moves the state by a substep towards `self.targets`. On an error the state is unusable.
    fn solve(&mut self, part: Part) -> Result<Advance, StepError> {
        let (state, history) = (&mut self.state, &mut self.history);
        match &mut self.contact {
            None => {
                let targets = &self.targets;
                let solved = self.active.advance(part.dt, state, Some(history), targets);
                solved.map_err(|error| error.at(self.frame + 1))?;
                Ok(Advance::Done)
            }
            Some(contact) => {
                let span = Span {
                    part,
                    targets: &self.targets,
                    threads: self.threads.for_cloth(state.positions.len()),
                };
                contact.advance(span, &mut self.active, state, history)
            }
        }
    }

    fn round(&mut self) {
        for (rounded, position) in self.rounded.iter_mut().zip(&self.state.positions) {
            *rounded = position.as_vec3();
        }
    }

    /// Rounds the positions to f32. Where one is beyond f32, or the cloth meets in f32, undoes the
    /// frame.
    fn round_new(&mut self) -> Result<(), StepError> {
        self.round();
        let frame = self.frame + 1;
        let lost = self.rounded.iter().position(|p| !p.is_finite());
        let error = match lost.map(|vertex| VertexId(vertex as u32)) {
            Some(vertex) => StepError::NonFinite { frame, vertex },
            None => match self.meets_rounded(frame) {
                Some(error) => error,
                None => return Ok(()),
            },
        };
        self.put_back(FRAME);
        self.round();
        Err(error)
    }
}
