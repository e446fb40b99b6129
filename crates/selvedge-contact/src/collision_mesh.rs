//! All bodies as one mesh: the points, faces and edges of the cloth, then those of each
//! obstacle.
//!
//! A round body stands there as its core: one face without area, whose corners are the point of a sphere
//! or the ends of a capsule, and which has the radius around it. Gaps of its pairs are those of the core
//! less the radius.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;
use selvedge_cloth::{Obstacle, Topology};

use crate::pair::Pair;

/// The connectivity of a cloth and its obstacles.
#[derive(Clone, Debug)]
pub struct CollisionMesh {
    faces: Vec<[u32; 3]>,
    edges: Vec<CollisionEdge>,
    bodies: Vec<Body>,
    /// First point of the connected part of each point.
    parts: Vec<u32>,
    /// Radius around each point `[m]`, 0 but of round bodies.
    radii: Vec<f64>,
    /// Vertices and edges that each face stands for; [`NONE`] where it does not.
    shares: Vec<Share>,
}

pub(crate) const NONE: u32 = u32::MAX;

/// Features that a face stands for in the search for pairs. Every vertex and edge of a face has one
/// face that stands for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    pub(crate) vertices: [u32; 3],
    pub(crate) edges: [u32; 3],
}

/// An edge of the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollisionEdge {
    /// Both ends.
    pub ends: [u32; 2],
    /// Third corners of its first two faces; the second is none at a boundary.
    pub wings: [Option<u32>; 2],
}

/// The cloth, or an obstacle, as part of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    /// Its points.
    pub points: Range<u32>,
    /// Its faces.
    pub faces: Range<u32>,
    /// Its edges.
    pub edges: Range<u32>,
}

impl CollisionMesh {
    /// The mesh of a cloth and `obstacles`. Body 0 is the cloth.
    pub fn new(cloth: &Topology, obstacles: &[Obstacle]) -> Self {
        let mut mesh = Self {
            faces: Vec::new(),
            edges: Vec::new(),
            bodies: Vec::new(),
            parts: Vec::new(),
            radii: Vec::new(),
            shares: Vec::new(),
        };
        mesh.push(cloth.vertex_count(), &cloth.face_indices());
        for obstacle in obstacles {
            mesh.radii.resize(mesh.parts.len(), 0.0);
            match obstacle.core() {
                None => mesh.push(obstacle.point_count(), obstacle.faces()),
                Some(core) => {
                    let points = core.point_count();
                    let last = points as u32 - 1;
                    mesh.push(points, &[[0, last, last]]);
                    mesh.radii.resize(mesh.parts.len(), core.radius);
                }
            }
        }
        mesh.radii.resize(mesh.parts.len(), 0.0);
        mesh
    }

    /// The points of an obstacle of a mesh at `time` `[s]`, `[m]`: those of its mesh, or its core.
    pub fn places_of(obstacle: &Obstacle, time: f64) -> impl Iterator<Item = DVec3> {
        let core = obstacle.core_at(time);
        let of_core = core.map(|core| core.ends.into_iter().take(core.point_count()));
        let of_mesh = core.is_none().then(|| obstacle.positions_at(time));
        let of_core = of_core.into_iter().flatten();
        of_core.chain(of_mesh.into_iter().flatten())
    }

    fn push(&mut self, points: usize, faces: &[[u32; 3]]) {
        let (first, first_face) = (self.parts.len() as u32, self.faces.len() as u32);
        let (last, first_edge) = (first + points as u32, self.edges.len() as u32);
        let moved = faces.iter().map(|face| face.map(|p| p + first));
        self.faces.extend(moved);
        self.join(first..last, first_face as usize);
        let mut numbers = BTreeMap::new();
        for face in &self.faces[first_face as usize..] {
            for k in (0..3).filter(|k| has_side(*face, *k)) {
                numbers.insert(side(*face, k), NONE);
            }
        }
        for (number, (ends, slot)) in numbers.iter_mut().enumerate() {
            *slot = first_edge + number as u32;
            self.edges.push(CollisionEdge {
                ends: *ends,
                wings: [None; 2],
            });
        }
        let mut has_vertex = vec![false; points];
        let mut has_edge = vec![false; numbers.len()];
        for face in &self.faces[first_face as usize..] {
            let mut share = Share {
                vertices: [NONE; 3],
                edges: [NONE; 3],
            };
            for k in 0..3 {
                let taken = &mut has_vertex[(face[k] - first) as usize];
                if !std::mem::replace(taken, true) {
                    share.vertices[k] = face[k];
                }
                if !has_side(*face, k) {
                    continue;
                }
                let edge = numbers[&side(*face, k)];
                let taken = &mut has_edge[(edge - first_edge) as usize];
                if !std::mem::replace(taken, true) {
                    share.edges[k] = edge;
                }
                let wings = &mut self.edges[edge as usize].wings;
                let third = face[(k + 2) % 3];
                if third != face[k]
                    && third != face[(k + 1) % 3]
                    && let Some(wing) = wings.iter_mut().find(|wing| wing.is_none())
                {
                    *wing = Some(third);
                }
            }
            self.shares.push(share);
        }
        self.bodies.push(Body {
            points: first..last,
            faces: first_face..self.faces.len() as u32,
            edges: first_edge..self.edges.len() as u32,
        });
    }

    /// Finds the connected parts of these `points`, and of the faces from this one on.
    fn join(&mut self, points: Range<u32>, first_face: usize) {
        fn root(parts: &mut [u32], mut p: u32) -> u32 {
            while parts[p as usize] != p {
                parts[p as usize] = parts[parts[p as usize] as usize];
                p = parts[p as usize];
            }
            p
        }
        self.parts.extend(points.clone());
        for [a, b, c] in &self.faces[first_face..] {
            for other in [b, c] {
                let two = [root(&mut self.parts, *a), root(&mut self.parts, *other)];
                self.parts[two[0].max(two[1]) as usize] = two[0].min(two[1]);
            }
        }
        for p in points {
            self.parts[p as usize] = root(&mut self.parts, p);
        }
    }

    /// Number of the connected part of its body to which `point` belongs.
    pub fn part_of(&self, point: u32) -> u32 {
        self.parts[point as usize]
    }

    /// Corners of every face.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Every edge.
    pub fn edges(&self) -> &[CollisionEdge] {
        &self.edges
    }

    /// The cloth, then each obstacle.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Number of the body to which `point` belongs; 0 is the cloth.
    pub fn body_of(&self, point: u32) -> usize {
        self.bodies
            .partition_point(|body| body.points.end <= point)
            .min(self.bodies.len() - 1)
    }

    /// Radius around each point `[m]`, `[points]`: 0 but of round bodies.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Radius of the round body of a pair `[m]`: its gap is that of its features less this. 0 without one.
    #[inline]
    pub fn radius_of(&self, pair: &Pair) -> f64 {
        let radius = |k: usize| self.radii[pair.corners[k] as usize];
        radius(0).max(radius(3))
    }

    #[inline]
    pub(crate) fn share(&self, face: u32) -> &Share {
        &self.shares[face as usize]
    }
}

/// Returns true if two corners are the ends of a side: not so of a face that is a line or a point.
fn has_side(face: [u32; 3], k: usize) -> bool {
    face[k] != face[(k + 1) % 3]
}

/// The side of a face from corner `k` on, smaller end first.
fn side(face: [u32; 3], k: usize) -> [u32; 2] {
    let (a, b) = (face[k], face[(k + 1) % 3]);
    [a.min(b), a.max(b)]
}
