//! A study at work: its folder, its data sets, and the machine that trains and runs its models.

use std::path::Path;

use selvedge_data::Dataset;

use super::error::StudyError;
use super::file::Study;
use crate::event::Reporter;
use crate::machine::Machine;

/// A study at work.
pub(super) struct Desk<'a> {
    pub(super) study: &'a Study,
    pub(super) out: &'a Path,
    pub(super) threads: Option<usize>,
    pub(super) machine: &'a Machine,
    pub(super) reporter: &'a Reporter<'a>,
    pub(super) data: Vec<StudyData>,
}

/// A data set of a study.
pub(super) struct StudyData {
    pub(super) name: String,
    pub(super) set: Dataset,
    /// Of its index.
    pub(super) hash: String,
}

impl Desk<'_> {
    /// The data set of this name, which `file` has checked to be there.
    pub(super) fn data(&self, name: &str) -> Result<&StudyData, StudyError> {
        let found = self.data.iter().find(|data| data.name == name);
        found.ok_or_else(|| StudyError::new(format!("the study has no data set {name:?}")))
    }
}
