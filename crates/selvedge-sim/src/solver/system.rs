//! One linearised backward Euler solve (Baraff and Witkin 1998, as ARCSim has it):
//! A Δv = b with
//!   A = M - Σ dt (dt + c) J + dt² K_handles,
//!   b = dt f_ext + Σ dt (F + (dt + c) J v) - dt k (x_h - target + dt v_h).
//! Linearised at an estimate of its end, it is a step towards the solution of an implicit stage
//! ([`System::linearise`]).
//!
//! Exact handles are eliminated. They are no unknowns; in the product J v they move with the
//! velocity that takes them to their targets, as their column of A would contribute. The pattern of
//! A is made once; assembling and solving allocate nothing.

use glam::DVec3;
use selvedge_cloth::{
    AirLaw, Environment, HandleConstraint, Handles, LinearSolver, Scene, Stop, VertexId,
};

use crate::contact::Collisions;
use crate::integrator::{SolveTape, Tape};
use crate::laws::external::AirResistance;
use crate::solver::conjugate_gradients::ConjugateGradients;
use crate::solver::direct::{Complete, Coupling, Direct, Springs};
use crate::solver::elements::{Elements, Linearisation};
use crate::solver::ordering::Ordering;
use crate::solver::pattern::Pattern;
use crate::solver::{ElementSums, Residual, SolveError};
use crate::state::State;
use crate::threads::Threads;

/// Stiffness of a spring handle, per axis `[N/m]`.
pub(crate) const HANDLE_STIFFNESS: f64 = 1e3;

/// Tolerance of the automatic choice `[m/s]`. With 1e-5 m/s held cloth hums for ever, by half a
/// millimetre per second.
const AUTOMATIC_TOLERANCE: f64 = 1e-7;
/// The same in second order with contact, whose systems are harder to solve.
const CONTACT_TOLERANCE: f64 = 3e-7;

/// Speed `[m/s]` to which the right side of an adjoint solve is brought, whose tolerance is 1e-7 m/s.
const ADJOINT_SPEED: f64 = 1e1;

/// The system of a cloth, assembled and solved again and again.
pub(crate) struct System {
    elements: Elements,
    pattern: Pattern,
    handles: Handles,
    constraint: HandleConstraint,
    air: AirLaw,
    threads: Threads,
    /// b, `[vertices]` `[N s]`.
    impulses: Vec<DVec3>,
    /// Velocities, for exact handles those of the step `[m/s]`, `[vertices]`.
    driven: Vec<DVec3>,
    /// Δv of the last solve, `[vertices]` `[m/s]`; 0 where held.
    changes: Vec<DVec3>,
    /// Time over which the Δv of the last solve come about `[s]`; 0 if the next one starts from
    /// nothing.
    solved_span: f64,
    solver: Solver,
    /// A factor of the whole, for a direct solver whose collisions couple vertices that its pattern does
    /// not, and where conjugate gradients with collisions do not converge.
    complete: Complete,
    /// Pairs that push in the solves that follow.
    pub(crate) collisions: Collisions,
    repeated: Repeated,
    /// What the substeps leave for their derivatives, where someone wants them.
    pub(crate) tape: Option<Box<Tape>>,
}

/// Parts that a solve repeated from the same start has in common with the last one.
#[derive(Default)]
struct Repeated {
    /// True if the next assembly is from the same start as the last one.
    is_next: bool,
    /// True if the last assembly was one from a start that was assembled before.
    is_now: bool,
    /// Length of the solve whose start was assembled last `[s]`; none before, and where it was not
    /// kept.
    dt: Option<f64>,
    /// b without what touches, `[vertices]` `[N s]`.
    impulses: Vec<DVec3>,
}

/// Method for A Δv = b.
enum Solver {
    Direct(Box<Direct>),
    Iterative(Box<ConjugateGradients>),
}

impl System {
    /// The system of a validated scene, with the solver of its settings.
    pub(crate) fn new(scene: &Scene) -> Result<Self, SolveError> {
        Self::with_solver(scene, scene.physics.solver)
    }

    /// The system of a validated scene, with this solver in place of that of its settings.
    pub(crate) fn with_solver(scene: &Scene, solver: LinearSolver) -> Result<Self, SolveError> {
        let mesh = &scene.mesh;
        let constraint = scene.physics.handles;
        let vertex_count = mesh.topology().vertex_count();
        let held = match constraint {
            HandleConstraint::Exact => scene.handles.mask(vertex_count),
            HandleConstraint::Spring => vec![false; vertex_count],
        };
        let settings = match solver {
            LinearSolver::Cholesky => None,
            LinearSolver::Automatic => Some(automatic(scene)),
            LinearSolver::ConjugateGradients(settings) => Some(settings),
        };
        let ordering = match settings {
            None => Ordering::Dissection,
            Some(_) => Ordering::Banded,
        };
        let elements = Elements::new(scene);
        let triangles = mesh.topology().face_indices();
        let hinges: Vec<[u32; 4]> = elements.hinges.corners().collect();
        let pattern = Pattern::new(ordering, &held, &triangles, &hinges);
        Ok(Self {
            solver: match settings {
                None => Solver::Direct(Box::new(Direct::new(&pattern, &elements))),
                Some(settings) => Solver::Iterative(Box::new(ConjugateGradients::new(
                    settings, &pattern, &elements,
                ))),
            },
            elements,
            pattern,
            complete: Complete::new(held, triangles, hinges),
            handles: scene.handles.clone(),
            constraint,
            air: scene.physics.air,
            threads: Threads::One,
            impulses: vec![DVec3::ZERO; vertex_count],
            driven: vec![DVec3::ZERO; vertex_count],
            changes: vec![DVec3::ZERO; vertex_count],
            solved_span: 0.0,
            collisions: Collisions::default(),
            repeated: Repeated::default(),
            tape: None,
        })
    }

    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub(crate) fn mass(&self) -> &[f64] {
        &self.elements.mass
    }

    /// Vertices that are unknowns.
    pub(crate) fn unknown_vertices(&self) -> &[u32] {
        self.pattern.vertices()
    }

    /// Positions of the active handles `[m]`, `[handles]`.
    pub(crate) fn handle_positions(&self, state: &State) -> impl Iterator<Item = DVec3> {
        let vertices = self.handles.vertices().iter();
        vertices.map(|vertex| state.positions[vertex.index()])
    }

    /// Sets gravity and air for the solves that follow. Gusts are ignored.
    pub(crate) fn set_environment(&mut self, environment: Environment) {
        self.elements.set_environment(environment);
    }

    /// Sets the threads of the solves that follow. The result is the same.
    pub(crate) fn set_threads(&mut self, threads: Threads) {
        self.threads = threads;
    }

    /// Lets long solves end with an error from when `stop` is wanted.
    pub(crate) fn stop_by(&mut self, stop: Stop) {
        if let Solver::Iterative(solver) = &mut self.solver {
            solver.stop_by(stop);
        }
    }

    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and their time `[s]`, 0 where the
    /// next solve starts from nothing.
    pub(crate) fn changes(&self) -> (&[DVec3], f64) {
        (&self.changes, self.solved_span)
    }

    /// Assembles b at `state` for a solve over `dt` `[s]` with handles going to `targets` `[m]`,
    /// and evaluates the elements of A.
    pub(crate) fn assemble(&mut self, dt: f64, state: &State, targets: &[DVec3]) {
        let _span = tracing::trace_span!("assembly").entered();
        let is_same = std::mem::take(&mut self.repeated.is_next);
        self.repeated.is_now = is_same && self.repeated.dt == Some(dt);
        if self.repeated.is_now {
            self.impulses.copy_from_slice(&self.repeated.impulses);
        } else {
            self.assemble_anew(dt, state, targets);
        }
        if !self.collisions.is_empty() {
            let driven = &self.driven;
            let place = |v: usize| state.positions[v] + driven[v] * dt;
            self.collisions.begin_stage();
            self.collisions
                .linearise(dt, driven.len(), place, &mut self.impulses);
        }
    }

    /// Lets the next assembly know that it is from the same start as the last one, with the same
    /// targets, if over the same time: only what touches is another.
    pub(crate) fn repeat_start(&mut self) {
        self.repeated.is_next = true;
    }

    /// As [`Self::assemble`], without what touches.
    fn assemble_anew(&mut self, dt: f64, state: &State, targets: &[DVec3]) {
        self.driven.copy_from_slice(&state.velocities);
        if self.constraint == HandleConstraint::Exact {
            for (vertex, target) in self.handles.vertices().iter().zip(targets) {
                let v = vertex.index();
                self.driven[v] = (*target - state.positions[v]) / dt;
            }
        }
        if !self.knows_next() {
            let at = at_start(self.air, dt, state, &self.driven);
            self.elements.evaluate(self.threads, at, &mut self.impulses);
        }
        self.push_springs(dt, targets, |v| {
            state.positions[v] + state.velocities[v] * dt
        });
        self.repeated.dt = None;
        if !self.collisions.is_empty() {
            self.repeated.dt = Some(dt);
            self.repeated.impulses.clear();
            self.repeated.impulses.extend_from_slice(&self.impulses);
        }
    }

    /// Assembles b = M (v̄ - v) + γ (f_ext + F + c J v), the residual of the equations of an
    /// implicit stage, M (v - v̄) = γ (f_ext + F(x) + c J v) with x = x̄ + γ v, at the estimate
    /// `now`, and evaluates the elements of A = M - Σ γ (γ + c) J + γ D_air + γ² K_handles. A Δv = b
    /// is Newton's step, for handles going to `targets` `[m]`; `velocities` is v̄ `[m/s]`,
    /// `[vertices]`. An estimate satisfies the second equation already, so that x̄ is not needed.
    /// `[eq:newton]`
    pub(crate) fn linearise(
        &mut self,
        gamma: f64,
        velocities: &[DVec3],
        now: &State,
        targets: &[DVec3],
    ) {
        let _span = tracing::trace_span!("assembly").entered();
        self.repeated = Repeated {
            impulses: std::mem::take(&mut self.repeated.impulses),
            ..Repeated::default()
        };
        if !self.knows_next() {
            let at = at_end(gamma, now);
            self.elements.evaluate(self.threads, at, &mut self.impulses);
        }
        for (v, impulse) in self.impulses.iter_mut().enumerate() {
            *impulse += (velocities[v] - now.velocities[v]) * self.elements.mass[v];
        }
        self.push_springs(gamma, targets, |v| now.positions[v]);
        if !self.collisions.is_empty() {
            let place = |v: usize| now.positions[v];
            self.collisions
                .linearise(gamma, velocities.len(), place, &mut self.impulses);
        }
    }

    /// Solves A λ = `right` with the matrix of the last linearisation, `[vertices]`, to 1e-8 of the
    /// change of velocity that `right` would give free masses, from the last λ on. λ is 0 where held.
    pub(crate) fn solve_adjoint(&mut self, right: &[DVec3]) -> Result<Vec<DVec3>, SolveError> {
        let mass = &self.elements.mass;
        let squares = right.iter().zip(mass).map(|(g, m)| g.length_squared() / m);
        let size = (squares.sum::<f64>() / mass.iter().sum::<f64>()).sqrt();
        if size == 0.0 {
            return Ok(vec![DVec3::ZERO; right.len()]);
        }
        // The tolerance of the solver is in m/s.
        let scale = ADJOINT_SPEED / size;
        for (impulse, right) in self.impulses.iter_mut().zip(right) {
            *impulse = *right * scale;
        }
        self.changes.iter_mut().for_each(|change| *change *= scale);
        self.solved_span = 1.0;
        self.solve(1.0)?;
        self.changes.iter_mut().for_each(|change| *change /= scale);
        Ok(self.changes.clone())
    }

    /// Keeps the solve linearised at `at`, the `first` of its stage, where someone wants it.
    pub(crate) fn record(&mut self, first: bool, at: &State) {
        if let Some(tape) = &mut self.tape {
            tape.solved(first, at, &self.collisions);
        }
    }

    /// Adds the derivatives of λᵀ(b - A Δv) of [`Self::linearise`] by where it is linearised and by
    /// v̄ to those two, and by the elements to `sums`. Returns γ k of spring handles, else 0.
    pub(crate) fn pull_stage(
        &self,
        gamma: f64,
        velocities: &[DVec3],
        solve: &SolveTape,
        multipliers: &[DVec3],
        (by, by_base, sums): (&mut State, &mut [DVec3], &mut ElementSums),
    ) -> f64 {
        let residual = Residual {
            at: at_end(gamma, &solve.at),
            base: Some(velocities),
            changes: &solve.changes,
            multipliers,
        };
        self.elements.pull_back(&residual, by, Some(by_base), sums);
        self.spring(gamma)
    }

    /// The same of [`Self::assemble`], by positions and by the velocities that lead exact handles.
    pub(crate) fn pull_euler(
        &self,
        dt: f64,
        start: &State,
        solve: &SolveTape,
        multipliers: &[DVec3],
        (by, sums): (&mut State, &mut ElementSums),
    ) -> f64 {
        let residual = Residual {
            at: at_start(self.air, dt, start, &self.driven),
            base: None,
            changes: &solve.changes,
            multipliers,
        };
        self.elements.pull_back(&residual, by, None, sums);
        self.spring(dt)
    }

    fn spring(&self, dt: f64) -> f64 {
        match self.constraint {
            HandleConstraint::Exact => 0.0,
            HandleConstraint::Spring => dt * HANDLE_STIFFNESS,
        }
    }

    /// The elements.
    pub(crate) fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Vertices of the active handles.
    pub(crate) fn handle_vertices(&self) -> &[VertexId] {
        self.handles.vertices()
    }

    /// How handles hold.
    pub(crate) fn constraint(&self) -> HandleConstraint {
        self.constraint
    }

    fn push_springs(&mut self, dt: f64, targets: &[DVec3], predicted: impl Fn(usize) -> DVec3) {
        if self.constraint == HandleConstraint::Spring {
            for (vertex, target) in self.handles.vertices().iter().zip(targets) {
                let v = vertex.index();
                self.impulses[v] -= (predicted(v) - *target) * (dt * HANDLE_STIFFNESS);
            }
        }
    }

    /// Energy of stretching and bending at `positions` `[m]`, `[vertices]`, in J; none if the law
    /// has no energy.
    pub(crate) fn elastic_energy(&self, positions: &[DVec3]) -> Option<f64> {
        self.elements.elastic_energy(positions)
    }

    /// The assembled right side b `[N s]`, `[vertices]`; without meaning at held vertices.
    pub(crate) fn impulses(&self) -> &[DVec3] {
        &self.impulses
    }

    /// Solves the assembled system; [`Self::velocity_changes`] gives the solution. Its Δv come
    /// about within `span` `[s]`, which scales the last solution to a first guess.
    pub(crate) fn solve(&mut self, span: f64) -> Result<(), SolveError> {
        let known = self.tape.as_mut().and_then(|tape| tape.known.next());
        if let Some(changes) = &known {
            self.changes.copy_from_slice(changes);
        }
        let solved = if known.is_some() { Ok(()) } else { self.solve_anew(span) };
        if let Some(tape) = &mut self.tape {
            let changes = known.unwrap_or_else(|| self.changes[..].into());
            tape.keep(solved.is_ok().then_some(changes));
        }
        solved?;
        self.solved_span = span;
        Ok(())
    }

    /// Returns true if the Δv of the next solve is known, so that nothing is to be assembled.
    fn knows_next(&self) -> bool {
        let tape = self.tape.as_ref();
        tape.is_some_and(|tape| !tape.known.as_slice().is_empty())
    }

    fn solve_anew(&mut self, span: f64) -> Result<(), SolveError> {
        self.check_impulses()?;
        let is_direct = matches!(self.solver, Solver::Direct(_));
        if is_direct && self.collisions.couple() {
            self.solve_whole()?;
        } else {
            match self.solve_as_set(span) {
                Err(SolveError::Failed(_)) if !is_direct && self.collisions.couple_at_all() => {
                    self.solve_whole()?;
                }
                other => other?,
            }
        }
        Ok(())
    }

    /// As [`Self::solve`], by a factor of the whole matrix with all collisions.
    fn solve_whole(&mut self) -> Result<(), SolveError> {
        let _span = tracing::trace_span!("complete factor").entered();
        let dt = self.elements.time_step();
        let coupling = Coupling {
            threads: self.threads,
            elements: &self.elements,
            springs: springs(self.constraint, &self.handles, dt),
            collisions: &self.collisions,
        };
        self.complete
            .solve(&coupling, &self.impulses, &mut self.changes)
    }

    /// As [`Self::solve`], by the solver of the settings.
    fn solve_as_set(&mut self, span: f64) -> Result<(), SolveError> {
        let dt = self.elements.time_step();
        let springs = springs(self.constraint, &self.handles, dt);
        let (pattern, impulses, changes) = (&self.pattern, &self.impulses, &mut self.changes);
        let (threads, collisions) = (self.threads, &self.collisions);
        let elements = &mut self.elements;
        let solver = match &mut self.solver {
            Solver::Iterative(solver) => solver.as_mut(),
            Solver::Direct(direct) => {
                let _span = tracing::trace_span!("complete factor").entered();
                direct.gather(threads, pattern, elements, springs);
                direct.add(pattern, collisions.blocks_within());
                return direct.solve(pattern, impulses, changes);
            }
        };
        // A change of velocity is about an acceleration times its span.
        let scale = if self.solved_span > 0.0 { span / self.solved_span } else { 0.0 };
        changes.iter_mut().for_each(|change| *change *= scale);
        let gathered =
            if self.repeated.is_now { None } else { Some((&*elements, springs.stiff())) };
        solver.prepare(threads, pattern, gathered, collisions);
        let residual = |changes: &[DVec3], residual: &mut [DVec3]| {
            elements.multiply(threads, changes, residual);
            for (residual, impulse) in residual.iter_mut().zip(impulses) {
                *residual = *impulse - *residual;
            }
            for (v, stiffness) in springs.stiff() {
                residual[v as usize] -= changes[v as usize] * stiffness;
            }
            collisions.multiply(-1.0, changes, residual);
        };
        solver.solve(threads, pattern, changes, residual)
    }

    fn check_impulses(&self) -> Result<(), SolveError> {
        let is_bad = |v: &&u32| !self.impulses[**v as usize].is_finite();
        match self.pattern.vertices().iter().find(is_bad) {
            None => Ok(()),
            Some(&vertex) => Err(SolveError::NonFinite {
                vertex: VertexId(vertex),
            }),
        }
    }

    /// Iterations of the last solve; none if the solver does not iterate.
    pub(crate) fn iterations(&self) -> Option<u32> {
        match &self.solver {
            Solver::Direct(_) => None,
            Solver::Iterative(solver) => Some(solver.iterations()),
        }
    }

    /// Lets the next solve, of a small correction, start from zero.
    pub(crate) fn forget_changes(&mut self) {
        self.solved_span = 0.0;
    }

    /// Changes of velocity from which the next solve starts `[m/s]`, `[vertices]`, and their time
    /// `[s]`; none if it starts from nothing.
    pub(crate) fn last_changes(&self) -> Option<(&[DVec3], f64)> {
        let iterates = matches!(self.solver, Solver::Iterative(_));
        let starts = iterates && self.solved_span > 0.0;
        starts.then_some((self.changes.as_slice(), self.solved_span))
    }

    /// Lets the next solve start from `changes` over `span` `[s]`.
    pub(crate) fn put_changes(&mut self, changes: &[DVec3], span: f64) {
        self.changes.copy_from_slice(changes);
        self.solved_span = span;
    }

    /// Each unknown vertex and its Δv `[m/s]` of the last solve.
    pub(crate) fn velocity_changes(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let vertices = self.pattern.vertices().iter();
        vertices.map(|&vertex| (vertex as usize, self.changes[vertex as usize]))
    }

    /// Moves `state` by one solve over `dt` `[s]`, handles to `targets` `[m]`. On an error the
    /// state is unusable and the caller restores it.
    pub(crate) fn advance(
        &mut self,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        self.assemble(dt, state, targets);
        self.solve(dt)?;
        self.record(true, state);
        for &v in self.pattern.vertices() {
            let v = v as usize;
            let velocity = state.velocities[v] + self.changes[v];
            state.velocities[v] = velocity;
            state.positions[v] += velocity * dt;
            if !(velocity.is_finite() && state.positions[v].is_finite()) {
                return Err(SolveError::NonFinite {
                    vertex: VertexId(v as u32),
                });
            }
        }
        if self.constraint == HandleConstraint::Exact {
            for (vertex, target) in self.handles.vertices().iter().zip(targets) {
                state.velocities[vertex.index()] = self.driven[vertex.index()];
                state.positions[vertex.index()] = *target;
            }
        }
        Ok(())
    }

    /// Sets `state` to `base`, its velocities plus the last solve's Δv and its positions plus
    /// `seconds` of it.
    pub(crate) fn apply(&self, seconds: f64, base: &State, state: &mut State) {
        for &v in self.pattern.vertices() {
            let v = v as usize;
            state.velocities[v] = base.velocities[v] + self.changes[v];
            state.positions[v] = base.positions[v] + self.changes[v] * seconds;
        }
    }
}

/// A linearisation at the start of a step over `dt` `[s]`.
fn at_start<'a>(air: AirLaw, dt: f64, state: &'a State, driven: &'a [DVec3]) -> Linearisation<'a> {
    Linearisation {
        dt,
        ahead: dt,
        positions: &state.positions,
        rates: driven,
        air_velocities: match air {
            AirLaw::Explicit => &state.velocities,
            AirLaw::Implicit => driven,
        },
        stiffening: false,
        air_resistance: air.into(),
    }
}

/// A linearisation at an estimate of the end of a stage.
fn at_end(gamma: f64, now: &State) -> Linearisation<'_> {
    Linearisation {
        dt: gamma,
        ahead: 0.0,
        positions: &now.positions,
        rates: &now.velocities,
        air_velocities: &now.velocities,
        stiffening: true,
        air_resistance: AirResistance::Tangent,
    }
}

/// Conjugate gradients of the automatic choice.
fn automatic(scene: &Scene) -> selvedge_cloth::ConjugateGradients {
    selvedge_cloth::ConjugateGradients {
        tolerance: match scene.physics.integrator.order() {
            2 if scene.contact.is_some() => CONTACT_TOLERANCE,
            _ => AUTOMATIC_TOLERANCE,
        },
        ..selvedge_cloth::ConjugateGradients::default()
    }
}

/// Springs of `handles` in a solve over `dt` `[s]`.
fn springs(constraint: HandleConstraint, handles: &Handles, dt: f64) -> Springs<'_> {
    Springs {
        vertices: match constraint {
            HandleConstraint::Exact => &[],
            HandleConstraint::Spring => handles.vertices(),
        },
        stiffness: dt * dt * HANDLE_STIFFNESS,
    }
}

#[cfg(test)]
mod tests;
