//! `selvedge`, the command line: reads what is asked, composes the crates that do it, prints a
//! table for people or one JSON object for programs.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted (what was written is whole). What a
//! command answers goes to standard output, everything else to standard error.

mod cli;
mod commands;
mod exporting;
mod failure;
mod film;
mod interrupt;
mod output;
mod place;
mod progress;
mod ranks;
mod scenes;

use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::LevelFilter;

use crate::cli::Cli;
use crate::output::End;

fn main() -> ExitCode {
    let cli = Cli::parse();
    listen_to_traces(cli.verbose);
    if cli.quiet {
        progress::be_quiet();
    }
    let answered = answer(&cli);
    let code = match &answered {
        Ok(End::Complete) => 0,
        Ok(End::Interrupted) => interrupt::EXIT_CODE,
        Err(_) if interrupt::requested() => interrupt::EXIT_CODE,
        Err(error) => failure::exit_code(error),
    };
    ranks::leave(answered.as_ref().err(), code);
    ExitCode::from(code)
}

fn answer(cli: &Cli) -> anyhow::Result<End> {
    interrupt::install()?;
    ranks::open(commands::shares(&cli.command))?;
    if !cli.no_cache {
        selvedge::rest_pose::keep_in_cache();
    }
    let answer = commands::run(&cli.command)?;
    if ranks::all().is_first() {
        answer.print(cli.reader())?;
    }
    answer.outcome()
}

fn listen_to_traces(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        _ => LevelFilter::DEBUG,
    };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_target(false)
        .without_time()
        .init();
}
