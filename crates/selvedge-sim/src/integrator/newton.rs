//! Newton's method for the equations of a [`Stage`], M (v - v̄) = γ (f_ext + F(x̄ + γ v) + c J v),
//! with a line search.
//!
//! Each solve starts from the end of the last. J is the positive semidefinite Jacobian of the laws
//! with the looked-up stiffness held constant. No energy has these forces as its gradient, so the
//! line search reduces the residual √(Σ |b|²/m / Σ m): steps are halved until it falls. Near a
//! solution convergence is linear, not quadratic.

use selvedge_cloth::Newton as Settings;

use glam::DVec3;

use crate::solver::{SolveError, Stage, StageAir, System};
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
        Self {
            settings,
            from: State::at_origin(vertices),
            base: State::at_origin(vertices),
        }
    }

    /// Moves `state` by backward Euler over `dt` `[s]`, handles to `targets` `[m]`. The first solve
    /// is the linearised step itself. On an error the state is unusable.
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        self.from.copy_from(state);
        system.advance(dt, state, targets)?;
        let stage = Stage {
            gamma: dt,
            velocities: &self.from.velocities,
            air: StageAir::OfStart(&self.from),
        };
        correct(self.settings, &mut self.base, system, stage, state, targets)?;
        system.remember_changes(dt, &self.from, state);
        Ok(())
    }

    /// Moves `state`, the end of a first solve of `stage`, to the solution. On an error the state
    /// is unusable.
    pub(crate) fn correct(
        &mut self,
        system: &mut System,
        stage: Stage<'_>,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        correct(self.settings, &mut self.base, system, stage, state, targets)
    }
}

fn correct(
    settings: Settings,
    base: &mut State,
    system: &mut System,
    stage: Stage<'_>,
    state: &mut State,
    targets: &[DVec3],
) -> Result<(), SolveError> {
    system.linearise(stage, state, targets);
    let mut lack = system.lack();
    let mut iterations = 1;
    while lack > settings.tolerance || lack.is_nan() {
        if iterations >= settings.max_iterations {
            return Err(SolveError::Newton {
                iterations,
                lack,
                tolerance: settings.tolerance,
            });
        }
        system.forget_changes();
        system.solve(stage.gamma)?;
        base.copy_from(state);
        let mut part = 1.0;
        loop {
            system.apply(stage.gamma * part, part, base, state);
            system.linearise(stage, state, targets);
            let next = system.lack();
            if next < lack || part <= SHORTEST {
                lack = next;
                break;
            }
            part *= 0.5;
        }
        iterations += 1;
    }
    Ok(())
}
