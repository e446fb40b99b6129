//! Derivatives of what touches: of the forces of a solve, and of the pull that its friction leaves for the
//! next substep, by the places from which they came.
//!
//! The force of a collision is one function of its shape (direction, weights, gap, masses), where its corners were
//! expected, where they end, and the pull of its anchor; the shape is one of corners at the start. Both go
//! backwards by hand but for what dual numbers do: the laws of a gap, the share of two edges, and the way to where a
//! pair meets. A pair keeps its shape over the solves of a substep, so derivatives by it are added up, and taken to
//! its corners once. Which pairs push and the branches of their
//! laws count as decided, and so does the gap that a pair missed in the last substep needed.

use std::array::from_fn;

use glam::DVec3;
use selvedge_cloth::Touching;
use selvedge_contact::number::{Dual, Number, Vector};
use selvedge_contact::{Kind, weights};

use super::barrier::{Barrier, Tangent};
use super::came_from::{At, CollisionTape, ShapeOrigin, ShapeTape, Share};
use super::collisions::{Collision, Collisions, PairLaw, RECOVERY, SHEAR, Sticking};
use super::friction::along_surface;
use super::narrow_phase::{distance, edge_share, round_share};

/// Difference of a slip as a part of it, from which it is not what the start tells.
const SAME: f64 = 1e-7;
/// The same of slips `[m]`.
const ROUNDING: f64 = 1e-13;

/// Derivative by the pull of an anchor that a substep left `[1/N]`, and by up to which compression it bears.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnchorSlope {
    of: Touching,
    normal: DVec3,
    by: DVec3,
    by_pressed: f64,
}

/// A solve over `time` `[s]` with a stage of γ `[s]`, and places of the cloth's vertices `[m]`,
/// `[vertices]`: where they start, where they were expected, and where they end.
#[derive(Clone, Copy)]
pub(crate) struct Places<'a> {
    pub(crate) gamma: f64,
    pub(crate) time: f64,
    pub(crate) start: &'a [DVec3],
    pub(crate) expected: &'a [DVec3],
    pub(crate) end: &'a [DVec3],
    /// The point of the substep at which its equations hold.
    pub(crate) point: f64,
    /// The part of the solve that was safe.
    pub(crate) part: f64,
}

/// Derivatives by places of the cloth's vertices `[vertices]`, to which those of collisions are added.
pub(crate) struct PlaceSlopes<'a> {
    pub(crate) start: &'a mut [DVec3],
    /// By velocities at the start.
    pub(crate) velocities: &'a mut [DVec3],
    pub(crate) expected: &'a mut [DVec3],
    pub(crate) end: &'a mut [DVec3],
    /// By the estimates of all solves, `[solves, vertices]`.
    pub(crate) estimates: &'a mut [Vec<DVec3>],
    /// By masses `[vertices]`.
    pub(crate) masses: &'a mut [f64],
    /// By the places of obstacles at the start and the end, `[obstacles]`.
    pub(crate) obstacles: &'a mut [[ObstacleSlope; 2]],
    /// By the pulls of anchors at the start.
    pub(crate) anchors: &'a mut Vec<AnchorSlope>,
}

/// Derivative by a rigid motion of an obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ObstacleSlope {
    /// By a translation `[1/m]`.
    pub translation: DVec3,
    /// By a rotation about the origin, along its axis `[1/rad]`. What a round body drags along because it spins
    /// is left out.
    pub rotation: DVec3,
}

impl ObstacleSlope {
    /// Adds the derivative by a point at `place` `[m]`.
    fn push(&mut self, place: DVec3, by: DVec3) {
        self.translation += by;
        self.rotation += place.cross(by);
    }

    /// Adds this part of another one.
    pub(crate) fn add(&mut self, other: Self, part: f64) {
        self.translation += other.translation * part;
        self.rotation += other.rotation * part;
    }
}

/// What of a collision is differentiated.
#[derive(Clone, Copy)]
enum Value {
    /// γ Σ λ·f over its corners, of these λ.
    Work([DVec3; 4]),
    /// The pull of the anchor that it leaves, times this, and up to which compression that bears, times this.
    Anchor(DVec3, f64),
}

/// Numbers of a collision's shape: weights of its corners, direction, gap at the start, drift, masses, its part
/// of the barrier, and half of the distance of its features at the start.
const WEIGHTS: usize = 0;
const NORMAL: usize = 4;
const GAP: usize = 7;
const DRIFT: usize = 8;
const MEAN_MASS: usize = 11;
const MASS: usize = 12;
const SHARE: usize = 13;
const HALF: usize = 14;
const SHAPE: usize = 15;
/// Numbers by which derivatives are taken at once.
const RATES: usize = 12;

/// Derivatives by the numbers of a collision's shape.
pub(crate) type ShapeSlopes = [f64; SHAPE];

/// Derivatives of `value`, a function of these numbers, by those that are `wanted`.
fn slopes_of<const M: usize>(
    numbers: &[f64; M],
    wanted: impl Fn(usize) -> bool,
    value: impl Fn(&[Dual<RATES>; M]) -> Dual<RATES>,
) -> [f64; M] {
    let mut duals = numbers.map(|value| Dual {
        value,
        rates: [0.0; RATES],
    });
    let (mut slopes, mut moved) = ([0.0; M], [0; RATES]);
    let mut wanted = (0..M).filter(|number| wanted(*number)).peekable();
    while wanted.peek().is_some() {
        let mut count = 0;
        for number in wanted.by_ref().take(RATES) {
            duals[number].rates[count] = 1.0;
            moved[count] = number;
            count += 1;
        }
        let rates = value(&duals).rates;
        for (k, number) in moved[..count].iter().enumerate() {
            slopes[*number] = rates[k];
            duals[*number].rates[k] = 0.0;
        }
    }
    slopes
}

fn vector<N: Number>(numbers: &[N], first: usize) -> N::Vector {
    N::Vector::of([numbers[first], numbers[first + 1], numbers[first + 2]])
}

fn four<N: Number>(numbers: &[N], first: usize) -> [N::Vector; 4] {
    from_fn(|k| vector(numbers, first + 3 * k))
}

fn set(numbers: &mut [f64], first: usize, vector: DVec3) {
    numbers[first..first + 3].copy_from_slice(&vector.to_array());
}

fn slope(slopes: &[f64], first: usize) -> DVec3 {
    DVec3::from_slice(&slopes[first..])
}

fn lift<N: Number>(one: N, vector: DVec3) -> N::Vector {
    N::Vector::of(vector.to_array().map(|component| one.same(component)))
}

fn add(slopes: &mut [f64], first: usize, vector: DVec3) {
    for (sum, component) in slopes[first..].iter_mut().zip(vector.to_array()) {
        *sum += component;
    }
}

/// Adds `by` times the rates of `number`.
fn add_rates<const K: usize>(sums: &mut [f64; K], number: Dual<K>, by: f64) {
    for (sum, rate) in sums.iter_mut().zip(number.rates) {
        *sum += rate * by;
    }
}

/// These numbers, each with a direction of its own.
fn variables<const K: usize>(values: [f64; K]) -> [Dual<K>; K] {
    from_fn(|k| {
        let mut rates = [0.0; K];
        rates[k] = 1.0;
        Dual {
            value: values[k],
            rates,
        }
    })
}

/// Σ w x.
fn weighted<const K: usize>(weights: [f64; K], vectors: [DVec3; K]) -> DVec3 {
    let parts = vectors.into_iter().zip(weights);
    parts.map(|(vector, weight)| vector * weight).sum()
}

/// Derivatives of a value of a collision.
#[derive(Default)]
struct ForceSlopes {
    /// By its gap, part of the barrier, masses, and half of the distance at the start.
    by_scalars: [f64; 5],
    by_weights: [f64; 4],
    by_normal: DVec3,
    /// By displacements where it was expected, where it ends, and where it has slid.
    by_displacements: [DVec3; 3],
    /// By the pull of the anchor at the start, and by up to which compression it bears.
    by_pull: DVec3,
    by_pressed: f64,
}

impl Collisions {
    /// Adds the derivatives of γ Σ λ·f of a solve, of these `multipliers` λ, `[vertices]`. `shapes` are those by
    /// the shapes of its collisions, then by those of the solve before.
    pub(crate) fn pull_forces(
        &self,
        came_from: &[CollisionTape],
        places: Places<'_>,
        multipliers: &[DVec3],
        by: &mut PlaceSlopes<'_>,
        shapes: &mut Vec<ShapeSlopes>,
    ) {
        shapes.resize(self.list.len(), [0.0; SHAPE]);
        let mut before: Vec<ShapeSlopes> = Vec::new();
        for ((collision, tape), shape) in self.list.iter().zip(came_from).zip(shapes.iter_mut()) {
            let own = collision.of_cloth(multipliers);
            if own != [DVec3::ZERO; 4] {
                collision.pull_back(tape, places, Value::Work(own), by, shape);
            }
            match &tape.shape {
                ShapeOrigin::Own(from) if *shape != [0.0; SHAPE] => {
                    collision.pull_shape(from, shape, by);
                }
                ShapeOrigin::Own(_) => {}
                ShapeOrigin::Earlier(earlier) => {
                    let room = before.len().max(*earlier + 1);
                    before.resize(room, [0.0; SHAPE]);
                    let sums = before[*earlier].iter_mut().zip(shape);
                    sums.for_each(|(sum, slope)| *sum += *slope);
                }
            }
        }
        *shapes = before;
    }

    /// Adds the derivatives of the pulls that the collisions of the last solve have left, of which `slopes` are
    /// known.
    pub(crate) fn pull_anchors(
        &self,
        came_from: &[CollisionTape],
        places: Places<'_>,
        mut slopes: Vec<AnchorSlope>,
        by: &mut PlaceSlopes<'_>,
        shapes: &mut Vec<ShapeSlopes>,
    ) {
        shapes.resize(self.list.len(), [0.0; SHAPE]);
        slopes.sort_by_key(|slope| slope.of);
        for ((collision, tape), shape) in self.list.iter().zip(came_from).zip(shapes) {
            let first = slopes.partition_point(|slope| Some(slope.of) < collision.anchored);
            let of = slopes[first..].iter();
            let of = of.take_while(|slope| collision.anchored == Some(slope.of));
            let own = of.filter(|slope| collision.normal == slope.normal);
            let (pull, pressed) = own.fold((DVec3::ZERO, 0.0), |(pull, pressed), slope| {
                (pull + slope.by, pressed + slope.by_pressed)
            });
            if pull != DVec3::ZERO || pressed != 0.0 {
                collision.pull_back(tape, places, Value::Anchor(pull, pressed), by, shape);
            }
        }
    }

    /// Memory of a recording, with what the collisions came from `[bytes]`.
    pub(crate) fn bytes(&self, came_from: &[CollisionTape]) -> usize {
        let boxed = came_from.iter().map(|tape| {
            let shape = match tape.shape {
                ShapeOrigin::Own(_) => size_of::<ShapeTape>(),
                ShapeOrigin::Earlier(_) => 0,
            };
            shape + tape.slid.as_deref().map_or(0, size_of_val)
        });
        boxed.sum::<usize>()
            + size_of_val(came_from)
            + size_of_val(&self.list[..])
            + size_of_val(&self.expected[..])
    }
}

impl Collision {
    /// Values of the cloth's corners, 0 of others.
    fn of_cloth(&self, values: &[DVec3]) -> [DVec3; 4] {
        let value = |corner: u32| values.get(corner as usize).copied();
        self.corners.map(|corner| value(corner).unwrap_or_default())
    }

    /// Adds the derivatives of `value`, those by its shape to `shape`.
    fn pull_back(
        &self,
        tape: &CollisionTape,
        places: Places<'_>,
        value: Value,
        by: &mut PlaceSlopes<'_>,
        shape: &mut ShapeSlopes,
    ) {
        let is_cloth = self
            .corners
            .map(|corner| (corner as usize) < places.end.len());
        let starts = self.of_cloth(places.start);
        let since_start = |at: [DVec3; 4]| -> [DVec3; 4] { from_fn(|k| at[k] - starts[k]) };
        let own = [
            since_start(self.of_cloth(places.expected)),
            since_start(self.of_cloth(places.end)),
            since_start(tape.slid.as_deref().map_or(starts, |(_, places)| *places)),
        ];
        let parts = [1.0, places.part, f64::from(u8::from(tape.slid.is_some()))];
        // Displacements of the first side against the second: where it was expected, where it ends, and where an
        // earlier solve has shown that it slides.
        let displacements = from_fn(|k| self.drift * parts[k] + weighted(self.weights, own[k]));
        let slopes = self.slopes(tape, places, value, displacements);
        let sums = [GAP, SHARE, MEAN_MASS, MASS, HALF].into_iter();
        for (number, slope) in sums.zip(slopes.by_scalars) {
            let counts = match number {
                SHARE => tape.has_share,
                HALF => matches!(tape.at, At::Half),
                MEAN_MASS | MASS => tape.has_way,
                _ => true,
            };
            shape[number] += if counts { slope } else { 0.0 };
        }
        let by_displacements = slopes.by_displacements;
        if tape.has_way {
            for k in (0..4).filter(|k| is_cloth[*k]) {
                shape[k] += slopes.by_weights[k];
                shape[k] += (0..3)
                    .map(|d| by_displacements[d].dot(own[d][k]))
                    .sum::<f64>();
            }
            add(shape, NORMAL, slopes.by_normal);
            if is_cloth.contains(&false) {
                add(shape, DRIFT, weighted(parts, by_displacements));
            }
        }
        let [expected, end, slid] = by_displacements;
        for k in (0..4).filter(|k| is_cloth[*k]) {
            let (corner, weight) = (self.corners[k] as usize, self.weights[k]);
            by.start[corner] -= (expected + end + slid) * weight;
            by.expected[corner] += expected * weight;
            by.end[corner] += end * weight;
            if let Some((solve, _)) = tape.slid.as_deref() {
                by.estimates[*solve][corner] += slid * (weight / places.point);
                by.start[corner] += slid * (weight * (1.0 - 1.0 / places.point));
            }
        }
        if let Some(anchor) = tape.anchor {
            by.anchors.push(AnchorSlope {
                of: anchor.of,
                normal: anchor.normal,
                by: slopes.by_pull,
                by_pressed: slopes.by_pressed,
            });
        }
    }

    /// The derivatives of `value` with these displacements. Those of barrier, pressure and inertia are by dual
    /// numbers, the rest by hand.
    fn slopes(
        &self,
        tape: &CollisionTape,
        places: Places<'_>,
        value: Value,
        [expected, end, slid]: [DVec3; 3],
    ) -> ForceSlopes {
        let (normal, gamma, time) = (self.normal, places.gamma, places.time);
        let mut slopes = ForceSlopes::default();
        let PairLaw::Barrier { share } = self.law else {
            // A push out of a body counts as decided but for where it ends.
            if let Value::Work(multipliers) = value {
                let along = weighted(self.weights, multipliers).dot(normal) * gamma;
                let stiffness = self.response.tangent.stiffness;
                slopes.by_displacements[1] = normal * (-along * stiffness);
            }
            return slopes;
        };
        let gap_at = |displacement: DVec3| self.gap + normal.dot(displacement);
        let scalars = [
            self.gap,
            share,
            self.mean_mass,
            self.mass,
            self.at.unwrap_or_default(),
            gap_at(expected),
            gap_at(end),
            gap_at(slid),
            self.pressure.pressed,
        ];
        let [
            gap,
            share,
            mean_mass,
            mass,
            half,
            estimate,
            at_end,
            at_slid,
            pressed,
        ] = variables(scalars);
        let pressure = self.pressure.with(pressed);
        let inertia = mass * (1.0 / (time * time));
        let barrier = Barrier {
            thickness: self.thickness,
            base: mean_mass * (1.0 / (time * time)),
            share,
            inertia: mass * (1.0 / (gamma * gamma)),
            pressure,
            recovery: RECOVERY / time,
        };
        let tangent: Tangent<Dual<9>> = match (self.at, tape.at) {
            (None, _) => barrier.linearise(gap, estimate),
            (Some(at), At::Fixed) => barrier.at(gap.same(at), gap),
            (Some(_), At::Start) => barrier.at(gap, gap),
            (Some(_), At::Half) => barrier.at(half, gap),
        };
        let grip = match pressure.firm(gap, self.thickness) {
            Some(firm) => inertia.greater(firm.stiffness * SHEAR),
            None => inertia,
        };
        let bearing = |gap| tangent.force_at(gap).at_least(0.0) * self.friction;
        let anchor = tape.anchor.map_or(DVec3::ZERO, |anchor| anchor.pull);
        let pull = along_surface(normal, anchor);
        let slip_at = |displacement| along_surface(normal, pull / grip.value + displacement);
        let slip = slip_at(end);
        // Derivatives by the slip at the end; by another one, and whose that is.
        let (mut by_slip, mut by_other) = (DVec3::ZERO, None);
        let mut by_grip = 0.0;
        let mut rates = [0.0; 9];
        match value {
            Value::Anchor(by, by_pressed) => {
                let [was, way, gap] = variables([scalars[8], end.length(), scalars[6]]);
                let ways = [way, gap.same(normal.dot(end))];
                let pressure = self.pressure.with(was);
                let left = pressure.pressed_after(places.part * time, ways, gap, self.thickness);
                let [by_was, by_way, by_gap] = left.rates.map(|rate| rate * by_pressed);
                (rates[8], rates[6]) = (by_was, by_gap);
                slopes.by_displacements[1] += end.normalize_or_zero() * by_way;
                let most = bearing(at_end);
                let (stiffness, length) = (grip.value, slip.length());
                if most.value > 0.0 && stiffness * length <= most.value {
                    (by_slip, by_grip) = (by * stiffness, by.dot(slip));
                } else if most.value > 0.0 {
                    let direction = slip / length;
                    by_slip = along_surface(direction, by) * (most.value / length);
                    add_rates(&mut rates, most, by.dot(direction));
                }
            }
            Value::Work(multipliers) => {
                let by = weighted(self.weights, multipliers) * gamma;
                let usual = barrier.bears(&tangent, gap, estimate) * self.friction;
                let (at, of, most) = match self.sticking {
                    Sticking::Sticks => (DVec3::ZERO, None, usual),
                    Sticking::Unknown | Sticking::Light => (slip_at(expected), Some(0), usual),
                    Sticking::Slides(at, bound) => {
                        let (first, of, most) = match tape.slid {
                            Some(_) => (slip_at(slid), 2, bearing(at_slid)),
                            None => (slip_at(expected), 0, usual),
                        };
                        // What an earlier end has shown counts as decided.
                        if at.distance(first) <= SAME * at.length() + ROUNDING {
                            (first, Some(of), most)
                        } else {
                            (at, None, gap.same(bound))
                        }
                    }
                };
                let (stiffness, length) = (grip.value, at.length());
                let holds = matches!(self.sticking, Sticking::Sticks);
                let force = tangent.force_at(at_end);
                let drag = if holds || stiffness * length <= most.value {
                    (by_slip, by_grip) = (by * -stiffness, -by.dot(slip));
                    slip * -stiffness
                } else {
                    let (u, part) = (at / length, most.value / length);
                    let (turned, across) = (along_surface(u, slip), along_surface(u, by));
                    by_slip = across * -part;
                    add_rates(&mut rates, most, -(by.dot(u) + by.dot(turned) / length));
                    let by_u = (by * u.dot(slip) + slip * by.dot(u)) * part - by * most.value;
                    let by_length = part / length * by.dot(turned);
                    by_other = of.map(|of| (of, (along_surface(u, by_u) / length) + u * by_length));
                    u * -most.value - turned * part
                };
                add_rates(&mut rates, force, by.dot(normal));
                slopes.by_normal += by * force.value;
                let whole = (normal * force.value + drag) * gamma;
                slopes.by_weights = multipliers.map(|multiplier| multiplier.dot(whole));
            }
        }
        for (of, by_slip) in [Some((1, by_slip)), by_other].into_iter().flatten() {
            let at = pull / grip.value + [expected, end, slid][of];
            slopes.by_normal -= by_slip * normal.dot(at) + at * normal.dot(by_slip);
            let by = along_surface(normal, by_slip);
            slopes.by_displacements[of] += by;
            slopes.by_pull += by / grip.value;
            by_grip -= by.dot(pull) / (grip.value * grip.value);
        }
        slopes.by_normal -= slopes.by_pull * normal.dot(anchor);
        add_rates(&mut rates, grip, by_grip);
        for (k, displacement) in [expected, end, slid].into_iter().enumerate() {
            slopes.by_displacements[k] += normal * rates[5 + k];
            slopes.by_normal += displacement * rates[5 + k];
            rates[0] += rates[5 + k];
        }
        slopes.by_scalars.copy_from_slice(&rates[..5]);
        slopes.by_pressed = rates[8];
        slopes
    }

    /// Adds the derivatives by what the shape came from, of these `slopes` by its numbers.
    fn pull_shape(&self, from: &ShapeTape, slopes: &ShapeSlopes, by: &mut PlaceSlopes<'_>) {
        let (kind, starts) = (from.kind, from.starts);
        let mut by_starts = [DVec3::ZERO; 4];
        let mut by_ends = [DVec3::ZERO; 4];
        let (by_gap, by_drift) = (slopes[GAP], slope(slopes, DRIFT));
        let met = from.way.map(|way| {
            let to = [starts, way.to];
            way.places::<f64>(kind, from.radius, starts, to)
        });
        let parts = met.map_or(self.weights, |met| weights::<f64>(kind, met));
        let between = met.map_or(self.normal, |met| weighted(parts, met));
        let normal = if met.is_some() { between.normalize() } else { self.normal };
        let mut by_weights: [f64; 4] = from_fn(|k| slopes[WEIGHTS + k]);
        let mut by_normal = slope(slopes, NORMAL);
        if slopes[SHARE] != 0.0 || slopes[HALF] != 0.0 {
            let by_both = [slopes[SHARE], slopes[HALF]];
            let slopes = self.share_slopes(from, (parts, normal), by_both);
            for k in 0..4 {
                by_starts[k] += slope(&slopes, 3 * k);
                by_weights[k] += slopes[24 + k];
                let Share::Edges(wings) = from.share else {
                    continue;
                };
                let Some((vertex, place)) = wings.as_flattened()[k] else {
                    continue;
                };
                let slope = slope(&slopes, 12 + 3 * k);
                match (by.start.get_mut(vertex), from.obstacle) {
                    (Some(sum), _) => *sum += slope,
                    (None, Some(obstacle)) => by.obstacles[obstacle][0].push(place, slope),
                    (None, None) => {}
                }
            }
            by_normal += slope(&slopes, 28);
        }
        for (by_start, weight) in by_starts.iter_mut().zip(parts) {
            *by_start += normal * (by_gap * weight);
        }
        if let (Some(way), Some(met)) = (from.way, met) {
            by_normal += weighted(parts, starts) * by_gap + from.turn.transpose() * by_drift;
            let by_between = along_surface(normal, by_normal) / between.length();
            let free = || (0..4).filter(|k| from.inverse[*k] > 0.0);
            let square = |k: usize| parts[k] * parts[k];
            let squares: f64 = free().map(square).sum();
            let mean = free().map(|k| square(k) / from.inverse[k]).sum::<f64>() / squares;
            let mass = 1.0 / free().map(|k| square(k) * from.inverse[k]).sum::<f64>();
            let (by_mean, by_mass) = (slopes[MEAN_MASS] / squares, slopes[MASS] * mass * mass);
            for k in free() {
                let own = from.inverse[k];
                by_weights[k] += 2.0 * parts[k] * (by_mean * (1.0 / own - mean) - by_mass * own);
                by.masses[self.corners[k] as usize] += square(k) * (by_mean + by_mass * own * own);
            }
            let mut by_met = [DVec3::ZERO; 4];
            for k in 0..4 {
                by_weights[k] += by_between.dot(met[k]) + by_gap * normal.dot(starts[k]);
                by_met[k] = by_between * parts[k];
                if !from.is_cloth[k] {
                    by_weights[k] += by_drift.dot(way.to[k] - starts[k]);
                    by_starts[k] -= by_drift * parts[k];
                    by_ends[k] += by_drift * parts[k];
                }
            }
            pull_weights(kind, met, parts, by_weights, &mut by_met);
            if way.distance == f64::INFINITY {
                (0..4).for_each(|k| by_starts[k] += by_met[k]);
            } else {
                let mut numbers = [0.0; 24];
                for (k, place) in starts.into_iter().chain(way.to).enumerate() {
                    set(&mut numbers, 3 * k, place);
                }
                let slopes = slopes_of(
                    &numbers,
                    |_| true,
                    |numbers| {
                        let ways = [four(numbers, 0), four(numbers, 12)];
                        let met = way.places::<Dual<RATES>>(kind, from.radius, starts, ways);
                        let along = (0..4).map(|k| lift(numbers[0], by_met[k]).dot(met[k]));
                        along.fold(numbers[0].same(0.0), |sum, along| sum + along)
                    },
                );
                for k in 0..4 {
                    by_starts[k] += slope(&slopes, 3 * k);
                    by_ends[k] += slope(&slopes, 12 + 3 * k);
                }
            }
        }
        for k in 0..4 {
            let (start, end) = (by_starts[k], by_ends[k]);
            if !from.is_cloth[k] {
                if let Some(obstacle) = from.obstacle {
                    by.obstacles[obstacle][0].push(starts[k], start);
                    by.obstacles[obstacle][1].push(from.ends[k], end);
                }
                continue;
            }
            let corner = self.corners[k] as usize;
            let way = from.way.map_or(([0.0; 3], 0), |way| (way.by, way.solve));
            let ([by_start, by_velocity, by_estimate], solve) = way;
            by.start[corner] += start + end * by_start;
            by.velocities[corner] += end * by_velocity;
            if by_estimate != 0.0 {
                by.estimates[solve][corner] += end * by_estimate;
            }
        }
    }

    /// The derivatives of its part of the barrier times `by_share`, and of half of the distance at the start times
    /// `by_half`: by corners at the start, by vertices beside two edges, and where it meets on a way by weights of
    /// the corners and by the direction.
    fn share_slopes(
        &self,
        from: &ShapeTape,
        (parts, normal): ([f64; 4], DVec3),
        [by_share, by_half]: [f64; 2],
    ) -> [f64; 31] {
        let wings = match from.share {
            Share::Edges(wings) => wings.map(|side| side.map(|wing| wing.map(|(_, place)| place))),
            Share::Fixed | Share::Round => Default::default(),
        };
        let flat = wings.as_flattened();
        let mut numbers = [0.0; 31];
        let beside = flat.iter().map(|wing| wing.unwrap_or_default());
        for (k, place) in from.starts.into_iter().chain(beside).enumerate() {
            set(&mut numbers, 3 * k, place);
        }
        numbers[24..28].copy_from_slice(&parts);
        set(&mut numbers, 28, normal);
        let wanted = |number: usize| match number {
            ..12 => true,
            12..24 => flat[(number - 12) / 3].is_some(),
            _ => from.way.is_some() && matches!(from.share, Share::Edges(_)),
        };
        slopes_of(&numbers, wanted, |numbers| {
            let (starts, beside) = (four(numbers, 0), four(numbers, 12));
            let thickness = self.thickness;
            let share = match from.share {
                _ if by_share == 0.0 => numbers[0].same(0.0),
                Share::Fixed => numbers[0].same(0.0),
                Share::Round => round_share(from.kind, starts, thickness),
                Share::Edges(_) => {
                    let wing = |k: usize| flat[k].map(|_| beside[k]);
                    let wings = [[wing(0), wing(1)], [wing(2), wing(3)]];
                    let (weights, normal) = (from_fn(|k| numbers[24 + k]), vector(numbers, 28));
                    edge_share(starts, wings, weights, normal, thickness)
                }
            };
            let half = match by_half {
                0.0 => numbers[0].same(0.0),
                _ => distance::<Dual<RATES>>(from.kind, starts) * 0.5,
            };
            share * by_share + half * by_half
        })
    }
}

/// Adds the derivatives of the weights of closest points by the corners to `by`. With b = Σ w x between the
/// points, and d the edges from the first corner that has a weight to others of its feature, b·d = 0.
fn pull_weights(
    kind: Kind,
    corners: [DVec3; 4],
    parts: [f64; 4],
    by_weights: [f64; 4],
    by: &mut [DVec3; 4],
) {
    let between = weighted(parts, corners);
    let mut edges = [(0, 0); 2];
    let mut count = 0;
    for feature in [0..kind.split(), kind.split()..4] {
        let mut borne = feature.filter(|k| parts[*k] != 0.0);
        let first = borne.next().unwrap_or_default();
        for other in borne {
            edges[count] = (first, other);
            count += 1;
        }
    }
    let ways = edges.map(|(from, to)| corners[to] - corners[from]);
    let right = edges.map(|(from, to)| by_weights[to] - by_weights[from]);
    let ([a, b], [p, q], product) = (
        ways.map(|d| d.length_squared()),
        right,
        ways[0].dot(ways[1]),
    );
    let found = match count {
        0 => return,
        1 => [p / a, 0.0],
        _ => {
            let determinant = a * b - product * product;
            [
                (b * p - product * q) / determinant,
                (a * q - product * p) / determinant,
            ]
        }
    };
    let along = ways[0] * found[0] + ways[1] * found[1];
    for (by, part) in by.iter_mut().zip(parts) {
        *by -= along * part;
    }
    for ((from, to), found) in edges.into_iter().zip(found) {
        by[from] += between * found;
        by[to] -= between * found;
    }
}

#[cfg(test)]
pub(crate) mod tests;
