//! A model of the time of a training step on many ranks, from pieces that can be measured.
//!
//! A step has three parts: the gradients of a rank's own samples, the sum over all ranks, and the
//! step of the optimiser, which every rank does. The sum goes along a chain in chunks
//! ([`Ranks::sum_in_order`](crate::Ranks::sum_in_order)): a chunk takes `s` to leave a rank and `l`
//! on its way. The last total arrives after `(2n - 2)(s + l) + (c - 1)s` where the chain is long,
//! and after `2cs + (n - 2)(s + l) - s` where the numbers are many and a rank sends sums and totals
//! one after the other, with `n` ranks and `c` chunks. A small gather goes up and down a tree that
//! is as deep as a rank has ones in binary.

use crate::together::{CHUNK, share_of};

/// A network between ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Time of an empty message `[s]`.
    pub latency: f64,
    /// Bytes per second that leave a rank.
    pub bandwidth: f64,
}

/// The measured pieces of a training step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepPieces {
    /// Pieces of the gradient: micro-batches of a step.
    pub pieces: usize,
    /// Time of one of them on a rank `[s]`.
    pub piece: f64,
    /// Numbers of the gradient.
    pub parameters: usize,
    /// Time to add one piece to a sum `[s]` per number.
    pub adding: f64,
    /// Time of the optimiser and of all else that every rank does `[s]`.
    pub update: f64,
}

impl StepPieces {
    /// Time of a step on so many ranks `[s]`.
    #[must_use]
    pub fn step(&self, ranks: usize, link: Link) -> f64 {
        let own = self.most_pieces(ranks);
        own as f64 * self.piece + self.talk(ranks, link) + self.update
    }

    /// Time of the sum and of the two small gathers of a step `[s]`; that of adding alone where
    /// there is one rank.
    #[must_use]
    pub fn talk(&self, ranks: usize, link: Link) -> f64 {
        let add = self.adding * self.most_pieces(ranks) as f64;
        if ranks < 2 {
            return add * self.parameters as f64;
        }
        let (n, c) = (ranks as f64, self.parameters.div_ceil(CHUNK).max(1) as f64);
        let numbers = self.parameters as f64 / c;
        let leave = 4.0 * numbers / link.bandwidth;
        // A chunk moves on when it has been added to, and has left.
        let (pace, hop) = (
            leave.max(add * numbers),
            leave + link.latency + add * numbers,
        );
        let along = (2.0 * n - 2.0) * hop + (c - 1.0) * pace;
        let through = match ranks {
            2 => 0.0,
            _ => 2.0 * c * pace + (n - 2.0) * hop - pace,
        };
        // The rank above another one in the tree is without its lowest binary one.
        let deepest = (0..ranks).map(usize::count_ones).max().unwrap_or(0);
        along.max(through) + 4.0 * f64::from(deepest) * link.latency
    }

    /// The part of its time that so many ranks work on gradients, against one rank.
    #[must_use]
    pub fn efficiency(&self, ranks: usize, link: Link) -> f64 {
        self.step(1, link) / (ranks as f64 * self.step(ranks, link))
    }

    fn most_pieces(&self, ranks: usize) -> usize {
        let shares = (0..ranks).map(|rank| share_of(self.pieces, rank, ranks).len());
        shares.max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests;
