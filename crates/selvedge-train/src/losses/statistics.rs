//! Statistics of the quantities that the losses compare, gathered from the targets alone, so that
//! a prediction cannot move its own yardstick.

use glam::DVec3;
use selvedge_model::{Normalizer, RunningStatistics, SpecError};
use serde::{Deserialize, Serialize};

use super::Triplet;
use selvedge_model::geometry::bending_angle;

/// One `T` for each quantity that the losses compare.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerQuantity<T> {
    /// Acceleration of a free vertex `[m/frame²]`, width 3: the network's output.
    pub acceleration: T,
    /// Kinetic energy of a free vertex `[kg m²/frame²]`, width 1.
    pub kinetic_energy: T,
    /// Vector of an edge, both ways `[m]`, width 3.
    pub edge_vector: T,
    /// Length of an edge `[m]`, width 1.
    pub edge_length: T,
    /// Bending angle of an edge `[rad]`, 0 on the boundary, width 1.
    pub bending_angle: T,
}

/// Frozen statistics of what the losses compare.
pub type LossStatistics = PerQuantity<Normalizer>;

/// The same statistics while samples are added.
pub type RunningLossStatistics = PerQuantity<RunningStatistics>;

/// Numbers of each quantity.
const WIDTHS: PerQuantity<usize> = PerQuantity {
    acceleration: 3,
    kinetic_energy: 1,
    edge_vector: 3,
    edge_length: 1,
    bending_angle: 1,
};

impl<T> PerQuantity<T> {
    /// `of` each.
    fn map<U>(&self, of: impl Fn(&T) -> U) -> PerQuantity<U> {
        PerQuantity {
            acceleration: of(&self.acceleration),
            kinetic_energy: of(&self.kinetic_energy),
            edge_vector: of(&self.edge_vector),
            edge_length: of(&self.edge_length),
            bending_angle: of(&self.bending_angle),
        }
    }
}

impl Default for RunningLossStatistics {
    fn default() -> Self {
        WIDTHS.map(|&width| RunningStatistics::new(&[width]))
    }
}

impl RunningLossStatistics {
    /// Checks what was read from a checkpoint.
    pub(crate) fn check(&self) -> Result<(), SpecError> {
        self.acceleration.check(&[WIDTHS.acceleration])?;
        self.kinetic_energy.check(&[WIDTHS.kinetic_energy])?;
        self.edge_vector.check(&[WIDTHS.edge_vector])?;
        self.edge_length.check(&[WIDTHS.edge_length])?;
        self.bending_angle.check(&[WIDTHS.bending_angle])
    }

    /// Adds the targets of one sample.
    pub fn add(&mut self, triplet: &Triplet<'_>) {
        let free = || triplet.free_vertices();
        let accelerations = free().flat_map(|v| triplet.acceleration(v).to_array());
        self.acceleration.add(&accelerations.collect::<Vec<f64>>());
        let energies = free().map(|v| triplet.kinetic_energy(v, triplet.target[v]));
        self.kinetic_energy.add(&energies.collect::<Vec<f64>>());

        let edges = triplet.graph.topology().edges();
        let mut vectors = Vec::with_capacity(6 * edges.len());
        let mut lengths = Vec::with_capacity(edges.len());
        for edge in edges {
            let [a, b] = edge.vertices.map(|v| triplet.target[v.index()]);
            let d: DVec3 = a - b;
            vectors.extend(d.to_array());
            vectors.extend((-d).to_array());
            lengths.push(d.length());
        }
        self.edge_vector.add(&vectors);
        self.edge_length.add(&lengths);

        let mut angles = vec![0.0; edges.len()];
        for hinge in triplet.graph.hinges() {
            let points = triplet.hinge_points(hinge, triplet.target);
            angles[hinge.edge as usize] = bending_angle(points);
        }
        self.bending_angle.add(&angles);
    }

    /// The statistics of the samples so far.
    pub fn freeze(&self) -> LossStatistics {
        self.map(RunningStatistics::freeze)
    }
}
