//! The search for the pairs of two bodies: of the cloth with itself, or of it with an obstacle. It
//! is made in a frame that goes along with the obstacle, or with the cloth, so that what both do
//! together costs nothing. `[eq:relative-motion]`

use glam::DVec3;

use crate::boxes::{Apart, Bounds, Rough, Slab, Slabs, Tree};
use crate::candidates::Reach;
use crate::frame::{Follower, LEAST_SHRINK, Passage};
use crate::pair::{Kind, Pair};
use crate::patches::Patches;
use crate::release::Released;
use crate::surface::{Body, NONE, Surface};

/// Solves ahead for which pairs are found, should all points go on as they go: fewer searches for
/// more pairs, of which most are never looked at.
const AHEAD: f64 = 2.0;
/// Size of a box from which it is made anew, in units of what it would be then.
const WASTE: f64 = 2.0;
/// Rounding of places in a frame `[m]`.
const ROUNDING: f64 = 1e-8;

/// The pairs of two bodies, or what is known of them.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    cloth: Layer,
    /// The obstacle; none where the cloth meets itself.
    other: Option<Layer>,
    /// The frame of what is not rigid.
    follower: Follower,
    passage: Passage,
    /// True for an obstacle that is at rest in the frame.
    is_rigid: bool,
    /// Gap for which the boxes of an obstacle at rest were made `[m]`.
    made_for: Option<f64>,
    /// What is added on every side of a box, so that those of all pairs that are nearer than the
    /// gap meet `[m]`.
    margin: f64,
    pub(crate) state: State,
    /// True if the pairs hold for the way of the points.
    pub(crate) holds: bool,
}

/// What is known of the pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    /// Nothing.
    Unknown,
    /// The bodies are so far from each other that there are none.
    Far,
    /// They hold while the points stay in their boxes.
    Near,
}

/// A body in the frame of a search.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    body: Body,
    pub(crate) tree: Tree,
    /// Places of the points in the frame at both ends of the way `[m]`.
    ways: [Vec<DVec3>; 2],
    /// Places when their boxes were made `[m]`, from which oblique directions are taken.
    middles: Vec<DVec3>,
    boxes: Boxes,
    /// Points that leave their boxes on the way.
    leaving: usize,
    /// Points whose boxes are others since the last update.
    has_moved: Vec<bool>,
}

/// Boxes of all features.
#[derive(Clone, Debug, Default)]
struct Boxes {
    /// Boxes that the points must not leave while the pairs hold.
    allowed: Vec<Bounds>,
    /// Those, wide enough for a search.
    points: Vec<Rough>,
    faces: Vec<Rough>,
    edges: Vec<Rough>,
    slabs: Vec<Slab>,
}

impl Search {
    /// Knows nothing yet of the cloth with itself, or with an `other` body.
    pub(crate) fn new(cloth: Layer, other: Option<Layer>) -> Self {
        let mut follower = Follower::default();
        let frame = follower.turn(&[]);
        Self {
            cloth,
            other,
            passage: Passage::still(frame),
            follower,
            is_rigid: false,
            made_for: None,
            margin: 0.0,
            state: State::Unknown,
            holds: false,
        }
    }

    /// The layer that the search alone has.
    pub(crate) fn layer(&self) -> &Layer {
        self.other.as_ref().unwrap_or(&self.cloth)
    }

    pub(crate) fn tree_mut(&mut self) -> &mut Tree {
        &mut self.cloth.tree
    }

    /// Part of a length in the frame that it has in the world on the way, at least.
    pub(crate) fn shrink(&self) -> f64 {
        self.passage.shrink
    }

    /// Puts the points, all at `from` `[m]`, where a way begins; a `rigid` obstacle goes with its
    /// frame. Tells `gone` how far each point of the cloth, and of an obstacle that deforms, has
    /// gone in the frame since the way before began.
    pub(crate) fn start(
        &mut self,
        from: &[DVec3],
        rigid: Option<Passage>,
        mut gone: impl FnMut(u32, f64),
    ) {
        if self.is_rigid != rigid.is_some() {
            self.is_rigid = rigid.is_some();
            self.made_for = None;
            self.state = State::Unknown;
        }
        let guide = self.layer().of(from);
        self.passage = rigid.unwrap_or_else(|| Passage::still(self.follower.turn(guide)));
        let frame = self.passage.from;
        let is_near = self.state == State::Near;
        for layer in self.moving_layers() {
            let points = &from[layer.body.points.start as usize..layer.body.points.end as usize];
            let places = &mut layer.ways[0];
            places.resize(points.len(), DVec3::ZERO);
            for ((p, place), point) in (layer.body.points.start..).zip(places).zip(points) {
                let before = std::mem::replace(place, frame.place(*point));
                if is_near {
                    gone(p, before.distance(*place));
                }
            }
        }
    }

    /// Takes the way on which the points, those that began at [`Self::start`], end at `to` `[m]`,
    /// and looks if the pairs hold for it.
    pub(crate) fn go(&mut self, to: &[DVec3]) {
        if !self.is_rigid {
            self.passage = self.follower.follow(self.layer().of(to));
        }
        let Passage {
            to: frame, bulge, ..
        } = self.passage;
        for layer in self.moving_layers() {
            let points = &to[layer.body.points.start as usize..layer.body.points.end as usize];
            let places = &mut layer.ways[1];
            places.clear();
            places.extend(points.iter().map(|p| frame.place(*p)));
        }
        self.holds = match self.state {
            State::Unknown => false,
            State::Far => self.is_far(0.0, 0.0),
            State::Near => {
                let leaving = self.moving_layers().map(|layer| layer.leave(bulge));
                leaving.sum::<usize>() == 0
            }
        };
    }

    /// Tells `gone` how far each point goes in the frame on its way, at most.
    pub(crate) fn lengths(&self, mut gone: impl FnMut(u32, f64)) {
        if self.state != State::Near {
            return;
        }
        let stretch = 1.0 + self.passage.bulge;
        let other = self.other.as_ref().filter(|_| !self.is_rigid);
        for layer in std::iter::once(&self.cloth).chain(other) {
            let ends = layer.ways[0].iter().zip(&layer.ways[1]);
            for (p, (from, to)) in (layer.body.points.start..).zip(ends) {
                gone(p, stretch * from.distance(*to));
            }
        }
    }

    fn moving_layers(&mut self) -> impl Iterator<Item = &mut Layer> {
        let other = self.other.as_mut().filter(|_| !self.is_rigid);
        std::iter::once(&mut self.cloth).chain(other)
    }

    /// Returns true if the cloth surely stays away from the obstacle, on its way and on
    /// going on for `ahead` `[m]`, all of it wider by `slack` `[m]`.
    fn is_far(&self, ahead: f64, slack: f64) -> bool {
        let Some(other) = &self.other else {
            return false;
        };
        let bulge = self.passage.bulge;
        let around = match self.is_rigid {
            true => other.tree.bounds(),
            false => other.extent(bulge, ahead, slack + self.margin),
        };
        let own = self.cloth.extent(bulge, ahead, slack + self.margin);
        matches!((own, around), (Some(own), Some(around)) if !own.meets(&around))
    }

    /// Finds all pairs that could come nearer than `reach.gap` while no point strays further than
    /// `reach.slack` from the box around its path in the frame. `first` are the places of all
    /// points where the frame of a rigid obstacle is that of the world `[m]`.
    pub(crate) fn find(
        &mut self,
        surface: &Surface,
        reach: Reach,
        mut patches: Option<&mut Patches>,
        ends: [&[DVec3]; 2],
        released: &Released,
        pairs: &mut Vec<Pair>,
    ) {
        self.margin = 0.5 * reach.gap / LEAST_SHRINK + ROUNDING;
        if !self.is_rigid {
            self.follower
                .refer(&self.other.as_ref().unwrap_or(&self.cloth).ways[0]);
            // By the new reference the frame turns otherwise.
            self.go(ends[1]);
        }
        if let Some(other) = &mut self.other
            && self.is_rigid
            && self.made_for != Some(reach.gap)
        {
            self.made_for = Some(reach.gap);
            other.rest(surface, released.first(), self.margin);
        }
        self.holds = true;
        if self.is_far(reach.ahead, reach.slack) {
            self.state = State::Far;
            return;
        }
        self.state = State::Near;
        if let Some(patches) = &mut patches {
            patches.look(ends[0], ends[1], reach.gap);
        }
        let (bulge, margin) = (self.passage.bulge, self.margin);
        for layer in self.moving_layers() {
            layer.make(surface, bulge, reach, margin);
        }
        self.visit(surface, true, patches.as_deref(), released, &[], pairs);
    }

    /// Returns true if it is worth while to look again only at what has moved: most points stay in
    /// their boxes.
    pub(crate) fn is_known(&self) -> bool {
        let other = self.other.as_ref().filter(|_| !self.is_rigid);
        let layers = || std::iter::once(&self.cloth).chain(other);
        let leaving: usize = layers().map(|layer| layer.leaving).sum();
        let all: usize = layers().map(|layer| layer.has_moved.len()).sum();
        self.state == State::Near && 2 * leaving < all
    }

    /// Makes the boxes anew of points that leave theirs on the way between these `ends` of all points
    /// `[m]`, or lets them `grow`. The pairs of others hold as they are; those of these are to be
    /// found by [`Self::find_moved`].
    pub(crate) fn follow(
        &mut self,
        surface: &Surface,
        reach: Reach,
        mut patches: Option<&mut Patches>,
        ends: [&[DVec3]; 2],
        grow: bool,
    ) {
        self.holds = true;
        if let Some(patches) = &mut patches {
            patches.look_again(ends[0], ends[1]);
        }
        let (bulge, margin) = (self.passage.bulge, self.margin);
        let has_lost = |face| {
            patches
                .as_ref()
                .is_some_and(|patches| patches.has_lost(face))
        };
        for layer in self.moving_layers() {
            layer.follow(surface, bulge, reach, margin, grow, has_lost);
        }
    }

    /// Returns true if [`Self::follow`] gave a corner of the pair another box.
    #[inline]
    pub(crate) fn has_moved(&self, pair: &Pair) -> bool {
        pair.corners.iter().any(|p| {
            let own = self.cloth.has_moved.get(*p as usize).copied();
            own.unwrap_or_else(|| {
                let layer = self.layer();
                layer.has_moved[layer.point(*p)]
            })
        })
    }

    /// Adds the pairs of what has moved that are not `listed`, in ascending order.
    pub(crate) fn find_moved(
        &self,
        surface: &Surface,
        patches: Option<&Patches>,
        released: &Released,
        listed: &[Pair],
        pairs: &mut Vec<Pair>,
    ) {
        self.visit(surface, false, patches, released, listed, pairs);
    }

    /// Adds the pairs whose boxes meet, or in a search that is not `anew` those of them that have
    /// moved and are not `listed`.
    fn visit(
        &self,
        surface: &Surface,
        anew: bool,
        patches: Option<&Patches>,
        released: &Released,
        listed: &[Pair],
        pairs: &mut Vec<Pair>,
    ) {
        let cloth = &self.cloth;
        let mut finder = Finder {
            surface,
            layers: [cloth, self.layer()],
            margin: self.margin,
            released,
            listed,
            pairs,
        };
        let found = |a, b, anew| finder.of_faces(a, b, anew);
        match &self.other {
            None => {
                let apart = |a, b| patches.map_or(Apart::Never, |patches| patches.apart(a, b));
                cloth.tree.own_pairs(anew, cloth.slabs(), apart, found);
            }
            Some(other) => {
                let slabs = [cloth.slabs(), other.slabs()];
                cloth.tree.pairs(&other.tree, anew, slabs, found);
            }
        }
    }
}

impl Layer {
    /// A body without boxes yet, its faces in this `tree`.
    pub(crate) fn new(body: &Body, tree: Tree) -> Self {
        Self {
            body: body.clone(),
            tree,
            ways: [Vec::new(), Vec::new()],
            middles: Vec::new(),
            boxes: Boxes::default(),
            leaving: 0,
            has_moved: Vec::new(),
        }
    }

    /// The entries of its points.
    fn of<'a>(&self, points: &'a [DVec3]) -> &'a [DVec3] {
        &points[self.body.points.start as usize..self.body.points.end as usize]
    }

    fn slabs(&self) -> Slabs<'_> {
        Slabs {
            all: &self.boxes.slabs,
            first: self.body.faces.start,
        }
    }

    /// Counts the points that leave their boxes.
    fn leave(&mut self, bulge: f64) -> usize {
        let ends = self.ways[0].iter().zip(&self.ways[1]);
        let boxes = self.boxes.allowed.iter().zip(ends);
        let leaving = boxes
            .filter(|(allowed, (from, to))| !allowed.contains(&around_way(**from, **to, bulge)));
        self.leaving = leaving.count();
        self.leaving
    }

    /// Box around the ways of all points, which go on for `ahead` `[m]`, wider by `slack` `[m]`;
    /// none if a place is not a number.
    fn extent(&self, bulge: f64, ahead: f64, slack: f64) -> Option<Rough> {
        let mut all: Option<Bounds> = None;
        for (from, to) in self.ways[0].iter().zip(&self.ways[1]) {
            let path = path(*from, *to, bulge, ahead);
            if !(path.least.is_finite() && path.greatest.is_finite()) {
                return None;
            }
            all = Some(all.map_or(path, |all| all.around(path)));
        }
        all.map(|all| all.widened(slack).into())
    }

    /// Makes the boxes of a body at rest in the frame.
    fn rest(&mut self, surface: &Surface, first: &[DVec3], margin: f64) {
        let places = self.of(first);
        self.middles.clear();
        self.middles.extend_from_slice(places);
        self.boxes.allowed.clear();
        self.boxes.points.clear();
        for place in places {
            self.boxes.allowed.push(Bounds::of(*place));
            self.boxes
                .points
                .push(Bounds::of(*place).widened(margin).into());
        }
        self.has_moved.clear();
        self.has_moved.resize(self.middles.len(), false);
        self.close(surface, margin, |_| false);
    }

    /// Makes the boxes of a body that moves in the frame.
    fn make(&mut self, surface: &Surface, bulge: f64, reach: Reach, margin: f64) {
        self.middles.clone_from(&self.ways[0]);
        self.boxes.allowed.clear();
        self.boxes.points.clear();
        for (from, to) in self.ways[0].iter().zip(&self.ways[1]) {
            let path = path(*from, *to, bulge, reach.ahead).widened(reach.slack);
            self.boxes.allowed.push(path);
            self.boxes.points.push(path.widened(margin).into());
        }
        self.has_moved.clear();
        self.has_moved.resize(self.middles.len(), true);
        self.close(surface, margin, |_| true);
    }

    /// Makes the boxes of points anew that leave theirs, or lets them `grow`.
    fn follow(
        &mut self,
        surface: &Surface,
        bulge: f64,
        reach: Reach,
        margin: f64,
        grow: bool,
        has_lost: impl Fn(u32) -> bool,
    ) {
        let mut has_moved = std::mem::take(&mut self.has_moved);
        has_moved.clear();
        for (p, (from, to)) in self.ways[0].iter().zip(&self.ways[1]).enumerate() {
            let allowed = &mut self.boxes.allowed[p];
            let path = path(*from, *to, bulge, reach.ahead).widened(reach.slack);
            // What was fast and is no more has more pairs than it needs.
            let stays = allowed.contains(&around_way(*from, *to, bulge))
                && (grow || allowed.size() < WASTE * path.size());
            has_moved.push(!stays);
            if !stays {
                *allowed = if grow { allowed.around(path) } else { path };
                self.boxes.points[p] = allowed.widened(margin).into();
                self.middles[p] = *from;
            }
        }
        let first = self.body.points.start;
        self.close(surface, margin, |face| {
            let mut corners = surface.faces()[face as usize].iter();
            corners.any(|p| has_moved[(*p - first) as usize]) || has_lost(face)
        });
        self.has_moved = has_moved;
    }

    /// Puts the boxes of faces and edges around those of their points, and those of the tree around
    /// them. Faces that `have_changed` are looked at again.
    fn close(&mut self, surface: &Surface, margin: f64, have_changed: impl Fn(u32) -> bool) {
        let Body {
            points,
            faces,
            edges,
        } = &self.body;
        let (boxes, middles) = (&mut self.boxes, &self.middles);
        let range = faces.start as usize..faces.end as usize;
        boxes.faces.clear();
        boxes.slabs.clear();
        for corners in &surface.faces()[range] {
            let [a, b, c] = corners.map(|p| (p - points.start) as usize);
            let around = boxes.points[a].around(boxes.points[b]);
            boxes.faces.push(around.around(boxes.points[c]));
            let (u, v) = (middles[b] - middles[a], middles[c] - middles[a]);
            let normal = u.cross(v).normalize_or_zero();
            let spans = [a, b, c].map(|p| boxes.allowed[p].along(normal));
            let (low, high) = around_spans(spans);
            boxes
                .slabs
                .push(Slab::new(normal, low - margin, high + margin));
        }
        let range = edges.start as usize..edges.end as usize;
        boxes.edges.clear();
        for edge in &surface.edges()[range] {
            let [a, b] = edge.ends.map(|p| (p - points.start) as usize);
            boxes.edges.push(boxes.points[a].around(boxes.points[b]));
        }
        self.tree.refit(|face| {
            let own = boxes.faces[(face - faces.start) as usize];
            (own, have_changed(face))
        });
    }

    fn point(&self, p: u32) -> usize {
        (p - self.body.points.start) as usize
    }

    fn face(&self, f: u32) -> usize {
        (f - self.body.faces.start) as usize
    }

    fn edge(&self, e: u32) -> usize {
        (e - self.body.edges.start) as usize
    }
}

/// Box around the way of a point in a frame.
#[inline]
fn around_way(from: DVec3, to: DVec3, bulge: f64) -> Bounds {
    let bulge = bulge * from.distance(to);
    Bounds::of(from).around(Bounds::of(to)).widened(bulge)
}

/// The same, of a point that goes on as it goes, for [`AHEAD`] ways in all, but `ahead` `[m]` more at
/// most.
fn path(from: DVec3, to: DVec3, bulge: f64, ahead: f64) -> Bounds {
    let further = (to - from) * (AHEAD - 1.0);
    let length = further.length();
    let part = if length > ahead { ahead / length } else { 1.0 };
    around_way(from, to, bulge).around(Bounds::of(to + further * part))
}

/// The least span around all.
#[inline]
fn around_spans<const N: usize>(spans: [(f64, f64); N]) -> (f64, f64) {
    spans
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |all, span| {
            (all.0.min(span.0), all.1.max(span.1))
        })
}

struct Finder<'a> {
    surface: &'a Surface,
    /// The two bodies, or the cloth twice.
    layers: [&'a Layer; 2],
    margin: f64,
    released: &'a Released,
    /// Pairs that there are, of those that have moved.
    listed: &'a [Pair],
    pairs: &'a mut Vec<Pair>,
}

impl Finder<'_> {
    /// Adds the pairs of two faces that meet; unless the faces are looked at `anew`, of those that
    /// have moved.
    fn of_faces(&mut self, a: u32, b: u32, anew: bool) {
        let [first, second] = self.layers;
        self.vertices([first, second], a, b, anew);
        self.vertices([second, first], b, a, anew);
        for edge in self.surface.share(a).edges {
            if edge != NONE
                && first.boxes.edges[first.edge(edge)].meets(&second.boxes.faces[second.face(b)])
            {
                self.edges_with(edge, self.surface.share(b).edges, anew);
            }
        }
    }

    /// Pairs of the vertices for which `owner` stands with `face`.
    fn vertices(&mut self, layers: [&Layer; 2], owner: u32, face: u32, anew: bool) {
        let corners = self.surface.faces()[face as usize];
        let around = &layers[1].boxes.faces[layers[1].face(face)];
        for vertex in self.surface.share(owner).vertices {
            if vertex == NONE || corners.contains(&vertex) {
                continue;
            }
            if layers[0].boxes.points[layers[0].point(vertex)].meets(around) {
                let [b, c, d] = corners;
                let pair = Pair::vertex_face(vertex, face, [vertex, b, c, d]);
                self.push(layers, pair, anew);
            }
        }
    }

    fn edges_with(&mut self, first: u32, others: [u32; 3], anew: bool) {
        let layers = self.layers;
        let [a, b] = self.surface.edges()[first as usize].ends;
        let own = &layers[0].boxes.edges[layers[0].edge(first)];
        for second in others {
            if second == NONE {
                continue;
            }
            let [c, d] = self.surface.edges()[second as usize].ends;
            if a == c || a == d || b == c || b == d {
                continue;
            }
            if own.meets(&layers[1].boxes.edges[layers[1].edge(second)]) {
                let pair = Pair::edge_edge(first, second, [a, b, c, d]);
                self.push(layers, pair, anew);
            }
        }
    }

    /// Adds a pair whose boxes meet, its features of these two layers; unless it is looked at
    /// `anew`, if it has moved and is not listed.
    fn push(&mut self, layers: [&Layer; 2], pair: Pair, anew: bool) {
        let split = pair.kind.split();
        let places: [_; 4] = std::array::from_fn(|k| {
            let layer = layers[usize::from(k >= split)];
            (layer, layer.point(pair.corners[k]))
        });
        let has_moved = || places.iter().any(|(layer, p)| layer.has_moved[*p]);
        if !(anew || has_moved()) || !self.meets_obliquely(pair.kind, places) {
            return;
        }
        let (first, second) = pair.corners.split_at(split);
        if self.released.frees(self.surface, first, second) {
            return;
        }
        if anew || self.listed.binary_search(&pair).is_err() {
            self.pairs.push(pair);
        }
    }

    /// Returns true if the boxes of both features meet along the direction across them where their
    /// boxes were made: the normal of the face, or the direction across both edges.
    fn meets_obliquely(&self, kind: Kind, corners: [(&Layer, usize); 4]) -> bool {
        let [a, b, c, d] = corners.map(|(layer, p)| layer.middles[p]);
        let across = match kind {
            Kind::VertexFace => (c - b).cross(d - b),
            Kind::EdgeEdge => (b - a).cross(d - c),
        };
        let across = across.normalize_or_zero();
        let [a, b, c, d] = corners.map(|(layer, p)| layer.boxes.allowed[p].along(across));
        let [first, second] = match kind {
            Kind::VertexFace => [a, around_spans([b, c, d])],
            Kind::EdgeEdge => [around_spans([a, b]), around_spans([c, d])],
        };
        let apart = 2.0 * self.margin;
        first.0 <= second.1 + apart && second.0 <= first.1 + apart
    }
}
