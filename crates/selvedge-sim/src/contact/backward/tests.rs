//! Forward rates of what touches, for the reference of the adjoint.

use super::*;
use crate::contact::real::Real;

type V = <Dual as Number>::Vector;

/// Rates by the numbers of a shape.
pub(crate) type ShapeRates = [f64; SHAPE];

/// A feature, its direction, and rates of its pull and of up to which compression it bears.
pub(crate) type AnchorRates = (Touching, DVec3, DVec3, f64);

/// Dual places of a solve `[m]`, `[vertices]`.
pub(crate) struct Moved<'a> {
    pub(crate) gamma: f64,
    pub(crate) time: f64,
    pub(crate) point: f64,
    pub(crate) start: &'a [V],
    pub(crate) velocities: &'a [V],
    pub(crate) expected: &'a [V],
    pub(crate) end: &'a [V],
    /// Estimates of the solves so far.
    pub(crate) estimates: &'a [Vec<V>],
    pub(crate) masses: &'a [Dual],
    /// Rates of the pulls that the substep before has left, and of up to which compression they bear.
    pub(crate) anchors: &'a [AnchorRates],
}

fn value(all: &[V]) -> Vec<DVec3> {
    let value = |v: &V| DVec3::from_array(v.0.map(|component| component.value));
    all.iter().map(value).collect()
}

fn rate(all: &[V], corner: u32) -> DVec3 {
    all.get(corner as usize)
        .map_or(DVec3::ZERO, |v| DVec3::from_array(v.0.map(|c| c.rates[0])))
}

fn with_rates(numbers: &mut [Dual<RATES>], first: usize, rates: DVec3) {
    for (number, rate) in numbers[first..first + 3].iter_mut().zip(rates.to_array()) {
        number.rates[0] = rate;
    }
}

impl Collisions {
    /// Rates of γ f at each corner, and of the pulls that are left `[N]`; then those of the shapes, by which the
    /// next solve goes on.
    pub(crate) fn rates(
        &self,
        came_from: &[CollisionTape],
        moved: &Moved<'_>,
        before: &[ShapeRates],
        forces: &mut [DVec3],
    ) -> (Vec<ShapeRates>, Vec<AnchorRates>) {
        let (start, expected, end) = (value(moved.start), value(moved.expected), value(moved.end));
        let places = Places {
            gamma: moved.gamma,
            time: moved.time,
            start: &start,
            expected: &expected,
            end: &end,
            point: moved.point,
            part: 1.0,
        };
        let (mut shapes, mut pulls) = (Vec::new(), Vec::new());
        for (collision, tape) in self.list.iter().zip(came_from) {
            let shape = match &tape.shape {
                ShapeOrigin::Own(from) => collision.shape_rates(from, moved),
                ShapeOrigin::Earlier(earlier) => before[*earlier],
            };
            shapes.push(shape);
            let numbers = collision.numbers(tape, &shape, moved);
            let rate = |of: Value| collision.value(tape, places, of, &numbers).rates[0];
            for (k, corner) in collision.corners.iter().enumerate() {
                let Some(force) = forces.get_mut(*corner as usize) else {
                    continue;
                };
                let along = |axis: DVec3| {
                    let mut multipliers = [DVec3::ZERO; 4];
                    multipliers[k] = axis;
                    rate(Value::Work(multipliers))
                };
                *force += DVec3::from_array(DVec3::AXES.map(along));
            }
            if let Some(of) = collision.anchored {
                let pull = DVec3::AXES.map(|axis| rate(Value::Anchor(axis, 0.0)));
                let pressed = rate(Value::Anchor(DVec3::ZERO, 1.0));
                pulls.push((of, collision.normal, DVec3::from_array(pull), pressed));
            }
        }
        (shapes, pulls)
    }
}

impl Collision {
    fn shape_rates(&self, from: &ShapeTape, moved: &Moved<'_>) -> ShapeRates {
        let constant = |value| Dual {
            value,
            rates: [0.0; RATES],
        };
        let wings = match from.share {
            Share::Edges(wings) => wings,
            Share::Fixed | Share::Round => Default::default(),
        };
        let mut numbers = [constant(0.0); CAME_FROM];
        let mut put = |first: usize, place: DVec3, rates: DVec3| {
            for axis in 0..3 {
                numbers[first + axis].value = place[axis];
            }
            with_rates(&mut numbers, first, rates);
        };
        for k in 0..4 {
            let corner = if from.is_cloth[k] { self.corners[k] } else { u32::MAX };
            put(STARTS + 3 * k, from.starts[k], rate(moved.start, corner));
            let to = from.way.map_or(from.ends[k], |way| way.to[k]);
            let rates = from.way.map_or(DVec3::ZERO, |way| {
                let [by_start, by_velocity, by_estimate] = way.by;
                let estimate = match by_estimate {
                    0.0 => DVec3::ZERO,
                    _ => rate(&moved.estimates[way.solve], corner),
                };
                rate(moved.start, corner) * by_start
                    + rate(moved.velocities, corner) * by_velocity
                    + estimate * by_estimate
            });
            put(ENDS + 3 * k, to, rates);
            if let Some((vertex, place)) = wings.as_flattened()[k] {
                put(WINGS + 3 * k, place, rate(moved.start, vertex as u32));
            }
        }
        for (k, inverse) in from.inverse.into_iter().enumerate() {
            numbers[INVERSE + k].value = inverse;
            if let Some(mass) = moved.masses.get(self.corners[k] as usize) {
                numbers[INVERSE + k].rates[0] = -mass.rates[0] * inverse * inverse;
            }
        }
        self.shape(from, &[1.0; SHAPE], &numbers)
            .map(|number| number.rates[0])
    }

    fn numbers(
        &self,
        tape: &CollisionTape,
        shape: &ShapeRates,
        moved: &Moved<'_>,
    ) -> [Dual<RATES>; FORCE] {
        let mut duals = self.force_numbers(tape).map(|value| Dual {
            value,
            rates: [0.0; RATES],
        });
        let cloth = moved.start.len() as u32;
        for (number, rate) in shape.iter().enumerate() {
            let counts = match number {
                ..NORMAL => tape.has_way && self.corners[number] < cloth,
                GAP => true,
                SHARE => tape.has_share,
                HALF => matches!(tape.at, At::Half),
                _ => tape.has_way,
            };
            duals[number].rates[0] = if counts { *rate } else { 0.0 };
        }
        let sum = |of: &dyn Fn(u32) -> DVec3| -> DVec3 {
            let parts = self.corners.iter().zip(self.weights);
            parts.map(|(corner, weight)| of(*corner) * weight).sum()
        };
        let start = |corner| rate(moved.start, corner);
        with_rates(
            &mut duals,
            EXPECTED,
            sum(&|c| rate(moved.expected, c) - start(c)),
        );
        with_rates(&mut duals, END, sum(&|c| rate(moved.end, c) - start(c)));
        if let Some((solve, _)) = tape.slid.as_deref() {
            let slid = |c| (rate(&moved.estimates[*solve], c) - start(c)) / moved.point;
            with_rates(&mut duals, SLID, sum(&slid));
        }
        if let Some(anchor) = tape.anchor {
            let own =
                |(of, normal, ..): &&AnchorRates| *of == anchor.of && *normal == anchor.normal;
            let own = || moved.anchors.iter().filter(own);
            with_rates(&mut duals, ANCHOR, own().map(|(_, _, pull, _)| *pull).sum());
            duals[PRESSED].rates[0] = own().map(|(.., pressed)| pressed).sum();
        }
        duals
    }
}

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

/// The part of `vector` across `normal`.
fn across<N: Number>(normal: N::Vector, vector: N::Vector) -> N::Vector {
    vector - normal * normal.dot(vector)
}

impl Collision {
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
