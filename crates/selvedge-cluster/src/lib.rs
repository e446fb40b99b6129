//! Many machines as one: **ranks**, the processes of one job, numbered from 0.
//!
//! [`Ranks`] sends messages between them and builds all else from that: gathers, and a sum whose
//! order is fixed by its pieces and not by the ranks ([`Ranks::sum_in_order`]). A message goes
//! over a transport: threads of this process ([`threads`]), or MPI with the feature `mpi`. A rank
//! alone needs none ([`Ranks::alone`]).
//!
//! A rank of MPI that fails ends the others with it ([`Ranks::end`]); of one that was killed the
//! launcher does.
//!
//! Without ranks there are [`Shard`]s: runs that share the jobs beforehand and never meet.
//!
//! # Examples
//!
//! ```
//! use selvedge_cluster::threads;
//!
//! # fn main() -> Result<(), selvedge_cluster::ClusterError> {
//! let ranks = threads(3);
//! let sums = std::thread::scope(|scope| {
//!     let sum = |ranks: selvedge_cluster::Ranks| {
//!         let own = ranks.rank() as f32;
//!         let mut sum = vec![0.0; 4];
//!         ranks.sum_in_order(&mut sum, &mut |range, sum| {
//!             range.zip(sum).for_each(|(k, sum)| *sum += own * k as f32);
//!             Ok::<_, selvedge_cluster::ClusterError>(())
//!         })?;
//!         Ok(sum)
//!     };
//!     let all: Vec<_> = ranks.into_iter().map(|r| scope.spawn(move || sum(r))).collect();
//!     let all = all.into_iter().map(|rank| rank.join().expect("no panic"));
//!     all.collect::<Result<Vec<Vec<f32>>, selvedge_cluster::ClusterError>>()
//! })?;
//! assert_eq!(sums, vec![vec![0.0, 3.0, 6.0, 9.0]; 3]);
//! # Ok(())
//! # }
//! ```

#[cfg(feature = "mpi")]
mod mpi;
mod ranks;
mod shard;
mod transport;

#[cfg(feature = "mpi")]
pub use mpi::{is_launched, open_mpi};
pub use ranks::{Adding, Ranks, share_of};
pub use shard::{Shard, ShardError};
pub use transport::{ClusterError, threads};
