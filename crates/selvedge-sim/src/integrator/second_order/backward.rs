//! A substep backwards: derivatives by its end become derivatives by its start.

use glam::DVec3;
use selvedge_cloth::{HandleConstraint, VertexId};

use super::super::tape::{SolveTape, SubstepTape};
use super::{START, SecondOrder};
use crate::contact::{AnchorSlope, ObstacleSlope, PlaceSlopes, Places, ShapeSlopes};
use crate::solver::{ElementSums, SolveError, System};
use crate::state::State;

/// Derivatives of a value that a substep leads to.
#[derive(Debug)]
pub(crate) struct Pulled<'a> {
    /// By the state: at the end of the substep, then at its start.
    pub(crate) state: &'a mut State,
    /// By the state before that one.
    pub(crate) before: &'a mut State,
    /// By the targets of the active handles at its end, `[handles]`.
    pub(crate) targets: &'a mut Vec<DVec3>,
    /// By the pulls of anchors, likewise.
    pub(crate) anchors: &'a mut Vec<AnchorSlope>,
    /// By the places of obstacles at its start and end, `[obstacles]`.
    pub(crate) obstacles: &'a mut [[ObstacleSlope; 2]],
    pub(crate) sums: &'a mut ElementSums,
}

/// A stage backwards.
struct Stage<'a> {
    gamma: f64,
    base: &'a State,
    /// The velocities of its prediction.
    velocities: &'a [DVec3],
    /// Positions at the start of the substep.
    start: &'a [DVec3],
    targets: &'a [DVec3],
    solves: &'a [SolveTape],
    /// False where the solves did not begin from the prediction, but from the base at rest.
    is_predicted: bool,
    /// Length of the substep `[s]`, and the point of it at which its equations hold, where things touch.
    dt: f64,
    point: f64,
}

/// Derivatives by what a stage is made from.
struct StageSlopes {
    base: State,
    velocities: Vec<DVec3>,
    start: Vec<DVec3>,
    targets: Vec<DVec3>,
}

fn zeros(count: usize) -> State {
    State::at_origin(count)
}

/// `sum` += `by` · `factor`.
fn add(sum: &mut [DVec3], by: &[DVec3], factor: f64) {
    for (sum, by) in sum.iter_mut().zip(by) {
        *sum += *by * factor;
    }
}

fn add_states(sum: &mut State, by: &State, factor: f64) {
    for (sum, by) in sum.both_mut().into_iter().zip(by.both()) {
        add(sum, by, factor);
    }
}

impl SecondOrder {
    /// Takes a recorded substep backwards; `system` is that of its active handles.
    pub(crate) fn pull_back(
        &mut self,
        system: &mut System,
        substep: &SubstepTape,
        pulled: &mut Pulled<'_>,
    ) -> Result<(), SolveError> {
        let has_touched = substep.touching.is_some();
        if !has_touched {
            pulled.anchors.clear();
        }
        if has_touched || substep.before.is_some() && !substep.fell_back {
            return self.pull_formula(system, substep, pulled);
        }
        let by_start = cut(substep, pulled.state);
        if substep.fell_back {
            self.pull_fallback(system, substep, pulled)?;
        } else {
            self.pull_start(system, substep, pulled)?;
        }
        add_states(pulled.state, &by_start, 1.0);
        Ok(())
    }

    /// A substep of one stage: of the formula, or where things touched and it did not look back, of backward
    /// Euler.
    fn pull_formula(
        &mut self,
        system: &mut System,
        substep: &SubstepTape,
        pulled: &mut Pulled<'_>,
    ) -> Result<(), SolveError> {
        let (formula, start) = (self.formula, &substep.start);
        let count = start.positions.len();
        let (mut at_start, mut at_before) = (zeros(count), zeros(count));
        let mut base = start.clone();
        let (mut gamma, mut point, mut weight) = (substep.dt, 1.0, 0.0);
        let mut by_before = [0.0, 1.0, 0.0];
        if let Some(before) = &substep.before {
            base.extrapolate(start, before, formula.weight);
            (gamma, point) = (formula.gamma(substep.dt), formula.point);
            (weight, by_before) = (formula.weight, formula.before_weights());
        }
        let targets = between(system, start, &substep.targets, point);
        let stage = Stage {
            gamma,
            base: &base,
            velocities: &start.velocities,
            start: &start.positions,
            targets: &targets,
            solves: substep.stages.first().map_or(&[], |solves| solves),
            is_predicted: substep.touching.is_none_or(|tape| tape.is_near),
            dt: substep.dt,
            point,
        };
        let mut touching = substep.touching.map(|_| {
            let (raw, expected) = self.predict_again(&stage);
            Touching {
                raw,
                expected,
                by_estimates: vec![vec![DVec3::ZERO; count]; stage.solves.len()],
                by_expected: vec![DVec3::ZERO; count],
                by_start: zeros(count),
                by_masses: vec![0.0; count],
                shapes: Vec::new(),
                anchors: pulled.anchors,
                obstacles: pulled.obstacles,
            }
        });
        if let Some(touching) = &mut touching {
            self.pull_anchors(substep, &stage, touching, pulled.state);
        }
        add_states(&mut at_start, &cut(substep, pulled.state), 1.0);
        let mut end = pulled.state.clone();
        let sums = [&mut end, &mut at_start, &mut at_before];
        for (sum, by) in sums.into_iter().zip(by_before) {
            add_states(sum, pulled.before, by);
        }
        for (vertex, target) in self.held.iter().zip(pulled.targets.iter_mut()) {
            *target += std::mem::take(&mut end.positions[vertex.index()]);
        }
        let mut estimate = zeros(count);
        add_states(&mut estimate, &end, 1.0 / point);
        add_states(&mut at_start, &end, 1.0 - 1.0 / point);
        let slopes = self.pull_stage(system, &stage, estimate, touching.as_mut(), pulled.sums)?;
        if let Some(touching) = touching {
            let masses = pulled.sums.mass.iter_mut().zip(touching.by_masses);
            masses.for_each(|(sum, by)| *sum += by);
            add_states(&mut at_start, &touching.by_start, 1.0);
        }
        add_states(&mut at_start, &slopes.base, 1.0 + weight);
        add_states(&mut at_before, &slopes.base, -weight);
        add(&mut at_start.velocities, &slopes.velocities, 1.0);
        add(&mut at_start.positions, &slopes.start, 1.0);
        self.pull_between(system, point, &slopes.targets, &mut at_start, pulled);
        *pulled.state = at_start;
        *pulled.before = at_before;
        Ok(())
    }

    /// Takes the anchors that the last solve left at the end of the substep backwards; `by_end` are derivatives
    /// by the state there.
    fn pull_anchors(
        &self,
        substep: &SubstepTape,
        stage: &Stage<'_>,
        touching: &mut Touching<'_>,
        by_end: &mut State,
    ) {
        let (slopes, point) = (std::mem::take(touching.anchors), stage.point);
        let Some(last) = stage.solves.last().filter(|_| !slopes.is_empty()) else {
            return;
        };
        let estimate = last.at.positions.iter().zip(&last.changes[..]);
        let ends = estimate.zip(stage.start).map(|((at, change), start)| {
            let estimate = *at + *change * stage.gamma;
            if point == 1.0 { estimate } else { self.formula.end(*start, estimate) }
        });
        let mut end: Vec<DVec3> = ends.collect();
        for (vertex, target) in self.held.iter().zip(&substep.targets) {
            end[vertex.index()] = *target;
        }
        add(&mut end[..substep.pushed.len()], &substep.pushed, 1.0);
        if let Some(part) = substep.safe {
            let ways = end.iter_mut().zip(stage.start);
            ways.for_each(|(end, start)| *end = start.lerp(*end, part));
        }
        let places = Places {
            gamma: stage.gamma,
            time: stage.dt,
            start: stage.start,
            expected: &touching.expected,
            end: &end,
            point,
            part: substep.safe.unwrap_or(1.0),
        };
        let mut by = PlaceSlopes {
            start: &mut touching.by_start.positions,
            velocities: &mut touching.by_start.velocities,
            expected: &mut touching.by_expected,
            end: &mut by_end.positions,
            estimates: &mut touching.by_estimates,
            masses: &mut touching.by_masses,
            obstacles: touching.obstacles,
            anchors: touching.anchors,
        };
        let (all, came_from) = (&last.collisions, &last.came_from);
        all.pull_anchors(came_from, places, slopes, &mut by, &mut touching.shapes);
    }

    fn pull_start(
        &mut self,
        system: &mut System,
        substep: &SubstepTape,
        pulled: &mut Pulled<'_>,
    ) -> Result<(), SolveError> {
        let start = &substep.start;
        let count = start.positions.len();
        let gamma = START * substep.dt;
        // The first estimate is where the last solve of the first stage leads.
        let Some(last) = substep.stages[0].last() else {
            return Ok(());
        };
        let mut first = last.at.clone();
        add(&mut first.positions, &last.changes, gamma);
        add(&mut first.velocities, &last.changes, 1.0);
        let weight = (1.0 - START) / START - 1.0;
        let mut base = zeros(count);
        base.extrapolate(&first, start, weight);
        // y' = end - change - (end - start - change) lag, change = (end - base) dt/γ.
        let (lag, rate) = (self.formula.lag(), (1.0 - self.formula.lag()) / START);
        let mut end = pulled.state.clone();
        add_states(&mut end, pulled.before, 1.0 - lag - rate);
        let mut at_start = zeros(count);
        add_states(&mut at_start, pulled.before, lag);
        let second = Stage {
            gamma,
            base: &base,
            velocities: &first.velocities,
            start: &start.positions,
            targets: &substep.targets,
            solves: &substep.stages[1],
            is_predicted: true,
            dt: substep.dt,
            point: 1.0,
        };
        let mut slopes = self.pull_stage(system, &second, end, None, pulled.sums)?;
        add_states(&mut slopes.base, pulled.before, rate);
        add(&mut at_start.positions, &slopes.start, 1.0);
        add(pulled.targets, &slopes.targets, 1.0);
        let mut estimate = zeros(count);
        add_states(&mut estimate, &slopes.base, 1.0 + weight);
        add_states(&mut at_start, &slopes.base, -weight);
        add(&mut estimate.velocities, &slopes.velocities, 1.0);
        let targets = between(system, start, &substep.targets, START);
        let stage = Stage {
            gamma,
            base: start,
            velocities: &start.velocities,
            start: &start.positions,
            targets: &targets,
            solves: &substep.stages[0],
            is_predicted: true,
            dt: substep.dt,
            point: 1.0,
        };
        let slopes = self.pull_stage(system, &stage, estimate, None, pulled.sums)?;
        add_states(&mut at_start, &slopes.base, 1.0);
        add(&mut at_start.velocities, &slopes.velocities, 1.0);
        add(&mut at_start.positions, &slopes.start, 1.0);
        self.pull_between(system, START, &slopes.targets, &mut at_start, pulled);
        *pulled.state = at_start;
        *pulled.before = zeros(count);
        Ok(())
    }

    /// Backward Euler, and solves of its equations from where it led. Its start is the state before.
    fn pull_fallback(
        &mut self,
        system: &mut System,
        substep: &SubstepTape,
        pulled: &mut Pulled<'_>,
    ) -> Result<(), SolveError> {
        let count = substep.start.positions.len();
        let mut at_start = std::mem::replace(pulled.before, zeros(count));
        if let Some(solves) = substep.stages.get(1) {
            let mut base = vec![DVec3::ZERO; count];
            let stage = Stage {
                gamma: substep.dt,
                base: &substep.start,
                velocities: &substep.start.velocities,
                start: &substep.start.positions,
                targets: &substep.targets,
                solves,
                is_predicted: false,
                dt: substep.dt,
                point: 1.0,
            };
            let by_targets =
                stage.pull_solves(system, pulled.state, &mut base, None, pulled.sums)?;
            add(&mut at_start.velocities, &base, 1.0);
            add(pulled.targets, &by_targets, 1.0);
        }
        pull_euler(system, substep, pulled)?;
        add_states(pulled.state, &at_start, 1.0);
        Ok(())
    }

    /// The prediction of a stage, before its edges were brought back and after `[m]`, `[vertices]`.
    fn predict_again(&mut self, stage: &Stage<'_>) -> (Vec<DVec3>, Vec<DVec3>) {
        let velocities = stage.velocities.iter().zip(&stage.base.positions);
        let mut raw: Vec<DVec3> = velocities
            .map(|(v, base)| *base + *v * stage.gamma)
            .collect();
        for (vertex, target) in self.held.iter().zip(stage.targets) {
            raw[vertex.index()] = *target;
        }
        let mut places = raw.clone();
        self.projection.project(stage.start, &mut places);
        (raw, places)
    }

    /// A stage backwards, from derivatives by its `estimate`; where things touch, with where the cloth was
    /// expected, derivatives by that, and room for those by anchors.
    fn pull_stage(
        &mut self,
        system: &mut System,
        stage: &Stage<'_>,
        mut estimate: State,
        mut touching: Option<&mut Touching<'_>>,
        sums: &mut ElementSums,
    ) -> Result<StageSlopes, SolveError> {
        let (gamma, base) = (stage.gamma, stage.base);
        let count = base.positions.len();
        let mut slopes = StageSlopes {
            base: zeros(count),
            velocities: vec![DVec3::ZERO; count],
            start: vec![DVec3::ZERO; count],
            targets: Vec::new(),
        };
        slopes.targets = stage.pull_solves(
            system,
            &mut estimate,
            &mut slopes.base.velocities,
            touching.as_deref_mut(),
            sums,
        )?;
        let by = &mut estimate;
        if !stage.is_predicted {
            for (handle, vertex) in self.held.iter().enumerate() {
                let v = vertex.index();
                let velocity = std::mem::take(&mut by.velocities[v]) / gamma;
                slopes.targets[handle] += std::mem::take(&mut by.positions[v]) + velocity;
                slopes.base.positions[v] -= velocity;
            }
            add(&mut slopes.base.positions, &by.positions, 1.0);
            *by = zeros(count);
        }
        let (raw, places) = match touching {
            Some(touching) => {
                add(&mut by.positions, &touching.by_expected, 1.0);
                let both = [&mut touching.raw, &mut touching.expected];
                both.map(std::mem::take).into()
            }
            None => self.predict_again(stage),
        };
        let is_held = |v: usize| self.held.contains(&VertexId(v as u32));
        if raw != places {
            for (v, place) in places.iter().enumerate() {
                let there = base.positions[v] + stage.velocities[v] * gamma;
                if is_held(v) || *place != there {
                    let velocity = std::mem::take(&mut by.velocities[v]) / gamma;
                    by.positions[v] += velocity;
                    slopes.base.positions[v] -= velocity;
                }
            }
            let (by, start) = (&mut by.positions, &mut slopes.start);
            let lengths = &mut sums.lengths;
            self.projection
                .pull_back(stage.start, &raw, by, start, lengths);
        }
        for (handle, vertex) in self.held.iter().enumerate() {
            let v = vertex.index();
            let velocity = std::mem::take(&mut by.velocities[v]) / gamma;
            slopes.targets[handle] += std::mem::take(&mut by.positions[v]) + velocity;
            slopes.base.positions[v] -= velocity;
        }
        add(&mut slopes.base.positions, &by.positions, 1.0);
        add(&mut slopes.velocities, &by.velocities, 1.0);
        add(&mut slopes.velocities, &by.positions, gamma);
        Ok(slopes)
    }

    /// Targets of a stage that lies at a `point` of the substep.
    fn pull_between(
        &self,
        system: &System,
        point: f64,
        by: &[DVec3],
        at_start: &mut State,
        pulled: &mut Pulled<'_>,
    ) {
        for (vertex, by) in system.handle_vertices().iter().zip(by) {
            at_start.positions[vertex.index()] += *by * (1.0 - point);
        }
        add(pulled.targets, by, point);
    }
}

/// Turns derivatives by the end of a substep, of which a part was safe, into those by the end of its solve,
/// and returns those by its start. Moves that pushed pairs apart count as decided.
fn cut(substep: &SubstepTape, by: &mut State) -> State {
    let mut by_start = zeros(by.positions.len());
    if let Some(part) = substep.safe {
        add_states(&mut by_start, by, 1.0 - part);
        let whole = by.clone();
        add_states(by, &whole, part - 1.0);
    }
    by_start
}

fn between(system: &System, start: &State, ends: &[DVec3], point: f64) -> Vec<DVec3> {
    let ways = system.handle_positions(start).zip(ends);
    ways.map(|(now, end)| now.lerp(*end, point)).collect()
}

/// Derivatives of a stage in which things touch.
struct Touching<'a> {
    /// Where the cloth was expected, before its edges were brought back and after `[m]`, `[vertices]`, and
    /// derivatives by that.
    raw: Vec<DVec3>,
    expected: Vec<DVec3>,
    by_expected: Vec<DVec3>,
    /// By the estimates of all solves, `[solves, vertices]`.
    by_estimates: Vec<Vec<DVec3>>,
    /// By the state at the start of the substep.
    by_start: State,
    /// By masses, `[vertices]`.
    by_masses: Vec<f64>,
    /// By the shapes of the collisions of the solve that is next.
    shapes: Vec<ShapeSlopes>,
    anchors: &'a mut Vec<AnchorSlope>,
    obstacles: &'a mut [[ObstacleSlope; 2]],
}

impl Stage<'_> {
    /// Takes the solves, each from where the last one led, backwards: turns `by`, derivatives by the end of the
    /// last solve, into those by where the first one is
    /// linearised, and adds those by v̄ to `by_base` and, where things touch, those by what collisions
    /// came from to `touching`. Returns those by the targets of spring handles,
    /// 0 of exact ones.
    fn pull_solves(
        &self,
        system: &mut System,
        by: &mut State,
        by_base: &mut [DVec3],
        mut touching: Option<&mut Touching<'_>>,
        sums: &mut ElementSums,
    ) -> Result<Vec<DVec3>, SolveError> {
        let mut by_targets = vec![DVec3::ZERO; self.targets.len()];
        for (number, solve) in self.solves.iter().enumerate().rev() {
            if let Some(touching) = &mut touching {
                add(&mut by.positions, &touching.by_estimates[number], 1.0);
            }
            system.collisions.clone_from(&solve.collisions);
            if let Some(touching) = &touching {
                system.collisions.expect(touching.expected.iter().copied());
            }
            let positions = by.positions.iter().zip(&by.velocities);
            let right: Vec<DVec3> = positions.map(|(x, v)| *x * self.gamma + *v).collect();
            system.linearise(self.gamma, &self.base.velocities, &solve.at, self.targets);
            let multipliers = system.solve_adjoint(&right)?;
            let stiffness = system.pull_stage(
                self.gamma,
                &self.base.velocities,
                solve,
                &multipliers,
                (by, by_base, sums),
            );
            for (vertex, by_target) in system.handle_vertices().iter().zip(&mut by_targets) {
                let pull = multipliers[vertex.index()] * stiffness;
                by.positions[vertex.index()] -= pull;
                *by_target += pull;
            }
            if let Some(touching) = &mut touching {
                let places = solve.at.positions.iter().zip(&solve.changes[..]);
                let end: Vec<DVec3> = places.map(|(x, v)| *x + *v * self.gamma).collect();
                let places = Places {
                    gamma: self.gamma,
                    time: self.dt,
                    start: self.start,
                    expected: &touching.expected,
                    end: &end,
                    point: self.point,
                    part: 1.0,
                };
                let mut by = PlaceSlopes {
                    start: &mut touching.by_start.positions,
                    velocities: &mut touching.by_start.velocities,
                    expected: &mut touching.by_expected,
                    end: &mut by.positions,
                    estimates: &mut touching.by_estimates,
                    masses: &mut touching.by_masses,
                    obstacles: touching.obstacles,
                    anchors: touching.anchors,
                };
                let (all, came_from) = (&solve.collisions, &solve.came_from);
                all.pull_forces(
                    came_from,
                    places,
                    &multipliers,
                    &mut by,
                    &mut touching.shapes,
                );
            }
        }
        system.collisions = Default::default();
        Ok(by_targets)
    }
}

/// A substep of backward Euler backwards, of which `substep` has the first solve alone.
pub(crate) fn pull_euler(
    system: &mut System,
    substep: &SubstepTape,
    pulled: &mut Pulled<'_>,
) -> Result<(), SolveError> {
    let (dt, start) = (substep.dt, &substep.start);
    let Some(solve) = substep.stages.first().and_then(|stage| stage.first()) else {
        return Ok(());
    };
    let end = pulled.state.clone();
    let places = end.positions.iter().zip(&end.velocities);
    let right: Vec<DVec3> = places.map(|(x, v)| *x * dt + *v).collect();
    system.assemble(dt, start, &substep.targets);
    let multipliers = system.solve_adjoint(&right)?;
    // By positions, and by the velocities that lead exact handles to their targets.
    let mut by = zeros(start.positions.len());
    let stiffness = system.pull_euler(dt, start, solve, &multipliers, (&mut by, pulled.sums));
    add(&mut by.positions, &end.positions, 1.0);
    add(&mut by.velocities, &right, 1.0);
    let is_exact = system.constraint() == HandleConstraint::Exact;
    for (handle, vertex) in system.handle_vertices().iter().enumerate() {
        let v = vertex.index();
        let target = &mut pulled.targets[handle];
        if is_exact {
            by.velocities[v] -= right[v];
            let led = (std::mem::take(&mut by.velocities[v]) + end.velocities[v]) / dt;
            *target += led + end.positions[v];
            by.positions[v] -= led + end.positions[v];
        } else {
            let pull = multipliers[v] * stiffness;
            by.positions[v] -= pull;
            by.velocities[v] -= pull * dt;
            *target += pull;
        }
    }
    *pulled.state = by;
    Ok(())
}
