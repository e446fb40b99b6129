//! Derivatives of what touches: of the forces of a solve, and of the pull that its friction leaves for the
//! next substep, by the places from which they came.
//!
//! Each collision is one function of its corners at the start, where they were expected, where they end, and
//! the pull of its anchor; evaluated with dual numbers it gives a derivative by each. Which pairs push and the
//! branches of their laws count as decided, and so does the gap that a pair missed in the last substep needed.

use glam::DVec3;
use selvedge_cloth::Touching;
use selvedge_contact::number::{Dual, DualVector, Number, Vector};
use selvedge_contact::weights;

use super::barrier::{Barrier, Tangent};
use super::came_from::{At, CollisionTape, Share};
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
/// `[vertices]`: where they were expected, and where they end.
#[derive(Clone, Copy)]
pub(crate) struct Places<'a> {
    pub(crate) gamma: f64,
    pub(crate) time: f64,
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

/// What a value depends on: vectors, at the places below, inverse masses of the corners, and up to which
/// compression the anchor bears.
#[derive(Clone, Copy)]
struct Inputs<N: Number> {
    vectors: [N::Vector; VECTORS],
    inverse: [N; 4],
    pressed: N,
    has_wing: [[bool; 2]; 2],
}

/// Corners at the start.
const STARTS: usize = 0;
/// Ends of the way on which the pair meets; of obstacles, those of the substep.
const ENDS: usize = 4;
/// Vertices beside two edges.
const WINGS: usize = 8;
/// Σ w x of the cloth's corners beyond their places, where they were expected and where they end.
const EXPECTED: usize = 12;
const END: usize = 13;
/// Pull of the anchor.
const ANCHOR: usize = 14;
/// Σ w x where an earlier solve has shown that it slides.
const SLID: usize = 15;
const VECTORS: usize = 16;
/// Vectors by which derivatives are taken at once, and their components.
const TOGETHER: usize = 4;
const RATES: usize = 3 * TOGETHER;

impl<N: Number> Inputs<N> {
    fn four(&self, first: usize) -> [N::Vector; 4] {
        std::array::from_fn(|k| self.vectors[first + k])
    }

    fn wings(&self) -> [[Option<N::Vector>; 2]; 2] {
        let wing = |edge: usize, side: usize| {
            self.has_wing[edge][side].then_some(self.vectors[WINGS + 2 * edge + side])
        };
        [[wing(0, 0), wing(0, 1)], [wing(1, 0), wing(1, 1)]]
    }
}

/// Direction, weights and masses of a collision.
struct Shape<N: Number> {
    weights: [N; 4],
    normal: N::Vector,
    /// Gap at the start `[m]`.
    gap: N,
    drift: N::Vector,
    mean_mass: N,
    mass: N,
}

fn lift<N: Number>(one: N, vector: DVec3) -> N::Vector {
    N::Vector::of(vector.to_array().map(|component| one.same(component)))
}

/// The part of `vector` across `normal`.
fn across<N: Number>(normal: N::Vector, vector: N::Vector) -> N::Vector {
    vector - normal * normal.dot(vector)
}

impl Collisions {
    /// Adds the derivatives of γ Σ λ·f of a solve, of these `multipliers` λ, `[vertices]`.
    pub(crate) fn pull_forces(
        &self,
        came_from: &[CollisionTape],
        places: Places<'_>,
        multipliers: &[DVec3],
        by: &mut PlaceSlopes<'_>,
        anchors: &mut Vec<AnchorSlope>,
    ) {
        for (collision, tape) in self.list.iter().zip(came_from) {
            let own = tape.of_cloth(collision, multipliers);
            if own != [DVec3::ZERO; 4] {
                let value = Value::Work(own);
                collision.pull_back(tape, places, value, by, anchors);
            }
        }
    }

    /// Adds the derivatives of the pulls that the collisions of the last solve have left, of which `slopes` are
    /// known.
    pub(crate) fn pull_anchors(
        &self,
        came_from: &[CollisionTape],
        places: Places<'_>,
        slopes: &[AnchorSlope],
        by: &mut PlaceSlopes<'_>,
        anchors: &mut Vec<AnchorSlope>,
    ) {
        for (collision, tape) in self.list.iter().zip(came_from) {
            let own = |slope: &&AnchorSlope| {
                collision.anchored == Some(slope.of) && collision.normal == slope.normal
            };
            let own = || slopes.iter().filter(own);
            let sum: DVec3 = own().map(|slope| slope.by).sum();
            let by_pressed: f64 = own().map(|slope| slope.by_pressed).sum();
            if sum != DVec3::ZERO || by_pressed != 0.0 {
                let value = Value::Anchor(sum, by_pressed);
                collision.pull_back(tape, places, value, by, anchors);
            }
        }
    }

    /// Memory of a recording `[bytes]`.
    pub(crate) fn bytes(&self) -> usize {
        self.list.len() * (size_of::<Collision>() + size_of::<CollisionTape>())
    }
}

impl CollisionTape {
    /// Values of the cloth's corners, 0 of others.
    fn of_cloth(&self, collision: &Collision, values: &[DVec3]) -> [DVec3; 4] {
        std::array::from_fn(|k| {
            if self.is_cloth[k] { values[collision.corners[k] as usize] } else { DVec3::ZERO }
        })
    }
}

impl Collision {
    /// Adds the derivatives of `value`.
    fn pull_back(
        &self,
        tape: &CollisionTape,
        places: Places<'_>,
        value: Value,
        by: &mut PlaceSlopes<'_>,
        anchors: &mut Vec<AnchorSlope>,
    ) {
        let wings = match tape.share {
            Share::Edges(wings) => wings,
            Share::Fixed | Share::Round => Default::default(),
        };
        let mut vectors = [DVec3::ZERO; VECTORS];
        vectors[STARTS..ENDS].copy_from_slice(&tape.starts);
        vectors[ENDS..WINGS].copy_from_slice(&tape.way.map_or(tape.ends, |way| way.to));
        for (into, wing) in vectors[WINGS..].iter_mut().zip(wings.as_flattened()) {
            *into = wing.map_or(DVec3::ZERO, |(_, place)| place);
        }
        vectors[ANCHOR] = tape.anchor.map_or(DVec3::ZERO, |anchor| anchor.pull);
        let (by_ends, solve) = tape.way.map_or(([0.0; 3], 0), |way| (way.by, way.solve));
        let is_wanted = |number: &usize| match *number {
            ENDS..WINGS => !tape.is_cloth[number - ENDS] || by_ends != [0.0; 3],
            WINGS..EXPECTED => wings.as_flattened()[number - WINGS].is_some(),
            ANCHOR => tape.anchor.is_some(),
            SLID => tape.slid.is_some(),
            _ => true,
        };
        let wanted: Vec<usize> = (0..VECTORS).filter(is_wanted).collect();
        // A number that has a rate where no vectors have.
        let number = |moved: &[usize], value: f64, place: usize, rate: f64| {
            let mut rates = [0.0; RATES];
            rates[place] = if moved.is_empty() { rate } else { 0.0 };
            Dual { value, rates }
        };
        let inputs = |moved: &[usize]| Inputs {
            vectors: std::array::from_fn(|number| {
                let first = moved.iter().position(|own| *own == number).map(|k| 3 * k);
                let rate = |k: usize| match first {
                    Some(first) if (first..first + 3).contains(&k) => DVec3::AXES[k - first],
                    _ => DVec3::ZERO,
                };
                DualVector::<RATES>::new(vectors[number], std::array::from_fn(rate))
            }),
            inverse: std::array::from_fn(|k| {
                let rate = -tape.inverse[k] * tape.inverse[k];
                number(moved, tape.inverse[k], k, rate)
            }),
            pressed: number(moved, self.pressure.pressed, 4, 1.0),
            has_wing: wings.map(|wings| wings.map(|wing| wing.is_some())),
        };
        let mut slopes = [DVec3::ZERO; VECTORS];
        for moved in wanted.chunks(TOGETHER) {
            let rates = self.value(tape, places, value, &inputs(moved)).rates;
            for (number, rates) in moved.iter().zip(rates.as_chunks().0) {
                slopes[*number] = DVec3::from_array(*rates);
            }
        }
        let by_numbers = self.value(tape, places, value, &inputs(&[])).rates;
        for k in 0..4 {
            let (start, end) = (slopes[STARTS + k], slopes[ENDS + k]);
            if !tape.is_cloth[k] {
                if let Some(obstacle) = tape.obstacle {
                    by.obstacles[obstacle][0].push(tape.starts[k], start);
                    by.obstacles[obstacle][1].push(tape.ends[k], end);
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
            by.masses[corner] += by_numbers[k];
            by.expected[corner] += slopes[EXPECTED] * self.weights[k];
            by.end[corner] += slopes[END] * self.weights[k];
            if let Some((solve, _)) = tape.slid {
                by.estimates[solve][corner] += slopes[SLID] * (self.weights[k] / places.point);
                by.start[corner] += slopes[SLID] * (self.weights[k] * (1.0 - 1.0 / places.point));
            }
        }
        for (wing, slope) in wings.as_flattened().iter().zip(&slopes[WINGS..]) {
            let Some((vertex, place)) = wing else {
                continue;
            };
            match (by.start.get_mut(*vertex), tape.obstacle) {
                (Some(sum), _) => *sum += *slope,
                (None, Some(obstacle)) => by.obstacles[obstacle][0].push(*place, *slope),
                (None, None) => {}
            }
        }
        if let Some(anchor) = tape.anchor {
            anchors.push(AnchorSlope {
                of: anchor.of,
                normal: anchor.normal,
                by: slopes[ANCHOR],
                by_pressed: by_numbers[4],
            });
        }
    }

    /// Direction, weights and masses.
    fn shape<N: Real>(&self, tape: &CollisionTape, inputs: &Inputs<N>, one: N) -> Shape<N> {
        let (starts, to) = (inputs.four(STARTS), inputs.four(ENDS));
        let Some(way) = tape.way else {
            let mut gap = one.same(self.gap);
            for (k, start) in starts.into_iter().enumerate() {
                let moved = start - lift(one, tape.starts[k]);
                gap = gap + moved.dot(lift(one, self.normal)) * self.weights[k];
            }
            return Shape {
                weights: self.weights.map(|weight| one.same(weight)),
                normal: lift(one, self.normal),
                gap,
                drift: lift(one, self.drift),
                mean_mass: one.same(self.mean_mass),
                mass: one.same(self.mass),
            };
        };
        let met = way.places::<N>(tape.kind, tape.radius, tape.starts, [starts, to]);
        let weights = weights::<N>(tape.kind, met);
        let zero = lift(one, DVec3::ZERO);
        let (mut between, mut apart, mut drift) = (zero, zero, zero);
        let (mut squares, mut weighted, mut inverse) =
            (one.same(0.0), one.same(0.0), one.same(0.0));
        for (k, weight) in weights.into_iter().enumerate() {
            between = between + met[k] * weight;
            apart = apart + starts[k] * weight;
            drift =
                drift + (to[k] - starts[k]) * if tape.is_cloth[k] { one.same(0.0) } else { weight };
            if tape.inverse[k] > 0.0 {
                let square = weight * weight;
                squares = squares + square;
                weighted = weighted + square / inputs.inverse[k];
                inverse = inverse + square * inputs.inverse[k];
            }
        }
        let normal = between / between.dot(between).sqrt();
        let [x, y, z] = normal.components();
        let turned = lift(one, tape.turn.x_axis) * x
            + lift(one, tape.turn.y_axis) * y
            + lift(one, tape.turn.z_axis) * z;
        Shape {
            weights,
            normal,
            gap: apart.dot(normal) - tape.radius,
            drift: drift + turned,
            mean_mass: weighted / squares,
            mass: one.same(1.0) / inverse,
        }
    }

    fn value<N: Real>(
        &self,
        tape: &CollisionTape,
        places: Places<'_>,
        value: Value,
        inputs: &Inputs<N>,
    ) -> N {
        let one = inputs.inverse[0].same(1.0);
        let starts = inputs.four(STARTS);
        let shape = self.shape(tape, inputs, one);
        let normal = shape.normal;
        // Displacements of the first side against the second since the start.
        let displacement = |all: [DVec3; 4], further: N::Vector, part: f64| {
            let mut sum = shape.drift * one.same(part) + further;
            for k in (0..4).filter(|k| tape.is_cloth[*k]) {
                sum = sum + (lift(one, all[k]) - starts[k]) * shape.weights[k];
            }
            sum
        };
        let at = |all: &[DVec3]| tape.of_cloth(self, all);
        let expected = displacement(at(places.expected), inputs.vectors[EXPECTED], 1.0);
        let end = displacement(at(places.end), inputs.vectors[END], places.part);
        let gap_at = |displacement: N::Vector| shape.gap + normal.dot(displacement);
        let (gamma, time) = (places.gamma, places.time);
        let share = match self.law {
            PairLaw::Barrier { share } => share,
            PairLaw::Out => return self.value_out(value, end, one),
        };
        let thickness = self.thickness;
        let share = match tape.share {
            Share::Fixed => one.same(share),
            Share::Edges(_) => edge_share(starts, inputs.wings(), shape.weights, normal, thickness),
            Share::Round => round_share(tape.kind, starts, thickness),
        };
        let pressure = self.pressure.with(inputs.pressed);
        let inertia = shape.mass * (1.0 / (time * time));
        let barrier = Barrier {
            thickness: self.thickness,
            base: shape.mean_mass * (1.0 / (time * time)),
            share,
            inertia: shape.mass * (1.0 / (gamma * gamma)),
            pressure,
            recovery: RECOVERY / time,
        };
        let estimate = gap_at(expected);
        let tangent: Tangent<N> = match self.at {
            None => barrier.linearise(shape.gap, estimate),
            Some(gap) => {
                let at = match tape.at {
                    At::Fixed => one.same(gap),
                    At::Start => shape.gap,
                    At::Half => (distance::<N>(tape.kind, starts) - tape.radius) * 0.5,
                };
                barrier.at(at, shape.gap)
            }
        };
        let firm = pressure.firm(shape.gap, self.thickness);
        let grip = match firm {
            Some(firm) => inertia.greater(firm.stiffness * SHEAR),
            None => inertia,
        };
        let pull = across::<N>(normal, inputs.vectors[ANCHOR]);
        let slip_at = |displacement: N::Vector| across::<N>(normal, pull / grip + displacement);
        let zero = one.same(0.0);
        let slip = slip_at(end);
        let by = match value {
            Value::Work(multipliers) => multipliers,
            Value::Anchor(by, by_pressed) => {
                let (gap, way) = (gap_at(end), end.dot(end).sqrt());
                let pressed = pressure.pressed_after(places.part * time, way, gap, thickness);
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
        let most = barrier.bears(&tangent, shape.gap, estimate) * self.friction;
        let drag = match self.sticking {
            Sticking::Unknown | Sticking::Light => slides(first, most),
            Sticking::Sticks => slip * -grip,
            Sticking::Slides(at, bound) => {
                let there = tape.slid.map(|(_, places)| {
                    let there = displacement(places, inputs.vectors[SLID], 1.0);
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
            work = work + lift(one, multiplier).dot(force) * shape.weights[k];
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
mod tests {
    // see below
}
