//! The state one substep ago, which a run of second order needs to go on bit for bit.

use glam::DVec3;

use super::{Simulator, SimulatorError, check_state};

/// The state of a cloth one substep ago.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviousSubstep {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Length of the substep that led from there `[s]`.
    pub seconds: f64,
}

impl Simulator {
    /// The same cloth with the state one substep ago, which a run of second order needs to go on
    /// bit for bit; see [`Self::previous`]. A run of first order does not look at it.
    ///
    /// # Errors
    /// As for [`Self::with_state`]; also a length of the substep that is not finite and positive.
    pub fn with_previous(mut self, previous: &PreviousSubstep) -> Result<Self, SimulatorError> {
        let vertices = self.rounded.len();
        let PreviousSubstep {
            positions,
            velocities,
            seconds,
        } = previous;
        check_state(
            "previous positions",
            "previous position",
            positions,
            vertices,
        )?;
        check_state(
            "previous velocities",
            "previous velocity",
            velocities,
            vertices,
        )?;
        if !(seconds.is_finite() && *seconds > 0.0) {
            return Err(SimulatorError::PreviousSubstep { seconds: *seconds });
        }
        self.history.before.positions.copy_from_slice(positions);
        self.history.before.velocities.copy_from_slice(velocities);
        self.history.set_last_substep(*seconds);
        Ok(self)
    }

    /// Drops the state one substep ago: the next substep starts anew.
    pub fn forget_previous(&mut self) {
        self.history.forget();
    }

    /// State before the last substep; none with an integrator of first order, before the first
    /// substep, and where the next one does not look back.
    #[must_use]
    pub fn previous(&self) -> Option<PreviousSubstep> {
        self.history.last_substep().map(|seconds| PreviousSubstep {
            positions: self.history.before.positions.clone(),
            velocities: self.history.before.velocities.clone(),
            seconds,
        })
    }
}
