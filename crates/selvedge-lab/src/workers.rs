//! Threads that share jobs.

use anyhow::{Context, Result};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool of so many threads, by default one per processor.
pub(crate) fn pool(threads: Option<usize>) -> Result<ThreadPool> {
    // Zero threads mean one per processor.
    let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0));
    pool.build().context("starting the threads")
}
