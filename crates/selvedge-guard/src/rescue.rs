//! The physics at a guard's side: a frame of it from the last good ones, and a few solves that relax a
//! prediction.
//!
//! It is the scene's own simulator, with the air taken implicitly (it then adds no energy, whatever
//! the velocities) and as many substeps as the scene says, never more: what strains too much is
//! limited afterwards.

use glam::{DVec3, Vec3};
use selvedge_cloth::{AirLaw, HandleTargets, Scene, StepError, Stepper, Substepping};
use selvedge_sim::{Simulator, SimulatorError, Threads};

/// A simulator and room for its states.
pub(crate) struct Physics {
    simulator: Simulator,
    frame_rate: f64,
    /// Length of a substep `[s]`.
    dt: f64,
    positions: Vec<DVec3>,
    velocities: Vec<DVec3>,
}

impl Physics {
    /// The physics of `scene`.
    pub(crate) fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let mut scene = scene.clone();
        scene.physics.air = AirLaw::Implicit;
        scene.physics.substepping = Substepping::Fixed;
        let mut simulator = Simulator::new(&scene)?;
        // Of the run that it is a part of.
        simulator.set_threads(Threads::Pool);
        Ok(Self {
            simulator,
            frame_rate: scene.frame_rate,
            dt: 1.0 / scene.frame_rate / f64::from(scene.physics.substeps),
            positions: Vec::new(),
            velocities: Vec::new(),
        })
    }

    /// The frame after frame `frame`, from the positions of the one before and of that one `[m]`,
    /// `[vertices]`, whose difference is the velocity, the handles going to `targets`.
    pub(crate) fn step(
        &mut self,
        frame: usize,
        [previous, current]: [&[Vec3]; 2],
        targets: &HandleTargets,
    ) -> Result<&[Vec3], StepError> {
        self.put(current);
        let pairs = current.iter().zip(previous);
        let rate = self.frame_rate;
        self.velocities.clear();
        self.velocities
            .extend(pairs.map(|(p, q)| (p.as_dvec3() - q.as_dvec3()) * rate));
        self.resume(frame)?;
        self.simulator.step(targets)?;
        Ok(self.simulator.positions())
    }

    /// Relaxes `positions` `[m]`, `[vertices]`, of frame `frame` in so many solves, each from rest:
    /// p ← argmin over x of Σ m |x - p|²/(2 dt²) + E(x), to first order, with E the energy of
    /// strain, bending and weight `[eq:guard-relaxation]`. What is strained most goes back most, and
    /// what is smooth hardly moves. Handles stay.
    pub(crate) fn relax(
        &mut self,
        frame: usize,
        solves: u32,
        handles: &[DVec3],
        positions: &mut [Vec3],
    ) -> Result<(), StepError> {
        self.put(positions);
        for _ in 0..solves {
            self.velocities.clear();
            self.velocities.resize(positions.len(), DVec3::ZERO);
            self.resume(frame)?;
            self.simulator.substep(self.dt, handles)?;
            self.positions.clear();
            self.positions
                .extend_from_slice(self.simulator.positions_f64());
        }
        positions.copy_from_slice(self.simulator.positions());
        Ok(())
    }

    fn put(&mut self, positions: &[Vec3]) {
        self.positions.clear();
        self.positions
            .extend(positions.iter().map(|p| p.as_dvec3()));
    }

    fn resume(&mut self, frame: usize) -> Result<(), StepError> {
        let resumed = self
            .simulator
            .resume(frame, &self.positions, &self.velocities);
        resumed.map_err(|error| StepError::Solve {
            frame,
            cause: error.to_string(),
        })
    }
}
