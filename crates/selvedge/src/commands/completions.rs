//! `selvedge completions`: a shell's script that completes commands and options.

use clap::CommandFactory;
use serde_json::json;

use crate::cli::{Cli, CompletionsArgs};
use crate::output::Answer;

/// Returns the script of a shell.
pub(crate) fn run(args: &CompletionsArgs) -> anyhow::Result<Answer> {
    let mut script = Vec::new();
    let mut program = Cli::command();
    clap_complete::generate(args.shell, &mut program, "selvedge", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    Answer::new(&script, &json!({ "script": script }))
}
