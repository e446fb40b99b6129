//! Many machines as one: **ranks**, the processes of one job, numbered from 0.
//!
//! [`Ranks`] sends messages between them and builds all else from that: gathers, and a sum whose
//! order is fixed by its pieces and not by the ranks ([`Ranks::sum_in_order`]). A message goes
//! over a transport: threads of this process ([`threads`]), or MPI with the feature `mpi`. A rank
//! alone needs none ([`Ranks::alone`]).
//!
//! A rank that fails tells the others, and a rank that has ended without a word is found out by
//! those that wait for it; both are errors that name it.
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

mod local;
#[cfg(feature = "mpi")]
mod mpi;
mod ranks;
mod shard;
mod together;
mod transport;

pub use local::threads;
#[cfg(feature = "mpi")]
pub use mpi::{is_launched, open_mpi};
pub use ranks::{Ranks, Traffic};
pub use shard::{Shard, ShardError};
pub use together::{Adding, share_of};
pub use transport::ClusterError;
