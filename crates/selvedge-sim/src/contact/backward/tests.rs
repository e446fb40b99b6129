//! Forward rates of what touches, for the reference of the adjoint.

use super::*;

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
