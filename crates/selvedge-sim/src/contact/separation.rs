//! Rounds after a solve, in which pairs without a certificate are pushed apart: by mass, with
//! friction. Pairs that this does not settle are held back towards their start, or the substep is
//! divided.
//!
//! Limits of strain come last, and give way: a vertex of a pair that would meet by its shift onto
//! the limits stays where it was ([`Contact::limit`]). A sweep of theirs between two rounds undoes
//! what the rounds did, and before them it brings together what the solve kept apart.

use glam::DVec3;
use selvedge_contact::{
    Approach, Gap, Kind, Pair, Path, certify, certify_straight, gap, least_gap, push,
};

use super::clearances::against;
use super::friction::along_surface;
use super::{Contact, ContactCounts, ContactError, Span, Unseparated};
use crate::active_handles::ActiveHandles;
use crate::solver::SolveError;
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
/// and after that.
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
}

/// Certificate of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Verdict {
    #[default]
    Safe,
    /// As safe, but one direction did not show it.
    Halved,
    Failed {
        approach: Approach,
        /// Gap that it must keep `[m]`.
        floor: f64,
    },
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
    verdicts: Vec<Verdict>,
    spare: Spare,
    /// Points that moved since the last certificates.
    stirred: Vec<bool>,
    failed: Vec<(Pair, Approach, f64)>,
    pub(super) worst: Option<Worst>,
}

/// Room that certificates of one solve leave: a solve that is repeated ends near the last one,
/// and most of its pairs need no new look.
#[derive(Default)]
struct Spare {
    /// Ends of the points when the first pair was certified `[m]`, `[points]`; empty before.
    ends: Vec<DVec3>,
    /// Way of each point from there to the last certificates `[m]`, `[points]`.
    strayed: Vec<DVec3>,
    /// Distance by which a point of one side may stray against one of the other while the pair
    /// stays certified `[m]`, `[candidates]`; negative where it is not.
    reach: Vec<f64>,
}

impl Spare {
    /// Forgets all certificates: points start elsewhere, or there are other candidates.
    fn forget(&mut self) {
        self.ends.clear();
    }

    /// Takes new `ends` of all points `[m]`, for this number of candidates.
    fn take(&mut self, ends: &[DVec3], candidates: usize) {
        if self.ends.is_empty() {
            self.ends.extend_from_slice(ends);
            self.reach.clear();
            self.reach.resize(candidates, -1.0);
        }
        let strayed = self.ends.iter().zip(ends).map(|(a, b)| *b - *a);
        self.strayed.clear();
        self.strayed.extend(strayed);
    }
}

impl Room {
    /// Forgets what the certificates of the last solve had to spare.
    pub(super) fn begin(&mut self) {
        self.spare.forget();
    }

    /// Lists the pairs that failed, and the one that was safe for the shortest part.
    fn list_failed(&mut self, pairs: &[Pair]) {
        self.failed.clear();
        self.worst = None;
        for (pair, verdict) in pairs.iter().zip(&self.verdicts) {
            let Verdict::Failed { approach, floor } = *verdict else {
                continue;
            };
            self.failed.push((*pair, approach, floor));
            let worst = self.worst.as_ref();
            if worst.is_none_or(|worst| approach.safe < worst.part) {
                self.worst = Some(Worst {
                    pair: *pair,
                    gap: approach.gap.distance,
                    part: approach.safe,
                });
            }
        }
    }
}

impl ContactCounts {
    /// Counts the first certificates after a solve.
    fn count(&mut self, verdicts: &[Verdict]) {
        for verdict in verdicts {
            let count = match verdict {
                Verdict::Safe => &mut self.certified,
                Verdict::Halved => &mut self.halved,
                Verdict::Failed { .. } => &mut self.uncertified,
            };
            *count += 1;
        }
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
    ) -> Result<Outcome, ContactError> {
        let rounds = self.settings.rounds;
        let last = if span.may_hold {
            rounds + HOLDING
        } else {
            rounds
        };
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
            let most = match round {
                _ if round == rounds => WELCOME,
                _ if round == rounds + HOLDING => SHORTEST,
                _ => 1.0,
            };
            let part = self.room.worst.as_ref().map_or(0.0, |worst| worst.part);
            if part >= most {
                self.take(left, state)?;
                return Ok(Outcome::Safe { part });
            }
            if round > rounds {
                self.counts.held_back += 1;
                self.hold_back(round - rounds > HALVES);
            }
            if round - rounds.min(round) <= HALVES {
                self.project(round);
            }
        }
        Err(ContactError::Unseparated(self.unseparated()))
    }

    /// Pushes pairs apart that have no certificate on their way to `end` `[m]`, `[vertices]`, but
    /// holds nothing back. Returns true if there were some.
    pub(super) fn push_apart(
        &mut self,
        threads: Threads,
        end: &[DVec3],
    ) -> Result<bool, Unseparated> {
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

    /// Moves `state`, the end of a solve over `left` `[s]` in which all pairs are certified, within
    /// the limits of the material, as far as that leaves them certified. Returns true if it moved.
    pub(super) fn limit(
        &mut self,
        left: f64,
        span: Span<'_>,
        active: &ActiveHandles,
        state: &mut State,
    ) -> Result<bool, SolveError> {
        let mut limited = state.clone();
        if !active.limit(left, &mut limited) {
            return Ok(false);
        }
        limited.check_finite()?;
        // A pair whose vertices all stay is certified, as it was.
        let mut is_certified = self.certify_solve(span.threads, &limited.positions);
        let mut rounds = 0;
        while !is_certified {
            rounds += 1;
            if rounds > HOLDING {
                return Ok(false);
            }
            for (pair, ..) in &self.room.failed {
                for p in pair.corners.map(|p| p as usize) {
                    if let Some(solved) = state.positions.get(p) {
                        self.end[p] = *solved;
                    }
                }
            }
            self.certify(span.threads, false);
            is_certified = self.room.failed.is_empty();
        }
        self.take(left, state)?;
        Ok(true)
    }

    /// The pair that is safe for the shortest part, in words.
    pub(super) fn unseparated(&self) -> Unseparated {
        let worst = self.room.worst.as_ref();
        Unseparated {
            pair: worst.map_or_else(String::new, |worst| self.name(&worst.pair)),
            gap: worst.map_or(0.0, |worst| worst.gap),
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
        if self.cover() {
            self.room.stirred.fill(true);
            self.room.spare.forget();
        }
        self.clearances.look_ahead(&self.start, &self.end);
        let mut room = std::mem::take(&mut self.room);
        let pairs = self.candidates.pairs();
        room.verdicts.resize(pairs.len(), Verdict::Safe);
        room.spare.take(&self.end, pairs.len());
        let (start, end, stirred) = (&self.start, &self.end, &room.stirred);
        let floor = self.settings.floor;
        let clearances = &self.clearances;
        let budgets = &clearances.budgets;
        let Spare { strayed, reach, .. } = &mut room.spare;
        threads.each_pair(&mut room.verdicts, reach, |k, verdict, reach| {
            let pair = &pairs[k];
            if clearances.surely_apart(budgets[k], pair, floor) {
                *verdict = Verdict::Safe;
                return;
            }
            if !first && !pair.corners.iter().any(|p| stirred[*p as usize]) {
                return;
            }
            if *reach > 0.0 && against(pair, strayed) <= *reach {
                *verdict = Verdict::Safe;
                return;
            }
            let mut spare =
                clearances.at_start(budgets[k], pair) - clearances.approach(pair) - floor;
            *verdict = Verdict::Safe;
            if spare <= 0.0 {
                let path = Path {
                    from: pair.places(start),
                    to: pair.places(end),
                };
                (*verdict, spare) = judge(pair.kind, path, clearances.approach(pair), floor);
            }
            *reach = spare - against(pair, strayed);
        });
        room.list_failed(pairs);
        if first {
            self.counts.count(&room.verdicts);
        }
        room.stirred.fill(false);
        for (pair, ..) in &room.failed {
            for p in pair.corners {
                room.stirred[p as usize] = true;
            }
        }
        self.room = room;
    }

    /// Pushes every pair that failed to a gap, one after the other. In `round` 0 friction acts.
    fn project(&mut self, round: u32) {
        let failed = std::mem::take(&mut self.room.failed);
        for (pair, approach, floor) in &failed {
            let body = self.other_body(pair);
            let inverse = pair.corners.map(|p| self.inverse[p as usize]);
            let gap = &approach.gap;
            let from = pair.places(&self.start);
            let extent: f64 = (0..4)
                .map(|k| gap.weights[k] * gap.normal.dot(from[k]))
                .sum();
            let goal = (PARKED * self.thickness[body]).min(extent);
            let goal = goal.max(ABOVE_FLOOR * floor);
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
        let (mut slip, mut mobility) = (DVec3::ZERO, 0.0);
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
    fn take(&mut self, left: f64, state: &mut State) -> Result<(), SolveError> {
        let places = state.positions.iter_mut().zip(&mut state.velocities);
        for ((place, velocity), end) in places.zip(&self.end) {
            *velocity += (*end - *place) / left;
            *place = *end;
        }
        state.check_finite()
    }
}

/// Certificate of a pair that keeps at least `floor` `[m]`, or its gap at the start, and what it
/// has to spare `[m]`. No two points of its sides come nearer by more than `approach` `[m]`.
#[inline]
fn judge(kind: Kind, path: Path, approach: f64, floor: f64) -> (Verdict, f64) {
    let spare = (least_gap(kind, path.from) - approach).max(path.axes_gap(kind)) - floor;
    if spare > 0.0 {
        return (Verdict::Safe, spare);
    }
    if let Some(spare) = certify_straight(kind, path, floor) {
        return (Verdict::Safe, spare);
    }
    let floor = floor.min(gap(kind, path.from).distance * KEPT);
    let verdict = match certify(kind, path, floor) {
        Ok(()) => Verdict::Halved,
        Err(approach) => Verdict::Failed { approach, floor },
    };
    (verdict, f64::NEG_INFINITY)
}
