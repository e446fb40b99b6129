//! selvedge-sim: see its Cargo.toml.
