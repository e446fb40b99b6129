//! Readers of files, texts and messages, each with its examples ([`TARGETS`]): libFuzzer damages
//! them nightly (`cargo xtask fuzz`), a test of the program (`corpus`) reads all of them as they are.

mod bench;
mod targets;

pub(crate) use self::bench::Bench;
pub(crate) use self::targets::{TARGETS, Target};
