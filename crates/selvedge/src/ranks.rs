//! The ranks of this job: one process, unless `mpirun` or `srun` has started several.
//!
//! Rank 0 talks to people; a rank that fails says so and tells the others, so that all end.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use selvedge_cluster::{ClusterError, Ranks};

use crate::failure::{self, wrong};
use crate::{interrupt, progress};

static RANKS: OnceLock<Ranks> = OnceLock::new();

/// Joins the other ranks, where there are some; `shares` says that the command is for several.
pub(crate) fn open(shares: bool) -> anyhow::Result<()> {
    let joined = joined()?;
    let ranks = RANKS.get_or_init(|| joined);
    if !ranks.are_several() {
        return Ok(());
    }
    if !ranks.is_first() {
        progress::silence();
    }
    // A rank that ends early takes the others with it.
    interrupt::keep_results();
    if shares {
        Ok(())
    } else {
        Err(wrong(
            "this command is of one rank: start it without mpirun; train runs on several, and \
             data generate shares its work with --shard",
        ))
    }
}

#[cfg(feature = "mpi")]
fn joined() -> anyhow::Result<Ranks> {
    if selvedge_cluster::is_launched() {
        Ok(selvedge_cluster::open_mpi()?)
    } else {
        Ok(Ranks::alone())
    }
}

#[cfg(not(feature = "mpi"))]
fn joined() -> anyhow::Result<Ranks> {
    let sizes = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE"].into_iter();
    let mut sizes = sizes.filter_map(|name| std::env::var(name).ok()?.parse::<u32>().ok());
    anyhow::ensure!(
        sizes.all(|size| size < 2),
        "started as one of several ranks, but built without the feature `mpi`: build the program with `cargo build --release -p selvedge --features mpi`, or share the work with --shard"
    );
    Ok(Ranks::alone())
}

/// The ranks of this job.
pub(crate) fn all() -> Ranks {
    RANKS.get().cloned().unwrap_or_else(Ranks::alone)
}

/// Takes leave of the other ranks after the command; `failure` is what this rank has to say.
/// Returns the exit code instead, where another one failed.
pub(crate) fn leave(failure: Option<&anyhow::Error>) -> Option<u8> {
    let ranks = all();
    if !ranks.are_several() {
        failure.iter().for_each(|error| failure::print(error));
        return None;
    }
    let Some(error) = failure else {
        // The launcher ends the others where one was killed: that is no press of Ctrl-C.
        let all_there = if ranks.is_first() { ranks.check_all_there() } else { Ok(()) };
        let error = all_there.and_then(|()| ranks.leave()).err()?;
        // What another rank has to say, it says itself; one that was killed cannot.
        if matches!(error, ClusterError::Gone { .. }) {
            failure::print(&error.into());
        }
        ranks.close();
        return Some(interrupt::EXIT_CODE);
    };
    let is_of_other = error
        .chain()
        .any(|cause| matches!(cause.downcast_ref(), Some(ClusterError::Failed { .. })));
    if !is_of_other {
        ranks.fail(&failure::chain(error));
    }
    if ranks.is_first() {
        failure::print(error);
    } else if !is_of_other && !is_said_by_first(&ranks) {
        failure::print(&anyhow::anyhow!(
            "rank {}: {}",
            ranks.rank(),
            failure::chain(error)
        ));
    }
    ranks.close();
    None
}

/// Waits a moment for rank 0 to fail, too: what all ranks refuse is said once.
fn is_said_by_first(ranks: &Ranks) -> bool {
    let started = Instant::now();
    while started.elapsed() < Duration::from_millis(300) {
        if ranks.has_failed() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    false
}
