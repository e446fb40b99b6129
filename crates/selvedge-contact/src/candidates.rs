//! Candidates: all pairs that could come near each other while the points stay close to a path.

use glam::{DVec2, DVec3};

use crate::boxes::{Bounds, Rough, Tree};
use crate::pair::Pair;
use crate::patches::Patches;
use crate::surface::{NONE, Surface};

/// Pairs of a surface whose boxes met when they were found, and the trees that find them.
#[derive(Clone, Debug)]
pub struct Candidates {
    /// One for the cloth, one for each obstacle.
    trees: Vec<Tree>,
    touches_itself: bool,
    /// Patches of the cloth whose pairs need no search.
    patches: Option<Patches>,
    pairs: Vec<Pair>,
    /// Boxes that the points must not leave while the pairs hold.
    allowed: Vec<Bounds>,
    /// Boxes of faces, in room that is kept.
    faces: Vec<Rough>,
    edges: Vec<Rough>,
    points: Vec<Rough>,
}

/// Ways of all points, for which candidates are found.
#[derive(Clone, Copy, Debug)]
pub struct Ways<'a> {
    /// Places of the points now `[m]`, `[points]`.
    pub from: &'a [DVec3],
    /// Places to which they go now, on straight ways `[m]`, `[points]`.
    pub to: &'a [DVec3],
    /// Places to which they may go later: the candidates hold as far as that `[m]`, `[points]`.
    pub later: &'a [DVec3],
}

impl<'a> Ways<'a> {
    /// Points that stay where they are `[m]`, `[points]`.
    #[must_use]
    pub fn still(points: &'a [DVec3]) -> Self {
        Self {
            from: points,
            to: points,
            later: points,
        }
    }
}

/// Distances in a search for candidates `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Gap below which no pair is missed.
    pub gap: f64,
    /// Distance that points may stray from their path.
    pub slack: f64,
}

impl Candidates {
    /// No candidates yet, of a `surface` whose trees fit these `points` `[m]`. Where the cloth does
    /// not touch itself, its own pairs are left out.
    #[must_use]
    pub fn new(surface: &Surface, points: &[DVec3], touches_itself: bool) -> Self {
        let middle = |face: u32| {
            let corners = surface.faces()[face as usize];
            let sum: DVec3 = corners.iter().map(|p| points[*p as usize]).sum();
            sum / 3.0
        };
        let tree = |faces: std::ops::Range<u32>| Tree::new(faces.map(|f| (f, middle(f))));
        let bodies = surface.bodies().iter();
        Self {
            trees: bodies.map(|body| tree(body.faces.clone())).collect(),
            touches_itself,
            patches: None,
            pairs: Vec::new(),
            allowed: Vec::new(),
            faces: Vec::new(),
            edges: Vec::new(),
            points: Vec::new(),
        }
    }

    /// The same, but pairs within a patch of the cloth that is too smooth to meet itself are left
    /// out. The cloth's faces have these `corners` in its pattern `[m]`, `[faces, 3]`. `[eq:patch]`
    #[must_use]
    pub fn with_pattern(mut self, surface: &Surface, corners: &[[DVec2; 3]]) -> Self {
        if let Some(cloth) = self.trees.first_mut().filter(|_| self.touches_itself) {
            self.patches = Some(Patches::new(surface, corners, cloth));
        }
        self
    }

    #[cfg(test)]
    pub(crate) fn patches(&self) -> Option<&Patches> {
        self.patches.as_ref()
    }

    /// Trees of every body, their nodes around the faces' `bounds`.
    pub(crate) fn trees_at(surface: &Surface, bounds: impl Fn(u32) -> Bounds) -> Vec<Tree> {
        let bodies = surface.bodies().iter();
        bodies
            .map(|body| {
                let middle = |face: u32| {
                    let bounds = bounds(face);
                    (face, (bounds.least + bounds.greatest) * 0.5)
                };
                let mut tree = Tree::new(body.faces.clone().map(middle));
                tree.refit(|face| bounds(face).into());
                tree
            })
            .collect()
    }

    /// The pairs, in an order that depends on the surface alone.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Drops the pairs: they hold nowhere.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.allowed.clear();
        if let Some(patches) = &mut self.patches {
            patches.clear();
        }
    }

    /// Returns true if no pair is missed while the points move from `from` to `to` `[m]`.
    #[must_use]
    pub fn cover(&mut self, from: &[DVec3], to: &[DVec3]) -> bool {
        self.allowed.len() == from.len()
            && self
                .allowed
                .iter()
                .zip(from.iter().zip(to))
                .all(|(allowed, (from, to))| {
                    allowed.contains(&Bounds::of(*from).around(Bounds::of(*to)))
                })
            && match &mut self.patches {
                Some(patches) => patches.hold(from, to),
                None => true,
            }
    }

    /// Finds all pairs that could come nearer than `reach.gap` while no point strays further than
    /// `reach.slack` from the box around its path.
    pub fn find(&mut self, surface: &Surface, ways: Ways<'_>, reach: Reach) {
        let Ways { from, to, later } = ways;
        if let Some(patches) = &mut self.patches {
            patches.look(from, to, reach.gap);
        }
        let margin = reach.slack + 0.5 * reach.gap;
        self.points.clear();
        self.allowed.clear();
        for ((from, to), later) in from.iter().zip(to).zip(later) {
            let path = Bounds::of(*from)
                .around(Bounds::of(*to))
                .around(Bounds::of(*later));
            self.allowed.push(path.widened(reach.slack));
            self.points.push(path.widened(margin).into());
        }
        let points = &self.points;
        let around = |corners: &[u32]| {
            let first = points[corners[0] as usize];
            let rest = corners[1..].iter();
            rest.fold(first, |all, p| all.around(points[*p as usize]))
        };
        self.faces.clear();
        self.faces
            .extend(surface.faces().iter().map(|face| around(face)));
        self.edges.clear();
        self.edges
            .extend(surface.edges().iter().map(|edge| around(&edge.ends)));
        for tree in &mut self.trees {
            tree.refit(|face| self.faces[face as usize]);
        }
        self.pairs.clear();
        let mut finder = Finder {
            surface,
            points: &self.points,
            faces: &self.faces,
            edges: &self.edges,
            pairs: &mut self.pairs,
        };
        let Some((cloth, obstacles)) = self.trees.split_first() else {
            return;
        };
        if self.touches_itself {
            let patches = self.patches.as_ref();
            let are_apart = |a, b| patches.is_some_and(|patches| patches.are_apart(a, b));
            cloth.own_pairs(are_apart, |a, b| finder.of_faces(a, b));
        }
        for obstacle in obstacles {
            cloth.pairs(obstacle, |a, b| finder.of_faces(a, b));
        }
    }
}

/// The search among the features of two faces.
struct Finder<'a> {
    surface: &'a Surface,
    points: &'a [Rough],
    faces: &'a [Rough],
    edges: &'a [Rough],
    pairs: &'a mut Vec<Pair>,
}

impl Finder<'_> {
    fn of_faces(&mut self, a: u32, b: u32) {
        self.vertices(a, b);
        self.vertices(b, a);
        for first in self.surface.share(a).edges {
            if first != NONE && self.edges[first as usize].meets(&self.faces[b as usize]) {
                self.edges_with(first, self.surface.share(b).edges);
            }
        }
    }

    /// Pairs of the vertices for which `owner` stands with `face`.
    fn vertices(&mut self, owner: u32, face: u32) {
        let corners = self.surface.faces()[face as usize];
        for vertex in self.surface.share(owner).vertices {
            if vertex == NONE || corners.contains(&vertex) {
                continue;
            }
            if self.points[vertex as usize].meets(&self.faces[face as usize]) {
                let [b, c, d] = corners;
                let pair = Pair::vertex_face(vertex, face, [vertex, b, c, d]);
                self.pairs.push(pair);
            }
        }
    }

    fn edges_with(&mut self, first: u32, others: [u32; 3]) {
        let [a, b] = self.surface.edges()[first as usize].ends;
        for second in others {
            if second == NONE {
                continue;
            }
            let [c, d] = self.surface.edges()[second as usize].ends;
            if a == c || a == d || b == c || b == d {
                continue;
            }
            if self.edges[first as usize].meets(&self.edges[second as usize]) {
                self.pairs
                    .push(Pair::edge_edge(first, second, [a, b, c, d]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest::gap;
    use crate::pair::Kind;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use selvedge_cloth::Obstacle;
    use selvedge_cloth::generate::{SquareSpec, square};

    /// All pairs without a common vertex, of the cloth with all.
    fn every_pair(surface: &Surface) -> Vec<Pair> {
        let cloth = surface.cloth_points() as u32;
        let mut pairs = Vec::new();
        for vertex in 0..surface.point_count() as u32 {
            for (number, face) in (0..).zip(surface.faces()) {
                if !face.contains(&vertex) && (vertex < cloth || face[0] < cloth) {
                    let corners = [vertex, face[0], face[1], face[2]];
                    pairs.push(Pair::vertex_face(vertex, number, corners));
                }
            }
        }
        for (first, left) in (0..).zip(surface.edges()) {
            for (second, right) in (0..).zip(surface.edges()) {
                let apart = left.ends.iter().all(|end| !right.ends.contains(end));
                if first < second && apart && left.ends[0] < cloth {
                    let corners = [left.ends[0], left.ends[1], right.ends[0], right.ends[1]];
                    pairs.push(Pair::edge_edge(first, second, corners));
                }
            }
        }
        pairs
    }

    fn ordered(pair: &Pair) -> Pair {
        let [a, b, c, d] = pair.corners;
        match pair.kind {
            Kind::EdgeEdge if pair.first > pair.second => {
                Pair::edge_edge(pair.second, pair.first, [c, d, a, b])
            }
            _ => *pair,
        }
    }

    #[test]
    fn no_near_pair_is_missed_and_none_comes_twice() {
        let spec = SquareSpec {
            vertices: 25,
            size: 1.0,
            seed: 1,
        };
        let sheet = square(&spec).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut point =
            |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
        let corners = (0..6).map(|_| point(0.7)).collect();
        let body = Obstacle::new("body", corners, vec![[0, 1, 2], [3, 4, 5], [1, 2, 3]]).unwrap();
        let surface = Surface::new(sheet.mesh.topology(), std::slice::from_ref(&body));
        let mut start = sheet.mesh.positions().to_vec();
        start.extend(body.positions_at(0.0));
        let mut candidates = Candidates::new(&surface, &start, true);
        let reach = Reach {
            gap: 0.02,
            slack: 0.01,
        };
        let every = every_pair(&surface);
        for _ in 0..50 {
            let crumpled = |p: &DVec3, by: DVec3| DVec3::new(0.0, p.y * 0.5, p.z * 0.5) + by;
            let from: Vec<DVec3> = start.iter().map(|p| crumpled(p, point(0.1))).collect();
            let to: Vec<DVec3> = from.iter().map(|p| *p + point(0.05)).collect();
            let ways = Ways {
                from: &from,
                to: &to,
                later: &to,
            };
            candidates.find(&surface, ways, reach);
            let mut found: Vec<Pair> = candidates.pairs().iter().map(ordered).collect();
            found.sort_unstable();
            let count = found.len();
            found.dedup();
            assert_eq!(found.len(), count);
            assert!(count < every.len());
            assert!(candidates.cover(&from, &to));
            // A path that strays less than the slack along each axis.
            let stray = |p: &DVec3, by: DVec3| *p + by;
            let other: Vec<DVec3> = from.iter().map(|p| stray(p, point(0.0099))).collect();
            let end: Vec<DVec3> = to.iter().map(|p| stray(p, point(0.0099))).collect();
            assert!(candidates.cover(&other, &end));
            let far: Vec<DVec3> = to.iter().map(|p| *p + DVec3::X * 0.2).collect();
            assert!(!candidates.cover(&other, &far));
            for pair in &every {
                let (a, b) = (pair.places(&other), pair.places(&end));
                let nearest = (0..=20)
                    .map(|k| {
                        let part = f64::from(k) / 20.0;
                        gap(pair.kind, std::array::from_fn(|c| a[c].lerp(b[c], part))).distance
                    })
                    .fold(f64::INFINITY, f64::min);
                if nearest < reach.gap {
                    assert!(found.binary_search(pair).is_ok(), "{pair:?} at {nearest}");
                }
            }
        }
    }
}
