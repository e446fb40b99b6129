//! Derivatives of what touches: of the forces of a solve, and of the pull that its friction leaves for the
//! next substep, by the places from which they came.
//!
//! The force of a collision is one function of its shape (direction, weights, gap, masses), where its corners were
//! expected, where they end, and the pull of its anchor; the shape is one of corners at the start. Evaluated with
//! dual numbers they give a derivative by each. A pair keeps its shape over the solves of a substep, so
//! derivatives by it are added up, and taken to its corners once. Which pairs push and the branches of their
//! laws count as decided, and so does the gap that a pair missed in the last substep needed.

use glam::DVec3;
use selvedge_cloth::Touching;
use selvedge_contact::number::{Dual, Number, Vector};
use selvedge_contact::weights;

use super::barrier::{Barrier, Tangent};
use super::came_from::{At, CollisionTape, ShapeOrigin, ShapeTape, Share};
use super::collisions::{Collision, Collisions, PairLaw, RECOVERY, SHEAR, Sticking};
use super::narrow_phase::{distance, edge_share, round_share};
use super::real::Real;

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
/// Numbers of a collision's force: its shape; Σ w x of the cloth's corners beyond their places, where they were
/// expected and where they end; pull of the anchor; Σ w x where an earlier solve has shown that it slides; up to which
/// compression the anchor bears.
const EXPECTED: usize = SHAPE;
const END: usize = EXPECTED + 3;
const ANCHOR: usize = END + 3;
const SLID: usize = ANCHOR + 3;
const PRESSED: usize = SLID + 3;
const FORCE: usize = PRESSED + 1;
/// Numbers from which a shape comes: corners at the start; ends of the way on which the pair meets, of obstacles
/// those of the substep; vertices beside two edges; inverse masses of the corners.
const STARTS: usize = 0;
const ENDS: usize = 12;
const WINGS: usize = 24;
const INVERSE: usize = 36;
const CAME_FROM: usize = 40;
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
    std::array::from_fn(|k| vector(numbers, first + 3 * k))
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

/// The part of `vector` across `normal`.
fn across<N: Number>(normal: N::Vector, vector: N::Vector) -> N::Vector {
    vector - normal * normal.dot(vector)
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
        slopes: &[AnchorSlope],
        by: &mut PlaceSlopes<'_>,
        shapes: &mut Vec<ShapeSlopes>,
    ) {
        shapes.resize(self.list.len(), [0.0; SHAPE]);
        for ((collision, tape), shape) in self.list.iter().zip(came_from).zip(shapes) {
            let own = |slope: &&AnchorSlope| {
                collision.anchored == Some(slope.of) && collision.normal == slope.normal
            };
            let own = || slopes.iter().filter(own);
            let sum: DVec3 = own().map(|slope| slope.by).sum();
            let by_pressed: f64 = own().map(|slope| slope.by_pressed).sum();
            if sum != DVec3::ZERO || by_pressed != 0.0 {
                let value = Value::Anchor(sum, by_pressed);
                collision.pull_back(tape, places, value, by, shape);
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

    /// What its force is a function of, as the solve had it.
    fn force_numbers(&self, tape: &CollisionTape) -> [f64; FORCE] {
        let mut numbers = [0.0; FORCE];
        numbers[..NORMAL].copy_from_slice(&self.weights);
        set(&mut numbers, NORMAL, self.normal);
        numbers[GAP] = self.gap;
        set(&mut numbers, DRIFT, self.drift);
        (numbers[MEAN_MASS], numbers[MASS]) = (self.mean_mass, self.mass);
        if let PairLaw::Barrier { share } = self.law {
            numbers[SHARE] = share;
        }
        numbers[HALF] = self.at.unwrap_or_default();
        let pull = tape.anchor.map_or(DVec3::ZERO, |anchor| anchor.pull);
        set(&mut numbers, ANCHOR, pull);
        numbers[PRESSED] = self.pressure.pressed;
        numbers
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
        let cloth = places.end.len();
        let is_cloth = self.corners.map(|corner| (corner as usize) < cloth);
        let numbers = self.force_numbers(tape);
        let wanted = |number: usize| match number {
            ..NORMAL => tape.has_way && is_cloth[number],
            GAP => true,
            DRIFT..MEAN_MASS => tape.has_way && is_cloth.contains(&false),
            NORMAL..SHARE => tape.has_way,
            SHARE => tape.has_share,
            HALF => matches!(tape.at, At::Half),
            ANCHOR..SLID | PRESSED => tape.anchor.is_some(),
            SLID.. => tape.slid.is_some(),
            _ => true,
        };
        let slopes = slopes_of(&numbers, wanted, |numbers| {
            self.value(tape, places, value, numbers)
        });
        for (sum, slope) in shape.iter_mut().zip(slopes) {
            *sum += slope;
        }
        let [expected, end, slid] = [EXPECTED, END, SLID].map(|first| slope(&slopes, first));
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
                by: slope(&slopes, ANCHOR),
                by_pressed: slopes[PRESSED],
            });
        }
    }

    /// Adds the derivatives by what the shape came from, of these `slopes` by its numbers.
    fn pull_shape(&self, from: &ShapeTape, slopes: &ShapeSlopes, by: &mut PlaceSlopes<'_>) {
        let wings = match from.share {
            Share::Edges(wings) => wings,
            Share::Fixed | Share::Round => Default::default(),
        };
        let wings = wings.as_flattened();
        let (by_ends, solve) = from.way.map_or(([0.0; 3], 0), |way| (way.by, way.solve));
        let to = from.way.map_or(from.ends, |way| way.to);
        let mut numbers = [0.0; CAME_FROM];
        for k in 0..4 {
            set(&mut numbers, STARTS + 3 * k, from.starts[k]);
            set(&mut numbers, ENDS + 3 * k, to[k]);
            let wing = wings[k].map_or(DVec3::ZERO, |(_, place)| place);
            set(&mut numbers, WINGS + 3 * k, wing);
        }
        numbers[INVERSE..].copy_from_slice(&from.inverse);
        let has_way = from.way.is_some();
        let wanted = |number: usize| match number {
            ENDS..WINGS => has_way && (!from.is_cloth[(number - ENDS) / 3] || by_ends != [0.0; 3]),
            WINGS..INVERSE => wings[(number - WINGS) / 3].is_some(),
            INVERSE.. => has_way && numbers[number] > 0.0,
            _ => true,
        };
        let slopes = slopes_of(&numbers, wanted, |numbers| {
            let mut value = numbers[0].same(0.0);
            for (number, slope) in self.shape(from, slopes, numbers).iter().zip(slopes) {
                value = value + *number * *slope;
            }
            value
        });
        for k in 0..4 {
            let [start, end] = [STARTS, ENDS].map(|first| slope(&slopes, first + 3 * k));
            if !from.is_cloth[k] {
                if let Some(obstacle) = from.obstacle {
                    by.obstacles[obstacle][0].push(from.starts[k], start);
                    by.obstacles[obstacle][1].push(from.ends[k], end);
                }
                continue;
            }
            let corner = self.corners[k] as usize;
            let [by_start, by_velocity, by_estimate] = by_ends;
            by.start[corner] += start + end * by_start;
            by.velocities[corner] += end * by_velocity;
            if by_estimate != 0.0 {
                by.estimates[solve][corner] += end * by_estimate;
            }
            by.masses[corner] -= slopes[INVERSE + k] * from.inverse[k] * from.inverse[k];
        }
        for (k, wing) in wings.iter().enumerate() {
            let Some((vertex, place)) = wing else {
                continue;
            };
            let slope = slope(&slopes, WINGS + 3 * k);
            match (by.start.get_mut(*vertex), from.obstacle) {
                (Some(sum), _) => *sum += slope,
                (None, Some(obstacle)) => by.obstacles[obstacle][0].push(*place, slope),
                (None, None) => {}
            }
        }
    }

    /// The numbers of the shape that have `slopes`, from those from which it comes.
    fn shape<N: Real>(
        &self,
        from: &ShapeTape,
        slopes: &ShapeSlopes,
        numbers: &[N; CAME_FROM],
    ) -> [N; SHAPE] {
        let one = numbers[0].same(1.0);
        let starts = four(numbers, STARTS);
        let to = four(numbers, ENDS);
        let mut shape = [one.same(0.0); SHAPE];
        let (all_weights, normal);
        if let Some(way) = from.way {
            let met = way.places::<N>(from.kind, from.radius, from.starts, [starts, to]);
            all_weights = weights::<N>(from.kind, met);
            let zero = lift(one, DVec3::ZERO);
            let (mut between, mut apart, mut drift) = (zero, zero, zero);
            let (mut squares, mut weighted, mut inverse) =
                (one.same(0.0), one.same(0.0), one.same(0.0));
            for (k, weight) in all_weights.into_iter().enumerate() {
                between = between + met[k] * weight;
                apart = apart + starts[k] * weight;
                if !from.is_cloth[k] {
                    drift = drift + (to[k] - starts[k]) * weight;
                }
                if from.inverse[k] > 0.0 {
                    let (square, own) = (weight * weight, numbers[INVERSE + k]);
                    squares = squares + square;
                    weighted = weighted + square / own;
                    inverse = inverse + square * own;
                }
            }
            normal = between / between.dot(between).sqrt();
            let [x, y, z] = normal.components();
            let turned = lift(one, from.turn.x_axis) * x
                + lift(one, from.turn.y_axis) * y
                + lift(one, from.turn.z_axis) * z;
            shape[WEIGHTS..NORMAL].copy_from_slice(&all_weights);
            shape[NORMAL..GAP].copy_from_slice(&[x, y, z]);
            shape[GAP] = apart.dot(normal) - from.radius;
            shape[DRIFT..MEAN_MASS].copy_from_slice(&(drift + turned).components());
            shape[MEAN_MASS] = weighted / squares;
            shape[MASS] = one.same(1.0) / inverse;
        } else {
            all_weights = self.weights.map(|weight| one.same(weight));
            normal = lift(one, self.normal);
            let mut gap = one.same(self.gap);
            for (k, start) in starts.into_iter().enumerate() {
                gap = gap + (start - lift(one, from.starts[k])).dot(normal) * self.weights[k];
            }
            shape[GAP] = gap;
        }
        shape[SHARE] = match from.share {
            _ if slopes[SHARE] == 0.0 => one.same(0.0),
            Share::Fixed => one.same(0.0),
            Share::Edges(wings) => {
                let places = four(numbers, WINGS);
                let wing =
                    |edge: usize, side: usize| wings[edge][side].map(|_| places[2 * edge + side]);
                let wings = [[wing(0, 0), wing(0, 1)], [wing(1, 0), wing(1, 1)]];
                edge_share(starts, wings, all_weights, normal, self.thickness)
            }
            Share::Round => round_share(from.kind, starts, self.thickness),
        };
        if slopes[HALF] != 0.0 {
            shape[HALF] = (distance::<N>(from.kind, starts) - from.radius) * 0.5;
        }
        shape
    }

    fn value<N: Real>(
        &self,
        tape: &CollisionTape,
        places: Places<'_>,
        value: Value,
        numbers: &[N; FORCE],
    ) -> N {
        let one = numbers[0].same(1.0);
        let (normal, gap) = (vector(numbers, NORMAL), numbers[GAP]);
        let starts = self.of_cloth(places.start);
        // Displacements of the first side against the second since the start.
        let displacement = |all: [DVec3; 4], further: usize, part: f64| {
            let drift: N::Vector = vector(numbers, DRIFT);
            let mut sum = drift * one.same(part) + vector(numbers, further);
            for k in 0..4 {
                sum = sum + lift(one, all[k] - starts[k]) * numbers[WEIGHTS + k];
            }
            sum
        };
        let expected = displacement(self.of_cloth(places.expected), EXPECTED, 1.0);
        let end = displacement(self.of_cloth(places.end), END, places.part);
        let gap_at = |displacement: N::Vector| gap + normal.dot(displacement);
        let (gamma, time) = (places.gamma, places.time);
        if let PairLaw::Out = self.law {
            return self.value_out(value, end, one);
        }
        let pressure = self.pressure.with(numbers[PRESSED]);
        let inertia = numbers[MASS] * (1.0 / (time * time));
        let barrier = Barrier {
            thickness: self.thickness,
            base: numbers[MEAN_MASS] * (1.0 / (time * time)),
            share: numbers[SHARE],
            inertia: numbers[MASS] * (1.0 / (gamma * gamma)),
            pressure,
            recovery: RECOVERY / time,
        };
        let estimate = gap_at(expected);
        let tangent: Tangent<N> = match self.at {
            None => barrier.linearise(gap, estimate),
            Some(at) => {
                let at = match tape.at {
                    At::Fixed => one.same(at),
                    At::Start => gap,
                    At::Half => numbers[HALF],
                };
                barrier.at(at, gap)
            }
        };
        let firm = pressure.firm(gap, self.thickness);
        let grip = match firm {
            Some(firm) => inertia.greater(firm.stiffness * SHEAR),
            None => inertia,
        };
        let pull = across::<N>(normal, vector(numbers, ANCHOR));
        let slip_at = |displacement: N::Vector| across::<N>(normal, pull / grip + displacement);
        let zero = one.same(0.0);
        let slip = slip_at(end);
        let by = match value {
            Value::Work(multipliers) => multipliers,
            Value::Anchor(by, by_pressed) => {
                let (time, gap) = (places.part * time, gap_at(end));
                let ways = [end.dot(end).sqrt(), normal.dot(end)];
                let pressed = pressure.pressed_after(time, ways, gap, self.thickness);
                let pressed = pressed * by_pressed;
                let most = tangent.force_at(gap).at_least(0.0) * self.friction;
                let pull = grip * slip.dot(slip).sqrt();
                let kept = if pull.within(most) { one } else { most / pull };
                let left = || lift(one, by).dot(slip) * grip * kept;
                return if zero.below(most) { left() + pressed } else { pressed };
            }
        };
        let slides = |at: N::Vector, most: N| {
            let length = at.dot(at).sqrt();
            if (grip * length).within(most) {
                return slip * -grip;
            }
            let direction = at / length;
            let further = slip - at;
            let turned = further - direction * direction.dot(further);
            direction * -most - turned * (most / length)
        };
        let first = slip_at(expected);
        let most = barrier.bears(&tangent, gap, estimate) * self.friction;
        let drag = match self.sticking {
            Sticking::Unknown | Sticking::Light => slides(first, most),
            Sticking::Sticks => slip * -grip,
            Sticking::Slides(at, bound) => {
                let there = tape.slid.as_deref().map(|(_, places)| {
                    let there = displacement(*places, SLID, 1.0);
                    let most = tangent.force_at(gap_at(there)).at_least(0.0) * self.friction;
                    (slip_at(there), most)
                });
                let (first, most) = there.unwrap_or((first, most));
                // What an earlier end told counts as decided.
                let off = lift(one, at) - first;
                let least = one.same((SAME * at.length() + ROUNDING).powi(2));
                if off.dot(off).within(least) {
                    slides(first, most)
                } else {
                    slides(lift(one, at), one.same(bound))
                }
            }
        };
        let force = normal * tangent.force_at(gap_at(end)) + drag;
        let mut work = zero;
        for (k, multiplier) in by.into_iter().enumerate() {
            work = work + lift(one, multiplier).dot(force) * numbers[WEIGHTS + k];
        }
        work * gamma
    }

    /// As [`Self::value`], of a push out of a body, which counts as decided but for where it ends.
    fn value_out<N: Real>(&self, value: Value, end: N::Vector, one: N) -> N {
        let Value::Work(multipliers) = value else {
            return one.same(0.0);
        };
        let along = end.dot(lift(one, self.normal));
        let force = one.same(self.response.tangent.force) - along * self.response.tangent.stiffness;
        let work = multipliers.iter().zip(self.weights);
        let work: f64 = work.map(|(by, weight)| by.dot(self.normal) * weight).sum();
        force * (work * self.response.gamma)
    }
}

#[cfg(test)]
pub(crate) mod tests;
