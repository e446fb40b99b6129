//! Every example and every file of the corpus, given to its reader as it is.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use super::bench::Bench;
use super::is_too_long;
use super::seeds::Seeds;
use super::targets::TARGETS;
use crate::program::Program;

/// The answer of a reader to one of its examples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replayed {
    /// Name of the target.
    pub target: &'static str,
    /// Number of the example, in the order of the target's list.
    pub number: usize,
    /// The reader's words, where it refuses the example.
    pub refusal: Option<String>,
}

/// Reads all examples of all targets in `folder`, which is empty; `program` writes some of them.
///
/// # Panics
/// Where a reader does, or accepts what does not hold.
pub fn replay(program: &Path, folder: &Path) -> Result<Vec<Replayed>> {
    let [made, bench] = ["made", "bench"].map(|name| folder.join(name));
    for inner in [&made, &bench] {
        fs::create_dir(inner).with_context(|| inner.display().to_string())?;
    }
    let seeds = Seeds::make(&Program::at(program), &made)?;
    let bench = Bench::new(&bench, &seeds)?;
    let mut all = Vec::new();
    for target in &TARGETS {
        let path = bench.folder.join(target.file.unwrap_or("input"));
        for (number, input) in target.examples(&seeds)?.iter().enumerate() {
            if target.file.is_some() {
                fs::write(&path, input).with_context(|| path.display().to_string())?;
            }
            let refusal = (target.read)(&bench, &path, input).err();
            if let Some(text) = refusal.as_ref().filter(|text| is_too_long(text, input)) {
                anyhow::bail!("{} {number}: an error of {} bytes", target.name, text.len());
            }
            all.push(Replayed {
                target: target.name,
                number,
                refusal,
            });
        }
    }
    Ok(all)
}
