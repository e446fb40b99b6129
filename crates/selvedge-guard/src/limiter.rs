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
}

/// An edge that has a free end.
pub(crate) struct LimitedEdge {
    /// Vertices of the edge.
    pub(crate) ends: [u32; 2],
    /// Shortest length allowed `[m]`.
    pub(crate) least: f32,
    /// Longest length allowed `[m]`.
    pub(crate) most: f32,
    /// Share of a move that each end takes, by 1/m: 0 for a handle, 1 in all.
    pub(crate) shares: [f32; 2],
}

impl EdgeLimiter {
    pub(crate) fn new(edges: Vec<LimitedEdge>) -> Self {
        Self { edges }
    }

    /// Returns true if all edges are within their bounds, false if a position is not finite.
    pub(crate) fn holds(&self, positions: &[Vec3]) -> bool {
        self.edges.iter().all(|edge| {
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
            let mut visit = |edge: &LimitedEdge| {
                let least = if is_short { edge.least } else { 0.0 };
                changed |= edge.limit(least, positions);
            };
            match sweep % 2 {
                0 => self.edges.iter().for_each(&mut visit),
                _ => self.edges.iter().rev().for_each(&mut visit),
            }
            if !changed {
                break;
            }
        }
        self.within(positions)
    }

    /// Returns true if no edge is too long by more than [`SLACK`].
    fn within(&self, positions: &[Vec3]) -> bool {
        let mut edges = self.edges.iter();
        edges.all(|edge| edge.vector(positions).length() <= edge.most * (1.0 + SLACK))
    }
}

impl LimitedEdge {
    fn vector(&self, positions: &[Vec3]) -> Vec3 {
        positions[self.ends[0] as usize] - positions[self.ends[1] as usize]
    }

    /// Brings the edge back between `least` `[m]` and its longest length, if it is beyond them by
    /// more than half the slack; less is not worth a sweep. Returns true if it was.
    fn limit(&self, least: f32, positions: &mut [Vec3]) -> bool {
        let most = self.most;
        let apart = self.vector(positions);
        let length = apart.length();
        let allowed = least * (1.0 - SLACK)..=most * (1.0 + 0.5 * SLACK);
        if allowed.contains(&length) || length == 0.0 || !length.is_finite() {
            return false;
        }
        let change = (length.clamp(least, most) / length - 1.0) * apart;
        positions[self.ends[0] as usize] += self.shares[0] * change;
        positions[self.ends[1] as usize] -= self.shares[1] * change;
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
        let weight = |v: u32| {
            if handles.contains(&(v as usize)) {
                0.0
            } else {
                1.0
            }
        };
        let edges = made.mesh.topology().edges().iter().filter_map(|edge| {
            let ends = edge.vertices.map(|v| v.0);
            let weights = ends.map(weight);
            let both: f32 = weights.iter().sum();
            let length = flat[ends[0] as usize].distance(flat[ends[1] as usize]);
            (both > 0.0).then(|| LimitedEdge {
                ends,
                least: 0.85 * length,
                most: 1.2 * length,
                shares: weights.map(|weight| weight / both),
            })
        });
        (EdgeLimiter::new(edges.collect()), handles, flat)
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
            shares: [0.25, 0.75],
        };
        let limiter = EdgeLimiter::new(vec![edge]);
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
