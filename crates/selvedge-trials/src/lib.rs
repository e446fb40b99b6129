//! Readers of files, texts and messages, each with its examples ([`TARGETS`]): libFuzzer damages
//! them nightly (`cargo xtask fuzz`), a test of the program reads all of them as they are.

mod bench;
mod targets;

pub use bench::Bench;
pub use targets::{TARGETS, Target};
