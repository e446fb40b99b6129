//! Rounds after a solve, in which pairs without a certificate are pushed apart: by mass, with
//! friction. Pairs that this does not settle are held back towards their start, or the substep is
//! divided.

use glam::DVec3;
use selvedge_cloth::StepError;
use selvedge_contact::{Gap, Pair, push};

use super::friction::along_surface;
use super::{Contact, Span};
use crate::state::State;
use crate::threads::Threads;

/// Part of the thickness to which a pair is pushed, at most.
const PUSHED_TO: f64 = 0.7;
/// Part of the floor to which a pair is pushed, at least.
const ABOVE_FLOOR: f64 = 1.5;
/// Rounds in which vertices are held back, by half of their way each, and then all of it.
const HOLDING: u32 = 24;
const HALVES: u32 = 10;
/// Shortest safe part of a solve after which a substep is divided before vertices are held back,
/// and after that. The round with the longest counts: what is held back may be run over by what is
/// led.
const LONG_ENOUGH: f64 = 0.125;
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
    Released,
}

impl Contact {
    /// Brings `state`, the end of a solve over `left` `[s]`, to where all pairs are certified on
    /// their way from the start.
    pub(super) fn resolve(
        &mut self,
        left: f64,
        span: Span<'_>,
        state: &mut State,
    ) -> Result<Outcome, StepError> {
        let _span = tracing::trace_span!("separation").entered();
        let rounds = self.settings.rounds;
        let last = if span.part.may_hold { rounds + HOLDING } else { rounds };
        // Longest part that was safe in a round after which vertices are held back, and what
        // obstacles had received by then.
        let mut best = None;
        let mut longest = SHORTEST;
        for round in 0..=last {
            if round > 0 {
                self.detect(span.threads, false);
            }
            if self.ccd.failed.is_empty() {
                let moved = round > 0;
                if moved {
                    self.take(left, state)?;
                }
                return Ok(Outcome::Settled { moved });
            }
            let earliest = self.ccd.earliest.as_ref();
            let part = earliest.map_or(0.0, |earliest| earliest.part);
            if round == rounds && self.release_squeezed(false) {
                return Ok(Outcome::Released);
            }
            if round == rounds && part >= LONG_ENOUGH {
                self.take(left, state)?;
                return Ok(Outcome::Safe { part });
            }
            if round >= rounds && span.part.may_hold && part >= longest {
                longest = part;
                best = Some(self.received.clone());
                self.ccd.best.clone_from(&self.end);
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
            if span.part.is_last && self.release_squeezed(true) {
                return Ok(Outcome::Released);
            }
            return Err(self.unseparated());
        };
        self.received = received;
        self.end.clone_from(&self.ccd.best);
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
        if self.is_collision_free(threads, end) {
            return Ok(false);
        }
        for round in 0..2 * self.settings.rounds {
            self.project(round);
            self.detect(threads, false);
            if self.ccd.failed.is_empty() {
                return Ok(true);
            }
        }
        Err(self.unseparated())
    }

    /// Pushes every pair that failed to a gap, one after the other. In `round` 0 friction acts.
    fn project(&mut self, round: u32) {
        let failed = std::mem::take(&mut self.ccd.failed);
        for (pair, impact, floor) in &failed {
            let body = self.other_body(pair);
            let inverse = pair.corners.map(|p| self.inverse[p as usize]);
            let gap = &impact.gap;
            let start = self.gap_along(pair, gap, &self.start);
            let goal = (PUSHED_TO * self.bodies.thickness[body]).min(start);
            let goal = goal.max(ABOVE_FLOOR * floor) + self.mesh.radius_of(pair);
            let Some(push) = push(gap, pair.places(&self.end), inverse, goal) else {
                continue;
            };
            self.counts.projected += 1;
            for (p, shift) in pair.corners.iter().zip(push.moves) {
                self.end[*p as usize] += shift;
                self.note_push(body, *p as usize, shift);
            }
            if round == 0 {
                self.push_friction(pair, body, gap, push.size);
            }
        }
        self.ccd.failed = failed;
    }

    /// Friction of a push against `body` of this `size` `[kg m]`: it takes from the slip of the
    /// pair since the start.
    fn push_friction(&mut self, pair: &Pair, body: usize, gap: &Gap, size: f64) {
        let (normal, weights) = (gap.normal, gap.weights);
        let most = self.bodies.friction[body] * size;
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
            self.received.note_push(body, *mass, shift, self.end[p]);
        }
    }

    /// Takes half of their way from the vertices of pairs that failed, or `all` of it.
    fn hold_back(&mut self, all: bool) {
        let mut is_held = vec![false; self.mass.len()];
        let failed = std::mem::take(&mut self.ccd.failed);
        for (pair, ..) in &failed {
            for p in pair.corners.map(|p| p as usize) {
                if self.inverse[p] > 0.0 && !std::mem::replace(&mut is_held[p], true) {
                    let (start, end) = (self.start[p], self.end[p]);
                    self.end[p] = if all { start } else { start.midpoint(end) };
                    self.note_push(self.other_body(pair), p, self.end[p] - end);
                }
            }
        }
        self.ccd.failed = failed;
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
