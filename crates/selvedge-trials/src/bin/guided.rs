//! A reader under libFuzzer, built and started by `cargo xtask guided`: the variable
//! `SELVEDGE_TARGET` names it, and `SELVEDGE_EXAMPLES` the folder in which its examples go.
#![no_main]
#![allow(
    clippy::print_stderr,
    reason = "a program that talks to people in a terminal"
)]

use std::path::Path;
use std::sync::LazyLock;

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use selvedge_trials::Guided;

static READER: LazyLock<Guided> = LazyLock::new(|| match open() {
    Ok(reader) => reader,
    Err(error) => {
        eprintln!("error: {error:#}");
        std::process::exit(2);
    }
});

fn open() -> anyhow::Result<Guided> {
    let name = std::env::var("SELVEDGE_TARGET")?;
    let examples = std::env::var("SELVEDGE_EXAMPLES")?;
    let bench = Path::new("target/guided/bench").join(&name);
    let reader = Guided::open(&name, &bench)?;
    for (number, example) in reader.examples().iter().enumerate() {
        std::fs::write(Path::new(&examples).join(number.to_string()), example)?;
    }
    Ok(reader)
}

fuzz_target!(init: { LazyLock::force(&READER); }, |data: &[u8]| READER.read(data));

// One in four is damaged as bytes, by what comparisons were seen to look for.
fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
    if seed % 4 == 0 {
        return fuzzer_mutate(data, size, most);
    }
    let damaged = READER.damaged(&data[..size], seed);
    let length = damaged.len().min(most);
    data[..length].copy_from_slice(&damaged[..length]);
    length
});
