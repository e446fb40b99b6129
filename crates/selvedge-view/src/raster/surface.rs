//! The shape of the surface at each vertex of a frame: the normal, and the relief.
//!
//! The normal is the normalised sum of the area vectors of the faces around the vertex. The relief
//! is the height of the vertex above the smoothed surface around it, along the normal, over the
//! mean length of the edges: positive on a ridge seen from the front, negative in a valley, where
//! less light arrives. Two widths of smoothing are added, for creases and for folds.

use glam::Vec3;
use selvedge_cloth::{Topology, VertexId};

/// Rounds of smoothing for creases, and for folds, with the weight of each.
const WIDTHS: [(usize, f32); 2] = [(1, 1.6), (9, 0.9)];

/// Normals and relief of one frame, `[vertices]`; kept between frames to keep the memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    pub(crate) normals: Vec<Vec3>,
    pub(crate) relief: Vec<f32>,
    smoothed: Vec<Vec3>,
    scratch: Vec<Vec3>,
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
        self.measure_relief(topology, positions);
    }

    fn measure_relief(&mut self, topology: &Topology, positions: &[Vec3]) {
        let lengths = topology.edges().iter().map(|edge| {
            let [a, b] = edge.vertices.map(|vertex| positions[vertex.index()]);
            a.distance(b)
        });
        let mean = lengths.sum::<f32>() / topology.edges().len().max(1) as f32;
        let per_length = mean.max(f32::MIN_POSITIVE).recip();
        self.relief.clear();
        self.relief.resize(positions.len(), 0.0);
        self.smoothed.clear();
        self.smoothed.extend_from_slice(positions);
        let mut done = 0;
        for (rounds, weight) in WIDTHS {
            for _ in done..rounds {
                smooth(topology, &self.smoothed, &mut self.scratch);
                std::mem::swap(&mut self.smoothed, &mut self.scratch);
            }
            done = rounds;
            let weight = weight * per_length / (rounds as f32).sqrt();
            for (vertex, relief) in self.relief.iter_mut().enumerate() {
                let height = positions[vertex] - self.smoothed[vertex];
                *relief += weight * height.dot(self.normals[vertex]);
            }
        }
    }
}

/// The middle of an arc through two points with these unit normals, and the normal there: cloth is
/// drawn rounder than its mesh. The arc is that of the curve of second order.
pub(crate) fn bowed([a, b]: [Vec3; 2], [from, to]: [Vec3; 2]) -> (Vec3, Vec3) {
    let along = b - a;
    let rise = 0.125 * (to * to.dot(along) - from * from.dot(along));
    (0.5 * (a + b) + rise, (from + to).normalize_or(from))
}

/// Replaces each value by the mean of itself and the mean of its neighbours.
fn smooth<T>(topology: &Topology, values: &[T], smoothed: &mut Vec<T>)
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
{
    smoothed.clear();
    smoothed.extend((0..values.len()).map(|vertex| {
        let here = values[vertex];
        let arcs = &topology.arcs()[topology.arcs_into(VertexId(vertex as u32))];
        let mut neighbours = arcs.iter().map(|arc| values[arc.sender.index()]);
        match neighbours.next() {
            None => here,
            Some(first) => {
                let sum = neighbours.fold(first, |sum, value| sum + value);
                (here + sum * (arcs.len() as f32).recip()) * 0.5
            }
        }
    }));
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
    fn an_apex_points_along_its_axis_and_is_a_ridge_and_a_pit_a_valley() {
        let mut surface = Surface::default();
        for h in [0.0, 0.75, -0.75] {
            let (topology, positions) = pyramid(h);
            surface.update(&topology, &positions);
            assert!(surface.normals[0].distance(Vec3::Z) < 1e-6);
            assert_eq!(surface.relief[0] > 0.0, h > 0.0);
            assert_eq!(surface.relief[0] < 0.0, h < 0.0);
        }
    }

    #[test]
    fn an_edge_bows_onto_the_circle_that_its_normals_belong_to() {
        // A tenth of a turn: the middle of the chord is 4.9 % inside, and the fourth order is small.
        let at = |angle: f32| Vec3::new(angle.cos(), angle.sin(), 0.0);
        let [a, b] = [-0.31416, 0.31416].map(at);
        let (middle, normal) = bowed([a, b], [a, b]);
        assert!(
            middle.distance(Vec3::X) < 4e-3 && normal.distance(Vec3::X) < 1e-6,
            "{middle}"
        );
        // A plane stays one.
        assert_eq!(bowed([a, b], [Vec3::Z; 2]).0, 0.5 * (a + b));
    }

    #[test]
    fn smoothing_takes_half_of_the_mean_of_the_neighbours() {
        let (topology, _) = pyramid(1.0);
        let mut smoothed = Vec::new();
        smooth(&topology, &[8.0, 0.0, 1.0, 2.0, 3.0], &mut smoothed);
        assert!((smoothed[0] - 0.5_f32 * (8.0 + 1.5)).abs() < 1e-6);
        // A corner of the ring: the apex and two neighbours on the ring.
        assert!((smoothed[1] - 0.5 * (8.0 + 1.0 + 3.0) / 3.0).abs() < 1e-6);
    }
}
