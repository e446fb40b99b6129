//! Newton's method for the equations of a backward Euler step,
//! M (v - v₀) = dt (f_ext + F(x₀ + dt v) + c J v), with a line search.
//!
//! The first solve is the linearised step itself; each further one starts from the end of the last.
//! J is the positive semidefinite Jacobian of the laws with the looked-up stiffness held constant.
//! No energy has these forces as its gradient, so the line search reduces the residual
//! √(Σ |b|²/m / Σ m): steps are halved until it falls. Near a solution convergence is linear, not
//! quadratic.

use selvedge_cloth::Newton as Settings;

use glam::DVec3;

use crate::solver::system::{SolveError, System};
use crate::state::State;

/// The method with its workspaces.
pub(crate) struct Newton {
    settings: Settings,
    /// Start of the step.
    from: State,
    /// Start of the line search.
    base: State,
}

/// Shortest step of the line search. It is taken in any case.
const SHORTEST: f64 = 1.0 / 64.0;

impl Newton {
    /// The method for a cloth with this number of vertices.
    pub(crate) fn new(settings: Settings, vertices: usize) -> Self {
        let state = || State {
            positions: vec![DVec3::ZERO; vertices],
            velocities: vec![DVec3::ZERO; vertices],
        };
        Self {
            settings,
            from: state(),
            base: state(),
        }
    }

    /// Moves `state` over `dt` `[s]`, handles to `targets` `[m]`. On an error the state is
    /// unusable.
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        self.from.copy_from(state);
        system.advance(dt, state, targets)?;
        system.linearise_again(dt, &self.from, state, targets);
        let mut lack = system.lack();
        let mut iterations = 1;
        while lack > self.settings.tolerance || lack.is_nan() {
            if iterations >= self.settings.max_iterations {
                return Err(SolveError::Newton {
                    iterations,
                    lack,
                    tolerance: self.settings.tolerance,
                });
            }
            system.forget_changes();
            system.solve()?;
            self.base.copy_from(state);
            let mut part = 1.0;
            loop {
                system.apply(dt * part, part, &self.base, state);
                system.linearise_again(dt, &self.from, state, targets);
                let next = system.lack();
                if next < lack || part <= SHORTEST {
                    lack = next;
                    break;
                }
                part *= 0.5;
            }
            iterations += 1;
        }
        system.remember_changes(dt, &self.from, state);
        Ok(())
    }
}
