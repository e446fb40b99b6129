//! Making a data set, one trajectory at a time, so that an interrupted run can continue.
//!
//! Until all are there `index.partial.json` holds the plan and what is done, rewritten after every
//! trajectory; a second run with the same plan keeps what has the right hash. The order in which
//! trajectories arrive does not change the finished index.
//!
//! A part of a data set is such a folder that is never finished: its plan is that of the whole, and
//! it is to have the trajectories of one shard. `merge` makes parts one.

use crate::dataset::check::{file_of, of_motion};
use crate::dataset::plan::{DatasetPlan, sections};
use crate::dataset::sections::Section;
use crate::dataset::{
    Dataset, DatasetIndex, DatasetStatistics, Entry, FORMAT, INDEX, Split, Splits, VERSION,
    read_checked, read_index, read_json,
};
use crate::formats::atomic::write_atomically;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::read_file;
use crate::trajectory::Trajectory;
use selvedge_cluster::Shard;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) const PARTIAL: &str = "index.partial.json";

const PARTIAL_FORMAT: &str = "selvedge-dataset-partial";

/// The contents of `index.partial.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartialIndex {
    format: String,
    version: u64,
    pub(super) plan: DatasetPlan,
    pub(super) done: Splits,
    /// The shard of a part, as 2/8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) part: Option<String>,
}

impl PartialIndex {
    pub(super) fn read(path: &Path) -> Result<Self, Problem> {
        read_json(path, PARTIAL_FORMAT)
    }

    /// What keeps a run from going on with `found`.
    fn difference(&self, found: &Self) -> Option<String> {
        let [there, own] = [found, self].map(|index| match &index.part {
            Some(part) => format!("part {part}"),
            None => "the whole".to_owned(),
        });
        let difference = self.plan.difference_of_plan(&found.plan);
        difference.or_else(|| (there != own).then(|| format!("is {there}, not {own}")))
    }
}

/// A data set in the making.
#[derive(Clone, Debug)]
pub struct DatasetWriter {
    folder: PathBuf,
    index: PartialIndex,
    part: Option<Shard>,
}

impl DatasetWriter {
    /// Starts a data set in `folder`, which is made, or continues one of the same plan.
    ///
    /// # Errors
    /// [`Problem`] when the folder holds something else, even a data set whose plan differs in
    /// a name, a motion or the order of motions; or when a name cannot be a file's.
    pub fn open(folder: &Path, plan: DatasetPlan) -> Result<Self, Problem> {
        Self::open_part(folder, plan, None)
    }

    /// The same of a part of a data set: only the trajectories of a shard, counted over the
    /// training motions and then the test motions.
    ///
    /// # Errors
    /// As [`Self::open`]; also when the folder holds another part.
    pub fn open_part(
        folder: &Path,
        plan: DatasetPlan,
        part: Option<Shard>,
    ) -> Result<Self, Problem> {
        plan.validate()?;
        let index = PartialIndex {
            format: PARTIAL_FORMAT.to_owned(),
            version: VERSION,
            plan,
            done: Splits::default(),
            part: part.map(|part| part.to_string()),
        };
        let mut writer = Self {
            folder: folder.to_owned(),
            index,
            part,
        };
        let [partial, finished] = [PARTIAL, INDEX].map(|name| folder.join(name));
        if partial.is_file() {
            let found = PartialIndex::read(&partial)?;
            writer.resume(writer.index.difference(&found), found.done)?;
        } else if finished.is_file() {
            let found = read_index(&finished)?;
            writer.resume(writer.index.plan.difference(&found), found.splits)?;
        } else {
            writer.check_empty()?;
        }
        writer.make_folders()?;
        writer.write_partial()?;
        Ok(writer)
    }

    /// The trajectory of this motion, if it is already written.
    pub fn written(&self, split: Split, motion: &str) -> Option<&Entry> {
        self.index.done.find(split, motion)
    }

    /// The motions that are still to be written, in order; of a part only its own.
    pub fn missing(&self) -> Vec<(Split, String)> {
        let own = self.index.plan.of_part(self.part).into_iter();
        own.filter(|(split, motion)| self.written(*split, motion).is_none())
            .map(|(split, motion)| (split, motion.to_owned()))
            .collect()
    }

    /// The number of motions that are to be written and kept here.
    pub fn motion_count(&self) -> usize {
        self.index.plan.of_part(self.part).len()
    }

    /// Writes a trajectory, in place of an earlier one of the same motion.
    ///
    /// # Errors
    /// [`Problem`] when the motion is not in the plan, the trajectory is too short for its
    /// sections or that of another motion, or writing fails.
    pub fn add(
        &mut self,
        split: Split,
        motion: &str,
        trajectory: &Trajectory,
    ) -> Result<(), Problem> {
        if !self.index.plan.motions(split).iter().any(|m| m == motion) {
            let problem = "is not in the plan of this split";
            return Err(of_motion(motion, problem));
        }
        if split == Split::Train {
            let rule = self.index.plan.sections;
            rule.sections(&[(motion, trajectory.frame_count())])?;
        }
        let file = file_of(split, motion);
        let path = self.folder.join(&file);
        trajectory.write(&path)?;
        let bytes = read_file(&path).map_err(FileError::unread(&path))?;
        let entry = Entry::new(motion, &file, &bytes, trajectory)?;
        self.list(split, entry)
    }

    /// Puts a trajectory that is written on the list of what is done.
    fn list(&mut self, split: Split, entry: Entry) -> Result<(), Problem> {
        let done = &mut self.index.done;
        done.of_mut(split)
            .retain(|other| other.motion != entry.motion);
        let twin = done.all().find(|other| other.blake3 == entry.blake3);
        if let Some(twin) = twin {
            let twins = Problem(format!(
                "motion {:?} ({}) is the same trajectory as motion {:?} ({}): leave one of them out",
                entry.motion, entry.file, twin.motion, twin.file
            ));
            // It is in no list: what cannot be taken away is only untidy.
            let _ = std::fs::remove_file(self.folder.join(&entry.file));
            self.write_partial()?;
            return Err(twins);
        }
        self.index.done.of_mut(split).push(entry);
        self.write_partial()
    }

    /// Writes the index of the finished data set and opens it.
    ///
    /// # Errors
    /// [`Problem`] when a trajectory is missing or too short for its sections.
    pub fn finish(mut self) -> Result<Dataset, Problem> {
        if let Some((_, motion)) = self.missing().first() {
            return Err(of_motion(motion, "has not been written yet"));
        }
        for split in Split::BOTH {
            let order = self.index.plan.motions(split).to_vec();
            let place = |entry: &Entry| order.iter().position(|m| *m == entry.motion);
            self.index.done.of_mut(split).sort_by_key(place);
        }
        let sections = sections(self.index.plan.sections, &self.index.done)?;
        let PartialIndex { plan, done, .. } = self.index.clone();
        let index = DatasetIndex {
            format: FORMAT.to_owned(),
            version: VERSION,
            name: plan.name,
            config: plan.config,
            statistics: statistics(&done, &sections),
            splits: done,
            sections,
        };
        self.write_json(INDEX, &index)?;
        // The finished index is in place: a partial one that cannot be removed is only untidy.
        let _ = std::fs::remove_file(self.folder.join(PARTIAL));
        Dataset::open(&self.folder)
    }

    /// Takes away what [`Self::open`] made, where no trajectory has been written: a plan alone is
    /// nothing to go on with.
    pub fn withdraw(self) {
        if self.index.done != Splits::default() {
            return;
        }
        // What cannot be taken away is only untidy.
        let emptied = Split::BOTH.map(|split| {
            let folder = self.folder.join(split.name());
            std::fs::remove_dir(folder).is_ok()
        });
        // Files that are in no list would be nobody's, and in the way, without a plan or an index.
        if emptied == [true, true] || self.folder.join(INDEX).is_file() {
            let _ = std::fs::remove_file(self.folder.join(PARTIAL));
        }
    }

    /// Keeps the trajectories of `done` whose files are as they were written, unless there is a
    /// difference.
    fn resume(&mut self, difference: Option<String>, done: Splits) -> Result<(), Problem> {
        if let Some(difference) = difference {
            let problem = format!("holds a data set that {difference}: choose another folder");
            return Err(self.folder_error(problem));
        }
        for (split, entries) in [(Split::Train, done.train), (Split::Test, done.test)] {
            let planned = self.index.plan.motions(split);
            let is_good = |entry: &Entry| {
                planned.contains(&entry.motion)
                    && entry.file == file_of(split, &entry.motion)
                    && read_checked(&self.folder.join(&entry.file), entry).is_ok()
            };
            let good = entries.into_iter().filter(is_good).collect();
            *self.index.done.of_mut(split) = good;
        }
        Ok(())
    }

    /// Without an index, what is in the folders is not ours to replace.
    fn check_empty(&self) -> Result<(), Problem> {
        for name in Split::BOTH.map(Split::name) {
            let inner = std::fs::read_dir(self.folder.join(name));
            if inner.is_ok_and(|mut files| files.next().is_some()) {
                let problem = format!("has files in {name}/ but no index: choose an empty folder");
                return Err(self.folder_error(problem));
            }
        }
        Ok(())
    }

    fn make_folders(&self) -> Result<(), Problem> {
        for name in Split::BOTH.map(Split::name) {
            std::fs::create_dir_all(self.folder.join(name))
                .map_err(|error| self.folder_error(format!("could not be made: {error}")))?;
        }
        Ok(())
    }

    fn folder_error(&self, problem: String) -> Problem {
        Problem(format!("{}: {problem}", self.folder.display()))
    }

    fn write_partial(&self) -> Result<(), Problem> {
        self.write_json(PARTIAL, &self.index)
    }

    fn write_json(&self, name: &str, contents: &impl Serialize) -> Result<(), Problem> {
        let path = self.folder.join(name);
        write_atomically(&path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, contents)?;
            writer.write_all(b"\n")
        })?;
        Ok(())
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
