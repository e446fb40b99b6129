//! Evaluations of models along the trajectories of data sets.

use std::io::Write;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge_data::write_atomically;
use selvedge_guard::GuardSettings;
use selvedge_lab::evaluation::{
    Contestant, Evaluation as Outcome, EvaluationPlan, Horizons, Racer, TestData, Who,
    check_horizons, evaluate as measure, summary,
};
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::machine::Machine;
use selvedge_lab::report::{self, Contest, Heading};
use selvedge_lab::workers::Crew;
use selvedge_lab::{End, folder};
use serde_json::{Value, json};

use crate::dataset::{Dataset, split_named};
use crate::errors::{told, wrong};
use crate::guarding;
use crate::json as python;
use crate::long::{Stop, Teller, beside};
use crate::model::Model;

/// The outcome of an evaluation.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Evaluation {
    outcome: Outcome,
    split: String,
    /// Name, file and parameters of each model.
    models: Vec<Vec<String>>,
    is_complete: bool,
}

#[pymethods]
impl Evaluation {
    /// One contestant along one trajectory each, as dictionaries; measures are in SI units.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows: Result<Vec<Value>, _> =
            self.outcome.rows.iter().map(serde_json::to_value).collect();
        let mut rows = rows.map_err(told)?;
        for row in rows.iter_mut().filter_map(Value::as_object_mut) {
            row.remove("curves");
        }
        python::to_python(py, &rows)
    }

    /// Means of every contestant over all motions.
    #[getter]
    fn means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let contest = Contest::of(&self.outcome.rows);
        let mut means = Vec::new();
        for subject in contest.subjects() {
            let mut mean = serde_json::to_value(summary(&subject.rows)).map_err(told)?;
            mean["name"] = json!(subject.label);
            means.push(mean);
        }
        python::to_python(py, &means)
    }

    /// Times of a frame by mesh and contestant [ms].
    #[getter]
    fn timings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python::to_python(py, &self.outcome.timings)
    }

    /// False where the progress callback asked to stop: then only the runs until that are here.
    #[getter]
    fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// The errors of every frame as text (.csv), as `selvedge evaluate --curves` writes them.
    fn curves_csv(&self) -> String {
        report::curves_csv(&Contest::of(&self.outcome.rows))
    }

    /// Writes the errors of every frame (.csv).
    fn write_curves(&self, path: PathBuf) -> PyResult<()> {
        let text = self.curves_csv();
        write_atomically(&path, |out| out.write_all(text.as_bytes())).map_err(told)
    }

    /// Writes tables and plots into a folder, as `selvedge evaluate --report` does.
    fn write_report(&self, py: Python<'_>, folder: PathBuf) -> PyResult<Vec<PathBuf>> {
        py.detach(|| {
            let _claimed = folder::claim_folder(&folder, FolderKind::Evaluation).map_err(told)?;
            let contest = Contest::of(&self.outcome.rows);
            let heading = Heading {
                title: &format!("Evaluation, {} split", self.split),
                note: match self.is_complete {
                    false => "**Interrupted: only the runs until then are here.**",
                    true => "",
                },
                models: self.models.clone(),
            };
            let mut page = report::evaluation_page(heading, &contest).map_err(told)?;
            page.say_of_times(&format!("Models ran on: {}.", Machine::Cpu.name()));
            let report = page.finish(&contest, &self.outcome.timings).map_err(told)?;
            report.write(&folder).map_err(told)
        })
    }

    fn __repr__(&self) -> String {
        format!("Evaluation({} rows)", self.outcome.rows.len())
    }
}

/// Runs models and their naive rivals along the trajectories of data sets, as `selvedge evaluate`
/// does. `models` are models by their names in tables; `guards` are none, limit, physics or
/// physics-always; `steps` are horizons and `starts` the true frames from which they start;
/// `mirror=False` leaves out the dearest rival; `physics` are substeps of physics that runs too.
///
/// # Errors
/// What of a model or a data set went wrong. A run that fails is a row that says so.
#[pyfunction]
#[pyo3(signature = (models, data, *, guards=vec!["limit".to_owned()], split="test",
    motions=Vec::new(), steps=None, starts=8, mirror=true, physics=Vec::new(), threads=None,
    progress=None))]
#[allow(
    clippy::too_many_arguments,
    reason = "each has a name and a default in Python"
)]
pub(crate) fn evaluate(
    py: Python<'_>,
    models: &Bound<'_, PyDict>,
    data: Vec<Py<Dataset>>,
    guards: Vec<String>,
    split: &str,
    motions: Vec<String>,
    steps: Option<Vec<usize>>,
    starts: usize,
    mirror: bool,
    physics: Vec<u32>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Evaluation> {
    let (files, mut contestants) = entrants(models, &guards)?;
    contestants.extend(physics.into_iter().map(Contestant::physics));
    let rivals = Contestant::rivals().into_iter();
    contestants.extend(rivals.filter(|rival| mirror || rival.who() != Who::Mirror));
    let part = split_named(split)?;
    let mut tests = Vec::with_capacity(data.len());
    for folder in &data {
        let folder = folder.get().inner.as_ref().clone();
        let name = folder.index().name.clone();
        tests.push(TestData::new(name, folder, part, &motions).map_err(told)?);
    }
    let are_asked = steps.is_some();
    let steps = steps.unwrap_or_else(|| Horizons::USUAL.to_vec());
    if steps.contains(&0) || starts == 0 {
        return Err(wrong("steps and starts must be at least 1"));
    }
    let horizons = Horizons::new(steps.into_iter(), starts);
    if are_asked {
        check_horizons(&tests, &horizons).map_err(told)?;
    }
    let stop = Stop::default();
    let mut teller = Teller::new(progress, &stop);
    let measured = beside(py, &stop, || {
        let plan = EvaluationPlan {
            data: &tests,
            contestants: &contestants,
            horizons: &horizons,
            crew: Crew::of_threads(threads),
            part: None,
        };
        measure(&plan, &mut |event| teller.hear(event))
    })?;
    let (outcome, end) = measured.map_err(told)?;
    Ok(Evaluation {
        outcome,
        split: split.to_owned(),
        models: files,
        is_complete: end == End::Complete,
    })
}

type Entrants = (Vec<Vec<String>>, Vec<Contestant>);

/// The models by their names, each once for every guard.
fn entrants(models: &Bound<'_, PyDict>, guards: &[String]) -> PyResult<Entrants> {
    let (mut files, mut contestants) = (Vec::new(), Vec::new());
    let settings: PyResult<Vec<GuardSettings>> =
        guards.iter().map(|name| guarding::settings(name)).collect();
    let settings = settings?;
    for (name, model) in models.iter() {
        let name: String = name.extract()?;
        if Contestant::rivals().iter().any(|rival| rival.name == name) {
            return Err(wrong(format!("models: {name} is the name of a rival")));
        }
        let model = model.cast::<Model>()?.get();
        let count = model.model.weights().len().to_string();
        files.push(vec![name.clone(), model.name.clone(), count]);
        for (guard, settings) in guards.iter().zip(&settings) {
            contestants.push(Contestant {
                name: match guards.len() {
                    1 => name.clone(),
                    _ => format!("{name} ({guard})"),
                },
                racer: Racer::Model(model.model.clone(), *settings, Machine::Cpu),
            });
        }
    }
    Ok((files, contestants))
}
