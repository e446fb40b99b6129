//! A folder of caches, opened: which trajectories it has, what data set they make, and each of them
//! read when it is wanted.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::cache::is_cache;
use super::options::ImportOptions;
use crate::dataset::Split;
use crate::dataset::plan::DatasetPlan;
use crate::dataset::sections::SectionRule;
use crate::formats::file_error::{FileError, Problem};
use crate::trajectory::Trajectory;

/// Foreign data that can be read.
#[derive(Clone, Debug)]
pub struct ForeignSource {
    name: String,
    /// The resolved options: an interrupted import continues only with the same.
    import: Value,
    options: ImportOptions,
    runs: Vec<ForeignRun>,
}

/// A trajectory of foreign data.
#[derive(Clone, Debug)]
pub struct ForeignRun {
    /// The part of the data set that it goes to.
    pub split: Split,
    /// Name of the trajectory in its source.
    pub name: String,
    path: PathBuf,
}

impl ForeignSource {
    /// Opens the caches in `folder`, without reading them: those in `train` and `test`, or else
    /// those side by side, where the options choose the test split. A file that is no cache is an
    /// error, unless its name begins with a dot.
    ///
    /// # Errors
    /// [`FileError<Problem>`] names the file or the option.
    pub fn open(folder: &Path, options: &ImportOptions) -> Result<Self, FileError<Problem>> {
        options
            .check()
            .map_err(|problem| FileError::new(folder, problem))?;
        let runs = runs_in(folder, &options.test)?;
        let import = options.describe()?;
        let named = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let named = named.file_name().map(|name| name.to_string_lossy());
        let name = options.name.clone();
        Ok(Self {
            name: name.unwrap_or_else(|| named.map_or_else(String::new, String::from)),
            import,
            options: options.clone(),
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
    /// [`FileError<Problem>`] names the file, and what in it cannot be used.
    pub fn read(&self, run: &ForeignRun) -> Result<Trajectory, FileError<Problem>> {
        let parts = self.options.read(&run.path)?;
        parts
            .trajectory()
            .map_err(|problem| FileError::new(&run.path, problem))
    }
}

/// The trajectories in `folder`; those named in `test` become the test split.
fn runs_in(folder: &Path, test: &[String]) -> Result<Vec<ForeignRun>, FileError<Problem>> {
    let [train_folder, test_folder] = ["train", "test"].map(|name| folder.join(name));
    let mut runs = Vec::new();
    if train_folder.is_dir() || test_folder.is_dir() {
        check_alone(folder)?;
        if !test.is_empty() {
            let problem = "has folders train and test, which say what to test on: leave `test` out";
            return Err(FileError::new(folder, problem));
        }
        for (split, path) in [(Split::Train, train_folder), (Split::Test, test_folder)] {
            if path.is_dir() {
                runs.extend(runs_of(&path, |_| split)?);
            }
        }
    } else {
        let split = |name: &str| match test.iter().any(|t| t == name) {
            true => Split::Test,
            false => Split::Train,
        };
        runs = runs_of(folder, split)?;
        let is_there = |name: &&String| runs.iter().any(|run| run.name == **name);
        if let Some(name) = test.iter().find(|name| !is_there(name)) {
            return Err(FileError::new(
                folder,
                format!("`test` names {name:?}, which is not there"),
            ));
        }
    }
    if runs.is_empty() {
        let problem = "has no cache: .usda, .usdc, .usdz, .glb, or .pc2, .npz with an .obj";
        return Err(FileError::new(folder, problem));
    }
    Ok(runs)
}

/// Checks that nothing stands beside the folders `train` and `test` that would be left out unseen.
fn check_alone(folder: &Path) -> Result<(), FileError<Problem>> {
    let is_other =
        |path: &&PathBuf| path.is_dir() && !path.ends_with("train") && !path.ends_with("test");
    match entries_in(folder)?.iter().find(is_other) {
        None => Ok(()),
        Some(path) => {
            let problem = "stands beside train and test, and is neither: put what is in it into one of them, or move it elsewhere";
            Err(FileError::new(path, problem))
        }
    }
}

/// What is in `folder`, by name, but for names that begin with a dot.
fn entries_in(folder: &Path) -> Result<Vec<PathBuf>, FileError<Problem>> {
    let entries = std::fs::read_dir(folder).and_then(|entries| {
        let paths = entries.map(|entry| Ok(entry?.path()));
        paths.collect::<std::io::Result<Vec<PathBuf>>>()
    });
    let mut entries = entries.map_err(FileError::unread(folder))?;
    let is_hidden = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().starts_with('.')
    };
    entries.retain(|path| !is_hidden(path));
    entries.sort();
    Ok(entries)
}

/// The caches in `folder`, by name. Meshes (.obj) belong to them; anything else is an error.
fn caches_in(folder: &Path) -> Result<Vec<PathBuf>, FileError<Problem>> {
    let mut files = entries_in(folder)?;
    files.retain(|path| path.extension().is_none_or(|ending| ending != "obj"));
    match files.iter().find(|path| path.is_dir() || !is_cache(path)) {
        None => Ok(files),
        Some(path) => {
            let known = "is no cache that can be read (.usda, .usdc, .usdz, .glb, .pc2, .npz): move it elsewhere";
            Err(FileError::new(path, known))
        }
    }
}

/// The trajectories in `folder`, by name.
fn runs_of(
    folder: &Path,
    split: impl Fn(&str) -> Split,
) -> Result<Vec<ForeignRun>, FileError<Problem>> {
    let runs = caches_in(folder)?.into_iter().map(|path| {
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        ForeignRun {
            split: split(&name),
            name,
            path,
        }
    });
    Ok(runs.collect())
}
