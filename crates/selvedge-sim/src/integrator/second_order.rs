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
use super::tape::TouchingTape;
use super::two_step::TwoStep;
use crate::edges::WatchedEdges;
use crate::solver::{SolveError, System};
use crate::state::State;

pub(crate) mod backward;

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
    /// Targets of the stage under way `[m]`, `[handles]`; and those at the end of a substep in which
    /// things touch, else room.
    targets: Vec<DVec3>,
    end_targets: Vec<DVec3>,
    /// Stage of a substep in which things touch, and its start.
    stage: Stage,
    start: State,
    /// Change of velocity of all solves of the stage so far `[m/s]`, `[vertices]`.
    changes: Vec<DVec3>,
}

/// The one stage of a substep in which things touch.
#[derive(Clone, Copy, Default)]
struct Stage {
    /// γ `[s]`.
    gamma: f64,
    /// Length of the substep `[s]`.
    span: f64,
    /// Point of the substep at which the equations hold.
    point: f64,
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
            end_targets: Vec::new(),
            stage: Stage::default(),
            start: State::at_origin(vertices),
            changes: vec![DVec3::ZERO; vertices],
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
        if let Some(tape) = &mut system.tape {
            let before = looks_back.then_some(&history.before);
            tape.begin(dt, state, before, targets);
        }
        let mut substep = Substep {
            system,
            dt,
            start: state,
            targets,
        };
        let is_solved = if looks_back {
            self.look_back(&mut substep, history)?
        } else {
            self.start(&mut substep)?
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
        if let Some(tape) = &mut system.tape {
            tape.fall_back();
        }
        self.base.copy_from(state);
        system.advance(dt, state, targets)?;
        let [from, to] = [&self.base, &*state].map(|state| &state.positions);
        if !self.edges.keep_their_lengths(from, to, MOST_CHANGE) {
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

    /// Moves `state` by one solve towards the end of a substep over `dt` `[s]` in which things touch,
    /// active handles to `targets` `[m]`: by the formula, or where there is no `history` by backward
    /// Euler. It is linearised where the cloth would go without a push. Returns false if the end may
    /// be far from the solution; [`Self::go_on`] comes nearer.
    pub(crate) fn advance_touching(
        &mut self,
        system: &mut System,
        dt: f64,
        targets: &[DVec3],
        state: &mut State,
        history: Option<&History>,
    ) -> Result<bool, SolveError> {
        if let Some(tape) = &mut system.tape {
            tape.begin(dt, state, history.map(|history| &history.before), targets);
        }
        self.start.copy_from(state);
        self.stage = match history {
            Some(history) => {
                self.base
                    .extrapolate(state, &history.before, self.formula.weight);
                Stage {
                    gamma: self.formula.gamma(dt),
                    span: dt,
                    point: self.formula.point,
                }
            }
            None => {
                self.base.copy_from(state);
                Stage {
                    gamma: dt,
                    span: dt,
                    point: 1.0,
                }
            }
        };
        self.end_targets.clear();
        self.end_targets.extend_from_slice(targets);
        self.targets.clear();
        let ways = system.handle_positions(state).zip(targets);
        let point = self.stage.point;
        self.targets
            .extend(ways.map(|(now, end)| now.lerp(*end, point)));
        self.estimate.velocities.copy_from_slice(&state.velocities);
        let is_near = self.predict(&state.positions, self.stage.gamma);
        system.collisions.begin_stage();
        if let Some(substep) = system.tape.as_mut().and_then(|tape| tape.last()) {
            substep.touching = Some(TouchingTape { is_near });
            substep.gamma = self.stage.gamma;
        }
        if !is_near {
            // Velocities that strain it are no prediction.
            let expected = self.predicted.positions.iter().copied();
            system.collisions.expect(expected);
            self.predicted
                .positions
                .copy_from_slice(&self.base.positions);
            self.predicted.velocities.fill(DVec3::ZERO);
            self.lead_handles(self.stage.gamma);
        }
        self.solve_stage(system, state, true)
    }

    /// Moves `state`, where the last solve of [`Self::advance_touching`] led, by another one that is
    /// linearised there, with what touches now. Returns false as that.
    pub(crate) fn go_on(
        &mut self,
        system: &mut System,
        state: &mut State,
    ) -> Result<bool, SolveError> {
        self.predicted.copy_from(&self.estimate);
        self.changes.copy_from_slice(system.changes().0);
        system.forget_changes();
        let is_near = self.solve_stage(system, state, false)?;
        // The next substep begins with all of the change, not with this correction.
        for (sum, change) in self.changes.iter_mut().zip(system.changes().0) {
            *sum += *change;
        }
        system.put_changes(&self.changes, self.stage.span);
        Ok(is_near)
    }

    /// One solve of the stage under way, the first or a further one, from `self.predicted`.
    fn solve_stage(
        &mut self,
        system: &mut System,
        state: &mut State,
        is_first: bool,
    ) -> Result<bool, SolveError> {
        let Stage { gamma, span, point } = self.stage;
        system.linearise(gamma, &self.base.velocities, &self.predicted, &self.targets);
        system.solve(span)?;
        system.record(is_first, &self.predicted);
        self.estimate.copy_from(&self.predicted);
        system.apply(gamma, &self.predicted, &mut self.estimate);
        self.estimate.check_finite()?;
        let ends = state.both_mut().into_iter().zip(self.estimate.both());
        for ((ends, estimates), starts) in ends.zip(self.start.both()) {
            for ((end, estimate), start) in ends.iter_mut().zip(estimates).zip(starts) {
                *end = if point == 1.0 { *estimate } else { self.formula.end(*start, *estimate) };
            }
        }
        // Exact handles are at their targets to the last digit.
        for (vertex, target) in self.held.iter().zip(&self.end_targets) {
            state.positions[vertex.index()] = *target;
        }
        let [from, to] = [&self.predicted, &self.estimate].map(|at| &at.positions);
        Ok(self.edges.keep_their_lengths(from, to, MOST_SOLVE_CHANGE))
    }

    /// Keeps what the next substep looks back to, after one of [`Self::advance_touching`] to `end`.
    pub(crate) fn keep_touching(&self, history: &mut History, end: &State) {
        let dt = self.stage.span;
        if history.fits(dt) && self.looked_back() {
            let before = history.before.both_mut().into_iter().zip(self.start.both());
            for ((before, start), end) in before.zip(end.both()) {
                for (v, before) in before.iter_mut().enumerate() {
                    *before = self.formula.before(start[v], *before, end[v]);
                }
            }
        } else {
            history.keep(&self.start, dt);
        }
    }

    /// Returns true if the stage under way is of the formula.
    pub(crate) fn looked_back(&self) -> bool {
        self.stage.gamma < self.stage.span
    }

    /// [`TwoStep::point`], in a substep that looks back.
    pub(crate) fn point(&self) -> f64 {
        self.formula.point
    }

    /// [`TwoStep::impulse`].
    pub(crate) fn impulse(&self, dt: f64, force: DVec3, carried: DVec3) -> [DVec3; 2] {
        self.formula.impulse(dt, force, carried)
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
        let places = substep.system.handle_positions(substep.start);
        let ways = places.zip(substep.targets);
        let mut targets = std::mem::take(&mut self.end_targets);
        targets.clear();
        targets.extend(ways.map(|(now, end)| now.lerp(*end, point)));
        let is_solved = self.stage(substep, factors, &targets);
        self.end_targets = targets;
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
        self.targets.clear();
        self.targets.extend_from_slice(targets);
        if !self.predict(&substep.start.positions, factors.gamma) {
            return Ok(false);
        }
        self.iterate(substep.system, factors, targets)?;
        Ok(true)
    }

    /// Predicts the end of the stage of `self.base` from the velocities of `self.estimate`, its edges
    /// brought back to their lengths at the `start` `[m]`. Returns false if an edge stays strained.
    fn predict(&mut self, start: &[DVec3], gamma: f64) -> bool {
        for (v, velocity) in self.estimate.velocities.iter().enumerate() {
            self.predicted.positions[v] = self.base.positions[v] + *velocity * gamma;
            self.predicted.velocities[v] = *velocity;
        }
        self.lead_handles(gamma);
        let (base, places) = (&self.base, &mut self.predicted.positions);
        if self.projection.project(start, places) {
            if !self.edges.keep_their_lengths(start, places, MOST_CHANGE) {
                return false;
            }
            for (v, velocity) in self.predicted.velocities.iter_mut().enumerate() {
                if places[v] != base.positions[v] + *velocity * gamma {
                    *velocity = (places[v] - base.positions[v]) / gamma;
                }
            }
        }
        true
    }

    /// Puts exact handles of the prediction at the targets of the stage.
    fn lead_handles(&mut self, gamma: f64) {
        for (vertex, target) in self.held.iter().zip(&self.targets) {
            let v = vertex.index();
            self.predicted.positions[v] = *target;
            self.predicted.velocities[v] = (*target - self.base.positions[v]) / gamma;
        }
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
            system.record(solve == 1, &self.predicted);
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
