//! `selvedge study convergence`: the physics against its own converged motion.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use selvedge_cloth::motion::named;
use selvedge_data::{LoadedScene, materials};
use selvedge_lab::convergence::{self, Case, Mean, Method, Outcome, Plan, WholeRun};
use selvedge_lab::folder;
use selvedge_lab::folder_kind::{FolderKind, REFERENCES};
use selvedge_lab::machine::{DeviceName, Machine, PrecisionName};
use selvedge_lab::models::NamedModel;
use selvedge_lab::start;
use serde::Serialize;

use crate::cli::ConvergenceArgs;
use crate::output::{Answer, End, Facts, Table};
use crate::{place, progress, scenes};

#[derive(Serialize)]
struct Answered {
    out: PathBuf,
    cases: Vec<CaseAnswer>,
    reference: Method,
    /// Reference runs that were there already.
    references_kept: usize,
    /// Every rival at every horizon, over all cases.
    means: Vec<Mean>,
    times: Vec<TimeAnswer>,
    /// The second reference run against the first, by horizon: positions `[m]`.
    half_reference: Vec<Option<f64>>,
    wrote: Vec<PathBuf>,
    interrupted: bool,
}

#[derive(Serialize)]
struct CaseAnswer {
    name: String,
    vertices: usize,
    starts: Vec<usize>,
}

#[derive(Serialize)]
struct TimeAnswer {
    #[serde(flatten)]
    method: Method,
    ms_per_frame: Option<f64>,
    /// The mean whole run over all cases, where they were asked for.
    whole: Option<WholeRun>,
}

/// Studies scenes.
///
/// # Errors
/// What of a scene, the reference run or a file went wrong.
pub(crate) fn run(args: &ConvergenceArgs) -> anyhow::Result<Answer> {
    folder::check_kind(&args.out, Some(FolderKind::Convergence))?;
    let opened = args.scenes.iter().map(|scene| scenes::open(scene));
    let mut opened: Vec<LoadedScene> = opened.collect::<anyhow::Result<_>>()?;
    if !args.named_models().is_empty() {
        opened.iter_mut().for_each(start::take_learned_law);
    }
    let shipped = materials().iter().map(|material| material.0);
    let materials = expanded(&args.materials, "all", shipped.collect());
    let motions = expanded(&args.motions, "test", named::test());
    let motions = expanded(&motions, "unseen", named::unseen());
    let cases = Case::all(&opened, &materials, &motions)?;
    let plan = Plan::new(cases, args.settings(models(args)?))?;
    let references = args.out.join(REFERENCES);
    check_places(&args.out, &opened)?;
    let _claimed = folder::claim_folder(&args.out, FolderKind::Convergence)?;
    let outcome = convergence::run(&plan, &references, &mut progress::listener())?;
    let wrote = match outcome.cases.is_empty() {
        true => Vec::new(),
        false => convergence::report(&outcome)?.write(&args.out)?,
    };
    let answered = answered(args, &outcome, wrote);
    Ok(Answer::new(text(&answered, &outcome), &answered)?.ended(outcome.end))
}

/// Opens the models that are measured, each in every precision that is asked for. One without a
/// name is called by its file without the ending.
fn models(args: &ConvergenceArgs) -> anyhow::Result<Vec<Method>> {
    let mut methods = Vec::new();
    for (name, file) in args.named_models() {
        let model = NamedModel::open(Some(&file))?.model;
        for &precision in &args.precisions() {
            let machine = Machine::open(DeviceName::Cpu, precision)?;
            let name = match precision {
                PrecisionName::Full => name.clone(),
                other => format!("{name}, {}", other.name()),
            };
            let model = Arc::clone(&model);
            methods.push(Method::of_model(name, model, machine.instructions()));
        }
    }
    Ok(methods)
}

/// Checks that no file of the study takes the place of one that is read.
fn check_places(out: &Path, opened: &[LoadedScene]) -> anyhow::Result<()> {
    let written = convergence::TABLES.map(|name| out.join(name));
    let outputs: Vec<(&str, &Path)> = written.iter().map(|p| ("--out", p.as_path())).collect();
    let inputs: Vec<_> = opened.iter().flat_map(scenes::inputs).collect();
    place::check_outputs(&outputs, &inputs)
}

/// `names` with `word` replaced by what it stands for.
fn expanded(names: &[String], word: &str, meaning: Vec<&str>) -> Vec<String> {
    let all = names.iter().flat_map(|name| match name == word {
        true => meaning.iter().map(|&name| name.to_owned()).collect(),
        false => vec![name.clone()],
    });
    all.collect()
}

fn answered(args: &ConvergenceArgs, outcome: &Outcome, wrote: Vec<PathBuf>) -> Answered {
    let settings = &outcome.settings;
    let case = |case: &convergence::CaseOutcome| CaseAnswer {
        name: case.name.clone(),
        vertices: case.vertices,
        starts: case.starts.clone(),
    };
    let time = |(rival, method): (usize, &Method)| TimeAnswer {
        method: method.clone(),
        ms_per_frame: outcome.ms_per_frame(rival),
        whole: outcome.whole(rival),
    };
    let half = |number| Some(outcome.half(number)?.position_rmse);
    Answered {
        out: args.out.clone(),
        cases: outcome.cases.iter().map(case).collect(),
        reference: settings.reference.clone(),
        references_kept: outcome.kept,
        means: outcome.means(),
        times: settings.rivals.iter().enumerate().map(time).collect(),
        half_reference: (0..settings.horizons.len()).map(half).collect(),
        wrote,
        interrupted: outcome.end == End::Interrupted,
    }
}

/// Position errors by horizon, and what was written.
fn text(answered: &Answered, outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let columns = settings.horizons.iter().map(|k| format!("k = {k}"));
    let mut headings = vec!["position RMSE (mm)".to_owned()];
    headings.extend(columns);
    headings.extend(settings.whole.then(|| "whole runs".to_owned()));
    headings.push("ms per frame".to_owned());
    let mut table = Table::new(headings.iter().map(String::as_str));
    for (rival, method) in settings.rivals.iter().enumerate() {
        let text = |error: Option<f64>| match error {
            Some(error) => format!("{:.3}", 1e3 * error),
            None => "–".to_owned(),
        };
        let error = |number| text(outcome.mean(rival, number).map(|mean| mean.position_rmse));
        let errors = (0..settings.horizons.len()).map(error);
        let whole = outcome.whole(rival).map(|run| run.position_rmse);
        let errors = errors.chain(settings.whole.then(|| text(whole)));
        let time = outcome.ms_per_frame(rival);
        let time = time.map_or_else(|| "–".to_owned(), |time| format!("{time:.2}"));
        let first = std::iter::once(method.to_string());
        table.row(first.chain(errors).chain([time]));
    }
    let mut facts = Facts::new();
    facts.add("truth", &settings.reference);
    facts.add("cases", answered.cases.len());
    if answered.references_kept > 0 {
        facts.add("kept truths", answered.references_kept);
    }
    if answered.interrupted {
        facts.add(
            "interrupted",
            "what is here is of the starts that were done",
        );
    }
    for path in &answered.wrote {
        facts.add("wrote", path.display());
    }
    format!("{table}\n{facts}")
}
