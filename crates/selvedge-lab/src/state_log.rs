//! A simulator with a log of its states: positions and velocities of every frame in f64. A
//! trajectory has positions in f32 and no velocities.

use selvedge_cloth::{HandleTargets, StepError, Stepper};
use selvedge_data::StateRun;
use selvedge_sim::Simulator;

/// A simulator and its states so far.
pub(crate) struct StateLog {
    simulator: Simulator,
    run: StateRun,
}

impl StateLog {
    /// Begins with the state now; every step adds one.
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

impl Stepper for StateLog {
    selvedge_cloth::delegate_stepper!(simulator);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.simulator.step(targets)?;
        self.keep();
        Ok(())
    }
}
