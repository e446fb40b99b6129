//! Threads that stand by while a frame is computed, for loops of a few microseconds.
//!
//! A loop of a small cloth is over before a sleeping thread has woken up. So the threads of
//! rayon's pool are woken once a frame, and until it ends they wait for loops by looking at a
//! number. The thread that computes the frame, the leader, takes part in every loop, and all of it
//! where no other thread is free; it waits only for pieces that another one has begun.
//!
//! `unsafe`: a loop's closure and slices are borrowed for the loop alone, while the threads that
//! help live on. [`Team::lead`] returns, also by a panic, only after all pieces that were taken are
//! done, and none can be taken after.

#![expect(unsafe_code, reason = "borrows that are handed to threads, see above")]

use std::cell::{Cell, UnsafeCell};
use std::hint::spin_loop;
use std::marker::PhantomData;
use std::ops::Range;
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

type Work<'a> = dyn Fn(usize) + Sync + 'a;

/// Looks at the number of the next loop before a thread lets others run.
const PATIENCE: u32 = 20_000;

/// The loop under way.
struct Team {
    /// Number of the loop, its pieces, and the first that nobody has taken: 32, 16 and 16 bits.
    ticket: AtomicU64,
    /// Pieces of the loop that are done.
    done: AtomicUsize,
    /// Written by the leader between loops, read by who holds a piece.
    work: UnsafeCell<Option<ptr::NonNull<Work<'static>>>>,
    /// True once no loop follows.
    is_over: AtomicBool,
}

// SAFETY: `work` is written only between loops, as said at `Team::lead`; what it points to is `Sync`.
unsafe impl Sync for Team {}

thread_local! {
    /// The team that this thread leads; null if none.
    static LED: Cell<*const Team> = const { Cell::new(ptr::null()) };
}

/// Runs `frame` on this thread with the threads of rayon's current pool standing by for the loops
/// of [`over_pieces`] in it.
pub(crate) fn standing_by<R: Send>(frame: impl FnOnce() -> R + Send) -> R {
    if !LED.get().is_null() {
        return frame();
    }
    let team = Team {
        ticket: AtomicU64::new(0),
        done: AtomicUsize::new(0),
        work: UnsafeCell::new(None),
        is_over: AtomicBool::new(false),
    };
    rayon::in_place_scope(|scope| {
        for _ in 1..rayon::current_num_threads() {
            scope.spawn(|_| team.help());
        }
        // Also where the frame panics, before the team's end.
        let _end = OnDrop(|| {
            LED.set(ptr::null());
            team.is_over.store(true, Ordering::Release);
        });
        LED.set(&team);
        frame()
    })
}

/// Calls `work` with each number below `pieces`, on this thread and those that stand by.
fn over_pieces(pieces: usize, work: &Work<'_>) {
    // A loop within a piece of another one is this thread's alone.
    let led = LED.replace(ptr::null());
    let _again = OnDrop(|| LED.set(led));
    // SAFETY: a team that is led lives: `standing_by` takes its address back before it ends.
    match unsafe { led.as_ref() } {
        Some(team) if pieces > 1 && pieces < 1 << 16 => team.lead(pieces, work),
        _ => (0..pieces).for_each(work),
    }
}

/// Pieces of a slice.
#[derive(Clone, Copy)]
pub(crate) enum Cuts<'a> {
    /// Of so many entries each; the last may have fewer.
    Every(usize),
    /// That end at these entries, ascending. What is beyond the last belongs to no piece.
    At(&'a [usize]),
}

/// Calls `work` with each piece of `a`, the pieces of `b` in the same place, and their number;
/// `cuts` are those of `a` and of `b`.
pub(crate) fn over_shares<A: Send, B: Send, const N: usize>(
    a: &mut [A],
    b: [&mut [B]; N],
    cuts: [Cuts<'_>; 2],
    work: impl Fn(usize, &mut [A], [&mut [B]; N]) + Sync,
) {
    let count = cuts[0].count(a.len());
    let (a, b) = (Pieces::of(a), b.map(Pieces::of));
    over_pieces(count, &|piece| {
        // SAFETY: each number comes once, and pieces do not overlap.
        let (a, b) = unsafe {
            let b = b.each_ref().map(|b| b.get(cuts[1].piece(piece)));
            (a.get(cuts[0].piece(piece)), b)
        };
        work(piece, a, b);
    });
}

impl Cuts<'_> {
    /// Number of the pieces of `count` entries.
    fn count(self, count: usize) -> usize {
        match self {
            Self::Every(share) => count.div_ceil(share),
            Self::At(ends) => ends.len(),
        }
    }

    /// A piece, as far as there are entries. Pieces do not overlap.
    fn piece(self, piece: usize) -> Range<usize> {
        match self {
            Self::Every(share) => share * piece..share * (piece + 1),
            Self::At(ends) => {
                let start = piece.checked_sub(1).map_or(0, |before| ends[before]);
                start..ends[piece].max(start)
            }
        }
    }
}

/// A slice that is given away in pieces.
struct Pieces<'a, A> {
    first: *mut A,
    count: usize,
    slice: PhantomData<&'a mut [A]>,
}

// SAFETY: a piece goes to one thread, which may have it as `A: Send`.
unsafe impl<A: Send> Sync for Pieces<'_, A> {}

impl<'a, A> Pieces<'a, A> {
    fn of(slice: &'a mut [A]) -> Self {
        Self {
            count: slice.len(),
            first: slice.as_mut_ptr(),
            slice: PhantomData,
        }
    }

    /// These entries, as far as there are any.
    ///
    /// # Safety
    ///
    /// No entry is in two ranges.
    unsafe fn get(&self, range: Range<usize>) -> &'a mut [A] {
        let [from, to] = [range.start, range.end].map(|end| end.min(self.count));
        // SAFETY: within the slice, and nobody else has the entries.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(from), to - from) }
    }
}

impl Team {
    /// Calls `work` with each number below `pieces`. Only the leader calls it.
    fn lead(&self, pieces: usize, work: &Work<'_>) {
        let number = (self.ticket.load(Ordering::Relaxed) >> 32) + 1;
        self.done.store(0, Ordering::Relaxed);
        // SAFETY: all pieces of the last loop are done, and none of this one can be taken yet, so
        // nobody reads `work`. The longer life is never used: the guard below waits for all pieces.
        unsafe {
            let work = std::mem::transmute::<ptr::NonNull<Work<'_>>, ptr::NonNull<Work<'static>>>(
                work.into(),
            );
            *self.work.get() = Some(work);
        }
        let ticket = number << 32 | (pieces as u64) << 16;
        self.ticket.store(ticket, Ordering::Release);
        let _wait = OnDrop(|| {
            // After a panic the pieces that nobody has taken are left.
            let last = self.ticket.swap(number << 32, Ordering::AcqRel);
            let taken = (last & 0xffff) as usize;
            let mut looks = 0;
            while self.done.load(Ordering::Acquire) < taken {
                look_again(&mut looks);
            }
        });
        while self.take_piece() {}
    }

    /// Takes a piece and does it. Returns false if there is none.
    fn take_piece(&self) -> bool {
        let mut ticket = self.ticket.load(Ordering::Acquire);
        loop {
            let (pieces, next) = (ticket >> 16 & 0xffff, ticket & 0xffff);
            if next >= pieces {
                return false;
            }
            match self.ticket.compare_exchange_weak(
                ticket,
                ticket + 1,
                Ordering::AcqRel,
                Ordering::Acquire,
            ) {
                Err(other) => ticket = other,
                Ok(_) => {
                    let _count = OnDrop(|| {
                        self.done.fetch_add(1, Ordering::Release);
                    });
                    // SAFETY: the leader wrote it before the ticket, and waits for this piece.
                    let work = unsafe { (*self.work.get()).map(|work| work.as_ref()) };
                    if let Some(work) = work {
                        work(next as usize);
                    }
                    return true;
                }
            }
        }
    }

    /// Takes pieces of loops until the frame is over.
    fn help(&self) {
        let mut looks = 0;
        while !self.is_over.load(Ordering::Acquire) {
            match self.take_piece() {
                true => looks = 0,
                false => look_again(&mut looks),
            }
        }
    }
}

/// Waits for a moment, longer from the [`PATIENCE`]th time on.
fn look_again(looks: &mut u32) {
    *looks += 1;
    match *looks < PATIENCE {
        true => spin_loop(),
        false => std::thread::yield_now(),
    }
}

/// Runs its closure when it is dropped.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::thread::{ThreadId, current, sleep};
    use std::time::Duration;

    fn in_pool<R: Send>(threads: usize, frame: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| standing_by(frame))
    }

    /// A piece for each entry.
    fn alone<A: Send>(entries: &mut [A], work: impl Fn(usize, &mut A) + Sync) {
        over_shares(
            entries,
            [] as [&mut [()]; 0],
            [Cuts::Every(1); 2],
            |piece, entry, _| {
                work(piece, &mut entry[0]);
            },
        );
    }

    #[test]
    fn every_entry_is_seen_once() {
        for threads in [1, 2, 5] {
            in_pool(threads, || {
                for round in 0..2000_usize {
                    let (mut a, mut b) = (vec![round; 37 + round % 7], vec![1; 90]);
                    over_shares(
                        &mut a,
                        [&mut b],
                        [Cuts::Every(5), Cuts::Every(10)],
                        |piece, a, [b]| {
                            a.iter_mut().for_each(|entry| *entry += piece);
                            b.iter_mut().for_each(|entry| *entry *= 2);
                        },
                    );
                    assert!(a.iter().enumerate().all(|(k, a)| *a == round + k / 5));
                    let seen = a.len().div_ceil(5) * 10;
                    assert!(b.iter().enumerate().all(|(k, b)| (*b == 2) == (k < seen)));
                }
            });
        }
    }

    #[test]
    fn threads_that_stand_by_help() {
        let seen: Vec<ThreadId> = in_pool(2, || {
            let mut seen = vec![current().id(); 2];
            for _ in 0..100 {
                alone(&mut seen, |_, seen| {
                    sleep(Duration::from_millis(10));
                    *seen = current().id();
                });
                if seen[0] != seen[1] {
                    break;
                }
            }
            seen
        });
        assert_ne!(seen[0], seen[1]);
    }

    #[test]
    fn panics_come_out_and_leave_nothing_behind() {
        for guilty in 0..4 {
            let result = catch_unwind(AssertUnwindSafe(|| {
                in_pool(2, || {
                    let mut entries = [0; 4];
                    alone(&mut entries, |piece, _| {
                        sleep(Duration::from_millis(1));
                        assert_ne!(piece, guilty, "the guilty piece");
                    });
                });
            }));
            assert!(result.is_err(), "piece {guilty}");
        }
        in_pool(2, || {
            let mut entries = [0; 64];
            alone(&mut entries, |piece, entry| {
                *entry = piece;
            });
            assert!(entries.iter().enumerate().all(|(k, entry)| k == *entry));
        });
    }
}
