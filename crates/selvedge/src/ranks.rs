//! The ranks of this job: one process, unless `mpirun` or `srun` has started several.
//!
//! Rank 0 talks to people; a rank that fails says so and ends the others.

use std::sync::OnceLock;
use std::time::Duration;

use selvedge_cluster::Ranks;

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

/// Ends this rank's part in the job. A failure is said, and ends all other ranks with its exit code:
/// by rank 0 at once, which is enough for what all of them refuse.
pub(crate) fn leave(failure: Option<&anyhow::Error>, code: u8) {
    let ranks = all();
    match failure {
        Some(error) if ranks.is_first() => failure::print(error),
        Some(error) => {
            std::thread::sleep(Duration::from_millis(300));
            let (rank, chain) = (ranks.rank(), failure::chain(error));
            failure::print(&anyhow::anyhow!("rank {rank} has failed: {chain}"));
        }
        None => {}
    }
    ranks.end(failure.map(|_| code));
}
