//! Terms that see folds: how far a cloth is bent as a whole, what is in its short waves, and how
//! far its edges are pressed together.
//!
//! A prediction that is unsure of where a fold will be is nearest to the truth, on average, with
//! half a fold. The first two terms compare amounts, wherever they are, so that a whole fold in the
//! wrong place costs less than none.

use glam::DVec3;
use selvedge_cloth::Modes;
use selvedge_model::Normalizer;
use selvedge_model::geometry::{bending_angle, bending_angle_with_gradient, length_with_gradient};

use super::{LossEvaluator, LossStatistics, LossWeights, Triplet, inverse, share};

/// Modes that are no short waves: the constant one and the twenty longest waves.
pub(crate) const LONG_MODES: usize = 21;

/// Short waves of a smaller amplitude count as if they had this one `[m]`.
const LEAST_AMPLITUDE: f64 = 1e-3;

impl LossEvaluator {
    /// The terms of bending spread, short waves and compression; none where a weight is 0.
    pub(super) fn folds(
        &mut self,
        triplet: &Triplet<'_>,
        statistics: &LossStatistics,
    ) -> [Option<f64>; 3] {
        let LossWeights {
            bending_spread,
            short_waves,
            compression,
            ..
        } = self.weights;
        let is_on = |weight: f64| weight > 0.0;
        [
            is_on(bending_spread)
                .then(|| self.bending_spread(triplet, &statistics.bending_angle, bending_spread)),
            is_on(short_waves).then(|| self.short_waves(triplet, short_waves)),
            is_on(compression)
                .then(|| self.compression(triplet, &statistics.edge_length, compression)),
        ]
    }

    /// L_σ = (σ - σ̄)², in deviations of θ, with σ² the mean of θ² over edges
    /// `[eq:bending-spread-loss]`.
    fn bending_spread(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = inverse(of.deviation()[0]);
        let share = share(triplet.graph.topology().edges().len());
        let spread = |positions: &[DVec3]| {
            let hinges = triplet.graph.hinges().iter();
            let angles = hinges.map(|hinge| bending_angle(triplet.hinge_points(hinge, positions)));
            (share * angles.map(|angle| angle * angle).sum::<f64>()).sqrt()
        };
        let found = spread(&self.positions);
        let difference = scale * (found - spread(triplet.target));
        // A flat cloth has no slope.
        let by_spread = 2.0 * weight * difference * scale * share * inverse(found);
        for hinge in triplet.graph.hinges() {
            let points = triplet.hinge_points(hinge, &self.positions);
            let (angle, slopes) = bending_angle_with_gradient(points);
            let vertices = [hinge.from, hinge.to, hinge.left, hinge.right];
            for (v, slope) in vertices.into_iter().zip(slopes) {
                self.by_position[v as usize] += by_spread * angle * slope;
            }
        }
        difference * difference
    }

    /// L_w = ((A - Ā) / Ā)², with A the amplitude of all short waves `[eq:short-wave-loss]`; 0
    /// where the cloth has no [`selvedge_model::ClothGraph::long_modes`].
    fn short_waves(&mut self, triplet: &Triplet<'_>, weight: f64) -> f64 {
        let Some(modes) = triplet.graph.long_modes() else {
            return 0.0;
        };
        let target = amplitude(modes, &without_long_waves(modes, triplet.target));
        let rest = without_long_waves(modes, &self.positions);
        let found = amplitude(modes, &rest);
        let scale = 1.0 / target.max(LEAST_AMPLITUDE);
        let difference = scale * (found - target);
        let by_square = weight * difference * scale * inverse(found);
        let rows = rest.iter().zip(&modes.shares);
        for (sum, (part, &share)) in self.by_position.iter_mut().zip(rows) {
            // What is left has no long waves, so that the way back through them is 0.
            *sum += 2.0 * by_square * share * *part;
        }
        difference * difference
    }

    /// L_c = mean over edges of (s - s̄)², in deviations of an edge's length, with
    /// s = min(|d| - `|d_rest|`, 0) `[eq:compression-loss]`.
    fn compression(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = inverse(of.deviation()[0]);
        let edges = triplet.graph.topology().edges();
        let share = share(edges.len());
        let mut loss = 0.0;
        for (edge, &rest) in edges.iter().zip(triplet.graph.rest_lengths()) {
            let [a, b] = edge.vertices.map(|v| v.index());
            let pressed = |length: f64| (length - f64::from(rest)).min(0.0);
            let target = triplet.target[a].distance(triplet.target[b]);
            let (length, slope) = length_with_gradient(self.positions[a] - self.positions[b]);
            let found = pressed(length);
            let difference = scale * (found - pressed(target));
            loss += difference * difference;
            if found < 0.0 {
                let by_vector = 2.0 * weight * share * difference * scale * slope;
                self.by_position[a] += by_vector;
                self.by_position[b] -= by_vector;
            }
        }
        loss * share
    }
}

/// Positions without their parts in long waves `[m]`.
pub(super) fn without_long_waves(modes: &Modes, positions: &[DVec3]) -> Vec<DVec3> {
    let count = modes.count();
    let mut waves = vec![DVec3::ZERO; count];
    let rows = || modes.values.chunks_exact(count.max(1));
    for ((row, &share), &position) in rows().zip(&modes.shares).zip(positions) {
        for (wave, &value) in waves.iter_mut().zip(row) {
            *wave += share * value * position;
        }
    }
    let left = rows().zip(positions).map(|(row, &position)| {
        let long: DVec3 = row
            .iter()
            .zip(&waves)
            .map(|(&value, &wave)| value * wave)
            .sum();
        position - long
    });
    left.collect()
}

/// The root of the mean square of `rest` over the area.
fn amplitude(modes: &Modes, rest: &[DVec3]) -> f64 {
    let squares = rest.iter().zip(&modes.shares);
    let square: f64 = squares
        .map(|(part, share)| share * part.length_squared())
        .sum();
    square.sqrt()
}
