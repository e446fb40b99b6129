//! The program of the trials, which `cargo xtask` builds and starts.

use std::process::ExitCode;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    selvedge_trials::run(&words)
}
