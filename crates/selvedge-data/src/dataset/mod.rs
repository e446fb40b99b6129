//! A data set: a folder with `index.json` and one trajectory file per motion, split into training
//! and test. What is opened here is complete; [`DatasetWriter`](crate::DatasetWriter) makes it.
//!
//! Nothing in the index is trusted: its own lists are checked when it is opened, its entry for a
//! file when the file is read.
//!
//! The index carries format name and version, the resolved configuration that it was made from,
//! the hash (BLAKE3) and size of every file, the sections to learn from and a few statistics.

pub(crate) mod check;
pub(crate) mod merge;
pub(crate) mod plan;
pub(crate) mod preset;
pub(crate) mod sections;
pub(crate) mod writer;

use crate::dataset::sections::{Sample, Section};
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{hash, read_file, read_text};
use crate::metrics::{mean_edge_length, speeds};
use crate::trajectory::Trajectory;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

pub(crate) const INDEX: &str = "index.json";

pub(crate) const FORMAT: &str = "selvedge-dataset";

pub(crate) const VERSION: u64 = 1;

/// A part of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Learned from.
    Train,
    /// Never learned from.
    Test,
}

/// The contents of `index.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetIndex {
    /// Always "selvedge-dataset".
    pub format: String,
    /// Version of the format.
    pub version: u64,
    /// Name of the data set.
    pub name: String,
    /// The resolved configuration that it was made from.
    pub config: Value,
    /// The trajectories.
    pub splits: Splits,
    /// Sections of the training split to learn from.
    pub sections: Vec<Section>,
    /// A few numbers about the training split.
    pub statistics: DatasetStatistics,
}

/// The trajectories of a data set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Splits {
    /// Learned from; sections count in this order.
    pub train: Vec<Entry>,
    /// Never learned from.
    pub test: Vec<Entry>,
}

/// A trajectory of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Name of its motion, once in a split.
    pub motion: String,
    /// File of the trajectory, relative to the folder.
    pub file: String,
    /// BLAKE3 hash of the file, in hexadecimal.
    pub blake3: String,
    /// Frames, the start included.
    pub frames: usize,
    /// Vertices.
    pub vertices: usize,
    /// Mean speed of the vertices `[m/s]`.
    pub mean_speed: f64,
    /// Largest speed of a vertex `[m/s]`.
    pub max_speed: f64,
    /// Mean length of the edges `[m]`.
    pub mean_edge_length: f64,
}

/// A few numbers about the training split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetStatistics {
    /// Trajectories in both splits.
    pub trajectories: usize,
    /// Frames in the training split.
    pub train_frames: usize,
    /// Samples in the sections.
    pub samples: usize,
    /// Mean over the training frames of the mean speed `[m/s]`.
    pub mean_speed: f64,
    /// Largest speed of a vertex in the training split `[m/s]`.
    pub max_speed: f64,
    /// Mean over the training frames of the mean edge length `[m]`.
    pub mean_edge_length: f64,
}

/// A complete data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    folder: PathBuf,
    index: DatasetIndex,
}

impl Split {
    /// Both parts, in order.
    pub const BOTH: [Self; 2] = [Self::Train, Self::Test];

    /// Its name, and that of its folder.
    pub fn name(self) -> &'static str {
        self.of("train", "test")
    }

    /// The one of two that is of this part.
    pub(crate) fn of<T>(self, train: T, test: T) -> T {
        match self {
            Self::Train => train,
            Self::Test => test,
        }
    }
}

impl Splits {
    /// The trajectories of a split.
    pub fn of(&self, split: Split) -> &[Entry] {
        split.of(&self.train, &self.test)
    }

    fn of_mut(&mut self, split: Split) -> &mut Vec<Entry> {
        split.of(&mut self.train, &mut self.test)
    }

    /// All trajectories, those learned from first.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Entry> {
        self.train.iter().chain(&self.test)
    }

    /// The trajectory of a motion.
    pub(crate) fn find(&self, split: Split, motion: &str) -> Option<&Entry> {
        self.of(split).iter().find(|entry| entry.motion == motion)
    }
}

impl Dataset {
    /// Opens the data set in `folder` and checks its index: format and version, names, files that
    /// exist, sections within the trajectories. It does not read the trajectories.
    ///
    /// # Errors
    /// [`Problem`] names the file and what is wrong.
    pub fn open(folder: &Path) -> Result<Self, Problem> {
        let path = folder.join(INDEX);
        let index = read_index(&path)?;
        check::check(folder, &index).map_err(|problem| wrong_index(&path, problem))?;
        Ok(Self {
            folder: folder.to_owned(),
            index,
        })
    }

    /// Folder of the data set.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Index of the data set.
    pub fn index(&self) -> &DatasetIndex {
        &self.index
    }

    /// The trajectories of a split.
    pub fn entries(&self, split: Split) -> &[Entry] {
        self.index.splits.of(split)
    }

    /// Sections of the training split to learn from.
    pub fn sections(&self) -> &[Section] {
        &self.index.sections
    }

    /// The samples of all sections, in order.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        self.index.sections.iter().flat_map(Section::samples)
    }

    /// Reads a trajectory and checks its hash, size and frame rate against the index.
    ///
    /// # Errors
    /// [`Problem`] names the file and what is wrong.
    pub fn read(&self, entry: &Entry) -> Result<Trajectory, Problem> {
        let path = self.folder.join(&entry.file);
        let bytes = read_checked(&path, entry)?;
        let trajectory = Trajectory::from_bytes(&bytes).map_err(FileError::at(&path))?;
        let agree = |expected: String, found: String| {
            if expected == found {
                Ok(())
            } else {
                Err(Problem(format!(
                    "{}: has {found}, the index says {expected}: restore the file or the index, or make the data set again",
                    path.display()
                )))
            }
        };
        let size = |frames, vertices| format!("{frames} frames of {vertices} vertices");
        let found = size(trajectory.frame_count(), trajectory.vertex_count());
        agree(size(entry.frames, entry.vertices), found)?;
        let rate = |rate| format!("{rate} frames per second");
        let found = trajectory.frame_rate();
        agree(rate(self.frame_rate().unwrap_or(found)), rate(found))?;
        Ok(trajectory)
    }

    /// Frames per second, where the configuration has them.
    fn frame_rate(&self) -> Option<f64> {
        let places = ["/setting/frame_rate", "/import/frame_rate"].into_iter();
        let mut rates = places.filter_map(|place| self.index.config.pointer(place)?.as_f64());
        rates.next()
    }
}

impl Entry {
    /// The entry of `trajectory`, whose `file` has these `bytes`.
    pub(crate) fn new(
        motion: &str,
        file: &str,
        bytes: &[u8],
        trajectory: &Trajectory,
    ) -> Result<Self, Problem> {
        let speeds = speeds(trajectory.frames(), trajectory.frame_rate())?;
        Ok(Self {
            motion: motion.to_owned(),
            file: file.to_owned(),
            blake3: hash(bytes),
            frames: trajectory.frame_count(),
            vertices: trajectory.vertex_count(),
            mean_speed: speeds.mean,
            max_speed: speeds.max,
            mean_edge_length: mean_edge_length(trajectory.frames(), trajectory.topology())?,
        })
    }
}

/// Reads the index of a finished data set.
pub(crate) fn read_index(path: &Path) -> Result<DatasetIndex, Problem> {
    read_json(path, FORMAT)
}

/// Reads an index file and checks format and version first, so that another version is named as
/// such.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path, format: &str) -> Result<T, Problem> {
    let text = read_text(path).map_err(FileError::unread(path))?;
    let problem = |problem: String| wrong_index(path, problem);
    let kind: Kind =
        serde_json::from_str(&text).map_err(|error| problem(format!("is no JSON: {error}")))?;
    for (key, expected, found) in [
        ("format", json!(format), kind.format),
        ("version", json!(VERSION), kind.version),
    ] {
        if found != expected {
            return Err(problem(format!(
                "{key}: expected {expected}, found {found}"
            )));
        }
    }
    serde_json::from_str(&text).map_err(|error| problem(error.to_string()))
}

fn wrong_index(path: &Path, problem: String) -> Problem {
    let remedy = "restore the index, or make the data set again";
    Problem(format!("{}: {problem}: {remedy}", path.display()))
}

/// What an index file says that it is.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Kind {
    format: Value,
    version: Value,
}

/// The bytes of an entry's file, if they are those of the index.
pub(crate) fn read_checked(path: &Path, entry: &Entry) -> Result<Vec<u8>, Problem> {
    let bytes = read_file(path).map_err(FileError::unread(path))?;
    let found = hash(&bytes);
    if found == entry.blake3 {
        return Ok(bytes);
    }
    Err(Problem(format!(
        "{}: the file has changed since the data set was made (its hash is {found}, the index says {}): restore it, or make the data set again",
        path.display(),
        entry.blake3
    )))
}
