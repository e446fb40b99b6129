//! Trials that take minutes or hours, each a command: `fuzz` gives damaged files to every reader
//! under libFuzzer, `faults` has calls of the system fail
//! under every command, `kill` ends long commands at random times, `soak`
//! runs steppers and the viewer for long, `load` puts many connections on the viewer.
//!
//! `cargo xtask` starts them. Every trial is made from a seed, says what it did in a row of a
//! table, and ends with an error where something did not hold.
#![allow(
    clippy::print_stdout,
    reason = "a program that talks to people in a terminal"
)]

mod arguments;
mod faults;
mod fuzz;
mod guided;
mod kill;
mod load;
mod program;
mod soak;
mod viewer;

use std::process::ExitCode;

use anyhow::Result;

pub use fuzz::{Guided, Replayed, replay};

const HELP: &str = "\
usage: cargo xtask fuzz|faults|kill|soak|load [OPTIONS]

  fuzz    damaged files, texts and messages for every reader, by libFuzzer
            --for SPAN       for every target (60s if not said)
            --target NAME    only this target (repeat for several)
  faults  calls on files, and for memory, that fail under every command; cuts of the power
            --faults N       of each kind of calls for every command (50 if not said)
            --of KIND        writes, reads or memory (repeat for several; all if not said)
            --command NAME   only this one (repeat for several)
            --seed N         other calls and faults
  kill    ends train, generate, study, import and export by kill -9 at random times
            --kills N        of each command (20 if not said)
            --command NAME   only this one (repeat for several)
            --seed N         other times
            --ranks N        one of so many ranks (train, generate, study), which mpirun starts
  soak    steppers and the viewer for long; their memory stays level
            --steps N        of every stepper (20000 if not said)
            --span SPAN      simulated time of the viewer (30s if not said)
            --pages N        that watch it and pull at it (30 if not said)
            --only NAME      physics, model, guard or viewer (repeat for several)
            --seed N         other hands
  load    connections, pages and requests for the viewer; a page is answered in time
            --half-open N    connections that say nothing or half a request (400 if not said)
            --pages N        that watch it and pull at it (30 if not said)
            --seed N         other hands";

/// Runs the trial that `words` name. The exit code says whether everything held.
#[must_use]
pub fn run(words: &[String]) -> ExitCode {
    let Some((command, options)) = words.split_first() else {
        println!("{HELP}");
        return ExitCode::from(2);
    };
    let outcome: Result<bool> = match command.as_str() {
        "fuzz" => guided::run(options),
        "faults" => faults::run(options),
        "kill" => kill::run(options),
        "soak" => soak::run(options),
        "load" => load::run(options),
        _ => {
            eprintln!("{HELP}");
            return ExitCode::from(2);
        }
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
