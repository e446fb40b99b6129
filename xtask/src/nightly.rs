//! Checks that only a nightly compiler has: Rust's sanitizers and Miri, on what has `unsafe` code
//! or threads of its own.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::root;

/// A sanitizer, and the tests that it watches.
pub(crate) struct Sanitizer {
    name: &'static str,
    flags: &'static str,
    /// Arguments of `cargo test`, one run each.
    tests: &'static [&'static [&'static str]],
}

const SANITIZERS: [Sanitizer; 2] = [
    // What has `unsafe` code, the counting allocators among it.
    Sanitizer {
        name: "address",
        flags: "-Zsanitizer=address",
        tests: &[
            &["-p=selvedge-model", "--lib", "--test=allocation"],
            &["-p=selvedge-cluster", "--lib"],
            &["-p=selvedge-sim", "--test=physics", "allocation"],
            &["-p=selvedge-trials", "--test=allocation"],
        ],
    },
    // What starts threads or shares memory between them. A fence, which this sanitizer does not
    // know, is replaced in crossbeam by the flag.
    Sanitizer {
        name: "thread",
        flags: "-Zsanitizer=thread --cfg crossbeam_sanitize_thread",
        tests: &[
            &["-p=selvedge-cluster", "-p=selvedge-model", "--lib"],
            &["-p=selvedge-train", "--lib"],
            &["-p=selvedge-live", "--lib", "--tests"],
            &["-p=selvedge-lab", "--lib"],
            &["-p=selvedge-sim", "--lib"],
        ],
    },
];

/// Tests that Miri runs: the kernels, by the instructions that every machine has.
const MIRI: &[&str] = &["-p=selvedge-model", "--lib", "kernels"];

impl Sanitizer {
    pub(crate) fn named(name: &str) -> Option<&'static Self> {
        SANITIZERS.iter().find(|one| one.name == name)
    }

    /// Runs the tests of this sanitizer, or those that `tests` asks `cargo test` for.
    pub(crate) fn run(&self, tests: &[&str]) -> Result<()> {
        let folder = format!("target/sanitize-{}", self.name);
        let given = [tests];
        let runs = if tests.is_empty() { self.tests } else { &given };
        for tests in runs {
            let mut arguments = vec!["test", "-Zbuild-std", "--target", "host-tuple"];
            arguments.extend(["--target-dir", &folder, "--no-fail-fast"]);
            arguments.extend(*tests);
            cargo(&arguments, self.flags, "rust-src")?;
        }
        Ok(())
    }
}

/// Runs under Miri what it can run, or the tests that `tests` asks `cargo miri test` for.
pub(crate) fn miri(tests: &[&str]) -> Result<()> {
    let mut arguments = vec!["miri", "test", "--target-dir", "target/miri"];
    arguments.extend(if tests.is_empty() { MIRI } else { tests });
    cargo(&arguments, "", "miri,rust-src")
}

/// Starts nightly's Cargo, which needs these components.
fn cargo(arguments: &[&str], flags: &str, components: &str) -> Result<()> {
    println!("RUSTFLAGS='{flags}' cargo +nightly {}", arguments.join(" "));
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo"]).args(arguments);
    command.current_dir(root());
    command.env("RUSTFLAGS", flags);
    // These name the compiler that built this program, and would be taken in nightly's place.
    for name in ["CARGO", "RUSTC", "RUSTDOC", "RUSTUP_TOOLCHAIN"] {
        command.env_remove(name);
    }
    let status = command.status().context("cannot start rustup")?;
    if !status.success() {
        bail!(
            "a test failed, or nightly is not here; install it by \
             `rustup toolchain install nightly -c {components}`"
        );
    }
    Ok(())
}
