//! Distances of pairs that were computed once, and how far their points have gone since: a pair
//! whose points cannot have come near needs no look. Nor does one whose two sides go the same way.

use glam::DVec3;
use selvedge_contact::number::Number;
use selvedge_contact::{Pair, approach};

/// Rounding of sums of distances `[m]`.
const ROUNDING: f64 = 1e-9;

/// What is known of a candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairCache {
    /// Distance when it was computed, plus the ways that its two sides had gone at least by then `[m]`;
    /// negative and infinite before.
    pub(super) budget: f64,
    /// What is known of its way in the solve of this number.
    known: Certificate,
    solve: u32,
    pub(super) pushes: Pushes,
}

/// What is known of a pair in a solve. A solve that is repeated, or whose end is pushed, ends near
/// the last one, and most of its pairs need no new look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Certificate {
    /// Distance by which a point of one side may stray from where it ended when the first pair was
    /// certified, against one of the other, while the pair stays certified `[m]`; negative where it is
    /// not, not a number where it has not been looked at.
    pub(super) reach: f64,
    /// A direction that serves it, and the extent along it at the start `[m]`; negative without.
    pub(super) direction: DVec3,
    pub(super) extent: f64,
}

/// Answers of [`Neighbours::leave_out`](super::active_set::Neighbours::leave_out) for a candidate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Pushes {
    #[default]
    Unknown,
    Never,
    Always,
}

impl PairCache {
    /// Nothing is known.
    pub(super) const NEW: Self = Self {
        budget: f64::NEG_INFINITY,
        known: Certificate::NOTHING,
        solve: 0,
        pushes: Pushes::Unknown,
    };

    /// What is known in the solve of this number, to be changed.
    #[inline]
    pub(super) fn in_solve(&mut self, solve: u32) -> &mut Certificate {
        if self.solve != solve {
            (self.solve, self.known) = (solve, Certificate::NOTHING);
        }
        &mut self.known
    }
}

impl Certificate {
    const NOTHING: Self = Self {
        reach: f64::NAN,
        direction: DVec3::ZERO,
        extent: -1.0,
    };
}

/// The ways of the points.
#[derive(Clone, Debug, Default)]
pub(super) struct PathLengths {
    /// Way that each point has gone, at least as long as the straight one `[m]`, `[points]`.
    pub(super) travelled: Vec<f64>,
    /// The same at the end of the solve under way `[m]`.
    ahead: Vec<f64>,
    /// Way of each point in the solve `[m]`.
    ways: Vec<DVec3>,
}

impl PathLengths {
    /// No distances, for this number of points.
    pub(super) fn new(points: usize) -> Self {
        Self {
            travelled: vec![0.0; points],
            ahead: vec![0.0; points],
            ways: vec![DVec3::ZERO; points],
        }
    }

    /// Takes the way of a solve, against what goes this `middle` way `[m]`.
    pub(super) fn look_ahead(&mut self, start: &[DVec3], end: &[DVec3], middle: DVec3) {
        for (way, (start, end)) in self.ways.iter_mut().zip(start.iter().zip(end)) {
            *way = *end - *start - middle;
        }
        let travelled = self.ahead.iter_mut().zip(&self.travelled);
        for ((ahead, travelled), way) in travelled.zip(&self.ways) {
            *ahead = travelled + way.length();
        }
    }

    /// Longest way of a point in the solve `[m]`.
    pub(super) fn longest_way(&self) -> f64 {
        let squares = self.ways.iter().map(|way| way.length_squared());
        squares.fold(0.0, f64::at_least).sqrt()
    }

    /// Returns true if a pair of this `budget` `[m]` surely stays more than `distance` `[m]` apart
    /// on the way of the solve, wherever its sides go.
    #[inline]
    pub(super) fn surely_apart(&self, budget: f64, pair: &Pair, distance: f64) -> bool {
        budget - furthest(pair, &self.ahead) > distance + ROUNDING
    }

    /// Distance of a pair of this `budget` at the start of the solve, at least `[m]`.
    #[inline]
    pub(super) fn at_start(&self, budget: f64, pair: &Pair) -> f64 {
        budget - furthest(pair, &self.travelled) - ROUNDING
    }

    /// Way of a point of one side of a pair against one of the other in the solve, at most `[m]`.
    #[inline]
    pub(super) fn approach(&self, pair: &Pair) -> f64 {
        against(pair, &self.ways)
    }

    /// The budget of a pair that is this far apart at the start of the solve `[m]`.
    #[inline]
    pub(super) fn budget(&self, pair: &Pair, distance: f64) -> f64 {
        let ways = pair.corners.map(|p| self.travelled[p as usize]);
        let (first, second) = ways.split_at(pair.kind.split());
        let least = |side: &[f64]| side.iter().copied().fold(f64::INFINITY, f64::at_most);
        distance + least(first) + least(second)
    }
}

/// Sum of the largest of these `lengths` `[m]`, `[points]`, on each side of a pair.
#[inline]
fn furthest(pair: &Pair, lengths: &[f64]) -> f64 {
    let ways = pair.corners.map(|p| lengths[p as usize]);
    let (first, second) = ways.split_at(pair.kind.split());
    let most = |side: &[f64]| side.iter().copied().fold(0.0, f64::at_least);
    most(first) + most(second)
}

/// Length of the longest of the `ways` `[m]`, `[points]`, of a point of one side of a pair against
/// one of the other, at most.
#[inline]
pub(super) fn against(pair: &Pair, ways: &[DVec3]) -> f64 {
    approach(pair.kind, pair.places(ways)) + ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: [DVec3; 4] = [DVec3::Y, DVec3::ZERO, DVec3::X, DVec3::Z];

    #[test]
    fn a_pair_is_apart_as_long_as_its_points_cannot_have_met() {
        let mut path_lengths = PathLengths::new(4);
        let pair = Pair::vertex_face(0, 0, [0, 1, 2, 3]);
        let moved = |by: f64| START.map(|p| p + DVec3::Y * by);
        path_lengths.look_ahead(&START, &START, DVec3::ZERO);
        assert!(!path_lengths.surely_apart(PairCache::NEW.budget, &pair, 0.1));
        let budget = path_lengths.budget(&pair, 1.0);
        path_lengths.look_ahead(&START, &moved(0.4), DVec3::ZERO);
        assert!(path_lengths.surely_apart(budget, &pair, 0.1));
        assert!(!path_lengths.surely_apart(budget, &pair, 0.2));
        // All have gone 0.4; the same again would be 1.6 of both sides together.
        path_lengths.travelled.fill(0.4);
        path_lengths.look_ahead(&START, &START, DVec3::ZERO);
        assert!(path_lengths.surely_apart(budget, &pair, 0.1));
        assert!((path_lengths.at_start(budget, &pair) - 0.2).abs() < 1e-6);
        path_lengths.look_ahead(&START, &moved(0.2), DVec3::ZERO);
        assert!(!path_lengths.surely_apart(budget, &pair, 0.1));
        let budget = path_lengths.budget(&pair, 0.9);
        assert!(path_lengths.surely_apart(budget, &pair, 0.1));
    }

    #[test]
    fn only_what_goes_against_the_other_side_brings_a_pair_near() {
        let mut path_lengths = PathLengths::new(4);
        let face = Pair::vertex_face(0, 0, [0, 1, 2, 3]);
        let edges = Pair::edge_edge(0, 1, [0, 1, 2, 3]);
        let fall = DVec3::NEG_Y * 5.0;
        path_lengths.look_ahead(&START, &START.map(|p| p + fall), DVec3::ZERO);
        for pair in [face, edges] {
            assert!(path_lengths.approach(&pair) < 1e-6);
        }
        // Each corner alone against the others.
        for own in 0..4 {
            let mut end = START.map(|p| p + fall);
            end[own] += DVec3::X * 0.3;
            path_lengths.look_ahead(&START, &end, DVec3::ZERO);
            for pair in [face, edges] {
                assert!((path_lengths.approach(&pair) - 0.3).abs() < 1e-6, "{own}");
            }
        }
        // Two corners of one side do not come nearer to each other.
        let mut end = START;
        end[2] += DVec3::Z * 0.2;
        end[3] -= DVec3::Z * 0.2;
        path_lengths.look_ahead(&START, &end, DVec3::ZERO);
        assert!((path_lengths.approach(&face) - 0.2).abs() < 1e-6);
    }
}
