//! Tests of the files and metrics of this crate from outside, in one binary.

#![allow(clippy::unwrap_used, reason = "a failing helper fails its test")]

#[path = "../../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod dataset;
mod example;
mod export;
mod garments;
#[path = "../../src/test_help.rs"]
mod help;
mod metrics;
mod obj;
mod obstacles;
mod presets;
mod scene_parts;
mod scenes;
mod sewn;
mod trajectory;
