//! Forecast of a data set: trajectories, frames, sections and samples, known before
//! anything is simulated.

use serde::Serialize;

use crate::dataset::Split;
use crate::dataset::sections::Section;

/// Forecast of the data set that a preset will make.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// The trajectories, in order; training first.
    pub runs: Vec<PlannedRun>,
    /// Sections of the training split to learn from.
    pub sections: Vec<Section>,
}

/// A planned trajectory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlannedRun {
    /// Part of the data set.
    pub split: Split,
    /// Name of the trajectory in the data set.
    pub name: String,
    /// Vertices of its mesh.
    pub vertices: usize,
    /// Number of frames, the start included.
    pub frames: usize,
}

impl Forecast {
    /// The trajectories of a split.
    pub fn of(&self, split: Split) -> impl Iterator<Item = &PlannedRun> {
        self.runs.iter().filter(move |run| run.split == split)
    }

    /// Frames in all, starts included.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.runs.iter().map(|run| run.frames).sum()
    }

    /// Positions in all: vertices of every frame.
    #[must_use]
    pub fn positions(&self) -> usize {
        self.runs.iter().map(|run| run.frames * run.vertices).sum()
    }

    /// Samples in the sections.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.sections.iter().map(|s| s.samples().count()).sum()
    }
}
