//! The 3x3 blocks of the system matrix, each gathered from its elements in a fixed order.

use glam::{DMat3, DVec3, Mat3A, Vec3A};

use crate::lists::Lists;
use crate::solver::elements::{Elements, FaceResponse, HingeResponse};
use crate::solver::pattern::Pattern;
use crate::threads::Threads;

/// The elements that contribute to the block of each slot.
pub(crate) struct Contributions {
    /// Per slot, 16 · face + 4 · row corner + column corner.
    faces: Lists,
    /// Per slot, 16 · hinge + 4 · row corner + column corner.
    hinges: Lists,
    /// Vertex of each slot of the diagonal.
    vertices: Vec<u32>,
}

impl Contributions {
    /// Contributions of `elements` to the slots of `pattern`.
    pub(crate) fn new(pattern: &Pattern, elements: &Elements) -> Self {
        let faces = elements.faces.faces.iter().map(|face| face.corners);
        let hinges = elements.hinges.hinges.iter().map(|hinge| hinge.corners);
        let group = |pairs: &[(u32, u32)]| Lists::group(pattern.slot_count(), pairs);
        Self {
            faces: group(&contributions(pattern, faces)),
            hinges: group(&contributions(pattern, hinges)),
            vertices: pattern.vertices().to_vec(),
        }
    }

    /// Gathers every block of M - dt (dt + c) J + dt D_air in f64, `[kg]`. `air` is room for the
    /// resistance of each face, which all its blocks share.
    pub(crate) fn gather(
        &self,
        threads: Threads,
        elements: &Elements,
        air: &mut [DMat3],
        blocks: &mut [DMat3],
    ) {
        let ninth = elements.time_step() / 9.0;
        let responses = &elements.faces.responses;
        threads.each(air, |k, air| *air = responses[k].air.matrix(ninth));
        threads.each(blocks, |slot, block| {
            let mut sum = DMat3::ZERO;
            for &entry in self.faces.of(slot) {
                let (face, row, column) = unpack(entry);
                let FaceResponse {
                    stretch, jacobian, ..
                } = &responses[face];
                sum += stretch.negative_jacobian(row, column) * *jacobian;
                sum += air[face];
            }
            for &entry in self.hinges.of(slot) {
                let (hinge, row, column) = unpack(entry);
                let HingeResponse { bend, jacobian } = &elements.hinges.responses[hinge];
                sum += bend.negative_jacobian(row, column) * *jacobian;
            }
            if let Some(&vertex) = self.vertices.get(slot) {
                sum += DMat3::from_diagonal(DVec3::splat(elements.mass[vertex as usize]));
            }
            *block = sum;
        });
    }

    /// Gathers every block of `scale` (M - dt (dt + c) J + dt D_air) in f32.
    pub(crate) fn gather_single(
        &self,
        threads: Threads,
        elements: &Elements,
        scale: f64,
        singles: &mut Singles,
        blocks: &mut [Mat3A],
    ) {
        singles.take(threads, elements, scale);
        let Singles { faces, hinges } = singles;
        threads.each(blocks, |slot, block| {
            let mut sum = Mat3A::ZERO;
            for &entry in self.faces.of(slot) {
                let (face, row, column) = unpack(entry);
                faces[face].add_to(&mut sum, row, column);
            }
            for &entry in self.hinges.of(slot) {
                let (hinge, row, column) = unpack(entry);
                let gradient = &hinges[hinge];
                add_outer(&mut sum, gradient[row], gradient[column]);
            }
            if let Some(&vertex) = self.vertices.get(slot) {
                let mass = (elements.mass[vertex as usize] * scale) as f32;
                sum += Mat3A::from_diagonal(glam::Vec3::splat(mass));
            }
            *block = sum;
        });
    }
}

/// The evaluated elements in f32, times the scale of the matrix.
#[derive(Default)]
pub(crate) struct Singles {
    faces: Vec<SingleFace>,
    /// Gradients of the angle, scaled so that a block is a product of two.
    hinges: Vec<[Vec3A; 4]>,
}

/// Contribution of a face to the blocks of its corners: `[eq:stretch-jacobian]`, scaled.
#[derive(Clone, Copy, Default)]
struct SingleFace {
    along: [Vec3A; 2],
    shape_u: [f32; 3],
    shape_v: [f32; 3],
    tangent: [f32; 6],
    tension: [f32; 3],
    air_normal: Vec3A,
    /// Resistance of the air across the normal, and its excess along the normal.
    air: [f32; 2],
}

impl Singles {
    /// Room for the elements of a cloth.
    pub(crate) fn new(elements: &Elements) -> Self {
        Self {
            faces: vec![SingleFace::default(); elements.faces.faces.len()],
            hinges: vec![[Vec3A::ZERO; 4]; elements.hinges.hinges.len()],
        }
    }

    fn take(&mut self, threads: Threads, elements: &Elements, scale: f64) {
        let ninth = elements.time_step() * scale / 9.0;
        threads.each(&mut self.faces, |k, single| {
            *single = SingleFace::new(&elements.faces.responses[k], scale, ninth);
        });
        threads.each(&mut self.hinges, |k, single| {
            let HingeResponse { bend, jacobian } = &elements.hinges.responses[k];
            let root = (bend.tangent * (jacobian * scale)).sqrt();
            *single = bend.gradient.map(|g| (g * root).as_vec3a());
        });
    }
}

impl SingleFace {
    /// The contribution of a face with this response, times `scale`; `ninth` is dt/9 of it `[s]`.
    fn new(response: &FaceResponse, scale: f64, ninth: f64) -> Self {
        let FaceResponse {
            stretch,
            air,
            jacobian,
        } = response;
        let scale = stretch.element.area * (jacobian * scale);
        let [through, across] = air.resistance.map(|resistance| resistance * ninth);
        Self {
            along: [stretch.along_u.as_vec3a(), stretch.along_v.as_vec3a()],
            shape_u: stretch.element.shape_u.map(|d| d as f32),
            shape_v: stretch.element.shape_v.map(|d| d as f32),
            tangent: stretch.elastic.tangent.map(|k| (k * scale) as f32),
            tension: stretch.elastic.tension.map(|t| (t * scale) as f32),
            air_normal: air.normal.as_vec3a(),
            air: [across as f32, (through - across) as f32],
        }
    }

    #[inline]
    fn add_to(&self, sum: &mut Mat3A, row: usize, column: usize) {
        let [along_u, along_v] = self.along;
        let [k0, k1, k2, k3, u3, v3] = self.tangent;
        let (shear, u3, v3) = (0.25 * k3, 0.5 * u3, 0.5 * v3);
        let (row_u, row_v) = (self.shape_u[row], self.shape_v[row]);
        let (column_u, column_v) = (self.shape_u[column], self.shape_v[column]);
        let (uu, vv) = (row_u * column_u, row_v * column_v);
        let (uv, vu) = (row_u * column_v, row_v * column_u);
        let (both, mixed) = (uv + vu, u3 * uu + v3 * vv);
        let left_u =
            along_u * (k0 * uu + shear * vv + u3 * both) + along_v * (k1 * vu + shear * uv + mixed);
        let left_v =
            along_u * (k1 * uv + shear * vu + mixed) + along_v * (k2 * vv + shear * uu + v3 * both);
        add_outer(sum, left_u, along_u);
        add_outer(sum, left_v, along_v);
        let [t0, t1, t2] = self.tension;
        let diagonal = t0 * uu + t1 * vv + t2 * both + self.air[0];
        sum.x_axis.x += diagonal;
        sum.y_axis.y += diagonal;
        sum.z_axis.z += diagonal;
        add_outer(sum, self.air_normal * self.air[1], self.air_normal);
    }
}

/// `sum` += `left` `right`ᵀ.
#[inline]
fn add_outer(sum: &mut Mat3A, left: Vec3A, right: Vec3A) {
    sum.x_axis += left * right.x;
    sum.y_axis += left * right.y;
    sum.z_axis += left * right.z;
}

#[inline]
fn unpack(entry: u32) -> (usize, usize, usize) {
    (
        (entry >> 4) as usize,
        (entry >> 2 & 3) as usize,
        (entry & 3) as usize,
    )
}

/// Pairs (slot, 16 · element + 4 · row corner + column corner) of all elements.
fn contributions<const N: usize>(
    pattern: &Pattern,
    corners: impl Iterator<Item = [u32; N]>,
) -> Vec<(u32, u32)> {
    let mut pairs = Vec::new();
    for (corners, element) in corners.zip(0_u32..) {
        for row in 0..N {
            for column in 0..N {
                let (a, b) = (corners[row], corners[column]);
                if pattern.unknown(a) < pattern.unknown(b) {
                    continue;
                }
                if let Some(slot) = pattern.slot(a, b) {
                    pairs.push((slot, 16 * element + 4 * row as u32 + column as u32));
                }
            }
        }
    }
    pairs
}
