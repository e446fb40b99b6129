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
use crate::solver::{SolveError, System};
use crate::state::State;
use crate::watched_edges::WatchedEdges;

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
pub(crate) struct Substep<'a> {
    pub(crate) system: &'a mut System,
    /// Length `[s]`.
    pub(crate) dt: f64,
    /// Targets of the active handles `[m]`, `[handles]`.
    pub(crate) targets: &'a [DVec3],
}

/// A stage that was solved, or one that is left to backward Euler.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Solved,
    FirstOrder,
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

    /// Moves `state` by `substep` and keeps the old one in `history`. A prediction that strains an
    /// edge too much, though edges were brought back, is dropped for backward Euler linearised at
    /// the start. On an error state and history are unusable.
    pub(crate) fn advance(
        &mut self,
        mut substep: Substep<'_>,
        state: &mut State,
        history: &mut History,
    ) -> Result<(), SolveError> {
        let dt = substep.dt;
        let looks_back = history.fits(dt);
        let (outcome, gamma) = if looks_back {
            self.looking_back(&mut substep, state, history)?
        } else {
            self.start(&mut substep, state)?
        };
        history.counts.all += 1;
        history.counts.started += u64::from(!looks_back);
        match outcome {
            Outcome::Solved => {
                self.keep(state, history, dt, (!looks_back).then_some(gamma));
                state.copy_from(&self.estimate);
            }
            Outcome::FirstOrder => {
                history.keep(state, dt);
                history.counts.fell_back += 1;
                self.base.copy_from(state);
                substep.system.advance(dt, state, substep.targets)?;
                let start = &self.base.positions;
                if !self
                    .edges
                    .keep_their_lengths(start, &state.positions, MOST_CHANGE)
                {
                    self.predicted.copy_from(state);
                    self.solve(
                        substep.system,
                        Factors {
                            gamma: dt,
                            span: dt,
                        },
                        substep.targets,
                    )?;
                    state.copy_from(&self.estimate);
                }
            }
        }
        Ok(())
    }

    /// Keeps what the next substep looks back to, after one from `state` over `dt` `[s]`; `started`
    /// is γ `[s]` of the last stage where that did not look back.
    fn keep(&self, state: &State, history: &mut History, dt: f64, started: Option<f64>) {
        let (end, base) = (&self.estimate, &self.base);
        let before = &mut history.before;
        for (before, start, end, base) in [
            (
                &mut before.positions,
                &state.positions,
                &end.positions,
                &base.positions,
            ),
            (
                &mut before.velocities,
                &state.velocities,
                &end.velocities,
                &base.velocities,
            ),
        ] {
            for (v, before) in before.iter_mut().enumerate() {
                *before = match started {
                    None => self.formula.before(start[v], *before, end[v]),
                    Some(gamma) => {
                        // The rate at the end of the last stage is (y - ȳ)/γ.
                        let change = (end[v] - base[v]) * (dt / gamma);
                        self.formula.first_before(start[v], end[v], change)
                    }
                };
            }
        }
        history.set_last_substep(dt);
    }

    /// Looks back to x', v': x̄ = x + w (x - x'), v̄ the same `[eq:generalised-alpha]`; with a
    /// spectral radius of 0 it is `[eq:bdf2]`.
    fn looking_back(
        &mut self,
        substep: &mut Substep<'_>,
        state: &State,
        history: &History,
    ) -> Result<(Outcome, f64), SolveError> {
        let formula = self.formula;
        let weight = formula.weight;
        let gamma = formula.gamma(substep.dt);
        extrapolate(
            &mut self.base.positions,
            &state.positions,
            &history.before.positions,
            weight,
        );
        extrapolate(
            &mut self.base.velocities,
            &state.velocities,
            &history.before.velocities,
            weight,
        );
        self.estimate.velocities.copy_from_slice(&state.velocities);
        let factors = Factors {
            gamma,
            span: substep.dt,
        };
        self.find_targets(substep, state, formula.point);
        let targets = std::mem::take(&mut self.targets);
        let outcome = self.stage(substep.system, factors, state, &targets);
        self.targets = targets;
        let estimate = &mut self.estimate;
        for (estimate, start) in [
            (&mut estimate.positions, &state.positions),
            (&mut estimate.velocities, &state.velocities),
        ] {
            for (end, start) in estimate.iter_mut().zip(start) {
                *end = formula.end(*start, *end);
            }
        }
        // Exact handles are at their targets to the last digit.
        for (vertex, target) in self.held.iter().zip(substep.targets) {
            self.estimate.positions[vertex.index()] = *target;
        }
        Ok((outcome?, gamma))
    }

    /// Sets the targets of a stage at `point` of the way through `substep`.
    fn find_targets(&mut self, substep: &Substep<'_>, state: &State, point: f64) {
        let now = substep.system.handle_positions(state);
        let places = now
            .zip(substep.targets)
            .map(|(now, end)| now.lerp(*end, point));
        self.targets.clear();
        self.targets.extend(places);
    }

    /// Two stages with γ = α dt, α = 1 - 1/√2: the first is backward Euler over γ, the second has
    /// x̄ = x + (1 - α)/α (x₁ - x) and v̄ the same, x₁, v₁ the end of the first. `[eq:sdirk2]`
    fn start(
        &mut self,
        substep: &mut Substep<'_>,
        state: &State,
    ) -> Result<(Outcome, f64), SolveError> {
        let dt = substep.dt;
        let gamma = START * dt;
        self.find_targets(substep, state, START);
        self.base.copy_from(state);
        self.estimate.velocities.copy_from_slice(&state.velocities);
        let targets = std::mem::take(&mut self.targets);
        let first = Factors { gamma, span: gamma };
        let outcome = self.stage(substep.system, first, state, &targets);
        self.targets = targets;
        if outcome? == Outcome::FirstOrder {
            return Ok((Outcome::FirstOrder, gamma));
        }
        // x + w (x₁ - x) = x₁ + (w - 1) (x₁ - x).
        let weight = (1.0 - START) / START - 1.0;
        extrapolate(
            &mut self.base.positions,
            &self.estimate.positions,
            &state.positions,
            weight,
        );
        extrapolate(
            &mut self.base.velocities,
            &self.estimate.velocities,
            &state.velocities,
            weight,
        );
        let second = Factors {
            gamma,
            span: dt - gamma,
        };
        let targets = substep.targets;
        let outcome = self.stage(substep.system, second, state, targets)?;
        Ok((outcome, gamma))
    }

    /// Solves the stage of `self.base` from the velocities of `self.estimate`, and leaves the
    /// solution there; `last` is the start of the substep.
    fn stage(
        &mut self,
        system: &mut System,
        factors: Factors,
        last: &State,
        targets: &[DVec3],
    ) -> Result<Outcome, SolveError> {
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
        let places = &mut predicted.positions;
        if self.projection.project(&last.positions, places) {
            let edges = &self.edges;
            if !edges.keep_their_lengths(&last.positions, places, MOST_CHANGE) {
                return Ok(Outcome::FirstOrder);
            }
            for (v, velocity) in predicted.velocities.iter_mut().enumerate() {
                if places[v] != base.positions[v] + *velocity * gamma {
                    *velocity = (places[v] - base.positions[v]) / gamma;
                }
            }
        }
        self.solve(system, factors, targets)?;
        Ok(Outcome::Solved)
    }

    /// Solves the implicit equations of `self.base` from `self.predicted`, into `self.estimate`. A
    /// solve that changes the length of an edge by too much is repeated from where it led.
    fn solve(
        &mut self,
        system: &mut System,
        factors: Factors,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        let Factors { gamma, span } = factors;
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

/// `into` = `now` + `weight` (`now` - `before`).
fn extrapolate(into: &mut [DVec3], now: &[DVec3], before: &[DVec3], weight: f64) {
    for ((into, now), before) in into.iter_mut().zip(now).zip(before) {
        *into = *now + (*now - *before) * weight;
    }
}
