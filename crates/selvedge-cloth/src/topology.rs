//! Connectivity of the triangles of a cloth: edges with both faces and both opposite vertices,
//! arcs (an edge in one direction) sorted by receiver, the boundary.
//!
//! Everything is checked once, in [`Topology::new`]; what holds a `Topology` needs no checks of
//! its own. Several separate sheets in one topology are allowed, a vertex shared by two fans too.

use std::collections::HashMap;

use serde::Serialize;
use thiserror::Error;

use crate::{EdgeId, FaceId, VertexId};

/// Most vertices, and most faces: the arcs (up to 6 per face) and the 3 unknowns per vertex of a
/// solve must be numbered by a u32 as well.
const LARGEST: usize = u32::MAX as usize / 6;

/// An undirected edge. `vertices[0]` → `vertices[1]` runs counter-clockwise in `faces[0]`, and
/// clockwise in the second face where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The two ends.
    pub vertices: [VertexId; 2],
    /// The face to the left of `vertices[0]` → `vertices[1]`, and the one to the right if any.
    pub faces: (FaceId, Option<FaceId>),
    /// The third vertex of each of these faces.
    pub opposite: (VertexId, Option<VertexId>),
}

impl Edge {
    /// Returns true when only one face has this edge.
    pub fn is_boundary(&self) -> bool {
        self.faces.1.is_none()
    }
}

/// One direction of an edge in the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arc {
    /// The vertex that sends the message.
    pub sender: VertexId,
    /// The vertex that receives the message.
    pub receiver: VertexId,
    /// The undirected edge.
    pub edge: EdgeId,
}

/// The connectivity of a triangle mesh, valid by construction.
///
/// Edges are numbered by their (smaller, larger) vertex, so that their order does not depend on
/// the order of the faces. Arcs, two per edge, are sorted by (receiver, sender).
///
/// Serialised are the vertices and the faces, from which all else comes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Topology {
    vertex_count: usize,
    faces: Vec<[VertexId; 3]>,
    #[serde(skip)]
    edges: Vec<Edge>,
    #[serde(skip)]
    face_edges: Vec<[EdgeId; 3]>,
    #[serde(skip)]
    arcs: Vec<Arc>,
    #[serde(skip)]
    first_arc: Vec<u32>,
}

/// A list of triangles that is not a cloth.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TopologyError {
    #[error("{0}")]
    Unusable(String),
    #[error("faces {first} and {second} have the same three vertices: remove one of them")]
    DuplicateFace { first: FaceId, second: FaceId },
    #[error(
        "edge {}-{} is shared by more than two faces ({faces:?}): the mesh is not manifold there",
        vertices[0], vertices[1]
    )]
    NonManifoldEdge {
        vertices: [VertexId; 2],
        faces: Vec<u32>,
    },
    #[error(
        "faces {first} and {second} run through edge {}-{} in the same direction: flip one of them, so that all faces are counter-clockwise",
        vertices[0], vertices[1]
    )]
    InconsistentOrientation {
        vertices: [VertexId; 2],
        first: FaceId,
        second: FaceId,
    },
}

impl Topology {
    /// Builds and checks the connectivity of `faces` (`[faces, 3]`, counter-clockwise) over
    /// `vertex_count` vertices.
    ///
    /// # Errors
    /// Each defect of a mesh is an error of its own, with the first offending numbers.
    pub fn new(vertex_count: usize, faces: &[[u32; 3]]) -> Result<Self, TopologyError> {
        if faces.is_empty() {
            return unusable("the mesh has no faces: a cloth needs at least one triangle");
        }
        check_size("vertices", vertex_count)?;
        check_size("faces", faces.len())?;
        check_faces(vertex_count, faces)?;
        check_isolated(vertex_count, faces)?;
        let faces: Vec<[VertexId; 3]> = faces.iter().map(|f| f.map(VertexId)).collect();
        let edges = collect_edges(&faces)?;
        let face_edges = edges_of_faces(&faces, &edges);
        let (arcs, first_arc) = collect_arcs(vertex_count, &edges);
        Ok(Self {
            vertex_count,
            faces,
            edges,
            face_edges,
            arcs,
            first_arc,
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// The triangles, counter-clockwise, `[faces, 3]`.
    pub fn faces(&self) -> &[[VertexId; 3]] {
        &self.faces
    }

    /// The undirected edges, sorted by (smaller, larger) vertex, `[edges]`.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The edges of each face: `[f][k]` joins corners `k` and `k + 1`, `[faces, 3]`.
    pub fn face_edges(&self) -> &[[EdgeId; 3]] {
        &self.face_edges
    }

    /// Both directions of every edge, sorted by (receiver, sender), `[2 edges]`.
    pub fn arcs(&self) -> &[Arc] {
        &self.arcs
    }

    /// The range of [`Self::arcs`] that arrive at `vertex`.
    pub fn arcs_into(&self, vertex: VertexId) -> std::ops::Range<usize> {
        let v = vertex.index();
        self.first_arc[v] as usize..self.first_arc[v + 1] as usize
    }

    /// Marks the vertices on the boundary, `[vertices]`.
    pub fn boundary_vertices(&self) -> Vec<bool> {
        let mut boundary = vec![false; self.vertex_count];
        for edge in self.edges.iter().filter(|edge| edge.is_boundary()) {
            for vertex in edge.vertices {
                boundary[vertex.index()] = true;
            }
        }
        boundary
    }

    /// The number of each vertex's sheet, `[vertices]`: connected pieces, counted from 0 in the
    /// order of their smallest vertices.
    pub fn sheets(&self) -> Vec<u32> {
        pieces(self.vertex_count, |vertex| {
            let arcs = self.arcs[self.arcs_into(VertexId(vertex as u32))].iter();
            arcs.map(|arc| arc.sender.index())
        })
    }

    /// The faces as plain numbers, `[faces, 3]`, as files want them.
    pub fn face_indices(&self) -> Vec<[u32; 3]> {
        self.faces.iter().map(|face| face.map(|v| v.0)).collect()
    }
}

/// The number of the connected piece of each of `count` things, counted from 0 in the order of their
/// first ones.
pub(crate) fn pieces<N: Iterator<Item = usize>>(
    count: usize,
    neighbours: impl Fn(usize) -> N,
) -> Vec<u32> {
    let mut pieces: Vec<Option<u32>> = vec![None; count];
    let mut found = 0;
    for first in 0..count {
        if pieces[first].is_some() {
            continue;
        }
        pieces[first] = Some(found);
        let mut open = vec![first];
        while let Some(one) = open.pop() {
            for next in neighbours(one) {
                if pieces[next].replace(found).is_none() {
                    open.push(next);
                }
            }
        }
        found += 1;
    }
    pieces.into_iter().flatten().collect()
}

fn unusable<T>(problem: impl Into<String>) -> Result<T, TopologyError> {
    Err(TopologyError::Unusable(problem.into()))
}

fn check_size(what: &str, count: usize) -> Result<(), TopologyError> {
    if count > LARGEST {
        return unusable(format!(
            "the mesh has {count} {what}, more than the {LARGEST} that indices allow"
        ));
    }
    Ok(())
}

fn check_faces(vertex_count: usize, faces: &[[u32; 3]]) -> Result<(), TopologyError> {
    let mut seen: HashMap<[u32; 3], u32> = HashMap::with_capacity(faces.len());
    for (number, &corners) in faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertex_count) {
            return unusable(format!(
                "face {number} names vertex {vertex}, but the mesh has {vertex_count} vertices (0 to {})",
                vertex_count.saturating_sub(1)
            ));
        }
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            let vertex = if b == c { b } else { a };
            return unusable(format!(
                "face {number} names vertex {vertex} twice: remove the degenerate face"
            ));
        }
        let mut key = corners;
        key.sort_unstable();
        if let Some(first) = seen.insert(key, number as u32) {
            let [first, second] = [first, number as u32].map(FaceId);
            return Err(TopologyError::DuplicateFace { first, second });
        }
    }
    Ok(())
}

fn check_isolated(vertex_count: usize, faces: &[[u32; 3]]) -> Result<(), TopologyError> {
    let mut used = vec![false; vertex_count];
    for &vertex in faces.iter().flatten() {
        used[vertex as usize] = true;
    }
    let count = used.iter().filter(|&&used| !used).count();
    match used.iter().position(|&used| !used) {
        Some(vertex) => unusable(format!(
            "vertex {vertex} belongs to no face (one of {count}): remove isolated vertices"
        )),
        None => Ok(()),
    }
}

/// A face's side: its direction through the edge, the face, the opposite vertex.
struct Side {
    key: [VertexId; 2],
    from: VertexId,
    face: FaceId,
    opposite: VertexId,
}

fn collect_edges(faces: &[[VertexId; 3]]) -> Result<Vec<Edge>, TopologyError> {
    let mut sides: Vec<Side> = Vec::with_capacity(3 * faces.len());
    for (number, face) in faces.iter().enumerate() {
        for corner in 0..3 {
            let (from, to) = (face[corner], face[(corner + 1) % 3]);
            sides.push(Side {
                key: [from.min(to), from.max(to)],
                from,
                face: FaceId(number as u32),
                opposite: face[(corner + 2) % 3],
            });
        }
    }
    sides.sort_by_key(|side| (side.key, side.face));
    sides
        .chunk_by(|a, b| a.key == b.key)
        .map(edge_of_sides)
        .collect()
}

fn edge_of_sides(sides: &[Side]) -> Result<Edge, TopologyError> {
    let first = &sides[0];
    let to = first.key[usize::from(first.from == first.key[0])];
    let vertices = [first.from, to];
    match sides {
        [_] => Ok(Edge {
            vertices,
            faces: (first.face, None),
            opposite: (first.opposite, None),
        }),
        [_, second] if second.from == first.from => Err(TopologyError::InconsistentOrientation {
            vertices,
            first: first.face,
            second: second.face,
        }),
        [_, second] => Ok(Edge {
            vertices,
            faces: (first.face, Some(second.face)),
            opposite: (first.opposite, Some(second.opposite)),
        }),
        _ => Err(TopologyError::NonManifoldEdge {
            vertices: first.key,
            faces: sides.iter().map(|side| side.face.0).collect(),
        }),
    }
}

fn edges_of_faces(faces: &[[VertexId; 3]], edges: &[Edge]) -> Vec<[EdgeId; 3]> {
    let mut of_face = vec![[EdgeId(u32::MAX); 3]; faces.len()];
    for (number, edge) in edges.iter().enumerate() {
        let incident = [Some(edge.faces.0), edge.faces.1];
        let start = edge.vertices;
        for (face, from) in incident.into_iter().zip(start) {
            let Some(face) = face else { continue };
            for corner in 0..3 {
                if faces[face.index()][corner] == from {
                    of_face[face.index()][corner] = EdgeId(number as u32);
                }
            }
        }
    }
    of_face
}

fn collect_arcs(vertex_count: usize, edges: &[Edge]) -> (Vec<Arc>, Vec<u32>) {
    let mut arcs: Vec<Arc> = Vec::with_capacity(2 * edges.len());
    for (number, edge) in edges.iter().enumerate() {
        let [a, b] = edge.vertices;
        let edge = EdgeId(number as u32);
        for (sender, receiver) in [(a, b), (b, a)] {
            arcs.push(Arc {
                sender,
                receiver,
                edge,
            });
        }
    }
    arcs.sort_by_key(|arc| (arc.receiver, arc.sender));
    let mut first_arc = vec![0_u32; vertex_count + 1];
    for arc in &arcs {
        first_arc[arc.receiver.index() + 1] += 1;
    }
    for v in 0..vertex_count {
        first_arc[v + 1] += first_arc[v];
    }
    (arcs, first_arc)
}

#[cfg(test)]
mod tests;
