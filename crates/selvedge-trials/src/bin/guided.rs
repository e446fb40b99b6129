//! A reader under libFuzzer, built and started by `.ci/fuzz`: the variable `SELVEDGE_TARGET` names
//! it (without it all names are printed), `SELVEDGE_EXAMPLES` the folder in which its examples go, and
//! `SELVEDGE` the program that writes some of them.
#![no_main]
#![allow(
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "a program that talks to people in a terminal"
)]

use std::env::var;
use std::path::Path;
use std::sync::LazyLock;

use anyhow::Context;
use libfuzzer_sys::fuzz_target;
use readers::{Bench, TARGETS, Target};

#[path = "../../tests/readers/mod.rs"]
mod readers;

static READER: LazyLock<(Bench, &Target)> = LazyLock::new(|| match open() {
    Ok(reader) => reader,
    Err(error) => {
        eprintln!("error: {error:#}");
        std::process::exit(2);
    }
});

fn open() -> anyhow::Result<(Bench, &'static Target)> {
    let Ok(name) = var("SELVEDGE_TARGET") else {
        TARGETS.iter().for_each(|target| println!("{}", target.0));
        std::process::exit(0);
    };
    let target = TARGETS.iter().find(|target| target.0 == name);
    let target = target.context("there is no such target")?;
    let folder = Path::new("target/guided/bench").join(&name);
    let bench = Bench::new(Path::new(&var("SELVEDGE")?), &folder)?;
    let examples = var("SELVEDGE_EXAMPLES")?;
    for (number, example) in bench.examples(target)?.iter().enumerate() {
        std::fs::write(Path::new(&examples).join(number.to_string()), example)?;
    }
    Ok((bench, target))
}

fuzz_target!(init: { LazyLock::force(&READER); }, |data: &[u8]| {
    let (bench, target) = &*READER;
    // What it refuses is no finding.
    let _ = bench.read(target, data);
});
