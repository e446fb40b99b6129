//! The state one substep ago, from which the second order extrapolates, and what became of the
//! substeps.

use crate::state::State;

/// Largest relative difference between two substeps that count as equally long: rounding of
/// 1/(rate · substeps).
const SAME_LENGTH: f64 = 1e-9;

/// The state before the last substep, as far as the formula has it: y' = y - Δt ẏ, with ẏ the rate
/// of y that the next substep goes on from. With BDF2 that is the state itself.
#[derive(Debug, Default)]
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
    /// Those without a usable state before: the first one, and those after a release
    /// or a substep of another length.
    pub started: u64,
    /// Those that fell back to backward Euler: a prediction strained an edge too much.
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

    /// Returns true if the next substep, over `dt` `[s]`, can look back: the last one was as long.
    ///
    /// After a substep of another length the formula could go on with coefficients of a variable
    /// step, stable up to a ratio of 1 + √2 (Grigorieff 1983). Starting anew is nearer to the
    /// motion.
    pub(crate) fn fits(&self, dt: f64) -> bool {
        self.dt > 0.0 && (dt - self.dt).abs() <= SAME_LENGTH * self.dt
    }
}
