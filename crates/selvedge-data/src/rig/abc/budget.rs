//! Bounds of what is read of an archive.

use std::cell::Cell;

/// Samples of a property at most.
pub(super) const MOST_SAMPLES: usize = 100_000;

/// Numbers that may still be taken from samples.
pub(super) struct Budget {
    left: Cell<usize>,
}

impl Budget {
    /// As many as the file has bytes.
    pub(super) fn of(bytes: &[u8]) -> Self {
        Self {
            left: Cell::new(bytes.len()),
        }
    }

    /// Takes `count` of them.
    pub(super) fn take(&self, count: usize) -> Result<(), String> {
        match self.left.get().checked_sub(count) {
            Some(left) => {
                self.left.set(left);
                Ok(())
            }
            None => Err(
                "has samples that are used again so often that they are more than the file"
                    .to_owned(),
            ),
        }
    }
}
