//! One reader with its examples, for a fuzzer that chooses inputs by what they reach.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::bench::Bench;
use super::is_too_long;
use super::seeds::Seeds;
use super::targets::{TARGETS, Target};
use crate::program::Program;

/// A reader that is given one input after another.
pub struct Guided {
    target: &'static Target,
    bench: Bench,
    path: PathBuf,
    examples: Vec<Vec<u8>>,
}

impl Guided {
    /// The reader of the target called `name`, at work in `folder`, which is made anew.
    pub fn open(name: &str, folder: &Path) -> Result<Self> {
        let Some(target) = TARGETS.iter().find(|target| target.name == name) else {
            bail!("there is no target {name:?}");
        };
        if folder.exists() {
            fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        let [made, bench] = ["made", "bench"].map(|name| folder.join(name));
        for inner in [&made, &bench] {
            fs::create_dir_all(inner).with_context(|| inner.display().to_string())?;
        }
        let seeds = Seeds::make(&Program::find()?, &made)?;
        let bench = Bench::new(&bench, &seeds)?;
        Ok(Self {
            examples: target.examples(&seeds)?,
            path: bench.folder.join(target.file.unwrap_or("input")),
            target,
            bench,
        })
    }

    /// Whole inputs.
    pub fn examples(&self) -> &[Vec<u8>] {
        &self.examples
    }

    /// Gives `input` to the reader.
    ///
    /// # Panics
    /// Where the reader does, accepts what does not hold, or says pages.
    pub fn read(&self, input: &[u8]) {
        if self.target.file.is_some() && fs::write(&self.path, input).is_err() {
            return;
        }
        if let Err(text) = (self.target.read)(&self.bench, &self.path, input) {
            assert!(
                !is_too_long(&text, input),
                "an error of {} bytes",
                text.len()
            );
        }
    }
}
