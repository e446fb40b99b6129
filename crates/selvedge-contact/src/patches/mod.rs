//! Patches of the cloth that are too smooth to meet themselves: their pairs need no search.
//!
//! Let R turn the plane of the pattern into space, and let F be the gradient of each face, from the
//! pattern to space. If the symmetric part of Rᵀ F is at least κ everywhere on the straight line
//! between two points of the pattern, then the two are at least κ times as far apart in space as in
//! the pattern: the sum of F along the line does not turn back on itself. The least eigenvalue is
//! a concave function of F, so that what holds at both ends of a straight way holds on all of it.
//! `[eq:patch]`
//!
//! Faces are taken in groups, those under one node of the tree. Each group has one R, and its
//! surroundings are a rectangle of the pattern around it, in which any two points have a straight
//! line within the cloth ([`layout`]).

mod layout;

use glam::{DVec2, DVec3, Vec3A};

use crate::boxes::{Apart, NO_GROUP, Tree};
use crate::collision_mesh::CollisionMesh;
use layout::Layout;

/// Faces of a group, at most.
const GROUP: u32 = 16;
/// κ that a patch keeps as long as its pairs are left out.
const KEPT: f32 = 0.25;
/// κ that a patch must have where it is left out anew, so that it is not taken up again at once.
const WELCOME: f32 = 0.4;
/// Rounding of an eigenvalue, and of boundaries that are straight but for rounding.
const ROUNDING: f32 = 1e-3;

/// Groups of the cloth's faces, and which of them are smooth.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    corners: Vec<[u32; 3]>,
    /// Inverse of each face's edges in the pattern, by columns `[1/m]`, `[faces]`.
    inverse: Vec<[f32; 4]>,
    groups: Vec<Group>,
    /// Gradients at the two ends of a way, `[groups]`.
    shapes: [Vec<Shape>; 2],
    /// Points of the cloth there `[m]`; empty before.
    places: [Vec<DVec3>; 2],
    points: usize,
    /// True for groups whose own pairs, and those with what is close, are left out.
    is_smooth: Vec<bool>,
    /// Those of the search before.
    was_smooth: Vec<bool>,
    /// Group of each face, `[faces]`.
    group_of: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Group {
    faces: Vec<u32>,
    /// Groups of which the whole lies in the surroundings, itself among them, in ascending order;
    /// empty where the surroundings are not as they must be.
    close: Vec<u32>,
    /// Groups of which a part lies in the surroundings, itself among them.
    around: Vec<u32>,
    /// True if it is among those around a group that is looked at.
    is_around_others: bool,
    /// Distance in the pattern of two features without a common vertex, at least, of its own faces
    /// with those that are close `[m]`.
    clearance: f64,
}

/// Gradients of a group's faces: their mean, by columns, and the largest distance from it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Shape {
    u: Vec3A,
    v: Vec3A,
    spread: f32,
}

impl Patches {
    /// The patches of a cloth whose faces have these `corners` in the pattern `[m]`, grouped as
    /// `tree` has them. The tree is told its groups.
    pub(crate) fn new(mesh: &CollisionMesh, corners: &[[DVec2; 3]], tree: &mut Tree) -> Self {
        let groups = tree.group(GROUP);
        let faces = &mesh.faces()[mesh.bodies()[0].faces.start as usize..][..corners.len()];
        let groups = Layout::new(faces, corners).groups(groups);
        let count = groups.len();
        let mut group_of = vec![NO_GROUP; corners.len()];
        for (number, group) in groups.iter().enumerate() {
            for face in &group.faces {
                group_of[*face as usize] = number as u32;
            }
        }
        Self {
            group_of,
            was_smooth: vec![false; count],
            corners: faces.to_vec(),
            inverse: corners.iter().map(inverse).collect(),
            groups,
            shapes: [vec![Shape::default(); count], vec![Shape::default(); count]],
            places: [Vec::new(), Vec::new()],
            points: mesh.bodies()[0].points.end as usize,
            is_smooth: vec![false; count],
        }
    }

    /// Looks which groups are smooth on the way from `from` to `to` `[m]`, so that none of their
    /// pairs comes nearer than `gap` `[m]`.
    pub(crate) fn look(&mut self, from: &[DVec3], to: &[DVec3], gap: f64) {
        self.measure(from, to);
        for k in 0..self.groups.len() {
            let is_fine = f64::from(KEPT) * self.groups[k].clearance >= gap;
            self.is_smooth[k] = is_fine && self.keeps(k, WELCOME);
        }
    }

    /// Drops groups that were smooth and are not on the way from `from` to `to` `[m]`.
    pub(crate) fn look_again(&mut self, from: &[DVec3], to: &[DVec3]) {
        self.measure(from, to);
        self.was_smooth.copy_from_slice(&self.is_smooth);
        for k in 0..self.groups.len() {
            self.is_smooth[k] = self.is_smooth[k] && self.keeps(k, KEPT);
        }
    }

    /// Returns true if [`Self::look_again`] has dropped the group of a face of the mesh.
    pub(crate) fn has_lost(&self, face: u32) -> bool {
        let group = self.group_of.get(face as usize);
        group.is_some_and(|k| self.was_smooth[*k as usize] && !self.is_smooth[*k as usize])
    }

    /// Returns true if all groups that were smooth are so on the way from `from` to `to` `[m]`.
    pub(crate) fn hold(&mut self, from: &[DVec3], to: &[DVec3]) -> bool {
        self.measure(from, to);
        (0..self.groups.len()).all(|k| !self.is_smooth[k] || self.keeps(k, KEPT))
    }

    pub(crate) fn clear(&mut self) {
        self.is_smooth.fill(false);
    }

    /// Tells if the pairs of the two groups need a search.
    #[inline]
    pub(crate) fn apart(&self, first: u32, second: u32) -> Apart {
        if first == NO_GROUP || second == NO_GROUP {
            return Apart::Never;
        }
        let covers = |own: u32, other: u32, smooth: &[bool]| {
            let close = &self.groups[own as usize].close;
            smooth[own as usize] && close.binary_search(&other).is_ok()
        };
        let apart =
            |smooth: &[bool]| covers(first, second, smooth) || covers(second, first, smooth);
        match (apart(&self.is_smooth), apart(&self.was_smooth)) {
            (true, _) => Apart::Still,
            (false, true) => Apart::NoMore,
            (false, false) => Apart::Never,
        }
    }

    /// Takes the gradients at both ends of a way. Those that are known are kept: a way mostly
    /// begins where the last one began or ended.
    fn measure(&mut self, from: &[DVec3], to: &[DVec3]) {
        if self.places[0] != from[..self.points] && self.places[1] == from[..self.points] {
            self.places.swap(0, 1);
            self.shapes.swap(0, 1);
        }
        for (end, places) in [from, to].into_iter().enumerate() {
            let cloth = &places[..self.points];
            if self.places[end] == cloth {
                continue;
            }
            self.places[end].clear();
            self.places[end].extend_from_slice(cloth);
            for (shape, group) in self.shapes[end].iter_mut().zip(&self.groups) {
                if group.is_around_others {
                    *shape = Shape::of(&group.faces, &self.corners, &self.inverse, cloth);
                }
            }
        }
    }

    /// Returns true if κ is at least this all around a group, at both ends of the way.
    fn keeps(&self, k: usize, least: f32) -> bool {
        let group = &self.groups[k];
        if group.close.is_empty() {
            return false;
        }
        let [from, to] = &self.shapes;
        let frame = Frame::between(&from[k], &to[k]);
        group.around.iter().all(|other| {
            [from, to]
                .iter()
                .all(|shapes| frame.least(&shapes[*other as usize]) >= least + ROUNDING)
        })
    }
}

impl Shape {
    /// Of the faces of a group.
    fn of(group: &[u32], corners: &[[u32; 3]], inverse: &[[f32; 4]], places: &[DVec3]) -> Self {
        let gradient = |face: u32| {
            let [a, b, c] = corners[face as usize].map(|p| places[p as usize]);
            let (first, second) = ((b - a).as_vec3a(), (c - a).as_vec3a());
            let [i, j, k, l] = inverse[face as usize];
            (first * i + second * j, first * k + second * l)
        };
        let mut gradients = [(Vec3A::ZERO, Vec3A::ZERO); GROUP as usize];
        let (mut u, mut v) = (Vec3A::ZERO, Vec3A::ZERO);
        for (slot, face) in gradients.iter_mut().zip(group) {
            *slot = gradient(*face);
            u += slot.0;
            v += slot.1;
        }
        let part = 1.0 / group.len() as f32;
        (u, v) = (u * part, v * part);
        let squares = gradients[..group.len()]
            .iter()
            .map(|(own_u, own_v)| (*own_u - u).length_squared() + (*own_v - v).length_squared());
        let spread = squares.fold(0.0, f32::max).sqrt();
        Self { u, v, spread }
    }
}

/// A turned plane of the pattern in space.
struct Frame {
    u: Vec3A,
    v: Vec3A,
}

impl Frame {
    /// The one that is nearest to the mean of two gradients.
    fn between(first: &Shape, second: &Shape) -> Self {
        let (u, v) = (first.u + second.u, first.v + second.v);
        let normal = u.cross(v).normalize_or_zero();
        let along = u.normalize_or_zero();
        let across = normal.cross(along);
        // The turn of a matrix with the columns (|u|, 0) and (v·along, v·across).
        let turn = glam::Vec2::new(u.length() + v.dot(across), -v.dot(along)).normalize_or_zero();
        Self {
            u: along * turn.x + across * turn.y,
            v: across * turn.x - along * turn.y,
        }
    }

    /// Least eigenvalue of the symmetric part of Rᵀ F over the faces of a group, at least.
    fn least(&self, shape: &Shape) -> f32 {
        let (a, d) = (self.u.dot(shape.u), self.v.dot(shape.v));
        let b = 0.5 * (self.u.dot(shape.v) + self.v.dot(shape.u));
        let half = 0.5 * (a - d);
        0.5 * (a + d) - (half * half + b * b).sqrt() - shape.spread
    }
}

/// Inverse of the edges from the first corner, by columns: what the two edges in space are
/// multiplied by for the first column of the gradient, and for the second.
fn inverse(corners: &[DVec2; 3]) -> [f32; 4] {
    let [a, b, c] = *corners;
    let matrix = glam::DMat2::from_cols(b - a, c - a).inverse();
    matrix.to_cols_array().map(|number| number as f32)
}

#[cfg(test)]
mod tests;
