//! What a run needs beside positions and velocities to go on bit for bit: the state one substep
//! ago, what contact left, and the last solve.

use glam::DVec3;
use selvedge_cloth::{ContactMemory, VertexId};

use super::{Simulator, SimulatorError, check_state};
use crate::contact::Memory;

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

    /// As [`Self::previous`], without a copy: positions `[m]` and velocities `[m/s]`, `[vertices]`
    /// each, where the last substep was one of those into which the scene divides a frame.
    #[must_use]
    pub fn substep_before(&self) -> Option<(&[DVec3], &[DVec3])> {
        let whole = 1.0 / (self.scene.frame_rate * f64::from(self.scene.physics.substeps));
        let before = &self.history.before;
        self.history
            .fits(whole)
            .then_some((&before.positions[..], &before.velocities[..]))
    }

    /// Smooths `field`, `[vertices]`, as the last solve smoothed the motion: A⁻¹ M `field`, 0 where
    /// a handle holds; conjugate gradients leave a hundredth of the residual.
    ///
    /// Returns false, and leaves the field, where no solver has that matrix: before the first
    /// solve, and where the cloth is coupled by what it touches.
    ///
    /// # Panics
    /// When `field` does not have the size of the cloth.
    pub fn smooth(&mut self, field: &mut [DVec3]) -> bool {
        assert_eq!(field.len(), self.rounded.len(), "vertices");
        self.active.system.smooth(field)
    }

    /// The same cloth with what contact had left by then, which a run with contact needs to go on
    /// bit for bit; see [`Self::contact_memory`]. Without contact in the scene it is passed over,
    /// as are features that do not touch.
    ///
    /// # Errors
    /// [`SimulatorError::NonFinite`] for an anchor whose direction or pull is not finite in f32.
    pub fn with_contact_memory(mut self, memory: &ContactMemory) -> Result<Self, SimulatorError> {
        for anchor in &memory.anchors {
            let vertex = VertexId(anchor.of.numbers()[1]);
            for (what, value) in [
                ("direction of an anchor", anchor.normal),
                ("pull of an anchor", anchor.pull),
            ] {
                if !value.as_vec3().is_finite() {
                    return Err(SimulatorError::NonFinite {
                        what,
                        vertex,
                        value,
                    });
                }
            }
        }
        if let Some(contact) = &mut self.contact {
            contact.remember_saved(Memory::of_saved(memory));
        }
        Ok(self)
    }

    /// The memory that the last substep left for the contact of the next; none without contact, and
    /// where nothing touched.
    #[must_use]
    pub fn contact_memory(&self) -> Option<ContactMemory> {
        let memory = self.contact.as_ref()?.memory().saved();
        (memory != ContactMemory::default()).then_some(memory)
    }

    /// The same cloth with the last solve's changes of velocity `[m/s]`, `[vertices]`, over
    /// `seconds`, from which conjugate gradients begin; see [`Self::last_changes`].
    ///
    /// # Errors
    /// As for [`Self::with_previous`].
    pub fn with_last_changes(
        mut self,
        changes: &[DVec3],
        seconds: f64,
    ) -> Result<Self, SimulatorError> {
        let vertices = self.rounded.len();
        check_state("changes", "change", changes, vertices)?;
        if !(seconds.is_finite() && seconds > 0.0) {
            return Err(SimulatorError::PreviousSubstep { seconds });
        }
        self.active.system.put_changes(changes, seconds);
        Ok(self)
    }

    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and the time over which they
    /// came about `[s]`: with conjugate gradients the next solve begins from them. None where it
    /// begins from nothing.
    #[must_use]
    pub fn last_changes(&self) -> Option<(&[DVec3], f64)> {
        self.active.system.last_changes()
    }
}
