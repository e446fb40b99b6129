//! Search for an equilibrium: long implicit steps without velocity.
//!
//! The linearised implicit step of [`crate::Simulator`] is repeated with the velocities set to zero
//! before each solve, x ← x + h² (M + h² K)⁻¹ F(x). With the long time steps used here it is nearly
//! Newton's method, except that K lacks the terms that would make it indefinite: the cloth leaves
//! an unstable equilibrium instead of finding it. Steps are limited in length. Near the end
//! Anderson's method accelerates them.
//!
//! If the search gets stuck, acceleration begins later, the last step damps or accelerates the next
//! ([`LastStep`]), and h is halved. There are two known causes: a kink of the material law, over
//! which a vertex steps to and fro and needs damping, and a slow way out of an unstable
//! equilibrium, which needs inertia. From outside they look alike, so both are tried in turn.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{LinearSolver, Scene, VertexId};

use super::anderson::Anderson;
use super::last_step::LastStep;
use super::start::sheet_size;
use super::{SagError, SagProgress, SaggedRest};
use crate::solver::{SolveError, System};
use crate::state::State;

/// Finds the pose in which no free vertex is accelerated, from `start` `[m]`, `[vertices]`.
pub(super) fn find_equilibrium(
    scene: &Scene,
    start: Vec<DVec3>,
    progress: &mut dyn FnMut(SagProgress) -> ControlFlow<()>,
) -> Result<SaggedRest, SagError> {
    let failed = |solves: u32, cause: SolveError| SagError::Solve {
        solves,
        cause: cause.to_string(),
    };
    let mut relaxation = Relaxation::new(scene, start).map_err(|cause| failed(0, cause))?;
    let (tolerance, mut solves) = (scene.sag.tolerance, 0);
    loop {
        let (residual, vertex) = relaxation.residual();
        let now = SagProgress {
            solves,
            residual,
            vertex,
            tolerance,
        };
        if progress(now).is_break() {
            return Err(SagError::Stopped { solves });
        }
        if residual <= tolerance {
            return Ok(SaggedRest {
                positions: relaxation.state.positions,
                solves,
                residual,
            });
        }
        if solves >= scene.sag.max_steps || !residual.is_finite() {
            return Err(SagError::NotConverged {
                solves,
                vertex,
                residual,
                tolerance,
            });
        }
        relaxation
            .step(residual)
            .map_err(|cause| failed(solves, cause))?;
        solves += 1;
    }
}

/// First time step `[s]`; longer ones gain nothing.
const TIME_STEP: f64 = 0.2;
/// Shortest time step `[s]`.
const SHORTEST_TIME_STEP: f64 = 0.1;
/// Longest step of a vertex, relative to the size of the sheet.
const LONGEST_STEP: f64 = 0.02;
/// Residual acceleration `[m/s²]` below which the iteration is smooth enough to be accelerated.
const ACCELERATE_BELOW: f64 = 3.0;
/// Steps that Anderson's method remembers.
const DEPTH: usize = 8;
/// Solves without a residual a tenth smaller than the best after which the search changes its way;
/// a quarter of it while accelerating.
const PATIENCE: u32 = 200;
/// Residual `[m/s²]` below which the last step has an influence, once patience has been lost.
const INFLUENCE_BELOW: f64 = 1.0;

/// Influence of the last step on the next.
#[derive(Clone, Copy, Debug)]
enum Influence {
    /// None: patience was not lost yet.
    None,
    /// [`LastStep::damp`].
    Damping,
    /// [`LastStep::accelerate`].
    Inertia,
}

/// The state of the search.
struct Relaxation {
    system: System,
    state: State,
    targets: Vec<DVec3>,
    anderson: Anderson,
    last_step: LastStep,
    influence: Influence,
    longest_step: f64,
    time_step: f64,
    /// Size of the last correction `[m]`.
    last_size: f64,
    accelerate_below: f64,
    best_residual: f64,
    solves_since_best: u32,
}

impl Relaxation {
    fn new(scene: &Scene, start: Vec<DVec3>) -> Result<Self, SolveError> {
        Ok(Self {
            system: System::with_solver(scene, LinearSolver::Cholesky)?,
            state: State::at_rest(start),
            targets: scene.handles.select(scene.mesh.positions()),
            anderson: Anderson::new(DEPTH),
            last_step: LastStep::new(scene.mesh.positions().len()),
            influence: Influence::None,
            longest_step: LONGEST_STEP * sheet_size(scene),
            time_step: TIME_STEP,
            last_size: f64::INFINITY,
            accelerate_below: ACCELERATE_BELOW,
            best_residual: f64::INFINITY,
            solves_since_best: 0,
        })
    }

    /// Assembles at the current positions. Gives the largest |F|/m of an unknown vertex `[m/s²]`, not a
    /// number where one of them is not, and the first vertex that has it. `[eq:sag-residual]`
    fn residual(&mut self) -> (f64, VertexId) {
        self.system
            .assemble(self.time_step, &self.state, &self.targets);
        let (impulses, mass) = (self.system.impulses(), self.system.mass());
        let mut largest = (0.0_f64, VertexId(0));
        for &vertex in self.system.unknown_vertices() {
            let v = vertex as usize;
            let value = impulses[v].length() / (self.time_step * mass[v]);
            if value > largest.0 || (value.is_nan() && !largest.0.is_nan()) {
                largest = (value, VertexId(vertex));
            }
        }
        largest
    }

    /// Takes the step that follows from what [`Self::residual`] assembled.
    fn step(&mut self, residual: f64) -> Result<(), SolveError> {
        self.system.solve(self.time_step)?;
        let mut correction = vec![DVec3::ZERO; self.state.positions.len()];
        for (v, change) in self.system.velocity_changes() {
            correction[v] = change * self.time_step;
        }
        let size = longest(&correction);
        if residual > self.accelerate_below || size > 2.0 * self.last_size {
            self.anderson.restart();
        }
        self.last_size = size;
        let mut step = self.anderson.step(&correction);
        if (self.accelerate_below..INFLUENCE_BELOW).contains(&residual) {
            match self.influence {
                Influence::None => (),
                Influence::Damping => self.last_step.damp(&correction, &mut step),
                Influence::Inertia => self.last_step.accelerate(&correction, &mut step),
            }
        }
        let scale = (self.longest_step / longest(&step)).min(1.0);
        for (position, entry) in self.state.positions.iter_mut().zip(&mut step) {
            *entry *= scale;
            *position += *entry;
        }
        self.last_step.taken(&step);
        self.anderson.taken(step, correction);
        self.lose_patience(residual);
        Ok(())
    }

    /// Counts the solves without progress; after too many, changes the way of the search.
    fn lose_patience(&mut self, residual: f64) {
        if residual < 0.9 * self.best_residual {
            self.best_residual = residual;
            self.solves_since_best = 0;
            return;
        }
        self.solves_since_best += 1;
        let accelerating = residual <= self.accelerate_below;
        let patience = if accelerating { PATIENCE / 4 } else { PATIENCE };
        if self.solves_since_best < patience {
            return;
        }
        self.influence = match self.influence {
            Influence::None | Influence::Inertia => Influence::Damping,
            Influence::Damping => Influence::Inertia,
        };
        if accelerating {
            self.accelerate_below = 0.1 * residual;
        } else {
            self.time_step = (0.5 * self.time_step).max(SHORTEST_TIME_STEP);
        }
        self.best_residual = residual;
        self.solves_since_best = 0;
        self.anderson.restart();
    }
}

fn longest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length()).fold(0.0, f64::max)
}
