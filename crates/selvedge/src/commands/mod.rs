//! One file per command: each takes its arguments and gives its [`Answer`].

mod compare;
mod dataset;
mod inspect;
mod sag;
mod simulate;

use crate::cli::{Command, DatasetCommand};
use crate::output::Answer;

/// Does what is asked.
///
/// # Errors
/// What went wrong, from what was being done to its cause.
pub(crate) fn run(command: &Command) -> anyhow::Result<Answer> {
    match command {
        Command::Simulate(args) => simulate::run(args),
        Command::Sag(args) => sag::run(args),
        Command::Dataset(DatasetCommand::Generate(args)) => dataset::generate(args),
        Command::Dataset(DatasetCommand::Inspect(args)) => dataset::inspect(&args.folder),
        Command::Compare(args) => compare::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Rollout(_) | Command::Train(_) | Command::Evaluate(_) => {
            anyhow::bail!("this build has no learned simulator yet")
        }
    }
}
