//! The bodies beside a cloth, in a matte grey that no cloth has.
//!
//! A face that turns away from the mean direction at one of its corners by more than 45° is flat
//! there, so that a box has edges and a sphere none. Large faces are cut into smaller ones, because
//! a triangle that reaches behind the camera is left out.

use glam::{Vec2, Vec3};

use super::camera::Camera;
use super::samples::Samples;
use super::shade::{Point, Shader};
use super::sun::Sun;
use super::triangle::{ScreenVertex, Triangle};
use crate::motion::body::Body;

/// Cosine of the largest angle between a face and the mean direction at its corner.
const SMOOTH: f32 = 0.707;
/// Times that a face is halved at most.
const CUTS: u32 = 10;

/// The bodies of one frame; kept between frames to keep the memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Props {
    /// Corners of all faces `[m]`.
    pub(crate) faces: Vec<[Vec3; 3]>,
    /// Unit normals of the corners.
    normals: Vec<[Vec3; 3]>,
    sums: Vec<Vec3>,
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
            self.sums.clear();
            self.sums.resize(points.len(), Vec3::ZERO);
            let area = |face: &[u32; 3]| {
                let [a, b, c] = face.map(|p| points[p as usize]);
                (b - a).cross(c - a)
            };
            for face in body.faces() {
                for &corner in face {
                    self.sums[corner as usize] += area(face);
                }
            }
            for face in body.faces() {
                let flat = area(face).normalize_or_zero();
                let normals = face.map(|corner| {
                    let mean = self.sums[corner as usize].normalize_or_zero();
                    if mean.dot(flat) < SMOOTH { flat } else { mean }
                });
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
        let [a, b, c] = [side, (side + 1) % 3, (side + 2) % 3];
        let middle = 0.5 * (corners[a] + corners[b]);
        let normal = (normals[a] + normals[b]).normalize_or_zero();
        let halves = [
            (
                [corners[a], middle, corners[c]],
                [normals[a], normal, normals[c]],
            ),
            (
                [middle, corners[b], corners[c]],
                [normal, normals[b], normals[c]],
            ),
        ];
        for (corners, normals) in halves {
            self.add(corners, normals, longest, cuts - 1);
        }
    }

    /// Places the faces on a screen of `extent` samples, with the light of `sun`.
    pub(crate) fn place(&mut self, camera: &Camera, sun: &Sun, extent: [usize; 2]) {
        self.placed.clear();
        for (corners, normals) in self.faces.iter().zip(&self.normals) {
            self.placed.push(std::array::from_fn(|k| {
                ScreenVertex::new(camera, extent, corners[k], normals[k], sun.open(corners[k]))
            }));
        }
    }

    /// Places of the corners in front of the camera `[samples]`.
    pub(crate) fn places(&self) -> impl Iterator<Item = Vec2> + '_ {
        let corners = self.placed.iter().flatten();
        corners.filter(|c| c.nearness > 0.0).map(|c| c.place)
    }

    /// Fills the faces.
    pub(crate) fn fill(&self, samples: &mut Samples, shader: &Shader) {
        for corners in &self.placed {
            let Some(triangle) = Triangle::new(*corners) else {
                continue;
            };
            samples.fill(&triangle, |weights, _| {
                let Point { normal, sun, .. } = triangle.point_at(weights);
                shader.body(normal, sun)
            });
        }
    }
}
