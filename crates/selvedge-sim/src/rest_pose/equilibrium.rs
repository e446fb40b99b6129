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

use glam::DVec3;
use selvedge_cloth::{LinearSolver, Scene};

use crate::rest_pose::anderson::Anderson;
use crate::rest_pose::last_step::LastStep;
use crate::rest_pose::progress::{Largest, Listener, SagError, SagProgress, SaggedRest, tell};
use crate::rest_pose::start::sheet_size;
use crate::solver::{SolveError, System};
use crate::state::State;

/// Finds the pose in which no free vertex is accelerated, from `start` `[m]`, `[vertices]`.
pub(super) fn find_equilibrium(
    scene: &Scene,
    start: Vec<DVec3>,
    progress: Listener<'_>,
) -> Result<SaggedRest, SagError> {
    let mut solves = 0;
    let mut relaxation = Relaxation::new(scene, start)?;
    loop {
        let largest = relaxation.residual();
        let now = SagProgress {
            solves,
            residual: largest.value,
            vertex: largest.vertex,
            tolerance: scene.sag.tolerance,
        };
        tell(progress, now)?;
        if now.is_reached() {
            return Ok(now.rest(relaxation.state.positions));
        }
        if solves >= scene.sag.max_steps || !now.residual.is_finite() {
            return Err(now.not_converged());
        }
        let stepped = relaxation.step(now.residual);
        stepped.map_err(|cause| SagError::failed_solve(solves, &cause))?;
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
    fn new(scene: &Scene, start: Vec<DVec3>) -> Result<Self, SagError> {
        let system = System::with_solver(scene, LinearSolver::Cholesky)
            .map_err(|cause| SagError::failed_solve(0, &cause))?;
        Ok(Self {
            system,
            state: State {
                positions: start,
                velocities: vec![DVec3::ZERO; scene.mesh.positions().len()],
            },
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

    /// Assembles at the current positions. Gives the largest |F|/m of an unknown vertex.
    /// `[eq:sag-residual]`
    fn residual(&mut self) -> Largest {
        self.system
            .assemble(self.time_step, &self.state, &self.targets);
        let (impulses, mass) = (self.system.impulses(), self.system.mass());
        let unknown = self.system.unknown_vertices().iter().map(|&v| v as usize);
        Largest::of(unknown.map(|v| (v, impulses[v].length() / (self.time_step * mass[v]))))
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
