//! Data of other projects as trajectories and data sets of ours: caches of other programs
//! ([`ForeignSource`]), and arrays of the caller ([`TrajectoryParts`]).
//!
//! Foreign data lack some of what a cloth needs. Nothing is made up in silence: what is missing is
//! an option ([`ImportOptions`]), an error where nobody can know it, a documented default where its
//! source says it. What was resolved is in the data set's configuration. Positions are turned to y
//! up, all faces counter-clockwise in material space.

mod cache;
mod parts;

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use self::cache::is_cache;
use crate::UpAxis;
use crate::dataset::Split;
use crate::dataset::plan::DatasetPlan;
use crate::dataset::sections::SectionRule;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{ending_of, hash, read_file};
use crate::trajectory::Trajectory;

pub use self::parts::{TrajectoryParts, Weight};

/// Source of the rest pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RestSource {
    /// The material coordinates, hanging flat in the plane x = 0: a 2D rest state.
    Flat,
    /// The first frame.
    FirstFrame,
    /// The vertices of a mesh file (.obj), y up, in metres.
    Obj(PathBuf),
}

/// Source of the material coordinates of a file that has none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FlatSource {
    /// Those of a flat mesh of the same vertices (.obj).
    Obj(PathBuf),
    /// The form of each face in the rest pose: of garments, whose pattern is not known.
    Shape,
}

/// Source of the held vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HandleSource {
    /// These, numbered from 0, in the order of their targets.
    Vertices(Vec<u32>),
    /// Those that go with nodes of these names, node by node. Of caches with nodes (USD,
    /// .glb).
    Nodes(Vec<String>),
}

/// Options of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Name of the data set; else that of the folder.
    pub name: Option<String>,
    /// Mass per area `[kg/m²]`.
    pub density: f64,
    /// Frames per second at which frames are taken.
    pub frame_rate: f64,
    /// The held vertices.
    pub handles: HandleSource,
    /// Name of the mesh that is the cloth; by default the only one, or the one called `sheet`.
    pub object: Option<String>,
    /// The rest pose.
    pub rest: RestSource,
    /// Where material coordinates are from, if not from the file.
    pub flat: Option<FlatSource>,
    /// Axis that points up in files that do not say it.
    pub up: UpAxis,
    /// Trajectories to test on, by name, for caches that are not already in `train` and `test`.
    pub test: Vec<String>,
}

impl ImportOptions {
    /// Checks what must be positive, and what must go together.
    fn check(&self) -> Result<(), String> {
        if (&self.rest, &self.flat) == (&RestSource::Flat, &Some(FlatSource::Shape)) {
            return Err(
                "a rest pose that is flat (option `rest`) needs a flat mesh (option `flat`)"
                    .to_owned(),
            );
        }
        let numbers = [("density", self.density), ("frame_rate", self.frame_rate)];
        let bad = numbers.iter().find(|(_, n)| !(n.is_finite() && *n > 0.0));
        bad.map_or(Ok(()), |(option, found)| {
            Err(format!(
                "{option} must be finite and positive, found {found}"
            ))
        })
    }

    /// The resolved options as the configuration of the data set has them.
    fn describe(&self) -> Result<Value, FileError<Problem>> {
        // A file is named with the hash of its bytes.
        let file = |path: &Path| {
            let bytes = read_file(path).map_err(FileError::unread(path))?;
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            Ok(json!({ "file": name, "blake3": hash(&bytes) }))
        };
        let mut import = json!({
            "format": "cache",
            "density": self.density,
            "frame_rate": self.frame_rate,
            "handles": match &self.handles {
                HandleSource::Vertices(numbers) => json!(numbers),
                HandleSource::Nodes(names) => json!({ "nodes": names }),
            },
            "rest": match &self.rest {
                RestSource::Flat => json!("flat"),
                RestSource::FirstFrame => json!("first-frame"),
                RestSource::Obj(path) => file(path)?,
            },
            "up": self.up,
        });
        if let Some(object) = &self.object {
            import["object"] = json!(object);
        }
        if let Some(flat) = &self.flat {
            import["flat"] = match flat {
                FlatSource::Obj(path) => file(path)?,
                FlatSource::Shape => json!("shape"),
            };
        }
        Ok(import)
    }
}

/// A folder of caches, opened: which trajectories it has, what data set they make, and each of them
/// read when it is wanted.
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
        let named = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let named = named.file_name().unwrap_or_default().to_string_lossy();
        Ok(Self {
            name: options.name.clone().unwrap_or_else(|| named.into_owned()),
            import: options.describe()?,
            options: options.clone(),
            runs,
        })
    }

    /// Trajectories of the source.
    pub fn runs(&self) -> &[ForeignRun] {
        &self.runs
    }

    /// The data set that they make: whole trajectories, and the resolved options as configuration.
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
        parts.trajectory().map_err(FileError::at(&run.path))
    }
}

/// The trajectories in `folder`; those named in `test` become the test split.
fn runs_in(folder: &Path, test: &[String]) -> Result<Vec<ForeignRun>, FileError<Problem>> {
    let wrong = |problem: &str| Err(FileError::new(folder, problem));
    let splits = [(Split::Train, "train"), (Split::Test, "test")];
    let splits = splits.map(|(split, name)| (split, folder.join(name)));
    let mut runs = Vec::new();
    if splits.iter().any(|(_, path)| path.is_dir()) {
        // Nothing may stand beside these folders that would be left out unseen.
        let is_known = |path: &PathBuf| splits.iter().any(|(_, known)| known == path);
        let entries = entries_in(folder)?;
        if let Some(other) = entries.iter().find(|path| path.is_dir() && !is_known(path)) {
            let problem = "stands beside train and test, and is neither: put what is in it into one of them, or move it elsewhere";
            return Err(FileError::new(other, problem));
        }
        if !test.is_empty() {
            return wrong(
                "has folders train and test, which say what to test on: leave `test` out",
            );
        }
        for (split, path) in splits.iter().filter(|(_, path)| path.is_dir()) {
            runs.extend(runs_of(path, |_| *split)?);
        }
    } else {
        let split = |name: &str| {
            if test.iter().any(|t| t == name) { Split::Test } else { Split::Train }
        };
        runs = runs_of(folder, split)?;
        let is_there = |name: &&String| runs.iter().any(|run| run.name == **name);
        if let Some(name) = test.iter().find(|name| !is_there(name)) {
            return wrong(&format!("`test` names {name:?}, which is not there"));
        }
    }
    if runs.is_empty() {
        return wrong("has no cache: .usda, .usdc, .usdz, .glb, or .pc2, .npz with an .obj");
    }
    Ok(runs)
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

/// The trajectories in `folder`, by name: its caches. Meshes (.obj) belong to them; anything else is
/// an error.
fn runs_of(
    folder: &Path,
    split: impl Fn(&str) -> Split,
) -> Result<Vec<ForeignRun>, FileError<Problem>> {
    let mut runs = Vec::new();
    for path in entries_in(folder)? {
        if ending_of(&path) == "obj" {
            continue;
        }
        if path.is_dir() || !is_cache(&path) {
            let known = "is no cache that can be read (.usda, .usdc, .usdz, .glb, .pc2, .npz): move it elsewhere";
            return Err(FileError::new(&path, known));
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = name.into_owned();
        runs.push(ForeignRun {
            split: split(&name),
            name,
            path,
        });
    }
    Ok(runs)
}

#[cfg(test)]
mod tests;
