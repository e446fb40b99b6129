//! Names the sources of the solver, for rest poses that are kept: another build may find them with
//! other bytes.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::io;
use std::path::Path;

fn main() {
    let mut hasher = DefaultHasher::new();
    // Beside this crate in its repository; as packages of a registry they have their versions.
    for source in [
        "selvedge-cloth/src",
        "selvedge-contact/src",
        "selvedge-sim/src",
        "../Cargo.lock",
    ] {
        let source = Path::new("..").join(source);
        if take(&source, &mut hasher).is_ok() {
            println!("cargo::rerun-if-changed={}", source.display());
        }
    }
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=SELVEDGE_SOLVER={:016x}", hasher.finish());
}

/// Takes a file, or all files of a folder in the order of their names.
fn take(path: &Path, hasher: &mut DefaultHasher) -> io::Result<()> {
    if !path.is_dir() {
        hasher.write(&fs::read(path)?);
        return Ok(());
    }
    let entries = fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
    let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
    entries.sort();
    entries.iter().try_for_each(|path| take(path, hasher))
}
