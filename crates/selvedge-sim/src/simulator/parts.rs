//! The substeps of a frame, of which one is halved where contact is too much for it.

use selvedge_cloth::HandleTargets;

use super::Simulator;
use super::contact::Part;
use super::substep_error::SubstepError;

/// Factor by which contact divides a frame before vertices are held back in it: a vertex that stays
/// while its neighbours go on is strained, and what is strained meets again.
const BEFORE_HOLDING: u32 = 8;

impl Simulator {
    /// Moves the state by a frame in `substeps` substeps, of which one is halved, and halves of it
    /// again, where contact is too much for it. Returns how many of the shortest make a frame. On
    /// an error the state is unusable.
    pub(super) fn advance(
        &mut self,
        targets: &HandleTargets,
        substeps: u32,
    ) -> Result<u32, SubstepError> {
        let most = self.scene.physics.most_substeps();
        self.forget_received();
        let mut finest = substeps;
        // Parts of the frame that are done, and how many of their length it has.
        let (mut done, mut parts) = (0, substeps);
        while done < parts {
            if self.stop.is_wanted() {
                return Err(SubstepError::Stopped);
            }
            let dt = 1.0 / self.scene.frame_rate / f64::from(parts);
            let fraction = f64::from(done + 1) / f64::from(parts);
            let reached = &self.reached;
            let path = |h: usize| targets.at(h, fraction, reached[h]);
            self.active.put_targets(&mut self.targets, path);
            let part = Part {
                from: f64::from(done) / f64::from(parts),
                to: fraction,
                may_hold: parts >= self.scene.physics.substeps * BEFORE_HOLDING || 2 * parts > most,
            };
            self.begin_part();
            match self.solve(dt, part) {
                Ok(()) => {
                    done += 1;
                    while parts > substeps && done % 2 == 0 {
                        (done, parts) = (done / 2, parts / 2);
                    }
                }
                Err(SubstepError::Contact(_)) if 2 * parts <= most => {
                    self.undo_part();
                    (done, parts) = (2 * done, 2 * parts);
                    finest = finest.max(parts);
                }
                Err(error) => return Err(error),
            }
        }
        let (began, bound) = (&self.saved.0.positions, self.scene.physics.max_strain);
        self.edges
            .check_stretch(began, &self.state.positions, bound)?;
        Ok(finest)
    }

    /// Keeps what [`Self::undo_part`] restores.
    fn begin_part(&mut self) {
        if let Some(contact) = &mut self.contact {
            self.part.0.copy_from(&self.state);
            self.part.1.copy_from(&self.history);
            contact.begin_part();
        }
    }

    /// Takes the cloth back to the start of the last part of a frame.
    fn undo_part(&mut self) {
        if let Some(contact) = &mut self.contact {
            self.state.copy_from(&self.part.0);
            self.history.copy_from(&self.part.1);
            self.active.system.forget_changes();
            contact.undo_part();
        }
    }
}
