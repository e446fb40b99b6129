//! Distances of pairs that were computed once, and how far their points have gone since: a pair
//! whose points cannot have come near needs no look.

use glam::DVec3;
use selvedge_contact::Pair;

/// Rounding of sums of distances `[m]`.
const ROUNDING: f64 = 1e-9;

/// Distances of the candidates, and the ways of the points.
#[derive(Clone, Debug, Default)]
pub(super) struct Clearances {
    /// Way that each point has gone, at least as long as the straight one `[m]`, `[points]`.
    pub(super) travelled: Vec<f64>,
    /// The same at the end of the solve under way `[m]`.
    ahead: Vec<f64>,
    /// Distance of each candidate when it was computed, plus the ways that its two sides had gone
    /// at least by then `[m]`; negative and infinite before.
    budgets: Vec<f64>,
}

impl Clearances {
    /// No distances, for this number of points.
    pub(super) fn new(points: usize) -> Self {
        Self {
            travelled: vec![0.0; points],
            ahead: vec![0.0; points],
            budgets: Vec::new(),
        }
    }

    /// Forgets all distances: there are other candidates, this many.
    pub(super) fn reset(&mut self, pairs: usize) {
        self.travelled.fill(0.0);
        self.budgets.clear();
        self.budgets.resize(pairs, f64::NEG_INFINITY);
    }

    /// Takes the way of a solve.
    pub(super) fn look_ahead(&mut self, start: &[DVec3], end: &[DVec3]) {
        let ways = start
            .iter()
            .zip(end)
            .map(|(start, end)| start.distance(*end));
        let travelled = self.ahead.iter_mut().zip(&self.travelled);
        for ((ahead, travelled), way) in travelled.zip(ways) {
            *ahead = travelled + way;
        }
    }

    /// Returns true if candidate `k` surely stays more than `distance` `[m]` apart on the way of
    /// the solve.
    #[inline]
    pub(super) fn surely_apart(&self, k: usize, pair: &Pair, distance: f64) -> bool {
        let ways = pair.corners.map(|p| self.ahead[p as usize]);
        let (first, second) = ways.split_at(pair.kind.split());
        let most = |side: &[f64]| side.iter().copied().fold(0.0, f64::max);
        self.budgets[k] - most(first) - most(second) > distance + ROUNDING
    }

    /// Keeps the distance of candidate `k` at the start of the solve `[m]`.
    #[inline]
    pub(super) fn keep(&mut self, k: usize, pair: &Pair, distance: f64) {
        let ways = pair.corners.map(|p| self.travelled[p as usize]);
        let (first, second) = ways.split_at(pair.kind.split());
        let least = |side: &[f64]| side.iter().copied().fold(f64::INFINITY, f64::min);
        self.budgets[k] = distance + least(first) + least(second);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_apart_as_long_as_its_points_cannot_have_met() {
        let mut clearances = Clearances::new(4);
        clearances.reset(1);
        let pair = Pair::vertex_face(0, 0, [0, 1, 2, 3]);
        let start = [DVec3::Y, DVec3::ZERO, DVec3::X, DVec3::Z];
        let moved = |by: f64| start.map(|p| p + DVec3::Y * by);
        clearances.look_ahead(&start, &start);
        assert!(!clearances.surely_apart(0, &pair, 0.1));
        clearances.keep(0, &pair, 1.0);
        clearances.look_ahead(&start, &moved(0.4));
        assert!(clearances.surely_apart(0, &pair, 0.1));
        assert!(!clearances.surely_apart(0, &pair, 0.2));
        // All have gone 0.4; the same again would be 1.6 of both sides together.
        clearances.travelled.fill(0.4);
        clearances.look_ahead(&start, &start);
        assert!(clearances.surely_apart(0, &pair, 0.1));
        clearances.look_ahead(&start, &moved(0.2));
        assert!(!clearances.surely_apart(0, &pair, 0.1));
        clearances.keep(0, &pair, 0.9);
        assert!(clearances.surely_apart(0, &pair, 0.1));
    }
}
