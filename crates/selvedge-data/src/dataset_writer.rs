//! Making a data set, one trajectory at a time, so that an interrupted run can go on.
//!
//! Until all are there the index is `index.partial.json`, rewritten after every trajectory; a
//! second run with the same configuration keeps what has the right hash. The order in which
//! trajectories arrive does not change the finished index.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::atomic::write_atomically;
use crate::dataset::{
    Dataset, DatasetError, DatasetIndex, DatasetStatistics, Entry, FORMAT, INDEX, Split, Splits,
    VERSION, read_checked, read_index,
};
use crate::sections::{Section, SectionRule};
use crate::trajectory::Trajectory;

const PARTIAL: &str = "index.partial.json";

/// What a data set is to hold.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetPlan {
    /// What people call it.
    pub name: String,
    /// The resolved configuration; a run goes on only with the same.
    pub config: Value,
    /// Motions of the training split, in order.
    pub train: Vec<String>,
    /// Motions of the test split, in order.
    pub test: Vec<String>,
    /// What of the training split is learned from.
    pub sections: SectionRule,
}

/// A data set in the making.
#[derive(Clone, Debug)]
pub struct DatasetWriter {
    folder: PathBuf,
    plan: DatasetPlan,
    done: Splits,
}

impl DatasetPlan {
    /// The motions of a split, in order.
    #[must_use]
    pub fn motions(&self, split: Split) -> &[String] {
        match split {
            Split::Train => &self.train,
            Split::Test => &self.test,
        }
    }

    fn validate(&self) -> Result<(), DatasetError> {
        let error = |motion: &str, problem| DatasetError::Motion {
            motion: motion.to_owned(),
            problem,
        };
        for split in [Split::Train, Split::Test] {
            let motions = self.motions(split);
            for (number, motion) in motions.iter().enumerate() {
                let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
                if motion.starts_with('.') || !motion.chars().all(is_plain) || motion.is_empty() {
                    let problem = "names of motions become file names: use letters, digits, - _ .";
                    return Err(error(motion, problem));
                }
                if motions[..number].contains(motion) {
                    return Err(error(motion, "is twice in one split"));
                }
            }
        }
        Ok(())
    }
}

impl DatasetWriter {
    /// Starts a data set in `folder`, which is made, or goes on with one of the same configuration.
    ///
    /// # Errors
    /// [`DatasetError`] when the folder holds something else, or a name cannot be a file's.
    pub fn open(folder: &Path, plan: DatasetPlan) -> Result<Self, DatasetError> {
        plan.validate()?;
        let mut writer = Self {
            folder: folder.to_owned(),
            plan,
            done: Splits::default(),
        };
        let indices = [PARTIAL, INDEX].map(|name| folder.join(name));
        match indices.iter().find(|path| path.is_file()) {
            Some(path) => writer.resume(path)?,
            None => writer.check_empty()?,
        }
        writer.make_folders()?;
        writer.write_index(PARTIAL, Vec::new())?;
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
    /// [`DatasetError`] when the motion is not in the plan, or writing fails.
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
        let file = file_of(split, motion);
        let path = self.folder.join(&file);
        trajectory.write(&path)?;
        let bytes = std::fs::read(&path).map_err(|source| DatasetError::Read {
            path: path.clone(),
            source,
        })?;
        let entry = Entry::new(motion, &file, &bytes, trajectory)?;
        let done = self.entries_mut(split);
        done.retain(|other| other.motion != motion);
        done.push(entry);
        self.write_index(PARTIAL, Vec::new())
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
        let lengths: Vec<(&str, usize)> = self
            .done
            .train
            .iter()
            .map(|entry| (entry.motion.as_str(), entry.frames))
            .collect();
        let sections = self.plan.sections.sections(&lengths)?;
        self.write_index(INDEX, sections)?;
        // The finished index is in place: a partial one that cannot be removed is only untidy.
        let _ = std::fs::remove_file(self.folder.join(PARTIAL));
        Dataset::open(&self.folder)
    }

    fn resume(&mut self, path: &Path) -> Result<(), DatasetError> {
        let index = read_index(path)?;
        if index.config != self.plan.config {
            let problem = "holds a data set of another configuration: choose another folder";
            return Err(self.folder_error(problem.to_owned()));
        }
        for (split, entries) in [
            (Split::Train, index.splits.train),
            (Split::Test, index.splits.test),
        ] {
            let planned = self.plan.motions(split);
            let is_good = |entry: &Entry| {
                planned.contains(&entry.motion)
                    && entry.file == file_of(split, &entry.motion)
                    && read_checked(&self.folder.join(&entry.file), entry).is_ok()
            };
            let good: Vec<Entry> = entries.into_iter().filter(is_good).collect();
            *self.entries_mut(split) = good;
        }
        Ok(())
    }

    /// Without an index, what is in the folders is not ours to replace.
    fn check_empty(&self) -> Result<(), DatasetError> {
        for name in [Split::Train, Split::Test].map(folder_of) {
            let inner = std::fs::read_dir(self.folder.join(name));
            if inner.is_ok_and(|mut files| files.next().is_some()) {
                return Err(self.folder_error(format!(
                    "has files in {name}/ but no index: choose an empty folder"
                )));
            }
        }
        Ok(())
    }

    fn make_folders(&self) -> Result<(), DatasetError> {
        for name in [Split::Train, Split::Test].map(folder_of) {
            std::fs::create_dir_all(self.folder.join(name))
                .map_err(|source| self.folder_error(format!("could not be made: {source}")))?;
        }
        Ok(())
    }

    fn folder_error(&self, problem: String) -> DatasetError {
        DatasetError::Folder {
            folder: self.folder.clone(),
            problem,
        }
    }

    fn write_index(&self, name: &str, sections: Vec<Section>) -> Result<(), DatasetError> {
        let index = DatasetIndex {
            format: FORMAT.to_owned(),
            version: VERSION,
            name: self.plan.name.clone(),
            config: self.plan.config.clone(),
            splits: self.done.clone(),
            statistics: statistics(&self.done, &sections),
            sections,
        };
        let path = self.folder.join(name);
        write_atomically(&path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &index)?;
            writer.write_all(b"\n")
        })?;
        Ok(())
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

fn folder_of(split: Split) -> &'static str {
    match split {
        Split::Train => "train",
        Split::Test => "test",
    }
}

fn file_of(split: Split, motion: &str) -> String {
    format!("{}/{motion}.safetensors", folder_of(split))
}
