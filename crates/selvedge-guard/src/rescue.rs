//! The physics beside a guard: frames in place of lost ones, and contact on the way to others.
//!
//! It is the scene's own simulator, but that the air is implicit, which adds no energy at any
//! velocity.

use glam::Vec3;
use selvedge_cloth::{AirLaw, HandleTargets, Scene, StepError, Stepper, Stop};
use selvedge_sim::{Checkpoint, Led, Simulator, SimulatorError, Threads};

/// A simulator with buffers for its states.
pub(crate) struct Physics {
    simulator: Simulator,
    frame_rate: f64,
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
        let pairs = current.iter().zip(previous);
        let rate = self.frame_rate;
        let start = &mut self.start;
        start.frame = frame;
        start.positions.clear();
        start.positions.extend(current.iter().map(|p| p.as_dvec3()));
        start.velocities.clear();
        start
            .velocities
            .extend(pairs.map(|(p, q)| (p.as_dvec3() - q.as_dvec3()) * rate));
        let resumed = self.simulator.restore(start);
        resumed.map_err(|error| StepError::Solve {
            frame: frame + 1,
            cause: error.to_string(),
        })?;
        self.simulator.step(targets)?;
        Ok(self.simulator.positions())
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
}
