//! The strain of a cloth that is shown: the largest of all edges, sixty times a second.

use glam::Vec3;
use selvedge_cloth::Cloth;

/// Measures the largest strain of an edge against the material.
pub(crate) struct StrainGauge {
    edges: Vec<[u32; 2]>,
    /// One over the material length of each edge `[1/m]`.
    inverse: Vec<f32>,
}

impl StrainGauge {
    pub(crate) fn new(cloth: &Cloth) -> Self {
        let edges = cloth.topology().edges().iter();
        let lengths = cloth.pattern().edge_lengths();
        Self {
            edges: edges.map(|edge| edge.vertices.map(|v| v.0)).collect(),
            inverse: lengths
                .iter()
                .map(|&length| (1.0 / length) as f32)
                .collect(),
        }
    }

    /// max (l - l₀)/l₀ at `positions` `[m]`, `[vertices]`. The same as
    /// `selvedge_data::metrics::largest_strain` of one frame, in f32.
    pub(crate) fn largest(&self, positions: &[Vec3]) -> f64 {
        let stretch = |(&[a, b], inverse): (&[u32; 2], &f32)| {
            positions[a as usize].distance(positions[b as usize]) * inverse
        };
        let most = self.edges.iter().zip(&self.inverse).map(stretch);
        f64::from(most.fold(0.0, f32::max)) - 1.0
    }
}
