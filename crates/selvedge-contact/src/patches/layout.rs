//! Groups of faces as they lie in the pattern: what is around each, and whether any two points
//! there have a straight line within the cloth.
//!
//! The cloth within a rectangle of the pattern is what hangs together across edges that are no
//! seams. It is locally convex if no corner of its boundary there is reflex, and then a shortest
//! way between two of its points is a straight line (Tietze's theorem). No point of the pattern
//! may be branched: the angles around an inner vertex make a full turn.

use std::collections::HashMap;

use glam::DVec2;

use super::Group;

/// Width of the surroundings around a group, in units of its longer side.
const AROUND: f64 = 0.8;
/// Angle by which a corner of a straight boundary may be off `[rad]`.
const STRAIGHT: f64 = 1e-6;
const NONE: u32 = u32::MAX;

pub(super) struct Layout<'a> {
    faces: &'a [[u32; 3]],
    corners: &'a [[DVec2; 3]],
    /// Face across each side of a face from corner k to the next, [`NONE`] where the cloth ends or
    /// is sewn.
    across: Vec<[u32; 3]>,
    /// True for corners that no straight line may pass.
    is_reflex: Vec<[bool; 3]>,
}

/// A rectangle of the pattern `[m]`.
#[derive(Clone, Copy)]
struct Rectangle {
    least: DVec2,
    greatest: DVec2,
}

impl Rectangle {
    fn around(points: impl Iterator<Item = DVec2>) -> Self {
        let none = Self {
            least: DVec2::INFINITY,
            greatest: DVec2::NEG_INFINITY,
        };
        points.fold(none, |all, p| Self {
            least: all.least.min(p),
            greatest: all.greatest.max(p),
        })
    }

    fn widened(self, by: f64) -> Self {
        Self {
            least: self.least - by,
            greatest: self.greatest + by,
        }
    }

    fn contains(&self, p: DVec2) -> bool {
        p.cmpge(self.least).all() && p.cmple(self.greatest).all()
    }

    /// Returns true if the segment from `a` to `b` has a point in the rectangle.
    fn meets(&self, a: DVec2, b: DVec2) -> bool {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let (start, way) = (a[axis], b[axis] - a[axis]);
            let (least, greatest) = (self.least[axis], self.greatest[axis]);
            if way == 0.0 {
                if start < least || start > greatest {
                    return false;
                }
                continue;
            }
            let (enter, leave) = ((least - start) / way, (greatest - start) / way);
            first = first.max(enter.min(leave));
            last = last.min(enter.max(leave));
        }
        first <= last
    }
}

impl<'a> Layout<'a> {
    /// The layout of `faces` whose corners lie at `corners` in the pattern `[m]`.
    pub(super) fn new(faces: &'a [[u32; 3]], corners: &'a [[DVec2; 3]]) -> Self {
        let mut layout = Self {
            faces,
            corners,
            across: across(faces, corners),
            is_reflex: vec![[false; 3]; faces.len()],
        };
        layout.mark_reflex();
        layout
    }

    /// Marks corners of boundaries that are wider than a half turn, and all of an inner vertex
    /// whose angles do not make a full one.
    fn mark_reflex(&mut self) {
        let mut is_done = vec![[false; 3]; self.faces.len()];
        for face in 0..self.faces.len() {
            for corner in 0..3 {
                if is_done[face][corner] {
                    continue;
                }
                let (fan, is_closed) = self.fan(face, corner);
                let angle: f64 = fan.iter().map(|(f, k)| self.angle(*f, *k)).sum();
                let is_reflex = if is_closed {
                    (angle - std::f64::consts::TAU).abs() > STRAIGHT
                } else {
                    angle > std::f64::consts::PI + STRAIGHT
                };
                for (f, k) in fan {
                    is_done[f][k] = true;
                    self.is_reflex[f][k] = is_reflex;
                }
            }
        }
    }

    /// Corners of the faces around a vertex that hang together there, and whether they close.
    fn fan(&self, face: usize, corner: usize) -> (Vec<(usize, usize)>, bool) {
        let mut fan = vec![(face, corner)];
        let vertex = self.faces[face][corner];
        for side in [corner, (corner + 2) % 3] {
            let (mut from, mut next) = (face, self.across[face][side]);
            while next != NONE {
                let here = next as usize;
                if here == face {
                    return (fan, true);
                }
                let k = (0..3).find(|k| self.faces[here][*k] == vertex);
                let Some(k) = k else {
                    break;
                };
                fan.push((here, k));
                let sides = [self.across[here][k], self.across[here][(k + 2) % 3]];
                let back = from as u32;
                from = here;
                // Two faces that share both sides of a vertex do not lie in a plane.
                next = match sides {
                    [a, b] if a == back && b == back => NONE,
                    [a, b] if a == back => b,
                    [a, _] => a,
                };
            }
        }
        (fan, false)
    }

    /// Angle of a face at a corner `[rad]`.
    fn angle(&self, face: usize, corner: usize) -> f64 {
        let points = self.corners[face];
        let [a, b, c] = [0, 1, 2].map(|k| points[(corner + k) % 3]);
        (b - a).angle_to(c - a).abs()
    }

    /// The groups with what is around them.
    pub(super) fn groups(&self, groups: Vec<Vec<u32>>) -> Vec<Group> {
        let mut group_of = vec![NONE; self.faces.len()];
        for (number, faces) in (0..).zip(&groups) {
            for face in faces {
                group_of[*face as usize] = number;
            }
        }
        let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
        let mut seen = vec![NONE; self.faces.len()];
        let mut found: Vec<Group> = Vec::with_capacity(groups.len());
        for (number, faces) in (0..).zip(groups) {
            let inside = self.surroundings(&faces, number, &mut seen);
            let mut group = Group {
                faces,
                close: Vec::new(),
                around: Vec::new(),
                clearance: 0.0,
                is_around_others: false,
            };
            if let Some((reached, wholly)) = inside {
                // Faces of each group that lie in the surroundings as a whole.
                let mut counts: HashMap<u32, usize> = HashMap::new();
                for face in &wholly {
                    *counts.entry(group_of[*face as usize]).or_default() += 1;
                }
                let is_whole = |g: &u32| counts.get(g) == Some(&sizes[*g as usize]);
                group.around = reached.iter().map(|f| group_of[*f as usize]).collect();
                group.around.sort_unstable();
                group.around.dedup();
                let close = group.around.iter().copied();
                group.close = close.filter(|g| is_whole(g)).collect();
                group.clearance = self.clearance(&reached);
            }
            found.push(group);
        }
        for number in 0..found.len() {
            for other in found[number].around.clone() {
                found[other as usize].is_around_others = true;
            }
        }
        found
    }

    /// Faces that hang together with a group within its surroundings, and those of them that lie
    /// there as a whole. None where two points there may have no straight line within the cloth.
    fn surroundings(
        &self,
        group: &[u32],
        number: u32,
        seen: &mut [u32],
    ) -> Option<(Vec<u32>, Vec<u32>)> {
        let own = group.iter().flat_map(|f| self.corners[*f as usize]);
        let own = Rectangle::around(own);
        let rectangle = own.widened(AROUND * (own.greatest - own.least).max_element());
        let mut reached = vec![group[0]];
        seen[group[0] as usize] = number;
        let mut next = 0;
        while let Some(face) = reached.get(next).map(|f| *f as usize) {
            next += 1;
            let points = self.corners[face];
            for k in 0..3 {
                if self.is_reflex[face][k] && rectangle.contains(points[k]) {
                    return None;
                }
                let other = self.across[face][k];
                let is_new = other != NONE && seen[other as usize] != number;
                if is_new && rectangle.meets(points[k], points[(k + 1) % 3]) {
                    seen[other as usize] = number;
                    reached.push(other);
                }
            }
        }
        if group.iter().any(|face| seen[*face as usize] != number) {
            return None;
        }
        let is_inside = |face: &u32| {
            let points = self.corners[*face as usize];
            points.iter().all(|p| rectangle.contains(*p))
        };
        let wholly = reached.iter().copied().filter(is_inside).collect();
        Some((reached, wholly))
    }

    /// Least distance of two features of these faces without a common vertex, in the pattern `[m]`:
    /// what is drawn in a plane without crossing is nearest at a corner, and a corner sees first the
    /// sides across the faces around it.
    fn clearance(&self, faces: &[u32]) -> f64 {
        let corners = faces.iter().map(|face| self.corners[*face as usize]);
        let across = corners.flat_map(|[a, b, c]| {
            [(a, b, c), (b, c, a), (c, a, b)].map(|(p, from, to)| to_segment(p, from, to))
        });
        across.fold(f64::INFINITY, f64::min)
    }
}

/// Distance of `p` to the segment from `a` to `b` `[m]`.
fn to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let way = b - a;
    let part = ((p - a).dot(way) / way.length_squared()).clamp(0.0, 1.0);
    p.distance(a + way * part)
}

/// Face across each side: one that sees both ends at the same points, and lies on the other side.
fn across(faces: &[[u32; 3]], corners: &[[DVec2; 3]]) -> Vec<[u32; 3]> {
    let mut sides: HashMap<[u32; 2], Vec<(usize, usize)>> = HashMap::new();
    for (face, ids) in faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (ids[k], ids[(k + 1) % 3]);
            sides
                .entry([a.min(b), a.max(b)])
                .or_default()
                .push((face, k));
        }
    }
    let mut across = vec![[NONE; 3]; faces.len()];
    for pair in sides.values() {
        let [(f, i), (g, j)] = pair[..] else {
            continue;
        };
        let ends = |face: usize, k: usize| {
            let next = (k + 1) % 3;
            let [a, b] = [k, next].map(|k| (faces[face][k], corners[face][k]));
            if a.0 < b.0 { [a.1, b.1] } else { [b.1, a.1] }
        };
        let [a, b] = ends(f, i);
        let side = |face: usize, k: usize| (b - a).perp_dot(corners[face][(k + 2) % 3] - a);
        if ends(g, j) == [a, b] && side(f, i) * side(g, j) < 0.0 {
            across[f][i] = g as u32;
            across[g][j] = f as u32;
        }
    }
    across
}
