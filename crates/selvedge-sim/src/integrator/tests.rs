//! The adjoint of a run against its forward sensitivities: the whole run once more in dual numbers along one
//! direction, with a dense matrix and Gaussian elimination. Slow and obvious.
//!
//! Numbers of elements, masses and environment are those of the solver; their rates are differences of scenes
//! that are moved along the direction, exact for all that enters linearly. All that follows is dual.

#![allow(clippy::print_stdout, reason = "the differences that were found")]

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    Environment, HandleTargets, Handles, Integrator, LinearSolver, Mesh, Scene, Stepper,
};

use super::SubstepTape;
use super::two_step::TwoStep;
use crate::contact::{AnchorRates, Moved};
use crate::edges::free_edges;
use crate::laws::bend::BendElement;
use crate::laws::external::{AirResistance, Drag, air_response};
use crate::laws::number::{Dual, DualVector, Number, Vector};
use crate::laws::stretch::{StretchElement, StretchResponse};
use crate::laws::stretch_energy::StretchEnergy;
use crate::solver::Elements;
use crate::{Gradient, GradientSettings, Simulator};

type D = Dual;
type V = DualVector;

/// Part of a direction by which scenes are moved for the rates of their numbers.
const STEP: f64 = 1e-5;

fn constant(value: f64) -> D {
    Dual {
        value,
        rates: [0.0],
    }
}

fn still(value: DVec3) -> V {
    DualVector::new(value, [DVec3::ZERO])
}

fn value(vector: V) -> DVec3 {
    DVec3::from_array(vector.0.map(|component| component.value))
}

fn rate(vector: V) -> DVec3 {
    vector.rates()[0]
}

/// Numbers with the rates that they have and those of a difference.
fn moved<const M: usize>(at: [D; M], [before, after]: [[f64; M]; 2]) -> [D; M] {
    std::array::from_fn(|k| Dual {
        rates: [at[k].rates[0] + (after[k] - before[k]) / (2.0 * STEP)],
        ..at[k]
    })
}

/// Numbers of three scenes: a part before, the scene, a part after.
fn between<const M: usize>([before, at, after]: [[f64; M]; 3]) -> [D; M] {
    moved(at.map(constant), [before, after])
}

/// Positions and velocities.
#[derive(Clone)]
struct Dynamic {
    x: Vec<V>,
    v: Vec<V>,
}

impl Dynamic {
    /// a + (a - b) · factor.
    fn extrapolated(&self, other: &Self, factor: f64) -> Self {
        let along = |a: &[V], b: &[V]| {
            let both = a.iter().zip(b);
            both.map(|(a, b)| *a + (*a - *b) * constant(factor))
                .collect()
        };
        Self {
            x: along(&self.x, &other.x),
            v: along(&self.v, &other.v),
        }
    }

    fn map(&self, other: &Self, of: impl Fn(V, V) -> V) -> Self {
        let both = |a: &[V], b: &[V]| a.iter().zip(b).map(|(a, b)| of(*a, *b)).collect();
        Self {
            x: both(&self.x, &other.x),
            v: both(&self.v, &other.v),
        }
    }
}

/// A cloth of one fabric whose numbers are dual.
struct Cloth {
    faces: Vec<([usize; 3], StretchElement<D>)>,
    hinges: Vec<([usize; 4], BendElement<D>)>,
    laws: [StretchEnergy; 3],
    air: [Environment; 3],
    mass: Vec<D>,
    damping: D,
    gravity: V,
    /// Ends, parts and length of each edge that is not held.
    edges: Vec<([usize; 2], [f64; 2], D)>,
    held: Vec<usize>,
    formula: TwoStep,
    dt: f64,
    substeps: usize,
}

impl Cloth {
    fn new(scenes: &[Scene; 3]) -> Self {
        let [_, scene, _] = scenes;
        let elements = scenes.each_ref().map(Elements::new);
        let faces = elements
            .each_ref()
            .map(|e| e.faces.elements().map(|(e, _)| e.numbers()));
        let faces = faces.map(Iterator::collect::<Vec<_>>);
        let hinges = elements
            .each_ref()
            .map(|e| e.hinges.elements().map(|e| e.numbers()));
        let hinges = hinges.map(Iterator::collect::<Vec<_>>);
        let one = |of: [f64; 3]| between(of.map(|value| [value]))[0];
        let held: Vec<usize> = scene.handles.vertices().iter().map(|v| v.index()).collect();
        let mask = scene.handles.mask(scene.mesh.positions().len());
        let edges = scenes
            .each_ref()
            .map(|scene| free_edges(&scene.mesh, &mask));
        let corners = elements[1].faces.corners().zip(0..);
        let wings = elements[1].hinges.corners().zip(0..);
        let Integrator::GeneralisedAlpha(alpha) = scene.physics.integrator else {
            panic!("the formula of second order")
        };
        Self {
            faces: corners
                .map(|(corners, k)| {
                    let numbers = faces.each_ref().map(|all| all[k]);
                    (
                        corners.map(|c| c as usize),
                        StretchElement::of(between(numbers)),
                    )
                })
                .collect(),
            hinges: wings
                .map(|(corners, k)| {
                    let numbers = hinges.each_ref().map(|all| all[k]);
                    (
                        corners.map(|c| c as usize),
                        BendElement::of(between(numbers)),
                    )
                })
                .collect(),
            laws: scenes
                .each_ref()
                .map(|scene| StretchEnergy::new(&scene.material.stretch)),
            air: scenes.each_ref().map(|scene| scene.environment),
            mass: (0..elements[1].mass.len())
                .map(|v| one(elements.each_ref().map(|e| e.mass[v])))
                .collect(),
            damping: one(scenes
                .each_ref()
                .map(|s| s.physics.damping(s.material.damping))),
            gravity: DualVector::of(between(
                scenes.each_ref().map(|s| s.environment.gravity.to_array()),
            )),
            edges: (0..edges[1].len())
                .map(|k| {
                    let edge = &edges[1][k];
                    (
                        edge.ends,
                        edge.parts,
                        one(edges.each_ref().map(|all| all[k].length)),
                    )
                })
                .collect(),
            held,
            formula: TwoStep::of(alpha.radius(scene.contact.is_some())),
            dt: 1.0 / (scene.frame_rate * f64::from(scene.physics.substeps)),
            substeps: scene.physics.substeps as usize,
        }
    }

    /// The response of a face at these corners: the law is that of the scene, with the rates of the others.
    fn respond(&self, element: &StretchElement<D>, corners: [V; 3]) -> StretchResponse<D> {
        let [before, law, after] = &self.laws;
        let plain = StretchElement::of(element.numbers().map(|number| number.value));
        let of = |law: &StretchEnergy| plain.respond(law, true, corners.map(value)).numbers();
        let numbers = element.respond(law, true, corners).numbers();
        StretchResponse::of(*element, moved(numbers, [of(before), of(after)]))
    }

    /// The force of the air on a face, and its resistance.
    fn blow(&self, area: D, corners: [V; 3], velocities: [V; 3]) -> (V, Drag<D>) {
        let [before, air, after] = &self.air;
        let tangent = AirResistance::Tangent;
        let of = |air: &Environment| {
            let (places, speeds) = (corners.map(value), velocities.map(value));
            let (force, drag) = air_response(air, tangent, area.value, places, speeds);
            (force.to_array(), drag.numbers())
        };
        let (force, drag) = air_response(air, tangent, area, corners, velocities);
        let (before, after) = (of(before), of(after));
        (
            DualVector::of(moved(force.components(), [before.0, after.0])),
            Drag::of(moved(drag.numbers(), [before.1, after.1])),
        )
    }

    /// A and b of a solve, `[3 vertices]`.
    fn assemble(&self, gamma: f64, base: &Dynamic, at: &Dynamic) -> (Vec<Vec<D>>, Vec<D>) {
        let count = 3 * at.x.len();
        let mut a = vec![vec![constant(0.0); count]; count];
        let mut b = vec![constant(0.0); count];
        let (g, zero) = (constant(gamma), constant(0.0));
        let (damped, all) = (g * self.damping, g * (g + self.damping));
        let mut push = |corner: usize, by: V| {
            for (axis, by) in by.components().into_iter().enumerate() {
                b[3 * corner + axis] = b[3 * corner + axis] + by;
            }
        };
        let mut couple = |row: usize, column: usize, columns: [V; 3]| {
            for (k, by) in columns.into_iter().enumerate() {
                for (axis, by) in by.components().into_iter().enumerate() {
                    let entry = &mut a[3 * row + axis][3 * column + k];
                    *entry = *entry + by;
                }
            }
        };
        let axes = DVec3::AXES.map(still);
        for (v, mass) in self.mass.iter().enumerate() {
            push(
                v,
                self.gravity * (*mass * g) + (base.v[v] - at.v[v]) * *mass,
            );
            couple(v, v, axes.map(|axis| axis * *mass));
        }
        for (corners, element) in &self.faces {
            let (places, rates) = (corners.map(|c| at.x[c]), corners.map(|c| at.v[c]));
            let response = self.respond(element, places);
            let (force, drag) = self.blow(element.area, places, rates);
            let (elastic, resisting) = (response.force(), response.negative_jacobian_times(rates));
            let third = constant(1.0 / 3.0);
            for i in 0..3 {
                push(
                    corners[i],
                    elastic[i] * g - resisting[i] * damped + force * (g * third),
                );
                for j in 0..3 {
                    let blown = axes.map(|axis| drag.resist(axis) * (g * third * third));
                    let block = response.negative_jacobian(i, j);
                    couple(
                        corners[i],
                        corners[j],
                        std::array::from_fn(|k| block[k] * all + blown[k]),
                    );
                }
            }
        }
        for (corners, element) in &self.hinges {
            let response = element.respond_by_energy(corners.map(|c| at.x[c]));
            let along = response.rate(corners.map(|c| at.v[c]));
            let pull = response.stiffness * response.angle * g + response.tangent * along * damped;
            for (i, gradient) in response.gradient.into_iter().enumerate() {
                push(corners[i], gradient * -pull);
                for (j, other) in response.gradient.into_iter().enumerate() {
                    let columns = other
                        .components()
                        .map(|by| gradient * (by * response.tangent * all));
                    couple(corners[i], corners[j], columns);
                }
            }
        }
        for v in self.held.iter().flat_map(|v| 3 * v..3 * v + 3) {
            b[v] = zero;
            a[v].fill(zero);
            a.iter_mut().for_each(|row| row[v] = zero);
            a[v][v] = constant(1.0);
        }
        (a, b)
    }

    /// Leads what is held to `targets`.
    fn lead(&self, gamma: f64, base: &Dynamic, at: &mut Dynamic, targets: &[V]) {
        for (v, target) in self.held.iter().zip(targets) {
            at.x[*v] = *target;
            at.v[*v] = (*target - base.x[*v]) / constant(gamma);
        }
    }

    /// The prediction of a stage, with its edges brought back to their lengths at `start`.
    fn predict(
        &self,
        gamma: f64,
        base: &Dynamic,
        speed: &[V],
        start: &[V],
        targets: &[V],
    ) -> Dynamic {
        let ahead = |(x, v): (&V, &V)| *x + *v * constant(gamma);
        let mut at = Dynamic {
            x: base.x.iter().zip(speed).map(ahead).collect(),
            v: speed.to_vec(),
        };
        self.lead(gamma, base, &mut at, targets);
        let raw = at.x.clone();
        self.project(start, &mut at.x);
        if raw != at.x {
            for v in 0..raw.len() {
                if value(at.x[v]) != value(base.x[v] + at.v[v] * constant(gamma)) {
                    at.v[v] = (at.x[v] - base.x[v]) / constant(gamma);
                }
            }
        }
        at
    }

    fn project(&self, start: &[V], places: &mut [V]) {
        let mut counts = vec![0.0_f64; places.len()];
        for (ends, ..) in &self.edges {
            ends.iter().for_each(|v| counts[*v] += 1.0);
        }
        let mut before = places.to_vec();
        let mut weight = 1.0;
        for pass in 0..6 {
            let mut shifts = vec![still(DVec3::ZERO); places.len()];
            for ([a, b], parts, length) in &self.edges {
                let first = start[*b] - start[*a];
                let (first, band) = (first.dot(first).sqrt(), *length * 0.001);
                let square = |length: D| length * length;
                let (least, most) = (square((first - band).at_least(0.0)), square(first + band));
                let way = places[*b] - places[*a];
                let now = way.dot(way);
                let limit = if now.value < least.value {
                    least
                } else if now.value > most.value {
                    most
                } else {
                    continue;
                };
                let excess = way * ((now - limit) / (now + limit));
                shifts[*a] = shifts[*a] + excess * constant(parts[0]);
                shifts[*b] = shifts[*b] - excess * constant(parts[1]);
            }
            if shifts.iter().all(|shift| value(*shift) == DVec3::ZERO) {
                return;
            }
            for v in 0..places.len() {
                let was = before[v];
                before[v] = places[v];
                if value(shifts[v]) != DVec3::ZERO {
                    let factor = constant(1.5 / counts[v].max(1.5));
                    let asked = places[v] + shifts[v] * factor;
                    places[v] = was + (asked - was) * constant(weight);
                }
            }
            weight = 4.0 / (4.0 - if pass == 0 { 2.0 } else { 1.0 } * 0.81 * weight);
        }
    }

    /// True if no edge changes its stretch by more than `bound`.
    fn keeps_lengths(&self, from: &[V], to: &[V], bound: f64) -> bool {
        let length = |all: &[V], [a, b]: [usize; 2]| value(all[a]).distance(value(all[b]));
        let mut edges = self.edges.iter();
        edges.all(|(ends, _, rest)| {
            (length(to, *ends) - length(from, *ends)).abs() <= bound * rest.value
        })
    }

    /// The solution of a stage.
    fn stage(
        &self,
        gamma: f64,
        base: &Dynamic,
        speed: &[V],
        start: &[V],
        targets: &[V],
    ) -> Dynamic {
        let mut at = self.predict(gamma, base, speed, start, targets);
        assert!(
            self.keeps_lengths(start, &at.x, 0.1),
            "it falls back to backward Euler"
        );
        for _ in 0..6 {
            let (a, b) = self.assemble(gamma, base, &at);
            let changes = eliminate(a, b);
            let to = stepped(&at, &changes, gamma);
            let from = std::mem::replace(&mut at, to);
            if self.keeps_lengths(&from.x, &at.x, 0.03) {
                break;
            }
        }
        at
    }

    /// A substep from `start`, which looks back to `before` or has none; and what the next one looks back to.
    fn substep(&self, start: &Dynamic, before: Option<&Dynamic>, ends: &[V]) -> [Dynamic; 2] {
        let formula = self.formula;
        let targets = |point: f64| -> Vec<V> {
            let ways = self.held.iter().map(|v| start.x[*v]).zip(ends);
            ways.map(|(now, end)| now + (*end - now) * constant(point))
                .collect()
        };
        let dt = self.dt;
        let Some(before) = before else {
            let part = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
            let first = self.stage(part * dt, start, &start.v, &start.x, &targets(part));
            let base = first.extrapolated(start, (1.0 - part) / part - 1.0);
            let end = self.stage(part * dt, &base, &first.v, &start.x, ends);
            let change = end.map(&base, |end, base| (end - base) / constant(part));
            let lagging = end.map(start, |end, start| end - start);
            let lagging = lagging.map(&change, |way, change| {
                (way - change) * constant(formula.lag())
            });
            let before = end.map(&change, |end, change| end - change);
            let before = before.map(&lagging, |before, lag| before - lag);
            return [end, before];
        };
        let base = start.extrapolated(before, formula.weight);
        let gamma = formula.gamma(dt);
        let there = self.stage(gamma, &base, &start.v, &start.x, &targets(formula.point));
        let point = constant(formula.point);
        let mut end = start.map(&there, |start, there| start + (there - start) / point);
        for (v, target) in self.held.iter().zip(ends) {
            end.x[*v] = *target;
        }
        let [by_end, by_start, by_before] = formula.before_weights().map(constant);
        let next = end.map(start, |end, start| end * by_end + start * by_start);
        let next = next.map(before, |sum, before| sum + before * by_before);
        [end, next]
    }

    /// A substep in which things touched, otherwise as [`Self::substep`]: its solves by the implicit function
    /// theorem, with the collisions that were recorded. `pulls` are the rates of the anchors.
    fn touching(
        &self,
        tape: &SubstepTape,
        start: &Dynamic,
        before: Option<&Dynamic>,
        pulls: &mut Vec<AnchorRates>,
    ) -> [Dynamic; 2] {
        assert!(self.formula.point == 1.0 && tape.pushed.is_empty() && tape.safe.is_none());
        let base = before.map_or(start.clone(), |before| {
            start.extrapolated(before, self.formula.weight)
        });
        let gamma = before.map_or(self.dt, |_| self.formula.gamma(self.dt));
        let mut at = self.predict(gamma, &base, &start.v, &start.x, &[]);
        let expected = at.x.clone();
        if !tape.touching.unwrap().is_near {
            at = Dynamic {
                x: base.x.clone(),
                v: vec![still(DVec3::ZERO); at.v.len()],
            };
        }
        let (mut estimates, mut shapes, mut left) = (Vec::new(), Vec::new(), Vec::new());
        for solve in &tape.stages[0] {
            let (a, b) = self.assemble(gamma, &base, &at);
            let changes = |v: usize| constant(solve.changes[v / 3][v % 3]);
            let places = at.x.iter().zip(&solve.changes[..]);
            let end: Vec<V> = places.map(|(x, dv)| *x + still(*dv * gamma)).collect();
            let moved = Moved {
                gamma,
                time: self.dt,
                point: 1.0,
                start: &start.x,
                velocities: &start.v,
                expected: &expected,
                end: &end,
                estimates: &estimates,
                masses: &self.mass,
                anchors: pulls,
            };
            let mut forces = vec![DVec3::ZERO; end.len()];
            let (collisions, came_from) = (&solve.collisions, &solve.came_from);
            let shapes_before = std::mem::take(&mut shapes);
            shapes = collisions
                .rates(came_from, &moved, &shapes_before, &mut forces)
                .0;
            // The rates of b - A Δv, and A with what touches.
            let residual: Vec<D> = (0..b.len())
                .map(|row| {
                    let product =
                        (0..b.len()).fold(constant(0.0), |sum, k| sum + a[row][k] * changes(k));
                    constant((b[row] - product).rates[0] + forces[row / 3][row % 3])
                })
                .collect();
            let mut whole: Vec<Vec<D>> = a
                .iter()
                .map(|row| row.iter().map(|n| constant(n.value)).collect())
                .collect();
            for column in 0..b.len() {
                let mut unit = vec![DVec3::ZERO; end.len()];
                unit[column / 3][column % 3] = 1.0;
                let mut product = vec![DVec3::ZERO; end.len()];
                collisions.multiply(1.0, &unit, &mut product);
                for (row, entries) in whole.iter_mut().enumerate() {
                    entries[column].value += product[row / 3][row % 3];
                }
            }
            let solved = eliminate(whole, residual)
                .into_iter()
                .zip(&solve.changes[..]);
            let changes: Vec<V> = solved
                .map(|(rates, dv)| DualVector::new(*dv, [value(rates)]))
                .collect();
            at = stepped(&at, &changes, gamma);
            let ended = Moved {
                end: &at.x,
                ..moved
            };
            left = collisions
                .rates(came_from, &ended, &shapes_before, &mut forces)
                .1;
            estimates.push(at.x.clone());
        }
        *pulls = left;
        let next = match before {
            Some(before) => {
                let [by_end, by_start, by_before] = self.formula.before_weights().map(constant);
                let next = at.map(start, |end, start| end * by_end + start * by_start);
                next.map(before, |sum, before| sum + before * by_before)
            }
            None => start.clone(),
        };
        [at, next]
    }

    /// The states after each frame, in which the handles go to `targets`, `[frames][handles]`, of a run that
    /// left these substeps.
    fn run(
        &self,
        mut state: Dynamic,
        targets: &[Vec<V>],
        recorded: &[&SubstepTape],
    ) -> Vec<Dynamic> {
        let (mut before, mut pulls, mut recorded) = (None, Vec::new(), recorded.iter());
        let frame = |targets: &Vec<V>| {
            let from: Vec<V> = self.held.iter().map(|v| state.x[*v]).collect();
            for number in 1..=self.substeps {
                let part = constant(number as f64 / self.substeps as f64);
                let ways = from.iter().zip(targets);
                let ends: Vec<V> = ways
                    .map(|(from, to)| *from + (*to - *from) * part)
                    .collect();
                let tape = recorded.next().unwrap();
                let looks_back = before.as_ref().filter(|_| tape.before.is_some());
                let [end, next] = if tape.touching.is_some() {
                    self.touching(tape, &state, looks_back, &mut pulls)
                } else {
                    pulls.clear();
                    self.substep(&state, looks_back, &ends)
                };
                (state, before) = (end, Some(next));
            }
            state.clone()
        };
        targets.iter().map(frame).collect()
    }
}

fn stepped(at: &Dynamic, changes: &[V], gamma: f64) -> Dynamic {
    Dynamic {
        x: at
            .x
            .iter()
            .zip(changes)
            .map(|(x, dv)| *x + *dv * constant(gamma))
            .collect(),
        v: at.v.iter().zip(changes).map(|(v, dv)| *v + *dv).collect(),
    }
}

/// The solution of a symmetric positive system.
fn eliminate(mut a: Vec<Vec<D>>, mut b: Vec<D>) -> Vec<V> {
    let count = b.len();
    for k in 0..count {
        let (pivot, right) = (a[k].clone(), b[k]);
        for row in k + 1..count {
            let factor = a[row][k] / pivot[k];
            if factor == constant(0.0) {
                continue;
            }
            for column in k..count {
                a[row][column] = a[row][column] - factor * pivot[column];
            }
            b[row] = b[row] - factor * right;
        }
    }
    for k in (0..count).rev() {
        let known = (k + 1..count).map(|j| (a[k][j], b[j]));
        let rest = known.fold(b[k], |rest, (entry, solved)| rest - entry * solved);
        b[k] = rest / a[k][k];
    }
    b.chunks(3)
        .map(|b| DualVector::of([b[0], b[1], b[2]]))
        .collect()
}

/// Scales the entries of a material's table, each by its own part.
fn scale_table(table: &mut [f64], part: f64) {
    let entries = table.iter_mut().enumerate();
    entries.for_each(|(k, entry)| *entry *= 1.0 + part * noise(k));
}

/// The derivative along [`scale_table`], of the gradient by the entries.
fn along_table(by: &[f64], table: &[f64]) -> f64 {
    let entries = by.iter().zip(table).enumerate();
    entries.map(|(k, (by, entry))| by * entry * noise(k)).sum()
}

/// Numbers between -1 and 1 that look random.
fn noise(k: usize) -> f64 {
    (12.9898 * k as f64 + 4.1).sin() * 43_758.545_3 % 1.0
}

fn vectors(from: usize, count: usize) -> Vec<DVec3> {
    let vector = |k| DVec3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2));
    (from..from + count).map(vector).collect()
}

/// Moves the points of a pattern without seams by a part of what looks random.
fn move_pattern(mesh: &mut Mesh, part: f64) {
    let points = mesh.material_coordinates().iter();
    let points = points.zip(vectors(8000, mesh.positions().len()));
    let points = points.map(|(p, n)| *p + n.truncate() * part).collect();
    let faces = mesh.topology().face_indices();
    *mesh = Mesh::new(&faces, points, mesh.positions().to_vec()).unwrap();
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// A rumpled cloth of 4 by 3 vertices in the wind whose upper corners are led.
fn hanging(fabric: &str) -> Scene {
    let points: Vec<DVec2> = (0..12)
        .map(|k| DVec2::new((k % 4) as f64, 2.0 - (k / 4) as f64) * 0.1)
        .zip(vectors(50, 12))
        .map(|(point, by)| point + by.truncate() * 0.01)
        .collect();
    let square = |k: u32| {
        let a = k / 3 * 4 + k % 3;
        match k % 2 {
            0 => [[a, a + 4, a + 5], [a, a + 5, a + 1]],
            _ => [[a, a + 4, a + 1], [a + 1, a + 4, a + 5]],
        }
    };
    let faces: Vec<[u32; 3]> = (0..6).flat_map(square).collect();
    let places = points.iter().map(|point| point.extend(0.0)).collect();
    let mesh = Mesh::new(&faces, points, places).unwrap();
    let handles = Handles::new(&[0, 3], 12).unwrap();
    let mut material: selvedge_cloth::Material = toml::from_str(fabric).unwrap();
    material.damping = 3e-3;
    let mut scene = Scene::of("forward", mesh, handles, material);
    scene.physics.even_bending = true;
    scene.physics.solver = LinearSolver::Cholesky;
    scene.environment.wind = DVec3::new(0.5, 0.3, -2.0);
    scene.environment.air_drag = 0.05;
    scene
}

/// A run, and weights of its value.
struct Case {
    scene: Scene,
    start: [Vec<DVec3>; 2],
    targets: Vec<Vec<DVec3>>,
}

/// Rates of what a run begins with, and of its scene for a part of it.
struct Direction {
    name: &'static str,
    start: [Vec<DVec3>; 2],
    targets: Vec<Vec<DVec3>>,
    scene: fn(&mut Scene, f64),
    by: fn(&Gradient, &Direction, &Scene) -> f64,
}

impl Case {
    fn new(scene: Scene, frames: usize) -> Self {
        let places = scene.mesh.positions();
        let rumpled = places.iter().zip(vectors(0, places.len()));
        let held = scene.handles.select(places);
        let way = |frame: usize| DVec3::new(0.4, 0.1, 0.2) * (0.002 * (frame as f64).powf(1.5));
        Self {
            start: [
                rumpled.map(|(x, n)| *x + n * 4e-3).collect(),
                vectors(500, places.len())
                    .iter()
                    .map(|n| *n * 0.3)
                    .collect(),
            ],
            targets: (1..=frames)
                .map(|frame| held.iter().map(|place| *place + way(frame)).collect())
                .collect(),
            scene,
        }
    }

    fn weights(&self, frame: usize) -> [Vec<DVec3>; 2] {
        let count = self.start[0].len();
        let velocities = vectors(2000 + 100 * frame, count);
        [
            vectors(1000 + 100 * frame, count),
            velocities.iter().map(|n| *n * 0.1).collect(),
        ]
    }

    /// The gradient, positions after each frame, and the solver with its recording.
    fn adjoint(&self) -> (Gradient, Vec<Vec<DVec3>>, Simulator) {
        let [places, velocities] = self.start.clone();
        let mut cloth = Simulator::with_state(&self.scene, places, velocities).unwrap();
        cloth.record_gradient(GradientSettings::default()).unwrap();
        let step = |targets: &Vec<DVec3>| {
            cloth
                .step(&HandleTargets::at_frame_end(targets.clone()).unwrap())
                .unwrap();
            cloth.positions_f64().to_vec()
        };
        let places = self.targets.iter().map(step).collect();
        let gradient = cloth.backward(&mut |frame, by| {
            if frame > 0 {
                let weights = self.weights(frame);
                let both = [&mut by.positions, &mut by.velocities]
                    .into_iter()
                    .zip(weights);
                both.for_each(|(by, weights)| {
                    by.iter_mut()
                        .zip(weights)
                        .for_each(|(by, weight)| *by += weight);
                });
            }
        });
        (gradient.unwrap(), places, cloth)
    }

    /// The slope of the value along `direction`, and positions after each frame.
    fn forward(&self, cloth: &Simulator, direction: &Direction) -> (f64, Vec<Vec<DVec3>>) {
        let scenes = [-STEP, 0.0, STEP].map(|part| {
            let mut scene = self.scene.clone();
            (direction.scene)(&mut scene, part);
            scene
        });
        let both = |values: &[DVec3], rates: &[DVec3]| -> Vec<V> {
            let rates = rates.iter().copied().chain(std::iter::repeat(DVec3::ZERO));
            values
                .iter()
                .zip(rates)
                .map(|(value, rate)| DualVector::new(*value, [rate]))
                .collect()
        };
        let start = Dynamic {
            x: both(&self.start[0], &direction.start[0]),
            v: both(&self.start[1], &direction.start[1]),
        };
        let none = Vec::new();
        let targets = self.targets.iter().enumerate();
        let targets: Vec<Vec<V>> = targets
            .map(|(k, places)| both(places, direction.targets.get(k).unwrap_or(&none)))
            .collect();
        let recorded: Vec<_> = cloth.recorded().collect();
        let frames = Cloth::new(&scenes).run(start, &targets, &recorded);
        let mut slope = 0.0;
        for (k, frame) in frames.iter().enumerate() {
            for (of, weights) in [&frame.x, &frame.v].into_iter().zip(self.weights(k + 1)) {
                slope += of
                    .iter()
                    .zip(weights)
                    .map(|(of, weight)| rate(*of).dot(weight))
                    .sum::<f64>();
            }
        }
        let places = frames
            .iter()
            .map(|frame| frame.x.iter().map(|x| value(*x)).collect());
        (slope, places.collect())
    }

    fn check(&self, name: &str, directions: &[Direction]) {
        let (gradient, expected, cloth) = self.adjoint();
        for direction in directions {
            let (slope, places) = self.forward(&cloth, direction);
            for (frame, (places, expected)) in places.iter().zip(&expected).enumerate() {
                for (place, expected) in places.iter().zip(expected) {
                    let off = place.distance(*expected);
                    assert!(
                        off < 1e-10,
                        "{name}, frame {frame}: the reference is {off} m off"
                    );
                }
            }
            let found = (direction.by)(&gradient, direction, &self.scene);
            let error = (found - slope).abs() / slope.abs();
            println!(
                "{name}, {}: adjoint {found:.12e}, forward {slope:.12e}, {error:.1e}",
                direction.name
            );
            assert!(error < 1e-8, "{name}, {}: {found} {slope}", direction.name);
        }
    }
}

/// Directions of everything that a run of `frames` depends on.
fn directions(vertices: usize, handles: usize, frames: usize) -> Vec<Direction> {
    let none = || Direction {
        name: "",
        start: [Vec::new(), Vec::new()],
        targets: Vec::new(),
        scene: |_, _| (),
        by: |_, _, _| 0.0,
    };
    let mut all = vec![
        Direction {
            name: "start",
            start: [vectors(3000, vertices), Vec::new()],
            by: |by, along, _| dot(&by.start.positions, &along.start[0]),
            ..none()
        },
        Direction {
            name: "velocities",
            start: [Vec::new(), vectors(3100, vertices)],
            by: |by, along, _| dot(&by.start.velocities, &along.start[1]),
            ..none()
        },
        Direction {
            name: "gravity",
            scene: |scene, part| scene.environment.gravity += DVec3::new(0.3, -0.5, 0.7) * part,
            by: |by, _, _| by.gravity.dot(DVec3::new(0.3, -0.5, 0.7)),
            ..none()
        },
        Direction {
            name: "wind",
            scene: |scene, part| scene.environment.wind += DVec3::new(0.3, -0.5, 0.7) * part,
            by: |by, _, _| by.wind.dot(DVec3::new(0.3, -0.5, 0.7)),
            ..none()
        },
        Direction {
            name: "density of the air",
            scene: |scene, part| scene.environment.air_density += part,
            by: |by, _, _| by.air_density,
            ..none()
        },
        Direction {
            name: "drag of the air",
            scene: |scene, part| scene.environment.air_drag += part,
            by: |by, _, _| by.air_drag,
            ..none()
        },
        Direction {
            name: "density",
            scene: |scene, part| scene.material.density += part,
            by: |by, _, _| by.materials[0].density,
            ..none()
        },
        Direction {
            name: "damping",
            scene: |scene, part| scene.material.damping += part,
            by: |by, _, _| by.materials[0].damping,
            ..none()
        },
        Direction {
            name: "stretching",
            scene: |scene, part| scale_table(scene.material.stretch.0.as_flattened_mut(), part),
            by: |by, _, scene| {
                let table = scene.material.stretch.0.as_flattened();
                along_table(by.materials[0].stretch.as_flattened(), table)
            },
            ..none()
        },
        Direction {
            name: "bending",
            scene: |scene, part| scale_table(scene.material.bend.0.as_flattened_mut(), part),
            by: |by, _, scene| {
                let table = scene.material.bend.0.as_flattened();
                along_table(by.materials[0].bend.as_flattened(), table)
            },
            ..none()
        },
        Direction {
            name: "rest angles",
            scene: |scene, part| {
                let edges = 0..scene.mesh.topology().edges().len();
                let angles = edges.map(|k| part * noise(k)).collect();
                scene.mesh = scene.mesh.clone().with_rest_angles(angles).unwrap();
            },
            by: |by, _, _| {
                by.rest_angles
                    .iter()
                    .enumerate()
                    .map(|(k, by)| by * noise(k))
                    .sum()
            },
            ..none()
        },
        Direction {
            name: "pattern",
            scene: |scene, part| move_pattern(&mut scene.mesh, 0.1 * part),
            by: |by, _, _| {
                let points = by.pattern.iter().zip(vectors(8000, by.pattern.len()));
                points.map(|(by, n)| 0.1 * by.dot(n.truncate())).sum()
            },
            ..none()
        },
    ];
    if handles > 0 {
        all.push(Direction {
            name: "handles",
            targets: (0..frames)
                .map(|k| vectors(3200 + 10 * k, handles))
                .collect(),
            by: |by, along, _| {
                let frames = by.targets.iter().zip(&along.targets);
                frames.map(|(by, along)| dot(by, along)).sum()
            },
            ..none()
        });
    }
    all
}

#[test]
fn the_adjoint_is_the_forward_sensitivity() {
    for (name, fabric) in &selvedge_assets::MATERIALS[..4] {
        Case::new(hanging(fabric), 8).check(name, &directions(12, 2, 8));
    }
}

/// A rumpled sheet that falls askew onto a body with friction.
fn falling(body: selvedge_cloth::bodies::Body) -> Scene {
    let mut scene = hanging(selvedge_assets::MATERIALS[0].1);
    scene.handles = Handles::new(&[], 12).unwrap();
    let lying = |p: &DVec3| DVec3::new(p.x - 0.15, 6e-3 + 0.03 * p.y, p.y - 0.1);
    let places = scene.mesh.positions().iter().map(lying).collect();
    scene.mesh = scene.mesh.with_positions(places).unwrap();
    scene.environment.wind = DVec3::new(0.5, -0.2, 0.1);
    scene.obstacles = vec![selvedge_cloth::Obstacle::of("body", body).unwrap()];
    scene.contact = Some(selvedge_cloth::ContactSettings {
        thickness: 2e-3,
        friction: 0.4,
        ..Default::default()
    });
    scene
}

#[test]
fn the_adjoint_is_the_forward_sensitivity_with_contact() {
    use selvedge_cloth::bodies;
    let ball = bodies::sphere(0.2, 0.1).placed(1.0, |p| p - DVec3::Y * 0.2);
    for (name, body) in [("floor", bodies::plane([1.0, 1.0])), ("ball", ball)] {
        let case = Case::new(falling(body), 8);
        let (_, _, cloth) = case.adjoint();
        let touching = cloth
            .recorded()
            .filter(|substep| substep.touching.is_some());
        assert!(touching.count() > 4, "{name}");
        case.check(name, &directions(12, 0, 8));
    }
}
