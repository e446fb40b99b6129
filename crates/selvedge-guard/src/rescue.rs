//! The physics beside a guard: frames in place of lost ones, and contact on the way to others.
//!
//! It is the scene's own simulator, but that the air is implicit, which adds no energy at any
//! velocity.

use glam::Vec3;
use selvedge_cloth::{AirLaw, HandleTargets, Scene, StepError, Stepper};
use selvedge_sim::{Checkpoint, Simulator, SimulatorError, Threads};

/// A simulator with buffers for its states.
pub(crate) struct Physics {
    pub(crate) simulator: Simulator,
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
}
