//! The program of the trials, which `cargo xtask` builds and starts.

use std::process::ExitCode;

fn main() -> ExitCode {
    selvedge_trials::run()
}
