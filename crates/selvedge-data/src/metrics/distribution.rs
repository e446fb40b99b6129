//! Distributions of the numbers of a data set: speed, acceleration, strain and bending angle
//! over all its frames, each with mean, deviation, extremes and a histogram.
//!
//! A histogram does not know its range beforehand: where a value lies outside, the range is doubled
//! and neighbouring bins are put together. So it depends only on the values, not on their order.

use glam::DVec3;
use selvedge_cloth::geometry::dihedral_angle;
use serde::Serialize;

use crate::metrics::material_edge_lengths;
use crate::trajectory::Trajectory;

const BINS: usize = 32;
/// Half the first range: a power of two, so that all bounds are exact.
const FIRST_REACH: f64 = 1.0 / (1 << 20) as f64;

/// Counts in equal bins, from `low` to `high`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Lower bound of the first bin.
    pub low: f64,
    /// Upper bound of the last bin.
    pub high: f64,
    /// Numbers in each bin.
    pub counts: [u64; BINS],
}

/// A set of numbers, summed up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// Number of values.
    pub count: u64,
    /// Mean of the values; 0 where there are none, as for all that follow.
    pub mean: f64,
    /// Sum of squared distances from the mean.
    #[serde(skip)]
    squares: f64,
    /// Standard deviation of the values.
    pub deviation: f64,
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Histogram of the values.
    pub histogram: Histogram,
}

/// The distributions of a data set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Distributions {
    /// Speeds of all vertices, between two frames `[m/s]`.
    pub speed: Distribution,
    /// Accelerations of the free vertices, over three frames `[m/s²]`. A network predicts these.
    pub acceleration: Distribution,
    /// Strains of all edges, (l - l₀)/l₀ with l₀ in material space.
    pub strain: Distribution,
    /// Bending angles at all edges with two faces `[rad]`, 0 where flat.
    pub bending_angle: Distribution,
}

impl Histogram {
    /// A histogram of numbers that are never negative.
    fn positive() -> Self {
        Self {
            low: 0.0,
            high: FIRST_REACH,
            counts: [0; BINS],
        }
    }

    /// A histogram of numbers of both signs.
    fn signed() -> Self {
        Self {
            low: -FIRST_REACH,
            ..Self::positive()
        }
    }

    fn add(&mut self, value: f64) {
        while value < self.low || value >= self.high {
            self.widen();
        }
        let place = (value - self.low) / (self.high - self.low) * BINS as f64;
        self.counts[(place as usize).min(BINS - 1)] += 1;
    }

    /// Doubles the range; zero stays where a bin begins.
    fn widen(&mut self) {
        let mut counts = [0; BINS];
        let first = if self.low < 0.0 { BINS / 4 } else { 0 };
        for (bin, count) in self.counts.iter().enumerate() {
            counts[first + bin / 2] += count;
        }
        self.counts = counts;
        self.low *= 2.0;
        self.high *= 2.0;
    }
}

impl Distribution {
    fn of(histogram: Histogram) -> Self {
        Self {
            count: 0,
            mean: 0.0,
            squares: 0.0,
            deviation: 0.0,
            least: 0.0,
            most: 0.0,
            histogram,
        }
    }

    /// Adds a number; what is not finite belongs to no distribution.
    fn add(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        if self.count == 0 {
            (self.least, self.most) = (value, value);
        }
        self.count += 1;
        // Welford's update.
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
        self.deviation = (self.squares / self.count as f64).sqrt();
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        self.histogram.add(value);
    }
}

impl Default for Distributions {
    fn default() -> Self {
        let positive = || Distribution::of(Histogram::positive());
        let signed = || Distribution::of(Histogram::signed());
        Self {
            speed: positive(),
            acceleration: positive(),
            strain: signed(),
            bending_angle: signed(),
        }
    }
}

impl Distributions {
    /// Each with its name and unit.
    #[must_use]
    pub fn named(&self) -> [(&'static str, &'static str, &Distribution); 4] {
        [
            ("speed", "m/s", &self.speed),
            ("acceleration", "m/s²", &self.acceleration),
            ("strain", "1", &self.strain),
            ("bending angle", "rad", &self.bending_angle),
        ]
    }

    /// Adds all frames of a trajectory.
    pub fn add(&mut self, trajectory: &Trajectory) {
        let rate = trajectory.frame_rate();
        let held = trajectory.handles().mask(trajectory.vertex_count());
        let frames = trajectory.frames();
        let pairs = || frames.iter().zip(frames.iter().skip(1));
        for (now, next) in pairs() {
            for (p, q) in now.iter().zip(next) {
                self.speed.add(rate * p.as_dvec3().distance(q.as_dvec3()));
            }
        }
        for ((before, now), next) in pairs().zip(frames.iter().skip(2)) {
            for vertex in (0..held.len()).filter(|&v| !held[v]) {
                let [a, b, c] = [before, now, next].map(|frame| frame[vertex].as_dvec3());
                self.acceleration
                    .add(rate * rate * (a - 2.0 * b + c).length());
            }
        }
        self.add_edges(trajectory);
    }

    fn add_edges(&mut self, trajectory: &Trajectory) {
        let topology = trajectory.topology();
        let rest = material_edge_lengths(trajectory.cloth());
        for frame in trajectory.frames().iter() {
            let at =
                |vertex: selvedge_cloth::VertexId| -> DVec3 { frame[vertex.index()].as_dvec3() };
            for (edge, rest) in topology.edges().iter().zip(&rest) {
                let [from, to] = edge.vertices.map(at);
                self.strain.add((from.distance(to) - rest) / rest);
                if let (left, Some(right)) = edge.opposite {
                    let angle = dihedral_angle(from, to, at(left), at(right));
                    self.bending_angle.add(angle);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_depends_on_the_values_and_not_on_their_order() {
        let values: Vec<f64> = (0..500)
            .map(|k| 0.013 * f64::from(k * k % 499) - 2.0)
            .collect();
        let of = |values: &[f64]| {
            let mut histogram = Histogram::signed();
            values.iter().for_each(|v| histogram.add(*v));
            histogram
        };
        let histogram = of(&values);
        let reversed: Vec<f64> = values.iter().rev().copied().collect();
        assert_eq!(of(&reversed), histogram);
        // The smallest power of two beyond 0.013 · 498 - 2 = 4.474.
        assert_eq!((histogram.low, histogram.high), (-8.0, 8.0));
        for (bin, count) in histogram.counts.iter().enumerate() {
            let from = -8.0 + 0.5 * bin as f64;
            let inside = values.iter().filter(|v| (from..from + 0.5).contains(*v));
            assert_eq!(*count, inside.count() as u64);
        }
    }

    #[test]
    fn mean_and_deviation_are_those_of_the_numbers() {
        let mut distribution = Distribution::of(Histogram::positive());
        assert_eq!((distribution.mean, distribution.deviation), (0.0, 0.0));
        (1..=9).for_each(|k| distribution.add(f64::from(k)));
        distribution.add(f64::NAN);
        // Of 1 … n: mean (n + 1)/2, variance (n² - 1)/12.
        assert!((distribution.mean - 5.0).abs() < 1e-14);
        assert!((distribution.deviation - (80.0_f64 / 12.0).sqrt()).abs() < 1e-14);
        assert_eq!((distribution.least, distribution.most), (1.0, 9.0));
        assert_eq!((distribution.count, distribution.histogram.high), (9, 16.0));
    }
}
