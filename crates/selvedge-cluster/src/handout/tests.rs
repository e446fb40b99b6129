//! All jobs are done once, wherever that is; failures name their rank and end the rest.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::*;
use crate::local::threads;

type Outcome = Result<bool, HandOutError<String>>;

/// Hands out so many jobs over `count` ranks of two workers; gives the outcomes by rank and what
/// rank 0 has taken.
fn handed(
    count: usize,
    jobs: usize,
    work: impl Fn(&Ranks, usize) -> Done + Sync,
) -> (Vec<Outcome>, Vec<(usize, Vec<u8>)>) {
    let taken = Mutex::new(Vec::new());
    let outcomes = thread::scope(|scope| {
        let run = |ranks: Ranks| {
            let plan = HandOut {
                ranks: &ranks,
                workers: 2,
                jobs,
            };
            hand_out(plan, &|job| work(&ranks, job), &mut |job, bytes| {
                taken.lock().unwrap().push((job, bytes));
                Ok(())
            })
        };
        let ranks = threads(count).into_iter();
        let all: Vec<_> = ranks.map(|ranks| scope.spawn(move || run(ranks))).collect();
        all.into_iter().map(|rank| rank.join().unwrap()).collect()
    });
    let mut taken = taken.into_inner().unwrap();
    taken.sort();
    (outcomes, taken)
}

/// Waits until another rank has come so far. On a busy machine it may begin so late that all jobs
/// would be done without it.
fn wait_for(flag: &AtomicBool) {
    while !flag.load(Ordering::Acquire) {
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn every_job_is_done_once_on_any_number_of_ranks() {
    for count in [1, 2, 3, 5] {
        let (outcomes, taken) = handed(count, 40, |_, job| {
            thread::sleep(Duration::from_micros(100 * (job % 7) as u64));
            Done::Answer(vec![job as u8; job])
        });
        assert_eq!(outcomes, vec![Ok(true); count]);
        let expected: Vec<_> = (0..40).map(|job| (job, vec![job as u8; job])).collect();
        assert_eq!(taken, expected);
    }
    assert_eq!(handed(3, 0, |_, _| Done::Stopped).0, vec![Ok(true); 3]);
}

#[test]
fn a_failure_names_its_rank_and_no_job_is_begun_after_it() {
    let has_failed = AtomicBool::new(false);
    let (outcomes, taken) = handed(3, 1000, |ranks, job| {
        thread::sleep(Duration::from_millis(1));
        if ranks.rank() == 2 && job > 10 {
            has_failed.store(true, Ordering::Release);
            return Done::Failed(format!("no room for job {job}"));
        }
        if job > 20 {
            wait_for(&has_failed);
        }
        Done::Answer(Vec::new())
    });
    let Err(HandOutError::Cluster(error)) = &outcomes[0] else {
        panic!("{outcomes:?}");
    };
    let message = error.to_string();
    assert!(
        message.starts_with("rank 2 has failed: no room for job"),
        "{message}"
    );
    assert!(taken.len() < 900, "{}", taken.len());
}

#[test]
fn a_panic_is_a_failure() {
    let has_begun = AtomicBool::new(false);
    let (outcomes, _) = handed(2, 20, |ranks, _| match ranks.rank() {
        0 => {
            wait_for(&has_begun);
            thread::sleep(Duration::from_millis(2));
            Done::Answer(Vec::new())
        }
        _ => {
            has_begun.store(true, Ordering::Release);
            panic!("on purpose");
        }
    });
    let Err(HandOutError::Cluster(ClusterError::Failed { rank, message })) = &outcomes[0] else {
        panic!("{outcomes:?}");
    };
    assert_eq!(*rank, 1);
    assert!(message.contains("panicked"), "{message}");
}

#[test]
fn a_stop_on_one_rank_stops_all() {
    let has_stopped = AtomicBool::new(false);
    let (outcomes, taken) = handed(3, 1000, |ranks, job| {
        thread::sleep(Duration::from_millis(1));
        if ranks.rank() == 1 && job > 10 || ranks.is_halted() {
            has_stopped.store(true, Ordering::Release);
            return Done::Stopped;
        }
        if job > 20 {
            wait_for(&has_stopped);
        }
        Done::Answer(Vec::new())
    });
    assert_eq!(outcomes[0], Ok(false));
    assert!(taken.len() < 900, "{}", taken.len());
}

#[test]
fn an_answer_that_cannot_be_taken_ends_it() {
    let outcomes: Vec<Outcome> = thread::scope(|scope| {
        let run = |ranks: Ranks| {
            let plan = HandOut {
                ranks: &ranks,
                workers: 1,
                jobs: 50,
            };
            let work = |_| Done::Answer(Vec::new());
            hand_out(plan, &work, &mut |job, _| match job {
                7 => Err("the disk is full".to_owned()),
                _ => Ok(()),
            })
        };
        let ranks = threads(2).into_iter();
        let all: Vec<_> = ranks.map(|ranks| scope.spawn(move || run(ranks))).collect();
        all.into_iter().map(|rank| rank.join().unwrap()).collect()
    });
    let expected = HandOutError::Take("the disk is full".to_owned());
    assert_eq!(outcomes[0], Err(expected));
}

#[test]
fn a_rank_that_ends_in_the_middle_is_named() {
    let mut ranks = threads(2);
    let (second, first) = (ranks.pop().unwrap(), ranks.pop().unwrap());
    let given = &AtomicBool::new(false);
    let outcome: Outcome = thread::scope(|scope| {
        scope.spawn(move || {
            // It says that it is there, asks for a job, gets it, and is gone.
            second.gather_for_all(1_u64.to_le_bytes().to_vec()).unwrap();
            second.send(0, Tag::ASK, Word::ready(0).pack()).unwrap();
            second.receive(0, Tag(Tag::JOB)).unwrap();
            given.store(true, Ordering::Release);
        });
        let plan = HandOut {
            ranks: &first,
            workers: 1,
            jobs: 5,
        };
        // The first rank works on nothing before: it might do all the jobs alone.
        let work = |_| {
            wait_for(given);
            Done::Answer(Vec::new())
        };
        hand_out(plan, &work, &mut |_, _| Ok(()))
    });
    let Err(HandOutError::Cluster(ClusterError::Gone { rank, .. })) = outcome else {
        panic!("{outcome:?}");
    };
    assert_eq!(rank, 1);
}
