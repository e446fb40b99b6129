//! Pairs of features that could touch.

use glam::DVec3;

/// Kind of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A vertex and a face: the first of four corners, and the other three.
    VertexFace,
    /// Two edges: the first two of four corners, and the last two.
    EdgeEdge,
}

/// Two features without a common vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pair {
    /// Kind of the pair.
    pub kind: Kind,
    /// Number of the vertex, or of the first edge.
    pub first: u32,
    /// Number of the face, or of the second edge.
    pub second: u32,
    /// Points of both features.
    pub corners: [u32; 4],
}

impl Kind {
    /// Number of corners of the first feature.
    #[inline]
    pub fn split(self) -> usize {
        match self {
            Self::VertexFace => 1,
            Self::EdgeEdge => 2,
        }
    }
}

impl Pair {
    /// The pair of a vertex and a face.
    pub fn vertex_face(vertex: u32, face: u32, corners: [u32; 4]) -> Self {
        Self {
            kind: Kind::VertexFace,
            first: vertex,
            second: face,
            corners,
        }
    }

    /// The pair of two edges.
    pub fn edge_edge(first: u32, second: u32, corners: [u32; 4]) -> Self {
        Self {
            kind: Kind::EdgeEdge,
            first,
            second,
            corners,
        }
    }

    /// Places of the corners among `points`.
    #[inline]
    pub fn places(&self, points: &[DVec3]) -> [DVec3; 4] {
        let [a, b, c, d] = self.corners;
        [
            points[a as usize],
            points[b as usize],
            points[c as usize],
            points[d as usize],
        ]
    }
}
