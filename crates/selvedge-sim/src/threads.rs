//! Loops over slices on one thread or on several, with the same result: every entry is computed by
//! itself, from data that no other entry of the loop writes.
//!
//! Several are those of rayon's current pool, which stand by while a frame is computed
//! ([`crate::team`]). If the pool has one thread, or the cloth is small, the loop runs on the
//! caller's.

use crate::team::{Cuts, over_shares, standing_by};

/// Threads that compute a cloth. The result is the same, byte for byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threads {
    /// The caller's thread alone: best where many cloths are simulated side by side.
    One,
    /// The threads of rayon's current pool, if the cloth is large enough.
    Pool,
}

/// Pieces of a loop for each thread: more balance the threads better, and cost more.
const PIECES: usize = 3;
/// Entries of a piece at least.
const SMALLEST_PIECE: usize = 16;
/// Vertices below which a second thread gains little, for twice the processor time.
const FEWEST_VERTICES: usize = 600;

impl Threads {
    /// Threads for a cloth of `vertices` vertices, from the calling thread.
    pub(crate) fn for_cloth(self, vertices: usize) -> Self {
        if vertices < FEWEST_VERTICES || rayon::current_num_threads() < 2 {
            Self::One
        } else {
            self
        }
    }

    /// Runs `work`, a frame or a part of it, for [`Self::Pool`] with the threads standing by.
    pub(crate) fn run<R: Send>(self, work: impl FnOnce() -> R + Send) -> R {
        match self {
            Self::One => work(),
            Self::Pool => standing_by(work),
        }
    }

    /// Entries of a piece of a loop over `count`.
    fn share(self, count: usize) -> usize {
        match self {
            Self::One => count.max(1),
            Self::Pool => {
                let pieces = PIECES * rayon::current_num_threads();
                count.div_ceil(pieces).max(SMALLEST_PIECE)
            }
        }
    }

    /// Calls `work` for each entry with its number.
    pub(crate) fn each<A: Send>(self, a: &mut [A], work: impl Fn(usize, &mut A) + Sync) {
        let share = self.share(a.len());
        over_shares(a, NONE, [Cuts::Every(share); 2], |piece, a, _| {
            for (k, a) in a.iter_mut().enumerate() {
                work(share * piece + k, a);
            }
        });
    }

    /// Calls `work` for each pair of entries with its number. The slices have the same length.
    pub(crate) fn each_pair<A: Send, B: Send>(
        self,
        a: &mut [A],
        b: &mut [B],
        work: impl Fn(usize, &mut A, &mut B) + Sync,
    ) {
        let share = self.share(a.len());
        over_shares(a, [b], [Cuts::Every(share); 2], |piece, a, [b]| {
            for (k, (a, b)) in a.iter_mut().zip(b).enumerate() {
                work(share * piece + k, a, b);
            }
        });
    }

    /// Calls `work` for each entry with its number, and returns what it found, in order.
    pub(crate) fn find<A: Send, F: Send>(
        self,
        a: &mut [A],
        work: impl Fn(usize, &mut A) -> Option<F> + Sync,
    ) -> Vec<F> {
        let share = self.share(a.len());
        let mut found: Vec<Vec<F>> = Vec::new();
        found.resize_with(a.len().div_ceil(share), Vec::new);
        over_shares(
            &mut found,
            [a],
            [Cuts::Every(1), Cuts::Every(share)],
            |piece, found, [a]| {
                let numbered = a.iter_mut().enumerate();
                found[0].extend(numbered.filter_map(|(k, a)| work(share * piece + k, a)));
            },
        );
        let rest = found.split_off(1.min(found.len()));
        let first = found.pop().unwrap_or_default();
        rest.into_iter().fold(first, |mut all, more| {
            all.extend(more);
            all
        })
    }

    /// Calls `work` for each entry of `parts`, large pieces of work, with its entries of each of
    /// `vectors`, which end at `ends`.
    pub(crate) fn each_part<A: Send, B: Send, const N: usize>(
        self,
        parts: &mut [A],
        vectors: [&mut [B]; N],
        ends: &[usize],
        work: impl Fn(&mut A, [&mut [B]; N]) + Sync,
    ) {
        let cuts = [Cuts::Every(1), Cuts::At(ends)];
        over_shares(parts, vectors, cuts, |_, part, vectors| {
            work(&mut part[0], vectors);
        });
    }

    /// Calls `work` for each entry of `few`, large pieces of work.
    pub(crate) fn each_large<A: Send>(self, few: &mut [A], work: impl Fn(&mut A) + Sync) {
        over_shares(few, NONE, [Cuts::Every(1); 2], |_, few, _| {
            work(&mut few[0])
        });
    }
}

/// No second slice.
const NONE: [&mut [()]; 0] = [];
