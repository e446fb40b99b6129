//! The elements of a cloth, faces or hinges, in groups of neighbours in the lists, with what they gave
//! at the last evaluation.

use glam::DVec3;

use crate::laws::number::{GROUP, Row};
use crate::threads::Threads;

/// Groups of [`GROUP`] elements of so many `CORNERS`, each a `G`, and the so many `NUMBERS` of each
/// element's response.
pub(crate) struct Groups<G, const CORNERS: usize, const NUMBERS: usize> {
    count: usize,
    pub(super) groups: Vec<G>,
    pub(super) responses: Vec<[Row; NUMBERS]>,
    /// Impulse on each corner `[N s]`, of whole groups.
    impulses: Vec<[DVec3; CORNERS]>,
}

impl<G: Sync, const CORNERS: usize, const NUMBERS: usize> Groups<G, CORNERS, NUMBERS> {
    /// `count` elements, not evaluated yet.
    pub(super) fn of(count: usize, groups: Vec<G>) -> Self {
        Self {
            count,
            responses: vec![[[0.0; GROUP]; NUMBERS]; groups.len()],
            impulses: vec![[DVec3::ZERO; CORNERS]; groups.len() * GROUP],
            groups,
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Impulse on a corner of an element `[N s]`.
    #[inline]
    pub(crate) fn impulse(&self, element: usize, corner: usize) -> DVec3 {
        self.impulses[element][corner]
    }

    /// Calls `work` for each group with its responses and impulses.
    pub(super) fn each(
        &mut self,
        threads: Threads,
        work: impl Fn(&G, &mut [Row; NUMBERS], &mut [[DVec3; CORNERS]; GROUP]) + Sync,
    ) {
        let (groups, responses) = (&self.groups, &mut self.responses);
        let (impulses, _) = self.impulses.as_chunks_mut();
        threads.each_pair(responses, impulses, |k, response, impulses| {
            work(&groups[k], response, impulses);
        });
    }
}
