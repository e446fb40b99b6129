//! Pairs that are too near at the start of a solve, or will be on their way: the narrow phase.
//!
//! Candidates are looked at in three passes, of which each leaves few to the next: boxes around their
//! ways, budgets that tell that a pair is apart, and closest points, of eight pairs of one kind at a time.

use glam::DVec3;
use selvedge_cloth::CaughtPair;
use selvedge_contact::number::{GROUP, Vector, of_lane};
use selvedge_contact::{Gap, Gaps, Kind, Pair, Path, certify, gaps, weights};

use super::Contact;
use super::barrier::LEAST;
use super::collisions::Met;
use super::distance_cache::{PairCache, Pushes};
use super::memory::{self, key};
use super::real::Real;
use crate::threads::Threads;

/// Depth of a fold at the nearer end of two edges that cross, as a part of the thickness, from
/// which they push in full.
const BULGE: f64 = 0.5;
/// The same that what is between vertices may be nearer to a round body than they, without a push.
const SLIGHT: f64 = 0.25;
/// Sine of the angle of two edges from which they push in full.
const PARALLEL: f64 = 0.1;
/// Sine of the angle by which an edge's push may lean over a face beside it.
const LEAN: f64 = 0.05;

/// A pair that may push.
pub(super) struct ClosePair {
    pub(super) pair: Pair,
    pub(super) body: usize,
    pub(super) gap: Gap,
    /// Distance along the gap's direction at the start `[m]`.
    pub(super) distance: f64,
    /// Part of the barrier's stiffness that it has, above 0.
    pub(super) share: f64,
    pub(super) met: Met,
    /// What is known if a solve caught it: it pushes whatever else is near.
    pub(super) caught: Option<CaughtPair>,
}

/// Candidates that follow each other, and what is known of them.
struct Part<'a> {
    /// Place of the first.
    first: usize,
    pairs: &'a [Pair],
    cached: &'a mut [PairCache],
}

/// Corners of eight pairs, of which `of` gives that of a lane; the first where there are fewer.
pub(super) fn corners_of<'a>(count: usize, of: impl Fn(usize) -> &'a Pair) -> [[u32; 4]; GROUP] {
    std::array::from_fn(|lane| of(if lane < count { lane } else { 0 }).corners)
}

impl Contact {
    /// All pairs that are too near or will be. Takes the budgets of the candidates and computes
    /// those that are used up anew; keeps the directions of gaps, along which most pairs will be
    /// certified.
    pub(super) fn narrow_phase(&mut self, threads: Threads) -> Vec<ClosePair> {
        let mut cached = std::mem::take(&mut self.cache.pairs);
        let mut open = std::mem::take(&mut self.cache.open);
        let ways = [&self.start[..], &self.end[..]];
        self.cache
            .swept
            .take(&self.mesh, ways, self.bodies.most, false);
        self.candidates.open(&self.cache.swept, |_| true, &mut open);
        let near = threads.find_in_pieces(&open, &mut cached, |first, open, cached, near| {
            let pairs = &self.candidates.pairs()[first..first + cached.len()];
            let part = Part {
                first,
                pairs,
                cached,
            };
            self.narrow_phase_of(open, part, near);
        });
        self.cache.pairs = cached;
        self.cache.open = open;
        near
    }

    /// The same of a part, of which the candidates at the `open` places are looked at.
    fn narrow_phase_of(&self, open: &[u32], mut part: Part<'_>, near: &mut Vec<ClosePair>) {
        let mut of_kinds: [Vec<u32>; 2] = [const { Vec::new() }; 2];
        for k in open.iter().map(|k| k - part.first as u32) {
            let (pair, cache) = (&part.pairs[k as usize], &part.cached[k as usize]);
            let path_lengths = self.path_lengths_of(part.first + k as usize);
            let is_apart = path_lengths.surely_apart(cache.budget, pair, self.bodies.most);
            if cache.pushes != Pushes::Never && !is_apart {
                of_kinds[pair.kind as usize].push(k);
            }
        }
        for (kind, open) in [Kind::VertexFace, Kind::EdgeEdge].into_iter().zip(of_kinds) {
            for group in open.chunks(GROUP) {
                let corners = corners_of(group.len(), |lane| &part.pairs[group[lane] as usize]);
                let gaps = gaps(kind, &corners, &self.start);
                for (lane, k) in group.iter().enumerate() {
                    near.extend(self.close_pair(*k as usize, &gaps, lane, &mut part));
                }
            }
        }
    }

    /// The pair, if it is too near or will be; its gap is that of this `lane`.
    fn close_pair(
        &self,
        k: usize,
        gaps: &Gaps,
        lane: usize,
        part: &mut Part<'_>,
    ) -> Option<ClosePair> {
        let path_lengths = self.path_lengths_of(part.first + k);
        let (pair, cache) = (&part.pairs[k], &mut part.cached[k]);
        let radius = self.mesh.radius_of(pair);
        let now = Gap {
            distance: gaps.distance[lane] - radius,
            normal: DVec3::from_array(of_lane(&gaps.normal, lane)),
            weights: of_lane(&gaps.weights, lane),
        };
        cache.budget = path_lengths.budget(pair, now.distance);
        let known = cache.in_solve(self.ccd.solve);
        (known.direction, known.extent) = (now.normal, gaps.extent[lane] - radius);
        let body = self.other_body(pair);
        let thickness = self.bodies.thickness[body];
        let path = Path {
            from: pair.places(&self.start),
            to: pair.places(&self.end),
        };
        let is_far = || {
            now.distance - path_lengths.approach(pair) > self.bodies.most
                || path.axes_gap(pair.kind) - radius > thickness
        };
        if now.distance >= thickness && is_far() {
            return None;
        }
        let of = key(pair);
        let caught = memory::caught(&self.memory.caught, of);
        let is_at_end = || now.weights.contains(&0.0);
        // What a vertex of the cloth does as well.
        let is_of_edges = pair.kind == Kind::EdgeEdge || self.is_of_core(pair);
        if is_of_edges && now.distance < thickness && caught.is_none() && is_at_end() {
            return None;
        }
        let (gap, met) = meeting(pair.kind, path, now, thickness, radius)?;
        let pushes = &mut cache.pushes;
        if *pushes == Pushes::Unknown {
            let never = body == 0 && self.neighbours.leave_out(pair, 2.0 * thickness);
            *pushes = if never { Pushes::Never } else { Pushes::Always };
        }
        if *pushes == Pushes::Never {
            return None;
        }
        let share = match pair.kind {
            _ if caught.is_some() => 1.0,
            _ if radius > 0.0 && is_of_edges => self.share_of_round(pair, thickness),
            Kind::EdgeEdge => self.share(pair, &gap, thickness),
            Kind::VertexFace => 1.0,
        };
        let near = ClosePair {
            pair: *pair,
            body,
            gap,
            distance: self.gap_along(pair, &gap, &self.start),
            share,
            met,
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
        let wings = self
            .wings(pair)
            .map(|wings| wings.map(|wing| wing.map(|p| self.start[p])));
        edge_share::<f64>(
            pair.places(&self.start),
            wings,
            gap.weights,
            gap.normal,
            thickness,
        )
    }

    /// The vertices beside the edges of a pair, of faces that have them.
    pub(super) fn wings(&self, pair: &Pair) -> [[Option<usize>; 2]; 2] {
        let wings = |edge: u32| self.mesh.edges()[edge as usize].wings;
        [pair.first, pair.second].map(|edge| wings(edge).map(|wing| wing.map(|p| p as usize)))
    }

    /// Returns true if a pair is a core's point with a face of the cloth.
    pub(super) fn is_of_core(&self, pair: &Pair) -> bool {
        pair.kind == Kind::VertexFace && self.mesh.radii()[pair.first as usize] > 0.0
    }

    /// Part of the barrier's stiffness that the middle of an edge or a face has against a round body: it
    /// grows with how much nearer the middle is than the ends, whose vertices push as well.
    fn share_of_round(&self, pair: &Pair, thickness: f64) -> f64 {
        round_share::<f64>(pair.kind, pair.places(&self.start), thickness)
    }
}

/// Distance of the features of a pair with these `corners`.
pub(super) fn distance<N: Real>(kind: Kind, corners: [N::Vector; 4]) -> N {
    let [a, b, c, d] = corners;
    let [w0, w1, w2, w3] = weights::<N>(kind, corners);
    let between = a * w0 + b * w1 + c * w2 + d * w3;
    between.dot(between).sqrt()
}

/// The `share_of_round` of a pair with these `corners`.
pub(super) fn round_share<N: Real>(kind: Kind, corners: [N::Vector; 4], thickness: f64) -> N {
    let split = kind.split();
    let (own, core) = match kind {
        Kind::VertexFace => (&corners[split..], [corners[0]; 3]),
        Kind::EdgeEdge => (&corners[..split], [corners[2], corners[3], corners[3]]),
    };
    let [a, b, c] = core;
    let ends = own
        .iter()
        .map(|end| distance::<N>(Kind::VertexFace, [*end, a, b, c]));
    let all = distance::<N>(kind, corners);
    let nearer = ends.fold(all.same(f64::INFINITY), N::smaller) - all;
    let share = (nearer / all.same(thickness) - SLIGHT) / all.same(BULGE);
    share.at_least(0.0).at_most(1.0)
}

/// The `share` of a pair of edges with these `corners`, beside which stand these `wings`.
pub(super) fn edge_share<N: Real>(
    corners: [N::Vector; 4],
    wings: [[Option<N::Vector>; 2]; 2],
    weights: [N; 4],
    normal: N::Vector,
    thickness: f64,
) -> N {
    let [a, b, c, d] = corners;
    let (along, across) = (b - a, d - c);
    let length = |vector: N::Vector| -> N { vector.dot(vector).sqrt() };
    // From the gap to the nearest end.
    let [w0, w1, w2, w3] = weights.map(N::abs);
    let nearest = [
        length(along) * w0.smaller(w1),
        length(across) * w2.smaller(w3),
    ];
    let away = nearest[0].smaller(nearest[1]);
    if away.within(away.same(1e-3 * thickness)) {
        return away.same(0.0);
    }
    let sine = length(along.cross(across)) / (length(along) * length(across));
    let leans = [
        lean::<N>(a, along, wings[0], -normal),
        lean::<N>(c, across, wings[1], normal),
    ];
    let is_free = wings.iter().all(|wings| wings[1].is_none());
    let bulge = if is_free { away } else { -leans[0].smaller(leans[1]) * away };
    let most = leans[0].greater(leans[1]);
    let parts = [
        bulge / away.same(BULGE * thickness),
        sine / away.same(PARALLEL),
        away.same(1.0) - most / away.same(LEAN),
    ];
    let [bulge, sine, lean] = parts.map(|part| part.at_least(0.0).at_most(1.0));
    bulge * sine * lean
}

/// Sine of the angle by which the faces beside an edge lean towards a direction; negative where
/// both lean away from it.
fn lean<N: Real>(
    a: N::Vector,
    edge: N::Vector,
    wings: [Option<N::Vector>; 2],
    towards: N::Vector,
) -> N {
    let unit = |vector: N::Vector| {
        let square: N = vector.dot(vector);
        let length = square.sqrt();
        let is_known = length.same(0.0).below(length);
        let inverse = if is_known { length.same(1.0) / length } else { length };
        vector * inverse
    };
    let along = unit(edge);
    let wings = wings.into_iter().flatten().map(|wing| {
        let arm = wing - a;
        unit(arm - along * along.dot(arm)).dot(towards)
    });
    let least = edge.components()[0].same(f64::NEG_INFINITY);
    wings.fold(least, N::greater)
}

/// Gap in which a pair pushes that is `now` this far apart: this one where it is less than
/// `thickness` `[m]`, or the one at which the pair, one of a round body of this `radius` `[m]`, would meet on
/// its `path`. None where it does not.
fn meeting(kind: Kind, path: Path, now: Gap, thickness: f64, radius: f64) -> Option<(Gap, Met)> {
    let near = if now.distance < thickness {
        Some((now, Met::Start))
    } else {
        let impact = certify(kind, path, LEAST * thickness + radius).err();
        impact.map(|impact| (impact.gap, Met::Ahead))
    };
    near.filter(|(gap, _)| gap.normal != DVec3::ZERO)
}
