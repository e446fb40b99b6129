//! `selvedge manual`: a manual page of each command, for `man`.

use anyhow::Context;
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use selvedge_data::write_atomically;
use selvedge_lab::folder;
use serde_json::json;

use crate::cli::{Cli, ManualArgs};
use crate::output::{Answer, Facts};

/// Writes a page of each command into the folder.
pub(crate) fn run(args: &ManualArgs) -> anyhow::Result<Answer> {
    let folder = &args.folder;
    folder::check_kind(folder, None)?;
    folder::make_folder(folder)?;
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    let mut pages = Vec::new();
    collect(&program, &mut pages);
    let mut names = Vec::new();
    for man in pages {
        let name = man.get_filename();
        let path = folder.join(&name);
        write_atomically(&path, |file| man.render(file))
            .with_context(|| format!("writing {}", path.display()))?;
        names.push(name);
    }
    let mut facts = Facts::default();
    facts.add("manual pages", names.len());
    facts.add("folder", folder.display());
    Answer::new(facts, &json!({ "folder": folder, "pages": names }))
}

/// Adds the page of a command and those of the commands below it.
fn collect(command: &Command, pages: &mut Vec<Man>) {
    pages.push(Man::new(command.clone()));
    let below = command.get_subcommands();
    for command in below.filter(|command| !command.is_hide_set()) {
        collect(command, pages);
    }
}
