//! Rounds after a solve, in which pairs without a certificate are pushed apart: by mass, with
//! friction. Pairs that this does not settle are held back towards their start, or the substep is
//! divided.

use glam::DVec3;
use selvedge_cloth::{Squeezed, StepError};
use selvedge_contact::{
    Approach, Gap, Pair, Path, Straight, Surface, SweptFeatures, certify_straight, certify_turning,
    extent, least_gap, push,
};

use super::clearances::{Known, against};
use super::friction::along_surface;
use super::{Contact, ContactCounts, Span};
use crate::state::State;
use crate::threads::Threads;

/// Part of the thickness to which a pair is pushed, at most.
const PARKED: f64 = 0.7;
/// Part of the floor to which a pair is pushed, at least.
const ABOVE_FLOOR: f64 = 1.5;
/// Rounding of a gap that may get lost where a pair starts below the floor.
const KEPT: f64 = 1.0 - 1e-6;
/// Rounds in which vertices are held back, by half of their way each, and then all of it.
const HOLDING: u32 = 24;
const HALVES: u32 = 10;
/// Shortest safe part of a solve after which a substep is divided before vertices are held back,
/// and after that. The round with the longest counts: what is held back may be run over by what is
/// led.
const WELCOME: f64 = 0.125;
const SHORTEST: f64 = 1.0 / 64.0;

/// End of a solve after all rounds.
pub(super) enum Outcome {
    /// All pairs are certified for the whole way.
    Settled {
        /// True if vertices are not where the solve had them.
        moved: bool,
    },
    /// All pairs are certified for this part of the way.
    Safe {
        /// Part, above 0 and below 1.
        part: f64,
    },
    /// Contact was released: the solve is to be repeated without it.
    GivenWay,
}

/// A pair that one direction does not certify.
enum Turning {
    /// It is safe all the same.
    Halved,
    Failed(Pair, Approach, f64),
}

/// The pair that was safe for the shortest part.
#[derive(Clone, Debug)]
pub(super) struct Worst {
    pub(super) pair: Pair,
    pub(super) gap: f64,
    part: f64,
}

/// Lists that are kept from round to round and from substep to substep.
#[derive(Default)]
pub(super) struct Room {
    /// Number of the solve.
    pub(super) solve: u32,
    /// Boxes around the ways in the solve.
    swept: SweptFeatures,
    /// Ends of the points when the first pair of the solve was certified `[m]`, `[points]`; empty
    /// before.
    ends: Vec<DVec3>,
    /// Way of each point from there to the last certificates `[m]`, `[points]`.
    strayed: Vec<DVec3>,
    /// Points that moved since the last certificates, and faces that have such a corner.
    stirred: Vec<bool>,
    stirred_faces: Vec<bool>,
    /// Pairs that failed, with the gap that each must keep `[m]`, in the order of [`by_place`].
    failed: Vec<(Pair, Approach, f64)>,
    pub(super) worst: Option<Worst>,
    /// Ends of the points in the round that was safe for the longest part `[m]`, `[points]`.
    best: Vec<DVec3>,
}

/// The order in which pairs are pushed, which depends on the pairs alone: those of a vertex with a
/// face stand beside those of the edges there. Chosen by trial, among six orders, for the pinched
/// table-cloths (`assets/scenes/contact`), which stop more often where all of one kind come first.
fn by_place(pair: &Pair) -> ([u32; 4], Pair) {
    let mut corners = pair.corners;
    corners.sort_unstable();
    (corners, *pair)
}

impl Room {
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
        let strayed = self.ends.iter().zip(ends).map(|(a, b)| *b - *a);
        self.strayed.clear();
        self.strayed.extend(strayed);
    }

    /// Takes the faces of points that moved.
    fn stir_faces(&mut self, surface: &Surface) {
        let is_stirred = |face: &[u32; 3]| face.iter().any(|p| self.stirred[*p as usize]);
        self.stirred_faces.clear();
        let faces = surface.faces().iter();
        self.stirred_faces.extend(faces.map(is_stirred));
    }

    /// Lists the pairs that failed, and the one that was safe for the shortest part.
    fn list_failed(&mut self, surface: &Surface, turning: Vec<Turning>) {
        self.failed.clear();
        self.failed
            .extend(turning.into_iter().filter_map(|turning| match turning {
                Turning::Halved => None,
                Turning::Failed(pair, approach, floor) => Some((pair, approach, floor)),
            }));
        self.failed
            .sort_unstable_by_key(|(pair, ..)| by_place(pair));
        let least = |a: &&(Pair, Approach, f64), b: &&(Pair, Approach, f64)| {
            let sooner = a.1.safe.total_cmp(&b.1.safe);
            sooner.then_with(|| a.0.cmp(&b.0))
        };
        let worst = self.failed.iter().min_by(least);
        self.worst = worst.map(|(pair, approach, _)| Worst {
            pair: *pair,
            gap: approach.gap.distance - surface.radius_of(pair),
            part: approach.safe,
        });
    }
}

impl ContactCounts {
    /// Counts the first certificates of `pairs` after a solve.
    fn count(&mut self, pairs: usize, turning: &[Turning]) {
        let halved = |turning: &&Turning| matches!(turning, Turning::Halved);
        let halved = turning.iter().filter(halved).count();
        self.certified += (pairs - turning.len()) as u64;
        self.halved += halved as u64;
        self.uncertified += (turning.len() - halved) as u64;
    }
}

impl Contact {
    /// Brings `state`, the end of a solve over `left` `[s]`, to where all pairs are certified on
    /// their way from the start.
    pub(super) fn separate(
        &mut self,
        left: f64,
        span: Span<'_>,
        state: &mut State,
    ) -> Result<Outcome, StepError> {
        let _span = tracing::trace_span!("separation").entered();
        let rounds = self.settings.rounds;
        let last = if span.part.may_hold {
            rounds + HOLDING
        } else {
            rounds
        };
        // Longest part that was safe in a round after which vertices are held back, and what
        // obstacles had received by then.
        let mut best = None;
        let mut longest = SHORTEST;
        for round in 0..=last {
            if round > 0 {
                self.certify(span.threads, false);
            }
            if self.room.failed.is_empty() {
                let moved = round > 0;
                if moved {
                    self.take(left, state)?;
                }
                return Ok(Outcome::Settled { moved });
            }
            let part = self.room.worst.as_ref().map_or(0.0, |worst| worst.part);
            if round == rounds && self.give_way(false) {
                return Ok(Outcome::GivenWay);
            }
            if round == rounds && part >= WELCOME {
                self.take(left, state)?;
                return Ok(Outcome::Safe { part });
            }
            if round >= rounds && span.part.may_hold && part >= longest {
                longest = part;
                best = Some(self.received.clone());
                self.room.best.clone_from(&self.end);
            }
            if round > rounds {
                self.counts.held_back += 1;
                self.hold_back(round - rounds > HALVES);
            }
            if round - rounds.min(round) <= HALVES {
                self.project(round);
            }
        }
        let Some(received) = best else {
            if span.part.is_last && self.give_way(true) {
                return Ok(Outcome::GivenWay);
            }
            return Err(self.unseparated());
        };
        self.received = received;
        self.end.clone_from(&self.room.best);
        self.take(left, state)?;
        Ok(Outcome::Safe { part: longest })
    }

    /// Pushes pairs apart that have no certificate on their way to `end` `[m]`, `[vertices]`, but
    /// holds nothing back. Returns true if there were some.
    pub(super) fn push_apart(
        &mut self,
        threads: Threads,
        end: &[DVec3],
    ) -> Result<bool, StepError> {
        if self.certify_solve(threads, end) {
            return Ok(false);
        }
        for round in 0..2 * self.settings.rounds {
            self.project(round);
            self.certify(threads, false);
            if self.room.failed.is_empty() {
                return Ok(true);
            }
        }
        Err(self.unseparated())
    }

    /// The pair that is safe for the shortest part, which cannot be kept apart.
    pub(super) fn unseparated(&self) -> StepError {
        let worst = self.room.worst.as_ref();
        StepError::Contact {
            frame: self.next_frame,
            pair: worst.map_or_else(String::new, |worst| self.name(&worst.pair)),
            gap: worst.map_or(0.0, |worst| worst.gap),
            squeezed_by: self.squeezers(),
            may_yield: self.settings.squeezed == Squeezed::Stop,
        }
    }

    /// Certifies all candidates on their way to `end` `[m]`, `[vertices]`, the end of a solve.
    /// Returns true if none fails.
    pub(super) fn certify_solve(&mut self, threads: Threads, end: &[DVec3]) -> bool {
        self.end[..end.len()].copy_from_slice(end);
        self.room.stirred.clear();
        self.room.stirred.resize(self.end.len(), true);
        self.certify(threads, true);
        self.room.failed.is_empty()
    }

    /// Pairs that failed the last time.
    pub(super) fn failed(&self) -> impl Iterator<Item = (&Pair, &Approach)> {
        self.room
            .failed
            .iter()
            .map(|(pair, approach, _)| (pair, approach))
    }

    /// Certifies all candidates, of which some point moved, and lists those that fail.
    fn certify(&mut self, threads: Threads, first: bool) {
        let _span = tracing::trace_span!("certificates").entered();
        self.cover(false);
        self.look_ahead();
        let mut room = std::mem::take(&mut self.room);
        let mut open = std::mem::take(&mut self.open);
        let are_new = room.ends.is_empty();
        room.take(&self.end);
        let ways = [&self.start[..], &self.end[..]];
        let floor = self.settings.floor;
        room.swept.take(&self.surface, ways, floor, !are_new);
        let are_all = first || are_new;
        room.stir_faces(&self.surface);
        let stirs = |face: u32| are_all || room.stirred_faces[face as usize];
        self.candidates.open(&room.swept, stirs, &mut open);
        let pairs = self.candidates.pairs();
        let mut watched = std::mem::take(&mut self.watched);
        let turning =
            threads.find_in_pieces(&open, &mut watched, |before, open, watched, found| {
                for k in open.iter().map(|k| *k as usize) {
                    let (pair, watch) = (&pairs[k], &mut watched[k - before]);
                    let budget = watch.budget;
                    let known = watch.in_solve(room.solve);
                    let is_still = || !pair.corners.iter().any(|p| room.stirred[*p as usize]);
                    if !first && !known.reach.is_nan() && is_still() {
                        continue;
                    }
                    let clearances = self.clearances_of(k);
                    if !clearances.surely_apart(budget, pair, floor) {
                        let at_start = clearances.at_start(budget, pair);
                        found.extend(self.look(at_start, pair, &room.strayed, known));
                    }
                }
            });
        self.watched = watched;
        self.open = open;
        if first {
            self.counts.count(pairs.len(), &turning);
        }
        room.list_failed(&self.surface, turning);
        room.stirred.fill(false);
        for (pair, ..) in &room.failed {
            for p in pair.corners {
                room.stirred[p as usize] = true;
            }
        }
        self.room = room;
    }

    /// Certifies a candidate that is at least as far apart `at_start` `[m]`, whose points have `strayed`
    /// `[m]`, `[points]`.
    fn look(
        &self,
        at_start: f64,
        pair: &Pair,
        strayed: &[DVec3],
        known: &mut Known,
    ) -> Option<Turning> {
        let floor = self.settings.floor;
        let radius = self.surface.radius_of(pair);
        if known.extent >= floor {
            let extent = extent(pair.kind, pair.places(&self.end), known.direction) - radius;
            if extent >= floor {
                known.reach = known.reach.max(0.0);
                return None;
            }
        }
        let strayed = against(pair, strayed);
        if known.reach > 0.0 && strayed <= known.reach {
            return None;
        }
        let approach = self.clearances[super::WORLD].approach(pair);
        let spare = at_start - approach - floor;
        if spare > 0.0 {
            known.reach = spare - strayed;
            return None;
        }
        let path = Path {
            from: pair.places(&self.start),
            to: pair.places(&self.end),
        };
        let spare = least_gap(pair.kind, path.from) - radius - approach - floor;
        if spare > 0.0 {
            known.reach = spare - strayed;
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
                *known = Known {
                    reach: spare - strayed,
                    direction,
                    extent: extent(pair.kind, path.from, direction) - radius,
                };
                None
            }
            Err(start) => {
                known.reach = f64::NEG_INFINITY;
                let floor = floor.min((start.distance - radius) * KEPT);
                Some(
                    match certify_turning(pair.kind, &path, floor + radius, start) {
                        Ok(()) => Turning::Halved,
                        Err(approach) => Turning::Failed(*pair, approach, floor),
                    },
                )
            }
        }
    }

    /// Pushes every pair that failed to a gap, one after the other. In `round` 0 friction acts.
    fn project(&mut self, round: u32) {
        let failed = std::mem::take(&mut self.room.failed);
        for (pair, approach, floor) in &failed {
            let body = self.other_body(pair);
            let inverse = pair.corners.map(|p| self.inverse[p as usize]);
            let gap = &approach.gap;
            let start = self.gap_along(pair, gap, &self.start);
            let goal = (PARKED * self.thickness[body]).min(start);
            let goal = goal.max(ABOVE_FLOOR * floor) + self.surface.radius_of(pair);
            let Some(push) = push(gap, pair.places(&self.end), inverse, goal) else {
                continue;
            };
            self.counts.projected += 1;
            for (p, shift) in pair.corners.iter().zip(push.moves) {
                self.end[*p as usize] += shift;
                self.note_push(body, *p as usize, shift);
            }
            if round == 0 {
                self.rub(pair, body, gap, push.size);
            }
        }
        self.room.failed = failed;
    }

    /// Friction of a push against `body` of this `size` `[kg m]`: it takes from the slip of the
    /// pair since the start.
    fn rub(&mut self, pair: &Pair, body: usize, gap: &Gap, size: f64) {
        let (normal, weights) = (gap.normal, gap.weights);
        let most = self.friction[body] * size;
        let (mut slip, mut mobility) = (self.turned(pair, body, normal), 0.0);
        for (corner, weight) in pair.corners.iter().zip(weights) {
            let p = *corner as usize;
            slip += (self.end[p] - self.start[p]) * weight;
            mobility += weight * weight * self.inverse[p];
        }
        let slip = along_surface(normal, slip);
        let length = slip.length();
        if length <= 0.0 || mobility <= 0.0 {
            return;
        }
        let size = most.min(length / mobility);
        for (corner, weight) in pair.corners.iter().zip(weights) {
            let p = *corner as usize;
            let shift = slip * (-weight * self.inverse[p] * size / length);
            self.end[p] += shift;
            self.note_push(body, p, shift);
        }
    }

    /// Notes that a push against `body` moved point `p` by `shift` `[m]`.
    fn note_push(&mut self, body: usize, p: usize, shift: DVec3) {
        if let Some(mass) = self.mass.get(p) {
            self.received.note_push(body, *mass, shift);
        }
    }

    /// Takes half of their way from the vertices of pairs that failed, or `all` of it.
    fn hold_back(&mut self, all: bool) {
        let mut is_held = vec![false; self.mass.len()];
        for (pair, ..) in &self.room.failed {
            for p in pair.corners.map(|p| p as usize) {
                if self.inverse[p] > 0.0 && !std::mem::replace(&mut is_held[p], true) {
                    let (start, end) = (self.start[p], &mut self.end[p]);
                    *end = if all { start } else { start.midpoint(*end) };
                }
            }
        }
    }

    /// Moves `state` to the end that is certified; velocities follow the moves.
    fn take(&mut self, left: f64, state: &mut State) -> Result<(), StepError> {
        let places = state.positions.iter_mut().zip(&mut state.velocities);
        for ((place, velocity), end) in places.zip(&self.end) {
            *velocity += (*end - *place) / left;
            *place = *end;
        }
        let checked = state.check_finite();
        checked.map_err(|error| error.at(self.next_frame))
    }
}
