//! Names the sources of the solver, for rest poses that are kept: another build may find them with
//! other bytes.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

fn main() {
    // Beside this crate in its repository; as packages of a registry they have their versions.
    let sources = [
        "cloth/src",
        "contact/src",
        "sim/src",
        "run/../../Cargo.lock",
    ];
    let sources = sources.map(|source| Path::new("..").join(format!("selvedge-{source}")));
    let open = sources.into_iter().filter(|source| source.exists());
    let mut open: Vec<PathBuf> = open.collect();
    open.iter()
        .for_each(|source| println!("cargo::rerun-if-changed={}", source.display()));
    println!("cargo::rerun-if-changed=build.rs");
    let mut hasher = DefaultHasher::new();
    while let Some(path) = open.pop() {
        if let Ok(entries) = fs::read_dir(&path) {
            let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
            entries.sort();
            open.extend(entries);
        } else {
            hasher.write(&fs::read(&path).unwrap_or_default());
        }
    }
    println!("cargo::rustc-env=SELVEDGE_SOLVER={:016x}", hasher.finish());
}
