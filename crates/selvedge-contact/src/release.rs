//! Contact that is released: vertices of the cloth that may pass a body, or a part of it.

use glam::DVec3;
use selvedge_cloth::ReleasedContact;
use selvedge_cloth::geometry::atan2;

use crate::collision_mesh::CollisionMesh;

/// Contact whose pairs are left out of a search.
#[derive(Clone, Debug, Default)]
pub struct Released {
    /// In ascending order of their vertices.
    list: Vec<ReleasedContact>,
    /// Places of all points when the scene begins `[m]`.
    first: Vec<DVec3>,
}

impl Released {
    /// Nothing yet, of points that begin here `[m]`.
    pub(crate) fn none(first: &[DVec3]) -> Self {
        Self {
            list: Vec::new(),
            first: first.to_vec(),
        }
    }

    /// Places of all points when the scene begins `[m]`, `[points]`.
    pub fn first(&self) -> &[DVec3] {
        &self.first
    }

    /// What is released, in ascending order of vertices.
    pub fn list(&self) -> &[ReleasedContact] {
        &self.list
    }

    pub(crate) fn take(&mut self, list: &[ReleasedContact]) {
        self.list.clear();
        self.list.extend_from_slice(list);
        self.list
            .sort_by_key(|one| (one.vertex, one.body, one.against));
    }

    /// Returns true if two features with these corners may pass each other.
    #[inline]
    pub fn frees(&self, mesh: &CollisionMesh, first: &[u32], second: &[u32]) -> bool {
        if self.list.is_empty() {
            return false;
        }
        let is_cloth = |feature: &[u32]| feature[0] < mesh.bodies()[0].points.end;
        let (cloth, other) = match (is_cloth(first), is_cloth(second)) {
            (true, false) => (first, second),
            (false, true) => (second, first),
            _ => return false,
        };
        let body = mesh.body_of(other[0]) as u32;
        cloth.iter().any(|vertex| {
            let from = self.list.partition_point(|one| one.vertex < *vertex);
            let own = self.list[from..].iter();
            own.take_while(|one| one.vertex == *vertex).any(|one| {
                one.body == body && other.iter().any(|p| self.frees_point(mesh, one, *p))
            })
        })
    }

    /// Returns true if this point of the body of `one` may be passed.
    pub fn frees_point(&self, mesh: &CollisionMesh, one: &ReleasedContact, point: u32) -> bool {
        let [own, other] = one
            .places
            .map(|p| p.distance_squared(self.first[point as usize]));
        one.against != one.body
            || mesh.part_of(point) == one.parts[0] && (one.parts[1] != one.parts[0] || own < other)
    }
}

/// Number of times that faces with these corners `[m]` wind around a `place` `[m]`: 0 outside of a
/// closed body and 1 or -1 within; across an open one it changes by 1.
pub fn winding(place: DVec3, faces: impl Iterator<Item = [DVec3; 3]>) -> f64 {
    let angles = faces.map(|face| {
        let [a, b, c] = face.map(|p| p - place);
        let lengths = [a, b, c].map(DVec3::length);
        let below = lengths[0] * lengths[1] * lengths[2]
            + a.dot(b) * lengths[2]
            + b.dot(c) * lengths[0]
            + c.dot(a) * lengths[1];
        atan2(a.dot(b.cross(c)), below)
    });
    angles.sum::<f64>() / std::f64::consts::TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use selvedge_cloth::{Obstacle, Topology, bodies};

    #[test]
    fn a_body_winds_once_around_what_is_within() {
        let ball = bodies::sphere(1.0, 0.4);
        let around = |p: DVec3| {
            let faces = ball.faces.iter();
            winding(p, faces.map(|f| f.map(|k| ball.points[k as usize])))
        };
        assert!((around(DVec3::X * 0.5).abs() - 1.0).abs() < 1e-9);
        assert!(around(DVec3::X * 1.5).abs() < 1e-9);
    }

    #[test]
    fn only_the_part_that_squeezes_is_passed() {
        let cloth = Topology::new(3, &[[0, 1, 2]]).unwrap();
        let limb = |z: f64| [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| p + DVec3::Z * z);
        let points = [limb(0.0), limb(1.0)].concat();
        let faces = vec![[0, 1, 2], [3, 4, 5]];
        let both = Obstacle::new("both", points.clone(), faces).unwrap();
        let other = Obstacle::new("other", limb(2.0).to_vec(), vec![[0, 1, 2]]).unwrap();
        let mesh = CollisionMesh::new(&cloth, &[both, other]);
        let first = [limb(0.5).to_vec(), points, limb(2.0).to_vec()].concat();
        let mut released = Released::none(&first);
        let mut one = ReleasedContact {
            vertex: 1,
            body: 1,
            against: 1,
            parts: [6, 3],
            places: [DVec3::Z, DVec3::ZERO],
            winding: 0.0,
        };
        let frees = |released: &Released, faces: [[u32; 3]; 2]| {
            let forth = released.frees(&mesh, &faces[0], &faces[1]);
            assert_eq!(forth, released.frees(&mesh, &faces[1], &faces[0]));
            forth
        };
        assert!(!frees(&released, [[0, 1, 2], [6, 7, 8]]));
        released.take(&[one]);
        assert!(frees(&released, [[0, 1, 2], [6, 7, 8]]));
        assert!(!frees(&released, [[0, 1, 2], [3, 4, 5]]));
        assert!(!frees(&released, [[0, 1, 2], [9, 10, 11]]));
        assert!(!released.frees(&mesh, &[0, 2], &[6, 7]));
        one.parts = [3, 3];
        one.places = [DVec3::X * 2.0, DVec3::NEG_X];
        released.take(&[one]);
        assert!(!frees(&released, [[0, 1, 2], [6, 7, 8]]));
        assert!(frees(&released, [[0, 1, 2], [3, 4, 5]]));
        assert!(!released.frees(&mesh, &[1], &[3, 5]));
        one.against = 2;
        released.take(&[one]);
        assert!(frees(&released, [[0, 1, 2], [3, 4, 5]]));
        assert!(!frees(&released, [[0, 1, 2], [9, 10, 11]]));
    }
}
