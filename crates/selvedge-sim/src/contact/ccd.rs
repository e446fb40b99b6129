//! Continuous collision detection: certificates that every pair stays apart on its way in a solve, and the
//! time of impact of each that has none.

use glam::DVec3;
use selvedge_cloth::{Squeezed, StepError};
use selvedge_contact::{
    CollisionMesh, Impact, Pair, Path, Straight, SweptBoxes, certify_straight, certify_turning,
    extent, least_gap,
};

use super::distance_cache::{Certificate, against};
use super::{Contact, ContactCounts};
use crate::threads::Threads;

/// Rounding of a gap that may get lost where a pair starts below the floor.
const ROUNDING: f64 = 1.0 - 1e-6;
/// A pair that one direction does not certify.
enum Ccd {
    /// It is safe all the same.
    Subdivided,
    Failed(Pair, Impact, f64),
}

/// The pair that was safe for the shortest part.
#[derive(Clone, Debug)]
pub(super) struct EarliestImpact {
    pub(super) pair: Pair,
    pub(super) gap: f64,
    pub(super) part: f64,
}

/// Lists that are kept from round to round and from substep to substep.
#[derive(Default)]
pub(super) struct CcdState {
    /// Number of the solve.
    pub(super) solve: u32,
    /// Boxes around the ways in the solve.
    swept: SweptBoxes,
    /// Ends of the points when the first pair of the solve was certified `[m]`, `[points]`; empty
    /// before.
    ends: Vec<DVec3>,
    /// Way of each point from there to the last certificates `[m]`, `[points]`.
    moved_since: Vec<DVec3>,
    /// Points that moved since the last certificates, and faces that have such a corner.
    has_moved: Vec<bool>,
    moved_faces: Vec<bool>,
    /// Pairs that failed, with the gap that each must keep `[m]`, in the order of [`by_place`].
    pub(super) failed: Vec<(Pair, Impact, f64)>,
    pub(super) earliest: Option<EarliestImpact>,
    /// Ends of the points in the round that was safe for the longest part `[m]`, `[points]`.
    pub(super) best: Vec<DVec3>,
}

/// The order in which pairs are pushed, which depends on the pairs alone: those of a vertex with a
/// face stand beside those of the edges there. Chosen by trial, among six orders, for the pinched
/// table-cloths (`assets/scenes/contact`), which stop more often where all of one kind come first.
fn by_place(pair: &Pair) -> ([u32; 4], Pair) {
    let mut corners = pair.corners;
    corners.sort_unstable();
    (corners, *pair)
}

impl CcdState {
    /// Forgets all certificates: points start elsewhere.
    pub(super) fn begin(&mut self) {
        self.ends.clear();
        self.solve = self.solve.wrapping_add(1);
    }

    /// Takes new `ends` of all points `[m]`.
    fn take(&mut self, ends: &[DVec3]) {
        if self.ends.is_empty() {
            self.ends.extend_from_slice(ends);
        }
        let moved_since = self.ends.iter().zip(ends).map(|(a, b)| *b - *a);
        self.moved_since.clear();
        self.moved_since.extend(moved_since);
    }

    /// Takes the faces of points that moved.
    fn mark_moved_faces(&mut self, mesh: &CollisionMesh) {
        let is_moved = |face: &[u32; 3]| face.iter().any(|p| self.has_moved[*p as usize]);
        self.moved_faces.clear();
        let faces = mesh.faces().iter();
        self.moved_faces.extend(faces.map(is_moved));
    }

    /// Lists the pairs that failed, and the one that was safe for the shortest part.
    fn list_failed(&mut self, mesh: &CollisionMesh, found: Vec<Ccd>) {
        self.failed.clear();
        self.failed
            .extend(found.into_iter().filter_map(|found| match found {
                Ccd::Subdivided => None,
                Ccd::Failed(pair, impact, floor) => Some((pair, impact, floor)),
            }));
        self.failed
            .sort_unstable_by_key(|(pair, ..)| by_place(pair));
        let least = |a: &&(Pair, Impact, f64), b: &&(Pair, Impact, f64)| {
            let sooner = a.1.time.total_cmp(&b.1.time);
            sooner.then_with(|| a.0.cmp(&b.0))
        };
        let earliest = self.failed.iter().min_by(least);
        self.earliest = earliest.map(|(pair, impact, _)| EarliestImpact {
            pair: *pair,
            gap: impact.gap.distance - mesh.radius_of(pair),
            part: impact.time,
        });
    }
}

impl ContactCounts {
    /// Counts the first certificates of `pairs` after a solve.
    fn count(&mut self, pairs: usize, found: &[Ccd]) {
        let halved = |found: &&Ccd| matches!(found, Ccd::Subdivided);
        let halved = found.iter().filter(halved).count();
        self.certified += (pairs - found.len()) as u64;
        self.halved += halved as u64;
        self.uncertified += (found.len() - halved) as u64;
    }
}

impl Contact {
    /// The pair that is safe for the shortest part, which cannot be kept apart.
    pub(crate) fn unseparated(&self) -> StepError {
        let earliest = self.ccd.earliest.as_ref();
        StepError::Contact {
            frame: self.next_frame,
            pair: earliest.map_or_else(
                || "the cloth and what it moves through".to_owned(),
                |earliest| self.name(&earliest.pair),
            ),
            gap: earliest.map_or(0.0, |earliest| earliest.gap),
            squeezed_by: self.squeezers(),
            may_yield: self.settings.squeezed == Squeezed::Stop,
        }
    }

    /// Certifies all candidates on their way to `end` `[m]`, `[vertices]`, the end of a solve.
    /// Returns true if none fails.
    pub(super) fn is_collision_free(&mut self, threads: Threads, end: &[DVec3]) -> bool {
        self.end[..end.len()].copy_from_slice(end);
        self.ccd.has_moved.clear();
        self.ccd.has_moved.resize(self.end.len(), true);
        self.detect(threads, true);
        self.ccd.failed.is_empty()
    }

    /// Pairs that failed the last time.
    pub(super) fn failed(&self) -> impl Iterator<Item = (&Pair, &Impact)> {
        self.ccd
            .failed
            .iter()
            .map(|(pair, impact, _)| (pair, impact))
    }

    /// Certifies all candidates, of which some point moved, and lists those that fail.
    pub(super) fn detect(&mut self, threads: Threads, first: bool) {
        let _span = tracing::trace_span!("certificates").entered();
        self.cover(false);
        self.look_ahead();
        let mut ccd = std::mem::take(&mut self.ccd);
        let mut open = std::mem::take(&mut self.cache.open);
        let are_new = ccd.ends.is_empty();
        ccd.take(&self.end);
        let ways = [&self.start[..], &self.end[..]];
        let floor = self.settings.floor;
        ccd.swept.take(&self.mesh, ways, floor, !are_new);
        let are_all = first || are_new;
        ccd.mark_moved_faces(&self.mesh);
        let moves = |face: u32| are_all || ccd.moved_faces[face as usize];
        self.candidates.open(&ccd.swept, moves, &mut open);
        let pairs = self.candidates.pairs();
        let mut cached = std::mem::take(&mut self.cache.pairs);
        let failed = threads.find_in_pieces(&open, &mut cached, |before, open, cached, found| {
            for k in open.iter().map(|k| *k as usize) {
                let (pair, cache) = (&pairs[k], &mut cached[k - before]);
                let budget = cache.budget;
                let known = cache.in_solve(ccd.solve);
                let is_still = || !pair.corners.iter().any(|p| ccd.has_moved[*p as usize]);
                if !first && !known.reach.is_nan() && is_still() {
                    continue;
                }
                let path_lengths = self.path_lengths_of(k);
                if !path_lengths.surely_apart(budget, pair, floor) {
                    let at_start = path_lengths.at_start(budget, pair);
                    found.extend(self.certify_pair(at_start, pair, &ccd.moved_since, known));
                }
            }
        });
        self.cache.pairs = cached;
        self.cache.open = open;
        if first {
            self.counts.count(pairs.len(), &failed);
        }
        ccd.list_failed(&self.mesh, failed);
        ccd.has_moved.fill(false);
        for (pair, ..) in &ccd.failed {
            for p in pair.corners {
                ccd.has_moved[p as usize] = true;
            }
        }
        self.ccd = ccd;
    }

    /// Certifies a candidate that is at least as far apart `at_start` `[m]`, whose points have `moved_since`
    /// `[m]`, `[points]`.
    fn certify_pair(
        &self,
        at_start: f64,
        pair: &Pair,
        moved_since: &[DVec3],
        known: &mut Certificate,
    ) -> Option<Ccd> {
        let floor = self.settings.floor;
        let radius = self.mesh.radius_of(pair);
        if known.extent >= floor {
            let extent = extent(pair.kind, pair.places(&self.end), known.direction) - radius;
            if extent >= floor {
                known.reach = if known.reach > 0.0 { known.reach } else { 0.0 };
                return None;
            }
        }
        let moved_since = against(pair, moved_since);
        if known.reach > 0.0 && moved_since <= known.reach {
            return None;
        }
        let approach = self.path_lengths[super::WORLD].approach(pair);
        let spare = at_start - approach - floor;
        if spare > 0.0 {
            known.reach = spare - moved_since;
            return None;
        }
        let path = Path {
            from: pair.places(&self.start),
            to: pair.places(&self.end),
        };
        let spare = least_gap(pair.kind, path.from) - radius - approach - floor;
        if spare > 0.0 {
            known.reach = spare - moved_since;
            return None;
        }
        let spare = path.axes_gap(pair.kind) - radius - floor;
        let straight = if spare > 0.0 {
            let direction = path.axis(pair.kind);
            Ok(Straight { direction, spare })
        } else {
            certify_straight(pair.kind, path, floor + radius)
        };
        match straight {
            Ok(Straight { direction, spare }) => {
                *known = Certificate {
                    reach: spare - moved_since,
                    direction,
                    extent: extent(pair.kind, path.from, direction) - radius,
                };
                None
            }
            Err(start) => {
                known.reach = f64::NEG_INFINITY;
                let floor = floor.min((start.distance - radius) * ROUNDING);
                Some(
                    match certify_turning(pair.kind, &path, floor + radius, start) {
                        Ok(()) => Ccd::Subdivided,
                        Err(impact) => Ccd::Failed(*pair, impact, floor),
                    },
                )
            }
        }
    }
}
