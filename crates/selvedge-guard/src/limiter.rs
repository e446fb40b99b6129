//! Bounds of edge lengths, the last part of a correction. Each edge beyond its bounds is brought
//! back to them; its ends move in inverse proportion to their masses. Sweeps visit edge by edge, to
//! and fro `[eq:guard-limits]`. Handles do not move.
//!
//! Positions in which no edge is too long form a convex set, and each move is a projection onto the
//! set of one edge (in the metric of the masses). So the sweeps converge whenever the handles leave
//! such positions. They end when no edge is too long by more than [`SLACK`]. Shortest lengths form
//! no convex set and are enforced in the first sweeps only. Edges between two handles are left out.

use glam::Vec3;

/// Excess length that an edge may keep, relative to its longest length: far more than the rounding
/// of f32 positions some metres from the origin, far less than can be seen.
pub(crate) const SLACK: f32 = 1e-3;
/// Sweeps that also lengthen edges that are too short.
const BOTH: u32 = 20;

/// Bounds of all edges of a cloth.
pub(crate) struct EdgeLimiter {
    edges: Vec<LimitedEdge>,
    /// True for each vertex that a handle holds, `[vertices]`.
    held: Vec<bool>,
}

/// An edge and its bounds.
pub(crate) struct LimitedEdge {
    /// Vertices of the edge.
    pub(crate) ends: [u32; 2],
    /// Shortest length allowed `[m]`.
    pub(crate) least: f32,
    /// Longest length allowed `[m]`.
    pub(crate) most: f32,
    /// Inverse masses of the ends `[1/kg]`.
    pub(crate) inverse: [f32; 2],
}

impl EdgeLimiter {
    /// Bounds of these edges of a cloth whose handles are `held`, `[vertices]`.
    pub(crate) fn new(edges: Vec<LimitedEdge>, held: Vec<bool>) -> Self {
        Self { edges, held }
    }

    /// Lets the handles at `vertices` go, or has them hold.
    pub(crate) fn hold(&mut self, vertices: impl Iterator<Item = (usize, bool)>) {
        for (vertex, holds) in vertices {
            self.held[vertex] = holds;
        }
    }

    /// The edges that have a free end, with the share of each end in a move, by 1/m.
    fn free(&self) -> impl DoubleEndedIterator<Item = (&LimitedEdge, [f32; 2])> {
        self.edges.iter().filter_map(|edge| {
            let ends = [0, 1].map(|k| (edge.ends[k] as usize, edge.inverse[k]));
            let inverse = ends.map(|(v, inverse)| if self.held[v] { 0.0 } else { inverse });
            let both: f32 = inverse.iter().sum();
            (both > 0.0).then(|| (edge, inverse.map(|weight| weight / both)))
        })
    }

    /// Returns true if all edges are within their bounds, false if a position is not finite.
    pub(crate) fn holds(&self, positions: &[Vec3]) -> bool {
        self.free().all(|(edge, _)| {
            let length = edge.vector(positions).length();
            (edge.least..=edge.most).contains(&length)
        })
    }

    /// Moves free vertices `[m]`, `[vertices]`, until no edge is too long by more than [`SLACK`],
    /// in at most `sweeps` sweeps. Returns true if that was reached.
    pub(crate) fn apply(&self, positions: &mut [Vec3], sweeps: u32) -> bool {
        for sweep in 0..sweeps {
            let is_short = sweep < BOTH;
            let mut changed = false;
            let mut visit = |(edge, shares): (&LimitedEdge, [f32; 2])| {
                let least = if is_short { edge.least } else { 0.0 };
                changed |= edge.limit(least, shares, positions);
            };
            match sweep % 2 {
                0 => self.free().for_each(&mut visit),
                _ => self.free().rev().for_each(&mut visit),
            }
            if !changed {
                break;
            }
        }
        self.within(positions)
    }

    /// Returns true if no edge is too long by more than [`SLACK`].
    fn within(&self, positions: &[Vec3]) -> bool {
        let mut edges = self.free();
        edges.all(|(edge, _)| edge.vector(positions).length() <= edge.most * (1.0 + SLACK))
    }
}

impl LimitedEdge {
    fn vector(&self, positions: &[Vec3]) -> Vec3 {
        positions[self.ends[0] as usize] - positions[self.ends[1] as usize]
    }

    /// Brings the edge back between `least` `[m]` and its longest length, if it is beyond them by
    /// more than half the slack; less is not worth a sweep. Returns true if it was.
    fn limit(&self, least: f32, shares: [f32; 2], positions: &mut [Vec3]) -> bool {
        let most = self.most;
        let apart = self.vector(positions);
        let length = apart.length();
        let allowed = least * (1.0 - SLACK)..=most * (1.0 + 0.5 * SLACK);
        if allowed.contains(&length) || length == 0.0 || !length.is_finite() {
            return false;
        }
        let change = (length.clamp(least, most) / length - 1.0) * apart;
        positions[self.ends[0] as usize] += shares[0] * change;
        positions[self.ends[1] as usize] -= shares[1] * change;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use selvedge_cloth::generate::{named_sheets, sheet};

    /// Bounds of 0.85 and 1.2 for every edge of a named mesh with uniform masses; also its handles
    /// and its positions.
    fn of(number: usize, density: f64) -> (EdgeLimiter, Vec<usize>, Vec<Vec3>) {
        let named = named_sheets()[number];
        let made = sheet(&named.of(named.vertices(density), 3)).unwrap();
        let handles: Vec<usize> = made.labels[named.handles]
            .iter()
            .map(|v| *v as usize)
            .collect();
        let flat: Vec<Vec3> = made.mesh.positions().iter().map(|p| p.as_vec3()).collect();
        let edges = made.mesh.topology().edges().iter().map(|edge| {
            let ends = edge.vertices.map(|v| v.0);
            let length = flat[ends[0] as usize].distance(flat[ends[1] as usize]);
            LimitedEdge {
                ends,
                least: 0.85 * length,
                most: 1.2 * length,
                inverse: [1.0; 2],
            }
        });
        let held = (0..flat.len()).map(|v| handles.contains(&v));
        let limiter = EdgeLimiter::new(edges.collect(), held.collect());
        (limiter, handles, flat)
    }

    fn shaken(flat: &[Vec3], handles: &[usize], size: f32) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw = || size * (2.0 * rng.random::<f32>() - 1.0);
        let mut shaken: Vec<Vec3> = flat
            .iter()
            .map(|p| *p + Vec3::new(draw(), draw(), draw()))
            .collect();
        for &v in handles {
            shaken[v] = flat[v];
        }
        shaken
    }

    #[test]
    fn no_edge_of_any_mesh_stays_too_long_and_handles_stay() {
        for number in 0..named_sheets().len() {
            for (density, size) in [(60.0, 0.05), (60.0, 1.0), (250.0, 0.3)] {
                let (limiter, handles, flat) = of(number, density);
                let mut positions = shaken(&flat, &handles, size);
                assert!(!limiter.holds(&positions));
                assert!(
                    limiter.apply(&mut positions, 1000),
                    "{number} {density} {size}"
                );
                for edge in &limiter.edges {
                    let length = edge.vector(&positions).length();
                    assert!(length <= edge.most * (1.0 + SLACK), "{number}");
                }
                for &v in &handles {
                    assert_eq!(positions[v], flat[v]);
                }
            }
        }
    }

    #[test]
    fn what_is_within_its_bounds_does_not_move() {
        let (limiter, _, flat) = of(0, 60.0);
        let mut positions = flat.clone();
        assert!(limiter.holds(&positions));
        assert!(limiter.apply(&mut positions, 10));
        assert_eq!(positions, flat);
        positions[20].x = f32::NAN;
        assert!(!limiter.holds(&positions) && !limiter.apply(&mut positions, 10));
    }

    #[test]
    fn an_edge_alone_ends_at_its_bound_by_its_shares() {
        let edge = LimitedEdge {
            ends: [0, 1],
            least: 0.8,
            most: 1.2,
            inverse: [1.0, 3.0],
        };
        let limiter = EdgeLimiter::new(vec![edge], vec![false; 2]);
        for (apart, ends) in [(2.0, [0.2, 1.4]), (0.4, [-0.1, 0.7]), (1.1, [0.0, 1.1])] {
            let mut positions = [Vec3::ZERO, Vec3::X * apart];
            assert!(limiter.apply(&mut positions, 3));
            for (position, end) in positions.iter().zip(ends) {
                // Two roundings of numbers of order one.
                assert!(position.distance(Vec3::X * end) < 3e-7, "{apart}");
            }
        }
        let mut gone = [Vec3::ZERO; 2];
        assert!(
            limiter.apply(&mut gone, 3),
            "no direction to be lengthened in"
        );
        assert_eq!(gone, [Vec3::ZERO; 2]);
    }

    #[test]
    fn handles_too_far_apart_are_told() {
        let (limiter, handles, mut flat) = of(0, 60.0);
        flat[handles[1]].z += 1.0;
        assert!(!limiter.apply(&mut flat, 1000));
        assert!(flat.iter().all(|p| p.is_finite() && p.length() < 3.0));
    }
}
