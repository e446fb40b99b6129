//! The loss of a prediction (Libao et al. 2023, §5.3) and its gradient, for one sample:
//!
//! L = L_acc + λ_KE L_KE + λ_ev L_ev + λ_el L_el + λ_θ L_θ `[eq:total-loss]`.
//!
//! The prediction is a normalised acceleration. It gives positions p̄ as in a rollout
//! ([`selvedge_model::TwoFrames::moved`]); handles take their target instead. Kinetic energy, edge
//! vector, edge length and bending angle of p̄ and of the target are compared in deviations of the
//! *target* quantity; the means cancel. All positions of a sample stand in one frame of reference:
//! the local frame of its current positions. Everything inside is f64; a component that never
//! varied is not compared.

mod statistics;
#[cfg(test)]
mod tests;

use glam::DVec3;
use selvedge_model::geometry::{
    bending_angle, bending_angle_with_gradient, length_with_gradient, wrapped,
};
use selvedge_model::{ClothGraph, Hinge, Normalizer, Real, TwoFrames};
use serde::{Deserialize, Serialize};

use crate::bounds::{ConfigError, require};

pub use statistics::{LossStatistics, PerQuantity, RunningLossStatistics};

/// Weights of the loss terms beside the acceleration, whose weight is 1. A term of weight 0 is off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossWeights {
    /// λ_KE.
    pub kinetic_energy: f64,
    /// λ_ev.
    pub edge_vector: f64,
    /// λ_el.
    pub edge_length: f64,
    /// λ_θ.
    pub bending_angle: f64,
}

impl Default for LossWeights {
    /// The paper's.
    fn default() -> Self {
        Self {
            kinetic_energy: 1.0,
            edge_vector: 30.0,
            edge_length: 30.0,
            bending_angle: 0.5,
        }
    }
}

impl LossWeights {
    /// Checks that every weight is finite and none negative.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let Self {
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
        } = *self;
        for (field, found) in [
            ("losses.kinetic_energy", kinetic_energy),
            ("losses.edge_vector", edge_vector),
            ("losses.edge_length", edge_length),
            ("losses.bending_angle", bending_angle),
        ] {
            let holds = found.is_finite() && found >= 0.0;
            require(holds, field, "finite and not negative", found)?;
        }
        Ok(())
    }
}

/// Three consecutive frames of a cloth, all in the same axes `[m]`, `[vertices]` each.
#[derive(Clone, Copy, Debug)]
pub struct Triplet<'a> {
    /// The cloth.
    pub graph: &'a ClothGraph,
    /// Positions one frame before the current ones.
    pub previous: &'a [DVec3],
    /// Positions that the prediction starts from.
    pub current: &'a [DVec3],
    /// Positions that it should lead to.
    pub target: &'a [DVec3],
}

impl Triplet<'_> {
    fn frames(&self) -> TwoFrames<'_, DVec3> {
        TwoFrames {
            graph: self.graph,
            previous: self.previous,
            current: self.current,
        }
    }

    /// The target's acceleration of vertex `v` `[m/frame²]`.
    fn acceleration(&self, v: usize) -> DVec3 {
        self.frames().acceleration_to(self.target[v], v)
    }

    /// Kinetic energy of vertex `v` on its way to `next` `[kg m²/frame²]`.
    fn kinetic_energy(&self, v: usize, next: DVec3) -> f64 {
        let mass = f64::from(self.graph.cloth().vertex_mass()[v]);
        0.5 * mass * (next - self.current[v]).length_squared()
    }

    fn free_vertices(&self) -> impl Iterator<Item = usize> {
        let mask = self.graph.handle_mask().iter().enumerate();
        mask.filter(|(_, handle)| !**handle).map(|(v, _)| v)
    }

    fn hinge_points(&self, hinge: &Hinge, positions: &[DVec3]) -> [DVec3; 4] {
        [hinge.from, hinge.to, hinge.left, hinge.right].map(|v| positions[v as usize])
    }
}

/// The terms of one sample's loss, each before its weight; `None` for one that was not computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossTerms {
    /// L_acc.
    pub acceleration: f64,
    /// L_KE.
    pub kinetic_energy: Option<f64>,
    /// L_ev.
    pub edge_vector: Option<f64>,
    /// L_el.
    pub edge_length: Option<f64>,
    /// L_θ.
    pub bending_angle: Option<f64>,
    /// The weighted sum.
    pub total: f64,
}

impl LossTerms {
    /// Total, acceleration and the other terms in their order; NaN for one that there is not.
    fn to_array(self) -> [f64; 6] {
        let rest = [
            self.kinetic_energy,
            self.edge_vector,
            self.edge_length,
            self.bending_angle,
        ];
        let [a, b, c, d] = rest.map(|term| term.unwrap_or(f64::NAN));
        [self.total, self.acceleration, a, b, c, d]
    }

    fn from_array([total, acceleration, rest @ ..]: [f64; 6]) -> Self {
        let rest = rest.map(|term| (!term.is_nan()).then_some(term));
        let [kinetic_energy, edge_vector, edge_length, bending_angle] = rest;
        Self {
            acceleration,
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
            total,
        }
    }

    /// The six numbers as bytes.
    pub(crate) fn to_bytes(self) -> Vec<u8> {
        let numbers = self.to_array().into_iter();
        numbers.flat_map(f64::to_le_bytes).collect()
    }

    /// The terms of several slots, one after another; none where the bytes are of something else.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Vec<Self>> {
        let (numbers, rest) = bytes.as_chunks::<8>();
        let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let (rows, cut) = numbers.as_chunks::<6>();
        let is_whole = rest.is_empty() && cut.is_empty();
        is_whole.then(|| rows.iter().map(|row| Self::from_array(*row)).collect())
    }

    /// The terms of acceleration, kinetic energy, edge vector, edge length and bending angle, in
    /// this order; those of weight 0 are left out.
    pub fn weighted(weights: &LossWeights, terms: [f64; 5]) -> Self {
        let [acceleration, rest @ ..] = terms;
        let all = [
            weights.kinetic_energy,
            weights.edge_vector,
            weights.edge_length,
            weights.bending_angle,
        ];
        let counted = all.iter().zip(rest).filter(|(weight, _)| **weight > 0.0);
        let total = acceleration + counted.map(|(w, l)| w * l).sum::<f64>();
        let term = |k: usize| (all[k] > 0.0).then_some(rest[k]);
        Self {
            acceleration,
            kinetic_energy: term(0),
            edge_vector: term(1),
            edge_length: term(2),
            bending_angle: term(3),
            total,
        }
    }

    /// The mean of each term; `None` where one of `terms` has none.
    pub(crate) fn mean<'a>(terms: impl IntoIterator<Item = &'a Self>) -> Self {
        let all: Vec<(f64, Self)> = terms.into_iter().map(|terms| (1.0, *terms)).collect();
        Self::weighted_mean(&all)
    }

    /// The mean of each term with these weights; `None` where one of `terms` has none.
    pub(crate) fn weighted_mean(terms: &[(f64, Self)]) -> Self {
        let weights: f64 = terms.iter().map(|(weight, _)| weight).sum();
        let share = if weights > 0.0 { 1.0 / weights } else { 0.0 };
        let sum = |k: usize| terms.iter().map(|(w, t)| w * t.to_array()[k]).sum::<f64>();
        Self::from_array(std::array::from_fn(|k| share * sum(k)))
    }
}

/// Computes losses and their gradients; keeps its buffers between samples.
#[derive(Clone, Debug)]
pub struct LossEvaluator {
    weights: LossWeights,
    /// p̄ `[m]`, `[vertices]`.
    positions: Vec<DVec3>,
    /// ∂(weighted position terms)/∂p̄, `[vertices]`.
    by_position: Vec<DVec3>,
}

impl LossEvaluator {
    /// An evaluator of the terms with a positive weight.
    pub fn new(weights: LossWeights) -> Self {
        Self {
            weights,
            positions: Vec::new(),
            by_position: Vec::new(),
        }
    }

    /// The loss of the normalised acceleration `predicted` (`[vertices, 3]`); `gradient`, of the
    /// same shape, receives that of the total, 0 for handles.
    ///
    /// A prediction that is not finite gives a total that is not finite.
    ///
    /// # Panics
    /// When a slice does not have the size of the cloth.
    pub fn evaluate<T: Real>(
        &mut self,
        triplet: &Triplet<'_>,
        statistics: &LossStatistics,
        predicted: &[T],
        gradient: &mut [T],
    ) -> LossTerms {
        let vertices = triplet.graph.vertex_count();
        for positions in [triplet.previous, triplet.current, triplet.target] {
            assert_eq!(positions.len(), vertices, "one position per vertex");
        }
        assert_eq!(predicted.len(), 3 * vertices, "predicted acceleration");
        assert_eq!(gradient.len(), 3 * vertices, "gradient");
        self.predict_positions(triplet, &statistics.acceleration, predicted);
        let (weights, of) = (self.weights, statistics);
        let mut terms = [0.0; 5];
        if weights.kinetic_energy > 0.0 {
            terms[1] = self.kinetic_energy(triplet, &of.kinetic_energy, weights.kinetic_energy);
        }
        if weights.edge_vector > 0.0 {
            terms[2] = self.edge_vector(triplet, &of.edge_vector, weights.edge_vector);
        }
        if weights.edge_length > 0.0 {
            terms[3] = self.edge_length(triplet, &of.edge_length, weights.edge_length);
        }
        if weights.bending_angle > 0.0 {
            terms[4] = self.bending_angle(triplet, &of.bending_angle, weights.bending_angle);
        }
        // Last: it collects the gradient of all.
        terms[0] = self.acceleration(triplet, &of.acceleration, predicted, gradient);
        LossTerms::weighted(&weights, terms)
    }

    /// Sets p̄ to the positions that the prediction leads to ([`TwoFrames::moved`]); handles take
    /// their target.
    fn predict_positions<T: Real>(
        &mut self,
        triplet: &Triplet<'_>,
        acceleration: &Normalizer,
        predicted: &[T],
    ) {
        let (mean, deviation) = (
            vector(acceleration.mean()),
            vector(acceleration.deviation()),
        );
        let vertices = triplet.target.len();
        self.by_position.clear();
        self.by_position.resize(vertices, DVec3::ZERO);
        self.positions.resize(vertices, DVec3::ZERO);
        let accelerations = (0..vertices).map(|v| row(predicted, v) * deviation + mean);
        let handles = triplet.graph.handles().vertices().iter();
        let handles = handles.map(|v| triplet.target[v.index()]);
        triplet
            .frames()
            .moved(accelerations, handles, &mut self.positions);
    }

    /// L_acc = mean over free vertices of |a - ā|², normalised `[eq:acceleration-loss]`; also
    /// collects the whole gradient: ∂p̄/∂(normalised a) is the acceleration's deviation.
    fn acceleration<T: Real>(
        &self,
        triplet: &Triplet<'_>,
        statistics: &Normalizer,
        predicted: &[T],
        gradient: &mut [T],
    ) -> f64 {
        let (mean, deviation) = (vector(statistics.mean()), vector(statistics.deviation()));
        let scale = vector(statistics.deviation()).map(inverse);
        let share = share(triplet.free_vertices().count());
        gradient.fill(T::ZERO);
        let mut loss = 0.0;
        for v in triplet.free_vertices() {
            let target = (triplet.acceleration(v) - mean) * scale;
            let difference = row(predicted, v) - target;
            loss += difference.length_squared();
            let by_acceleration = 2.0 * share * difference + self.by_position[v] * deviation;
            for (out, value) in gradient[3 * v..].iter_mut().zip(by_acceleration.to_array()) {
                *out = T::from_f64(value);
            }
        }
        loss * share
    }

    /// L_KE = mean over free vertices of (KE - K̄E)², in deviations of KE
    /// `[eq:kinetic-energy-loss]`.
    fn kinetic_energy(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = inverse(of.deviation()[0]);
        let share = share(triplet.free_vertices().count());
        let mut loss = 0.0;
        for v in triplet.free_vertices() {
            let target = triplet.kinetic_energy(v, triplet.target[v]);
            let found = triplet.kinetic_energy(v, self.positions[v]);
            let difference = scale * (found - target);
            loss += difference * difference;
            let momentum = f64::from(triplet.graph.cloth().vertex_mass()[v])
                * (self.positions[v] - triplet.current[v]);
            self.by_position[v] += 2.0 * weight * share * difference * scale * momentum;
        }
        loss * share
    }

    /// L_ev = mean over edges of |d - d̄|², each component in its deviations
    /// `[eq:edge-vector-loss]`.
    fn edge_vector(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = vector(of.deviation()).map(inverse);
        let edges = triplet.graph.topology().edges();
        let share = share(edges.len());
        let mut loss = 0.0;
        for edge in edges {
            let [a, b] = edge.vertices.map(|v| v.index());
            let target = triplet.target[a] - triplet.target[b];
            let difference = scale * (self.positions[a] - self.positions[b] - target);
            loss += difference.length_squared();
            let by_vector = 2.0 * weight * share * difference * scale;
            self.by_position[a] += by_vector;
            self.by_position[b] -= by_vector;
        }
        loss * share
    }

    /// L_el = mean over edges of (|d| - |d̄|)², in deviations of |d| `[eq:edge-length-loss]`.
    fn edge_length(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = inverse(of.deviation()[0]);
        let edges = triplet.graph.topology().edges();
        let share = share(edges.len());
        let mut loss = 0.0;
        for edge in edges {
            let [a, b] = edge.vertices.map(|v| v.index());
            let target = triplet.target[a].distance(triplet.target[b]);
            let (found, slope) = length_with_gradient(self.positions[a] - self.positions[b]);
            let difference = scale * (found - target);
            loss += difference * difference;
            let by_vector = 2.0 * weight * share * difference * scale * slope;
            self.by_position[a] += by_vector;
            self.by_position[b] -= by_vector;
        }
        loss * share
    }

    /// L_θ = mean over edges of (θ - θ̄)², in deviations of θ `[eq:bending-loss]`. The difference
    /// is taken the shorter way round, so that two almost closed folds on either side of ±π are
    /// alike; boundary edges add nothing but count.
    fn bending_angle(&mut self, triplet: &Triplet<'_>, of: &Normalizer, weight: f64) -> f64 {
        let scale = inverse(of.deviation()[0]);
        let share = share(triplet.graph.topology().edges().len());
        let mut loss = 0.0;
        for hinge in triplet.graph.hinges() {
            let target = bending_angle(triplet.hinge_points(hinge, triplet.target));
            let points = triplet.hinge_points(hinge, &self.positions);
            let (found, slopes) = bending_angle_with_gradient(points);
            let difference = scale * wrapped(found - target);
            loss += difference * difference;
            let by_angle = 2.0 * weight * share * difference * scale;
            let vertices = [hinge.from, hinge.to, hinge.left, hinge.right];
            for (v, slope) in vertices.into_iter().zip(slopes) {
                self.by_position[v as usize] += by_angle * slope;
            }
        }
        loss * share
    }
}

/// 1 / deviation, and 0 for what never varied.
fn inverse(deviation: f64) -> f64 {
    if deviation > 0.0 { 1.0 / deviation } else { 0.0 }
}

/// Weight of one of `count` things in their mean.
fn share(count: usize) -> f64 {
    1.0 / count.max(1) as f64
}

fn vector(components: &[f64]) -> DVec3 {
    DVec3::from_slice(components)
}

fn row<T: Real>(rows: &[T], v: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| rows[3 * v + k].to_f64()))
}
