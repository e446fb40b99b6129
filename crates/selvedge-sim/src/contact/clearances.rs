//! Distances of pairs that were computed once, and how far their points have gone since: a pair
//! whose points cannot have come near needs no look. Nor does one whose two sides go the same way.

use std::ops::Range;

use glam::DVec3;
use selvedge_contact::{Candidates, Pair, Slots, approach};

/// Rounding of sums of distances `[m]`.
const ROUNDING: f64 = 1e-9;

/// Distances of the candidates, and the ways of the points in the frames of the searches.
#[derive(Clone, Debug)]
pub(super) struct Clearances {
    slots: Slots,
    /// Way that each point has gone, at least as long as the straight one `[m]`, `[slots]`.
    travelled: Vec<f64>,
    /// The same at the end of the solve under way `[m]`.
    ahead: Vec<f64>,
    /// Part of a distance in a frame that it has in the world, at least.
    shrink: f64,
    /// Way of each point in the solve, in the world `[m]`, `[points]`.
    ways: Vec<DVec3>,
    /// Distance of each candidate when it was computed, plus the ways that its two sides had gone
    /// at least by then `[m]`; negative and infinite before.
    pub(super) budgets: Vec<f64>,
}

impl Clearances {
    /// No distances, for this number of points.
    pub(super) fn new(points: usize, slots: &Slots) -> Self {
        Self {
            travelled: vec![0.0; slots.count()],
            ahead: vec![0.0; slots.count()],
            shrink: 1.0,
            slots: slots.clone(),
            ways: vec![DVec3::ZERO; points],
            budgets: Vec::new(),
        }
    }

    /// Follows the candidates: some were dropped, others are new. Returns true if some were dropped.
    pub(super) fn follow(&mut self, candidates: &mut Candidates) -> bool {
        candidates.renumber(&mut self.budgets, f64::NEG_INFINITY)
    }

    /// A point has gone this far in a frame `[m]`.
    #[inline]
    pub(super) fn go(&mut self, slot: usize, length: f64) {
        self.travelled[slot] += length;
    }

    /// Takes the way of a solve that the candidates cover, of the points that `move`.
    pub(super) fn look_ahead(
        &mut self,
        candidates: &Candidates,
        [start, end]: [&[DVec3]; 2],
        moving: impl Iterator<Item = Range<usize>>,
    ) {
        for range in moving {
            let ends = start[range.clone()].iter().zip(&end[range.clone()]);
            for (way, (start, end)) in self.ways[range].iter_mut().zip(ends) {
                *way = *end - *start;
            }
        }
        let (ahead, travelled) = (&mut self.ahead, &self.travelled);
        candidates.lengths(|slot, length| ahead[slot] = travelled[slot] + length);
        self.shrink = candidates.shrink();
    }

    /// Returns true if a pair of this `budget` `[m]` surely stays more than `distance` `[m]` apart
    /// on the way of the solve, wherever its sides go.
    #[inline]
    pub(super) fn surely_apart(&self, budget: f64, pair: &Pair, distance: f64) -> bool {
        (budget - self.furthest(pair, &self.ahead)) * self.shrink > distance + ROUNDING
    }

    /// Distance of a pair of this `budget` at the start of the solve, at least `[m]`.
    #[inline]
    pub(super) fn at_start(&self, budget: f64, pair: &Pair) -> f64 {
        (budget - self.furthest(pair, &self.travelled)) * self.shrink - ROUNDING
    }

    /// Way of a point of one side of a pair against one of the other in the solve, at most `[m]`.
    #[inline]
    pub(super) fn approach(&self, pair: &Pair) -> f64 {
        against(pair, &self.ways)
    }

    /// The budget of a pair that is this far apart at the start of the solve `[m]`.
    #[inline]
    pub(super) fn budget(&self, pair: &Pair, distance: f64) -> f64 {
        let ways = self.slots.of(pair).map(|slot| self.travelled[slot]);
        let (first, second) = ways.split_at(pair.kind.split());
        let least = |side: &[f64]| side.iter().copied().fold(f64::INFINITY, f64::min);
        distance + least(first) + least(second)
    }

    /// Sum of the largest of these `lengths` `[m]`, `[slots]`, on each side of a pair.
    #[inline]
    fn furthest(&self, pair: &Pair, lengths: &[f64]) -> f64 {
        let ways = self.slots.of(pair).map(|slot| lengths[slot]);
        let (first, second) = ways.split_at(pair.kind.split());
        let most = |side: &[f64]| side.iter().copied().fold(0.0, f64::max);
        most(first) + most(second)
    }
}

/// Length of the longest of the `ways` `[m]`, `[points]`, of a point of one side of a pair against
/// one of the other, at most.
#[inline]
pub(super) fn against(pair: &Pair, ways: &[DVec3]) -> f64 {
    approach(pair.kind, pair.places(ways)) + ROUNDING
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use selvedge_cloth::{Obstacle, Topology};
    use selvedge_contact::{Passage, Reach, Surface};

    use super::*;

    const REST: (DQuat, DVec3) = (DQuat::IDENTITY, DVec3::ZERO);

    /// A vertex of the cloth, one of its faces, above a face of an obstacle.
    fn scene() -> (Surface, Vec<DVec3>, Pair) {
        let cloth = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let below = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
        let body = Obstacle::new("body", below.clone(), vec![[0, 1, 2]]).unwrap();
        let surface = Surface::new(&cloth, &[body]);
        let mut points: Vec<DVec3> = below.iter().map(|p| *p + DVec3::Y).collect();
        points.extend(below);
        (surface, points, Pair::vertex_face(0, 1, [0, 3, 4, 5]))
    }

    #[test]
    fn a_pair_is_apart_as_long_as_its_points_cannot_have_met() {
        let (surface, start, pair) = scene();
        let mut candidates = Candidates::new(&surface, &start, true);
        let mut clearances = Clearances::new(start.len(), candidates.slots());
        let reach = Reach {
            gap: 2.0,
            slack: 1.0,
            ahead: 0.0,
        };
        let still = [Some(Passage::new(REST, REST).unwrap())];
        let moved = |by: f64| -> Vec<DVec3> {
            let cloth = start[..3].iter().map(|p| *p - DVec3::Y * by);
            cloth.chain(start[3..].iter().copied()).collect()
        };
        let mut go = |clearances: &mut Clearances, from: f64, to: f64| {
            let (from, to) = (moved(from), moved(to));
            candidates.start(&from, &still, |slot, way| clearances.go(slot, way));
            if !candidates.cover(&from, &to) {
                candidates.renew(&surface, [&from, &to], reach);
            }
            clearances.follow(&mut candidates);
            let all = std::iter::once(0..start.len());
            clearances.look_ahead(&candidates, [&from, &to], all);
        };
        go(&mut clearances, 0.0, 0.0);
        assert!(!clearances.surely_apart(clearances.budgets[0], &pair, 0.1));
        let budget = clearances.budget(&pair, 1.0);
        go(&mut clearances, 0.0, 0.4);
        assert!(clearances.surely_apart(budget, &pair, 0.5));
        assert!(!clearances.surely_apart(budget, &pair, 0.7));
        assert!((clearances.approach(&pair) - 0.4).abs() < 1e-6);
        // It has gone 0.4, and goes 0.3 more.
        go(&mut clearances, 0.4, 0.7);
        assert!((clearances.at_start(budget, &pair) - 0.6).abs() < 1e-6);
        assert!(clearances.surely_apart(budget, &pair, 0.29));
        assert!(!clearances.surely_apart(budget, &pair, 0.31));
    }

    #[test]
    fn what_falls_together_uses_up_nothing() {
        let (surface, start, pair) = scene();
        let mut candidates = Candidates::new(&surface, &start, true);
        let mut clearances = Clearances::new(start.len(), candidates.slots());
        let reach = Reach {
            gap: 2.0,
            slack: 1.0,
            ahead: 0.0,
        };
        let mut budget = 0.0;
        for k in 0..20 {
            let fall = |k: f64| -> Vec<DVec3> {
                start.iter().map(|p| *p - DVec3::Y * (9.0 * k)).collect()
            };
            let place = |k: f64| (DQuat::IDENTITY, DVec3::NEG_Y * (9.0 * k));
            let (now, then) = (f64::from(k), f64::from(k + 1));
            let (from, to) = (fall(now), fall(then));
            let rigid = [Passage::new(place(now), place(then))];
            candidates.start(&from, &rigid, |slot, way| clearances.go(slot, way));
            if !candidates.cover(&from, &to) {
                candidates.renew(&surface, [&from, &to], reach);
            }
            clearances.follow(&mut candidates);
            let all = std::iter::once(0..start.len());
            clearances.look_ahead(&candidates, [&from, &to], all);
            if k == 0 {
                budget = clearances.budget(&pair, 1.0);
            }
            assert!(clearances.surely_apart(budget, &pair, 0.999), "{k}");
            assert!(clearances.approach(&pair) < 1e-6);
        }
        // One search of each body, for all of it.
        assert_eq!(candidates.made(), 2);
    }
}
