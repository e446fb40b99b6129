//! Making a data set, one trajectory at a time, so that an interrupted run can continue.
//!
//! Until all are there `index.partial.json` holds the plan and what is done, rewritten after every
//! trajectory; a second run with the same plan keeps what has the right hash. The order in which
//! trajectories arrive does not change the finished index.

use crate::dataset::check::{file_of, folder_of};
use crate::dataset::plan::{DatasetPlan, sections};
use crate::dataset::problem::FolderProblem;
use crate::dataset::sections::Section;
use crate::dataset::{
    Dataset, DatasetError, DatasetIndex, DatasetStatistics, Entry, FORMAT, INDEX, Split, Splits,
    VERSION, read_checked, read_index, read_json,
};
use crate::formats::atomic::write_atomically;
use crate::formats::input::read_file;
use crate::trajectory::Trajectory;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

const PARTIAL: &str = "index.partial.json";

const PARTIAL_FORMAT: &str = "selvedge-dataset-partial";

/// The contents of `index.partial.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartialIndex {
    format: String,
    version: u64,
    plan: DatasetPlan,
    done: Splits,
}

/// A data set in the making.
#[derive(Clone, Debug)]
pub struct DatasetWriter {
    folder: PathBuf,
    plan: DatasetPlan,
    done: Splits,
}

impl DatasetWriter {
    /// Starts a data set in `folder`, which is made, or continues one of the same plan.
    ///
    /// # Errors
    /// [`DatasetError`] when the folder holds something else, even a data set whose plan differs in
    /// a name, a motion or the order of motions; or when a name cannot be a file's.
    pub fn open(folder: &Path, plan: DatasetPlan) -> Result<Self, DatasetError> {
        plan.validate()?;
        let mut writer = Self {
            folder: folder.to_owned(),
            plan,
            done: Splits::default(),
        };
        let [partial, finished] = [PARTIAL, INDEX].map(|name| folder.join(name));
        if partial.is_file() {
            writer.resume_partial(&partial)?;
        } else if finished.is_file() {
            writer.resume_finished(&finished)?;
        } else {
            writer.check_empty()?;
        }
        writer.make_folders()?;
        writer.write_partial()?;
        Ok(writer)
    }

    /// The trajectory of this motion, if it is already written.
    #[must_use]
    pub fn written(&self, split: Split, motion: &str) -> Option<&Entry> {
        let done = self.entries(split);
        done.iter().find(|entry| entry.motion == motion)
    }

    /// The motions that are still to be written, in order.
    #[must_use]
    pub fn missing(&self) -> Vec<(Split, String)> {
        [Split::Train, Split::Test]
            .into_iter()
            .flat_map(|split| self.plan.motions(split).iter().map(move |m| (split, m)))
            .filter(|(split, motion)| self.written(*split, motion).is_none())
            .map(|(split, motion)| (split, motion.clone()))
            .collect()
    }

    /// Writes a trajectory, in place of an earlier one of the same motion.
    ///
    /// # Errors
    /// [`DatasetError`] when the motion is not in the plan, the trajectory is too short for its
    /// sections or that of another motion, or writing fails.
    pub fn add(
        &mut self,
        split: Split,
        motion: &str,
        trajectory: &Trajectory,
    ) -> Result<(), DatasetError> {
        if !self.plan.motions(split).iter().any(|m| m == motion) {
            return Err(DatasetError::Motion {
                motion: motion.to_owned(),
                problem: "is not in the plan of this split",
            });
        }
        if split == Split::Train {
            let rule = self.plan.sections;
            rule.sections(&[(motion, trajectory.frame_count())])?;
        }
        let file = file_of(split, motion);
        let path = self.folder.join(&file);
        trajectory.write(&path)?;
        let bytes = read_file(&path).map_err(|source| DatasetError::Read {
            path: path.clone(),
            source,
        })?;
        let entry = Entry::new(motion, &file, &bytes, trajectory)?;
        let done = self.entries_mut(split);
        done.retain(|other| other.motion != motion);
        if let Some(twin) = self.twin_of(&entry) {
            let (entry, other) = (Box::new(entry), Box::new(twin.clone()));
            // It is in no list: what cannot be taken away is only untidy.
            let _ = std::fs::remove_file(&path);
            self.write_partial()?;
            return Err(DatasetError::Twin { entry, other });
        }
        self.entries_mut(split).push(entry);
        self.write_partial()
    }

    /// Writes the index of the finished data set and opens it.
    ///
    /// # Errors
    /// [`DatasetError`] when a trajectory is missing or too short for its sections.
    pub fn finish(mut self) -> Result<Dataset, DatasetError> {
        if let Some((_, motion)) = self.missing().first() {
            return Err(DatasetError::Motion {
                motion: motion.clone(),
                problem: "has not been written yet",
            });
        }
        for split in [Split::Train, Split::Test] {
            let order = self.plan.motions(split).to_vec();
            let place = |entry: &Entry| order.iter().position(|m| *m == entry.motion);
            self.entries_mut(split).sort_by_key(place);
        }
        let sections = sections(self.plan.sections, &self.done)?;
        self.write_index(sections)?;
        // The finished index is in place: a partial one that cannot be removed is only untidy.
        let _ = std::fs::remove_file(self.folder.join(PARTIAL));
        Dataset::open(&self.folder)
    }

    /// Takes away what [`Self::open`] made, where no trajectory has been written: a plan alone is
    /// nothing to go on with.
    pub fn withdraw(self) {
        if self.done != Splits::default() {
            return;
        }
        // What cannot be taken away is only untidy.
        let emptied = [Split::Train, Split::Test].map(|split| {
            let folder = self.folder.join(folder_of(split));
            std::fs::remove_dir(folder).is_ok()
        });
        // Files that are in no list would be nobody's, and in the way, without a plan or an index.
        if emptied == [true, true] || self.folder.join(INDEX).is_file() {
            let _ = std::fs::remove_file(self.folder.join(PARTIAL));
        }
    }

    fn resume_partial(&mut self, path: &Path) -> Result<(), DatasetError> {
        let partial: PartialIndex = read_json(path, PARTIAL_FORMAT)?;
        self.check_same(self.plan.difference_of_plan(&partial.plan))?;
        self.keep(partial.done);
        Ok(())
    }

    fn resume_finished(&mut self, path: &Path) -> Result<(), DatasetError> {
        let index = read_index(path)?;
        self.check_same(self.plan.difference(&index))?;
        self.keep(index.splits);
        Ok(())
    }

    fn check_same(&self, difference: Option<String>) -> Result<(), DatasetError> {
        match difference {
            None => Ok(()),
            Some(difference) => Err(self.folder_error(FolderProblem::Other { difference })),
        }
    }

    /// Keeps the trajectories of `done` whose files are as they were written.
    fn keep(&mut self, done: Splits) {
        for (split, entries) in [(Split::Train, done.train), (Split::Test, done.test)] {
            let planned = self.plan.motions(split);
            let is_good = |entry: &Entry| {
                planned.contains(&entry.motion)
                    && entry.file == file_of(split, &entry.motion)
                    && read_checked(&self.folder.join(&entry.file), entry).is_ok()
            };
            let good: Vec<Entry> = entries.into_iter().filter(is_good).collect();
            *self.entries_mut(split) = good;
        }
    }

    /// Without an index, what is in the folders is not ours to replace.
    fn check_empty(&self) -> Result<(), DatasetError> {
        for name in [Split::Train, Split::Test].map(folder_of) {
            let inner = std::fs::read_dir(self.folder.join(name));
            if inner.is_ok_and(|mut files| files.next().is_some()) {
                return Err(self.folder_error(FolderProblem::NoIndex { name }));
            }
        }
        Ok(())
    }

    fn make_folders(&self) -> Result<(), DatasetError> {
        for name in [Split::Train, Split::Test].map(folder_of) {
            std::fs::create_dir_all(self.folder.join(name))
                .map_err(|source| self.folder_error(FolderProblem::Make(source)))?;
        }
        Ok(())
    }

    fn folder_error(&self, problem: FolderProblem) -> DatasetError {
        DatasetError::Folder {
            folder: self.folder.clone(),
            problem,
        }
    }

    fn write_partial(&self) -> Result<(), DatasetError> {
        let partial = PartialIndex {
            format: PARTIAL_FORMAT.to_owned(),
            version: VERSION,
            plan: self.plan.clone(),
            done: self.done.clone(),
        };
        self.write_json(PARTIAL, &partial)
    }

    fn write_index(&self, sections: Vec<Section>) -> Result<(), DatasetError> {
        let index = DatasetIndex {
            format: FORMAT.to_owned(),
            version: VERSION,
            name: self.plan.name.clone(),
            config: self.plan.config.clone(),
            splits: self.done.clone(),
            statistics: statistics(&self.done, &sections),
            sections,
        };
        self.write_json(INDEX, &index)
    }

    fn write_json(&self, name: &str, contents: &impl Serialize) -> Result<(), DatasetError> {
        let path = self.folder.join(name);
        write_atomically(&path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, contents)?;
            writer.write_all(b"\n")
        })?;
        Ok(())
    }

    /// The trajectory that is written already and has the same bytes.
    fn twin_of(&self, entry: &Entry) -> Option<&Entry> {
        let mut done = self.done.train.iter().chain(&self.done.test);
        done.find(|other| other.blake3 == entry.blake3)
    }

    fn entries(&self, split: Split) -> &[Entry] {
        match split {
            Split::Train => &self.done.train,
            Split::Test => &self.done.test,
        }
    }

    fn entries_mut(&mut self, split: Split) -> &mut Vec<Entry> {
        match split {
            Split::Train => &mut self.done.train,
            Split::Test => &mut self.done.test,
        }
    }
}

fn statistics(splits: &Splits, sections: &[Section]) -> DatasetStatistics {
    let train_frames: usize = splits.train.iter().map(|entry| entry.frames).sum();
    let mean = |of: fn(&Entry) -> f64| {
        let sum: f64 = splits.train.iter().map(|e| of(e) * e.frames as f64).sum();
        sum / train_frames.max(1) as f64
    };
    DatasetStatistics {
        trajectories: splits.train.len() + splits.test.len(),
        train_frames,
        samples: sections.iter().map(|s| s.samples().count()).sum(),
        mean_speed: mean(|entry| entry.mean_speed),
        max_speed: splits.train.iter().map(|e| e.max_speed).fold(0.0, f64::max),
        mean_edge_length: mean(|entry| entry.mean_edge_length),
    }
}
