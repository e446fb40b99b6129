//! Kinds of folders of results, told by the files in them, so that none is written into another.

use std::fmt;
use std::path::Path;

use selvedge_train::files;

/// The kind of a folder of results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FolderKind {
    /// Trajectories to learn from, and their index.
    DataSet,
    /// One training.
    Training,
    /// Trainings and evaluations of a study.
    Study,
    /// The report of an evaluation.
    Evaluation,
    /// The run of a model on a scene.
    Rollout,
}

/// The folder of a study with its trainings.
pub const TRAININGS: &str = "trainings";
/// The folder of a study with its evaluations.
pub const EVALUATIONS: &str = "evaluations";
/// The folder of an evaluation with its converged runs.
pub const REFERENCES: &str = "references";
/// The folder of a study with its report.
pub const REPORT: &str = "report";
/// The table of the report of an evaluation.
pub const ERRORS: &str = "errors.csv";
/// The trajectory of a rollout.
pub const ROLLOUT: &str = "rollout.safetensors";

impl FolderKind {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::DataSet,
        Self::Training,
        Self::Study,
        Self::Evaluation,
        Self::Rollout,
    ];

    /// Files and folders that only a folder of this kind has, and of which it has at least one.
    pub fn marks(self) -> &'static [&'static str] {
        match self {
            Self::DataSet => &["index.json", "index.partial.json"],
            Self::Training => &[files::LOG, files::CHECKPOINT],
            Self::Study => &[TRAININGS, EVALUATIONS],
            Self::Evaluation => &[ERRORS, REFERENCES],
            Self::Rollout => &[ROLLOUT],
        }
    }

    /// Folders inside one of this kind that its run writes into and that nothing else claims.
    pub fn inner(self) -> &'static [&'static str] {
        match self {
            Self::DataSet => &["train", "test"],
            Self::Study => &[EVALUATIONS, REPORT],
            Self::Evaluation => &[REFERENCES],
            Self::Training | Self::Rollout => &[],
        }
    }

    /// The mark of this kind that `folder` has; none where it is of another kind, or absent.
    pub fn mark_in(self, folder: &Path) -> Option<&'static str> {
        let marks = self.marks().iter().copied();
        marks.into_iter().find(|name| folder.join(name).exists())
    }

    /// The first kind that `folder` is of.
    pub fn of(folder: &Path) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|kind| kind.mark_in(folder).is_some())
    }
}

impl fmt::Display for FolderKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::DataSet => "a data set",
            Self::Training => "a training",
            Self::Study => "a study",
            Self::Evaluation => "the report of an evaluation",
            Self::Rollout => "a rollout",
        })
    }
}
