//! One file per command: each takes its arguments and gives its [`Answer`].

mod compare;
mod completions;
mod convergence;
mod convert;
mod correction;
mod dataset;
mod dataset_import;
mod dataset_inspect;
mod dataset_merge;
mod dataset_plan;
mod evaluate;
mod export;
mod flops;
mod inspect;
mod manual;
mod presets;
mod rollout;
mod sag;
mod simulate;
mod stress;
mod study;
mod train;
mod view;

use crate::cli::{Command, DatasetCommand};
use crate::output::Answer;

/// Returns true for a command that several ranks can share.
pub(crate) fn shares(command: &Command) -> bool {
    match command {
        Command::Dataset(command) => matches!(command, DatasetCommand::Generate(_)),
        Command::Train(_) | Command::Evaluate(_) | Command::Stress(_) => true,
        Command::Study(args) => args.command.is_none(),
        _ => false,
    }
}

/// Does what is asked.
///
/// # Errors
/// What went wrong, from what was being done to its cause.
pub(crate) fn run(command: &Command) -> anyhow::Result<Answer> {
    match command {
        Command::Simulate(args) => simulate::run(args),
        Command::Sag(args) => sag::run(args),
        Command::Dataset(DatasetCommand::Generate(args)) => dataset::generate(args),
        Command::Dataset(DatasetCommand::Plan(args)) => dataset_plan::run(&args.preset),
        Command::Dataset(DatasetCommand::Merge(args)) => dataset_merge::run(args),
        Command::Dataset(DatasetCommand::Import(args)) => dataset_import::run(args),
        Command::Dataset(DatasetCommand::Inspect(args)) => {
            dataset_inspect::run(&args.folder, args.pictures.as_deref())
        }
        Command::Compare(args) => compare::run(args),
        Command::Export(args) => export::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Presets => presets::run(),
        Command::Completions(args) => completions::run(args),
        Command::Manual(args) => manual::run(args),
        Command::Rollout(args) => rollout::run(args),
        Command::View(args) => view::run(args),
        Command::Train(args) => train::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::Study(args) => study::run(args),
        Command::Stress(args) => stress::run(args),
    }
}
