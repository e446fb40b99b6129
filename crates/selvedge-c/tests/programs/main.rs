//! The library as other languages have it: programs in C and C#, compiled and run, beside the
//! command line.

// A test that cannot be set up fails where it is set up.
#![allow(clippy::unwrap_used)]

mod c;
mod common;
mod csharp;
