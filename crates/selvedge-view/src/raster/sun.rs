//! The key light's shadow of the cloth on itself: how much of the light reaches each vertex.
//!
//! The cloth is drawn into a small map of its greatest height along the light, by parallel rays. A
//! vertex is lit where the map around it is no higher than the vertex. The mean over the neighbours
//! softens the edge of the shadow to the width of a few edges.

use glam::{Vec2, Vec3};
use selvedge_cloth::Topology;

use super::surface::smooth;

/// Cells along the side of the map.
const CELLS: usize = 160;
/// A surface higher than a vertex by so many cells begins to hide the light; by twice as many it
/// hides all of it.
const BIAS: f32 = 2.0;
/// Rounds of softening.
const ROUNDS: usize = 3;

/// The light on one frame; kept between frames to keep the memory.
#[derive(Clone, Debug)]
pub(crate) struct Sun {
    towards: Vec3,
    map: HeightMap,
    /// The part of the light that reaches each vertex, `[vertices]`, in [0, 1].
    pub(crate) reach: Vec<f32>,
    scratch: Vec<f32>,
}

impl Sun {
    /// A light in the direction `towards`, a unit vector.
    pub(crate) fn new(towards: Vec3) -> Self {
        Self {
            towards,
            map: HeightMap::default(),
            reach: Vec::new(),
            scratch: Vec::new(),
        }
    }

    /// Computes the light on `positions` `[m]`, `[vertices]`, beside the faces of `bodies`.
    pub(crate) fn update(&mut self, topology: &Topology, positions: &[Vec3], bodies: &[[Vec3; 3]]) {
        let cloth = topology.faces().iter();
        let cloth = cloth.map(|face| face.map(|vertex| positions[vertex.index()]));
        let faces = cloth.chain(bodies.iter().copied());
        self.map.draw(faces, self.towards);
        self.reach.clear();
        self.reach
            .extend(positions.iter().map(|&p| self.map.open(p)));
        for _ in 0..ROUNDS {
            smooth(topology, &self.reach, &mut self.scratch);
            std::mem::swap(&mut self.reach, &mut self.scratch);
        }
    }

    /// The part of the light that reaches a point of a body, in [0, 1].
    pub(crate) fn open(&self, point: Vec3) -> f32 {
        self.map.open(point)
    }
}

/// The greatest height of a surface along a direction, on a grid of square cells across it.
#[derive(Clone, Debug, Default)]
struct HeightMap {
    direction: Vec3,
    across: Vec3,
    down: Vec3,
    origin: Vec2,
    per_metre: f32,
    heights: Vec<f32>,
}

impl HeightMap {
    fn draw(&mut self, faces: impl Iterator<Item = [Vec3; 3]> + Clone, direction: Vec3) {
        self.direction = direction;
        (self.across, self.down) = direction.any_orthonormal_pair();
        let flat = |p: Vec3| Vec2::new(p.dot(self.across), p.dot(self.down));
        let (low, high) = faces
            .clone()
            .flatten()
            .fold((Vec2::MAX, Vec2::MIN), |(low, high), p| {
                (low.min(flat(p)), high.max(flat(p)))
            });
        // A cell is left free at each side, for the look-ups around a vertex.
        let side = (high - low).max_element().max(1e-5);
        self.per_metre = (CELLS - 4) as f32 / side;
        self.origin = low - Vec2::splat(2.0 / self.per_metre);
        self.heights.clear();
        self.heights.resize(CELLS * CELLS, f32::NEG_INFINITY);
        for face in faces {
            self.fill(face);
        }
    }

    /// A point in cells, and its height in cells.
    fn place(&self, point: Vec3) -> Vec3 {
        let flat = Vec2::new(point.dot(self.across), point.dot(self.down)) - self.origin;
        (flat * self.per_metre).extend(point.dot(self.direction) * self.per_metre)
    }

    fn fill(&mut self, corners: [Vec3; 3]) {
        let [a, b, c] = corners.map(|corner| self.place(corner));
        let [ab, ac] = [b - a, c - a];
        let doubled_area = ab.x * ac.y - ab.y * ac.x;
        if doubled_area.abs() < 1e-6 || !doubled_area.is_finite() {
            return;
        }
        let last = (CELLS - 1) as f32;
        let low = a.min(b).min(c).clamp(Vec3::ZERO, Vec3::splat(last)).ceil();
        let high = a.max(b).max(c).clamp(Vec3::ZERO, Vec3::splat(last)).floor();
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let p = Vec2::new(x as f32 - a.x, y as f32 - a.y);
                let u = (p.x * ac.y - p.y * ac.x) / doubled_area;
                let v = (ab.x * p.y - ab.y * p.x) / doubled_area;
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                    let cell = &mut self.heights[y * CELLS + x];
                    *cell = cell.max(a.z + u * ab.z + v * ac.z);
                }
            }
        }
    }

    /// The part of the cells around a point of the surface that hide nothing of it, in [0, 1].
    fn open(&self, point: Vec3) -> f32 {
        let place = self.place(point);
        let last = (CELLS - 2) as f32;
        let [x, y] = [place.x, place.y].map(|at| at.round().clamp(1.0, last) as usize);
        let mut open = 0.0;
        for row in y - 1..=y + 1 {
            for column in x - 1..=x + 1 {
                let above = self.heights[row * CELLS + column] - place.z;
                // From open at the bias to hidden at twice the bias.
                open += (2.0 - above / BIAS).clamp(0.0, 1.0);
            }
        }
        open / 9.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_that_is_nearer_to_the_light_shades_the_other() {
        // A unit square at height 1 over one at height 0, in a grid of 12 x 12 vertices each.
        const SIDE: usize = 12;
        let at = |layer: usize, row: usize, column: usize| {
            (layer * SIDE * SIDE + row * SIDE + column) as u32
        };
        let mut faces = Vec::new();
        let mut positions = Vec::new();
        for layer in 0..2 {
            for row in 0..SIDE {
                for column in 0..SIDE {
                    let [x, z] = [column, row].map(|k| k as f32 / (SIDE - 1) as f32);
                    positions.push(Vec3::new(x, layer as f32, z));
                    if row + 1 < SIDE && column + 1 < SIDE {
                        let corner = at(layer, row, column);
                        let (right, below) =
                            (at(layer, row, column + 1), at(layer, row + 1, column));
                        faces.push([corner, below, right]);
                        faces.push([right, below, below + 1]);
                    }
                }
            }
        }
        let topology = Topology::new(positions.len(), &faces).unwrap();
        let mut sun = Sun::new(Vec3::Y);
        sun.update(&topology, &positions, &[]);
        let middle = SIDE / 2;
        assert_eq!(sun.reach[at(0, middle, middle) as usize], 0.0);
        assert_eq!(sun.reach[at(1, middle, middle) as usize], 1.0);
        // From below it is the other way round.
        let mut sun = Sun::new(-Vec3::Y);
        sun.update(&topology, &positions, &[]);
        assert_eq!(sun.reach[at(0, middle, middle) as usize], 1.0);
        assert_eq!(sun.reach[at(1, middle, middle) as usize], 0.0);
    }
}
