//! The push that brings a pair to a gap: the least change of positions by mass, along one
//! direction.

use glam::DVec3;

use crate::closest::Gap;

/// A push on the four corners of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Moves of the corners `[m]`.
    pub moves: [DVec3; 4],
    /// Size of the push λ `[kg m]`: corner i moves by wᵢ λ n / mᵢ.
    pub size: f64,
}

/// The push along `gap`'s direction after which Σ wᵢ n·xᵢ is `distance` `[m]`, for corners `now`
/// `[m]` and their inverse masses `[1/kg]`, 0 where they are held. None if it is that already, or
/// if all are held. `[eq:separation]`
#[must_use]
pub fn push(gap: &Gap, now: [DVec3; 4], inverse: [f64; 4], distance: f64) -> Option<Push> {
    let mut extent = 0.0;
    let mut mobility = 0.0;
    for k in 0..4 {
        extent += gap.weights[k] * gap.normal.dot(now[k]);
        mobility += gap.weights[k] * gap.weights[k] * inverse[k];
    }
    let lack = distance - extent;
    if lack <= 0.0 || mobility <= 0.0 {
        return None;
    }
    let size = lack / mobility;
    let moves = std::array::from_fn(|k| gap.normal * (gap.weights[k] * inverse[k] * size));
    Some(Push { moves, size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest::gap;
    use crate::pair::Kind;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_push_keeps_both_momenta_and_reaches_its_distance() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for round in 0..200 {
            let kind = [Kind::VertexFace, Kind::EdgeEdge][round % 2];
            let now =
                [0; 4].map(|_| DVec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.0))));
            let inverse = [0; 4].map(|_| rng.random_range(0.1..3.0));
            let found = gap(kind, now);
            let distance = found.distance + 0.3;
            let push = push(&found, now, inverse, distance).unwrap();
            let (mut linear, mut angular) = (DVec3::ZERO, DVec3::ZERO);
            let mut reached = 0.0;
            for k in 0..4 {
                let momentum = push.moves[k] / inverse[k];
                linear += momentum;
                angular += now[k].cross(momentum);
                reached += found.weights[k] * found.normal.dot(now[k] + push.moves[k]);
            }
            assert!(linear.length() < 1e-12 * push.size.max(1.0));
            assert!(angular.length() < 1e-10 * push.size.max(1.0));
            assert!((reached - distance).abs() < 1e-12);
            assert!(super::push(&found, now, inverse, found.distance - 0.1).is_none());
            assert!(super::push(&found, now, [0.0; 4], distance).is_none());
        }
    }
}
