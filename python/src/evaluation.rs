//! Evaluations of models along the trajectories of data sets.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge::machine::Machine;
use selvedge_data::Split;
use selvedge_guard::Correction;
use selvedge_lab::End;
use selvedge_lab::evaluation::{
    Case, Evaluation as Outcome, EvaluationPlan, Horizons, Method, PhysicsMethod, Run, check,
    evaluate as measure, summaries,
};
use selvedge_lab::folder::{self, FolderKind};
use selvedge_lab::report::{self, Heading, ModelFile};
use serde_json::Value;

use crate::arrays::natural;
use crate::dataset::Data;
use crate::errors::{raised, word, wrong};
use crate::json as python;
use crate::long::beside_reporting;
use crate::model::Model;

/// The outcome of an evaluation.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Evaluation {
    outcome: Outcome,
    split: Split,
    models: Vec<ModelFile>,
    /// False where the progress callback asked to stop: then only the runs until that are here.
    #[pyo3(get)]
    is_complete: bool,
}

#[pymethods]
impl Evaluation {
    /// One run each, as dictionaries; measures are in SI units. Frames of whole runs are summed up.
    #[getter]
    fn runs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let runs: Result<Vec<Value>, _> = self.outcome.runs.iter().map(Run::to_json).collect();
        python::to_python(py, &runs.map_err(raised)?)
    }

    /// Means of every method over starts and cases.
    #[getter]
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all: Vec<&Run> = self.outcome.runs.iter().collect();
        python::to_python(py, &summaries(&all))
    }

    /// Times of a frame by mesh and method [ms].
    #[getter]
    fn timings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python::to_python(py, &self.outcome.timings)
    }

    /// All errors as text (.csv), as `selvedge eval -o` writes them.
    fn errors_csv(&self) -> String {
        String::from_utf8_lossy(&report::errors_csv(&self.outcome.runs)).into_owned()
    }

    /// Writes all errors (.csv).
    fn write_errors(&self, path: PathBuf) -> PyResult<()> {
        report::write_errors(&path, &self.outcome.runs).map_err(raised)
    }

    /// Writes tables into a folder, as `selvedge eval -o` does.
    fn write_report(&self, py: Python<'_>, folder: PathBuf) -> PyResult<Vec<PathBuf>> {
        py.detach(|| {
            let _claimed = folder::claim_folder(&folder, FolderKind::Evaluation).map_err(raised)?;
            let (split, models) = (Some(self.split), &self.models);
            let heading = Heading::new(split, models, &Machine::Cpu, self.is_complete);
            report::write(&folder, &heading, &self.outcome).map_err(raised)
        })
    }

    fn __repr__(&self) -> String {
        format!("Evaluation({} runs)", self.outcome.runs.len())
    }
}

/// Runs models, physics and baselines along the trajectories of data sets, as `selvedge eval --data`
/// does. `models` are models by their names in tables; `guards` are none or limit;
/// `horizons` are frames after true states and `starts` how many of these there are;
/// `baselines`: rigid; `physics` are substeps of physics that runs too.
///
/// # Errors
/// What of a model or a data set went wrong. A run that fails is one that says so.
#[pyfunction]
#[pyo3(signature = (models, data, *, guards=vec!["limit".to_owned()], split="test",
    motions=Vec::new(), horizons=None, starts=8, baselines=vec!["rigid".to_owned()],
    physics=Vec::new(), threads=None, progress=None))]
pub(crate) fn evaluate(
    py: Python<'_>,
    models: &Bound<'_, PyDict>,
    data: Vec<Data>,
    guards: Vec<String>,
    split: &str,
    motions: Vec<String>,
    horizons: Option<Vec<usize>>,
    #[pyo3(from_py_with = natural)] starts: usize,
    baselines: Vec<String>,
    physics: Vec<u32>,
    #[pyo3(from_py_with = natural)] threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Evaluation> {
    let (files, mut methods) = entrants(models, &guards)?;
    let physics = physics.into_iter().map(|substeps| PhysicsMethod {
        integrator: None,
        substeps,
    });
    methods.extend(physics.map(Method::physics));
    for name in &baselines {
        let baseline = Method::baseline(name);
        let unknown = || wrong(format!("baselines: {name:?} is not rigid"));
        methods.push(baseline.ok_or_else(unknown)?);
    }
    let split = word("split", split)?;
    let mut cases = Vec::new();
    for folder in data {
        let folder = folder.open(py)?;
        let folder = folder.get().inner.as_ref();
        let name = &folder.index().name;
        cases.extend(Case::recorded(name, folder, split, &motions).map_err(raised)?);
    }
    let are_asked = horizons.is_some();
    let horizons = horizons.unwrap_or_else(|| Horizons::USUAL.to_vec());
    let horizons = Horizons::new(horizons, starts);
    let plan = EvaluationPlan {
        cases: &cases,
        methods: &methods,
        horizons: &horizons,
        references: None,
        threads,
    };
    check(&plan, are_asked).map_err(|error| wrong(error.to_string()))?;
    let measured = beside_reporting(py, progress, |_, reporter| {
        measure(&plan, &mut |event| reporter.on_event(event))
    })?;
    let (outcome, end) = measured.map_err(raised)?;
    Ok(Evaluation {
        outcome,
        split,
        models: files,
        is_complete: end == End::Complete,
    })
}

type Entrants = (Vec<ModelFile>, Vec<Method>);

/// The models by their names, each once for every guard.
fn entrants(models: &Bound<'_, PyDict>, guards: &[String]) -> PyResult<Entrants> {
    let (mut files, mut methods) = (Vec::new(), Vec::new());
    let guards = guards.iter().map(|name| name.parse().map_err(wrong));
    let guards = guards.collect::<PyResult<Vec<Correction>>>()?;
    for (name, model) in models.iter() {
        let name: String = name.extract()?;
        if Method::BASELINES.contains(&name.as_str()) {
            return Err(wrong(format!("models: {name} is the name of a baseline")));
        }
        let model = model.cast::<Model>()?.get();
        let named = Method::guarded(&name, &model.model, &guards, &Machine::Cpu);
        methods.extend(named);
        files.push(ModelFile {
            name,
            file: PathBuf::from(&model.name),
            parameters: model.model.weights().len(),
        });
    }
    Ok((files, methods))
}
