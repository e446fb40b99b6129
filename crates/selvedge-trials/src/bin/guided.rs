//! A reader under libFuzzer, built and started by `cargo xtask fuzz`: the variable
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

// One in four is damaged whole, the others in a part, around which lengths and checksums are mended.
fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
    let mut damage = |part: &[u8]| {
        let mut bytes = part.to_vec();
        bytes.resize(part.len() + 64, 0);
        let most = bytes.len();
        let length = fuzzer_mutate(&mut bytes, part.len(), most);
        bytes.truncate(length);
        bytes
    };
    let mended = match seed % 4 {
        0 => None,
        _ => READER.damaged(&data[..size], seed, &mut damage),
    };
    let Some(mended) = mended else {
        return fuzzer_mutate(data, size, most);
    };
    let length = mended.len().min(most);
    data[..length].copy_from_slice(&mended[..length]);
    length
});
