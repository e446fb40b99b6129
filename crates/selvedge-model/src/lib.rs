//! selvedge-model: see its Cargo.toml.
