//! Loops over slices on one thread or on a pool, with the same result: every entry is computed by
//! itself, from data that no other entry of the loop writes.
//!
//! The pool is rayon's current one. If it has one thread, or the cloth is small, the loop runs on
//! the caller's thread.

use rayon::prelude::*;

/// Threads that compute a cloth. The result is the same, byte for byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threads {
    /// The caller's thread alone: best where many cloths are simulated side by side.
    One,
    /// The threads of rayon's current pool, if the cloth is large enough.
    Pool,
}

/// Entries that one thread takes at a time, at least.
const CHUNK: usize = 128;
/// Entries of a piece that is searched by itself.
const PIECE: usize = 2048;
/// Vertices below which waking other threads costs as much as they do: at 1024 two threads take as
/// long as one, and twice the processor time.
const FEWEST_VERTICES: usize = 2000;

impl Threads {
    /// Threads for a cloth of `vertices` vertices, from the calling thread.
    pub(crate) fn for_cloth(self, vertices: usize) -> Self {
        if vertices < FEWEST_VERTICES || rayon::current_num_threads() < 2 {
            Self::One
        } else {
            self
        }
    }

    /// Runs `work`, for [`Self::Pool`] inside the pool: once inside, loops start quickly.
    pub(crate) fn run<R: Send>(self, work: impl FnOnce() -> R + Send) -> R {
        match self {
            Self::One => work(),
            Self::Pool => rayon::scope(|_| work()),
        }
    }

    /// Calls `work` for each entry with its number.
    pub(crate) fn each<A: Send>(self, a: &mut [A], work: impl Fn(usize, &mut A) + Sync) {
        match self {
            Self::One => a.iter_mut().enumerate().for_each(|(k, a)| work(k, a)),
            Self::Pool => {
                let entries = a.par_iter_mut().enumerate().with_min_len(CHUNK);
                entries.for_each(|(k, a)| work(k, a));
            }
        }
    }

    /// Calls `work` for each pair of entries with its number. The slices have the same length.
    pub(crate) fn each_pair<A: Send, B: Send>(
        self,
        a: &mut [A],
        b: &mut [B],
        work: impl Fn(usize, &mut A, &mut B) + Sync,
    ) {
        match self {
            Self::One => {
                let pairs = a.iter_mut().zip(b).enumerate();
                pairs.for_each(|(k, (a, b))| work(k, a, b));
            }
            Self::Pool => {
                let pairs = a.par_iter_mut().zip(b).enumerate().with_min_len(CHUNK);
                pairs.for_each(|(k, (a, b))| work(k, a, b));
            }
        }
    }

    /// Calls `work` for pieces of a slice and those of the `open` places, in ascending order, that lie in
    /// them, with the place of the first entry, to add what it finds there; all that was found, in order.
    pub(crate) fn find_in_pieces<A: Send, F: Send>(
        self,
        open: &[u32],
        all: &mut [A],
        work: impl Fn(usize, &[u32], &mut [A], &mut Vec<F>) + Sync,
    ) -> Vec<F> {
        let mut found = Vec::new();
        if self == Self::One {
            work(0, open, all, &mut found);
            return found;
        }
        let before = |place: usize| open.partition_point(|k| (*k as usize) < place);
        let of_piece = |(k, piece): (usize, &mut [A])| {
            let first = PIECE * k;
            let open = &open[before(first)..before(first + piece.len())];
            let mut found = Vec::new();
            work(first, open, piece, &mut found);
            found
        };
        let pieces = all.par_chunks_mut(PIECE).enumerate();
        pieces.flat_map_iter(of_piece).collect()
    }

    /// Calls `work` for each entry of `few`, large pieces of work, with its `share` entries of
    /// `many` (the last may have fewer).
    pub(crate) fn each_share<A: Send, B: Send>(
        self,
        few: &mut [A],
        many: &mut [B],
        share: usize,
        work: impl Fn(&mut A, &mut [B]) + Sync,
    ) {
        if self == Self::One || few.len() < 2 {
            few.iter_mut()
                .zip(many.chunks_mut(share))
                .for_each(|(a, b)| work(a, b));
        } else {
            few.par_iter_mut()
                .zip(many.par_chunks_mut(share))
                .for_each(|(a, b)| work(a, b));
        }
    }

    /// Calls `work` for each entry of `few`, large pieces of work.
    pub(crate) fn each_large<A: Send>(self, few: &mut [A], work: impl Fn(&mut A) + Sync) {
        if self == Self::One || few.len() < 2 {
            few.iter_mut().for_each(work);
        } else {
            few.par_iter_mut().for_each(&work);
        }
    }
}
