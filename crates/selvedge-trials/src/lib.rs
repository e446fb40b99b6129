//! Trials that take minutes or hours, each a command: `fuzz` gives damaged files to every reader
//! under libFuzzer, `faults` has calls of the system fail under every command.
//!
//! `cargo xtask` starts them. Every trial says what it did, and ends with an error where something
//! did not hold.
#![allow(
    clippy::print_stdout,
    reason = "a program that talks to people in a terminal"
)]

mod faults;
mod fuzz;
mod guided;
mod program;

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use faults::Side;
use selvedge_lab::span;

pub use fuzz::{Guided, Replayed, replay};

/// Trials that take minutes or hours.
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
enum Trial {
    /// Damaged files, texts and messages for every reader, by libFuzzer
    Fuzz {
        /// For every target
        #[arg(long = "for", value_name = "SPAN", default_value = "60s", value_parser = span::parse)]
        span: Duration,
        /// Only this target (repeat for several)
        #[arg(long)]
        target: Vec<String>,
    },
    /// Calls on files, and for memory, that fail under every command; cuts of the power
    Faults {
        /// Of each kind of calls for every command
        #[arg(long, default_value_t = 50)]
        faults: u64,
        /// Only these calls (repeat for several)
        #[arg(long, value_enum)]
        of: Vec<Side>,
        /// Only this one (repeat for several)
        #[arg(long)]
        command: Vec<String>,
        /// Other calls and faults
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
}

/// Runs the trial that the command line names. The exit code says whether everything held.
pub fn run() -> ExitCode {
    let outcome = match Trial::parse() {
        Trial::Fuzz { span, target } => guided::run(span, &target),
        Trial::Faults {
            faults,
            of,
            command,
            seed,
        } => faults::run(faults, &of, &command, seed),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// True where no name is asked for, or this one.
fn is_wanted(name: &str, asked: &[String]) -> bool {
    asked.is_empty() || asked.iter().any(|other| other == name)
}
