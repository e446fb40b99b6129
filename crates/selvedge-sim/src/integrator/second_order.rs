//! The generalised-α method, linearised at a predicted state: second order for one solve per
//! substep.
//!
//! The error of one linear solve is quadratic in the distance from where it is linearised, and the
//! Jacobian that the solve has is not exact. Linearised at the start of the substep, that leaves an
//! error of first order whatever the formula. The prediction x̄ + γ v differs from the end by a
//! change of velocity only, O(dt²), and the error is of second order.
//!
//! The first substep has no state before it. It takes two stages of a one-step formula (Alexander
//! 1977): diagonally implicit, L-stable and of second order.

use glam::DVec3;
use selvedge_cloth::{HandleConstraint, Integrator, Scene, VertexId};

use super::edge_projection::EdgeProjection;
use super::history::History;
use super::two_step::TwoStep;
use crate::edges::WatchedEdges;
use crate::solver::{SolveError, System};
use crate::state::State;

/// Largest change of an edge's stretch l/l₀ from the start of a substep to its prediction.
const MOST_CHANGE: f64 = 0.1;
/// Largest change of an edge's stretch in the last solve of a stage. With 0.1 a caught sheet of denim
/// gained 8 % of the energy of its fall in a frame of one substep, with 0.03 none in 105 falls.
const MOST_SOLVE_CHANGE: f64 = 0.03;
/// Solves of a stage at most. Where cloth that falls is caught by its handles one is too far from
/// the solution: it gains up to a fifth of the energy of the fall.
const MOST_SOLVES: u32 = 6;

/// γ/dt of the one-step formula, 1 - 1/√2.
const START: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// The formula's workspaces.
pub(crate) struct SecondOrder {
    formula: TwoStep,
    edges: WatchedEdges,
    projection: EdgeProjection,
    /// Exact handles, in the order of their targets.
    held: Vec<VertexId>,
    /// x̄ and v̄.
    base: State,
    /// Start of a solve.
    predicted: State,
    /// The estimate of the end: the prediction first, then the solution.
    estimate: State,
    /// Targets of a stage within the substep `[m]`, `[handles]`.
    targets: Vec<DVec3>,
}

/// A substep to be taken.
struct Substep<'a> {
    system: &'a mut System,
    /// Length `[s]`.
    dt: f64,
    /// Its start.
    start: &'a State,
    /// Targets of the active handles `[m]`, `[handles]`.
    targets: &'a [DVec3],
}

/// Factors of a stage `[s]`.
#[derive(Clone, Copy)]
struct Factors {
    gamma: f64,
    /// Time between the velocities of prediction and solution.
    span: f64,
}

impl SecondOrder {
    /// The formula of a validated scene, for its cloth and handles; none where that is backward
    /// Euler.
    pub(crate) fn of(scene: &Scene) -> Option<Self> {
        let formula = match scene.physics.integrator {
            Integrator::Linearised => return None,
            Integrator::GeneralisedAlpha(settings) => {
                TwoStep::of(settings.radius(scene.contact.is_some()))
            }
        };
        let vertices = scene.mesh.topology().vertex_count();
        let held = match scene.physics.handles {
            HandleConstraint::Exact => scene.handles.vertices().to_vec(),
            HandleConstraint::Spring => Vec::new(),
        };
        Some(Self {
            formula,
            edges: WatchedEdges::new(&scene.mesh, &scene.handles),
            projection: EdgeProjection::new(&scene.mesh, &held),
            held,
            base: State::at_origin(vertices),
            predicted: State::at_origin(vertices),
            estimate: State::at_origin(vertices),
            targets: Vec::new(),
        })
    }

    /// Moves `state` by a substep over `dt` `[s]`, active handles to `targets` `[m]`, and keeps the old
    /// one in `history`. A prediction that strains an edge too much, though edges were brought back, is
    /// dropped for backward Euler linearised at the start. On an error state and history are unusable.
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        dt: f64,
        targets: &[DVec3],
        state: &mut State,
        history: &mut History,
    ) -> Result<(), SolveError> {
        let looks_back = history.fits(dt);
        let mut substep = Substep {
            system,
            dt,
            start: state,
            targets,
        };
        let is_solved = match looks_back {
            true => self.look_back(&mut substep, history)?,
            false => self.start(&mut substep)?,
        };
        history.counts.all += 1;
        history.counts.started += u64::from(!looks_back);
        if is_solved {
            self.keep(state, history, dt, !looks_back);
            state.copy_from(&self.estimate);
            return Ok(());
        }
        history.keep(state, dt);
        history.counts.fell_back += 1;
        let from_start = self.backward_euler(system, dt, targets, state, MOST_CHANGE)?;
        if !from_start {
            self.predicted.copy_from(state);
            let factors = Factors {
                gamma: dt,
                span: dt,
            };
            self.iterate(system, factors, targets)?;
            state.copy_from(&self.estimate);
        }
        Ok(())
    }

    /// Moves `state` by one solve of backward Euler, linearised at its start. Returns false if that
    /// changes the stretch of an edge by more than `most`.
    fn backward_euler(
        &mut self,
        system: &mut System,
        dt: f64,
        targets: &[DVec3],
        state: &mut State,
        most: f64,
    ) -> Result<bool, SolveError> {
        self.base.copy_from(state);
        system.advance(dt, state, targets)?;
        let [from, to] = [&self.base, &*state].map(|state| &state.positions);
        Ok(self.edges.keep_their_lengths(from, to, most))
    }

    /// As [`Self::advance`], by one solve of backward Euler, linearised at the start: where what
    /// touches changes, no rate of before tells the next one. Returns false if the end may be far
    /// from the solution, and [`Self::go_on`] is to be called.
    pub(crate) fn from_start(
        &mut self,
        system: &mut System,
        dt: f64,
        targets: &[DVec3],
        state: &mut State,
    ) -> Result<bool, SolveError> {
        self.backward_euler(system, dt, targets, state, MOST_SOLVE_CHANGE)
    }

    /// Moves `state`, where the last solve of backward Euler over `dt` `[s]` led, by another one that
    /// is linearised there. Returns false as that.
    pub(crate) fn go_on(
        &mut self,
        system: &mut System,
        dt: f64,
        targets: &[DVec3],
        state: &mut State,
    ) -> Result<bool, SolveError> {
        self.predicted.copy_from(state);
        system.linearise(dt, &self.base.velocities, &self.predicted, targets);
        system.solve(dt)?;
        system.apply(dt, &self.predicted, state);
        state.check_finite()?;
        let [from, to] = [&self.predicted, &*state].map(|state| &state.positions);
        Ok(self.edges.keep_their_lengths(from, to, MOST_SOLVE_CHANGE))
    }

    /// Keeps what the next substep looks back to, after one from `state` over `dt` `[s]`, which
    /// `started` or looked back itself.
    fn keep(&self, state: &State, history: &mut History, dt: f64, started: bool) {
        let before = history.before.both_mut().into_iter().zip(state.both());
        let ends = self.estimate.both().into_iter().zip(self.base.both());
        for ((before, start), (end, base)) in before.zip(ends) {
            for (v, before) in before.iter_mut().enumerate() {
                *before = if started {
                    // The rate at the end of the last stage is (y - ȳ)/γ.
                    let change = (end[v] - base[v]) * (dt / (START * dt));
                    self.formula.first_before(start[v], end[v], change)
                } else {
                    self.formula.before(start[v], *before, end[v])
                };
            }
        }
        history.set_last_substep(dt);
    }

    /// Looks back to x', v': x̄ = x + w (x - x'), v̄ the same `[eq:generalised-alpha]`; with a
    /// spectral radius of 0 it is `[eq:bdf2]`. Returns false as [`Self::stage`].
    fn look_back(
        &mut self,
        substep: &mut Substep<'_>,
        history: &History,
    ) -> Result<bool, SolveError> {
        let (formula, start) = (self.formula, substep.start);
        self.base
            .extrapolate(start, &history.before, formula.weight);
        self.estimate.velocities.copy_from_slice(&start.velocities);
        let factors = Factors {
            gamma: formula.gamma(substep.dt),
            span: substep.dt,
        };
        let is_solved = self.stage_at(formula.point, substep, factors)?;
        for (end, start) in self.estimate.both_mut().into_iter().zip(start.both()) {
            for (end, start) in end.iter_mut().zip(start) {
                *end = formula.end(*start, *end);
            }
        }
        // Exact handles are at their targets to the last digit.
        for (vertex, target) in self.held.iter().zip(substep.targets) {
            self.estimate.positions[vertex.index()] = *target;
        }
        Ok(is_solved)
    }

    /// Two stages with γ = α dt, α = 1 - 1/√2: the first is backward Euler over γ, the second has
    /// x̄ = x + (1 - α)/α (x₁ - x) and v̄ the same, x₁, v₁ the end of the first. Returns false as
    /// [`Self::stage`]. `[eq:sdirk2]`
    fn start(&mut self, substep: &mut Substep<'_>) -> Result<bool, SolveError> {
        let start = substep.start;
        let gamma = START * substep.dt;
        self.base.copy_from(start);
        self.estimate.velocities.copy_from_slice(&start.velocities);
        let first = Factors { gamma, span: gamma };
        if !self.stage_at(START, substep, first)? {
            return Ok(false);
        }
        // x + w (x₁ - x) = x₁ + (w - 1) (x₁ - x).
        let weight = (1.0 - START) / START - 1.0;
        self.base.extrapolate(&self.estimate, start, weight);
        let second = Factors {
            gamma,
            span: substep.dt - gamma,
        };
        self.stage(substep, second, substep.targets)
    }

    /// As [`Self::stage`], with the handles at this `point` of their way through the substep.
    fn stage_at(
        &mut self,
        point: f64,
        substep: &mut Substep<'_>,
        factors: Factors,
    ) -> Result<bool, SolveError> {
        let mut targets = std::mem::take(&mut self.targets);
        targets.clear();
        let places = substep.system.handle_positions(substep.start);
        let ways = places.zip(substep.targets);
        targets.extend(ways.map(|(now, end)| now.lerp(*end, point)));
        let is_solved = self.stage(substep, factors, &targets);
        self.targets = targets;
        is_solved
    }

    /// Solves the stage of `self.base` from the velocities of `self.estimate`, and leaves the
    /// solution there. Returns false if it is left to backward Euler.
    fn stage(
        &mut self,
        substep: &mut Substep<'_>,
        factors: Factors,
        targets: &[DVec3],
    ) -> Result<bool, SolveError> {
        let gamma = factors.gamma;
        let (base, predicted) = (&self.base, &mut self.predicted);
        for (v, velocity) in self.estimate.velocities.iter().enumerate() {
            predicted.positions[v] = base.positions[v] + *velocity * gamma;
            predicted.velocities[v] = *velocity;
        }
        for (vertex, target) in self.held.iter().zip(targets) {
            let v = vertex.index();
            predicted.positions[v] = *target;
            predicted.velocities[v] = (*target - base.positions[v]) / gamma;
        }
        substep.system.touches.begin_stage();
        let (start, places) = (&substep.start.positions, &mut predicted.positions);
        if self.projection.project(start, places) {
            if !self.edges.keep_their_lengths(start, places, MOST_CHANGE) {
                return Ok(false);
            }
            for (v, velocity) in predicted.velocities.iter_mut().enumerate() {
                if places[v] != base.positions[v] + *velocity * gamma {
                    *velocity = (places[v] - base.positions[v]) / gamma;
                }
            }
        }
        self.iterate(substep.system, factors, targets)?;
        Ok(true)
    }

    /// Solves the implicit equations of `self.base` from `self.predicted`, into `self.estimate`. A
    /// solve that changes the length of an edge by too much is repeated from where it led.
    fn iterate(
        &mut self,
        system: &mut System,
        Factors { gamma, span }: Factors,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        for solve in 1..=MOST_SOLVES {
            system.linearise(gamma, &self.base.velocities, &self.predicted, targets);
            system.solve(span)?;
            self.estimate.copy_from(&self.predicted);
            system.apply(gamma, &self.predicted, &mut self.estimate);
            self.estimate.check_finite()?;
            let [from, to] = [&self.predicted, &self.estimate].map(|at| &at.positions);
            if solve == MOST_SOLVES || self.edges.keep_their_lengths(from, to, MOST_SOLVE_CHANGE) {
                break;
            }
            self.predicted.copy_from(&self.estimate);
        }
        Ok(())
    }
}
