//! `selvedge study convergence`: the physics against its own converged motion.

use std::path::{Path, PathBuf};

use selvedge_cloth::motion::named;
use selvedge_data::{LoadedScene, materials};
use selvedge_lab::convergence::{self, Case, Mean, Method, Outcome, Plan};
use selvedge_lab::folder;
use selvedge_lab::folder_kind::{FolderKind, REFERENCES};
use selvedge_lab::models::NamedModel;
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
}

/// Studies scenes.
///
/// # Errors
/// What of a scene, the reference run or a file went wrong.
pub(crate) fn run(args: &ConvergenceArgs) -> anyhow::Result<Answer> {
    folder::check_kind(&args.out, Some(FolderKind::Convergence))?;
    let opened = args.scenes.iter().map(|scene| scenes::open(scene));
    let opened: Vec<LoadedScene> = opened.collect::<anyhow::Result<_>>()?;
    let shipped = materials().iter().map(|material| material.0);
    let materials = expanded(&args.materials, "all", shipped.collect());
    let motions = expanded(&args.motions, "test", named::test());
    let cases = Case::all(&opened, &materials, &motions)?;
    let plan = Plan::new(cases, args.settings(models(&args.models)?))?;
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

/// Opens the models that are measured, called by their files without the ending.
fn models(files: &[PathBuf]) -> anyhow::Result<Vec<Method>> {
    let open = |file: &PathBuf| -> anyhow::Result<Method> {
        let model = NamedModel::open(Some(file))?.model;
        let name = file.with_extension("");
        Ok(Method::of_model(format!("model {}", name.display()), model))
    };
    files.iter().map(open).collect()
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
    headings.push("ms per frame".to_owned());
    let mut table = Table::new(headings.iter().map(String::as_str));
    for (rival, method) in settings.rivals.iter().enumerate() {
        let error = |number| match outcome.mean(rival, number) {
            Some(deviation) => format!("{:.3}", 1e3 * deviation.position_rmse),
            None => "–".to_owned(),
        };
        let errors = (0..settings.horizons.len()).map(error);
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
