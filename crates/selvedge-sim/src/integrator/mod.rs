//! Formulas of a substep: backward Euler ([`System::advance`], or [`newton`] for its full
//! equations), and the [`second_order`] with its coefficients ([`two_step`]) and the [`history`]
//! that it needs.

mod edge_projection;
mod history;
mod newton;
mod second_order;
mod two_step;

use glam::DVec3;
use selvedge_cloth::{Integrator, Scene};

use crate::solver::{SolveError, System};
use crate::state::State;

pub(crate) use history::History;
pub use history::SubstepCounts;
pub(crate) use newton::Newton;
use second_order::{SecondOrder, Substep};
use two_step::TwoStep;

/// The formula that a scene asks for, with its workspaces.
pub(crate) struct Formula {
    newton: Option<Newton>,
    second_order: Option<SecondOrder>,
}

impl Formula {
    /// The formula of a validated scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let integrator = scene.physics.integrator;
        let vertices = scene.mesh.topology().vertex_count();
        Self {
            newton: integrator.newton().map(|s| Newton::new(s, vertices)),
            second_order: match integrator {
                Integrator::Linearised | Integrator::Newton(_) => None,
                Integrator::SecondOrder | Integrator::SecondOrderNewton(_) => {
                    Some(SecondOrder::new(scene, TwoStep::BDF2))
                }
                Integrator::GeneralisedAlpha(settings) => {
                    Some(SecondOrder::new(scene, TwoStep::of(settings)))
                }
            },
        }
    }

    /// Returns true if a substep depends on the state before the last one.
    pub(crate) fn looks_back(&self) -> bool {
        self.second_order.is_some()
    }

    /// Moves `state` by a substep over `dt` `[s]`, active handles to `targets` `[m]`. Gives γ, the
    /// factor `[s]` from a change of velocity to one of position in this substep. On an error state
    /// and history are unusable.
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        dt: f64,
        state: &mut State,
        history: &mut History,
        targets: &[DVec3],
    ) -> Result<f64, SolveError> {
        match &mut self.second_order {
            None => self.advance_first_order(system, dt, state, targets),
            Some(second_order) => second_order.advance(
                Substep {
                    system,
                    dt,
                    targets,
                },
                self.newton.as_mut(),
                state,
                history,
            ),
        }
    }

    /// As [`Self::advance`], by backward Euler whatever the scene asks for.
    pub(crate) fn advance_first_order(
        &mut self,
        system: &mut System,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<f64, SolveError> {
        match &mut self.newton {
            None => system.advance(dt, state, targets)?,
            Some(newton) => newton.advance(system, dt, state, targets)?,
        }
        Ok(dt)
    }
}
