//! A folder of foreign data, opened: which trajectories it has, what data set they make, and each
//! of them read when it is wanted.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::cache::{Caches, is_cache};
use super::error::{ForeignError, ForeignProblem};
use super::flag_simple::{FlagSimple, record_files};
use super::options::{ForeignFormat, ImportOptions, Purpose, describe_file};
use super::released::{POSITIONS, Released};
use super::tfrecord::{self, RecordPlace};
use crate::dataset::Split;
use crate::dataset::check::folder_of;
use crate::dataset::plan::DatasetPlan;
use crate::dataset::sections::SectionRule;
use crate::formats::input::open_file;
use crate::trajectory::Trajectory;

/// Foreign data that can be read.
#[derive(Clone, Debug)]
pub struct ForeignSource {
    name: String,
    /// The resolved options: an interrupted import continues only with the same.
    import: Value,
    reader: Reader,
    runs: Vec<ForeignRun>,
}

/// A trajectory of foreign data.
#[derive(Clone, Debug)]
pub struct ForeignRun {
    /// The part of the data set that it goes to.
    pub split: Split,
    /// Name of the trajectory in its source.
    pub name: String,
    place: TrajectoryPlace,
}

#[derive(Clone, Debug)]
enum TrajectoryPlace {
    Record(PathBuf, RecordPlace),
    Folder(PathBuf),
    File(PathBuf),
}

#[derive(Clone, Debug)]
enum Reader {
    FlagSimple(FlagSimple),
    Released(Released),
    Caches(Caches),
}

impl ForeignSource {
    /// Opens the data in `folder` and finds their trajectories, without reading them.
    ///
    /// `flag_simple`: `train.tfrecord` becomes the training split and every other .tfrecord file
    /// the test split; trajectories are called by file and record, as `valid-0007`. Released
    /// folders: those in `train` and `test`, or else those side by side, where the options choose
    /// the test split. A folder that is no trajectory is an error, unless its name begins with a
    /// dot.
    ///
    /// # Errors
    /// [`ForeignError`] names the file, the record and the byte, or the option.
    pub fn open(
        format: ForeignFormat,
        folder: &Path,
        options: &ImportOptions,
    ) -> Result<Self, ForeignError> {
        let at_folder = |problem| ForeignError {
            path: folder.to_owned(),
            problem,
        };
        let (reader, mut runs) = match format {
            ForeignFormat::FlagSimple => {
                let reader = FlagSimple::open(folder, options)?;
                (Reader::FlagSimple(reader), records(folder)?)
            }
            ForeignFormat::Released => {
                let reader = Released::new(options).map_err(at_folder)?;
                let runs = runs_in(folder, &options.test, FOLDERS)?;
                (Reader::Released(reader), runs)
            }
            ForeignFormat::Cache => {
                let reader = Caches::new(options).map_err(at_folder)?;
                (
                    Reader::Caches(reader),
                    runs_in(folder, &options.test, CACHES)?,
                )
            }
        };
        if options.purpose == Purpose::Testing {
            runs.retain(|run| run.split == Split::Test);
        }
        if let Some(limit) = options.limit {
            let mut kept = [0; 2];
            runs.retain(|run| {
                let count = &mut kept[usize::from(run.split == Split::Test)];
                *count += 1;
                *count <= limit
            });
        }
        check_purpose(format, options.purpose, &runs).map_err(at_folder)?;
        let import = match &reader {
            Reader::FlagSimple(reader) => reader.describe()?,
            Reader::Released(reader) => describe_released(reader, &runs)?,
            Reader::Caches(reader) => reader.describe()?,
        };
        let named = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let named = named.file_name().map(|name| name.to_string_lossy());
        let name = options.name.clone();
        Ok(Self {
            name: name.unwrap_or_else(|| named.map_or_else(String::new, String::from)),
            import,
            reader,
            runs,
        })
    }

    /// Trajectories of the source.
    #[must_use]
    pub fn runs(&self) -> &[ForeignRun] {
        &self.runs
    }

    /// The data set that they make: whole trajectories, and the resolved options as configuration.
    #[must_use]
    pub fn plan(&self) -> DatasetPlan {
        let of = |split| {
            let runs = self.runs.iter().filter(move |run| run.split == split);
            runs.map(|run| run.name.clone()).collect()
        };
        DatasetPlan {
            name: self.name.clone(),
            config: json!({ "name": self.name, "import": self.import }),
            train: of(Split::Train),
            test: of(Split::Test),
            sections: SectionRule::Whole,
        }
    }

    /// Reads a trajectory and checks all of it.
    ///
    /// # Errors
    /// [`ForeignError`] names the file, the record and the byte, or the array.
    pub fn read(&self, run: &ForeignRun) -> Result<Trajectory, ForeignError> {
        let (path, parts) = match (&self.reader, &run.place) {
            (Reader::FlagSimple(reader), TrajectoryPlace::Record(path, place)) => {
                (path, reader.read(path, place))
            }
            (Reader::Released(reader), TrajectoryPlace::Folder(path)) => {
                (path, Ok(reader.read(path)?))
            }
            (Reader::Caches(reader), TrajectoryPlace::File(path)) => (path, Ok(reader.read(path)?)),
            (
                Reader::FlagSimple(_) | Reader::Caches(_) | Reader::Released(_),
                TrajectoryPlace::Folder(path)
                | TrajectoryPlace::File(path)
                | TrajectoryPlace::Record(path, _),
            ) => {
                let problem = format!("{} is of another source", run.name);
                (path, Err(ForeignProblem::Layout(problem)))
            }
        };
        let trajectory = parts.and_then(super::assemble::Parts::trajectory);
        trajectory.map_err(|problem| ForeignError {
            path: path.clone(),
            problem,
        })
    }
}

/// The resolved options of released folders: with one frame rate, or with that of each of the
/// `runs` where they have several.
fn describe_released(reader: &Released, runs: &[ForeignRun]) -> Result<Value, ForeignError> {
    let mut rates = BTreeMap::new();
    for run in runs {
        if let TrajectoryPlace::Folder(folder) = &run.place {
            let name = format!("{}/{}", folder_of(run.split), run.name);
            rates.insert(name, reader.rate(folder)?);
        }
    }
    let first = rates.values().next().copied();
    let only = first.filter(|first| rates.values().all(|rate| rate == first));
    let mut import = json!({
        "format": ForeignFormat::Released,
        "frame_rate": only,
        "handles": reader.handles,
        "up": reader.up,
    });
    if only.is_none() {
        import["frame_rates"] = json!(rates);
    }
    if let Some(flat) = &reader.flat {
        import["flat"] = describe_file(flat)?;
    }
    Ok(import)
}

/// Checks that the data have something for their purpose.
fn check_purpose(
    format: ForeignFormat,
    purpose: Purpose,
    runs: &[ForeignRun],
) -> Result<(), ForeignProblem> {
    let split = match purpose {
        Purpose::Training => Split::Train,
        Purpose::Testing => Split::Test,
    };
    if runs.iter().any(|run| run.split == split) {
        return Ok(());
    }
    let problem = match (purpose, format) {
        (Purpose::Training, ForeignFormat::FlagSimple) => {
            "has nothing to train on, as train.tfrecord is not there: add it, or import what there is with --test-only"
        }
        (Purpose::Training, ForeignFormat::Released | ForeignFormat::Cache) => {
            "has nothing to train on: name fewer with --test or add a folder train, or import what there is to test on with --test-only"
        }
        (Purpose::Testing, ForeignFormat::FlagSimple) => {
            "has nothing to test on: add valid.tfrecord or test.tfrecord, or leave --test-only out"
        }
        (Purpose::Testing, ForeignFormat::Released | ForeignFormat::Cache) => {
            "has nothing to test on: name some with --test or add a folder test, or leave --test-only out"
        }
    };
    Err(ForeignProblem::Layout(problem.to_owned()))
}

/// The records of all TFRecord files in `folder`.
fn records(folder: &Path) -> Result<Vec<ForeignRun>, ForeignError> {
    let at = |path: &Path, problem| ForeignError {
        path: path.to_owned(),
        problem,
    };
    let mut runs = Vec::new();
    for path in record_files(folder).map_err(|problem| at(folder, problem))? {
        let places = open_file(&path)
            .map_err(ForeignProblem::Read)
            .and_then(|mut file| tfrecord::scan(&mut file))
            .map_err(|problem| at(&path, problem))?;
        if places.is_empty() {
            let problem = ForeignProblem::Layout("has no record".to_owned());
            return Err(at(&path, problem));
        }
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
        let stem = stem.unwrap_or_default();
        runs.extend(places.into_iter().map(|place| ForeignRun {
            split: match stem.as_str() {
                "train" => Split::Train,
                _ => Split::Test,
            },
            name: format!("{stem}-{:04}", place.number),
            place: TrajectoryPlace::Record(path.clone(), place),
        }));
    }
    Ok(runs)
}

/// A kind of trajectories that are found by name: how they are found in a folder, and the word
/// where there is none.
#[derive(Clone, Copy)]
struct Found {
    all: fn(&Path) -> Result<Vec<PathBuf>, ForeignError>,
    place: fn(PathBuf) -> TrajectoryPlace,
    none: &'static str,
}

const FOLDERS: Found = Found {
    all: trajectory_folders,
    place: TrajectoryPlace::Folder,
    none: "has no folder with a cloth_pos.npy",
};

const CACHES: Found = Found {
    all: caches_in,
    place: TrajectoryPlace::File,
    none: "has no cache: .abc, .usda, .usdc, .usdz, .glb, or .pc2, .mdd, .npz with an .obj",
};

/// The trajectories in `folder`; those named in `test` become the test split.
fn runs_in(folder: &Path, test: &[String], found: Found) -> Result<Vec<ForeignRun>, ForeignError> {
    let wrong = |problem: String| ForeignError {
        path: folder.to_owned(),
        problem: ForeignProblem::Layout(problem),
    };
    let [train_folder, test_folder] = ["train", "test"].map(|name| folder.join(name));
    let mut runs = Vec::new();
    if train_folder.is_dir() || test_folder.is_dir() {
        check_alone(folder)?;
        if !test.is_empty() {
            return Err(wrong(
                "has folders train and test, which say what to test on: leave --test out"
                    .to_owned(),
            ));
        }
        for (split, path) in [(Split::Train, train_folder), (Split::Test, test_folder)] {
            if path.is_dir() {
                runs.extend(runs_of(&path, |_| split, found)?);
            }
        }
    } else {
        let split = |name: &str| match test.iter().any(|t| t == name) {
            true => Split::Test,
            false => Split::Train,
        };
        runs = runs_of(folder, split, found)?;
        if let Some(name) = test
            .iter()
            .find(|t| !runs.iter().any(|run| run.name == **t))
        {
            return Err(wrong(format!("--test names {name:?}, which is not there")));
        }
    }
    if runs.is_empty() {
        return Err(wrong(found.none.to_owned()));
    }
    Ok(runs)
}

/// Checks that nothing stands beside the folders `train` and `test` that would be left out unseen.
fn check_alone(folder: &Path) -> Result<(), ForeignError> {
    for path in folders_in(folder)? {
        if !["train", "test"].iter().any(|name| path.ends_with(name)) {
            let problem = "stands beside train and test, and is neither: put what is in it into one of them, or move it elsewhere";
            return Err(ForeignError {
                path,
                problem: ForeignProblem::Layout(problem.to_owned()),
            });
        }
    }
    Ok(())
}

/// The folders in `folder` whose names do not begin with a dot, by name.
fn folders_in(folder: &Path) -> Result<Vec<PathBuf>, ForeignError> {
    let read = |source| ForeignError {
        path: folder.to_owned(),
        problem: ForeignProblem::Read(source),
    };
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && !name.starts_with('.') {
            folders.push(path);
        }
    }
    folders.sort();
    Ok(folders)
}

/// The folders in `folder`, each a trajectory, by name.
fn trajectory_folders(folder: &Path) -> Result<Vec<PathBuf>, ForeignError> {
    let folders = folders_in(folder)?;
    match folders.iter().find(|path| !path.join(POSITIONS).is_file()) {
        None => Ok(folders),
        Some(path) => {
            let problem = format!(
                "has no file {POSITIONS}: every folder here is taken for a trajectory, so add the file, or move the folder elsewhere"
            );
            Err(ForeignError {
                path: path.clone(),
                problem: ForeignProblem::Layout(problem),
            })
        }
    }
}

/// The caches in `folder`, by name. Meshes (.obj) belong to them; anything else is an error, unless
/// its name begins with a dot.
fn caches_in(folder: &Path) -> Result<Vec<PathBuf>, ForeignError> {
    let read = |source| ForeignError {
        path: folder.to_owned(),
        problem: ForeignProblem::Read(source),
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with('.') || path.extension().is_some_and(|ending| ending == "obj") {
            continue;
        }
        if path.is_dir() || !is_cache(&path) {
            let problem = "is no cache that can be read (.abc, .usda, .usdc, .usdz, .glb, .pc2, .mdd, .npz): move it elsewhere";
            return Err(ForeignError {
                path,
                problem: ForeignProblem::Layout(problem.to_owned()),
            });
        }
        files.push(path);
    }
    files.sort();
    Ok(files)
}

/// The trajectories in `folder`, by name.
fn runs_of(
    folder: &Path,
    split: impl Fn(&str) -> Split,
    found: Found,
) -> Result<Vec<ForeignRun>, ForeignError> {
    let runs = (found.all)(folder)?.into_iter().map(|path| {
        let place = (found.place)(path.clone());
        let name = match &place {
            TrajectoryPlace::File(path) => path.file_stem(),
            _ => path.file_name(),
        };
        let name = name.unwrap_or_default().to_string_lossy().into_owned();
        ForeignRun {
            split: split(&name),
            name,
            place,
        }
    });
    Ok(runs.collect())
}
