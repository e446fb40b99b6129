//! selvedge-data: see its Cargo.toml.
