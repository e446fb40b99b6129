//! Boxes along the axes, and a binary tree of them over the faces of a body. The tree is made once
//! and refitted, so that faces are visited in the same order however they move.

use glam::{DVec3, Vec3A};

/// A box along the axes `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub least: DVec3,
    /// Greatest corner.
    pub greatest: DVec3,
}

impl Bounds {
    /// The box of one point.
    #[inline]
    pub fn of(point: DVec3) -> Self {
        Self {
            least: point,
            greatest: point,
        }
    }

    /// The least box around both.
    #[inline]
    pub fn around(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }

    /// The box, wider by `margin` on every side.
    #[inline]
    pub fn widened(self, margin: f64) -> Self {
        Self {
            least: self.least - DVec3::splat(margin),
            greatest: self.greatest + DVec3::splat(margin),
        }
    }

    /// Returns true if the boxes have a point in common.
    #[inline]
    pub fn meets(&self, other: &Self) -> bool {
        self.least.cmple(other.greatest).all() && other.least.cmple(self.greatest).all()
    }

    /// Returns true if `other` lies within.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        self.least.cmple(other.least).all() && other.greatest.cmple(self.greatest).all()
    }
}

/// A box along the axes in f32 `[m]`, around the one in f64 that it was made of. Two of them are
/// compared in four instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rough {
    least: Vec3A,
    greatest: Vec3A,
}

/// Rounding of a number to f32, relative to it, and a little more.
const ROUNDING: f32 = 1.2e-7;

impl From<Bounds> for Rough {
    #[inline]
    fn from(bounds: Bounds) -> Self {
        let outward = |v: DVec3| {
            let v = v.as_vec3a();
            (v, v.abs() * ROUNDING)
        };
        let (least, below) = outward(bounds.least);
        let (greatest, above) = outward(bounds.greatest);
        Self {
            least: least - below,
            greatest: greatest + above,
        }
    }
}

impl Rough {
    /// The least box around both.
    #[inline]
    pub(crate) fn around(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }

    /// Returns true if the boxes have a point in common.
    #[inline]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        let overlap =
            self.least.cmple(other.greatest).bitmask() & other.least.cmple(self.greatest).bitmask();
        overlap == 0b111
    }
}

/// Boxes around features on their straight ways: those at the begin and at the end. Between, a box goes
/// evenly from one to the other, so what stays apart along an axis at both is apart throughout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swept {
    begin: Rough,
    end: Rough,
}

impl Swept {
    /// A point that goes from `from` to `to`, widened by `margin`.
    #[inline]
    pub(crate) fn of(from: DVec3, to: DVec3, margin: f64) -> Self {
        Self {
            begin: Bounds::of(from).widened(margin).into(),
            end: Bounds::of(to).widened(margin).into(),
        }
    }

    #[inline]
    pub(crate) fn around(self, other: Self) -> Self {
        Self {
            begin: self.begin.around(other.begin),
            end: self.end.around(other.end),
        }
    }

    /// Returns true if one axis separates the two throughout.
    #[inline]
    pub(crate) fn are_apart(&self, other: &Self) -> bool {
        let above = self.begin.least.cmpgt(other.begin.greatest).bitmask()
            & self.end.least.cmpgt(other.end.greatest).bitmask();
        let below = other.begin.least.cmpgt(self.begin.greatest).bitmask()
            & other.end.least.cmpgt(self.end.greatest).bitmask();
        above | below != 0
    }
}

/// The group of a node that stands for none.
pub(crate) const NO_GROUP: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Rough,
    /// Second child of an inner node (the first follows it), or the face of a leaf.
    link: u32,
    /// Faces below; a leaf has one.
    count: u32,
    /// The group of faces that are all those below, or [`NO_GROUP`].
    group: u32,
    /// True if a face below has changed since the last search: its box, or what it is apart from.
    has_changed: bool,
}

/// The tree of a body's faces. Children stand after their parent.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// A tree over `faces`, each with its place `[m]`, halved at medians along the longest side.
    pub(crate) fn new(faces: impl Iterator<Item = (u32, DVec3)>) -> Self {
        let mut faces: Vec<(u32, DVec3)> = faces.collect();
        let mut nodes = Vec::with_capacity(2 * faces.len());
        if !faces.is_empty() {
            build(&mut nodes, &mut faces);
        }
        Self { nodes }
    }

    /// Gives every face the box that `bounds` has for it, with whether the face has changed, and
    /// every node one around its faces.
    pub(crate) fn refit(&mut self, bounds: impl Fn(u32) -> (Rough, bool)) {
        for k in (0..self.nodes.len()).rev() {
            let Node { link, count, .. } = self.nodes[k];
            let (around, has_changed) = match count {
                1 => bounds(link),
                _ => {
                    let (left, right) = (&self.nodes[k + 1], &self.nodes[link as usize]);
                    let has_changed = left.has_changed || right.has_changed;
                    (left.bounds.around(right.bounds), has_changed)
                }
            };
            self.nodes[k].bounds = around;
            self.nodes[k].has_changed = has_changed;
        }
    }

    /// Makes groups of the faces, each of `most` faces at most: those below a node whose parent has
    /// more. Returns the faces of each.
    pub(crate) fn group(&mut self, most: u32) -> Vec<Vec<u32>> {
        let mut groups: Vec<Vec<u32>> = Vec::new();
        let mut k = 0;
        while k < self.nodes.len() {
            let count = self.nodes[k].count;
            if count > most {
                k += 1;
                continue;
            }
            // The nodes below follow: one less than there are faces, and the faces.
            let end = k + 2 * count as usize - 1;
            let leaves = self.nodes[k..end].iter().filter(|node| node.count == 1);
            let faces = leaves.map(|node| node.link).collect();
            self.nodes[k].group = groups.len() as u32;
            groups.push(faces);
            k = end;
        }
        groups
    }

    /// Calls `found` for each two faces of the tree whose boxes meet, but for those below two
    /// groups, or the same, that are `apart`; with whether they are looked at for the first time.
    /// In a search that is not `anew` two faces are left out of which neither has changed since the
    /// last one.
    pub(crate) fn own_pairs(
        &self,
        anew: bool,
        apart: impl Fn(u32, u32) -> Apart,
        mut found: impl FnMut(u32, u32, bool),
    ) {
        let mut open: Vec<Two> = Vec::with_capacity(64);
        if !self.nodes.is_empty() {
            open.push(Two {
                first: 0,
                second: 0,
                anew,
            });
        }
        while let Some(mut two) = open.pop() {
            let own = two.first;
            let group = |node: u32| self.nodes[node as usize].group;
            match apart(group(own), group(two.second)) {
                Apart::Still => continue,
                Apart::NoMore => two.anew = true,
                Apart::Never => (),
            }
            if own != two.second {
                visit(&self.nodes, &self.nodes, two, &mut open, &mut found);
                continue;
            }
            let Node {
                link,
                count,
                has_changed,
                ..
            } = self.nodes[own as usize];
            if count > 1 && (two.anew || has_changed) {
                let two = |first, second| Two {
                    first,
                    second,
                    anew: two.anew,
                };
                open.extend([two(own + 1, link), two(link, link), two(own + 1, own + 1)]);
            }
        }
    }

    /// Calls `found` for each face of this tree and each of `other` whose boxes meet, with `anew`.
    /// In a search that is not two faces are left out of which neither has changed since the last
    /// one.
    pub(crate) fn pairs(&self, other: &Self, anew: bool, mut found: impl FnMut(u32, u32, bool)) {
        let mut open: Vec<Two> = Vec::with_capacity(64);
        if !self.nodes.is_empty() && !other.nodes.is_empty() {
            open.push(Two {
                first: 0,
                second: 0,
                anew,
            });
        }
        while let Some(two) = open.pop() {
            visit(&self.nodes, &other.nodes, two, &mut open, &mut found);
        }
    }
}

/// Need of a search for the pairs of two groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Apart {
    /// They need none.
    Still,
    /// They need one, and needed none the last time.
    NoMore,
    /// They need one, as the last time.
    Never,
}

/// Two nodes that are still to be compared.
#[derive(Clone, Copy)]
struct Two {
    first: u32,
    second: u32,
    /// True if the pairs below were left out of the last search.
    anew: bool,
}

/// Opens the larger of two nodes whose boxes meet, or gives two leaves to `found`.
#[inline]
fn visit(
    left: &[Node],
    right: &[Node],
    two: Two,
    open: &mut Vec<Two>,
    found: &mut impl FnMut(u32, u32, bool),
) {
    let Two {
        first,
        second,
        anew,
    } = two;
    let (a, b) = (&left[first as usize], &right[second as usize]);
    let is_known = !(anew || a.has_changed || b.has_changed);
    if is_known || !a.bounds.meets(&b.bounds) {
        return;
    }
    let with_first = |first| Two { first, ..two };
    let with_second = |second| Two { second, ..two };
    match (a.count, b.count) {
        (1, 1) => found(a.link, b.link, anew),
        (m, n) if m >= n => open.extend([with_first(a.link), with_first(first + 1)]),
        _ => open.extend([with_second(b.link), with_second(second + 1)]),
    }
}

fn build(nodes: &mut Vec<Node>, faces: &mut [(u32, DVec3)]) {
    let own = nodes.len();
    nodes.push(Node {
        bounds: Bounds::of(DVec3::ZERO).into(),
        link: faces[0].0,
        count: faces.len() as u32,
        group: NO_GROUP,
        has_changed: true,
    });
    if faces.len() == 1 {
        return;
    }
    let around = |all: Bounds, face: &(u32, DVec3)| all.around(Bounds::of(face.1));
    let all = faces[1..].iter().fold(Bounds::of(faces[0].1), around);
    let axis = (all.greatest - all.least).max_position();
    faces.sort_unstable_by(|a, b| a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0)));
    let (left, right) = faces.split_at_mut(faces.len() / 2);
    build(nodes, left);
    nodes[own].link = nodes.len() as u32;
    build(nodes, right);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_rough_box_is_around_the_exact_one() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..1000 {
            let mut number = || rng.random_range(-1.0_f64..1.0) * 10_f64.powi(3);
            let mut point = || DVec3::new(number(), number() * 1e-3, number() * 1e-6);
            let exact = Bounds::of(point()).around(Bounds::of(point()));
            let rough = Rough::from(exact);
            assert!(rough.least.as_dvec3().cmple(exact.least).all());
            assert!(rough.greatest.as_dvec3().cmpge(exact.greatest).all());
            assert!(rough.meets(&Bounds::of(exact.least).into()));
            let beside = exact.least - DVec3::splat(1e-3);
            assert!(!rough.meets(&Bounds::of(beside).into()));
        }
    }
}
