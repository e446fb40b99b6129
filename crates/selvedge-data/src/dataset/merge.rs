//! Parts of a data set made one: every part is there once, has all of its trajectories, and was
//! made by the same plan.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use selvedge_cluster::Shard;

use crate::dataset::plan::DatasetPlan;
use crate::dataset::writer::{DatasetWriter, PARTIAL, PartialIndex};
use crate::dataset::{Dataset, Entry, Split, read_checked};
use crate::formats::file_error::{FileError, Problem};
use crate::trajectory::Trajectory;

/// A part that was read.
struct Part {
    folder: PathBuf,
    shard: Shard,
    index: PartialIndex,
}

/// All parts of a data set, checked to fit together.
pub struct DatasetParts {
    plan: DatasetPlan,
    /// The trajectories and their parts' folders, in the order of the plan.
    files: Vec<(Split, Entry, PathBuf)>,
}

impl DatasetParts {
    /// Opens the parts in `folders`, in any order.
    ///
    /// # Errors
    /// [`Problem`] names the folder that is no part, does not fit the others or lacks
    /// something, or the parts that are missing.
    pub fn open(folders: &[PathBuf]) -> Result<Self, Problem> {
        let mut parts: BTreeMap<usize, Part> = BTreeMap::new();
        for folder in folders {
            let part = Part::open(folder)?;
            let number = part.shard.number();
            let misfit = parts.values().next().and_then(|first| part.misfit(first));
            let twice = parts.get(&number).map(|twice| {
                let [one, other] = [twice, &part].map(|part| part.folder.display());
                format!("{one} and {other} are both part {}", part.shard)
            });
            if let Some(problem) = misfit.or_else(|| part.lack()).or(twice) {
                return Err(Problem(problem));
            }
            parts.insert(number, part);
        }
        let none = || Problem("name the folders of the parts".to_owned());
        let first = parts.values().next().ok_or_else(none)?;
        let (count, plan) = (first.shard.count(), first.index.plan.clone());
        let missing = (1..=count).filter(|number| !parts.contains_key(number));
        let missing: Vec<String> = missing.map(|number| format!("{number}/{count}")).collect();
        if !missing.is_empty() {
            return Err(Problem(format!(
                "parts {} are missing: name their folders, too, or make them",
                missing.join(", ")
            )));
        }
        let files = plan.of_part(None).into_iter().enumerate();
        let files = files.filter_map(|(number, (split, motion))| {
            let part = parts.get(&(number % count + 1))?;
            let entry = part.index.done.find(split, motion)?;
            Some((split, entry.clone(), part.folder.clone()))
        });
        let files = files.collect();
        Ok(Self { plan, files })
    }

    /// Name of the data set.
    pub fn name(&self) -> &str {
        &self.plan.name
    }

    /// Number of trajectories.
    pub fn trajectory_count(&self) -> usize {
        self.files.len()
    }

    /// Writes the whole into `folder`, or goes on with it; `observe` hears of every trajectory and
    /// may break: then there is no data set yet, and the same merge goes on. The parts stay as they
    /// are.
    ///
    /// # Errors
    /// A file of a part that has changed, a folder that holds something else, two trajectories that
    /// are the same, or a failure to write.
    pub fn merge(
        &self,
        folder: &Path,
        observe: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Dataset>, Problem> {
        let mut writer = DatasetWriter::open(folder, self.plan.clone())?;
        for (split, entry, from) in &self.files {
            if writer.written(*split, &entry.motion).is_none() {
                let bytes = read_checked(&from.join(&entry.file), entry)?;
                let read = Trajectory::from_bytes(&bytes);
                let read = read.map_err(FileError::at(entry.file.as_ref()))?;
                writer.add(*split, &entry.motion, &read)?;
            }
            if observe().is_break() {
                return Ok(None);
            }
        }
        Ok(Some(writer.finish()?))
    }
}

impl Part {
    fn open(folder: &Path) -> Result<Self, Problem> {
        let no_part = || {
            Problem(format!(
                "{}: is no part of a data set: `selvedge data generate --shard I/N` makes one",
                folder.display()
            ))
        };
        let path = folder.join(PARTIAL);
        if !path.is_file() {
            return Err(no_part());
        }
        let index = PartialIndex::read(&path)?;
        let shard = index.part.as_ref().and_then(|part| part.parse().ok());
        Ok(Self {
            folder: folder.to_owned(),
            shard: shard.ok_or_else(no_part)?,
            index,
        })
    }

    /// What keeps it from being of one data set with `first`.
    fn misfit(&self, first: &Self) -> Option<String> {
        let [folder, other] = [self, first].map(|part| part.folder.display());
        if let Some(difference) = first.index.plan.difference_of_plan(&self.index.plan) {
            return Some(format!(
                "{folder}: does not fit {other}, since it {difference}"
            ));
        }
        (self.shard.count() != first.shard.count()).then(|| {
            format!(
                "{folder}: is part {}, and {other} is part {}: take parts of one number",
                self.shard, first.shard
            )
        })
    }

    /// What it lacks.
    fn lack(&self) -> Option<String> {
        let own = self.index.plan.of_part(Some(self.shard)).into_iter();
        let done = &self.index.done;
        let missing = own.filter(|(split, motion)| done.find(*split, motion).is_none());
        let missing: Vec<&str> = missing.map(|(_, motion)| motion).collect();
        missing.first().map(|first| {
            format!(
                "{}: part {} lacks {} of its trajectories, as {first:?}: run again the command that makes it",
                self.folder.display(),
                self.shard,
                missing.len()
            )
        })
    }
}
