//! Cloth between two bodies, or two parts of one, that leave it no ccd: contact with the weaker is
//! released there, vertex by vertex, until the vertex is on its outer side again.
//!
//! The candidate search leaves the pairs of released contact out, so nothing else knows of it. Of
//! two bodies the upper is the weaker, so that cloth stays on what bears it; side by side the one
//! that moves faster against the other; else the later. What was released between the same two
//! before decides first. Inside the weaker body a vertex is pushed towards its outer side by a force
//! and at a speed that are bounded; so it also stays at the other body. Contact of the cloth with
//! itself is never released.

use glam::DVec3;
use selvedge_cloth::{ReleasedContact, Squeezed};
use selvedge_contact::{Bounds, Gap, Impact, Kind, Pair, Reach, Ways, gap, least_gap, winding};

use super::Contact;
use super::barrier::LEAST;
use super::collisions::{Collision, PairLaw};

/// Cosine against the direction of a gap within which a body is on one side of the cloth.
const OPPOSED: f64 = 0.5;
/// Pairs that are looked at, at most, of those that fail first: others may be well without them.
const FIRST: usize = 16;
/// Way of bodies in a solve, as a part of the thickness, from which they come nearer.
const CLOSING: f64 = 0.01;
/// Part of a corner in the closest point of a pair from which it is released.
const OWN_PART: f64 = 1.0 / 3.0;
/// Part of a closest point that handles hold, from which nothing else can yield.
const LED: f64 = 0.5;
/// Part of the distance from where a vertex was let in that a way out counts as longer.
const ASIDE: f64 = 0.5;
/// Difference of two speeds, as a part of the larger, from which one is the faster.
const FASTER: f64 = 0.1;

/// Released contact, and the frames at whose end it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YieldedContact {
    /// The contact.
    pub released: ReleasedContact,
    /// First and last frame.
    pub frames: [usize; 2],
}

/// The way of a vertex out of the body that it may pass, over a frame.
pub(super) struct WayOut {
    /// The vertex and the face through which it is to leave.
    pair: Pair,
    /// Their gap at the begin of the frame, its direction out of the body.
    gap: Gap,
}

/// Obstacles near pairs that failed.
struct Around {
    /// Their faces.
    faces: Vec<u32>,
    /// Their pairs with the vertices of the cloth that are in the pairs that failed.
    pairs: Vec<Pair>,
    /// Farthest that a face of an obstacle is looked for `[m]`.
    reach: f64,
}

/// A body on one side of a place in the cloth.
struct Side {
    body: usize,
    /// The nearest of its points.
    point: u32,
    /// Its place at the begin of the scene `[m]`.
    first: DVec3,
    /// Direction from it to the cloth.
    normal: DVec3,
    /// Distance `[m]`, and that at the end of the solve, were the cloth to stay.
    distance: f64,
    /// Way towards the cloth in the solve `[m]`.
    way: f64,
}

impl Contact {
    pub(crate) fn set_squeezed(&mut self, squeezed: Squeezed) {
        self.settings.squeezed = squeezed;
    }

    /// Releases contact of the pairs that failed where bodies squeeze them; `at_last` wherever they
    /// are of an obstacle. Returns true if some was released.
    pub(super) fn release_squeezed(&mut self, at_last: bool) -> bool {
        if self.settings.squeezed == Squeezed::Stop {
            return false;
        }
        let mut failed: Vec<_> = self.failed().map(|(pair, a)| (*pair, *a)).collect();
        failed.sort_by(|a, b| {
            let sooner = a.1.time.total_cmp(&b.1.time);
            sooner.then_with(|| a.0.cmp(&b.0))
        });
        failed.truncate(FIRST);
        let around = self.around_failed();
        let mut has_more = false;
        for (pair, impact) in &failed {
            let (first, second) = pair.corners.split_at(pair.kind.split());
            let released = self.candidates.released();
            if released.frees(&self.mesh, first, second) {
                continue;
            }
            let more = self.release_of(pair, impact, at_last, &around);
            if !more.is_empty() {
                self.memory.released.extend(more);
                self.candidates.release(&self.memory.released);
                has_more = true;
            }
        }
        self.memory.released = self.candidates.released().list().to_vec();
        has_more
    }

    /// What is to be released for a pair that failed.
    fn release_of(
        &self,
        pair: &Pair,
        impact: &Impact,
        at_last: bool,
        around: &Around,
    ) -> Vec<ReleasedContact> {
        let corners = pair.corners.into_iter().zip(impact.gap.weights);
        let (own, met): (Vec<_>, Vec<_>) =
            corners.partition(|(p, _)| (*p as usize) < self.mass.len());
        let held = own.iter().filter(|(p, _)| self.inverse[*p as usize] == 0.0);
        let led: f64 = held.map(|(_, weight)| weight.abs()).sum();
        let of = |weak: &Side, strong: Option<&Side>| self.newly_released(&own, weak, strong);
        // The body of the pair itself.
        let body = self.other_body(pair);
        let nearest = met.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let begin = self.candidates.released().first();
        let first = |(p, weight): &(u32, f64)| begin[*p as usize] * weight.abs();
        let whole = nearest.map(|(point, _)| Side {
            body,
            point: *point,
            first: met.iter().map(first).sum(),
            normal: DVec3::ZERO,
            distance: 0.0,
            way: 0.0,
        });
        let comes = met.iter().any(|(p, _)| {
            let way = self.start[*p as usize].distance(self.end[*p as usize]);
            way > CLOSING * self.bodies.thickness[body]
        });
        let found = match (self.sides(pair, impact, around), &whole) {
            ([a, b], Some(own)) if led >= LED && (at_last || comes) => {
                let other = [&a, &b].into_iter().flatten();
                let other = other.filter(|side| side.body != own.body);
                of(own, other.min_by(|a, b| a.distance.total_cmp(&b.distance)))
            }
            ([Some(a), Some(b)], _) if at_last || self.squeeze(&a, &b) => {
                if self.is_weaker(&a, &b) { of(&a, Some(&b)) } else { of(&b, Some(&a)) }
            }
            ([Some(one), _] | [_, Some(one)], None) if at_last => of(&one, None),
            _ => Vec::new(),
        };
        match &whole {
            Some(own) if at_last && found.is_empty() => of(own, None),
            _ => found,
        }
    }

    /// Contact with `weak` of the corners of the cloth, each with its weight, that are a large part of
    /// the closest point, where it is not released yet. `strong` presses them.
    fn newly_released(
        &self,
        corners: &[(u32, f64)],
        weak: &Side,
        strong: Option<&Side>,
    ) -> Vec<ReleasedContact> {
        let other = strong.unwrap_or(weak);
        let (body, against) = (weak.body as u32, strong.map_or(0, |side| side.body as u32));
        let parts = [weak, other].map(|side| self.mesh.part_of(side.point));
        let is_new = |vertex: u32| {
            self.memory.released.iter().all(|one| {
                let is_same = (one.parts, one.against) == (parts, against);
                let is_passed = one.body == body && self.passes(one, weak.point);
                one.vertex != vertex || !(is_same || is_passed)
            })
        };
        let own = corners.iter().map(|(vertex, part)| (*vertex, part.abs()));
        let new = own.filter(|(vertex, part)| *part >= OWN_PART && is_new(*vertex));
        new.map(|(vertex, _)| ReleasedContact {
            vertex,
            body,
            against,
            parts,
            places: [weak.first, other.first],
            winding: self.winding(weak.body, &self.start, self.start[vertex as usize]),
        })
        .collect()
    }

    /// Returns true if released contact lets its vertex pass this point.
    fn passes(&self, one: &ReleasedContact, point: u32) -> bool {
        let released = self.candidates.released();
        released.frees_point(&self.mesh, one, point)
    }

    fn around_failed(&self) -> Around {
        let cloth = self.mass.len() as u32;
        let around = |corners: &[u32]| {
            let points = corners.iter().map(|p| *p as usize);
            let points = points.map(|p| Bounds::of(self.start[p]).around(Bounds::of(self.end[p])));
            points.reduce(Bounds::around)
        };
        let all = self.failed().filter_map(|(pair, _)| around(&pair.corners));
        let ways = self.start.iter().zip(&self.end).skip(self.mass.len());
        let ways = ways.map(|(start, end)| start.distance(*end));
        let mut near = Around {
            faces: Vec::new(),
            pairs: Vec::new(),
            reach: self.largest_thickness() + ways.fold(0.0, f64::max),
        };
        let Some(all) = all.reduce(Bounds::around) else {
            return near;
        };
        let all = all.widened(near.reach);
        for number in self.mesh.bodies()[0].faces.end..self.mesh.faces().len() as u32 {
            let face = &self.mesh.faces()[number as usize];
            let own = around(face).map(|own| own.widened(self.mesh.radii()[face[0] as usize]));
            if own.is_some_and(|own| own.meets(&all)) {
                near.faces.push(number);
            }
        }
        let mut is_failed = vec![false; self.start.len()];
        for p in self.failed().flat_map(|(pair, _)| pair.corners) {
            is_failed[p as usize] = p < cloth;
        }
        let pairs = self.candidates.pairs().iter();
        let pairs = pairs.filter(|pair| pair.corners.iter().any(|p| is_failed[*p as usize]));
        let reach = near.reach;
        let comes_near = |pair: &&Pair| {
            [&self.start, &self.end].iter().any(|points| {
                least_gap(pair.kind, pair.places(points)) <= reach + self.mesh.radius_of(pair)
            })
        };
        near.pairs
            .extend(pairs.filter(|pair| self.other_body(pair) > 0 && comes_near(pair)));
        near
    }

    /// Names of the obstacles that squeeze the first pair that failed and is squeezed.
    pub(super) fn squeezers(&self) -> Vec<String> {
        let name = |side: &Side| self.bodies.obstacles[side.body - 1].name().to_owned();
        let around = self.around_failed();
        let squeezed = self.failed().find_map(|(pair, impact)| {
            let [Some(a), Some(b)] = self.sides(pair, impact, &around) else {
                return None;
            };
            let (a, b) = if a.body > b.body { (b, a) } else { (a, b) };
            self.squeeze(&a, &b).then(|| vec![name(&a), name(&b)])
        });
        let mut names = squeezed.unwrap_or_default();
        names.dedup();
        names
    }

    /// The nearest body on each side of where a pair fails, along the direction of its gap: of
    /// those near the place, and those that press on the edges and faces of its vertices, which may
    /// be coarser than the bodies.
    fn sides(&self, pair: &Pair, impact: &Impact, around: &Around) -> [Option<Side>; 2] {
        let cloth = self.mass.len() as u32;
        let then = |p: u32| self.start[p as usize].lerp(self.end[p as usize], impact.time);
        // The closest point of the feature that is the cloth's; of two, of the first.
        let of_cloth =
            if pair.corners[0] < cloth { 0..pair.kind.split() } else { pair.kind.split()..4 };
        let place: DVec3 = of_cloth
            .map(|k| then(pair.corners[k]) * impact.gap.weights[k].abs())
            .sum();
        let mut sides: [Option<Side>; 2] = [None, None];
        let mut look = |near: &Pair, places: [DVec3; 4]| {
            let Some(found) = self.side(near, places, place, impact, around.reach) else {
                return;
            };
            let side = &mut sides[usize::from(found.normal.dot(impact.gap.normal) < 0.0)];
            if side.as_ref().is_none_or(|s| found.distance < s.distance) {
                *side = Some(found);
            }
        };
        for number in &around.faces {
            let [a, b, c] = self.mesh.faces()[*number as usize];
            let places = [place, then(a), then(b), then(c)];
            look(&Pair::vertex_face(0, *number, [0, a, b, c]), places);
        }
        let own = |p: &u32| *p < cloth && pair.corners.contains(p);
        // A body is not on both sides of a face that it presses on.
        let part_of = |pair: &Pair| {
            let other = pair.corners.iter().find(|p| **p >= cloth);
            other.map(|p| self.mesh.part_of(*p))
        };
        let has_own = |near: &&Pair| near.corners.iter().any(own) && part_of(near) != part_of(pair);
        for near in around.pairs.iter().filter(has_own) {
            look(near, near.corners.map(then));
        }
        sides
    }

    /// The body of a pair at these `places`, if it is within `reach` of the cloth's `place` `[m]`
    /// where a pair fails with this `impact`, and on one side of it.
    fn side(
        &self,
        near: &Pair,
        places: [DVec3; 4],
        place: DVec3,
        impact: &Impact,
        reach: f64,
    ) -> Option<Side> {
        let Pair { kind, corners, .. } = *near;
        let radius = self.mesh.radius_of(near);
        if least_gap(kind, places) > reach + radius {
            return None;
        }
        let mut found = gap(kind, places);
        found.distance -= radius;
        let cloth = self.mass.len() as u32;
        let bodies = || (0..4).filter(|k| corners[*k] >= cloth);
        let weighted = |of: &dyn Fn(usize) -> DVec3| -> DVec3 {
            bodies().map(|k| of(k) * found.weights[k].abs()).sum()
        };
        // From the body to the cloth.
        let normal = if corners[3] >= cloth { found.normal } else { -found.normal };
        let is_beside = normal.dot(impact.gap.normal).abs() >= OPPOSED;
        let is_beyond = (place - weighted(&|k| places[k])).dot(normal) <= 0.0;
        if found.distance > reach || !is_beside || is_beyond {
            return None;
        }
        let point = |k: usize| corners[k] as usize;
        let left = 1.0 - impact.time;
        let way = weighted(&|k| (self.end[point(k)] - self.start[point(k)]) * left).dot(normal);
        let weight = |k: usize| found.weights[k].abs();
        let heaviest = bodies().max_by(|a, b| weight(*a).total_cmp(&weight(*b)));
        let nearest = corners[heaviest.unwrap_or(0)];
        let begin = self.candidates.released().first();
        Some(Side {
            body: self.mesh.body_of(nearest),
            point: nearest,
            first: weighted(&|k| begin[point(k)]),
            normal,
            distance: found.distance - way,
            way,
        })
    }

    /// Returns true if two bodies come nearer to each other than one layer needs. What stands still
    /// squeezes nothing: cloth that is drawn in between yields to shorter steps.
    fn squeeze(&self, a: &Side, b: &Side) -> bool {
        let need = 0.5 * (self.bodies.thickness[a.body] + self.bodies.thickness[b.body]);
        a.distance + b.distance < need && a.way + b.way > CLOSING * need
    }

    /// Returns true if the first of two bodies is the weaker.
    fn is_weaker(&self, a: &Side, b: &Side) -> bool {
        for one in &self.memory.released {
            let is_of = |weak: &Side, strong: &Side| {
                (one.body, one.against) == (weak.body as u32, strong.body as u32)
                    && self.passes(one, weak.point)
            };
            if is_of(a, b) || is_of(b, a) {
                return is_of(a, b);
            }
        }
        let falls = [a, b].map(|side| side.normal.dot(self.down));
        if falls[0].max(falls[1]) > OPPOSED && falls[0].min(falls[1]) < 0.0 {
            return falls[0] > falls[1];
        }
        if (a.way - b.way).abs() > FASTER * a.way.abs().max(b.way.abs()) {
            return a.way > b.way;
        }
        if a.body != b.body {
            return a.body > b.body;
        }
        let apart = a.first - b.first;
        apart[apart.abs().max_position()] > 0.0
    }

    /// Ends the release of contact whose vertices are on the outer side again, apart from the body
    /// by [`LEAST`] of the thickness with all that it frees. `positions` are those at the begin of
    /// the frame `[m]`, `[vertices]`.
    pub(crate) fn take_back(&mut self, positions: &[DVec3]) {
        self.ways_out.clear();
        if self.memory.released.is_empty() {
            return;
        }
        let points = [positions, &self.bodies.frame[0]].concat();
        let (free, mut kept): (Vec<_>, Vec<_>) = self.memory.released.iter().partition(|one| {
            let now = self.winding(one.body as usize, &points, points[one.vertex as usize]);
            (now - one.winding).abs() < 0.5
        });
        self.candidates.release(&kept);
        let mut is_near: Vec<[u32; 2]> = Vec::new();
        let mut note = |corners: &[u32]| {
            let body = corners.iter().map(|p| self.mesh.body_of(*p)).max();
            let body = body.unwrap_or(0) as u32;
            is_near.extend(corners.iter().map(|vertex| [*vertex, body]));
        };
        if !free.is_empty() {
            for found in self.candidates.intersections(&self.mesh, &points) {
                let [a, b] = found.faces.map(|face| self.mesh.faces()[face as usize]);
                note(&[a, b].concat());
            }
            let reach = Reach {
                gap: LEAST * self.largest_thickness(),
                slack: 0.0,
                own_slack: 0.0,
            };
            self.candidates
                .find(&self.mesh, Ways::still(&points), reach);
            for pair in self.candidates.pairs() {
                let body = self.other_body(pair);
                let distance =
                    gap(pair.kind, pair.places(&points)).distance - self.mesh.radius_of(pair);
                if body > 0 && distance < LEAST * self.bodies.thickness[body] {
                    note(&pair.corners);
                }
            }
        }
        is_near.sort_unstable();
        kept.extend(free.into_iter().filter(|one| {
            let own = [one.vertex, one.body];
            is_near.binary_search(&own).is_ok()
        }));
        self.candidates.release(&kept);
        self.memory.released = self.candidates.released().list().to_vec();
        let ways = self.memory.released.iter();
        self.ways_out = ways.filter_map(|one| self.way_out(one, &points)).collect();
    }

    /// The way out of a vertex, all points being at `points` `[m]`: to the nearest face, of which
    /// those count as farther that are far from where it was let in.
    fn way_out(&self, one: &ReleasedContact, points: &[DVec3]) -> Option<WayOut> {
        let (place, body) = (points[one.vertex as usize], one.body as usize);
        let first = self.candidates.released().first();
        let mut best = (f64::INFINITY, None);
        for number in self.mesh.bodies()[body].faces.clone() {
            let face = self.mesh.faces()[number as usize];
            let [a, b, c] = face.map(|p| points[p as usize]);
            let corners = [place, a, b, c];
            let is_passed = || face.iter().any(|p| self.passes(one, *p));
            if least_gap(Kind::VertexFace, corners) > best.0 || !is_passed() {
                continue;
            }
            let found = gap(Kind::VertexFace, corners);
            let there: DVec3 = (0..3)
                .map(|k| first[face[k] as usize] * -found.weights[k + 1])
                .sum();
            let far = found.distance + ASIDE * there.distance(one.places[0]);
            if far < best.0 {
                let [a, b, c] = face;
                let pair = Pair::vertex_face(one.vertex, number, [one.vertex, a, b, c]);
                best = (far, Some((pair, found)));
            }
        }
        let (pair, found) = best.1?;
        let is_round = self.mesh.radius_of(&pair) > 0.0;
        let is_within = !is_round && (self.winding(body, points, place) - one.winding).abs() >= 0.5;
        let sign = if is_within { -1.0 } else { 1.0 };
        Some(WayOut {
            pair,
            gap: Gap {
                normal: found.normal * sign,
                ..found
            },
        })
    }

    /// Pushes of vertices out of the bodies that they may pass.
    pub(super) fn push_out(&self) -> impl Iterator<Item = Collision> {
        self.ways_out.iter().filter_map(|way| {
            let WayOut { pair, gap } = way;
            let distance = self.gap_along(pair, gap, &self.start);
            let body = self.other_body(pair);
            let is_free = self.inverse[pair.first as usize] > 0.0;
            (is_free && distance < self.bodies.thickness[body]).then(|| {
                let collision = self.collision_of(pair, body, gap, distance, PairLaw::Out);
                Collision {
                    friction: 0.0,
                    anchored: None,
                    pull: DVec3::ZERO,
                    ..collision
                }
            })
        })
    }

    /// Times that a body winds around a place, its points at `points` `[m]`, `[points]`.
    fn winding(&self, body: usize, points: &[DVec3], place: DVec3) -> f64 {
        if self.bodies.obstacles[body - 1].core().is_some() {
            let first = self.mesh.bodies()[body].points.start;
            let [_, b, c] = self.mesh.faces()[self.mesh.bodies()[body].faces.start as usize];
            let [a, b, c] = [first, b, c].map(|p| points[p as usize]);
            let distance = gap(Kind::VertexFace, [place, a, b, c]).distance;
            return f64::from(u8::from(distance < self.mesh.radii()[first as usize]));
        }
        let faces = &self.mesh.bodies()[body].faces;
        let faces = &self.mesh.faces()[faces.start as usize..faces.end as usize];
        winding(place, faces.iter().map(|f| f.map(|p| points[p as usize])))
    }

    /// Notes what is released at the end of `frame`, in place of what was noted of it before.
    pub(crate) fn note_released(&mut self, frame: usize) {
        self.yielded.retain_mut(|one| {
            one.frames[1] = one.frames[1].min(frame.saturating_sub(1));
            one.frames[0] <= one.frames[1]
        });
        for released in &self.memory.released {
            let mut all = self.yielded.iter_mut();
            match all.find(|one| one.frames[1] + 1 == frame && one.released == *released) {
                Some(one) => one.frames[1] = frame,
                None => self.yielded.push(YieldedContact {
                    released: *released,
                    frames: [frame; 2],
                }),
            }
        }
    }
}
