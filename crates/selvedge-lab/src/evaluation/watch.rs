//! Runs under way on a rank: their progress, and the request to stop.

use std::ops::ControlFlow;

use selvedge_cluster::Ranks;

use crate::event::Task;

/// Runs under way on a rank.
#[derive(Clone, Copy)]
pub(super) struct Watch<'a, 't, 'l> {
    pub(super) task: &'a Task<'t, 'l>,
    pub(super) ranks: &'a Ranks,
}

impl Watch<'_, '_, '_> {
    /// Counts a frame; breaks where an end is asked for, here or elsewhere.
    pub(super) fn advance(self) -> ControlFlow<()> {
        match self.ranks.is_halted() {
            true => ControlFlow::Break(()),
            false => self.task.advance(),
        }
    }
}
