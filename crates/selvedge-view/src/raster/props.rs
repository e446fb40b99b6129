//! The bodies beside a cloth, in a matte grey that no cloth has.
//!
//! A face is smooth with those around its corner that it meets at a small angle, so that a box and
//! the rim of a cylinder have edges and a sphere none. Points at one place are one: readers of
//! meshes part them at seams of a texture. Large faces are cut into smaller ones, because a triangle
//! that reaches behind the camera is left out.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::camera::Camera;
use super::samples::Samples;
use super::shade::Shader;
use super::sun::Sun;
use super::triangle::{ScreenVertex, Triangle};
use crate::motion::body::Body;

/// Cosine of the largest angle between two faces that are smooth: 50°.
const SMOOTH: f32 = 0.643;
/// A body is drawn farther away by a thousandth: at a horizon, cloth that is rounder than its mesh
/// may lie a trace within the body that it covers.
const BEHIND: f32 = 0.999;
/// Times that a face is halved at most.
const CUTS: u32 = 10;

/// Twice the area of a face, along its normal `[m²]`.
fn area(face: &[u32; 3], points: &[Vec3]) -> Vec3 {
    let [a, b, c] = face.map(|p| points[p as usize]);
    (b - a).cross(c - a)
}

/// The place of a point, to find the others there.
fn key(points: &[Vec3], corner: u32) -> [u32; 3] {
    // Minus zero is zero.
    let point = points[corner as usize].to_array();
    point.map(|x| (x + 0.0).to_bits())
}

/// The faces around each place.
fn faces_around(faces: &[[u32; 3]], points: &[Vec3]) -> HashMap<[u32; 3], Vec<u32>> {
    let mut around: HashMap<_, Vec<u32>> = HashMap::with_capacity(points.len());
    for (number, face) in faces.iter().enumerate() {
        for &corner in face {
            let here = around.entry(key(points, corner)).or_default();
            here.push(number as u32);
        }
    }
    around
}

/// The unit normal at a corner of a face: the mean of the faces `around` it that it is smooth with.
fn smooth_normal(own: Vec3, around: &[u32], areas: &[Vec3]) -> Vec3 {
    let flat = own.normalize_or_zero();
    let areas = around.iter().map(|&face| areas[face as usize]);
    let smooth = areas.filter(|area| area.dot(flat) >= SMOOTH * area.length());
    smooth.sum::<Vec3>().normalize_or(flat)
}

/// The bodies of one frame; kept between frames to keep the memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Props {
    /// Corners of all faces `[m]`.
    pub(crate) faces: Vec<[Vec3; 3]>,
    /// Unit normals of the corners.
    normals: Vec<[Vec3; 3]>,
    /// Corners on the screen.
    placed: Vec<[ScreenVertex; 3]>,
}

impl Props {
    /// Takes the faces of `bodies` in a frame, cut until no edge is longer than `longest` `[m]`.
    pub(crate) fn update<'b>(
        &mut self,
        bodies: impl Iterator<Item = &'b Body<'b>>,
        frame: usize,
        longest: f32,
    ) {
        self.faces.clear();
        self.normals.clear();
        for body in bodies {
            let points = body.points(frame);
            let areas: Vec<Vec3> = body.faces().iter().map(|face| area(face, points)).collect();
            let around = faces_around(body.faces(), points);
            for (face, &own) in body.faces().iter().zip(&areas) {
                let normals =
                    face.map(|corner| smooth_normal(own, &around[&key(points, corner)], &areas));
                let corners = face.map(|corner| points[corner as usize]);
                self.add(corners, normals, longest, CUTS);
            }
        }
    }

    /// Adds a face, or its halves.
    fn add(&mut self, corners: [Vec3; 3], normals: [Vec3; 3], longest: f32, cuts: u32) {
        let length = |k: usize| corners[k].distance(corners[(k + 1) % 3]);
        let side = (1..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
        if cuts == 0 || length(side) <= longest {
            self.faces.push(corners);
            self.normals.push(normals);
            return;
        }
        let [a, b] = [side, (side + 1) % 3];
        let middle = 0.5 * (corners[a] + corners[b]);
        let normal = (normals[a] + normals[b]).normalize_or_zero();
        // Each half has the middle in place of the corner at the other end.
        for end in [b, a] {
            let (mut corners, mut normals) = (corners, normals);
            (corners[end], normals[end]) = (middle, normal);
            self.add(corners, normals, longest, cuts - 1);
        }
    }

    /// Places the faces on a screen of `extent` samples.
    pub(crate) fn place(&mut self, camera: &Camera, sun: &Sun, extent: [usize; 2]) {
        self.placed.clear();
        for (corners, normals) in self.faces.iter().zip(&self.normals) {
            self.placed.push(std::array::from_fn(|k| {
                let (corner, lit) = (corners[k], sun.place(corners[k]));
                let mut vertex = ScreenVertex::new(camera, extent, corner, normals[k], lit);
                vertex.nearness *= BEHIND;
                vertex
            }));
        }
    }

    /// Places of the corners in front of the camera `[samples]`.
    pub(crate) fn places(&self) -> impl Iterator<Item = Vec2> + '_ {
        let corners = self.placed.iter().flatten();
        corners.filter(|c| c.nearness > 0.0).map(|c| c.place)
    }

    /// Fills the faces, in the light of `sun`.
    pub(crate) fn fill(&self, samples: &mut Samples, shader: &Shader, sun: &Sun) {
        for corners in &self.placed {
            let Some(triangle) = Triangle::new(*corners) else {
                continue;
            };
            samples.fill(&triangle, |weights, nearness| {
                shader.body(triangle.point_at(weights, nearness, sun))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::borrow::Cow;

    /// A closed cylinder of 12 sides around y, whose caps are fans around their first points.
    #[test]
    fn the_rim_of_a_cylinder_is_sharp_and_its_side_smooth() {
        let at = |k: u32, y: f32| {
            let angle = k as f32 * std::f32::consts::TAU / 12.0;
            Vec3::new(angle.cos(), y, angle.sin())
        };
        let points: Vec<Vec3> = [0.0, 1.0]
            .into_iter()
            .flat_map(|y| (0..12).map(move |k| at(k, y)))
            .collect();
        let mut faces = Vec::new();
        for k in 0..12 {
            let next = (k + 1) % 12;
            faces.extend([[k, k + 12, next], [next, k + 12, next + 12]]);
        }
        for k in 1..11 {
            faces.extend([[12, k + 13, k + 12], [0, k, k + 1]]);
        }
        let mut props = Props::default();
        let body = Body::new(&faces, [Cow::Borrowed(points.as_slice())]);
        props.update(std::iter::once(&body), 0, 9.0);
        for (corners, normals) in props.faces.iter().zip(&props.normals) {
            let cap = corners.iter().all(|c| c.y == corners[0].y);
            for (corner, normal) in corners.iter().zip(normals) {
                let expected = if cap {
                    Vec3::Y * (2.0 * corner.y - 1.0)
                } else {
                    Vec3::new(corner.x, 0.0, corner.z)
                };
                // The diagonals of the side weigh its two faces unevenly: a third of 30°.
                assert!(normal.dot(expected) > 0.98, "{corner} {normal} {expected}");
            }
        }
    }
}
