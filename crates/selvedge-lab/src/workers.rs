//! Jobs shared among threads. One thread does a job from its start to its end.
//!
//! Each worker has a pool of its own, so that a job that waits for its parts does not begin another
//! job meanwhile: no more jobs are under way than there are workers, and each has its share of the
//! threads. Answers come in the order of the jobs.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use rayon::ThreadPoolBuildError;
use thiserror::Error;

/// Threads that cannot do their work.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum WorkerError {
    #[error("starting the threads: {0}")]
    Start(#[from] ThreadPoolBuildError),
    #[error("a thread has ended early")]
    Ended,
}

/// Does all `jobs` on `threads`, by default one per processor. After a job that fails no other is
/// begun.
pub fn share<J: Sync, R: Send, E: From<WorkerError> + Send>(
    threads: Option<usize>,
    jobs: &[J],
    work: impl Fn(&J) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let threads = threads.unwrap_or_else(processors);
    let workers = threads.min(jobs.len()).max(1);
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let take = || {
        let job = next.fetch_add(1, Ordering::Relaxed);
        (job < jobs.len() && !failed.load(Ordering::Relaxed)).then_some(job)
    };
    let worker = || {
        let pool = pool(threads / workers)?;
        let mut done = Vec::new();
        while let Some(job) = take() {
            let answer = pool.install(|| work(&jobs[job]));
            failed.fetch_or(answer.is_err(), Ordering::Relaxed);
            done.push((job, answer));
        }
        Ok::<_, WorkerError>(done)
    };
    let mut answers = thread::scope(|scope| {
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        let mut answers = Vec::with_capacity(jobs.len());
        for handle in handles {
            let done = handle.join().map_err(|_| WorkerError::Ended)?;
            answers.extend(done?);
        }
        Ok::<_, WorkerError>(answers)
    })?;
    answers.sort_by_key(|(job, _)| *job);
    answers.into_iter().map(|(_, answer)| answer).collect()
}

/// Does one thing with all threads.
pub fn alone<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> R + Send,
) -> Result<R, WorkerError> {
    Ok(pool(threads.unwrap_or_else(processors))?.install(work))
}

fn pool(threads: usize) -> Result<rayon::ThreadPool, WorkerError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1));
    Ok(pool.build()?)
}

fn processors() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct JobError(String);

    impl From<WorkerError> for JobError {
        fn from(error: WorkerError) -> Self {
            Self(error.to_string())
        }
    }

    #[test]
    fn answers_come_in_the_order_of_the_jobs_for_any_number_of_threads() {
        let jobs: Vec<usize> = (0..100).collect();
        for threads in [1, 2, 3, 7] {
            let squares = share(Some(threads), &jobs, |job| Ok::<_, JobError>(job * job)).unwrap();
            assert!(
                squares
                    .iter()
                    .enumerate()
                    .all(|(k, square)| *square == k * k)
            );
        }
        let none: [usize; 0] = [];
        assert!(
            share(Some(2), &none, |job| Ok::<_, JobError>(*job))
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn a_failure_ends_it_and_is_told() {
        let jobs: Vec<usize> = (0..1000).collect();
        let begun = AtomicUsize::new(0);
        let result = share(Some(1), &jobs, |job| {
            begun.fetch_add(1, Ordering::Relaxed);
            if *job == 3 {
                Err(JobError(format!("job {job}")))
            } else {
                Ok(())
            }
        });
        assert_eq!(result.unwrap_err().0, "job 3");
        assert_eq!(begun.into_inner(), 4);
    }
}
