//! The ranks as each of them sees them: messages by rank and tag, failures that are told to all,
//! and counts of what went over the wires.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::local::threads;
use crate::transport::{ClusterError, Letter, Transport};

/// A kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tag(u32);

impl Tag {
    const FAILED: Self = Self(1);
    pub(crate) const GATHER: Self = Self(2);
    pub(crate) const SUM: Self = Self(4);
    pub(crate) const TOTAL: Self = Self(5);
    const END: Self = Self(6);
}

/// Waiting without a pause: for answers that are on their way.
const EAGER: Duration = Duration::from_millis(1);
/// The shortest and the longest pause between two looks.
const PAUSES: [Duration; 2] = [Duration::from_micros(50), Duration::from_millis(2)];
/// Between two looks at whether the other one still lives.
const LOOK: Duration = Duration::from_millis(20);
/// Waiting for a rank that works on the same thing as this one.
const PATIENCE: Duration = Duration::from_secs(1800);

/// What this rank sent, and the time of its talk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes sent to other ranks.
    pub bytes: u64,
    /// Time spent in sums and gathers, waiting included.
    pub time: Duration,
}

/// The ranks of a job, seen from one of them.
#[derive(Clone)]
pub struct Ranks {
    inner: Arc<Inner>,
}

struct Inner {
    transport: Box<dyn Transport>,
    inbox: Mutex<Inbox>,
    has_failed: AtomicBool,
    bytes: AtomicU64,
    nanoseconds: AtomicU64,
}

#[derive(Default)]
struct Inbox {
    letters: VecDeque<Letter>,
    failure: Option<ClusterError>,
}

impl Ranks {
    /// One rank without others.
    pub fn alone() -> Self {
        threads(1).remove(0)
    }

    /// The ranks that `transport` joins.
    pub(crate) fn new(transport: Box<dyn Transport>) -> Self {
        Self {
            inner: Arc::new(Inner {
                transport,
                inbox: Mutex::default(),
                has_failed: AtomicBool::new(false),
                bytes: AtomicU64::new(0),
                nanoseconds: AtomicU64::new(0),
            }),
        }
    }

    /// This rank, from 0.
    pub fn rank(&self) -> usize {
        self.inner.transport.rank()
    }

    /// The number of this rank, from 0, among those of its machine.
    pub fn local_rank(&self) -> usize {
        self.inner.transport.local_rank()
    }

    /// The number of ranks.
    pub fn count(&self) -> usize {
        self.inner.transport.count()
    }

    /// The other ranks.
    pub(crate) fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let own = self.rank();
        (0..self.count()).filter(move |rank| *rank != own)
    }

    /// Returns true for rank 0, which writes files and talks to people.
    pub fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Returns true where there are other ranks.
    pub fn are_several(&self) -> bool {
        self.count() > 1
    }

    /// What was sent so far, and the time of it.
    pub fn traffic(&self) -> Traffic {
        let inner = &self.inner;
        Traffic {
            bytes: inner.bytes.load(Ordering::Relaxed),
            time: Duration::from_nanos(inner.nanoseconds.load(Ordering::Relaxed)),
        }
    }

    /// Counts the time of `work` as that of the ranks' talk.
    pub(crate) fn timed<T>(&self, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let answer = work();
        let spent = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.inner.nanoseconds.fetch_add(spent, Ordering::Relaxed);
        answer
    }

    /// Sends a message to another rank and returns at once.
    pub(crate) fn send(&self, to: usize, tag: Tag, bytes: Vec<u8>) -> Result<(), ClusterError> {
        let length = bytes.len() as u64;
        self.inner.bytes.fetch_add(length, Ordering::Relaxed);
        self.inner.transport.send(to, tag.0, bytes)
    }

    /// Waits for the next message of this tag from `from`.
    ///
    /// # Errors
    /// A rank that failed, one that has ended, or one that is silent for half an hour.
    pub(crate) fn receive(&self, from: usize, tag: Tag) -> Result<Vec<u8>, ClusterError> {
        self.wait(from, tag, PATIENCE)
    }

    fn wait(&self, from: usize, tag: Tag, patience: Duration) -> Result<Vec<u8>, ClusterError> {
        let (started, mut looked, mut pause) = (Instant::now(), Instant::now(), PAUSES[0]);
        let is_it = |letter: &Letter| letter.from == from && letter.tag == tag.0;
        loop {
            if let Some(letter) = self.take(&is_it)? {
                return Ok(letter.bytes);
            }
            if looked.elapsed() > LOOK {
                looked = Instant::now();
                if let Some(error) = self.missing(from..from + 1) {
                    // It may have written before it ended.
                    let letter = self.take(&is_it)?.ok_or(error)?;
                    return Ok(letter.bytes);
                }
            }
            let waited = started.elapsed();
            if waited > patience {
                let seconds = patience.as_secs();
                let rank = from;
                return Err(ClusterError::Silent { rank, seconds });
            }
            // What this rank has sent moves on only while it looks.
            if waited < EAGER || self.inner.transport.is_sending() {
                thread::yield_now();
            } else {
                thread::sleep(pause);
                pause = (pause * 5 / 4).min(PAUSES[1]);
            }
        }
    }

    /// Waits until what was sent has reached `to`: large messages stand still while this rank works
    /// on something else.
    pub(crate) fn flush(&self, to: usize) -> Result<(), ClusterError> {
        let is_none = |_: &Letter| false;
        let started = Instant::now();
        let mut looked = started;
        while self.inner.transport.is_sending() {
            self.take(&is_none)?;
            if looked.elapsed() > LOOK {
                looked = Instant::now();
                self.missing(to..to + 1).map_or(Ok(()), Err)?;
            }
            if started.elapsed() > PATIENCE {
                let seconds = PATIENCE.as_secs();
                return Err(ClusterError::Silent { rank: to, seconds });
            }
            thread::yield_now();
        }
        Ok(())
    }

    /// Takes the first message that is asked for out of those that are there.
    fn take(&self, is_it: &dyn Fn(&Letter) -> bool) -> Result<Option<Letter>, ClusterError> {
        // Messages are taken from the carrier under the lock, or two threads could swap them.
        let mut inbox = self.inbox();
        self.fetch(&mut inbox)?;
        if let Some(place) = inbox.letters.iter().position(is_it) {
            return Ok(inbox.letters.remove(place));
        }
        match &inbox.failure {
            Some(failure) => Err(failure.clone()),
            None => Ok(None),
        }
    }

    fn fetch(&self, inbox: &mut Inbox) -> Result<(), ClusterError> {
        while let Some(letter) = self.inner.transport.poll()? {
            match Tag(letter.tag) {
                Tag::FAILED => {
                    let message = String::from_utf8_lossy(&letter.bytes).into_owned();
                    let rank = letter.from;
                    let failure = ClusterError::Failed { rank, message };
                    inbox.failure.get_or_insert(failure);
                    self.inner.has_failed.store(true, Ordering::Relaxed);
                }
                _ => inbox.letters.push_back(letter),
            }
        }
        Ok(())
    }

    fn missing(&self, mut ranks: Range<usize>) -> Option<ClusterError> {
        let transport = &self.inner.transport;
        let rank = ranks.find(|rank| !transport.is_alive(*rank))?;
        let place = transport.place(rank);
        Some(ClusterError::Gone { rank, place })
    }

    /// Tells all other ranks that this one has failed: whoever waits for anybody ends with that.
    pub fn fail(&self, message: &str) {
        self.tell_others(Tag::FAILED, message.as_bytes());
    }

    fn tell_others(&self, tag: Tag, bytes: &[u8]) {
        for to in self.others() {
            // Who cannot be told is no longer there.
            let _ = self.send(to, tag, bytes.to_vec());
        }
    }

    /// Returns true once another rank has failed.
    pub fn has_failed(&self) -> bool {
        if let Ok(mut inbox) = self.inner.inbox.try_lock() {
            // What the carrier says is said again to whoever waits.
            let _ = self.fetch(&mut inbox);
        }
        self.inner.has_failed.load(Ordering::Relaxed)
    }

    /// Waits until rank 0 has done all that it does alone, and takes leave of the others.
    pub fn leave(&self) -> Result<(), ClusterError> {
        if self.is_first() {
            self.tell_others(Tag::END, &[]);
        } else {
            self.wait(0, Tag::END, Duration::MAX)?;
        }
        self.close();
        Ok(())
    }

    /// Fails where another rank is known to have ended: before [`Self::leave`] none does.
    pub fn check_all_there(&self) -> Result<(), ClusterError> {
        self.missing(0..self.count()).map_or(Ok(()), Err)
    }

    /// Takes leave of the others without waiting for them longer than a few seconds.
    pub fn close(&self) {
        self.inner.transport.close();
    }

    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        // A panic elsewhere does not make messages wrong.
        let inbox = self.inner.inbox.lock();
        inbox.unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for Ranks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "rank {} of {}", self.rank(), self.count())
    }
}
