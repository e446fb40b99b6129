//! selvedge-train: see its Cargo.toml.
