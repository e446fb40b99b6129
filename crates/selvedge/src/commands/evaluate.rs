//! `selvedge evaluate`: models and their naive rivals on the trajectories of data sets, as a table,
//! as JSON, and as a report with plots.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use selvedge_data::metrics::Character;
use selvedge_data::{Dataset, write_atomically};
use selvedge_lab::evaluation::{
    Contestant, Evaluation, EvaluationPlan, Measures, Racer, Row, Summary, TestData, Timing, Who,
    check_horizons, evaluate, summary,
};
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::report::{self, Contest, Heading, Report};
use selvedge_lab::{folder, generation, parts};
use serde::Serialize;
use serde_json::Value;

use crate::cli::EvaluateArgs;
use crate::failure::WrongUsage;
use crate::output::{Answer, End, Facts, Table, length, percent};
use crate::{place, progress, ranks};

#[derive(Serialize)]
struct Answered<'a> {
    models: &'a [ModelFile],
    /// The device of the models.
    device: String,
    data: &'a [PathBuf],
    split: &'static str,
    guards: Vec<&'static str>,
    rows: Vec<Value>,
    means: Vec<Mean>,
    meshes: Vec<Mean>,
    timings: &'a [Timing],
    wrote: Vec<PathBuf>,
    interrupted: bool,
}

/// A model that is measured.
#[derive(Clone, Debug, Serialize)]
struct ModelFile {
    name: String,
    file: PathBuf,
    parameters: usize,
}

/// One contestant over all motions of a mesh, or of all meshes.
#[derive(Serialize)]
struct Mean {
    name: String,
    who: Who,
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<String>,
    #[serde(flatten)]
    summary: Summary,
}

/// Evaluates models.
///
/// # Errors
/// What of a model, a data set or a file went wrong.
pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<Answer> {
    let machine = args.machine.open()?;
    check_places(args)?;
    let ranks = ranks::all();
    let _claimed = match &args.report {
        Some(folder) if ranks.is_first() => {
            Some(folder::claim_folder(folder, FolderKind::Evaluation)?)
        }
        _ => None,
    };
    let (models, mut contestants) = open_models(args, &machine)?;
    contestants.extend(args.substeps().into_iter().map(Contestant::physics));
    let rivals = Contestant::rivals().into_iter();
    contestants.extend(rivals.filter(|rival| !(args.no_mirror && rival.who() == Who::Mirror)));
    let data = open_data(args)?;
    let horizons = args.horizons();
    if args.steps.is_some() {
        check_horizons(&data, &horizons)?;
    }
    let plan = EvaluationPlan {
        data: &data,
        contestants: &contestants,
        horizons: &horizons,
        crew: ranks::crew(args.threads),
        part: args.parts.shard,
    };
    let (evaluation, end) = runs(args, &plan)?;
    if !ranks.is_first() {
        return Answer::new("", &serde_json::json!({}));
    }
    let contest = Contest::of(&evaluation.rows);
    let wrote = write_files(args, &models, &machine, &evaluation, end)?;
    let answered = Answered {
        models: &models,
        device: machine.name(),
        data: &args.data,
        split: args.split.name(),
        guards: args.guards().iter().map(|guard| guard.name()).collect(),
        rows: evaluation
            .rows
            .iter()
            .map(without_curves)
            .collect::<Result<_, _>>()?,
        means: means(&contest, None),
        meshes: contest
            .values(|row| &row.mesh)
            .into_iter()
            .flat_map(|mesh| means(&contest, Some(mesh)))
            .collect(),
        timings: &evaluation.timings,
        wrote,
        interrupted: end == End::Interrupted,
    };
    let text = text(&answered, &evaluation, &contest);
    Ok(Answer::new(text, &answered)?.ended(end))
}

/// Checks what is to be written, and where.
fn check_places(args: &EvaluateArgs) -> anyhow::Result<()> {
    if args.parts.shard.is_some() && (args.report.is_some() || args.curves.is_some()) {
        let problem = "--shard: a part has no report and no curves: ask for them with --parts";
        return Err(WrongUsage::new(problem).into());
    }
    if let Some(curves) = &args.curves {
        place::check_file(curves, "--curves", &["csv"])?;
    }
    if let (Some(curves), Some(folder)) = (&args.curves, &args.report) {
        let curves = ("--curves", curves.as_path());
        for file in report::TABLES {
            let table = folder.join(file);
            place::check_distinct(&[("--report", &table), curves])?;
        }
    }
    Ok(())
}

/// The runs that are asked for: made now, all or a part of them, or taken from parts.
fn runs(args: &EvaluateArgs, plan: &EvaluationPlan<'_>) -> anyhow::Result<(Evaluation, End)> {
    let asked = &args.parts;
    if asked.shard.is_none() && asked.parts.is_empty() {
        return Ok(evaluate(plan, &mut progress::listener())?);
    }
    let call = call(args, plan)?;
    if !asked.parts.is_empty() {
        let (rows, timings) = parts::read(&asked.parts, &call)?;
        return Ok((Evaluation { rows, timings }, End::Complete));
    }
    let (evaluation, end) = evaluate(plan, &mut progress::listener())?;
    let is_whole = end == End::Complete && ranks::all().is_first();
    if let (true, Some(shard), Some(path)) = (is_whole, asked.shard, &asked.part) {
        let Evaluation { rows, timings } = evaluation.clone();
        parts::write(path, shard, call, rows, timings)?;
    }
    Ok((evaluation, end))
}

/// A hash of all that the rows depend on.
fn call(args: &EvaluateArgs, plan: &EvaluationPlan<'_>) -> anyhow::Result<String> {
    let read = |path: &Path| {
        let bytes = selvedge_data::read_file(path);
        bytes.with_context(|| format!("reading {}", path.display()))
    };
    let names: Vec<&str> = plan.contestants.iter().map(|c| c.name.as_str()).collect();
    let words = (
        names,
        args.split,
        &args.motions,
        plan.horizons,
        args.guards(),
        args.machine.arithmetic(),
    );
    let mut files = Vec::new();
    for model in args.models.iter().map(|text| part(text).1) {
        files.push(NamedModel::open(Some(model))?.model.to_bytes()?);
    }
    for data in &args.data {
        files.push(read(&data.join("index.json"))?);
    }
    Ok(parts::call_of(&format!("evaluate {words:?}"), &files))
}

/// Writes what is asked for and says where it is.
fn write_files(
    args: &EvaluateArgs,
    models: &[ModelFile],
    machine: &Machine,
    evaluation: &Evaluation,
    end: End,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut wrote = Vec::new();
    if end == End::Complete {
        wrote.extend(args.parts.part.clone());
    }
    if let Some(curves) = &args.curves {
        let text = report::curves_csv(&Contest::of(&evaluation.rows));
        write_atomically(curves, |out| out.write_all(text.as_bytes()))?;
        wrote.push(curves.clone());
    }
    if let Some(folder) = &args.report {
        wrote.extend(paper(args, models, machine, evaluation, end)?.write(folder)?);
    }
    Ok(wrote)
}

/// The models that are named, each with a name of its own.
fn open_models(
    args: &EvaluateArgs,
    machine: &Machine,
) -> anyhow::Result<(Vec<ModelFile>, Vec<Contestant>)> {
    let (named, guards) = (&args.models, args.guards());
    let parted: Vec<(Option<&str>, &Path)> = named.iter().map(|text| part(text)).collect();
    let short: Vec<String> = parted
        .iter()
        .map(|(name, file)| name.map_or_else(|| short_name(file), str::to_owned))
        .collect();
    let mut models: Vec<ModelFile> = Vec::with_capacity(named.len());
    let mut contestants = Vec::with_capacity(named.len());
    for ((given, file), name) in parted.into_iter().zip(&short) {
        let is_double = short.iter().filter(|other| *other == name).count() > 1;
        let name = match is_double && given.is_none() {
            true => file.display().to_string(),
            false => name.clone(),
        };
        let is_rival = Contestant::rivals().iter().any(|rival| rival.name == name);
        if is_rival || models.iter().any(|model| model.name == name) {
            let problem = format!("--model: two are called {name}: give each a name, as a=FILE");
            return Err(WrongUsage::new(problem).into());
        }
        let model = NamedModel::open(Some(file))?.model;
        models.push(ModelFile {
            name: name.clone(),
            file: file.to_owned(),
            parameters: model.weights().len(),
        });
        for guard in &guards {
            contestants.push(Contestant {
                name: match guards.len() {
                    1 => name.clone(),
                    _ => format!("{name} ({})", guard.name()),
                },
                racer: Racer::Model(Arc::clone(&model), guard.settings(), machine.clone()),
            });
        }
    }
    Ok((models, contestants))
}

/// Name and file of `NAME=FILE`; no name where all of it is a file.
fn part(text: &str) -> (Option<&str>, &Path) {
    match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !Path::new(text).exists() => {
            (Some(name), Path::new(file))
        }
        _ => (None, Path::new(text)),
    }
}

/// The name of the file, or of its folder where the file is called as all models of trainings are.
fn short_name(file: &Path) -> String {
    let of = |name: Option<&std::ffi::OsStr>| name.map(|name| name.to_string_lossy().into_owned());
    let stem = of(file.file_stem());
    let folder = of(file.parent().and_then(Path::file_name));
    match (stem, folder) {
        (Some(stem), Some(folder)) if stem == "model" => folder,
        (Some(stem), _) => stem,
        (None, _) => file.display().to_string(),
    }
}

fn open_data(args: &EvaluateArgs) -> anyhow::Result<Vec<TestData>> {
    let mut all: Vec<Dataset> = Vec::with_capacity(args.data.len());
    let mut seen = Vec::with_capacity(args.data.len());
    for folder in &args.data {
        let data = generation::open(folder)?;
        let place = std::fs::canonicalize(folder)
            .with_context(|| format!("{}: could not be found", folder.display()))?;
        if seen.contains(&place) {
            let problem = format!("--data {}: stands twice", folder.display());
            return Err(WrongUsage::new(problem).into());
        }
        seen.push(place);
        all.push(data);
    }
    let named = names_of(&all).into_iter().zip(all);
    named
        .map(|(name, data)| {
            Ok(TestData::new(
                name,
                data,
                args.split.split(),
                &args.motions,
            )?)
        })
        .collect()
}

/// A name of its own for each data set: that of its index, its folder where others have that too,
/// and a number on top where another is called like the folder.
fn names_of(all: &[Dataset]) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(all.len());
    for data in all {
        let name = &data.index().name;
        let is_same = |other: &&Dataset| other.index().name == *name;
        let is_double = all.iter().filter(is_same).count() > 1;
        let name = match is_double {
            true => data.folder().display().to_string(),
            false => name.clone(),
        };
        let mut own = name.clone();
        let mut number = 1;
        while names.contains(&own) {
            number += 1;
            own = format!("{name} ({number})");
        }
        names.push(own);
    }
    names
}

fn means(contest: &Contest<'_>, mesh: Option<String>) -> Vec<Mean> {
    let of_subject = |subject: &report::Subject<'_>| {
        let is_here = |row: &&&Row| mesh.as_ref().is_none_or(|mesh| row.mesh == *mesh);
        let rows: Vec<&Row> = subject.rows.iter().filter(is_here).copied().collect();
        Mean {
            name: subject.label.clone(),
            who: subject.who,
            mesh: mesh.clone(),
            summary: summary(&rows),
        }
    };
    contest.subjects().map(of_subject).collect()
}

fn without_curves(row: &Row) -> Result<Value, serde_json::Error> {
    let mut value = serde_json::to_value(row)?;
    if let Some(fields) = value.as_object_mut() {
        fields.remove("curves");
    }
    Ok(value)
}

/// The report of an evaluation.
fn paper(
    args: &EvaluateArgs,
    models: &[ModelFile],
    machine: &Machine,
    evaluation: &Evaluation,
    end: End,
) -> anyhow::Result<Report> {
    let contest = Contest::of(&evaluation.rows);
    let cells = |m: &ModelFile| {
        let file = m.file.display().to_string();
        vec![m.name.clone(), file, m.parameters.to_string()]
    };
    let heading = Heading {
        title: &format!("Evaluation, {} split", args.split.name()),
        note: match end {
            End::Interrupted => "**Interrupted: only the runs until then are here.**",
            End::Complete => "",
        },
        models: models.iter().map(cells).collect(),
    };
    let mut page = report::evaluation_page(heading, &contest)?;
    page.say_of_times(&format!("Models ran on: {}.", machine.name()));
    Ok(page.finish(&contest, &evaluation.timings)?)
}

fn text(answered: &Answered<'_>, evaluation: &Evaluation, contest: &Contest<'_>) -> String {
    let mut facts = Facts::new();
    for model in answered.models {
        facts.add(
            "model",
            format!("{} ({})", model.name, model.file.display()),
        );
    }
    facts.add("device", &answered.device);
    for folder in answered.data {
        facts.add(
            "data",
            format!("{}, {} split", folder.display(), answered.split),
        );
    }
    for (name, words, runs) in beyond(&evaluation.rows) {
        facts.add("beyond training", format!("{name}: {words} ({runs})"));
    }
    if answered.interrupted {
        facts.add("interrupted", "only the runs until then are here");
    }
    for path in &answered.wrote {
        facts.add("wrote", path.display());
    }
    let runs = runs_table(&evaluation.rows, &answered.means);
    let likeness = likeness_table(&answered.means);
    let steps = steps_table(&answered.means);
    let stability = stability_table(&answered.means);
    let mut times = Table::new(["mesh", "who", "time per frame"]);
    for timing in &evaluation.timings {
        let ms = format!("{:.2} ms", timing.ms_per_frame);
        times.row([timing.mesh.clone(), timing.name.clone(), ms]);
    }
    let notes = "rigid: the rest pose moved with the handles; mirror: the physics from the other branch of the buckling; one run: it never starts from a true state, and over k steps these are k frames of its whole run";
    let failures = report::failures(contest);
    format!("{facts}\n{runs}\n{notes}\n\n{stability}\n{likeness}\n{steps}\n{times}\n{failures}")
}

/// Departures from the training of each model: its name, the words, and the motions.
fn beyond(rows: &[Row]) -> Vec<(String, String, String)> {
    let mut found: Vec<(String, String, Vec<&str>)> = Vec::new();
    for row in rows {
        for words in &row.beyond {
            let known = |f: &&mut (String, String, Vec<&str>)| f.0 == row.name && f.1 == *words;
            match found.iter_mut().find(known) {
                Some(known) => known.2.push(&row.motion),
                None => found.push((row.name.clone(), words.clone(), vec![&row.motion])),
            }
        }
    }
    let in_words = |motions: &[&str]| match motions {
        [one] => (*one).to_owned(),
        [first, rest @ ..] => format!("{first} and {} more", rest.len()),
        [] => String::new(),
    };
    let lines = found.into_iter();
    lines
        .map(|(name, words, motions)| (name, words, in_words(&motions)))
        .collect()
}

/// A line for each run, and the means of everyone.
fn runs_table(rows: &[Row], means: &[Mean]) -> Table {
    let first = rows.first().map(|row| &row.data);
    let is_one = rows.iter().all(|row| Some(&row.data) == first);
    let mut table = Table::new([
        "motion",
        "who",
        "position RMSE",
        "mean error",
        "e3D",
        "edge-length RMSE",
        "largest strain",
        "over 20 % from",
        "last second",
    ]);
    for row in rows {
        let motion = match is_one {
            true => row.motion.clone(),
            false => format!("{}: {}", row.data, row.motion),
        };
        table.row(cells(
            &motion,
            &row.name,
            row.measures.as_ref(),
            row.unstable_frame,
        ));
    }
    table.rule();
    for mean in means {
        let of = &mean.summary;
        table.row(cells(
            "mean",
            &mean.name,
            of.measures.as_ref(),
            of.unstable_frame,
        ));
    }
    table
}

/// Counts of runs that diverge, and of corrections by guards.
fn stability_table(means: &[Mean]) -> Table {
    let mut table = Table::new([
        "over 30 % for more than 10 frames",
        "runs",
        "diverge",
        "frames corrected",
        "lost",
        "largest correction",
    ]);
    for mean in means {
        let of = &mean.summary;
        let mut cells = vec![
            mean.name.clone(),
            of.motions.to_string(),
            of.diverged.to_string(),
        ];
        match &of.guarded {
            Some(guarded) => cells.extend([
                percent(guarded.share()),
                guarded.lost_in_words(),
                length(guarded.largest_correction),
            ]),
            None => cells.extend(["-", "-", "-"].map(str::to_owned)),
        }
        table.row(cells);
    }
    table
}

/// The character of the motions, as ratios to their truths.
fn likeness_table(means: &[Mean]) -> Table {
    let heads = std::iter::once("ratio to the truth").chain(Character::NAMES);
    let mut table = Table::new(heads);
    for mean in means.iter().filter(|mean| mean.who != Who::Truth) {
        let cell = |ratio: Option<f64>| ratio.map_or_else(|| "-".to_owned(), |r| format!("{r:.3}"));
        let cells = match mean.summary.ratios {
            Some(ratios) => ratios.map(cell),
            None => std::array::from_fn(|_| "-".to_owned()),
        };
        table.row(std::iter::once(mean.name.clone()).chain(cells));
    }
    table
}

/// Position errors over k steps, a column for each k.
fn steps_table(means: &[Mean]) -> Table {
    let all = means.iter().flat_map(|mean| &mean.summary.horizons);
    let mut steps: Vec<usize> = all.map(|h| h.steps).collect();
    steps.sort_unstable();
    steps.dedup();
    let heads: Vec<String> = steps.iter().map(usize::to_string).collect();
    let heads = heads.iter().map(String::as_str);
    let mut table = Table::new(std::iter::once("position RMSE over k steps, k =").chain(heads));
    for mean in means
        .iter()
        .filter(|mean| !mean.summary.horizons.is_empty())
    {
        let cell = |k: &usize| {
            let found = mean.summary.horizons.iter().find(|h| h.steps == *k);
            found.map_or_else(|| "-".to_owned(), |h| length(h.position_rmse))
        };
        let name = match is_one_run(mean.who) {
            true => format!("{} (one run)", mean.name),
            false => mean.name.clone(),
        };
        table.row(std::iter::once(name).chain(steps.iter().map(cell)));
    }
    table
}

/// Returns true for who does not start over from true states: its errors over k steps are those of
/// k frames of its one whole run.
fn is_one_run(who: Who) -> bool {
    match who {
        Who::Mirror | Who::Physics => true,
        Who::Model | Who::Rigid | Who::Truth => false,
    }
}

fn cells(motion: &str, who: &str, of: Option<&Measures>, unstable: Option<usize>) -> Vec<String> {
    let mut cells = vec![motion.to_owned(), who.to_owned()];
    let unstable = unstable.map_or_else(|| "-".to_owned(), |frame| format!("frame {frame}"));
    let Some(m) = of else {
        cells.extend(["failed", "", "", "", ""].map(str::to_owned));
        cells.push(unstable);
        return cells;
    };
    cells.extend([
        length(m.position_rmse),
        length(m.mean_vertex_error),
        percent(m.relative_error),
        length(m.edge_length_rmse),
        percent(m.largest_strain),
        unstable,
        format!("{:.3} m/s", m.final_speed),
    ]);
    cells
}
