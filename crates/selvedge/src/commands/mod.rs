//! One file per command: each takes its arguments and gives its [`Answer`].

mod compare;
mod completions;
mod data;
mod data_import;
mod data_merge;
mod eval;
mod export;
mod info;
mod list;
mod model;
mod rollout;
mod run;
mod sag;
mod simulate;
mod study;
mod train;
mod view;

use crate::cli::{Command, DataCommand, ModelCommand};
use crate::output::Answer;

/// Returns true for a command that several ranks can share.
pub(crate) fn shares(command: &Command) -> bool {
    matches!(command, Command::Train(_))
}

/// Does what is asked.
pub(crate) fn run(command: &Command) -> anyhow::Result<Answer> {
    match command {
        Command::Run(args) => run::run(args),
        Command::View(args) => view::run(args),
        Command::Export(args) => export::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Data(DataCommand::Generate(args)) => data::generate(args),
        Command::Data(DataCommand::Import(args)) => data_import::run(args),
        Command::Data(DataCommand::Merge(args)) => data_merge::run(args),
        Command::Train(args) => train::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Study(args) => study::run(args),
        Command::Info(args) => info::run(args),
        Command::List(args) => list::run(args.what),
        Command::Model(ModelCommand::Convert(args)) => model::convert(args),
        Command::Completions(args) => completions::run(args),
    }
}
