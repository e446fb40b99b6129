//! The search for candidates: when it is needed, how far it looks, and how far what was found reaches.

use glam::DVec3;
use selvedge_contact::{Reach, Ways};

use super::Contact;
use super::distance_cache::{PairCache, PathLengths};
use crate::state::State;

/// Distance that points may stray from their expected way, as a part of the thickness.
const SLACK: f64 = 2.0;
/// Times that the slack doubles, at most, where candidates are found again for the same solve: what
/// meets ends elsewhere than was expected, and elsewhere again when the solve is repeated.
const WIDENINGS: u32 = 3;

/// Solves ahead for which candidates are found, should all points go on as they go: fewer searches
/// for more candidates, of which most are never looked at.
const AHEAD: f64 = 4.0;
/// The same beyond the first solve, in units of the thickness, at most: what is fast has too many
/// candidates.
const FARTHEST_AHEAD: f64 = 10.0;

impl Contact {
    /// Makes sure that the candidates hold for the way on which the cloth is.
    pub(super) fn find_candidates(&mut self, left: f64, state: &State) {
        for (v, velocity) in state.velocities.iter().enumerate() {
            self.end[v] = self.start[v] + *velocity * left;
        }
        self.cover(true);
    }

    /// Finds the candidates where the points may have left their boxes: `anew`, or in addition to
    /// those there are, which keep their places.
    pub(super) fn cover(&mut self, anew: bool) {
        if self.candidates.cover(&self.start, &self.end) {
            return;
        }
        let _span = tracing::trace_span!("candidates").entered();
        let reach = self.reach();
        self.look_ahead();
        let slack = |path_lengths: &PathLengths| {
            let slack = path_lengths.longest_way();
            let slack = slack.clamp(0.125 * reach.slack, reach.slack);
            slack * f64::from(1_u32 << self.cache.searches.min(WIDENINGS))
        };
        let [own_slack, slack] = self.path_lengths.each_ref().map(slack);
        let reach = Reach {
            slack,
            own_slack,
            ..reach
        };
        self.cache.searches += 1;
        self.cache.ahead.clear();
        let ways = self.start.iter().zip(&self.end);
        let most = FARTHEST_AHEAD * self.largest_thickness();
        self.cache.ahead.extend(ways.map(|(start, end)| {
            let further = (*end - *start) * (AHEAD - 1.0);
            *end + further.clamp_length_max(most)
        }));
        let ways = Ways {
            from: &self.start,
            to: &self.end,
            later: &self.cache.ahead,
        };
        if anew || self.candidates.pairs().is_empty() {
            let kept = self.candidates.find(&self.mesh, ways, reach);
            self.cache.pairs.truncate(kept);
            self.ccd.begin();
        } else {
            self.candidates.widen(&self.mesh, ways, reach);
        }
        let count = self.candidates.pairs().len();
        self.cache.pairs.resize(count, PairCache::NEW);
    }

    pub(super) fn reach(&self) -> Reach {
        let most = self.largest_thickness();
        Reach {
            gap: most,
            slack: SLACK * most,
            own_slack: SLACK * most,
        }
    }

    /// Takes the ways of the solve.
    pub(super) fn look_ahead(&mut self) {
        let cloth = self.mass.len();
        let ways = self.start.iter().zip(&self.end).take(cloth);
        let middle = ways.map(|(start, end)| *end - *start).sum::<DVec3>() / cloth as f64;
        let [own, world] = &mut self.path_lengths;
        own.look_ahead(&self.start, &self.end, middle);
        world.look_ahead(&self.start, &self.end, DVec3::ZERO);
    }

    /// PathLengths of the candidate at this place: those against the middle of the cloth for what meets
    /// only itself.
    #[inline]
    pub(super) fn path_lengths_of(&self, place: usize) -> &PathLengths {
        &self.path_lengths[usize::from(place >= self.candidates.own_count())]
    }
}
