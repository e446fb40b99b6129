//! A simulator with a log of its states: positions and velocities of every frame in f64. A
//! trajectory has positions in f32 and no velocities.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Scene, StepError, Stepper};
use selvedge_data::{LastChanges, PreviousState, SavedState, StateRun};
use selvedge_sim::{Checkpoint, PreviousSubstep, Simulator, SimulatorError};

/// A simulator, and its states so far where they are kept.
pub(crate) struct StateLog {
    pub(crate) simulator: Simulator,
    pub(crate) states: Option<StateRun>,
}

impl StateLog {
    /// Begins with the state now; every step adds one.
    pub(crate) fn new(simulator: Simulator, keeps_states: bool) -> Self {
        let states = keeps_states.then(StateRun::default);
        let mut log = Self { simulator, states };
        log.keep();
        log
    }

    fn keep(&mut self) {
        if let Some(run) = &mut self.states {
            run.states.push(saved_state(&self.simulator));
        }
    }
}

/// The state of `simulator` now, from which a run can go on bit for bit.
pub fn saved_state(simulator: &Simulator) -> SavedState {
    let Checkpoint {
        frame,
        positions,
        velocities,
        previous,
        changes,
        contact,
        obstacles: _,
    } = simulator.checkpoint();
    SavedState {
        positions,
        velocities,
        frame,
        previous: previous.map(|before| PreviousState {
            positions: before.positions,
            velocities: before.velocities,
            seconds: before.seconds,
        }),
        contact,
        changes: changes.map(|(velocities, seconds)| LastChanges {
            velocities,
            seconds,
        }),
    }
}

/// A simulator of `scene` in `state`, with frames counted from there.
pub fn simulator_in(scene: &Scene, state: SavedState) -> Result<Simulator, SimulatorError> {
    simulator_among(scene, state, &[])
}

/// The physics of a run of `scene` from `state` on: as [`simulator_in`], handles and obstacles
/// where the motion has them by then.
pub fn simulator_of_run(scene: &Scene, state: SavedState) -> Result<Simulator, SimulatorError> {
    let frame = state.frame;
    simulator_in(scene, state)?.taken_up_at(frame)
}

/// As [`simulator_in`], the first obstacles at `offsets` `[m]` from their own paths.
pub fn simulator_among(
    scene: &Scene,
    state: SavedState,
    offsets: &[DVec3],
) -> Result<Simulator, SimulatorError> {
    let checkpoint = Checkpoint {
        frame: state.frame,
        positions: state.positions,
        velocities: state.velocities,
        previous: state.previous.map(|before| PreviousSubstep {
            positions: before.positions,
            velocities: before.velocities,
            seconds: before.seconds,
        }),
        changes: state.changes.map(|last| (last.velocities, last.seconds)),
        contact: state.contact,
        obstacles: offsets.to_vec(),
    };
    Simulator::from_checkpoint(scene, &checkpoint)
}

impl Stepper for StateLog {
    selvedge_cloth::delegate_stepper!(simulator);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.simulator.step(targets)?;
        self.keep();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use selvedge_cloth::conformance::{HandlesEnd, check};

    use super::*;
    use crate::test_scene::hanging;

    #[test]
    fn a_simulator_with_a_log_conforms() {
        let scene = hanging();
        let make = || StateLog::new(Simulator::new(&scene).unwrap(), true);
        assert_eq!(check(make, HandlesEnd::AtTargets), Ok(()));
    }

    #[test]
    fn a_step_that_fails_leaves_no_state() {
        let scene = hanging();
        let mut log = StateLog::new(Simulator::new(&scene).unwrap(), true);
        let none = HandleTargets::at_frame_end(Vec::new()).unwrap();
        assert!(log.step(&none).is_err());
        let held = scene.handles.select(scene.mesh.positions());
        log.step(&HandleTargets::at_frame_end(held).unwrap())
            .unwrap();
        let frames: Vec<usize> = log.states.unwrap().states.iter().map(|s| s.frame).collect();
        assert_eq!(frames, [0, 1]);
    }
}
