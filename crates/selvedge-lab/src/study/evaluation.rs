//! The evaluation of a study: one method after another, each kept in a file that says which
//! model and which data it is of, and made anew where these are others.

use std::path::{Path, PathBuf};

use selvedge_data::Split;
use selvedge_guard::Correction;
use serde::{Deserialize, Serialize};

use super::desk::{Desk, StudyData};
use super::error::{OfPart, StudyError};
use super::{kept, training};
use crate::evaluation::{
    self, Case, Evaluation, EvaluationPlan, Horizons, Method, Mover, measure as measure_plan,
};
use crate::event::End;
use crate::folder;
use crate::folder_kind::EVALUATIONS;
use crate::models::NamedModel;

/// An evaluation and what it is of.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    of: Subject,
    evaluation: Evaluation,
}

/// The inputs of an evaluation; a kept one is only taken for the same.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Subject {
    /// Version of what is measured.
    version: u32,
    /// Hash of the model, or what a baseline is.
    model: String,
    /// Names and hashes of the data sets.
    data: Vec<(String, String)>,
    motions: Vec<String>,
    horizons: Horizons,
    /// The device, since times depend on it: `cpu` for a baseline, and by default.
    #[serde(default = "kept::processor")]
    device: String,
}

/// Raised where evaluations that are kept would come out differently now.
const VERSION: u32 = 4;

/// Fails where something that is to be measured cannot be: before any work is done.
pub(super) fn check(desk: &Desk<'_>) -> Result<(), StudyError> {
    for data in &desk.data {
        let context = || format!("data set {:?} of the study", data.name);
        data.set.verify_hashes().of(context)?;
    }
    for entry in &desk.study.model {
        let (path, _) = training::model_file(desk, entry)?;
        NamedModel::open(Some(&path)).of(|| format!("model {:?}", entry.name))?;
    }
    let cases = cases(desk)?;
    let rigid: Vec<Method> = Method::baseline("rigid").into_iter().collect();
    let plan = EvaluationPlan {
        cases: &cases,
        methods: &rigid,
        horizons: &horizons(desk),
        references: None,
        threads: desk.threads,
    };
    evaluation::check(&plan, desk.study.evaluation.horizons.is_some())
        .map_err(|error| StudyError::new(format!("evaluation.{error}")))
}

fn horizons(desk: &Desk<'_>) -> Horizons {
    let asked = &desk.study.evaluation;
    let frames = asked.horizons.as_deref().unwrap_or(&Horizons::USUAL);
    Horizons::new(frames.iter().copied(), asked.starts)
}

/// Measures every method that is not measured yet. None where the listener asked to stop.
pub(super) fn measure_all(desk: &Desk<'_>) -> Result<Option<Evaluation>, StudyError> {
    let cases = cases(desk)?;
    folder::make_folder(&desk.out.join(EVALUATIONS))?;
    let mut results = Evaluation::default();
    let mut add = |method: Waiting| -> Result<bool, StudyError> {
        let Some(found) = measure(desk, &cases, method)? else {
            return Ok(false);
        };
        results.runs.extend(found.runs);
        results.timings.extend(found.timings);
        Ok(true)
    };
    for entry in &desk.study.train {
        let (path, hash) = training::finished_model(desk, entry)?;
        if !add(Waiting::model(&entry.name, path, hash))? {
            return Ok(None);
        }
    }
    for entry in &desk.study.model {
        let (path, hash) = training::model_file(desk, entry)?;
        if !add(Waiting::model(&entry.name, path, hash))? {
            return Ok(None);
        }
    }
    for baseline in desk.study.evaluation.baselines() {
        let waiting = Waiting {
            name: baseline.name.clone(),
            hash: baseline.name.clone(),
            runs: Runs::Baseline(baseline),
        };
        if !add(waiting)? {
            return Ok(None);
        }
    }
    Ok(Some(results))
}

/// A method to be measured, with a hash that changes where it does.
struct Waiting {
    name: String,
    hash: String,
    runs: Runs,
}

/// A method to be; a model is opened late, where it must run.
enum Runs {
    Model(PathBuf),
    Baseline(Method),
}

impl Waiting {
    fn model(name: &str, path: PathBuf, hash: String) -> Self {
        Self {
            name: name.to_owned(),
            hash,
            runs: Runs::Model(path),
        }
    }
}

fn cases(desk: &Desk<'_>) -> Result<Vec<Case>, StudyError> {
    let asked = &desk.study.evaluation;
    let is_asked = |name: &String| asked.data.is_empty() || asked.data.contains(name);
    let sets = desk.data.iter().filter(|data| is_asked(&data.name));
    let mut cases = Vec::new();
    for StudyData { name, set, .. } in sets {
        let of_set = Case::recorded(name, set, Split::Test, &asked.motions);
        // The study's mistake, not one of the command line.
        let told = |error| StudyError::new(format!("evaluation.motions: {error}"));
        cases.extend(of_set.map_err(told)?);
    }
    Ok(cases)
}

/// Names and hashes of the data sets of `cases`.
fn hashes(desk: &Desk<'_>, cases: &[Case]) -> Result<Vec<(String, String)>, StudyError> {
    let mut hashes: Vec<(String, String)> = Vec::new();
    for case in cases {
        if !hashes.iter().any(|known| known.0 == case.set) {
            hashes.push((case.set.clone(), desk.data(&case.set)?.hash.clone()));
        }
    }
    Ok(hashes)
}

/// The evaluation that is kept of `of`.
fn kept_of(path: &Path, of: &Subject) -> Result<Option<Evaluation>, StudyError> {
    // What failed may have failed by a cause that is gone: it is tried again.
    let is_good = |kept: &Kept| {
        let mut runs = kept.evaluation.runs.iter();
        kept.of == *of && runs.all(|run| run.failure.is_none())
    };
    let kept = kept::read::<Kept>(path)?.filter(is_good);
    Ok(kept.map(|kept| kept.evaluation))
}

fn measure(
    desk: &Desk<'_>,
    cases: &[Case],
    waiting: Waiting,
) -> Result<Option<Evaluation>, StudyError> {
    let asked = &desk.study.evaluation;
    let of = Subject {
        version: VERSION,
        model: waiting.hash,
        data: hashes(desk, cases)?,
        motions: asked.motions.clone(),
        horizons: horizons(desk),
        device: match waiting.runs {
            Runs::Model(_) => desk.machine.name(),
            Runs::Baseline(_) => kept::processor(),
        },
    };
    let folder = desk.out.join(EVALUATIONS);
    let path = folder.join(format!("{}.json", waiting.name));
    if let Some(kept) = kept_of(&path, &of)? {
        return Ok(Some(kept));
    }
    let method = match waiting.runs {
        Runs::Baseline(method) => method,
        Runs::Model(file) => Method {
            name: waiting.name,
            mover: Mover::Model(
                NamedModel::open(Some(&file))?.model,
                Correction::None,
                desk.machine.clone(),
            ),
        },
    };
    let plan = EvaluationPlan {
        cases,
        methods: &[method],
        horizons: &of.horizons,
        references: None,
        threads: desk.threads,
    };
    let (evaluation, end) = measure_plan(&plan, desk.reporter)?;
    if end == End::Interrupted {
        return Ok(None);
    }
    let kept = Kept { of, evaluation };
    kept::write(&path, &kept)?;
    Ok(Some(kept.evaluation))
}
