//! `selvedge stress`: a model, or physics alone, along random motions, without a truth: how many
//! runs stay whole.

use std::collections::BTreeMap;
use std::path::PathBuf;

use selvedge_lab::models::NamedModel;
use selvedge_lab::stress::{
    self, Driven, KeptRun, MeshChoice, StressError, StressPlan, StressRun, StressStage,
    StressSummary, quantile, summary,
};
use selvedge_lab::watched::{DIVERGED_FRAMES, DIVERGED_STRAIN};
use selvedge_lab::{parts, start};
use selvedge_model::Aspect;
use serde::Serialize;

use crate::cli::StressArgs;
use crate::failure::WrongUsage;
use crate::output::{Answer, End, Facts, Table, length, percent};
use crate::{place, progress, ranks, scenes};

#[derive(Serialize)]
struct StressReport {
    model: String,
    guard: &'static str,
    seed: u64,
    speed: f64,
    frames: usize,
    runs_asked: usize,
    all: StressSummary,
    meshes: Vec<StressSummary>,
    /// Median over runs, on one thread each `[ms]`.
    ms_per_frame: f64,
    runs: Vec<StressRun>,
    wrote: Option<PathBuf>,
    interrupted: bool,
}

/// Drives a model, or physics alone, through random motions.
///
/// # Errors
/// What of the scene, the model, a cloth or a file went wrong. A run that fails is one that
/// diverged.
pub(crate) fn run(args: &StressArgs) -> anyhow::Result<Answer> {
    if let Some(out) = &args.out {
        place::check_file(out, "--out", &["csv"])?;
    }
    let driven = match args.physics {
        Some(substeps) => Driven::Physics(substeps),
        None => Driven::Model(NamedModel::open(args.model.as_deref())?),
    };
    let meshes = MeshChoice {
        names: args.mesh.clone(),
        density: args.density,
        seed: args.mesh_seed,
    };
    let mut loaded = scenes::open(&args.scene)?;
    if matches!(driven, Driven::Model(_)) {
        start::take_learned_law(&mut loaded);
    }
    let stages =
        stress::stages(&args.scene, loaded, &meshes, &mut progress::listener()).map_err(usage)?;
    stress::check_rate(&driven, &stages)?;
    let plan = plan(args);
    let runs = runs(args, &plan, &driven, &stages)?;
    if !ranks::all().is_first() {
        return Answer::new("", &serde_json::json!({}));
    }
    if let Some(out) = &args.out {
        stress::write_runs(out, &runs)?;
    }
    let report = report(args, &plan, &stages, runs, driven.name());
    let end = match report.interrupted {
        true => End::Interrupted,
        false => End::Complete,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// The runs that are asked for: made now, all or a part of them, or taken from parts.
fn runs(
    args: &StressArgs,
    plan: &StressPlan,
    driven: &Driven,
    stages: &[StressStage],
) -> anyhow::Result<Vec<StressRun>> {
    let asked = &args.parts;
    let drive = |plan: &StressPlan| stress::drive(plan, driven, stages, &mut progress::listener());
    let call = || -> anyhow::Result<String> {
        let meshes = (&args.mesh, args.density, args.mesh_seed);
        let motions = (&plan.numbers, plan.frames, plan.seed, plan.speed);
        let words = format!(
            "stress {:?} {meshes:?} {motions:?} {:?}",
            args.scene, args.guard
        );
        let of = match driven {
            Driven::Model(model) => model.model.to_bytes()?,
            Driven::Physics(_) => driven.name().into_bytes(),
        };
        Ok(parts::call_of(&words, &[of]))
    };
    if !asked.parts.is_empty() {
        let (kept, _) = parts::read::<KeptRun>(&asked.parts, &call()?)?;
        return Ok(kept.into_iter().map(StressRun::from).collect());
    }
    let (Some(shard), Some(path)) = (asked.shard, &asked.part) else {
        return Ok(drive(plan)?);
    };
    let numbers = plan.numbers.iter().enumerate();
    let own = numbers
        .filter(|(place, _)| shard.has(*place))
        .map(|(_, number)| *number);
    let own = StressPlan {
        numbers: own.collect(),
        ..plan.clone()
    };
    let runs = drive(&own)?;
    if runs.len() == own.numbers.len() && ranks::all().is_first() {
        let kept = runs.iter().cloned().map(KeptRun::from).collect();
        parts::write(path, shard, call()?, kept, Vec::new())?;
    }
    Ok(runs)
}

/// A choice that cannot be stressed is a mistake of the call.
fn usage(error: StressError) -> anyhow::Error {
    match error {
        StressError::Choice(choice) => WrongUsage::new(choice.to_string()).into(),
        other => other.into(),
    }
}

fn plan(args: &StressArgs) -> StressPlan {
    let mut numbers: Vec<usize> = args.only.iter().map(|&number| number as usize).collect();
    numbers.sort_unstable();
    numbers.dedup();
    if numbers.is_empty() {
        numbers.extend(0..args.runs as usize);
    }
    StressPlan {
        numbers,
        frames: args.frames as usize,
        seed: args.seed,
        speed: args.speed,
        guard: args.guard.settings(),
        crew: ranks::crew(args.threads),
    }
}

fn report(
    args: &StressArgs,
    plan: &StressPlan,
    stages: &[StressStage],
    runs: Vec<StressRun>,
    model: String,
) -> StressReport {
    let is_own = |place: &usize| args.parts.shard.is_none_or(|shard| shard.has(*place));
    let asked = (0..plan.numbers.len()).filter(is_own).count();
    let several = if stages.len() > 1 { stages } else { &[] };
    let vertices = |stage: &StressStage| stage.cloth.rest_positions().len();
    StressReport {
        model,
        guard: args.guard.name(),
        seed: plan.seed,
        speed: plan.speed,
        frames: plan.frames,
        runs_asked: asked,
        all: summary("all", stages.iter().map(vertices).max().unwrap_or(0), &runs),
        meshes: several
            .iter()
            .map(|stage| summary(&stage.mesh, vertices(stage), &runs))
            .collect(),
        ms_per_frame: quantile(runs.iter().map(|run| run.ms_per_frame).collect(), 0.5)
            .unwrap_or(0.0),
        interrupted: runs.len() < asked,
        runs,
        wrote: args.out.clone().or_else(|| args.parts.part.clone()),
    }
}

/// Departures from the training, the first run's words for each, and in how many runs.
fn beyond(runs: &[StressRun]) -> Vec<(String, usize)> {
    let mut counts: BTreeMap<Aspect, (String, usize)> = BTreeMap::new();
    for departure in runs.iter().flat_map(|run| &run.beyond) {
        let first = (departure.words.clone(), 0);
        counts.entry(departure.aspect).or_insert(first).1 += 1;
    }
    counts.into_values().collect()
}

fn text(report: &StressReport) -> String {
    let mut facts = Facts::new();
    let all = &report.all;
    facts.add("driven", &report.model);
    facts.add("guard", report.guard);
    let asked = report.runs_asked;
    facts.add(
        "runs",
        format!("{} of {asked}, {} frames each", all.runs, report.frames),
    );
    facts.add(
        "motions",
        format!("seed {}, {} × the trained peak", report.seed, report.speed),
    );
    facts.add(
        "stable",
        format!(
            "{} ({}): no edge over {} for more than {DIVERGED_FRAMES} frames in a row, and no failure",
            all.stable,
            percent(all.stable_share),
            percent(DIVERGED_STRAIN)
        ),
    );
    for (words, runs) in beyond(&report.runs) {
        facts.add("beyond training", format!("{words} in {runs} runs"));
    }
    facts.add("lost frames", all.guarded.lost_in_words());
    facts.add("frames corrected", percent(all.guarded.share()));
    facts.add("largest correction", length(all.guarded.largest_correction));
    facts.add(
        "with the guard",
        format!("{:.2} ms per frame (median run)", report.ms_per_frame),
    );
    if report.interrupted {
        facts.add("interrupted", "only the runs until then are here");
    }
    if let Some(path) = &report.wrote {
        facts.add("wrote", path.display());
    }
    let table = strains(std::iter::once(all).chain(&report.meshes));
    format!("{facts}\n{table}")
}

/// The strains of each cloth's runs.
fn strains<'a>(summaries: impl Iterator<Item = &'a StressSummary>) -> Table {
    let mut table = Table::new([
        "largest strain of a run",
        "vertices",
        "runs",
        "stable",
        "lost frames",
        "general",
        "least",
        "1/4",
        "median",
        "3/4",
        "95 %",
        "most",
    ]);
    for summary in summaries {
        let guarded = &summary.guarded;
        let mut cells = vec![
            summary.mesh.clone(),
            summary.vertices.to_string(),
            summary.runs.to_string(),
            percent(summary.stable_share),
            guarded.lost_in_words(),
            percent(guarded.share()),
        ];
        let strain = |strain: &Option<f64>| strain.map_or_else(|| "failed".to_owned(), percent);
        cells.extend(summary.strain_quantiles.iter().map(strain));
        table.row(cells);
    }
    table
}
