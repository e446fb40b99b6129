//! The program as people call it: one binary of tests, so that it is linked once and what they
//! share is used by all.

// A test that cannot be set up fails where it is set up.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod common;
mod convert;
mod corpus;
mod data_sets;
mod devices;
mod evaluation;
mod export;
mod fit;
mod fronts;
mod goldens;
mod guard;
mod interrupts;
mod learned;
mod parity;
mod physics;
mod presets;
mod shards;
mod usage;
