//! Fields that are smoothed by the matrix of the last solve, as that smoothed the motion.

use glam::DVec3;

use super::{Solver, System, Touching};
use crate::solver::coupled::Factor as _;

/// Workspaces.
#[derive(Default)]
pub(super) struct Smoothing {
    /// M times the field, `[vertices]`.
    weighted: Vec<DVec3>,
    /// A⁻¹ times that, `[vertices]`.
    smoothed: Vec<DVec3>,
}

impl System {
    /// Replaces `field`, `[vertices]`, by A⁻¹ M `field` with the matrix A of the last solve, 0 where
    /// held; conjugate gradients leave a hundredth of the residual `[eq:smoothed-differences]`.
    ///
    /// Returns false, and leaves the field, where no solver has that matrix: before the first
    /// solve, where touches couple vertices, and where conjugate gradients fail.
    pub(crate) fn smooth(&mut self, field: &mut [DVec3]) -> bool {
        if self.solved_span == 0.0 || self.touches.couple_at_all() {
            return false;
        }
        let Smoothing { weighted, smoothed } = &mut self.smoothing;
        weighted.clear();
        let pairs = field.iter().zip(&self.elements.mass);
        weighted.extend(pairs.map(|(value, mass)| *value * *mass));
        smoothed.clear();
        smoothed.resize(field.len(), DVec3::ZERO);
        let touching = self.touching.as_mut().filter(|_| !self.touches.is_empty());
        let done = match (&mut self.solver, touching) {
            (Solver::Direct(direct), None) => {
                direct.solve_again(&self.pattern, weighted, smoothed);
                Ok(())
            }
            (Solver::Iterative(solver), _) => {
                solver.smooth(self.threads, &self.pattern, weighted, smoothed)
            }
            (Solver::Direct(_), Some(touching)) => {
                let Touching { pattern, solver } = touching.as_mut();
                solver.smooth(self.threads, pattern, weighted, smoothed)
            }
        };
        if done.is_err() {
            return false;
        }
        field.copy_from_slice(smoothed);
        true
    }
}
