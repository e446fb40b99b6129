//! Candidates: all pairs that could come near each other while the points stay close to a path.

use glam::{DVec2, DVec3};
use selvedge_cloth::ReleasedContact;

use crate::boxes::{Bounds, Tree};
use crate::frame::Passage;
use crate::pair::Pair;
use crate::patches::Patches;
use crate::release::Released;
use crate::search::{Layer, Search, State};
use crate::surface::{NONE, Surface};

/// Pairs of a surface whose boxes met when they were found, and the searches that find them: one of
/// the cloth with itself, and one with each obstacle, each in a frame of its own. What moves as a
/// whole, or with the obstacle, needs no new search.
///
/// A way of the points is first begun ([`Self::start`]), then its end is looked at as often as it
/// changes ([`Self::cover`]), and the searches that do not hold for it are made anew
/// ([`Self::renew`]) or extended ([`Self::widen`]).
#[derive(Clone, Debug)]
pub struct Candidates {
    /// One for the cloth with itself, then one for each obstacle.
    searches: Vec<Search>,
    touches_itself: bool,
    /// Patches of the cloth whose pairs need no search.
    patches: Option<Patches>,
    /// Contact whose pairs are left out.
    released: Released,
    pairs: Vec<Pair>,
    /// Search and number of pairs that stand together, in order.
    runs: Vec<(usize, usize)>,
    /// Numbers that the pairs had when [`Self::renumber`] was last called; [`NONE`] of those that
    /// are new.
    numbers: Vec<u32>,
    /// True if some were dropped since.
    has_dropped: bool,
    slots: Slots,
    /// Searches that were made.
    made: u64,
}

/// Ways of all points, for which candidates are found.
#[derive(Clone, Copy, Debug)]
pub struct Ways<'a> {
    /// Places of the points now `[m]`, `[points]`.
    pub from: &'a [DVec3],
    /// Places to which they go now, on straight ways `[m]`, `[points]`.
    pub to: &'a [DVec3],
    /// Frames in which obstacles are at rest, from the world of their points when the scene begins,
    /// `[obstacles]`; none for those that deform, and for all that the list does not reach.
    pub rigid: &'a [Option<Passage>],
}

impl<'a> Ways<'a> {
    /// Points that stay where they are `[m]`, `[points]`.
    #[must_use]
    pub fn still(points: &'a [DVec3]) -> Self {
        Self {
            from: points,
            to: points,
            rigid: &[],
        }
    }
}

/// Distances in a search for candidates `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Gap below which no pair is missed.
    pub gap: f64,
    /// Distance that points may stray from their path, in the frame of the search.
    pub slack: f64,
    /// Distance that they may go on beyond it, at most.
    pub ahead: f64,
}

/// Places in a list of lengths for all points in all frames: a vertex of the cloth has one for the
/// cloth with itself, and one for each obstacle.
#[derive(Clone, Debug)]
pub struct Slots {
    cloth: u32,
    /// Where the cloth's are for pairs of each point, `[points]`.
    offsets: Vec<u32>,
    count: usize,
}

impl Slots {
    fn new(surface: &Surface) -> Self {
        let bodies = surface.bodies();
        let (cloth, all) = (bodies[0].points.end, bodies[bodies.len() - 1].points.end);
        let mut offsets = vec![0; cloth as usize];
        for (body, k) in bodies[1..].iter().zip(0..) {
            offsets.resize(body.points.end as usize, all + k * cloth);
        }
        Self {
            cloth,
            offsets,
            count: all as usize + (bodies.len() - 1) * cloth as usize,
        }
    }

    /// Number of lengths.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Where the corners of a pair have their lengths.
    #[must_use]
    #[inline]
    pub fn of(&self, pair: &Pair) -> [usize; 4] {
        // Of a pair with an obstacle one of these is its point, and has the larger number.
        let last = pair.corners[0].max(pair.corners[3]);
        let offset = self.offsets[last as usize];
        pair.corners.map(|p| self.at(p, offset))
    }

    #[inline]
    fn at(&self, p: u32, offset: u32) -> usize {
        let offset = if p < self.cloth { offset } else { 0 };
        (p + offset) as usize
    }

    /// Where point `p` has its length in this search.
    fn within(&self, search: usize, p: u32) -> usize {
        let offset = match search.checked_sub(1) {
            None => 0,
            Some(k) => self.offsets.len() as u32 + k as u32 * self.cloth,
        };
        self.at(p, offset)
    }
}

impl Candidates {
    /// No candidates yet, of a `surface` whose trees fit these `points` `[m]`, those at the begin of
    /// the scene. Where the cloth does
    /// not touch itself, its own pairs are left out.
    #[must_use]
    pub fn new(surface: &Surface, points: &[DVec3], touches_itself: bool) -> Self {
        let middle = |face: u32| {
            let corners = surface.faces()[face as usize];
            let sum: DVec3 = corners.iter().map(|p| points[*p as usize]).sum();
            sum / 3.0
        };
        let bodies = surface.bodies().iter();
        let layers: Vec<Layer> = bodies
            .map(|body| {
                let faces = body.faces.clone();
                Layer::new(body, Tree::new(faces.map(|f| (f, middle(f)))))
            })
            .collect();
        let (cloth, others) = (&layers[0], layers[1..].iter().cloned().map(Some));
        let others = std::iter::once(None).chain(others);
        Self {
            searches: others
                .map(|other| Search::new(cloth.clone(), other))
                .collect(),
            touches_itself,
            patches: None,
            released: Released::none(points),
            pairs: Vec::new(),
            runs: Vec::new(),
            numbers: Vec::new(),
            has_dropped: false,
            slots: Slots::new(surface),
            made: 0,
        }
    }

    /// The same, but pairs within a patch of the cloth that is too smooth to meet itself are left
    /// out. The cloth's faces have these `corners` in its pattern `[m]`, `[faces, 3]`. `[eq:patch]`
    #[must_use]
    pub fn with_pattern(mut self, surface: &Surface, corners: &[[DVec2; 3]]) -> Self {
        if self.touches_itself {
            let tree = self.searches[0].tree_mut();
            self.patches = Some(Patches::new(surface, corners, tree));
        }
        self
    }

    pub(crate) fn patches(&self) -> Option<&Patches> {
        self.patches.as_ref()
    }

    /// The trees of the bodies, cloth first, their nodes around the faces' `bounds`.
    pub(crate) fn trees_around(&self, bounds: impl Fn(u32) -> Bounds) -> Vec<Tree> {
        let searches = self.searches.iter();
        let mut trees: Vec<Tree> = searches.map(|s| s.layer().tree.clone()).collect();
        for tree in &mut trees {
            tree.refit(|face| (bounds(face).into(), true));
        }
        trees
    }

    pub(crate) fn touches_itself(&self) -> bool {
        self.touches_itself
    }

    /// The pairs. Their order depends on the surface and on the searches that were made.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Places of lengths that are kept for the points in the frames of the searches.
    #[must_use]
    pub fn slots(&self) -> &Slots {
        &self.slots
    }

    /// Number of searches that were made so far: each of the cloth with one body.
    #[must_use]
    pub fn made(&self) -> u64 {
        self.made
    }

    /// Leaves out the pairs of this contact from now on, and only these. The pairs there are hold
    /// nowhere.
    pub fn release(&mut self, released: &[ReleasedContact]) {
        self.released.take(released);
        self.clear();
    }

    /// Contact whose pairs are left out.
    #[must_use]
    pub fn released(&self) -> &Released {
        &self.released
    }

    /// Drops the pairs: they hold nowhere.
    pub fn clear(&mut self) {
        self.has_dropped = true;
        self.pairs.clear();
        self.numbers.clear();
        self.runs.clear();
        for search in &mut self.searches {
            search.state = State::Unknown;
        }
        if let Some(patches) = &mut self.patches {
            patches.clear();
        }
    }

    /// Takes `values`, one for each pair of the last call of this, to the pairs now; new ones get
    /// `new`. Returns true if pairs were dropped since, so that those that are left have other
    /// numbers.
    pub fn renumber<T: Copy>(&mut self, values: &mut Vec<T>, new: T) -> bool {
        let has_dropped = std::mem::take(&mut self.has_dropped);
        if has_dropped {
            let numbers = self.numbers.iter();
            let value = |number: &u32| values.get(*number as usize).copied().unwrap_or(new);
            *values = numbers.map(value).collect();
        } else {
            values.resize(self.pairs.len(), new);
        }
        self.numbers.clear();
        self.numbers.extend(0..self.pairs.len() as u32);
        has_dropped
    }

    /// Searches that are made, with their numbers.
    fn searches(&mut self) -> impl Iterator<Item = (usize, &mut Search)> {
        let first = usize::from(!self.touches_itself);
        self.searches.iter_mut().enumerate().skip(first)
    }

    /// Begins a way of the points at `from` `[m]`, `[points]`, with obstacles that are `rigid` as in
    /// [`Ways`]. Tells `gone`, by its slot, how far each point has gone since the last one began, in
    /// the frame of a search whose pairs there are.
    pub fn start(
        &mut self,
        from: &[DVec3],
        rigid: &[Option<Passage>],
        mut gone: impl FnMut(usize, f64),
    ) {
        let (first, slots) = (usize::from(!self.touches_itself), &self.slots);
        for (k, search) in self.searches.iter_mut().enumerate().skip(first) {
            let rigid = k
                .checked_sub(1)
                .and_then(|k| rigid.get(k).copied().flatten());
            search.start(from, rigid, |p, length| gone(slots.within(k, p), length));
        }
    }

    /// Returns true if no pair is missed while the points move from `from`, where their way was begun,
    /// to `to` `[m]`.
    #[must_use]
    pub fn cover(&mut self, from: &[DVec3], to: &[DVec3]) -> bool {
        for (_, search) in self.searches() {
            search.go(to);
        }
        if let Some(patches) = &mut self.patches {
            let own = &mut self.searches[0];
            own.holds = own.holds && patches.hold(from, to);
        }
        self.searches().all(|(_, search)| search.holds)
    }

    /// Part of a length in the frame of a search that it has in the world on the way, at least.
    #[must_use]
    pub fn shrink(&self) -> f64 {
        let all = self.searches.iter().map(Search::shrink);
        all.fold(1.0, f64::min)
    }

    /// Tells `gone`, by its slot, how far each point goes on its way in the frame of a search whose
    /// pairs there are.
    pub fn lengths(&self, mut gone: impl FnMut(usize, f64)) {
        for (k, search) in self.searches.iter().enumerate() {
            search.lengths(|p, length| gone(self.slots.within(k, p), length));
        }
    }

    /// Finds all pairs that could come nearer than `reach.gap` while no point strays further than
    /// `reach.slack` from the box around its path.
    pub fn find(&mut self, surface: &Surface, ways: Ways<'_>, reach: Reach) {
        self.start(ways.from, ways.rigid, |_, _| {});
        let _ = self.cover(ways.from, ways.to);
        self.find_all(surface, [ways.from, ways.to], reach);
    }

    /// As [`Self::find`], of the way from `ends[0]` to `ends[1]` `[m]` that [`Self::cover`] looked at.
    pub fn find_all(&mut self, surface: &Surface, ends: [&[DVec3]; 2], reach: Reach) {
        for (_, search) in self.searches() {
            (search.holds, search.state) = (false, State::Unknown);
        }
        self.renew(surface, ends, reach);
    }

    /// Makes the searches anew that do not hold for the way from `ends[0]` to `ends[1]` `[m]` that
    /// [`Self::cover`] looked at: all of one, or what it has of the points that leave their boxes.
    /// Pairs are dropped.
    pub fn renew(&mut self, surface: &Surface, ends: [&[DVec3]; 2], reach: Reach) {
        self.update(surface, ends, reach, false);
    }

    /// Adds the pairs that [`Self::find`] would find for points that go where they were not
    /// expected to go, from `ends[0]` to `ends[1]` `[m]`, as [`Self::cover`] looked at it. All pairs
    /// that there are stay, in their places.
    pub fn widen(&mut self, surface: &Surface, ends: [&[DVec3]; 2], reach: Reach) {
        self.update(surface, ends, reach, true);
    }

    fn update(&mut self, surface: &Surface, ends: [&[DVec3]; 2], reach: Reach, keep: bool) {
        for k in usize::from(!self.touches_itself)..self.searches.len() {
            let search = &mut self.searches[k];
            if search.holds {
                continue;
            }
            self.made += 1;
            let mut patches = self.patches.as_mut().filter(|_| k == 0);
            let is_partial = search.is_known() || keep && search.state == State::Near;
            if !is_partial {
                drop_pairs(self, k, |_, _| true);
                let (search, pairs) = (&mut self.searches[k], &mut self.pairs);
                let patches = self.patches.as_mut().filter(|_| k == 0);
                search.find(surface, reach, patches, ends, &self.released, pairs);
                self.note(k);
                continue;
            }
            search.follow(surface, reach, patches.as_deref_mut(), ends, keep);
            let mut listed = Vec::new();
            if keep {
                let runs = self.own_pairs(k);
                listed.extend(runs.filter(|pair| self.searches[k].has_moved(pair)));
                listed.sort_unstable();
            } else {
                drop_pairs(self, k, Search::has_moved);
            }
            let (search, pairs) = (&self.searches[k], &mut self.pairs);
            let patches = self.patches.as_ref().filter(|_| k == 0);
            search.find_moved(surface, patches, &self.released, &listed, pairs);
            self.note(k);
        }
    }

    /// The pairs of search `k`.
    fn own_pairs(&self, k: usize) -> impl Iterator<Item = Pair> {
        let mut rest = &self.pairs[..];
        let runs = self.runs.iter().map(move |(search, count)| {
            let (run, others) = rest.split_at(*count);
            rest = others;
            if *search == k { run } else { &[] }
        });
        runs.flatten().copied()
    }

    /// Notes that the pairs which have no number yet are of search `k`.
    fn note(&mut self, k: usize) {
        let new = self.pairs.len() - self.numbers.len();
        if new > 0 {
            match self.runs.last_mut() {
                Some((last, count)) if *last == k => *count += new,
                _ => self.runs.push((k, new)),
            }
            self.numbers.resize(self.pairs.len(), NONE);
        }
    }
}

/// Drops pairs of search `k`.
fn drop_pairs(all: &mut Candidates, k: usize, is_dropped: impl Fn(&Search, &Pair) -> bool) {
    let (mut from, mut to) = (0, 0);
    for (search, count) in &mut all.runs {
        let end = from + *count;
        for at in from..end {
            let pair = all.pairs[at];
            if *search == k && is_dropped(&all.searches[k], &pair) {
                *count -= 1;
                continue;
            }
            all.pairs[to] = pair;
            all.numbers[to] = all.numbers[at];
            to += 1;
        }
        from = end;
    }
    all.has_dropped |= to < all.pairs.len();
    all.pairs.truncate(to);
    all.numbers.truncate(to);
    all.runs.retain(|(_, count)| *count > 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest;
    use crate::pair::Kind;
    use glam::DQuat;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use selvedge_cloth::Obstacle;
    use selvedge_cloth::generate::square;

    /// All pairs without a common vertex, of the cloth with all.
    fn every_pair(surface: &Surface) -> Vec<Pair> {
        let bodies = surface.bodies();
        let (cloth, all) = (bodies[0].points.end, bodies[bodies.len() - 1].points.end);
        let mut pairs = Vec::new();
        for vertex in 0..all {
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

    /// A sheet of so many vertices, and three faces over six `corners` `[m]`, with all points.
    fn scene(vertices: usize, corners: Vec<DVec3>) -> (Surface, Vec<DVec3>) {
        let sheet = square(vertices, 1.0, 1).unwrap();
        let body = Obstacle::new("body", corners, vec![[0, 1, 2], [3, 4, 5], [1, 2, 3]]).unwrap();
        let mut start = sheet.mesh.positions().to_vec();
        start.extend(body.positions_at(0.0));
        let surface = Surface::new(sheet.mesh.topology(), std::slice::from_ref(&body));
        (surface, start)
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

    /// Asserts that `found`, in order, has all pairs that come nearer than `gap` `[m]` on the way
    /// between two states.
    fn assert_none_is_missed(every: &[Pair], found: &[Pair], way: [&[DVec3]; 2], gap: f64) {
        for pair in every {
            let [a, b] = way.map(|points| pair.places(points));
            let nearest = (0..=20)
                .map(|k| {
                    let part = f64::from(k) / 20.0;
                    let corners = std::array::from_fn(|c| a[c].lerp(b[c], part));
                    closest::gap(pair.kind, corners).distance
                })
                .fold(f64::INFINITY, f64::min);
            if nearest < gap {
                assert!(found.binary_search(pair).is_ok(), "{pair:?} at {nearest}");
            }
        }
    }

    #[test]
    fn no_near_pair_is_missed_none_comes_twice_and_a_wider_search_keeps_what_there_is() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut point =
            |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
        let (surface, start) = scene(36, (0..6).map(|_| point(0.7)).collect());
        let mut candidates = Candidates::new(&surface, &start, true);
        let reach = Reach {
            gap: 0.02,
            slack: 0.02,
            ahead: 0.0,
        };
        let every = every_pair(&surface);
        let in_order = |pairs: &[Pair]| {
            let mut found: Vec<Pair> = pairs.iter().map(ordered).collect();
            found.sort_unstable();
            found.dedup();
            assert!(found.len() == pairs.len() && found.len() < every.len());
            found
        };
        let mut added = 0;
        for _ in 0..20 {
            let crumpled = |p: &DVec3, by: DVec3| DVec3::new(0.0, p.y * 0.5, p.z * 0.5) + by;
            let from: Vec<DVec3> = start.iter().map(|p| crumpled(p, point(0.1))).collect();
            let to: Vec<DVec3> = from.iter().map(|p| *p + point(0.05)).collect();
            let ends = |to| [&from[..], to];
            let rigid = &[];
            candidates.find(
                &surface,
                Ways {
                    from: &from,
                    to: &to,
                    rigid,
                },
                reach,
            );
            let first = candidates.pairs().to_vec();
            // A path that strays less than the slack along each axis.
            let mut strayed = |from: &[DVec3]| from.iter().map(|p| *p + point(0.0199)).collect();
            let [begin, end]: [Vec<DVec3>; 2] = [strayed(&from), strayed(&to)];
            assert!(candidates.cover(&from, &to));
            assert_none_is_missed(&every, &in_order(&first), [&begin, &end], reach.gap);
            // Some points end elsewhere.
            let mut other = to.clone();
            for _ in 0..8 {
                other[(point(1.0).x.abs() * 41.0) as usize] += point(0.3);
            }
            assert!(!candidates.cover(&from, &other));
            candidates.widen(&surface, ends(&other), reach);
            assert!(candidates.cover(&from, &other) && candidates.cover(&from, &to));
            let pairs = candidates.pairs();
            assert_eq!(pairs[..first.len()], first);
            added += pairs.len() - first.len();
            let found = in_order(pairs);
            for end in [&to, &other] {
                assert_none_is_missed(&every, &found, [&from, end], reach.gap);
            }
            // Nothing new for points that stay within their boxes.
            candidates.widen(&surface, ends(&to), reach);
            assert_eq!(candidates.pairs().len(), found.len());
        }
        assert!(added > 1000, "{added}");
    }

    #[test]
    fn what_moves_as_a_whole_is_searched_once_and_no_near_pair_is_missed() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut point =
            |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
        let (surface, start) = scene(36, (0..6).map(|_| point(0.7)).collect());
        let cloth = surface.bodies()[0].points.end as usize;
        let every = every_pair(&surface);
        let reach = Reach {
            gap: 0.02,
            slack: 0.02,
            ahead: 0.05,
        };
        let crumpled: Vec<DVec3> = start.iter().map(|p| *p + point(0.1)).collect();
        // What all are at rest in falls fast and turns; the body is rigid, or said to deform.
        for (is_rigid, drift) in [(true, 0.0), (false, 0.0), (true, 0.004), (false, 0.004)] {
            let mut candidates = Candidates::new(&surface, &start, true);
            let place = |k: f64| {
                let turn = DQuat::from_scaled_axis(DVec3::new(0.05, 0.1, -0.03) * k);
                (turn, DVec3::new(0.4, -1.3 * k, 0.1 * k * k))
            };
            let mut own = crumpled.clone();
            own[cloth..].copy_from_slice(&start[cloth..]);
            let world = |own: &[DVec3], k: f64| -> Vec<DVec3> {
                let (turn, shift) = place(k);
                own.iter().map(|p| turn * *p + shift).collect()
            };
            let mut least = usize::MAX;
            for k in 0..40 {
                let k = f64::from(k);
                let mut next = own.clone();
                next[..cloth]
                    .iter_mut()
                    .for_each(|p| *p += point(1.0) * drift);
                let (from, to) = (world(&own, k), world(&next, k + 1.0));
                let passage = Passage::new(place(k), place(k + 1.0)).filter(|_| is_rigid);
                candidates.start(&from, &[passage], |_, _| {});
                if !candidates.cover(&from, &to) {
                    candidates.renew(&surface, [&from, &to], reach);
                }
                assert!(candidates.cover(&from, &to));
                let mut found: Vec<Pair> = candidates.pairs().iter().map(ordered).collect();
                found.sort_unstable();
                found.dedup();
                assert_eq!(found.len(), candidates.pairs().len());
                assert_none_is_missed(&every, &found, [&from, &to], reach.gap);
                least = least.min(found.len());
                own = next;
            }
            assert!(least > 10 && least < every.len() / 2, "{least}");
            // Two searches, each made once; what strays is looked at again.
            let made = candidates.made();
            assert_eq!(made == 2, drift == 0.0, "{made}");
        }
    }
}
