//! Operations that all ranks do together, each at the same place of its program.

use std::ops::Range;

use crate::ranks::{Ranks, Tag};
use crate::transport::ClusterError;

/// Numbers of a sum that travel in one message: 128 KiB, so that the first ranks add the next ones
/// while these go on.
pub(crate) const CHUNK: usize = 32 * 1024;

/// Adds the numbers of a range to their sum.
pub type Adding<'a, E> = dyn FnMut(Range<usize>, &mut [f32]) -> Result<(), E> + 'a;

/// The part of `count` things that belongs to `rank` of `ranks`: in a row, and as even as can be.
pub fn share_of(count: usize, rank: usize, ranks: usize) -> Range<usize> {
    count * rank / ranks..count * (rank + 1) / ranks
}

impl Ranks {
    /// The `bytes` of every rank, in their order, on rank 0; nothing on the others.
    pub fn gather(&self, bytes: Vec<u8>) -> Result<Vec<Vec<u8>>, ClusterError> {
        self.timed(|| {
            if self.is_first() {
                self.hear_all(bytes)
            } else {
                self.send(0, Tag::GATHER, bytes).map(|()| Vec::new())
            }
        })
    }

    /// The `bytes` of every rank, in their order, on every rank. Each tells them to all others: for
    /// few bytes.
    pub fn gather_for_all(&self, bytes: Vec<u8>) -> Result<Vec<Vec<u8>>, ClusterError> {
        self.timed(|| {
            for to in self.others() {
                self.send(to, Tag::GATHER, bytes.clone())?;
            }
            self.hear_all(bytes)
        })
    }

    /// What all others send, and in its place what is this rank's own.
    fn hear_all(&self, own: Vec<u8>) -> Result<Vec<Vec<u8>>, ClusterError> {
        let mut all = vec![own; self.count()];
        for from in self.others() {
            all[from] = self.receive(from, Tag::GATHER)?;
        }
        Ok(all)
    }

    /// Sums numbers over the ranks in the order of the ranks: rank 0 begins with zeros, each rank
    /// adds its own (`add` is given a range and adds to its sum), and all get the total.
    ///
    /// A rank that adds several pieces one after the other gives the same bits as if one rank had
    /// added all of them. The sum goes along a chain, in chunks that follow one another, and the
    /// totals go round from the last rank: each rank sends the numbers twice at most, whatever the
    /// number of ranks and of pieces, which is what the best all-reduce needs.
    pub fn sum_in_order<E: From<ClusterError>>(
        &self,
        total: &mut [f32],
        add: &mut Adding<'_, E>,
    ) -> Result<(), E> {
        let (rank, last) = (self.rank(), self.count() - 1);
        let mut sum = vec![0.0; CHUNK.min(total.len())];
        for chunk in chunks(total.len()) {
            let sum = &mut sum[..chunk.len()];
            match rank {
                0 => sum.fill(0.0),
                _ => self.timed(|| self.receive_numbers(rank - 1, Tag::SUM, sum))?,
            }
            add(chunk.clone(), sum)?;
            if rank == last {
                total[chunk].copy_from_slice(sum);
            }
            if last > 0 {
                let next = (rank + 1) % (last + 1);
                let tag = if rank == last { Tag::TOTAL } else { Tag::SUM };
                self.timed(|| self.send(next, tag, to_bytes(sum)))?;
            }
        }
        if rank < last {
            self.timed(|| self.pass_totals(total))?;
        }
        self.timed(|| self.flush((rank + 1) % (last + 1)))?;
        Ok(())
    }

    /// Takes the totals from the rank before, and hands them on to all but the last.
    fn pass_totals(&self, total: &mut [f32]) -> Result<(), ClusterError> {
        let (rank, last) = (self.rank(), self.count() - 1);
        let before = if rank == 0 { last } else { rank - 1 };
        for chunk in chunks(total.len()) {
            let part = &mut total[chunk];
            self.receive_numbers(before, Tag::TOTAL, part)?;
            if rank + 1 < last {
                self.send(rank + 1, Tag::TOTAL, to_bytes(part))?;
            }
        }
        Ok(())
    }

    fn receive_numbers(
        &self,
        from: usize,
        tag: Tag,
        numbers: &mut [f32],
    ) -> Result<(), ClusterError> {
        let bytes = self.receive(from, tag)?;
        let (expected, found) = (size_of_val(numbers), bytes.len());
        if expected != found {
            return Err(ClusterError::Size {
                rank: from,
                expected,
                found,
            });
        }
        let (words, _) = bytes.as_chunks();
        for (number, word) in numbers.iter_mut().zip(words) {
            *number = f32::from_le_bytes(*word);
        }
        Ok(())
    }
}

fn chunks(count: usize) -> impl Iterator<Item = Range<usize>> {
    let starts = (0..count).step_by(CHUNK);
    starts.map(move |start| start..count.min(start + CHUNK))
}

fn to_bytes(numbers: &[f32]) -> Vec<u8> {
    let mut bytes = vec![0; size_of_val(numbers)];
    let (words, _) = bytes.as_chunks_mut();
    for (word, number) in words.iter_mut().zip(numbers) {
        *word = number.to_le_bytes();
    }
    bytes
}

#[cfg(test)]
mod tests;
