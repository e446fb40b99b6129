//! Data sets as sequences of trajectories.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use selvedge_data::{
    Dataset as Folder, DatasetPlan, DatasetPreset, DatasetWriter, SectionRule, Split as Part,
};
use selvedge_lab::folder::{self, FolderKind};
use selvedge_lab::generation::{self, Order};

use crate::arrays::natural;
use crate::errors::raised;
use crate::json;
use crate::long::beside_reporting;
use crate::pickling::{self, Call};
use crate::trajectory::Trajectory;

/// A folder of trajectories with an index: some to train on, others to test on.
///
/// `Dataset(folder)` opens a complete one.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Dataset {
    pub(crate) inner: Arc<Folder>,
}

/// A data set, or its folder.
#[derive(FromPyObject)]
pub(crate) enum Data {
    Set(Py<Dataset>),
    Folder(PathBuf),
}

impl Data {
    pub(crate) fn open(self, py: Python<'_>) -> PyResult<Py<Dataset>> {
        match self {
            Self::Set(set) => Ok(set),
            Self::Folder(folder) => Py::new(py, Dataset::new(py, folder)?),
        }
    }
}

#[pymethods]
impl Dataset {
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| generation::open(&folder)).map_err(raised)?;
        let inner = Arc::new(opened);
        Ok(Self { inner })
    }

    /// Makes the data set of a `preset` (a shipped name or a TOML file) in `folder`, or goes on
    /// with it, as `selvedge data generate` does. After Ctrl-C the same call goes on.
    #[staticmethod]
    #[pyo3(signature = (preset, folder, threads=None, progress=None))]
    fn generate(
        py: Python<'_>,
        preset: PathBuf,
        folder: PathBuf,
        #[pyo3(from_py_with = natural)] threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        beside_reporting(py, progress, |_, reporter| {
            let preset = DatasetPreset::open(&preset.to_string_lossy()).map_err(raised)?;
            for warning in preset.warnings() {
                tracing::warn!("{warning}");
            }
            let order = Order {
                preset: &preset,
                folder: &folder,
                part: None,
            };
            let made = generation::generate(order, threads, &mut |event| reporter.on_event(event));
            made.map_err(raised)
        })??;
        Self::new(py, folder)
    }

    /// Writes a data set in `folder`, or goes on with one of the same `config`: `read(split, name)`
    /// gives each trajectory of the names in `train` and `test` when it is wanted.
    #[staticmethod]
    #[pyo3(signature = (folder, name, train, test, read, config=None))]
    fn write(
        py: Python<'_>,
        folder: PathBuf,
        name: &str,
        train: Vec<String>,
        test: Vec<String>,
        read: Py<PyAny>,
        config: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let config: serde_json::Value =
            config.map_or(Ok(serde_json::Value::Null), json::from_python)?;
        let plan = DatasetPlan {
            name: name.to_owned(),
            config: serde_json::json!({ "name": name, "import": config }),
            train,
            test,
            sections: SectionRule::Whole,
        };
        let _claimed = folder::claim_folder(&folder, FolderKind::DataSet).map_err(raised)?;
        let mut writer = DatasetWriter::open(&folder, plan.clone()).map_err(raised)?;
        for part in Part::BOTH {
            for name in plan.motions(part) {
                if writer.written(part, name).is_some() {
                    continue;
                }
                py.check_signals()?;
                let added = read
                    .call1(py, (part.name(), name.as_str()))
                    .and_then(|made| {
                        let made = made.bind(py).cast::<Trajectory>()?.get();
                        writer.add(part, name, &made.inner).map_err(raised)
                    });
                if let Err(error) = added {
                    writer.withdraw();
                    return Err(error);
                }
            }
        }
        writer.finish().map_err(raised)?;
        Self::new(py, folder)
    }

    /// Name.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.index().name
    }

    /// The index as a dictionary: the configuration, the files and their hashes, statistics.
    #[getter]
    fn index<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, self.inner.index())
    }

    /// Trajectories to train on.
    #[getter]
    fn train(&self) -> Split {
        self.split(Part::Train)
    }

    /// Trajectories to test on.
    #[getter]
    fn test(&self) -> Split {
        self.split(Part::Test)
    }

    /// The samples to learn from, (samples, 2), uint32: a trajectory of `train` and its current
    /// frame; the frames before and after it are there too.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let pairs = self.inner.samples().flat_map(|s| [s.trajectory, s.current]);
        let numbers: Vec<u32> = pairs.map(|number| number as u32).collect();
        let count = numbers.len() / 2;
        numbers.into_pyarray(py).reshape([count, 2])
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Call<'py>> {
        let folder = pickling::absolute(slf.get().inner.folder());
        Ok((
            slf.get_type().into_any(),
            (folder,).into_pyobject(slf.py())?,
        ))
    }

    fn __repr__(&self) -> String {
        let counts = Part::BOTH.map(|part| self.inner.entries(part).len());
        let [train, test] = counts;
        format!(
            "Dataset({:?}, {train} to train on, {test} to test on)",
            self.name()
        )
    }
}

impl Dataset {
    fn split(&self, part: Part) -> Split {
        let inner = Arc::clone(&self.inner);
        Split { inner, part }
    }
}

/// The trajectories of one split, read from their files one at a time when they are asked for.
#[pyclass(frozen, sequence, module = "selvedge")]
pub(crate) struct Split {
    inner: Arc<Folder>,
    part: Part,
}

#[derive(FromPyObject)]
enum Which {
    Number(isize),
    Motion(String),
}

#[pymethods]
impl Split {
    /// Names of the motions, in order.
    #[getter]
    fn motions(&self) -> Vec<String> {
        let entries = self.inner.entries(self.part).iter();
        entries.map(|entry| entry.motion.clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.entries(self.part).len()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Call<'py>> {
        let inner = Arc::clone(&self.inner);
        let parts = (Py::new(py, Dataset { inner })?, self.part.name()).into_pyobject(py)?;
        Ok((py.import("builtins")?.getattr("getattr")?, parts))
    }

    fn __getitem__(&self, py: Python<'_>, which: Which) -> PyResult<Trajectory> {
        let entries = self.inner.entries(self.part);
        let entry = match which {
            Which::Number(number) => {
                let place = if number < 0 { number + entries.len() as isize } else { number };
                let place = usize::try_from(place).ok();
                place.and_then(|place| entries.get(place)).ok_or_else(|| {
                    let count = entries.len();
                    PyIndexError::new_err(format!("trajectory {number} of {count}"))
                })?
            }
            Which::Motion(name) => {
                let found = entries.iter().find(|entry| entry.motion == name);
                found.ok_or_else(|| {
                    let known = self.motions().join(", ");
                    PyKeyError::new_err(format!("motion {name}: there are {known}"))
                })?
            }
        };
        let read = py.detach(|| self.inner.read(entry)).map_err(raised)?;
        Trajectory::of(py, read)
    }
}
