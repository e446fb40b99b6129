//! Bodies drawn at random: what they are, where they stand, and how far they travel.

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Tries to find a place for a body.
const TRIES: usize = 200;

/// Kinds of bodies that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// A sphere; its size is the radius.
    Sphere,
    /// A capsule three times as long as wide; its size is the radius.
    Capsule,
    /// A cube; its size is half a side.
    Box,
}

/// Ranges that bodies are drawn from.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyRanges {
    /// Fewest and most bodies.
    pub count: [usize; 2],
    /// Kinds, at least one.
    pub kinds: Vec<BodyKind>,
    /// Smallest and largest size `[m]`.
    pub size: [f64; 2],
    /// Corners of the box of their centres at the start `[m]`.
    pub within: [DVec3; 2],
    /// Farthest way of a body `[m]`.
    pub travel: f64,
    /// Least and largest coefficient of friction.
    pub friction: [f64; 2],
    /// Least distance to the cloth and to each other at the start `[m]`.
    pub clearance: f64,
}

/// A body that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnBody {
    /// Kind of the body.
    pub kind: BodyKind,
    /// Size by its kind `[m]`.
    pub size: f64,
    /// Place of its centre at the start `[m]`.
    pub centre: DVec3,
    /// Turn about its centre.
    pub turn: DQuat,
    /// Way that it goes `[m]`.
    pub travel: DVec3,
    /// Coefficient of friction.
    pub friction: f64,
}

impl DrawnBody {
    /// Radius of the sphere about its centre that holds it `[m]`.
    #[must_use]
    pub fn reach(&self) -> f64 {
        match self.kind {
            BodyKind::Sphere => self.size,
            BodyKind::Capsule => 3.0 * self.size,
            BodyKind::Box => self.size * 3.0_f64.sqrt(),
        }
    }
}

/// Draws bodies clear of the `cloth` `[m]`; none for a body that has no place after some tries.
/// Equal `seed` and `number`, equal bodies.
#[must_use]
pub fn draw(
    ranges: &BodyRanges,
    cloth: &[DVec3],
    seed: u64,
    number: u64,
) -> Option<Vec<DrawnBody>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let count = ranges.count[0] + choice(&mut random, ranges.count[1] - ranges.count[0] + 1);
    let mut drawn: Vec<DrawnBody> = Vec::with_capacity(count);
    for _ in 0..count {
        let found = (0..TRIES).find_map(|_| {
            let body = draw_one(ranges, &mut random);
            let clear = body.reach() + ranges.clearance;
            let from_cloth = cloth.iter().all(|p| p.distance(body.centre) > clear);
            let from_others = drawn
                .iter()
                .all(|other| other.centre.distance(body.centre) > clear + other.reach());
            (from_cloth && from_others).then_some(body)
        });
        drawn.push(found?);
    }
    Some(drawn)
}

fn draw_one(ranges: &BodyRanges, random: &mut ChaCha8Rng) -> DrawnBody {
    let kind = ranges.kinds[choice(random, ranges.kinds.len())];
    let size = between(random, ranges.size);
    let [low, high] = ranges.within;
    let mut at = |k: usize| between(random, [low[k], high[k]]);
    let centre = DVec3::new(at(0), at(1), at(2));
    let axis = direction(random);
    let turn = DQuat::from_axis_angle(axis, between(random, [0.0, std::f64::consts::TAU]));
    let travel = direction(random) * between(random, [0.0, ranges.travel]);
    DrawnBody {
        kind,
        size,
        centre,
        turn,
        travel,
        friction: between(random, ranges.friction),
    }
}

/// A number of a range, all alike.
fn between(random: &mut ChaCha8Rng, range: [f64; 2]) -> f64 {
    // 53 bits are all that fit.
    let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    range[0] + (range[1] - range[0]) * share
}

/// One of `count` choices, which are few.
fn choice(random: &mut ChaCha8Rng, count: usize) -> usize {
    (between(random, [0.0, count as f64]) as usize).min(count.saturating_sub(1))
}

/// A direction, all alike: a point of the cube that lies in the ball.
fn direction(random: &mut ChaCha8Rng) -> DVec3 {
    for _ in 0..TRIES {
        let mut at = || between(random, [-1.0, 1.0]);
        let point = DVec3::new(at(), at(), at());
        if (0.01..=1.0).contains(&point.length()) {
            return point.normalize();
        }
    }
    DVec3::Y
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges() -> BodyRanges {
        BodyRanges {
            count: [1, 4],
            kinds: vec![BodyKind::Sphere, BodyKind::Capsule, BodyKind::Box],
            size: [0.05, 0.1],
            within: [DVec3::splat(-1.0), DVec3::splat(1.0)],
            travel: 0.5,
            friction: [0.1, 0.4],
            clearance: 0.02,
        }
    }

    #[test]
    fn bodies_are_within_their_ranges_and_clear_of_all_else() {
        let cloth = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let mut counts = [0; 5];
        for number in 0..100 {
            let drawn = draw(&ranges(), &cloth, 3, number).unwrap();
            counts[drawn.len()] += 1;
            for (k, body) in drawn.iter().enumerate() {
                assert!((0.05..=0.1).contains(&body.size));
                assert!((0.1..=0.4).contains(&body.friction));
                assert!(body.centre.abs().max_element() <= 1.0 && body.travel.length() <= 0.5);
                assert!((body.turn.length() - 1.0).abs() < 1e-12);
                let gap = |p: DVec3| p.distance(body.centre) - body.reach();
                assert!(cloth.iter().all(|p| gap(*p) > 0.02));
                let others = drawn[..k].iter();
                assert!(others.clone().all(|o| gap(o.centre) > o.reach() + 0.02));
            }
            assert_eq!(draw(&ranges(), &cloth, 3, number).unwrap(), drawn);
        }
        assert!(
            counts[0] == 0 && counts[1..].iter().all(|n| *n > 5),
            "{counts:?}"
        );
        let other = draw(&ranges(), &cloth, 4, 0);
        assert_ne!(other, draw(&ranges(), &cloth, 3, 0));
    }

    #[test]
    fn a_body_without_a_place_is_told() {
        let crowded = BodyRanges {
            within: [DVec3::ZERO, DVec3::splat(0.01)],
            ..ranges()
        };
        assert_eq!(draw(&crowded, &[DVec3::ZERO], 0, 0), None);
    }
}
