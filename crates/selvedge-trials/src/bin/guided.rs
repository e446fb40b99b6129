//! A reader under libFuzzer, built and started by `cargo xtask fuzz`: the variable
//! `SELVEDGE_TARGET` names it, and `SELVEDGE_EXAMPLES` the folder in which its examples go.
#![no_main]
#![allow(
    clippy::print_stderr,
    reason = "a program that talks to people in a terminal"
)]

use std::path::Path;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
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
