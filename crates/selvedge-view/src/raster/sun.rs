//! The key light's shadow of the cloth and of the bodies: how much of the light reaches a point.
//!
//! All is drawn into a map of its greatest height along the light, by parallel rays. A point is lit
//! where the map around it is no higher than the plane of the surface there; the mean over a square
//! of cells gives shadows a soft edge.

use glam::{Vec2, Vec3, Vec3A};

/// Cells along the side of the map.
const CELLS: usize = 320;
/// A surface higher than a point by so many cells begins to hide the light; by twice as many it
/// hides all of it. Where the light grazes, both are more.
const BIAS: f32 = 2.0;
/// Width of the square over which shadows are soft, in cells.
const SOFT: usize = 7;
/// Most cells that the plane of a surface may rise per cell.
const STEEPEST: f32 = 12.0;

/// The light on one frame: the greatest height of a surface along its direction, on a grid of square
/// cells across it. Kept between frames to keep the memory.
#[derive(Clone, Debug)]
pub(crate) struct Sun {
    direction: Vec3,
    across: Vec3,
    down: Vec3,
    origin: Vec2,
    per_metre: f32,
    heights: Vec<f32>,
}

impl Sun {
    /// A light in the direction `towards`, a unit vector.
    pub(crate) fn new(towards: Vec3) -> Self {
        let (across, down) = towards.any_orthonormal_pair();
        Self {
            direction: towards,
            across,
            down,
            origin: Vec2::ZERO,
            per_metre: 0.0,
            heights: Vec::new(),
        }
    }

    /// Draws the map of `faces` `[m]`.
    pub(crate) fn update(&mut self, faces: &[[Vec3; 3]]) {
        let (mut low, mut high) = (Vec2::MAX, Vec2::MIN);
        for p in faces.as_flattened() {
            let flat = Vec2::new(p.dot(self.across), p.dot(self.down));
            (low, high) = (low.min(flat), high.max(flat));
        }
        // Cells are left free at each side, for the look-ups around a point.
        let side = (high - low).max_element().max(1e-5);
        self.per_metre = (CELLS - 2 * SOFT) as f32 / side;
        self.origin = low - Vec2::splat(SOFT as f32 / self.per_metre);
        self.heights.clear();
        self.heights.resize(CELLS * CELLS, f32::NEG_INFINITY);
        for face in faces {
            self.fill(face);
        }
    }

    /// Where the light sees a point `[m]`: a place in the map and the height, in cells.
    pub(crate) fn place(&self, point: Vec3) -> Vec3A {
        let flat = Vec2::new(point.dot(self.across), point.dot(self.down)) - self.origin;
        let height = point.dot(self.direction) * self.per_metre;
        (flat * self.per_metre).extend(height).into()
    }

    fn fill(&mut self, corners: &[Vec3; 3]) {
        let [a, b, c] = corners.map(|corner| Vec3::from(self.place(corner)));
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

    /// The part of the light that reaches a `place` of a surface with this normal, in [0, 1]: of the
    /// cells around it, the part that hide nothing of the plane of the surface there.
    #[inline]
    pub(crate) fn open(&self, place: Vec3A, normal: Vec3A) -> f32 {
        let normal = Vec3::from(normal);
        let rise = normal.dot(self.direction);
        let steep = rise.abs().max(1e-6) * rise.signum();
        let slope = Vec2::new(normal.dot(self.across), normal.dot(self.down)) / -steep;
        let slope = slope.clamp(Vec2::splat(-STEEPEST), Vec2::splat(STEEPEST));
        let bias = (BIAS * (1.0 + 0.5 * slope.length())).recip();
        // The square begins within a cell: its first and last rows and columns count in part.
        let last = Vec2::splat((CELLS - SOFT - 2) as f32);
        let middle = Vec2::new(place.x, place.y);
        let start = (middle - 0.5 * SOFT as f32 + 0.5).clamp(Vec2::ZERO, last);
        let first = start.floor();
        let part = start - first;
        let weight = |k: usize, part: f32| match k {
            0 => 1.0 - part,
            SOFT => part,
            _ => 1.0,
        };
        let mut open = 0.0;
        for row in 0..=SOFT {
            let line = (first.y as usize + row) * CELLS + first.x as usize;
            let mut sum = 0.0;
            for (column, height) in self.heights[line..=line + SOFT].iter().enumerate() {
                let cell = first + Vec2::new(column as f32, row as f32);
                let above = height - (place.z + slope.dot(cell - middle));
                // From open at the bias to hidden at twice the bias.
                sum += weight(column, part.x) * (2.0 - above * bias).clamp(0.0, 1.0);
            }
            open += weight(row, part.y) * sum;
        }
        open / (SOFT * SOFT) as f32
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
        let place = |face: &[u32; 3]| face.map(|vertex| positions[vertex as usize]);
        let faces: Vec<[Vec3; 3]> = faces.iter().map(place).collect();
        let mut sun = Sun::new(Vec3::Y);
        sun.update(&faces);
        let middle = SIDE / 2;
        let reach = |sun: &Sun, layer| {
            let point = positions[at(layer, middle, middle) as usize];
            sun.open(sun.place(point), Vec3A::Y)
        };
        assert_eq!([0, 1].map(|layer| reach(&sun, layer)), [0.0, 1.0]);
        // From below it is the other way round.
        let mut sun = Sun::new(-Vec3::Y);
        sun.update(&faces);
        assert_eq!([0, 1].map(|layer| reach(&sun, layer)), [1.0, 0.0]);
    }
}
