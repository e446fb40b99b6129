//! selvedge-view: see its Cargo.toml.
