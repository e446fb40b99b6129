//! The pattern of a cloth: its flat pieces, as they lay before they were sewn.
//!
//! A pattern has points in its plane, and each face has three of them: the face's rest shape.
//! Vertices are shared in space; where pieces are sewn together, a vertex has several points. Of a
//! sheet without seams point v is vertex v. A seam is an edge between two faces that see its ends
//! at different points, and a panel is what hangs together without crossing a seam.
//!
//! Points are numbered so that every vertex knows one: point v is that of vertex v in the first
//! face that has it; the others follow in the order of the faces.

use glam::{DVec2, Vec2};
use serde::Serialize;

use crate::error::SceneError;
use crate::geometry::signed_area_2d;
use crate::topology::pieces;
use crate::{Edge, FaceId, Topology, VertexId};

/// A point of the plane in one of the two precisions.
pub trait PatternPoint: Copy + PartialEq {
    /// The point in `f64` `[m]`.
    fn wide(self) -> DVec2;
}

impl PatternPoint for DVec2 {
    fn wide(self) -> DVec2 {
        self
    }
}

impl PatternPoint for Vec2 {
    fn wide(self) -> DVec2 {
        self.as_dvec2()
    }
}

/// The pattern of a cloth, borrowed from it.
#[derive(Clone, Copy, Debug)]
pub struct Pattern<'a, P> {
    topology: &'a Topology,
    points: &'a [P],
    corners: Option<&'a [[u32; 3]]>,
}

/// Points and faces of a pattern, numbered as this module says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NumberedPattern<P> {
    /// The points `[m]`, `[points]`.
    pub points: Vec<P>,
    /// Points of each face's corners, `[faces, 3]`; none where no vertex has more than one.
    pub corners: Option<Vec<[u32; 3]>>,
}

impl<P: PatternPoint> NumberedPattern<P> {
    /// Numbers the points of faces with these coordinates at their `corners`, `[faces, 3]`.
    /// Corners of a vertex with equal coordinates are one point.
    pub fn new(topology: &Topology, corners: &[[P; 3]]) -> Self {
        let count = topology.vertex_count();
        let mut first: Vec<Option<P>> = vec![None; count];
        let mut further: Vec<Vec<(P, u32)>> = vec![Vec::new(); count];
        for (face, places) in topology.faces().iter().zip(corners) {
            for (vertex, place) in face.iter().zip(places) {
                first[vertex.index()].get_or_insert(*place);
            }
        }
        // Every vertex of a topology has a face.
        let mut points: Vec<P> = first.iter().filter_map(|place| *place).collect();
        let mut numbers = Vec::with_capacity(corners.len());
        for (face, places) in topology.faces().iter().zip(corners) {
            numbers.push(std::array::from_fn(|corner| {
                let (vertex, place) = (face[corner].index(), places[corner]);
                if points[vertex] == place {
                    return vertex as u32;
                }
                if let Some((_, number)) = further[vertex].iter().find(|(p, _)| *p == place) {
                    return *number;
                }
                let number = points.len() as u32;
                points.push(place);
                further[vertex].push((place, number));
                number
            }));
        }
        let corners = (points.len() > count).then_some(numbers);
        Self { points, corners }
    }
}

/// The texture coordinates of a cloth, for those who draw it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub enum Texture {
    /// The points of its pattern.
    #[default]
    Pattern,
    /// None: it has no pattern but the form of each face.
    None,
    /// Those of its file, where the pattern is another.
    Own(NumberedPattern<Vec2>),
}

/// Checks faces over `points` points of a pattern, `[faces, 3]`, against the topology.
///
/// # Errors
/// [`SceneError`] names the first face or point that does not fit.
pub(crate) fn check_corners(
    topology: &Topology,
    points: usize,
    corners: &[[u32; 3]],
) -> Result<(), SceneError> {
    let (expected, found) = (topology.faces().len(), corners.len());
    if expected != found {
        let text = format!("the pattern has {found} faces, the cloth {expected}");
        return Err(SceneError(text));
    }
    let mut owners: Vec<Option<VertexId>> = vec![None; points];
    for (face, (corners, named)) in topology.faces().iter().zip(corners).enumerate() {
        for (&vertex, &point) in corners.iter().zip(named) {
            let Some(owner) = owners.get_mut(point as usize) else {
                return Err(SceneError(format!(
                    "face {face} names point {point} of the pattern, which has {points} points"
                )));
            };
            let first = *owner.get_or_insert(vertex);
            if first != vertex {
                return Err(SceneError(format!(
                    "point {point} of the pattern belongs to vertices {first} and {vertex}: every point must have one vertex"
                )));
            }
        }
    }
    for (point, owner) in owners.iter().enumerate() {
        let what = match owner {
            None => "belongs to no face: remove it".to_owned(),
            Some(owner) if point < topology.vertex_count() && owner.index() != point => {
                format!("must belong to vertex {point}")
            }
            Some(_) => continue,
        };
        return Err(SceneError(format!("point {point} of the pattern {what}")));
    }
    Ok(())
}

/// One side of an edge: a face, and what its pattern shape has there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeSide<P> {
    /// The face.
    pub face: FaceId,
    /// The edge's ends in the face's pattern, in the order of [`Edge::vertices`] `[m]`.
    pub ends: [P; 2],
    /// The third corner of the face `[m]`.
    pub opposite: P,
}

impl<P: PatternPoint> EdgeSide<P> {
    /// Length of the edge in this face's pattern `[m]`.
    pub fn length(&self) -> f64 {
        let [a, b] = self.ends.map(P::wide);
        a.distance(b)
    }

    /// Area of the face in its pattern `[m²]`.
    pub fn area(&self) -> f64 {
        let [a, b] = self.ends.map(P::wide);
        signed_area_2d(a, b, self.opposite.wide()).abs()
    }
}

impl<'a, P: PatternPoint> Pattern<'a, P> {
    /// The pattern of `topology` with these points; without `corners`, point v is vertex v.
    pub(crate) fn new(
        topology: &'a Topology,
        points: &'a [P],
        corners: Option<&'a [[u32; 3]]>,
    ) -> Self {
        Self {
            topology,
            points,
            corners,
        }
    }

    /// The points `[m]`, `[points]`.
    pub fn points(&self) -> &'a [P] {
        self.points
    }

    /// Returns true when a vertex has more than one point.
    pub fn is_sewn(&self) -> bool {
        self.corners.is_some()
    }

    /// Points of the corners of each face, `[faces, 3]`.
    pub fn corners(&self) -> Vec<[u32; 3]> {
        match self.corners {
            Some(corners) => corners.to_vec(),
            None => self.topology.face_indices(),
        }
    }

    /// Points of the corners of a face.
    pub fn corner_points(&self, face: FaceId) -> [u32; 3] {
        match self.corners {
            Some(corners) => corners[face.index()],
            None => self.topology.faces()[face.index()].map(|v| v.0),
        }
    }

    /// Rest shape of a face: its corners in the pattern `[m]`.
    pub fn face(&self, face: FaceId) -> [P; 3] {
        self.corner_points(face)
            .map(|point| self.points[point as usize])
    }

    /// Rest shapes of all faces `[m]`, `[faces, 3]`.
    pub fn faces(self) -> impl Iterator<Item = [P; 3]> + 'a {
        (0..self.topology.faces().len() as u32).map(move |face| self.face(FaceId(face)))
    }

    /// Vertex of each point, `[points]`.
    pub fn vertices(&self) -> Vec<u32> {
        let mut vertices: Vec<u32> = (0..self.points.len() as u32).collect();
        let faces = self.topology.faces().iter();
        for (face, corners) in faces.zip(self.corners.unwrap_or_default()) {
            for (vertex, &point) in face.iter().zip(corners) {
                vertices[point as usize] = vertex.0;
            }
        }
        vertices
    }

    /// The edge as its two faces have it; of a boundary edge only the first.
    pub fn sides(&self, edge: &Edge) -> (EdgeSide<P>, Option<EdgeSide<P>>) {
        let side = |face: FaceId| {
            let vertices = self.topology.faces()[face.index()];
            let places = self.face(face);
            let place = |vertex: VertexId| {
                let corner = vertices.iter().position(|v| *v == vertex);
                places[corner.unwrap_or_default()]
            };
            let opposite = if face == edge.faces.0 {
                edge.opposite.0
            } else {
                edge.opposite.1.unwrap_or(edge.opposite.0)
            };
            EdgeSide {
                face,
                ends: edge.vertices.map(place),
                opposite: place(opposite),
            }
        };
        (side(edge.faces.0), edge.faces.1.map(side))
    }

    /// Returns true when the edge's two faces see its ends at different points.
    pub fn is_seam(&self, edge: &Edge) -> bool {
        if self.corners.is_none() {
            return false;
        }
        let (left, right) = self.sides(edge);
        right.is_some_and(|right| right.ends != left.ends)
    }

    /// Length of each edge in the pattern `[m]`, `[edges]`; at a seam the mean of its two sides,
    /// which may differ where one is eased into the other. `[eq:seam-length]`
    pub fn edge_lengths(&self) -> Vec<f64> {
        let edges = self.topology.edges().iter();
        edges
            .map(|edge| {
                let (left, right) = self.sides(edge);
                right.map_or(left.length(), |right| {
                    0.5 * (left.length() + right.length())
                })
            })
            .collect()
    }

    /// Number of each face's panel, `[faces]`: pieces that hang together without a seam, counted
    /// from 0 in the order of their first faces.
    pub fn panels(&self) -> Vec<u32> {
        pieces(self.topology.faces().len(), |face| {
            let edges = self.topology.face_edges()[face].into_iter();
            let edges = edges.map(move |edge| &self.topology.edges()[edge.index()]);
            let inner = edges.filter(move |edge| !self.is_seam(edge));
            let faces = inner.flat_map(|edge| [Some(edge.faces.0), edge.faces.1]);
            faces.flatten().map(FaceId::index)
        })
    }
}

#[cfg(test)]
mod tests;
