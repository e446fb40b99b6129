//! The ranks as each of them sees them, and what all of them do together, each at the same place of
//! its program.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::transport::{ClusterError, Transport, threads};

/// Numbers of a sum that travel in one message: 128 KiB, so that the first ranks add the next ones
/// while these go on.
const CHUNK: usize = 32 * 1024;

/// Adds the numbers of a range to their sum.
pub type Adding<'a, E> = dyn FnMut(Range<usize>, &mut [f32]) -> Result<(), E> + 'a;

/// The part of `count` things that belongs to `rank` of `ranks`: in a row, and as even as can be.
pub fn share_of(count: usize, rank: usize, ranks: usize) -> Range<usize> {
    count * rank / ranks..count * (rank + 1) / ranks
}

/// The ranks of a job, seen from one of them.
#[derive(Clone)]
pub struct Ranks {
    /// This rank, their number, and that of this one among those of its machine.
    numbers: [usize; 3],
    transport: Arc<dyn Transport>,
    /// Of sums and gathers.
    nanoseconds: Arc<AtomicU64>,
}

impl Ranks {
    /// One rank without others.
    pub fn alone() -> Self {
        threads(1).remove(0)
    }

    /// The ranks that `transport` joins: this one, their number, and that of this one among those of its machine.
    pub(crate) fn new(numbers: [usize; 3], transport: Arc<dyn Transport>) -> Self {
        Self {
            numbers,
            transport,
            nanoseconds: Arc::default(),
        }
    }

    /// This rank, from 0.
    pub fn rank(&self) -> usize {
        self.numbers[0]
    }

    /// The number of this rank, from 0, among those of its machine.
    pub fn local_rank(&self) -> usize {
        self.numbers[2]
    }

    /// The number of ranks.
    pub fn count(&self) -> usize {
        self.numbers[1]
    }

    /// Returns true for rank 0, which writes files and talks to people.
    pub fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Returns true where there are other ranks.
    pub fn are_several(&self) -> bool {
        self.count() > 1
    }

    /// Time spent in sums and gathers so far, waiting included.
    pub fn time_of_talk(&self) -> Duration {
        Duration::from_nanos(self.nanoseconds.load(Ordering::Relaxed))
    }

    /// Ends this rank's part in the job; with the exit code of a failure all other ranks end with it.
    /// Of threads nothing ends.
    pub fn end(&self, failure: Option<u8>) {
        self.transport.end(failure);
    }

    /// The `bytes` of every rank, in their order, on rank 0; nothing on the others.
    pub fn gather(&self, bytes: Vec<u8>) -> Result<Vec<Vec<u8>>, ClusterError> {
        self.timed(|| {
            if !self.is_first() {
                return self.transport.send(0, &bytes).map(|()| Vec::new());
            }
            let others = (1..self.count()).map(|from| self.transport.receive(from));
            std::iter::once(Ok(bytes)).chain(others).collect()
        })
    }

    /// The `bytes` of every rank, in their order, on every rank, by way of rank 0.
    pub fn gather_for_all(&self, bytes: Vec<u8>) -> Result<Vec<Vec<u8>>, ClusterError> {
        let all = self.gather(bytes)?;
        self.timed(|| {
            if !self.is_first() {
                return (0..self.count())
                    .map(|_| self.transport.receive(0))
                    .collect();
            }
            for to in 1..self.count() {
                all.iter()
                    .try_for_each(|bytes| self.transport.send(to, bytes))?;
            }
            Ok(all)
        })
    }

    /// Sums numbers over the ranks in the order of the ranks: rank 0 begins with zeros, each rank
    /// adds its own (`add` is given a range and adds to its sum), and all get the total.
    ///
    /// A rank that adds several pieces one after the other gives the same bits as if one rank had
    /// added all of them. The sum goes along a chain, in chunks that follow one another, and then the
    /// total from the last rank round the others: each sends the numbers twice at most, whatever the
    /// number of ranks and of pieces, which is what the best all-reduce needs.
    pub fn sum_in_order<E: From<ClusterError>>(
        &self,
        total: &mut [f32],
        add: &mut Adding<'_, E>,
    ) -> Result<(), E> {
        let (rank, last) = (self.rank(), self.count() - 1);
        let before = if rank == 0 { last } else { rank - 1 };
        for chunk in chunks(total.len()) {
            let sum = &mut total[chunk.clone()];
            match rank {
                0 => sum.fill(0.0),
                _ => self.timed(|| self.receive_numbers(before, sum))?,
            }
            add(chunk, sum)?;
            if rank < last {
                self.timed(|| self.transport.send(rank + 1, &to_bytes(sum)))?;
            }
        }
        // Nobody sends a total before it has all sums, so that no two ranks wait for each other.
        for chunk in chunks(total.len()) {
            let part = &mut total[chunk];
            if rank < last {
                self.timed(|| self.receive_numbers(before, part))?;
            }
            let next = (rank + 1) % (last + 1);
            if next < last {
                self.timed(|| self.transport.send(next, &to_bytes(part)))?;
            }
        }
        Ok(())
    }

    fn receive_numbers(&self, from: usize, numbers: &mut [f32]) -> Result<(), ClusterError> {
        let bytes = self.transport.receive(from)?;
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

    /// Counts the time of `work` as that of the ranks' talk.
    fn timed<T>(&self, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let answer = work();
        let spent = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds.fetch_add(spent, Ordering::Relaxed);
        answer
    }
}

impl std::fmt::Debug for Ranks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "rank {} of {}", self.rank(), self.count())
    }
}

fn chunks(count: usize) -> impl Iterator<Item = Range<usize>> {
    let starts = (0..count).step_by(CHUNK);
    starts.map(move |start| start..count.min(start + CHUNK))
}

fn to_bytes(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

#[cfg(test)]
mod tests;
