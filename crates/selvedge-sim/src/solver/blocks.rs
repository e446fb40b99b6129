//! The 3x3 blocks of the system matrix, each gathered from its elements in a fixed order.

use glam::{DMat3, DVec3, Mat3A, Vec3A};

use crate::laws::number::GROUP;
use crate::lists::Lists;
use crate::solver::elements::Elements;
use crate::solver::faces::{FaceBlocks, FaceResponse};
use crate::solver::hinges::HingeResponse;
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
        let (faces, hinges) = (elements.faces.corners(), elements.hinges.corners());
        let group = |pairs: &[(u32, u32)]| Lists::group(pattern.slot_count(), pairs);
        Self {
            faces: group(&contributions(pattern, faces)),
            hinges: group(&contributions(pattern, hinges)),
            vertices: pattern.vertices().to_vec(),
        }
    }

    /// Gathers every block of M - dt (dt + c) J + dt D_air in f64, `[kg]`. `room` is for the elements.
    pub(crate) fn gather(
        &self,
        threads: Threads,
        elements: &Elements,
        room: &mut Doubles,
        blocks: &mut [DMat3],
    ) {
        room.take(threads, elements);
        threads.each(blocks, |slot, block| {
            let mut sum = DMat3::ZERO;
            for &entry in self.faces.of(slot) {
                let (face, row, column) = unpack(entry);
                let (response, air) = &room.faces[face];
                let [x, y, z] = response.stretch.negative_jacobian(row, column);
                sum += DMat3::from_cols(x, y, z) * response.jacobian;
                sum += *air;
            }
            for &entry in self.hinges.of(slot) {
                let (hinge, row, column) = unpack(entry);
                sum += room.hinges[hinge].block(row, column);
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
                sum += faces[face].of(row, column);
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

/// The evaluated elements in f64, one after the other.
pub(crate) struct Doubles {
    /// Each face's response, and the air's resistance that all its blocks share `[kg]`.
    faces: Vec<(FaceResponse, DMat3)>,
    hinges: Vec<HingeResponse>,
}

impl Doubles {
    /// Room for the elements of a cloth.
    pub(crate) fn new(elements: &Elements) -> Self {
        let (faces, hinges) = (&elements.faces, &elements.hinges);
        let face = |face| (faces.response(face), DMat3::ZERO);
        Self {
            faces: (0..faces.count()).map(face).collect(),
            hinges: (0..hinges.count()).map(|k| hinges.response(k)).collect(),
        }
    }

    fn take(&mut self, threads: Threads, elements: &Elements) {
        let ninth = elements.time_step() / 9.0;
        threads.each(&mut self.faces, |k, face| {
            let response = elements.faces.response(k);
            *face = (response, response.drag.matrix(ninth));
        });
        threads.each(&mut self.hinges, |k, hinge| {
            *hinge = elements.hinges.response(k);
        });
    }
}

/// The evaluated elements in f32, times the scale of the matrix.
pub(crate) struct Singles {
    /// Of whole groups.
    faces: Vec<FaceBlocks>,
    /// Gradients of the angle, scaled so that a block is a product of two; of whole groups.
    hinges: Vec<[Vec3A; 4]>,
}

impl Singles {
    /// Room for the elements of a cloth.
    pub(crate) fn new(elements: &Elements) -> Self {
        let room = |count: usize| count.next_multiple_of(GROUP);
        Self {
            faces: vec![FaceBlocks([Mat3A::ZERO; 6]); room(elements.faces.count())],
            hinges: vec![[Vec3A::ZERO; 4]; room(elements.hinges.count())],
        }
    }

    fn take(&mut self, threads: Threads, elements: &Elements, scale: f64) {
        let ninth = elements.time_step() * scale / 9.0;
        let (faces, _) = self.faces.as_chunks_mut();
        threads.each(faces, |group, faces| {
            elements.faces.blocks(group, scale, ninth, faces);
        });
        let (hinges, _) = self.hinges.as_chunks_mut();
        threads.each(hinges, |group, hinges| {
            elements.hinges.roots(group, scale, hinges);
        });
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
