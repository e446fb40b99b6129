//! The evaluation of a study: one method after another, each kept in a file that says which
//! model and which data it is of, and made anew where these are others.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use selvedge_data::Split;
use selvedge_guard::Correction;
use serde::{Deserialize, Serialize};

use super::{StudyData, StudyRun, processor, read_kept, training, write_kept};
use crate::evaluation::{
    self, Case, Evaluation, EvaluationPlan, Horizons, Method, Mover, evaluate,
};
use crate::event::End;
use crate::folder::{self, EVALUATIONS};

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
    #[serde(default = "super::processor")]
    device: String,
}

/// Raised where evaluations that are kept would come out differently now.
const VERSION: u32 = 4;

/// Fails where something that is to be measured cannot be: before any work is done.
pub(super) fn check(run: &StudyRun<'_>) -> Result<()> {
    for data in &run.data {
        let context = || format!("data set {:?} of the study", data.name);
        data.set.verify_hashes().with_context(context)?;
    }
    for entry in &run.order.study.model {
        let (path, _) = training::model_file(run, entry)?;
        selvedge::Model::open(Some(&path)).with_context(|| format!("model {:?}", entry.name))?;
    }
    let cases = cases(run)?;
    let rigid: Vec<Method> = Method::baseline("rigid").into_iter().collect();
    let plan = EvaluationPlan {
        cases: &cases,
        methods: &rigid,
        horizons: &horizons(run),
        references: None,
        threads: run.order.threads,
    };
    evaluation::check(&plan, run.order.study.evaluation.horizons.is_some())
        .map_err(|error| anyhow!("evaluation.{error}"))
}

fn horizons(run: &StudyRun<'_>) -> Horizons {
    let asked = &run.order.study.evaluation;
    let frames = asked.horizons.as_deref().unwrap_or(&Horizons::USUAL);
    Horizons::new(frames.iter().copied(), asked.starts)
}

/// Measures every method that is not measured yet. None where the listener asked to stop.
pub(super) fn measure_all(run: &StudyRun<'_>) -> Result<Option<Evaluation>> {
    let cases = cases(run)?;
    folder::make_folder(&run.order.out.join(EVALUATIONS))?;
    let mut waiting: Vec<(String, Option<Model>)> = Vec::new();
    for entry in &run.order.study.train {
        let model = training::finished_model(run, entry)?;
        waiting.push((entry.name.clone(), Some(model)));
    }
    for entry in &run.order.study.model {
        let model = training::model_file(run, entry)?;
        waiting.push((entry.name.clone(), Some(model)));
    }
    let baselines = run.order.study.evaluation.baselines();
    waiting.extend(baselines.map(|baseline| (baseline.name, None)));
    let mut results = Evaluation::default();
    for (name, model) in waiting {
        let Some(found) = measure(run, &cases, &name, model)? else {
            return Ok(None);
        };
        results.runs.extend(found.runs);
        results.timings.extend(found.timings);
    }
    Ok(Some(results))
}

/// The file of a model, which is opened where it must run, and its hash.
type Model = (PathBuf, String);

fn cases(run: &StudyRun<'_>) -> Result<Vec<Case>> {
    let asked = &run.order.study.evaluation;
    let is_asked = |name: &String| asked.data.is_empty() || asked.data.contains(name);
    let sets = run.data.iter().filter(|data| is_asked(&data.name));
    let mut cases = Vec::new();
    for StudyData { name, set, .. } in sets {
        let of_set = Case::recorded(name, set, Split::Test, &asked.motions);
        // The study's mistake, not one of the command line.
        let in_motions = |error| anyhow!("evaluation.motions: {error}");
        cases.extend(of_set.map_err(in_motions)?);
    }
    Ok(cases)
}

/// Names and hashes of the data sets of `cases`.
fn hashes(run: &StudyRun<'_>, cases: &[Case]) -> Result<Vec<(String, String)>> {
    let mut hashes: Vec<(String, String)> = Vec::new();
    for case in cases {
        if !hashes.iter().any(|known| known.0 == case.set) {
            hashes.push((case.set.clone(), run.data(&case.set)?.hash.clone()));
        }
    }
    Ok(hashes)
}

/// The evaluation that is kept of `of`.
fn kept_of(path: &Path, of: &Subject) -> Result<Option<Evaluation>> {
    // What failed may have failed by a cause that is gone: it is tried again.
    let is_good = |kept: &Kept| {
        let mut runs = kept.evaluation.runs.iter();
        kept.of == *of && runs.all(|run| run.failure.is_none())
    };
    let kept = read_kept::<Kept>(path)?.filter(is_good);
    Ok(kept.map(|kept| kept.evaluation))
}

/// Measures a model, or the baseline of this name where there is none.
fn measure(
    run: &StudyRun<'_>,
    cases: &[Case],
    name: &str,
    model: Option<Model>,
) -> Result<Option<Evaluation>> {
    let asked = &run.order.study.evaluation;
    let of = Subject {
        version: VERSION,
        model: model.as_ref().map_or(name, |model| &model.1).to_owned(),
        data: hashes(run, cases)?,
        motions: asked.motions.clone(),
        horizons: horizons(run),
        device: match model {
            Some(_) => run.order.machine.name(),
            None => processor(),
        },
    };
    let path = run.order.out.join(EVALUATIONS).join(format!("{name}.json"));
    if let Some(kept) = kept_of(&path, &of)? {
        return Ok(Some(kept));
    }
    let method = match model {
        None => Method::baseline(name).with_context(|| format!("no baseline {name:?}"))?,
        Some((file, _)) => Method {
            name: name.to_owned(),
            mover: Mover::Model(
                selvedge::Model::open(Some(&file))?.model,
                Correction::None,
                run.order.machine.clone(),
            ),
        },
    };
    let plan = EvaluationPlan {
        cases,
        methods: &[method],
        horizons: &of.horizons,
        references: None,
        threads: run.order.threads,
    };
    let (evaluation, end) = evaluate(&plan, &mut run.reporter.listener())?;
    if end == End::Interrupted {
        return Ok(None);
    }
    let kept = Kept { of, evaluation };
    write_kept(&path, &kept)?;
    Ok(Some(kept.evaluation))
}
