//! The state one substep ago, from which the second order extrapolates, and what became of the
//! substeps.

use crate::state::State;

/// Largest ratio of a substep to the one before it at which the history is still of use. The
/// formula is stable up to 1 + √2 (Grigorieff 1983).
const MOST_GROWTH: f64 = 2.0;

/// The state before the last substep.
#[derive(Clone, Debug)]
pub(crate) struct History {
    /// The state, if `dt` is not 0.
    pub(crate) before: State,
    /// Length of the last substep `[s]`; 0 without a history.
    dt: f64,
    /// Substeps so far.
    pub(crate) counts: SubstepCounts,
}

/// Substeps of a simulator by what they came to. Those that were done again with a finer division
/// do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SubstepCounts {
    /// All substeps.
    pub all: u64,
    /// Those without a usable state before: the first one, and those after a release, a shift
    /// within limits of strain, or a substep of less than half the length.
    pub started: u64,
    /// Those that fell back to backward Euler: a prediction strained an edge too much, or limits of
    /// strain had just moved the cloth.
    pub fell_back: u64,
}

impl History {
    /// No history, for a cloth with this number of vertices.
    pub(crate) fn none(vertices: usize) -> Self {
        Self {
            before: State::at_origin(vertices),
            dt: 0.0,
            counts: SubstepCounts::default(),
        }
    }

    /// Makes this a copy of `other`, of the same size.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        if other.dt > 0.0 {
            self.before.copy_from(&other.before);
        }
        (self.dt, self.counts) = (other.dt, other.counts);
    }

    /// Drops the state before: the next substep starts anew.
    pub(crate) fn forget(&mut self) {
        self.dt = 0.0;
    }

    /// Keeps `state` as that before a substep over `dt` `[s]`.
    pub(crate) fn keep(&mut self, state: &State, dt: f64) {
        self.before.copy_from(state);
        self.dt = dt;
    }

    /// Length of the last substep `[s]`; none without a history.
    pub(crate) fn last_substep(&self) -> Option<f64> {
        (self.dt > 0.0).then_some(self.dt)
    }

    /// Makes the state before one from which a substep over `dt` `[s]` led to the present one.
    pub(crate) fn set_last_substep(&mut self, dt: f64) {
        self.dt = dt;
    }

    /// Ratio of a substep over `dt` `[s]` to the last one; none if the history is of no use to it.
    pub(crate) fn ratio(&self, dt: f64) -> Option<f64> {
        // Rounding of 1/(rate · substeps) must not decide.
        let usable = self.dt > 0.0 && dt <= self.dt * MOST_GROWTH * (1.0 + 1e-9);
        usable.then(|| dt / self.dt)
    }
}
