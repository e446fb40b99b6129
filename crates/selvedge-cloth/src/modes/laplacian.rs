//! The Laplacian of linear elements on a cloth's flat faces, with the area of each vertex.

use glam::DVec3;

use crate::cloth::Cloth;
use crate::ids::FaceId;
use crate::modes::subspace::Symmetric;

/// Weights between vertices, and areas of vertices.
pub(super) struct Laplacian {
    /// Half the sum of the cotangents opposite to each edge, `[edges]`, and the edge's vertices.
    edges: Vec<([usize; 2], f64)>,
    /// A third of the faces around each vertex `[m²]`, `[vertices]`.
    areas: Vec<f64>,
}

impl Laplacian {
    pub(super) fn of(cloth: &Cloth) -> Self {
        let topology = cloth.topology();
        let edges = topology.edges().iter();
        let mut laplacian = Self {
            edges: edges
                .map(|edge| (edge.vertices.map(|v| v.index()), 0.0))
                .collect(),
            areas: vec![0.0; cloth.vertex_count()],
        };
        for (face, edges) in topology.face_edges().iter().enumerate() {
            let vertices = topology.faces()[face].map(|v| v.index());
            let corners = flat_face(cloth, face);
            for (corner, at) in corners.iter().enumerate() {
                let [next, last] = [1, 2].map(|by| (corner + by) % 3);
                let [left, right] = [corners[next] - at, corners[last] - at];
                let double_area = left.cross(right).length();
                // A face of no area would have infinite cotangents.
                let least = 1e-9 * left.length_squared().max(right.length_squared());
                let cotangent = left.dot(right) / double_area.max(least).max(f64::MIN_POSITIVE);
                let opposite = edges.iter().find(|edge| {
                    let ends = laplacian.edges[edge.index()].0;
                    !ends.contains(&vertices[corner])
                });
                if let Some(edge) = opposite {
                    laplacian.edges[edge.index()].1 += 0.5 * cotangent;
                }
                laplacian.areas[vertices[corner]] += double_area / 6.0;
            }
        }
        let total: f64 = laplacian.areas.iter().sum();
        let least = f64::MIN_POSITIVE.max(1e-12 * total);
        laplacian.areas.iter_mut().for_each(|a| *a = a.max(least));
        laplacian
    }

    /// Share of each vertex in the area, `[vertices]`.
    pub(super) fn shares(&self) -> Vec<f64> {
        let total: f64 = self.areas.iter().sum();
        self.areas.iter().map(|area| area / total).collect()
    }

    /// M^-½ L M^-½ `[1/m²]`, with the areas on the diagonal of M: its eigenvectors are those of
    /// L φ = λ M φ times M^½.
    pub(super) fn scaled(&self) -> Symmetric {
        let roots: Vec<f64> = self.areas.iter().map(|area| area.sqrt()).collect();
        let mut matrix = Symmetric::zeros(roots.len());
        for &(ends, weight) in &self.edges {
            let [a, b] = ends;
            matrix.add_to_diagonal(a, weight / self.areas[a]);
            matrix.add_to_diagonal(b, weight / self.areas[b]);
            matrix.put(ends, -weight / (roots[a] * roots[b]));
        }
        matrix
    }
}

/// Corners of a face in the pattern, or in the rest pose where the pattern is unknown `[m]`.
fn flat_face(cloth: &Cloth, face: usize) -> [DVec3; 3] {
    let flat = cloth.pattern().face(FaceId(face as u32));
    if flat.iter().all(|corner| *corner == flat[0]) {
        let vertices = cloth.topology().faces()[face];
        return vertices.map(|v| cloth.rest_positions()[v.index()].as_dvec3());
    }
    flat.map(|corner| corner.as_dvec2().extend(0.0))
}
