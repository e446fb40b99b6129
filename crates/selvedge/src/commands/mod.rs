//! One file per command: each takes its arguments and gives its [`Answer`].

mod compare;
mod data;
mod drape;
mod eval;
mod export;
mod fit;
mod info;
mod list;
mod model;
mod rollout;
mod sag;
mod simulate;
mod train;
mod view;

use clap::CommandFactory;
use selvedge::machine::DeviceName;
use serde_json::json;

use crate::cli::{Cli, Command, CompletionsArgs, DataCommand, DrapeCommand, ModelCommand, RunArgs};
use crate::output::Answer;

/// Returns true for a command that several ranks can share.
pub(crate) fn shares(command: &Command) -> bool {
    matches!(command, Command::Train(_))
}

/// Does what is asked.
pub(crate) fn run(command: &Command) -> anyhow::Result<Answer> {
    match command {
        Command::Run(args) => run_scene(args),
        Command::View(args) => view::run(args),
        Command::Export(args) => export::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Data(DataCommand::Generate(args)) => data::generate(args),
        Command::Data(DataCommand::Merge(args)) => data::merge(args),
        Command::Train(args) => train::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Drape(DrapeCommand::Test(args)) => drape::test(args),
        Command::Drape(DrapeCommand::Fit(args)) => drape::fit_to(args),
        Command::Fit(args) => fit::run(args),
        Command::Info(args) => info::run(args),
        Command::List(args) => list::run(args.what),
        Command::Model(ModelCommand::Convert(args)) => model::convert(args),
        Command::Completions(args) => Ok(complete(args)),
    }
}

/// Runs a scene: by the physics, its rest pose alone, or by a model.
fn run_scene(args: &RunArgs) -> anyhow::Result<Answer> {
    match &args.model {
        Some(model) => rollout::run(args, model),
        None if args.machine.device != DeviceName::Cpu => anyhow::bail!(
            "--device is that of a model, and the physics runs on the processor: add --model, or leave --device out"
        ),
        None if args.rest => sag::run(args),
        None => simulate::run(args),
    }
}

/// The script with which a shell completes commands and options.
fn complete(args: &CompletionsArgs) -> Answer {
    let mut script = Vec::new();
    let mut program = Cli::command();
    clap_complete::generate(args.shell, &mut program, "selvedge", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    Answer::new(&script, json!({ "script": script }))
}
