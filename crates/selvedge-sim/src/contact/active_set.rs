//! Pairs that push in a substep: those nearer than the thickness, and those that would meet on
//! their way. Of several on the same side of a vertex the nearest pushes.

use glam::DVec3;
use selvedge_cloth::{CaughtPair, FrictionAnchor, Pushing, Scene, Touching};
use selvedge_contact::{Gap, Impact, Kind, Pair, gap};

use super::barrier::LEAST;
use super::collisions::{Collision, Collisions, Met, PairLaw, Sticking};
use super::friction::{along_surface, kept};
use super::memory::{self, feature, key};
use super::narrow_phase::ClosePair;
use super::pressure::UNPRESSED;
use super::{ActiveSet, Contact};
use crate::active_handles::ActiveHandles;
use crate::lists::Lists;
use crate::threads::Threads;

/// Cosine of two directions from which they count as the same side.
const SAME_SIDE: f64 = 0.7;
/// Part of the push at no gap that a pair bears firmly: at 0.9 of the thickness.
const FIRM: f64 = 0.01;
/// Pairs that a vertex of the cloth meets first, of which each is caught. With one of them cloth
/// that folds has more to repeat; with four, or all, cloth that lies crumpled.
const EARLIEST: usize = 2;

/// Vertices that are joined by an edge of the cloth, and where they start `[m]`.
pub(super) struct Neighbours {
    joined: Lists,
    start: Vec<DVec3>,
}

impl Neighbours {
    pub(super) fn new(scene: &Scene) -> Self {
        let edges = scene.mesh.topology().edges().iter();
        let ends = edges.map(|edge| edge.vertices.map(|v| v.0));
        let both: Vec<_> = ends.flat_map(|[a, b]| [(a, b), (b, a)]).collect();
        let start = scene.mesh.positions().to_vec();
        Self {
            joined: Lists::group(start.len(), &both),
            start,
        }
    }

    /// Returns true if an edge joins the two features.
    pub(super) fn join(&self, pair: &Pair) -> bool {
        let (first, second) = pair.corners.split_at(pair.kind.split());
        let mut joined = first.iter().flat_map(|a| self.joined.of(*a as usize));
        joined.any(|b| second.contains(b))
    }

    /// Returns true if two features of the cloth never push: an edge joins them, and they start
    /// nearer than this `distance` `[m]`.
    pub(super) fn leave_out(&self, pair: &Pair, distance: f64) -> bool {
        self.join(pair) && gap(pair.kind, pair.places(&self.start)).distance < distance
    }
}

impl Contact {
    /// The collisions of a solve over `time` `[s]`, in the order of their corners.
    pub(super) fn find_active_set(&mut self, threads: Threads, time: f64) -> ActiveSet {
        let _span = tracing::trace_span!("collisions").entered();
        self.look_ahead();
        let near = self.narrow_phase(threads);
        let kept = self.nearest(&near);
        let near = || kept.iter().map(|k| &near[*k as usize]);
        self.squeeze.see(near());
        self.memory.caught.clear();
        self.memory
            .caught
            .extend(near().filter_map(|near| near.caught));
        self.memory.caught.sort_by_key(|caught| caught.of);
        let mut pushing: Vec<Pushing> = near().map(|near| self.pushing(near)).collect();
        memory::sort(&mut pushing);
        let mut list: Vec<Collision> = near().map(|near| self.collision(near)).collect();
        list.extend(self.push_out());
        if list.len() > kept.len() {
            list.sort_by_key(|collision| collision.corners);
        }
        for collision in &mut list {
            self.leave_obstacles(collision);
        }
        ActiveSet {
            collisions: Collisions {
                sorted: list.len(),
                list,
                expected: Vec::new(),
                time,
            },
            pushing,
        }
    }

    /// The feature of `near` that pushes.
    fn pushing(&self, near: &ClosePair) -> Pushing {
        let expected = self.gap_along(&near.pair, &near.gap, &self.end);
        let least = near.distance.min(expected) / self.bodies.thickness[near.body];
        let depth = (1.0 - least).max(0.0);
        Pushing {
            of: feature(&near.pair, near.body, self.is_of_core(&near.pair)),
            firmly: near.share * depth * depth > FIRM,
        }
    }

    /// Of these pairs all edges and, from near to far, the vertices on whose side no other has pushed;
    /// and what was caught. Their numbers, in the order of their corners.
    fn nearest(&self, near: &[ClosePair]) -> Vec<u32> {
        let mut kept = Vec::with_capacity(near.len());
        let mut vertices = Vec::with_capacity(near.len());
        for (k, one) in (0..).zip(near) {
            match one.pair.kind {
                Kind::VertexFace if self.is_of_core(&one.pair) => kept.push(k),
                Kind::VertexFace => vertices.push((one.pair.first, one.distance, k)),
                Kind::EdgeEdge => kept.push(k),
            }
        }
        vertices.sort_unstable_by(|(a, nearer, k), (b, farther, l)| {
            let face = |k: u32| near[k as usize].pair.second;
            let sides = a.cmp(b).then_with(|| nearer.total_cmp(farther));
            sides.then_with(|| face(*k).cmp(&face(*l)))
        });
        let mut taken: Vec<DVec3> = Vec::new();
        let mut before = None;
        for (vertex, _, k) in vertices {
            if before.replace(vertex) != Some(vertex) {
                taken.clear();
            }
            let normal = near[k as usize].gap.normal;
            let is_new = taken.iter().all(|n| n.dot(normal) < SAME_SIDE);
            if is_new {
                taken.push(normal);
            }
            if is_new || near[k as usize].caught.is_some() {
                kept.push(k);
            }
        }
        kept.sort_unstable_by_key(|k| {
            let pair = &near[*k as usize].pair;
            (pair.corners, pair.kind)
        });
        kept
    }

    fn collision(&self, near: &ClosePair) -> Collision {
        let law = PairLaw::Barrier { share: near.share };
        let collision = self.collision_of(&near.pair, near.body, &near.gap, near.distance, law);
        let gap = near.caught.and_then(|caught| caught.gap);
        // Where the fabric has lifted the pair, that tangent of the barrier would pull.
        let pulls = |gap: &f64| near.distance > gap * (1.5 - 0.5 * gap / collision.thickness);
        let gap = gap.filter(|gap| !(collision.pressure.bears_slowly() && pulls(gap)));
        let at = gap.map(|gap| gap.min(near.distance));
        Collision {
            at,
            met: near.met,
            ..collision
        }
    }

    /// A pair that pushes at `distance` `[m]` along the direction of `gap`.
    pub(super) fn collision_of(
        &self,
        pair: &Pair,
        body: usize,
        gap: &Gap,
        distance: f64,
        law: PairLaw,
    ) -> Collision {
        let (mut squares, mut weighted, mut inverse) = (0.0, 0.0, 0.0);
        let (mut base, mut drift) = (DVec3::ZERO, DVec3::ZERO);
        for (corner, weight) in pair.corners.iter().zip(gap.weights) {
            let p = *corner as usize;
            let square = weight * weight;
            if self.inverse[p] > 0.0 {
                squares += square;
                weighted += square / self.inverse[p];
                inverse += square * self.inverse[p];
            }
            if p < self.mass.len() {
                base += self.start[p] * weight;
            } else {
                drift += (self.end[p] - self.start[p]) * weight;
            }
        }
        drift += self.turned(pair, body, gap.normal);
        let is_of_core = self.is_of_core(pair);
        let own = feature(pair, body, is_of_core);
        let anchor = self.anchor(own, gap.normal);
        let mean_mass = weighted / squares;
        let squeeze = &self.squeeze;
        let pressure = squeeze.push(pair, body, is_of_core, mean_mass, gap.normal);
        Collision {
            pair: key(pair),
            corners: pair.corners,
            weights: gap.weights,
            normal: gap.normal,
            gap: distance,
            thickness: self.bodies.thickness[body],
            law,
            pressure: pressure.with(anchor.map_or(UNPRESSED, |anchor| anchor.pressed)),
            mean_mass,
            mass: 1.0 / inverse,
            base,
            drift,
            friction: self.bodies.friction[body],
            is_within: false,
            is_of_core,
            anchored: Some(own),
            pull: anchor.map_or(DVec3::ZERO, |a| along_surface(gap.normal, a.pull)),
            sticking: Sticking::Unknown,
            met: Met::Start,
            at: None,
            response: super::collisions::Response::default(),
        }
    }

    /// Drops the collisions that pulled in the last solve, whose ends are certified or not. Returns
    /// true if there were some.
    pub(super) fn release(&mut self, collisions: &mut Collisions) -> bool {
        let sorted = collisions.sorted;
        let mut place = 0;
        let some_pull = self.forget_pulling(collisions) > 0;
        let end = &self.end;
        collisions.list.retain(|collision| {
            let pulls = collision.pulls(|v| end[v]);
            collisions.sorted -= usize::from(pulls && place < sorted);
            place += 1;
            !pulls
        });
        some_pull
    }

    /// Forgets that solves missed the collisions that pulled in the last one. Gives the number of those that
    /// pulled.
    pub(super) fn forget_pulling(&mut self, collisions: &Collisions) -> usize {
        let (end, caught) = (&self.end, &mut self.memory.caught);
        let all = collisions.list.iter();
        let pulling = all.filter(|collision| collision.pulls(|v| end[v]));
        let forget = |collision: &Collision| {
            let known = caught.binary_search_by_key(&collision.pair, |caught| caught.of);
            if let (Some(_), Ok(place)) = (collision.at, known) {
                caught.remove(place);
            }
        };
        pulling.map(forget).count()
    }

    /// Lets pairs that failed push in the next solve, harder than in the last. Returns false if
    /// none of them can.
    ///
    /// A way that goes deep fails with all that lies on it, of which most would never meet if the
    /// first did not. So a pair is caught if it is among the [`EARLIEST`] of a vertex of the cloth.
    /// What was caught before and pulls is let go.
    pub(super) fn catch(&mut self, collisions: &mut Collisions) -> bool {
        let (mut caught, mut pushing) = (Vec::new(), Vec::new());
        let mut met = vec![0; self.mass.len()];
        let (count, sorted) = (collisions.list.len(), collisions.sorted);
        let mut failed: Vec<_> = self.failed().collect();
        failed.sort_by(|a, b| a.1.time.total_cmp(&b.1.time));
        for (pair, impact) in failed {
            // What a vertex of the cloth does as well.
            let zeros = impact.gap.weights.iter().filter(|weight| **weight == 0.0);
            let is_again = self.is_of_core(pair) && zeros.count() > 1;
            if is_again || !is_early(pair, &impact.gap, &mut met) {
                continue;
            }
            let of = key(pair);
            let first = collisions.list[..sorted].partition_point(|t| t.corners < pair.corners);
            let same = collisions.list[first..sorted].iter();
            let last = first + same.take_while(|t| t.corners == pair.corners).count();
            let is_same = |k: &usize| collisions.list[*k].is_same_place(of, &impact.gap);
            let place = (first..last).chain(sorted..count).find(is_same);
            let known = place.map(|k| &collisions.list[k]);
            let Some((near, collision)) = self.caught(pair, impact, known) else {
                continue;
            };
            caught.extend(near.caught);
            match place {
                Some(k) => collisions.list[k] = collision,
                None => {
                    collisions.list.push(collision);
                    pushing.push(self.pushing(&near));
                }
            }
        }
        let has_caught = !caught.is_empty();
        memory::catch(&mut self.memory.caught, caught);
        self.memory.pushing.extend(pushing);
        memory::sort(&mut self.memory.pushing);
        has_caught
    }

    /// A pair with this `impact` that a solve has missed, and its touch for the next one, which pushes
    /// harder than the `known` one of the last. None where that is in vain.
    fn caught(
        &self,
        pair: &Pair,
        impact: &Impact,
        known: Option<&Collision>,
    ) -> Option<(ClosePair, Collision)> {
        let gap = impact.gap;
        let distance = self.gap_along(pair, &gap, &self.start);
        let missed = self.gap_along(pair, &gap, &self.end);
        if gap.normal == DVec3::ZERO || distance <= 0.0 || missed >= distance {
            return None;
        }
        let body = self.other_body(pair);
        let thickness = self.bodies.thickness[body];
        let at = match known {
            Some(collision) => 0.5 * collision.response.tangent.gap.min(0.5 * thickness),
            None => distance.min(LEAST * thickness),
        };
        let of = key(pair);
        let once_more = known.is_some() && memory::caught(&self.memory.caught, of).is_some();
        let near = ClosePair {
            pair: *pair,
            body,
            gap,
            distance,
            share: 1.0,
            met: Met::Solve,
            caught: Some(CaughtPair {
                of,
                gap: once_more.then_some(at),
            }),
        };
        if !self.can_move(&near) {
            return None;
        }
        let mut collision = self.collision(&near);
        collision.at = Some(at);
        self.leave_obstacles(&mut collision);
        Some((near, collision))
    }

    /// Returns true if a push moves something.
    pub(super) fn can_move(&self, near: &ClosePair) -> bool {
        let corners = near.pair.corners.iter().zip(near.gap.weights);
        let mut corners = corners.map(|(p, weight)| weight.abs() * self.inverse[*p as usize]);
        corners.any(|mobility| mobility > 0.0)
    }

    /// Drops the weights of obstacles, which the system does not have.
    pub(super) fn leave_obstacles(&self, collision: &mut Collision) {
        for (corner, weight) in collision.corners.iter().zip(&mut collision.weights) {
            if *corner as usize >= self.mass.len() {
                *weight = 0.0;
                collision.is_within = true;
            }
        }
    }

    /// The anchor of a feature on this side.
    pub(super) fn anchor(&self, of: Touching, normal: DVec3) -> Option<&FrictionAnchor> {
        let anchors = &self.memory.anchors;
        let first = anchors.partition_point(|anchor| anchor.of < of);
        let mut own = anchors[first..].iter().take_while(|a| a.of == of);
        own.find(|anchor| anchor.normal.dot(normal) > SAME_SIDE)
    }

    /// Takes the anchors from what touched in the last solve, at its end, which is this `part` of
    /// what was solved.
    pub(super) fn remember(&mut self, part: f64, active: &mut ActiveHandles) {
        let mut anchors: Vec<FrictionAnchor> = Vec::new();
        for collision in &active.system.collisions.list {
            let Some(of) = collision.anchored else {
                continue;
            };
            let displacement =
                collision.displacement(|v| self.end[v]) - collision.drift * (1.0 - part);
            let gap = collision.gap + collision.normal.dot(displacement);
            let most = collision.friction * collision.response.tangent.force_at(gap).max(0.0);
            let grip = collision.response.grip;
            let time = part * active.system.collisions.time;
            let opened = collision.normal.dot(displacement);
            let (ways, thickness) = ([displacement.length(), opened], collision.thickness);
            let pressed = collision.pressure.pressed_after(time, ways, gap, thickness);
            if most <= 0.0 && pressed <= UNPRESSED {
                continue;
            }
            let slip = along_surface(collision.normal, collision.pull / grip + displacement);
            anchors.push(FrictionAnchor {
                of,
                normal: collision.normal,
                pull: kept(slip, grip, most) * grip,
                pressed,
            });
        }
        anchors.sort_by_key(|anchor| anchor.of);
        self.memory.anchors = anchors;
        active.system.collisions.list.clear();
    }
}

/// Returns true if a pair that meets now is among the [`EARLIEST`] of a vertex of the cloth, of
/// which `met` counts what they have met, `[vertices]`.
fn is_early(pair: &Pair, gap: &Gap, met: &mut [usize]) -> bool {
    let mut is_early = false;
    for (corner, weight) in pair.corners.iter().zip(gap.weights) {
        if let Some(met) = met.get_mut(*corner as usize).filter(|_| weight != 0.0) {
            is_early |= *met < EARLIEST;
            *met += 1;
        }
    }
    is_early
}
