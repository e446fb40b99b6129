//! Candidates: all pairs that could come near each other while the points stay close to a path.

use std::iter::repeat;

use glam::{DVec2, DVec3};
use selvedge_cloth::ReleasedContact;

use crate::boxes::{Apart, Bounds, Rough, Swept, Tree};
use crate::collision_mesh::{CollisionMesh, NONE};
use crate::pair::{Kind, Pair};
use crate::patches::Patches;
use crate::release::Released;

/// Pairs of a mesh whose boxes met when they were found, and the trees that find them.
#[derive(Clone, Debug)]
pub struct Candidates {
    /// One for the cloth, one for each obstacle.
    trees: Vec<Tree>,
    /// One more for the cloth, around where it is against its middle.
    own_tree: Tree,
    touches_itself: bool,
    /// Number of the points of the cloth.
    own_points: usize,
    /// Patches of the cloth whose pairs need no search.
    patches: Option<Patches>,
    /// Contact whose pairs are left out.
    released: Released,
    pairs: Vec<Pair>,
    /// Two faces each, and the first of the pairs of their features, in the order of the pairs.
    faces: Vec<([u32; 2], u32)>,
    /// Pairs of the cloth with itself that come first, and their entries in `faces`: no pair of an
    /// obstacle is among them.
    own: (usize, usize),
    /// False where pairs of the cloth with itself come later too.
    own_come_first: bool,
    /// Gap for which the pairs were found `[m]`.
    gap: f64,
    /// Boxes for the pairs of the cloth with itself, against its middle, and for all others.
    centred: Held,
    world: Held,
    /// Ways against the middle of the cloth, in room that is kept.
    places: [Vec<DVec3>; 3],
}

/// Boxes for which pairs were found.
#[derive(Clone, Debug, Default)]
struct Held {
    /// Boxes that the points must not leave while the pairs hold.
    allowed: Vec<Bounds>,
    boxes: Boxes,
    /// Boxes of the search before, and points whose boxes are others since, in room that is kept.
    before: Boxes,
    has_moved: Vec<bool>,
}

/// Boxes of all features, wide enough for a search.
#[derive(Clone, Debug, Default)]
struct Boxes {
    points: Vec<Rough>,
    faces: Vec<Rough>,
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
    /// The same of points of the cloth against its middle, for its pairs with itself.
    pub own_slack: f64,
}

/// Boxes around the ways of all features.
#[derive(Clone, Debug, Default)]
pub struct SweptBoxes {
    points: Vec<Swept>,
    edges: Vec<Swept>,
    faces: Vec<Swept>,
}

impl SweptBoxes {
    /// Takes the ways of the points from `from` to `to` `[m]`, `[points]`, for features that are looked
    /// for within `distance` `[m]`: those of all bodies, or of the cloth alone where the others are known.
    pub fn take(
        &mut self,
        mesh: &CollisionMesh,
        [from, to]: [&[DVec3]; 2],
        distance: f64,
        cloth_alone: bool,
    ) {
        let cloth = mesh.bodies().first().filter(|_| cloth_alone);
        let points = cloth.map_or(from.len(), |cloth| cloth.points.len());
        let edges = cloth.map_or(mesh.edges().len(), |cloth| cloth.edges.len());
        let faces = cloth.map_or(mesh.faces().len(), |cloth| cloth.faces.len());
        if !cloth_alone {
            self.points.clear();
            self.edges.clear();
            self.faces.clear();
        }
        let ways = from.iter().zip(to).take(points);
        let ways = ways.zip(mesh.radii());
        put(
            &mut self.points,
            ways.map(|((from, to), radius)| Swept::of(*from, *to, 0.5 * distance + radius)),
        );
        let of = |p: u32| self.points[p as usize];
        let ends = mesh.edges()[..edges].iter().map(|edge| edge.ends);
        put(&mut self.edges, ends.map(|[a, b]| of(a).around(of(b))));
        let corners = mesh.faces()[..faces].iter();
        put(
            &mut self.faces,
            corners.map(|[a, b, c]| of(*a).around(of(*b)).around(of(*c))),
        );
    }

    /// Returns true if one axis separates two faces throughout.
    #[inline]
    fn faces_are_apart(&self, [a, b]: [u32; 2]) -> bool {
        self.faces[a as usize].are_apart(&self.faces[b as usize])
    }

    /// Returns true if one axis separates a pair throughout.
    #[inline]
    fn are_apart(&self, pair: &Pair) -> bool {
        let (first, second) = (pair.first as usize, pair.second as usize);
        match pair.kind {
            Kind::VertexFace => self.points[first].are_apart(&self.faces[second]),
            Kind::EdgeEdge => self.edges[first].are_apart(&self.edges[second]),
        }
    }
}

/// Puts `new` boxes in the place of the first ones that there are.
fn put(boxes: &mut Vec<Swept>, new: impl Iterator<Item = Swept>) {
    for (k, new) in new.enumerate() {
        match boxes.get_mut(k) {
            Some(own) => *own = new,
            None => boxes.push(new),
        }
    }
}

impl Candidates {
    /// No candidates yet, of a `mesh` whose trees fit these `points` `[m]`, those at the begin of
    /// the scene. Where the cloth does
    /// not touch itself, its own pairs are left out.
    pub fn new(mesh: &CollisionMesh, points: &[DVec3], touches_itself: bool) -> Self {
        let middle = |face: u32| {
            let corners = mesh.faces()[face as usize];
            let sum: DVec3 = corners.iter().map(|p| points[*p as usize]).sum();
            sum / 3.0
        };
        let tree = |faces: std::ops::Range<u32>| Tree::new(faces.map(|f| (f, middle(f))));
        let bodies = mesh.bodies().iter();
        let trees: Vec<Tree> = bodies.map(|body| tree(body.faces.clone())).collect();
        Self {
            own_tree: trees.first().cloned().unwrap_or_default(),
            trees,
            touches_itself,
            own_points: mesh.bodies().first().map_or(0, |cloth| cloth.points.len()),
            patches: None,
            released: Released::none(points),
            pairs: Vec::new(),
            faces: Vec::new(),
            own: (0, 0),
            own_come_first: true,
            gap: 0.0,
            centred: Held::default(),
            world: Held::default(),
            places: Default::default(),
        }
    }

    /// The same, but pairs within a patch of the cloth that is too smooth to meet itself are left
    /// out. The cloth's faces have these `corners` in its pattern `[m]`, `[faces, 3]`. `[eq:patch]`
    pub fn with_pattern(mut self, mesh: &CollisionMesh, corners: &[[DVec2; 3]]) -> Self {
        if self.touches_itself {
            self.patches = Some(Patches::new(mesh, corners, &mut self.own_tree));
        }
        self
    }

    #[cfg(test)]
    pub(crate) fn patches(&self) -> Option<&Patches> {
        self.patches.as_ref()
    }

    /// The trees of the bodies, cloth first, their nodes around the faces' `bounds`.
    pub(crate) fn trees_around(&self, bounds: impl Fn(u32) -> Bounds) -> Vec<Tree> {
        let mut trees = self.trees.clone();
        for tree in &mut trees {
            tree.refit(|face| (bounds(face).into(), true));
        }
        trees
    }

    pub(crate) fn touches_itself(&self) -> bool {
        self.touches_itself
    }

    /// The pairs. Those of one search are in an order that depends on the mesh alone.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Gives the places of the pairs that are not known by their boxes to stay apart on the ways of
    /// `swept`, in order; of pairs of two faces of which `concerns` is true of neither, none.
    pub fn open(&self, swept: &SweptBoxes, concerns: impl Fn(u32) -> bool, open: &mut Vec<u32>) {
        open.clear();
        let ends = self.faces.iter().skip(1).map(|(_, first)| *first);
        let ends = ends.chain([self.pairs.len() as u32]);
        for ((faces, first), end) in self.faces.iter().zip(ends) {
            let [a, b] = *faces;
            if (concerns(a) || concerns(b)) && !swept.faces_are_apart(*faces) {
                let pairs = *first..end;
                open.extend(pairs.filter(|k| !swept.are_apart(&self.pairs[*k as usize])));
            }
        }
    }

    /// Leaves out the pairs of this contact from now on, and only these. The pairs there are hold
    /// nowhere.
    pub fn release(&mut self, released: &[ReleasedContact]) {
        self.released.take(released);
        self.clear();
    }

    /// Contact whose pairs are left out.
    pub fn released(&self) -> &Released {
        &self.released
    }

    /// Drops the pairs: they hold nowhere.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.faces.clear();
        self.own = (0, 0);
        self.own_come_first = true;
        self.centred.allowed.clear();
        self.world.allowed.clear();
        if let Some(patches) = &mut self.patches {
            patches.clear();
        }
    }

    /// Pairs of the cloth with itself that come first: it may move as a whole, and they still hold.
    pub fn own_count(&self) -> usize {
        self.own.0
    }

    /// Returns true if no pair is missed while the points move from `from` to `to` `[m]`.
    pub fn cover(&mut self, from: &[DVec3], to: &[DVec3]) -> bool {
        let still = Ways {
            from,
            to,
            later: to,
        };
        self.world.holds(from, to) && self.own_hold(still)
    }

    /// Returns true if no pair of the cloth with itself is missed on these ways.
    fn own_hold(&mut self, ways: Ways<'_>) -> bool {
        if !self.touches_itself {
            return true;
        }
        self.centre(ways);
        let [from, to, _] = &self.places;
        self.centred.holds(from, to)
            && match &mut self.patches {
                Some(patches) => patches.hold(ways.from, ways.to),
                None => true,
            }
    }

    /// Takes the ways of the cloth against its middle.
    fn centre(&mut self, ways: Ways<'_>) {
        let count = self.own_points;
        let all = [ways.from, ways.to, ways.later];
        for (places, points) in self.places.iter_mut().zip(all) {
            let cloth = &points[..count];
            let middle = cloth.iter().sum::<DVec3>() / count as f64;
            places.clear();
            places.extend(cloth.iter().map(|p| *p - middle));
        }
    }

    /// Finds all pairs that could come nearer than `reach.gap` while no point strays further than
    /// `reach.slack` from the box around its path, the cloth with itself against its middle. Pairs of
    /// the cloth with itself that still hold stay, in their places; gives their number.
    pub fn find(&mut self, mesh: &CollisionMesh, ways: Ways<'_>, reach: Reach) -> usize {
        let is_known = self.own_come_first && self.gap == reach.gap;
        let mut kept = self.own.0;
        if !(is_known && self.own_hold(ways)) {
            kept = 0;
            self.clear();
            self.gap = reach.gap;
            if self.touches_itself {
                self.centre(ways);
                if let Some(patches) = &mut self.patches {
                    patches.look(ways.from, ways.to, reach.gap);
                }
                let [from, to, later] = &self.places;
                let own = Ways { from, to, later };
                self.centred.take(own, &[], reach.gap, reach.own_slack);
                self.search_own(mesh, true);
                self.own = (self.pairs.len(), self.faces.len());
            }
        }
        self.pairs.truncate(self.own.0);
        self.faces.truncate(self.own.1);
        self.world.take(ways, mesh.radii(), reach.gap, reach.slack);
        self.search_others(mesh, true);
        kept
    }

    /// Adds the pairs that [`Self::find`] would find for points that go where they were not
    /// expected to go. All pairs that there are stay, in their places.
    pub fn widen(&mut self, mesh: &CollisionMesh, ways: Ways<'_>, reach: Reach) {
        if self.world.allowed.len() != ways.from.len() {
            self.find(mesh, ways, reach);
            return;
        }
        if !self.own_hold(ways) {
            if let Some(patches) = &mut self.patches {
                patches.look_again(ways.from, ways.to);
            }
            let [from, to, later] = &self.places;
            let own = Ways { from, to, later };
            self.centred.widen(own, &[], reach.gap, reach.own_slack);
            let count = self.pairs.len();
            self.search_own(mesh, false);
            self.own_come_first &= self.pairs.len() == count;
        }
        if !self.world.holds(ways.from, ways.to) {
            self.world.widen(ways, mesh.radii(), reach.gap, reach.slack);
            self.search_others(mesh, false);
        }
    }

    /// Adds the pairs of the cloth with itself whose boxes meet now; in a search that is not `anew`,
    /// those of which this was not so in the last one.
    fn search_own(&mut self, mesh: &CollisionMesh, anew: bool) {
        let faces = mesh.bodies().first().map_or(0, |cloth| cloth.faces.len());
        self.centred.boxes.close(mesh, faces);
        let patches = self.patches.as_ref();
        let has_lost = |face: u32| patches.is_some_and(|patches| patches.has_lost(face));
        let held = &self.centred;
        self.own_tree.refit(|face| {
            let has_changed = anew || held.has_moved(mesh, face) || has_lost(face);
            (held.boxes.faces[face as usize], has_changed)
        });
        let mut finder = Finder {
            mesh,
            held,
            released: &self.released,
            pairs: &mut self.pairs,
            faces: &mut self.faces,
        };
        let apart = |a, b| patches.map_or(Apart::Never, |patches| patches.apart(a, b));
        let found = |a, b, anew| finder.of_faces(a, b, anew);
        self.own_tree.own_pairs(anew, apart, found);
    }

    /// As [`Self::search_own`], of the cloth with obstacles.
    fn search_others(&mut self, mesh: &CollisionMesh, anew: bool) {
        self.world.boxes.close(mesh, mesh.faces().len());
        let held = &self.world;
        for tree in &mut self.trees {
            tree.refit(|face| {
                let has_changed = anew || held.has_moved(mesh, face);
                (held.boxes.faces[face as usize], has_changed)
            });
        }
        let mut finder = Finder {
            mesh,
            held,
            released: &self.released,
            pairs: &mut self.pairs,
            faces: &mut self.faces,
        };
        let Some((cloth, obstacles)) = self.trees.split_first() else {
            return;
        };
        for obstacle in obstacles {
            cloth.pairs(obstacle, anew, |a, b, anew| finder.of_faces(a, b, anew));
        }
    }
}

impl Held {
    /// Returns true if no point leaves its box on its way.
    fn holds(&self, from: &[DVec3], to: &[DVec3]) -> bool {
        let ends = from.iter().zip(to);
        self.allowed.len() == from.len()
            && self.allowed.iter().zip(ends).all(|(allowed, (from, to))| {
                allowed.contains(&Bounds::of(*from).around(Bounds::of(*to)))
            })
    }

    /// Takes the boxes around ways of points with these `radii`, 0 beyond the last.
    fn take(&mut self, ways: Ways<'_>, radii: &[f64], gap: f64, slack: f64) {
        self.boxes.points.clear();
        self.allowed.clear();
        for (path, radius) in paths(ways).zip(radii.iter().chain(repeat(&0.0))) {
            self.allowed.push(path.widened(slack));
            let wide = path.widened(slack + 0.5 * gap + radius);
            self.boxes.points.push(wide.into());
        }
    }

    /// Widens the boxes of the points that leave theirs.
    fn widen(&mut self, ways: Ways<'_>, radii: &[f64], gap: f64, slack: f64) {
        self.before.clone_from(&self.boxes);
        self.has_moved.clear();
        let ends = ways.from.iter().zip(ways.to);
        let radii = radii.iter().chain(repeat(&0.0));
        for (p, ((path, (from, to)), radius)) in paths(ways).zip(ends).zip(radii).enumerate() {
            let allowed = &mut self.allowed[p];
            let stays = allowed.contains(&Bounds::of(*from).around(Bounds::of(*to)));
            self.has_moved.push(!stays);
            if !stays {
                *allowed = allowed.around(path.widened(slack));
                let wide = path.widened(slack + 0.5 * gap + radius);
                self.boxes.points[p] = self.boxes.points[p].around(wide.into());
            }
        }
    }

    /// Returns true if [`Self::widen`] has moved the box of a corner.
    fn has_moved(&self, mesh: &CollisionMesh, face: u32) -> bool {
        let corners = mesh.faces()[face as usize].iter();
        let mut moved = corners.map(|p| self.has_moved[*p as usize]);
        moved.any(|moved| moved)
    }
}

fn paths(ways: Ways<'_>) -> impl Iterator<Item = Bounds> {
    let ends = ways.from.iter().zip(ways.to).zip(ways.later);
    ends.map(|((from, to), later)| {
        Bounds::of(*from)
            .around(Bounds::of(*to))
            .around(Bounds::of(*later))
    })
}

impl Boxes {
    /// Puts the boxes of the first faces around those of their points.
    fn close(&mut self, mesh: &CollisionMesh, face_count: usize) {
        let faces = mesh.faces()[..face_count].iter();
        let points = &self.points;
        self.faces.clear();
        self.faces.extend(faces.map(|corners| {
            let [a, b, c] = corners.map(|p| points[p as usize]);
            a.around(b).around(c)
        }));
    }

    /// The box of an edge.
    #[inline]
    fn edge(&self, [a, b]: [u32; 2]) -> Rough {
        self.points[a as usize].around(self.points[b as usize])
    }

    fn vertex_meets(&self, vertex: u32, face: u32) -> bool {
        self.points[vertex as usize].meets(&self.faces[face as usize])
    }

    fn edges_meet(&self, first: [u32; 2], second: [u32; 2]) -> bool {
        self.edge(first).meets(&self.edge(second))
    }
}

struct Finder<'a> {
    mesh: &'a CollisionMesh,
    held: &'a Held,
    released: &'a Released,
    pairs: &'a mut Vec<Pair>,
    faces: &'a mut Vec<([u32; 2], u32)>,
}

impl Finder<'_> {
    /// Adds the pairs of two faces whose boxes meet; unless the faces are looked at `anew`, those
    /// whose boxes did not meet before.
    fn of_faces(&mut self, a: u32, b: u32, anew: bool) {
        let first = self.pairs.len();
        self.vertices(a, b, anew);
        self.vertices(b, a, anew);
        for first in self.mesh.share(a).edges {
            if first != NONE {
                self.edges_with(first, b, anew);
            }
        }
        if self.pairs.len() > first {
            self.faces.push(([a, b], first as u32));
        }
    }

    /// Pairs of the vertices for which `owner` stands with `face`.
    fn vertices(&mut self, owner: u32, face: u32, anew: bool) {
        let corners = self.mesh.faces()[face as usize];
        for vertex in self.mesh.share(owner).vertices {
            if vertex == NONE || corners.contains(&vertex) {
                continue;
            }
            if self.held.boxes.vertex_meets(vertex, face)
                && (anew || !self.held.before.vertex_meets(vertex, face))
            {
                let [b, c, d] = corners;
                self.push(Pair::vertex_face(vertex, face, [vertex, b, c, d]));
            }
        }
    }

    /// Pairs of an edge with the edges for which `face` stands.
    fn edges_with(&mut self, first: u32, face: u32, anew: bool) {
        let [a, b] = self.mesh.edges()[first as usize].ends;
        let boxes = &self.held.boxes;
        if !boxes.edge([a, b]).meets(&boxes.faces[face as usize]) {
            return;
        }
        for second in self.mesh.share(face).edges {
            if second == NONE {
                continue;
            }
            let [c, d] = self.mesh.edges()[second as usize].ends;
            if a == c || a == d || b == c || b == d {
                continue;
            }
            if boxes.edges_meet([a, b], [c, d])
                && (anew || !self.held.before.edges_meet([a, b], [c, d]))
            {
                self.push(Pair::edge_edge(first, second, [a, b, c, d]));
            }
        }
    }

    fn push(&mut self, pair: Pair) {
        let (first, second) = pair.corners.split_at(pair.kind.split());
        if !self.released.frees(self.mesh, first, second) {
            self.pairs.push(pair);
        }
    }
}

#[cfg(test)]
mod tests;
