//! `selvedge eval`: models, physics and baselines on recorded trajectories, on scenes against their
//! own converged physics, or in random motions, as tables, as JSON, and as a report.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use selvedge::machine::Machine;
use selvedge_cloth::motion::named;
use selvedge_data::{Dataset, LoadedScene, materials};
use selvedge_lab::evaluation::{
    self, Case, Evaluation, EvaluationPlan, Method, Run, Summary, evaluate, summaries,
};
use selvedge_lab::folder::{self, FolderKind, REFERENCES};
use selvedge_lab::generation;
use selvedge_lab::report::{self, Heading, ModelFile};
use selvedge_model::Aspect;
use serde_json::{Value, json};

use crate::cli::EvalArgs;
use crate::failure::wrong;
use crate::output::{Answer, End, Facts, Table};
use crate::{place, progress, scenes};

/// Evaluates.
pub(crate) fn run(args: &EvalArgs) -> anyhow::Result<Answer> {
    let machine = args.machine.open()?;
    let (models, mut methods) = open_models(args, &machine)?;
    methods.extend(args.others());
    let opened = open_scenes(args)?;
    check_places(args, &opened)?;
    let cases = cases(args, &opened)?;
    let horizons = args.horizons();
    let references = args.output.as_deref().filter(|_| is_converged(args));
    let plan = EvaluationPlan {
        cases: &cases,
        methods: &methods,
        horizons: &horizons,
        references: references.map(|folder| folder.join(REFERENCES)),
        threads: args.jobs.map(usize::from),
    };
    evaluation::check(&plan, args.horizons.is_some())?;
    let claim = |folder| folder::claim_folder(folder, FolderKind::Evaluation);
    let _claimed = args.output.as_deref().map(claim).transpose()?;
    let (found, end) = evaluate(&plan, &mut progress::listener())?;
    let wrote = match &args.output {
        Some(folder) if !found.runs.is_empty() => {
            let mut heading = heading(args, &models, &machine, end);
            heading.reference_order = reference_order(args, &opened);
            report::write(folder, &heading, &found)?
        }
        _ => Vec::new(),
    };
    let all: Vec<&Run> = found.runs.iter().collect();
    let means = summaries(&all);
    let runs: Result<Vec<Value>, _> = found.runs.iter().map(Run::to_json).collect();
    let guards = args.guards();
    let report = json!({
        "models": models,
        "device": machine.name(),
        "cases": cases.len(),
        "guards": guards.iter().map(|guard| guard.name()).collect::<Vec<_>>(),
        // One for each run: without the frames of whole runs, which are summed up.
        "runs": runs?,
        "means": means,
        "timings": found.timings,
        "wrote": wrote,
        "interrupted": end == End::Interrupted,
    });
    let mut facts = facts(&models, &machine, cases.len(), &found.runs);
    if end == End::Interrupted {
        facts.add("interrupted", "only the starts until then are here");
    }
    facts.add_paths("wrote", &wrote);
    let tables = tables(&means, &found);
    Ok(Answer::new(format!("{facts}{tables}"), report).ended(end))
}

/// What was measured, of which model, and what of it is far from what the models learned from.
fn facts(models: &[ModelFile], machine: &Machine, cases: usize, runs: &[Run]) -> Facts {
    let mut facts = Facts::new();
    for model in models {
        let file = model.file.display();
        facts.add("model", format!("{} ({file})", model.name));
    }
    facts.add("device", machine.name());
    facts.add("cases", cases);
    for (name, words, count) in out_of_distribution(runs) {
        let plural = if count == 1 { "" } else { "s" };
        let words = format!("{name}: {words} ({count} case{plural})");
        facts.add("out of distribution", words);
    }
    facts
}

/// Returns true where scenes are measured against their converged physics.
fn is_converged(args: &EvalArgs) -> bool {
    args.data.is_empty() && args.random.is_none()
}

/// The scenes that are named.
fn open_scenes(args: &EvalArgs) -> anyhow::Result<Vec<LoadedScene>> {
    let wrong = |problem: &str| Err(wrong(problem.to_owned()));
    let mut names = args.scenes.clone();
    match (args.random, names.len()) {
        (Some(_), 0) => names.push("default".to_owned()),
        (Some(_), 2..) => return wrong("--random: name one scene"),
        (None, 0) if args.data.is_empty() => {
            return wrong(
                "there is nothing to measure on: name scenes, or data sets with --data, or random motions with --random",
            );
        }
        _ => {}
    }
    if is_converged(args) && args.output.is_none() {
        return wrong("--output: scenes need a folder, in which their references are kept");
    }
    let opened = names.iter().map(|name| scenes::open(name));
    opened.collect()
}

/// Checks that no file of the report takes the place of one that is read.
fn check_places(args: &EvalArgs, opened: &[LoadedScene]) -> anyhow::Result<()> {
    let Some(folder) = &args.output else {
        return Ok(());
    };
    let outputs = report::TABLES.map(|name| ("--output", folder.join(name)));
    let inputs: Vec<_> = opened.iter().flat_map(scenes::inputs).collect();
    place::check_outputs(&outputs, &inputs)
}

fn cases(args: &EvalArgs, opened: &[LoadedScene]) -> anyhow::Result<Vec<Case>> {
    if let (Some(count), Some(scene)) = (args.random, opened.first()) {
        let random = args.random_cases(count);
        return Case::random(scene, &random, &mut progress::listener());
    }
    if !args.data.is_empty() {
        let mut cases = Vec::new();
        for (name, data) in open_data(args)? {
            let split = args.split;
            cases.extend(Case::recorded(&name, &data, split, &args.motions)?);
        }
        return Ok(cases);
    }
    let shipped = materials().iter().map(|material| material.0);
    let materials = expanded(&args.materials, "all", shipped.collect());
    let motions = expanded(&args.motions, "test", named::test());
    let motions = expanded(&motions, "unseen", named::unseen());
    Case::converged(opened, &materials, &motions, &args.reference)
}

/// `names` with `word` replaced by what it stands for.
fn expanded(names: &[String], word: &str, meaning: Vec<&str>) -> Vec<String> {
    let all = names.iter().flat_map(|name| {
        if name == word {
            meaning.iter().map(|&name| name.to_owned()).collect()
        } else {
            vec![name.clone()]
        }
    });
    all.collect()
}

/// The models that are named, each with a name of its own, once for every guard.
fn open_models(
    args: &EvalArgs,
    machine: &Machine,
) -> anyhow::Result<(Vec<ModelFile>, Vec<Method>)> {
    let (named, guards) = (args.models(), args.guards());
    let parted: Vec<(Option<&str>, &Path)> = named.iter().map(|text| part(text)).collect();
    let short: Vec<String> = parted
        .iter()
        .map(|(name, file)| name.map_or_else(|| short_name(file), str::to_owned))
        .collect();
    let mut models: Vec<ModelFile> = Vec::with_capacity(named.len());
    let mut methods = Vec::with_capacity(named.len());
    for ((given, file), name) in parted.into_iter().zip(&short) {
        let is_double = short.iter().filter(|other| *other == name).count() > 1;
        let name =
            if is_double && given.is_none() { file.display().to_string() } else { name.clone() };
        let is_baseline = Method::BASELINES.contains(&name.as_str());
        if is_baseline || models.iter().any(|model| model.name == name) {
            let problem = format!("--model: two are called {name}: give each a name, as a=FILE");
            return Err(wrong(problem));
        }
        let model = selvedge::Model::open(Some(file))?.model;
        let parameters = model.weights().len();
        methods.extend(Method::guarded(&name, &model, &guards, machine));
        let file = file.to_owned();
        models.push(ModelFile {
            name,
            file,
            parameters,
        });
    }
    Ok((models, methods))
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

/// The data sets, each with a name of its own: that of its index, its folder where others have that
/// too.
fn open_data(args: &EvalArgs) -> anyhow::Result<Vec<(String, Dataset)>> {
    let mut all: Vec<Dataset> = Vec::with_capacity(args.data.len());
    let mut seen = Vec::with_capacity(args.data.len());
    for folder in &args.data {
        let data = generation::open(folder)?;
        let place = std::fs::canonicalize(folder)
            .with_context(|| format!("{}: could not be found", folder.display()))?;
        if seen.contains(&place) {
            let problem = format!("--data {}: stands twice", folder.display());
            return Err(wrong(problem));
        }
        seen.push(place);
        all.push(data);
    }
    let name = |data: &Dataset| {
        let name = &data.index().name;
        let is_same = |other: &&Dataset| other.index().name == *name;
        match all.iter().filter(is_same).count() {
            1 => name.clone(),
            _ => data.folder().display().to_string(),
        }
    };
    let named = all.iter().map(|data| (name(data), data.clone()));
    Ok(named.collect())
}

fn heading(args: &EvalArgs, models: &[ModelFile], machine: &Machine, end: End) -> Heading {
    let split = (!args.data.is_empty()).then_some(args.split);
    let mut heading = Heading::new(split, models, machine, end == End::Complete);
    if is_converged(args) {
        let reference = &args.reference;
        heading
            .tables
            .push(format!("The truth is a run by {reference}."));
    }
    heading
}

/// The order of the reference's integrator; none where there is no reference.
fn reference_order(args: &EvalArgs, opened: &[LoadedScene]) -> Option<u32> {
    let own = opened.first()?.scene.physics.integrator;
    let named = args.reference.integrator.as_ref();
    is_converged(args).then(|| named.map_or(own, |known| known.1).order())
}

/// Means, times and failures, for people.
fn tables(means: &[Summary], found: &Evaluation) -> String {
    let mut times = Table::new(["time of a frame on", "method", "one thread"]);
    for timing in &found.timings {
        let ms = format!("{:.2} ms", timing.ms_per_frame);
        times.row([timing.mesh.clone(), timing.method.clone(), ms]);
    }
    let mut tables = String::new();
    for of in [report::after, report::whole, report::character] {
        let (headings, rows) = of(means);
        if !rows.is_empty() {
            let mut table = Table::new(headings.iter().map(String::as_str));
            rows.into_iter().for_each(|row| table.row(row));
            tables.push_str(&format!("\n{table}"));
        }
    }
    let failures = report::failures(&found.runs);
    format!("{tables}\n{times}\n{failures}")
}

/// Departures from the training of each model: its name, the first words, and in how many cases.
fn out_of_distribution(runs: &[Run]) -> Vec<(String, String, usize)> {
    let mut found: BTreeMap<(&str, Aspect), (String, usize)> = BTreeMap::new();
    for run in runs {
        for departure in &run.out_of_distribution {
            let first = (departure.words.clone(), 0);
            let place = (run.method.as_str(), departure.aspect);
            found.entry(place).or_insert(first).1 += 1;
        }
    }
    let lines = found.into_iter();
    lines
        .map(|((name, _), (words, runs))| (name.to_owned(), words, runs))
        .collect()
}
