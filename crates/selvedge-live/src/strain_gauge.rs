//! The strain of a cloth that is shown, the largest of all edges, sixty times a second; and the measures
//! of a drape test.

use glam::Vec3;
use selvedge_cloth::{Cloth, Drape};

/// Measures the largest strain of an edge against the material.
pub(crate) struct StrainGauge {
    edges: Vec<[u32; 2]>,
    /// One over the material length of each edge `[1/m]`.
    inverse: Vec<f32>,
    /// The cloth, where it is a drape test.
    draped: Option<Cloth>,
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
            draped: Drape::of(cloth, cloth.rest_positions()).map(|_| cloth.clone()),
        }
    }

    /// Drape coefficient and folds at `positions`, of a drape test.
    pub(crate) fn drape(&self, positions: &[Vec3]) -> Option<(f64, usize)> {
        let found = Drape::of(self.draped.as_ref()?, positions)?;
        Some((found.coefficient, found.nodes))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::{CORNERS, cloth};

    #[test]
    fn a_drape_test_is_measured_and_no_other_cloth() {
        assert_eq!(StrainGauge::new(&cloth()).drape(&CORNERS), None);
        let scene = selvedge_data::open_scene("drape").unwrap().scene;
        let flat: Vec<Vec3> = scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
        let cloth = Cloth::of_scene(&scene, flat.clone()).unwrap();
        let (coefficient, folds) = StrainGauge::new(&cloth).drape(&flat).unwrap();
        assert!(
            (coefficient - 1.0).abs() < 0.03 && folds == 0,
            "{coefficient}"
        );
    }
}
