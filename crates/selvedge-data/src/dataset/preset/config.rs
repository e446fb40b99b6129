//! The configuration of a data set as its index keeps it: setting, cloths and motions, resolved; and
//! what is known of the set before anything is simulated.

use selvedge_cloth::Motion;
use serde::{Deserialize, Serialize};

use crate::dataset::Split;
use crate::dataset::sections::{Section, SectionRule};
use crate::scene::{MeshSpec, Setting};

/// A mesh, its handles and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCloth {
    /// Name of the cloth.
    pub name: String,
    /// Source of the mesh.
    pub mesh: MeshSpec,
    /// The held vertices, in the order of the handle targets.
    pub handles: Vec<u32>,
}

/// The configuration of a data set, as its index keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetConfig {
    /// Name of the data set.
    pub name: String,
    /// Rule for the sections to learn from.
    pub sections: SectionRule,
    /// All of the scenes but their motions.
    pub setting: Setting,
    /// Cloths beside the setting's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cloths: Vec<NamedCloth>,
    /// Motions of the training split, in order.
    pub train: Vec<NamedMotion>,
    /// Motions of the test split, in order.
    pub test: Vec<NamedMotion>,
}

/// A motion and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedMotion {
    /// Name of the motion and of its file.
    pub name: String,
    /// Motion of the handles.
    pub motion: Motion,
    /// The cloth that they move; the setting's own where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
}

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
