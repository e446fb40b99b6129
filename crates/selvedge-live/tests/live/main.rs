//! A served session as its clients see it: one binary of tests, so that what they share is used by
//! all.

// A test that cannot be set up fails where it is set up.
#![allow(clippy::unwrap_used)]

mod common;
#[path = "../../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod hostile;
mod session;
