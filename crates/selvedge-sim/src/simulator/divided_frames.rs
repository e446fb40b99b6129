//! Frames that took more substeps than their scene asks for.

/// The frames so far that took more substeps than the scene asks for: edges would have strained too
/// much, or contact was too much for fewer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DividedFrames {
    /// Such frames.
    pub frames: u64,
    /// The most substeps that one would have taken, had all been as short as its shortest; 0 where
    /// there is none.
    pub most_substeps: u32,
}

impl DividedFrames {
    /// Counts a frame that took `substeps` where `asked` were asked for.
    pub(super) fn count(&mut self, substeps: u32, asked: u32) {
        if substeps > asked {
            self.frames += 1;
            self.most_substeps = self.most_substeps.max(substeps);
        }
    }

    /// Those of this run and of another.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            most_substeps: self.most_substeps.max(other.most_substeps),
        }
    }
}
