//! Ranks of an MPI job. An error of MPI ends the job: that is its default, and the launcher says
//! which rank it was.

use std::env::var_os;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mpi::Threading;
use mpi::environment::Universe;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Source};

use crate::ranks::Ranks;
use crate::transport::{ClusterError, Transport};

/// Returns true where this process was started as a rank, by `mpirun` or `srun`: by the variables of
/// Open MPI, MPICH and Intel MPI, PMIx (Slurm), MVAPICH.
pub fn is_launched() -> bool {
    let names = [
        "OMPI_COMM_WORLD_SIZE",
        "PMI_SIZE",
        "PMIX_RANK",
        "MV2_COMM_WORLD_SIZE",
    ];
    names.iter().any(|name| var_os(name).is_some())
}

/// Joins the ranks of the MPI job that this process is of. Once per process.
///
/// # Errors
/// An MPI that was started before, or is for one thread only.
pub fn open_mpi() -> Result<Ranks, ClusterError> {
    // What is asked for, and what it can do.
    let started = mpi::initialize_with_threading(Threading::Serialized);
    let (universe, _) = started
        .filter(|(_, can)| *can >= Threading::Serialized)
        .ok_or(ClusterError::Mpi)?;
    let world = universe.world();
    let size = |number| usize::try_from(number).map_err(|_| ClusterError::Mpi);
    let local_rank = world.split_shared(world.rank()).rank();
    let numbers = [size(world.rank())?, size(world.size())?, size(local_rank)?];
    let mpi = Mpi(Mutex::new(Some(universe)));
    Ok(Ranks::new(numbers, Arc::new(mpi)))
}

/// The lock of all calls; nothing after the end.
struct Mpi(Mutex<Option<Universe>>);

impl Mpi {
    fn with<T>(
        &self,
        rank: usize,
        call: impl FnOnce(&SimpleCommunicator) -> T,
    ) -> Result<T, ClusterError> {
        let universe = self.lock();
        let universe = universe.as_ref().ok_or(ClusterError::Gone { rank })?;
        Ok(call(&universe.world()))
    }

    fn lock(&self) -> MutexGuard<'_, Option<Universe>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Transport for Mpi {
    fn send(&self, to: usize, bytes: &[u8]) -> Result<(), ClusterError> {
        self.with(to, |world| world.process_at_rank(to as i32).send(bytes))
    }

    fn receive(&self, from: usize) -> Result<Vec<u8>, ClusterError> {
        self.with(from, |world| {
            world.process_at_rank(from as i32).receive_vec().0
        })
    }

    fn end(&self, failure: Option<u8>) {
        let universe = self.lock().take();
        if let (Some(universe), Some(code)) = (universe, failure) {
            universe.world().abort(code.into());
        }
    }
}
