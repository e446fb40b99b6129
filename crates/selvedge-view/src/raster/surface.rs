//! What shading needs to know at each vertex of a frame: the normal, and how hollow the surface is.
//!
//! The normal is the normalised sum of the area vectors of the faces around the vertex. Hollowness
//! is the mean of the neighbours' heights above the tangent plane over their mean distance, in
//! about [-1, 1]: positive in a valley seen from the front, where less light arrives.

use glam::Vec3;
use selvedge_cloth::{Topology, VertexId};

/// Normals and hollowness of one frame, `[vertices]`; kept between frames to keep the memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    pub(crate) normals: Vec<Vec3>,
    pub(crate) hollow: Vec<f32>,
}

impl Surface {
    /// Computes both for `positions` `[m]`, `[vertices]`.
    pub(crate) fn update(&mut self, topology: &Topology, positions: &[Vec3]) {
        self.normals.clear();
        self.normals.resize(positions.len(), Vec3::ZERO);
        for face in topology.faces() {
            let [a, b, c] = face.map(|v| positions[v.index()]);
            let area = (b - a).cross(c - a);
            for vertex in face {
                self.normals[vertex.index()] += area;
            }
        }
        for normal in &mut self.normals {
            *normal = normal.normalize_or_zero();
        }
        let normals = &self.normals;
        self.hollow.clear();
        self.hollow.extend((0..positions.len()).map(|vertex| {
            let vertex = VertexId(vertex as u32);
            hollowness(topology, positions, normals[vertex.index()], vertex)
        }));
    }
}

fn hollowness(topology: &Topology, positions: &[Vec3], normal: Vec3, vertex: VertexId) -> f32 {
    let here = positions[vertex.index()];
    let (mut height, mut distance) = (0.0, 0.0);
    for arc in &topology.arcs()[topology.arcs_into(vertex)] {
        let offset = positions[arc.sender.index()] - here;
        height += offset.dot(normal);
        distance += offset.length();
    }
    if distance > 0.0 {
        height / distance
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pyramid without a base: the apex 0 at height `h` over a square ring of unit radius.
    fn pyramid(h: f32) -> (Topology, Vec<Vec3>) {
        let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let ring = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
        let mut positions = vec![Vec3::new(0.0, 0.0, h)];
        positions.extend(ring.map(|(x, y)| Vec3::new(x, y, 0.0)));
        (Topology::new(5, &faces).unwrap(), positions)
    }

    #[test]
    fn an_apex_points_along_its_axis_and_a_pit_is_hollow() {
        let mut surface = Surface::default();
        for h in [0.0, 0.75, -0.75] {
            let (topology, positions) = pyramid(h);
            surface.update(&topology, &positions);
            assert!(surface.normals[0].distance(Vec3::Z) < 1e-6);
            // Each neighbour is lower by h, at a distance of sqrt(1 + h²).
            let expected = -h / (1.0 + h * h).sqrt();
            assert!((surface.hollow[0] - expected).abs() < 1e-6);
        }
    }
}
