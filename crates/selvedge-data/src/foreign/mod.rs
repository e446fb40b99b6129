//! Data of other projects as trajectories and data sets of ours: caches of other programs
//! ([`ForeignSource`]), and arrays of the caller ([`TrajectoryParts`]).
//!
//! Foreign data lack some of what a cloth needs. Nothing is made up in silence: what is missing is
//! an option ([`ImportOptions`]), an error where nobody can know it, a documented default where its
//! source says it. What was resolved is in the data set's configuration. Positions are turned to y
//! up, all faces counter-clockwise in material space.

mod assemble;
mod cache;
mod options;
mod source;

pub use assemble::{TrajectoryParts, Weight};
pub use options::{HandleSource, ImportOptions, RestSource};
pub use source::{ForeignRun, ForeignSource};
