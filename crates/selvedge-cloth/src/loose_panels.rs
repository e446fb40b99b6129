//! The panels of a sewn mesh as they lie in space before they are sewn.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::{Mesh, MeshError};

/// Panels with vertices of their own. Their faces are those of the sewn mesh, in the same order.
#[derive(Clone, Debug, PartialEq)]
pub struct LoosePanels {
    faces: Vec<[u32; 3]>,
    positions: Vec<DVec3>,
}

impl LoosePanels {
    /// Panels whose `faces` (`[faces, 3]`) name places among `places` `[m]`; places that no face
    /// names are left out. Returns nothing where a face names a place that there is not.
    pub fn new(faces: &[[u32; 3]], places: &[DVec3]) -> Option<Self> {
        let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
        for place in faces.as_flattened() {
            numbers.insert(*place, 0);
        }
        let mut positions = Vec::with_capacity(numbers.len());
        for (place, number) in &mut numbers {
            *number = positions.len() as u32;
            positions.push(*places.get(*place as usize)?);
        }
        let number = |place: &u32| numbers.get(place).copied().unwrap_or_default();
        let faces = faces.iter().map(|face| face.each_ref().map(number));
        Some(Self {
            faces: faces.collect(),
            positions,
        })
    }

    /// Start positions of the loose vertices `[m]`.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// The same panels with each position moved by `place`.
    pub fn moved(mut self, place: impl Fn(DVec3) -> DVec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = place(*p));
        self
    }

    /// The panels as a mesh of their own, with the pattern and the fabrics of `sewn`.
    ///
    /// # Errors
    /// Panels that are no mesh, or that are not those of `sewn`.
    pub fn mesh(&self, sewn: &Mesh) -> Result<Mesh, MeshError> {
        let shapes: Vec<[glam::DVec2; 3]> = sewn.pattern().faces().collect();
        let mesh = Mesh::sewn(&self.faces, &shapes, self.positions.clone())?;
        mesh.with_fabrics(sewn.fabrics().clone())
    }

    /// Loose vertices of each vertex of `sewn`, `[vertices]`.
    pub fn copies(&self, sewn: &Mesh) -> Vec<Vec<usize>> {
        let mut copies = vec![Vec::new(); sewn.positions().len()];
        for (face, loose) in sewn.topology().faces().iter().zip(&self.faces) {
            for (vertex, copy) in face.iter().zip(loose) {
                let known: &mut Vec<usize> = &mut copies[vertex.index()];
                if !known.contains(&(*copy as usize)) {
                    known.push(*copy as usize);
                }
            }
        }
        copies
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn panels_have_the_shapes_of_the_sewn_mesh_and_vertices_of_their_own() {
        let points = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(DVec2::from);
        let [a, b, c, d] = points;
        let positions = points.map(|p| p.extend(0.0)).to_vec();
        let shapes = [[a, b, c], [b, d, c]];
        let sewn = Mesh::sewn(&[[0, 1, 2], [1, 3, 2]], &shapes, positions).unwrap();
        let mut places: Vec<DVec3> = (0..8).map(|k| DVec3::new(f64::from(k), 0.0, 0.0)).collect();
        places[7].y = 1.0;
        let loose = LoosePanels::new(&[[0, 1, 2], [4, 7, 6]], &places).unwrap();
        // Place 3 and place 5 are nobody's.
        assert_eq!(loose.positions().len(), 6);
        assert_eq!(
            loose.copies(&sewn),
            [vec![0], vec![1, 3], vec![2, 4], vec![5]]
        );
        let apart = loose.clone().moved(|p| p + DVec3::Z).mesh(&sewn).unwrap();
        assert_eq!(apart.positions()[5], DVec3::new(7.0, 1.0, 1.0));
        let areas = |mesh: &Mesh| mesh.rest_shape(1.0).face_area;
        assert_eq!(areas(&apart), areas(&sewn));
        assert_eq!(apart.topology().sheets(), [0, 0, 0, 1, 1, 1]);
        assert_eq!(LoosePanels::new(&[[0, 1, 9]], &places), None);
    }
}
