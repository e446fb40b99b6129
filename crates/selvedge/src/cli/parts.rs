//! The options of commands whose runs can be made in parts.

use std::path::PathBuf;

use clap::Args;
use selvedge_cluster::Shard;

/// Runs in parts.
#[derive(Debug, Args)]
pub(crate) struct PartArgs {
    /// Only make part I of N of the runs, counted from 1, and write it to the file of --part.
    #[arg(long, value_name = "I/N", requires = "part", conflicts_with = "parts")]
    pub(crate) shard: Option<Shard>,
    /// The file of this part (.json).
    #[arg(long, value_name = "FILE", requires = "shard")]
    pub(crate) part: Option<PathBuf>,
    /// Make no runs, but take those of all parts from these files, separated by commas. All else
    /// must be as in the commands that made them.
    #[arg(long, value_name = "FILES", value_delimiter = ',')]
    pub(crate) parts: Vec<PathBuf>,
}
