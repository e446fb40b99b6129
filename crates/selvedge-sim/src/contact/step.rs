//! The loop of a substep with contact.

use glam::DVec3;
use selvedge_cloth::StepError;
use selvedge_contact::{Impact, Pair};

use super::projection::Outcome;
use super::{ActiveSet, Contact, HistoryUse, OWN, WORLD, memory};
use crate::active_handles::ActiveHandles;
use crate::integrator::History;
use crate::simulator::Part;
use crate::solver::SolveError;
use crate::state::State;
use crate::threads::Threads;

/// Times that a solve is repeated, at most, with pairs that met unexpectedly and without those that
/// pulled.
const REPEATS: usize = 8;
/// Part of the collisions, or one, that may pull in a solve that is not repeated. Of 80 falls none gains
/// energy by it, and a fifth of the solves of the drape, the fold and the skirt is saved.
const FEW: f64 = 0.01;
/// Depth of a round body in the cloth after the last solve, as a part of the thickness, from which pushing
/// it out lets energy in.
const DEEP: f64 = 0.25;
/// Of the repeats, those that see whether firm collisions stick or slide.
const STICKING: usize = 2;

/// A substep to be taken.
#[derive(Clone, Copy)]
pub(crate) struct Span<'a> {
    pub(crate) part: Part,
    /// Targets of the active handles at the end `[m]`.
    pub(crate) targets: &'a [DVec3],
    pub(crate) threads: Threads,
}

/// What became of a substep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Advance {
    Done,
    /// It is too long for what touches in it, and is to be divided. The state is unusable.
    TooLong,
}

impl Contact {
    /// Moves `state` by a substep. On an error the state is unusable.
    pub(crate) fn advance(
        &mut self,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<Advance, StepError> {
        let frame = self.next_frame;
        self.update_inverse(active);
        let (mut done, mut divisions) = (0.0, 0);
        while divisions < self.settings.max_divisions {
            let [from, to] = span.part.way;
            let left = span.part.dt * (1.0 - done);
            self.begin_step(&state.positions, from + (to - from) * done, to);
            let solved = self.solve(left, span, active, state, history);
            let is_near = solved.map_err(|error| error.at(frame))?;
            if !is_near && span.part.may_divide {
                return Ok(Advance::TooLong);
            }
            let collisions = &active.system.collisions;
            let (looked_back, point) = (self.looked_back, active.point(self.looked_back));
            self.received.add_forces(
                &self.mesh,
                |v| self.start[v].lerp(self.end[v], point),
                |force, carried| active.impulse(left, force, carried.filter(|_| looked_back)),
                collisions,
            );
            let is_taped = active.system.tape.is_some();
            let solved = is_taped.then(|| state.positions.clone());
            let outcome = self.resolve(left, span, state)?;
            self.received.add_pushes(left);
            if let (Some(tape), Some(solved)) = (&mut active.system.tape, solved) {
                self.record_collisions(tape, left, point);
                if let Some(substep) = tape.last() {
                    substep.way = [from + (to - from) * done, to];
                }
                if let Some(substep) = tape.last().filter(|_| solved != state.positions) {
                    let ends = state.positions.iter().zip(solved);
                    substep.pushed = ends.map(|(end, solved)| *end - solved).collect();
                }
            }
            match outcome {
                Outcome::Released => {
                    self.received.take_back();
                    history.forget();
                    state.copy_from(&self.before);
                    active.system.repeat_start();
                }
                Outcome::Settled { moved } => {
                    if moved {
                        self.history = HistoryUse::Forgotten;
                        active.system.forget_changes();
                    }
                    match self.history {
                        HistoryUse::Kept => (),
                        HistoryUse::ToKeep => active.keep_touching(history, state),
                        HistoryUse::Forgotten => history.forget(),
                    }
                    self.remember(1.0, active);
                    return Ok(Advance::Done);
                }
                Outcome::Safe { part } => {
                    divisions += 1;
                    self.counts.divisions += 1;
                    history.forget();
                    active.system.forget_changes();
                    state.cut_back(&self.before, part);
                    if let Some(tape) = &mut active.system.tape {
                        if let Some(substep) = tape.last() {
                            substep.safe = Some(part);
                        }
                        tape.settle(to);
                    }
                    self.received.cut_back(part);
                    done += (1.0 - done) * part;
                    self.end[..state.positions.len()].copy_from_slice(&state.positions);
                    self.remember(part, active);
                    if divisions == self.settings.max_divisions
                        && span.part.is_last
                        && self.release_squeezed(true)
                    {
                        divisions = 0;
                    }
                }
            }
        }
        Err(self.unseparated())
    }

    /// Solves over `left` `[s]`, certifies the end, and goes on with the pairs that were missed and
    /// without those that pulled, and where the end is not near the solution. Returns false if the last
    /// one is not near either.
    fn solve(
        &mut self,
        left: f64,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<bool, SolveError> {
        let mut is_near = self.solve_first(left, span, active, state, history)?;
        let mut is_certified = self.is_collision_free(span.threads, &state.positions);
        for repeat in 0..REPEATS {
            let collisions = &mut active.system.collisions;
            let most = (FEW * collisions.list.len() as f64).max(1.0);
            let is_done = is_near && is_certified && self.forget_pulling(collisions) as f64 <= most;
            let has_released = !is_done && self.release(collisions);
            let has_caught = !is_certified && self.catch(collisions);
            let has_slipped = repeat < STICKING && collisions.see_slips(|v| self.end[v]);
            if !(has_released || has_caught || has_slipped) && is_near {
                break;
            }
            if is_done {
                self.release(collisions);
            }
            self.counts.repeated += 1;
            is_near = if self.history == HistoryUse::Kept {
                history.forget();
                state.copy_from(&self.before);
                self.looked_back = false;
                active.advance_touching(left, state, None, span.targets)?
            } else {
                active.go_on(left, &self.before, state, span.targets)?
            };
            if has_caught || self.history == HistoryUse::Kept {
                self.history = HistoryUse::Forgotten;
            }
            is_certified = self.is_collision_free(span.threads, &state.positions);
        }
        // A round body slides over faces.
        let is_deep = |(pair, impact): (&Pair, &Impact)| {
            let most = DEEP * self.bodies.thickness[self.other_body(pair)];
            let is_round = self.mesh.radius_of(pair) > 0.0;
            is_round && self.gap_along(pair, &impact.gap, &self.end) < -most
        };
        let is_deep = self.failed().any(is_deep);
        Ok(is_near && !is_deep)
    }

    /// Leads the cloth from `from` to `to` `[m]`, both of `[vertices]`, on straight ways over the
    /// whole frame, where pairs that have no certificate are pushed apart. Returns true if vertices
    /// were moved. Handles of `active` are not.
    pub(crate) fn lead(
        &mut self,
        threads: Threads,
        active: &ActiveHandles,
        from: &[DVec3],
        to: &mut [DVec3],
    ) -> Result<bool, StepError> {
        self.update_inverse(active);
        self.begin_step(from, 0.0, 1.0);
        let was_moved = self.push_apart(threads, to)?;
        to.copy_from_slice(&self.end[..to.len()]);
        Ok(was_moved)
    }

    /// One solve over `left` `[s]`, with what touches in it. Returns false if its end may be far from
    /// the solution.
    fn solve_first(
        &mut self,
        left: f64,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<bool, SolveError> {
        self.find_candidates(left, state);
        let ActiveSet {
            collisions,
            pushing,
        } = self.find_active_set(span.threads, left);
        self.counts.solves += 1;
        self.counts.touching = collisions.list.len() as u64;
        let jumps = memory::jumps(&self.memory.pushing, &pushing);
        self.memory.pushing = pushing;
        active.system.collisions = collisions;
        self.before.copy_from(state);
        if active.system.collisions.is_empty() && !jumps {
            self.history = HistoryUse::Kept;
            let (fits, fell_back) = (history.fits(left), history.counts.fell_back);
            active.advance(left, state, Some(history), span.targets)?;
            self.looked_back = fits && history.counts.fell_back == fell_back;
            return Ok(true);
        }
        let looks_back = !jumps && history.fits(left);
        self.looked_back = looks_back;
        if active.looks_back() {
            history.counts.fell_back += u64::from(!looks_back);
            history.counts.all += 1;
        }
        self.history = if jumps { HistoryUse::Forgotten } else { HistoryUse::ToKeep };
        let from = looks_back.then_some(&*history);
        active.advance_touching(left, state, from, span.targets)
    }

    /// Puts the points at the start of a solve, and obstacles at its end; parts of the frame.
    fn begin_step(&mut self, positions: &[DVec3], now: f64, end: f64) {
        self.ccd.begin();
        self.cache.searches = 0;
        self.bodies.part = end - now;
        let cloth = positions.len();
        let middle = |all: &[DVec3]| all.iter().sum::<DVec3>() / cloth as f64;
        let way = middle(positions) - middle(&self.start[..cloth]);
        let mut put = |p: usize, place: DVec3| {
            let gone = place - self.start[p];
            self.path_lengths[WORLD].travelled[p] += gone.length();
            if p < cloth {
                self.path_lengths[OWN].travelled[p] += (gone - way).length();
            }
            self.start[p] = place;
        };
        for (p, place) in positions.iter().enumerate() {
            put(p, *place);
        }
        let [from, to] = &self.bodies.frame;
        for (k, (from, to)) in from.iter().zip(to).enumerate() {
            put(cloth + k, from.lerp(*to, now));
            self.end[cloth + k] = from.lerp(*to, end);
        }
    }
}
