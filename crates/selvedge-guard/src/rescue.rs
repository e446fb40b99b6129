//! The physics beside a guard: frames in place of lost ones, and solves that relax a prediction.
//!
//! It is the scene's own simulator, but that the air is implicit, which adds no energy at any
//! velocity.

use glam::{DVec3, Vec3};
use selvedge_cloth::{AirLaw, HandleTargets, Scene, StepError, Stepper, Stop};
use selvedge_sim::{Checkpoint, Led, Simulator, SimulatorError, Threads};

/// A simulator with buffers for its states.
pub(crate) struct Physics {
    simulator: Simulator,
    frame_rate: f64,
    /// Length of a substep `[s]`.
    dt: f64,
    /// Where the next step begins.
    start: Checkpoint,
}

impl Physics {
    /// Sets up the physics of `scene`.
    pub(crate) fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let mut scene = scene.clone();
        scene.physics.air = AirLaw::Implicit;
        let mut simulator = Simulator::new(&scene)?;
        // The pool of the run that the guard is part of.
        simulator.set_threads(Threads::Pool);
        Ok(Self {
            simulator,
            frame_rate: scene.frame_rate,
            dt: 1.0 / scene.frame_rate / f64::from(scene.physics.substeps),
            start: Checkpoint::default(),
        })
    }

    /// Lets solves end with an error from when `stop` is wanted.
    pub(crate) fn stop_by(&mut self, stop: Stop) {
        self.simulator.stop_by(stop);
    }

    /// Computes the frame after `frame`. `current` `[m]`, `[vertices]`, is that frame and
    /// `previous` the one before it; their difference gives the velocity.
    pub(crate) fn step(
        &mut self,
        frame: usize,
        previous: &[Vec3],
        current: &[Vec3],
        targets: &HandleTargets,
    ) -> Result<&[Vec3], StepError> {
        self.put(current);
        let pairs = current.iter().zip(previous);
        let rate = self.frame_rate;
        self.start.velocities.clear();
        self.start
            .velocities
            .extend(pairs.map(|(p, q)| (p.as_dvec3() - q.as_dvec3()) * rate));
        self.resume(frame)?;
        self.simulator.step(targets)?;
        Ok(self.simulator.positions())
    }

    /// Relaxes `positions` `[m]`, `[vertices]`, of frame `frame` in `solves` solves, each from
    /// rest: p ← argmin over x of Σ m |x - p|²/(2 dt²) + E(x), to first order, with E the energy of
    /// strain, bending and weight `[eq:guard-relaxation]`. Strong strains recede most; smooth cloth
    /// hardly moves. Handles go to `handles` `[m]`. On an error `positions` stay.
    pub(crate) fn relax(
        &mut self,
        frame: usize,
        solves: u32,
        handles: &[DVec3],
        positions: &mut [Vec3],
    ) -> Result<(), StepError> {
        self.put(positions);
        for _ in 0..solves {
            let relaxed = self.relax_once(frame, handles);
            relaxed.map_err(|error| error.at_frame(frame))?;
        }
        positions.copy_from_slice(self.simulator.positions());
        Ok(())
    }

    /// One solve from rest, from the positions of the start and back into them.
    fn relax_once(&mut self, frame: usize, handles: &[DVec3]) -> Result<(), StepError> {
        self.start.velocities.clear();
        let vertices = self.start.positions.len();
        self.start.velocities.resize(vertices, DVec3::ZERO);
        self.resume(frame)?;
        self.simulator.substep(self.dt, handles)?;
        self.start
            .positions
            .copy_from_slice(self.simulator.positions_f64());
        Ok(())
    }

    /// Checks that nothing meets in `positions` `[m]`, `[vertices]`, of frame `frame`.
    pub(crate) fn check_apart(&self, frame: usize, positions: &[Vec3]) -> Result<(), StepError> {
        self.simulator.check_apart(frame, positions)
    }

    /// Holds `to`, the frame after `frame`, to contact on its way from `from`
    /// ([`Simulator::lead`]).
    pub(crate) fn lead(
        &mut self,
        frame: usize,
        from: &[Vec3],
        to: &mut [Vec3],
    ) -> Result<Led, StepError> {
        self.simulator.lead(frame, from, to)
    }

    fn put(&mut self, positions: &[Vec3]) {
        self.start.positions.clear();
        self.start
            .positions
            .extend(positions.iter().map(|p| p.as_dvec3()));
    }

    fn resume(&mut self, frame: usize) -> Result<(), StepError> {
        self.start.frame = frame;
        let resumed = self.simulator.restore(&self.start);
        resumed.map_err(|error| StepError::Solve {
            frame: frame + 1,
            cause: error.to_string(),
        })
    }
}
