//! Pairs that push in a substep: those nearer than the thickness, and those that would meet on
//! their way. Of several on the same side of a vertex or an edge the nearest pushes.

use std::collections::HashSet;

use glam::DVec3;
use selvedge_cloth::Scene;
use selvedge_contact::{Gap, Kind, Pair, Path, certify, gap};

use super::barrier::LEAST;
use super::clearances::Clearances;
use super::friction::{along_surface, kept};
use super::touches::{Touch, Touches};
use super::{Anchor, Contact, Key, key};
use crate::active_handles::ActiveHandles;

/// Cosine of two directions from which they count as the same side.
const SAME_SIDE: f64 = 0.7;
/// Sines of the angle that an edge's push may lean over a face beside it, and must keep from both
/// faces of one of the two edges.
const LEAN: f64 = 0.05;
const CONVEX: f64 = 0.01;

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
    fn gap(&self, pair: &Pair) -> f64 {
        gap(pair.kind, pair.places(&self.start)).distance
    }

    /// Returns true if an edge joins the two features.
    fn join(&self, pair: &Pair) -> bool {
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
    /// True if it pushes whatever else is near.
    is_caught: bool,
}

impl Contact {
    /// The touches of a solve, and their pairs.
    pub(super) fn find_touches(&mut self) -> (Touches, Vec<Key>) {
        let mut clearances = std::mem::take(&mut self.clearances);
        clearances.look_ahead(&self.start, &self.end);
        let mut near = self.near(&mut clearances);
        self.clearances = clearances;
        // The nearest first, in the order of the surface where two are as near.
        near.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let near = self.nearest(near);
        let mut set: Vec<Key> = near.iter().map(|near| key(&near.pair)).collect();
        set.sort_unstable();
        let mut list: Vec<Touch> = near.iter().map(|near| self.touch(near)).collect();
        list.sort_by_key(|touch| touch.corners);
        for touch in &mut list {
            self.leave_obstacles(touch);
        }
        (Touches { list }, set)
    }

    /// All pairs that are too near or will be.
    fn near(&self, clearances: &mut Clearances) -> Vec<Near> {
        let mut found = Vec::new();
        let most = self.largest_thickness();
        for (k, pair) in self.candidates.pairs().iter().enumerate() {
            if clearances.surely_apart(k, pair, most) {
                continue;
            }
            let body = self.other_body(pair);
            let thickness = self.thickness[body];
            let path = Path {
                from: pair.places(&self.start),
                to: pair.places(&self.end),
            };
            let now = gap(pair.kind, path.from);
            clearances.keep(k, pair, now.distance);
            if now.distance >= thickness && path.boxes_apart(pair.kind, thickness) {
                continue;
            }
            let near = if now.distance < thickness {
                Some(now)
            } else {
                let approach = certify(pair.kind, path, LEAST * thickness).err();
                approach.map(|approach| approach.gap)
            };
            let Some(gap) = near.filter(|gap| gap.normal != DVec3::ZERO) else {
                continue;
            };
            if body == 0
                && self.neighbours.join(pair)
                && self.neighbours.gap(pair) < 2.0 * thickness
            {
                continue;
            }
            let is_caught = self.memory.caught.binary_search(&key(pair)).is_ok();
            if pair.kind == Kind::EdgeEdge && !is_caught && !self.is_in_wedge(pair, &gap) {
                continue;
            }
            let distance = extent(&gap, path.from);
            let near = Near {
                pair: *pair,
                body,
                gap,
                distance,
                is_caught,
            };
            if distance > 0.0 && self.can_move(&near) {
                found.push(near);
            }
        }
        found
    }

    /// Returns true if the gap of two edges leaves both between their faces, and one of them is a
    /// fold towards the other. Elsewhere a vertex is as near.
    fn is_in_wedge(&self, pair: &Pair, gap: &Gap) -> bool {
        let inner = |w: f64| (1e-4..=1.0 - 1e-4).contains(&w.abs());
        if !gap.weights.iter().all(|w| inner(*w)) {
            return false;
        }
        let lean = |edge: u32, towards: DVec3| {
            let edge = self.surface.edges()[edge as usize];
            let [a, b] = edge.ends.map(|p| self.start[p as usize]);
            let along = (b - a).normalize_or_zero();
            let wings = edge.wings.iter().flatten().map(|wing| {
                let arm = self.start[*wing as usize] - a;
                let arm = (arm - along * along.dot(arm)).normalize_or_zero();
                arm.dot(towards)
            });
            wings.fold(f64::NEG_INFINITY, f64::max)
        };
        let leans = [lean(pair.first, -gap.normal), lean(pair.second, gap.normal)];
        leans.iter().all(|lean| *lean <= LEAN) && leans.iter().any(|lean| *lean <= -CONVEX)
    }

    /// Of pairs from near to far, those on whose side of their vertex or edge no other has pushed.
    fn nearest(&self, near: Vec<Near>) -> Vec<Near> {
        let mut sides: Vec<Vec<DVec3>> = vec![Vec::new(); self.start.len()];
        let mut edges: std::collections::HashMap<u32, Vec<DVec3>> =
            std::collections::HashMap::new();
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
                Kind::EdgeEdge => {
                    let ends = [(near.pair.first, normal), (near.pair.second, -normal)];
                    let new = ends.iter().any(|(edge, normal)| {
                        edges.get(edge).is_none_or(|taken| is_new(taken, *normal))
                    });
                    if new {
                        for (edge, normal) in ends {
                            edges.entry(edge).or_default().push(normal);
                        }
                    }
                    new
                }
            };
            if is_kept || near.is_caught {
                kept.push(near);
            }
        }
        kept
    }

    fn touch(&self, near: &Near) -> Touch {
        let Near {
            pair,
            body,
            gap,
            distance,
            ..
        } = near;
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
        Touch {
            corners: pair.corners,
            weights: gap.weights,
            normal: gap.normal,
            gap: *distance,
            thickness: self.thickness[*body],
            mean_mass: weighted / squares,
            mass: 1.0 / inverse,
            base,
            drift,
            friction: self.friction[*body],
            body: (pair.kind == Kind::VertexFace).then_some(*body as u32),
            pull: self.pull(pair, *body, gap.normal),
            at: None,
            response: super::touches::Response::default(),
        }
    }

    /// Lets pairs that failed push in the next solve, harder than in the last. Returns false if
    /// none of them can.
    pub(super) fn catch(&mut self, touches: &mut Touches) -> bool {
        let (mut caught, mut new) = (false, Vec::new());
        let count = touches.list.len();
        for (pair, approach) in self.failed() {
            let gap = approach.gap;
            let distance = extent(&gap, pair.places(&self.start));
            let missed = extent(&gap, pair.places(&self.end));
            if gap.normal == DVec3::ZERO || distance <= 0.0 || missed >= distance {
                continue;
            }
            let near = Near {
                pair: *pair,
                body: self.other_body(pair),
                gap,
                distance,
                is_caught: true,
            };
            if !self.can_move(&near) {
                continue;
            }
            let mut touch = self.touch(&near);
            self.leave_obstacles(&mut touch);
            caught = true;
            let known = touches.list[..count].binary_search_by_key(&pair.corners, |t| t.corners);
            match known {
                Ok(k) => {
                    let last = touches.list[k].response.tangent.gap;
                    touch.at = Some(0.5 * last.min(0.5 * touch.thickness));
                    touches.list[k] = touch;
                }
                Err(_) => {
                    touch.at = Some(distance.min(LEAST * touch.thickness));
                    touches.list.push(touch);
                    new.push(key(pair));
                }
            }
        }
        touches.list.sort_by_key(|touch| touch.corners);
        for list in [&mut self.memory.caught, &mut self.memory.set] {
            list.extend(&new);
            list.sort_unstable();
            list.dedup();
        }
        caught
    }

    /// Returns true if a push moves something.
    fn can_move(&self, near: &Near) -> bool {
        let corners = near.pair.corners.iter().zip(near.gap.weights);
        let mut corners = corners.map(|(p, weight)| weight.abs() * self.inverse[*p as usize]);
        corners.any(|mobility| mobility > 0.0)
    }

    /// Drops the weights of obstacles, which the system does not have.
    fn leave_obstacles(&self, touch: &mut Touch) {
        for (corner, weight) in touch.corners.iter().zip(&mut touch.weights) {
            if *corner as usize >= self.mass.len() {
                *weight = 0.0;
            }
        }
    }

    /// Pull that the anchor of a pair has left `[N]`.
    fn pull(&self, pair: &Pair, body: usize, normal: DVec3) -> DVec3 {
        if pair.kind == Kind::EdgeEdge {
            return DVec3::ZERO;
        }
        let anchors = &self.memory.anchors;
        let first = anchors.partition_point(|anchor| anchor.vertex < pair.first);
        let own = anchors[first..]
            .iter()
            .take_while(|a| a.vertex == pair.first);
        let mut same = own.filter(|a| a.body as usize == body && a.normal.dot(normal) > SAME_SIDE);
        same.next()
            .map_or(DVec3::ZERO, |anchor| along_surface(normal, anchor.pull))
    }

    /// Takes the anchors from what touched in the last solve, at its end, which is this `part` of
    /// what was solved.
    pub(super) fn remember(&mut self, part: f64, active: &mut ActiveHandles) {
        let mut anchors: Vec<Anchor> = Vec::new();
        for touch in &active.system.touches.list {
            let Some(body) = touch.body else {
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
            anchors.push(Anchor {
                vertex: touch.corners[0],
                body,
                normal: touch.normal,
                pull: kept(slip, grip, most) * grip,
            });
        }
        anchors.sort_by_key(|anchor| anchor.vertex);
        self.memory.anchors = anchors;
        active.system.touches.list.clear();
    }
}

/// Distance of two features along the direction of `gap`, at these places of their corners `[m]`.
fn extent(gap: &Gap, corners: [DVec3; 4]) -> f64 {
    let corners = corners.iter().zip(gap.weights);
    corners
        .map(|(corner, weight)| weight * gap.normal.dot(*corner))
        .sum()
}
