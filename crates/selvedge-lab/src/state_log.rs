//! A simulator that keeps its states: positions and velocities of every frame in f64, which a
//! trajectory has in f32 or not at all.

use selvedge_cloth::{HandleTargets, StepError, Stepper};
use selvedge_data::StateRun;
use selvedge_sim::Simulator;

/// A simulator and the states that it has been in.
pub(crate) struct KeepingStates {
    simulator: Simulator,
    run: StateRun,
}

impl KeepingStates {
    /// Keeps the state now and that after every step.
    pub(crate) fn new(simulator: Simulator) -> Self {
        let mut keeping = Self {
            simulator,
            run: StateRun::default(),
        };
        keeping.keep();
        keeping
    }

    /// The states so far.
    pub(crate) fn into_run(self) -> StateRun {
        self.run
    }

    fn keep(&mut self) {
        let run = &mut self.run;
        run.positions.extend(self.simulator.positions_f64());
        run.velocities.extend(self.simulator.velocities_f64());
        run.frames.push(self.simulator.frame() as u32);
    }
}

impl Stepper for KeepingStates {
    selvedge_cloth::delegate_stepper!(simulator);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.simulator.step(targets)?;
        self.keep();
        Ok(())
    }
}
