//! A hand-out of jobs that differ in length: whoever is free gets the next one.
//!
//! Rank 0 hands out and takes answers; its own workers ask like all others. Answers arrive in any
//! order, each with the number of its job.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;

use crate::error::ClusterError;
use crate::ranks::{Ranks, Tag};

/// The end of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Done {
    /// It is done.
    Answer(Vec<u8>),
    /// An end was asked for while it was under way.
    Stopped,
    /// It failed, in words.
    Failed(String),
}

/// Jobs to be handed out.
#[derive(Clone, Copy, Debug)]
pub struct HandOut<'a> {
    /// The ranks that share them.
    pub ranks: &'a Ranks,
    /// Jobs that this rank does at once.
    pub workers: usize,
    /// Number of jobs, the same on every rank.
    pub jobs: usize,
}

/// A hand-out that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HandOutError<E> {
    /// A rank failed.
    Cluster(ClusterError),
    /// An answer could not be taken.
    Take(E),
}

impl<E> From<ClusterError> for HandOutError<E> {
    fn from(error: ClusterError) -> Self {
        Self::Cluster(error)
    }
}

/// A worker's word to rank 0: its number, the number of its job, how that ended, and its answer.
struct Word {
    worker: usize,
    job: usize,
    kind: u8,
    bytes: Vec<u8>,
}

const READY: u8 = 0;
const ANSWER: u8 = 1;
const STOPPED: u8 = 2;
const FAILED: u8 = 3;

impl Word {
    fn ready(worker: usize) -> Self {
        Self {
            worker,
            job: 0,
            kind: READY,
            bytes: Vec::new(),
        }
    }

    fn of(worker: usize, job: usize, done: Done) -> Self {
        let (kind, bytes) = match done {
            Done::Answer(bytes) => (ANSWER, bytes),
            Done::Stopped => (STOPPED, Vec::new()),
            Done::Failed(message) => (FAILED, message.into_bytes()),
        };
        Self {
            worker,
            job,
            kind,
            bytes,
        }
    }

    fn pack(self) -> Vec<u8> {
        let mut packed = self.bytes;
        packed.extend((self.worker as u64).to_le_bytes());
        packed.extend((self.job as u64).to_le_bytes());
        packed.push(self.kind);
        packed
    }

    fn unpack(mut bytes: Vec<u8>) -> Option<Self> {
        let kind = bytes.pop()?;
        let mut number = || {
            let place = bytes.len().checked_sub(8)?;
            let tail = bytes.split_off(place);
            usize::try_from(u64::from_le_bytes(tail.try_into().ok()?)).ok()
        };
        let (job, worker) = (number()?, number()?);
        Some(Self {
            worker,
            job,
            kind,
            bytes,
        })
    }
}

/// Does all jobs, on whichever rank is free; `work` does one on a worker of some rank, `take` has
/// the answers on rank 0. Returns true on rank 0 where all were done, and on the others where
/// nobody asked them to stop.
///
/// After a job that failed or was stopped no other is begun, and [`Ranks::is_halted`] tells those
/// under way.
pub fn hand_out<E: Send>(
    plan: HandOut<'_>,
    work: &(dyn Fn(usize) -> Done + Sync),
    take: &mut dyn FnMut(usize, Vec<u8>) -> Result<(), E>,
) -> Result<bool, HandOutError<E>> {
    let ranks = plan.ranks;
    let workers = plan.workers.max(1);
    let told = ranks.gather_for_all((workers as u64).to_le_bytes().to_vec())?;
    thread::scope(|scope| {
        let own: Vec<_> = (0..workers)
            .map(|worker| scope.spawn(move || serve(ranks, worker, work)))
            .collect();
        let handed = if ranks.is_first() {
            let mut desk = Desk::new(plan, &told);
            let handed = desk.run(take);
            if handed.is_err() {
                ranks.halt();
                // Its own workers wait for a word.
                (0..workers).for_each(|worker| {
                    let _ = ranks.send(0, job_tag(worker), Vec::new());
                });
            }
            handed
        } else {
            Ok(true)
        };
        let mut outcome = handed.map(|all| all && (ranks.is_first() || !ranks.is_halted()));
        for worker in own {
            if let (Ok(Err(error)), Ok(_)) = (worker.join(), &outcome) {
                outcome = Err(error.into());
            }
        }
        outcome
    })
}

fn job_tag(worker: usize) -> Tag {
    Tag(Tag::JOB + worker as u32)
}

/// Asks for jobs and does them until there are no more.
fn serve(
    ranks: &Ranks,
    worker: usize,
    work: &(dyn Fn(usize) -> Done + Sync),
) -> Result<(), ClusterError> {
    let mut word = Word::ready(worker);
    loop {
        ranks.send(0, Tag::ASK, word.pack())?;
        let answer = ranks.receive_patiently(0, job_tag(worker))?;
        let Some(job) = number_of(&answer) else {
            return Ok(());
        };
        let done = catch_unwind(AssertUnwindSafe(|| work(job)));
        let done = done.unwrap_or_else(|_| Done::Failed(format!("job {job} panicked")));
        word = Word::of(worker, job, done);
    }
}

fn number_of(bytes: &[u8]) -> Option<usize> {
    usize::try_from(u64::from_le_bytes(bytes.try_into().ok()?)).ok()
}

/// Rank 0 at the hand-out.
struct Desk<'a> {
    plan: HandOut<'a>,
    /// Workers of each rank that have not been sent home.
    left: Vec<usize>,
    next: usize,
    done: usize,
    goes_on: bool,
}

impl<'a> Desk<'a> {
    fn new(plan: HandOut<'a>, told: &[Vec<u8>]) -> Self {
        let left = told.iter().map(|bytes| number_of(bytes).unwrap_or(0));
        Self {
            plan,
            left: left.collect(),
            next: 0,
            done: 0,
            goes_on: true,
        }
    }

    fn run<E>(
        &mut self,
        take: &mut dyn FnMut(usize, Vec<u8>) -> Result<(), E>,
    ) -> Result<bool, HandOutError<E>> {
        let ranks = self.plan.ranks;
        let mut failure = None;
        loop {
            let busy = self.left.iter().enumerate();
            let busy: Vec<usize> = busy
                .filter(|(_, left)| **left > 0)
                .map(|(r, _)| r)
                .collect();
            if busy.is_empty() {
                break;
            }
            let letter = ranks.receive_any(Tag::ASK, &busy)?;
            let rank = letter.from;
            let Some(word) = Word::unpack(letter.bytes) else {
                continue;
            };
            let worker = word.worker;
            if let Err(error) = self.hear(rank, word, take) {
                failure.get_or_insert(error);
                self.stop();
            }
            let more = self.goes_on && self.next < self.plan.jobs;
            let answer = match more {
                true => (self.next as u64).to_le_bytes().to_vec(),
                false => Vec::new(),
            };
            match more {
                true => self.next += 1,
                false => self.left[rank] = self.left[rank].saturating_sub(1),
            }
            ranks.send(rank, job_tag(worker), answer)?;
        }
        match failure {
            Some(error) => Err(error),
            None => Ok(self.done == self.plan.jobs),
        }
    }

    fn hear<E>(
        &mut self,
        rank: usize,
        word: Word,
        take: &mut dyn FnMut(usize, Vec<u8>) -> Result<(), E>,
    ) -> Result<(), HandOutError<E>> {
        match word.kind {
            ANSWER => {
                take(word.job, word.bytes).map_err(HandOutError::Take)?;
                self.done += 1;
            }
            STOPPED => self.stop(),
            FAILED => {
                let message = String::from_utf8_lossy(&word.bytes).into_owned();
                return Err(ClusterError::Failed { rank, message }.into());
            }
            _ => {}
        }
        Ok(())
    }

    fn stop(&mut self) {
        if self.goes_on {
            self.goes_on = false;
            self.plan.ranks.halt();
        }
    }
}

#[cfg(test)]
mod tests;
