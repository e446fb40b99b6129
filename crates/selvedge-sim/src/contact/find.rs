//! Pairs that push in a substep: those nearer than the thickness, and those that would meet on
//! their way. Of several on the same side of a vertex the nearest pushes.

use std::collections::HashSet;

use glam::DVec3;
use selvedge_cloth::{CaughtPair, FrictionAnchor, Pushing, Scene, Touching};
use selvedge_contact::{Gap, Kind, Pair, Path, certify, gap, least_gap};

use super::arcsim;
use super::barrier::LEAST;
use super::friction::{along_surface, kept};
use super::memory::{self, feature, key};
use super::touches::{PairLaw, Touch, Touches};
use super::{Contact, Found};
use crate::active_handles::ActiveHandles;
use crate::threads::Threads;

/// Cosine of two directions from which they count as the same side.
const SAME_SIDE: f64 = 0.7;
/// Part of the push at no gap that a pair bears firmly: at 0.9 of the thickness.
const FIRM: f64 = 0.01;
/// Depth of a fold at the nearer end of two edges that cross, as a part of the thickness, from
/// which they push in full.
const BULGE: f64 = 0.5;
/// Sine of the angle of two edges from which they push in full.
const PARALLEL: f64 = 0.1;
/// Sine of the angle by which an edge's push may lean over a face beside it.
const LEAN: f64 = 0.05;

/// Pairs that a vertex of the cloth meets first, of which each is caught. With one of them cloth
/// that folds has more to repeat; with four, or all, cloth that lies crumpled.
const EARLIEST: usize = 2;

/// Vertices that are joined by an edge of the cloth, and where they start `[m]`.
pub(super) struct Neighbours {
    joined: HashSet<[u32; 2]>,
    start: Vec<DVec3>,
}

impl Neighbours {
    pub(super) fn new(scene: &Scene) -> Self {
        let edges = scene.mesh.topology().edges().iter();
        let ends = edges.map(|edge| edge.vertices.map(|v| v.0));
        Self {
            joined: ends.map(|[a, b]| [a.min(b), a.max(b)]).collect(),
            start: scene.mesh.positions().to_vec(),
        }
    }

    /// Gap of two features of the cloth at the start `[m]`.
    pub(super) fn gap(&self, pair: &Pair) -> f64 {
        gap(pair.kind, pair.places(&self.start)).distance
    }

    /// Returns true if an edge joins the two features.
    pub(super) fn join(&self, pair: &Pair) -> bool {
        let (first, second) = pair.corners.split_at(pair.kind.split());
        let joined = |a: u32, b: u32| self.joined.contains(&[a.min(b), a.max(b)]);
        first.iter().any(|a| second.iter().any(|b| joined(*a, *b)))
    }
}

/// A pair that may push.
struct Near {
    pair: Pair,
    body: usize,
    gap: Gap,
    /// Distance along the gap's direction at the start `[m]`.
    distance: f64,
    /// Part of the barrier's stiffness that it has, above 0.
    share: f64,
    /// What is known if a solve caught it: it pushes whatever else is near.
    caught: Option<CaughtPair>,
}

impl Contact {
    /// The touches of a solve over `time` `[s]`.
    pub(super) fn find_touches(&mut self, threads: Threads, time: f64) -> Found {
        let _span = tracing::trace_span!("touches").entered();
        if let Some(law) = &self.arcsim {
            return self.find_as_arcsim(law, time);
        }
        self.look_ahead();
        let mut budgets = std::mem::take(&mut self.clearances.budgets);
        let mut near = self.near(threads, &mut budgets);
        self.clearances.budgets = budgets;
        near.sort_by(|a, b| {
            let nearer = a.distance.total_cmp(&b.distance);
            nearer.then_with(|| key(&a.pair).cmp(&key(&b.pair)))
        });
        let near = self.nearest(near);
        let mut set: Vec<Touching> = near.iter().map(|near| key(&near.pair)).collect();
        set.sort_unstable();
        let mut list: Vec<Touch> = near.iter().map(|near| self.touch(near)).collect();
        list.extend(self.push_out());
        list.sort_by_key(|touch| touch.corners);
        for touch in &mut list {
            self.leave_obstacles(touch);
        }
        let mut pushing: Vec<Pushing> = near.iter().map(|near| self.pushing(near)).collect();
        memory::sort(&mut pushing);
        let exact = false;
        Found {
            touches: Touches { list, exact, time },
            set,
            pushing,
        }
    }

    /// As [`Self::find_touches`], of ARCSim's law.
    fn find_as_arcsim(&self, law: &arcsim::Law, time: f64) -> Found {
        let nearest = law.nearest(&arcsim::Bodies {
            surface: &self.surface,
            places: &self.start,
            pairs: self.candidates.pairs(),
            thickness: &self.thickness,
        });
        let mut set: Vec<Touching> = nearest.iter().map(|near| key(&near.pair)).collect();
        set.sort_unstable();
        let mut list = Vec::new();
        for arcsim::Nearby {
            pair,
            gap,
            stiffness,
        } in nearest
        {
            let body = self.other_body(&pair);
            if gap.distance < self.thickness[body] {
                let law = PairLaw::Arcsim { stiffness };
                let mut touch = self.touch_of(&pair, body, &gap, gap.distance, law);
                (touch.anchored, touch.pull) = (None, DVec3::ZERO);
                self.leave_obstacles(&mut touch);
                list.push(touch);
            }
        }
        list.sort_by_key(|touch| touch.corners);
        let exact = true;
        Found {
            touches: Touches { list, exact, time },
            set,
            pushing: Vec::new(),
        }
    }

    /// The feature of `near` that pushes.
    fn pushing(&self, near: &Near) -> Pushing {
        let expected = extent(&near.gap, near.pair.places(&self.end));
        let least = near.distance.min(expected) / self.thickness[near.body];
        let depth = (1.0 - least).max(0.0);
        Pushing {
            of: feature(&near.pair, near.body),
            firmly: near.share * depth * depth > FIRM,
        }
    }

    /// All pairs that are too near or will be. Takes the `budgets` of the candidates and computes
    /// those that are used up anew.
    fn near(&self, threads: Threads, budgets: &mut [f64]) -> Vec<Near> {
        let pairs = self.candidates.pairs();
        threads.find(budgets, |k, budget| self.near_pair(&pairs[k], budget))
    }

    /// The pair, if it is too near or will be.
    #[inline]
    fn near_pair(&self, pair: &Pair, budget: &mut f64) -> Option<Near> {
        let (most, clearances) = (self.largest_thickness(), &self.clearances);
        if clearances.surely_apart(*budget, pair, most) {
            return None;
        }
        let approach = clearances.approach(pair);
        if clearances.at_start(*budget, pair) - approach > most {
            return None;
        }
        // What is far needs no closest point.
        let least = least_gap(pair.kind, pair.places(&self.start));
        *budget = clearances.budget(pair, least);
        if least - approach > most {
            return None;
        }
        let body = self.other_body(pair);
        let thickness = self.thickness[body];
        let path = Path {
            from: pair.places(&self.start),
            to: pair.places(&self.end),
        };
        let axes = path.axes_gap(pair.kind);
        if axes > most {
            return None;
        }
        let now = gap(pair.kind, path.from);
        *budget = clearances.budget(pair, now.distance);
        if now.distance - approach > most {
            return None;
        }
        if now.distance >= thickness && axes > thickness {
            return None;
        }
        let gap = meeting(pair.kind, path, now, thickness)?;
        if body == 0 && self.neighbours.join(pair) && self.neighbours.gap(pair) < 2.0 * thickness {
            return None;
        }
        let caught = memory::caught(&self.memory.caught, key(pair));
        let share = match pair.kind {
            Kind::EdgeEdge if caught.is_none() => self.share(pair, &gap, thickness),
            _ => 1.0,
        };
        let near = Near {
            pair: *pair,
            body,
            gap,
            distance: extent(&gap, path.from),
            share,
            caught,
        };
        (share > 0.0 && near.distance > 0.0 && self.can_move(&near)).then_some(near)
    }

    /// Part of the barrier's stiffness that two edges have: none where a vertex is about as near.
    /// All of it where they cross, the gap leaves both between their faces, and one of them is a
    /// fold towards the other, by which it is nearer to the middle of the other than to its ends;
    /// or both are boundaries, off their ends. It grows evenly: a push that began at once would
    /// keep a cloth at rest trembling, and what trembles has more friction than its load.
    /// `[eq:contact-edges]`
    fn share(&self, pair: &Pair, gap: &Gap, thickness: f64) -> f64 {
        let [a, b, c, d] = pair.places(&self.start);
        let (along, across) = (b - a, d - c);
        // From the gap to the nearest end.
        let [w0, w1, w2, w3] = gap.weights.map(f64::abs);
        let away = (along.length() * w0.min(w1)).min(across.length() * w2.min(w3));
        if away <= 1e-3 * thickness {
            return 0.0;
        }
        let sine = along.cross(across).length() / (along.length() * across.length());
        let leans = [
            self.lean(pair.first, -gap.normal),
            self.lean(pair.second, gap.normal),
        ];
        let ends = |edge: u32| self.surface.edges()[edge as usize].wings[1].is_none();
        let bulge = match ends(pair.first) && ends(pair.second) {
            true => away,
            false => -leans[0].min(leans[1]) * away,
        };
        [
            bulge / (BULGE * thickness),
            sine / PARALLEL,
            1.0 - leans[0].max(leans[1]) / LEAN,
        ]
        .into_iter()
        .map(|part| part.clamp(0.0, 1.0))
        .product()
    }

    /// Sine of the angle by which the faces beside an edge lean towards a direction; negative where
    /// both lean away from it.
    fn lean(&self, edge: u32, towards: DVec3) -> f64 {
        let edge = self.surface.edges()[edge as usize];
        let [a, b] = edge.ends.map(|p| self.start[p as usize]);
        let along = (b - a).normalize_or_zero();
        let wings = edge.wings.iter().flatten().map(|wing| {
            let arm = self.start[*wing as usize] - a;
            let arm = (arm - along * along.dot(arm)).normalize_or_zero();
            arm.dot(towards)
        });
        wings.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Of pairs from near to far, all edges, and the vertices on whose side no other has pushed.
    fn nearest(&self, near: Vec<Near>) -> Vec<Near> {
        let mut sides: Vec<Vec<DVec3>> = vec![Vec::new(); self.start.len()];
        let is_new =
            |taken: &[DVec3], normal: DVec3| taken.iter().all(|n| n.dot(normal) < SAME_SIDE);
        let mut kept = Vec::new();
        for near in near {
            let normal = near.gap.normal;
            let is_kept = match near.pair.kind {
                Kind::VertexFace => {
                    let taken = &mut sides[near.pair.first as usize];
                    let new = is_new(taken, normal);
                    if new {
                        taken.push(normal);
                    }
                    new
                }
                Kind::EdgeEdge => true,
            };
            if is_kept || near.caught.is_some() {
                kept.push(near);
            }
        }
        kept
    }

    fn touch(&self, near: &Near) -> Touch {
        let law = PairLaw::Barrier { share: near.share };
        let touch = self.touch_of(&near.pair, near.body, &near.gap, near.distance, law);
        let gap = near.caught.and_then(|caught| caught.gap);
        let at = gap.map(|gap| gap.min(near.distance));
        Touch { at, ..touch }
    }

    /// A pair that pushes at `distance` `[m]` along the direction of `gap`.
    pub(super) fn touch_of(
        &self,
        pair: &Pair,
        body: usize,
        gap: &Gap,
        distance: f64,
        law: PairLaw,
    ) -> Touch {
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
        let own = feature(pair, body);
        Touch {
            pair: key(pair),
            corners: pair.corners,
            weights: gap.weights,
            normal: gap.normal,
            gap: distance,
            thickness: self.thickness[body],
            law,
            mean_mass: weighted / squares,
            mass: 1.0 / inverse,
            base,
            drift,
            friction: self.friction[body],
            is_within: false,
            anchored: Some(own),
            pull: self.pull(own, gap.normal),
            at: None,
            response: super::touches::Response::default(),
        }
    }

    /// Drops the touches that pulled in the last solve, whose ends are certified or not. Returns
    /// true if there were some.
    pub(super) fn release(&mut self, touches: &mut Touches) -> bool {
        let count = touches.list.len();
        let (end, caught) = (&self.end, &mut self.memory.caught);
        touches.list.retain(|touch| {
            let pulls = touch.pulls(|v| end[v]);
            if pulls && touch.at.is_some() {
                caught.retain(|caught| caught.of != touch.pair);
            }
            !pulls
        });
        touches.list.len() < count
    }

    /// Lets pairs that failed push in the next solve, harder than in the last. Returns false if
    /// none of them can.
    ///
    /// A way that goes deep fails with all that lies on it, of which most would never meet if the
    /// first did not. So a pair is caught if it is among the [`EARLIEST`] of a vertex of the cloth.
    /// What was caught before and pulls is let go.
    pub(super) fn catch(&mut self, touches: &mut Touches) -> bool {
        let (mut caught, mut pushing) = (Vec::new(), Vec::new());
        let mut met = vec![0; self.mass.len()];
        let count = touches.list.len();
        let mut failed: Vec<_> = self.failed().collect();
        failed.sort_by(|a, b| a.1.safe.total_cmp(&b.1.safe));
        for (pair, approach) in failed {
            if !is_early(pair, &approach.gap, &mut met) {
                continue;
            }
            let place = touches.list[..count].binary_search_by_key(&pair.corners, |t| t.corners);
            let known = place.ok().map(|k| &touches.list[k]);
            let Some((near, touch)) = self.caught(pair, approach.gap, known) else {
                continue;
            };
            caught.extend(near.caught);
            match place {
                Ok(k) => touches.list[k] = touch,
                Err(_) => {
                    touches.list.push(touch);
                    pushing.push(self.pushing(&near));
                }
            }
        }
        touches.list.sort_by_key(|touch| touch.corners);
        let has_caught = !caught.is_empty();
        memory::catch(&mut self.memory.caught, caught);
        self.memory.pushing.extend(pushing);
        memory::sort(&mut self.memory.pushing);
        has_caught
    }

    /// A pair with this `gap` that a solve has missed, and its touch for the next one, which pushes
    /// harder than the `known` one of the last. None where that is in vain.
    fn caught(&self, pair: &Pair, gap: Gap, known: Option<&Touch>) -> Option<(Near, Touch)> {
        let distance = extent(&gap, pair.places(&self.start));
        let missed = extent(&gap, pair.places(&self.end));
        if gap.normal == DVec3::ZERO || distance <= 0.0 || missed >= distance {
            return None;
        }
        let body = self.other_body(pair);
        let thickness = self.thickness[body];
        let at = match known {
            Some(touch) => 0.5 * touch.response.tangent.gap.min(0.5 * thickness),
            None => distance.min(LEAST * thickness),
        };
        let of = key(pair);
        let once_more = known.is_some() && memory::caught(&self.memory.caught, of).is_some();
        let near = Near {
            pair: *pair,
            body,
            gap,
            distance,
            share: 1.0,
            caught: Some(CaughtPair {
                of,
                gap: once_more.then_some(at),
            }),
        };
        if !self.can_move(&near) {
            return None;
        }
        let mut touch = self.touch(&near);
        touch.at = Some(at);
        self.leave_obstacles(&mut touch);
        Some((near, touch))
    }

    /// Returns true if a push moves something.
    fn can_move(&self, near: &Near) -> bool {
        let corners = near.pair.corners.iter().zip(near.gap.weights);
        let mut corners = corners.map(|(p, weight)| weight.abs() * self.inverse[*p as usize]);
        corners.any(|mobility| mobility > 0.0)
    }

    /// Drops the weights of obstacles, which the system does not have.
    pub(super) fn leave_obstacles(&self, touch: &mut Touch) {
        for (corner, weight) in touch.corners.iter().zip(&mut touch.weights) {
            if *corner as usize >= self.mass.len() {
                *weight = 0.0;
                touch.is_within = true;
            }
        }
    }

    /// Pull that the anchor of a feature has left on this side `[N]`.
    fn pull(&self, of: Touching, normal: DVec3) -> DVec3 {
        let anchors = &self.memory.anchors;
        let first = anchors.partition_point(|anchor| anchor.of < of);
        let mut own = anchors[first..].iter().take_while(|a| a.of == of);
        own.find(|anchor| anchor.normal.dot(normal) > SAME_SIDE)
            .map_or(DVec3::ZERO, |anchor| along_surface(normal, anchor.pull))
    }

    /// Takes the anchors from what touched in the last solve, at its end, which is this `part` of
    /// what was solved.
    pub(super) fn remember(&mut self, part: f64, active: &mut ActiveHandles) {
        let mut anchors: Vec<FrictionAnchor> = Vec::new();
        for touch in &active.system.touches.list {
            let Some(of) = touch.anchored else {
                continue;
            };
            let displacement = touch.displacement(|v| self.end[v]) - touch.drift * (1.0 - part);
            let gap = touch.gap + touch.normal.dot(displacement);
            let most = touch.friction * touch.response.tangent.force_at(gap).max(0.0);
            let grip = touch.response.grip;
            if most <= 0.0 {
                continue;
            }
            let slip = along_surface(touch.normal, touch.pull / grip + displacement);
            anchors.push(FrictionAnchor {
                of,
                normal: touch.normal,
                pull: kept(slip, grip, most) * grip,
            });
        }
        anchors.sort_by_key(|anchor| anchor.of);
        self.memory.anchors = anchors;
        active.system.touches.list.clear();
    }
}

/// Gap in which a pair pushes that is `now` this far apart: this one where it is less than
/// `thickness` `[m]`, or the one at which the pair would meet on its `path`. None where it does
/// not.
fn meeting(kind: Kind, path: Path, now: Gap, thickness: f64) -> Option<Gap> {
    let near = if now.distance < thickness {
        Some(now)
    } else {
        let approach = certify(kind, path, LEAST * thickness).err();
        approach.map(|approach| approach.gap)
    };
    near.filter(|gap| gap.normal != DVec3::ZERO)
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

/// Distance of two features along the direction of `gap`, at these places of their corners `[m]`.
fn extent(gap: &Gap, corners: [DVec3; 4]) -> f64 {
    let corners = corners.iter().zip(gap.weights);
    corners
        .map(|(corner, weight)| weight * gap.normal.dot(*corner))
        .sum()
}
