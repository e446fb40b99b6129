//! `selvedge stress`: a model along random motions, without a truth: how many runs stay whole.
//!
//! Each run is the work of one thread from its start to its end, and its motion follows from seed and
//! number alone.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::{Cloth, RandomMotion, Scene, Stepper};
use selvedge_data::{NamedCloth, SceneSpec, metrics, write_atomically};
use selvedge_lab::machine::Machine;
use selvedge_lab::models::{self, NamedModel};
use selvedge_lab::watched::{DIVERGED_FRAMES, DIVERGED_STRAIN, Guarded, Watched};
use selvedge_lab::{physics, workers};
use selvedge_model::ClothGraph;
use serde::Serialize;

use crate::cli::StressArgs;
use crate::failure::{self, WrongUsage};
use crate::output::{Answer, End, Facts, Table, length, percent};
use crate::progress::{self, Progress};
use crate::{interrupt, place, scenes};

#[derive(Serialize)]
struct Report {
    model: String,
    guard: &'static str,
    seed: u64,
    speed: f64,
    frames: usize,
    runs_asked: usize,
    all: Summary,
    meshes: Vec<Summary>,
    /// Median over runs, on one thread each `[ms]`.
    ms_per_frame: f64,
    runs: Vec<Run>,
    wrote: Option<PathBuf>,
    interrupted: bool,
}

/// Runs of one cloth, or of all.
#[derive(Serialize)]
struct Summary {
    mesh: String,
    vertices: usize,
    runs: usize,
    /// Those that did not diverge.
    stable: usize,
    stable_share: f64,
    guarded: Guarded,
    /// Of the largest strain of each run: the smallest, lower quartile, median, upper quartile, that of
    /// 95 of 100, and the largest; null where a run failed.
    strain_quantiles: [Option<f64>; 6],
}

/// One run.
#[derive(Clone, Serialize)]
struct Run {
    number: usize,
    mesh: String,
    /// Where it diverged.
    diverged_frame: Option<usize>,
    /// Over all frames, against the material; none where the run failed.
    largest_strain: Option<f64>,
    guarded: Guarded,
    /// Why it ended early.
    failure: Option<String>,
    #[serde(skip)]
    ms_per_frame: f64,
}

/// A cloth in its rest pose.
struct Stage {
    mesh: String,
    scene: Arc<Scene>,
    cloth: Cloth,
    graph: ClothGraph,
}

const QUANTILES: [f64; 6] = [0.0, 0.25, 0.5, 0.75, 0.95, 1.0];

/// Drives a model through random motions.
///
/// # Errors
/// What of the scene, the model, a cloth or a file went wrong. A run that fails is one that diverged.
pub(crate) fn run(args: &StressArgs) -> anyhow::Result<Answer> {
    if let Some(out) = &args.out {
        place::check_file(out, "--out", &["csv"])?;
    }
    let model = models::open(args.model.as_deref())?;
    let stages = stages(args)?;
    let mut numbers: Vec<usize> = args.only.iter().map(|&number| number as usize).collect();
    numbers.sort_unstable();
    numbers.dedup();
    if numbers.is_empty() {
        numbers.extend(0..args.runs as usize);
    }
    let progress = Progress::new("driving", numbers.len() * args.frames as usize, "frames");
    let runs = workers::share(args.threads.map(usize::from), &numbers, |&number| {
        let stage = &stages[number % stages.len()];
        Ok(one_run(args, &model, stage, number, &progress))
    })?;
    drop(progress);
    let runs: Vec<Run> = runs.into_iter().flatten().collect();
    let end = match runs.len() < numbers.len() {
        true => End::Interrupted,
        false => End::Complete,
    };
    if let Some(out) = &args.out {
        write_runs(out, &runs)?;
    }
    let several = if stages.len() > 1 { &stages[..] } else { &[] };
    let vertices = |stages: &[Stage]| stages.iter().map(|s| s.cloth.rest_positions().len()).max();
    let report = Report {
        model: model.name,
        guard: args.guard.name(),
        seed: args.seed,
        speed: args.speed,
        frames: args.frames as usize,
        runs_asked: numbers.len(),
        all: summary("all", vertices(&stages).unwrap_or(0), &runs),
        meshes: several
            .iter()
            .map(|stage| summary(&stage.mesh, stage.cloth.rest_positions().len(), &runs))
            .collect(),
        ms_per_frame: quantile(runs.iter().map(|run| run.ms_per_frame).collect(), 0.5)
            .unwrap_or(0.0),
        runs,
        wrote: args.out.clone(),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// The cloths that are asked for, each in its rest pose.
fn stages(args: &StressArgs) -> anyhow::Result<Vec<Stage>> {
    let loaded = scenes::open(&args.scene)?;
    if !loaded.scene.schedule.is_empty() {
        let problem = format!(
            "scene {}: lets handles go, which no model can follow",
            args.scene
        );
        return Err(WrongUsage::new(problem).into());
    }
    if args.mesh.is_empty() {
        return Ok(vec![stage(args.scene.clone(), loaded.scene)?]);
    }
    let mut stages = Vec::new();
    for sheet in sheets(&args.mesh)? {
        let (cloth, _) = NamedCloth::of_sheet(&sheet, args.density, args.mesh_seed)
            .map_err(|problem| WrongUsage::new(format!("mesh {}: {problem}", sheet.name)))?;
        let mut spec: SceneSpec = loaded.spec.clone();
        (spec.setting.mesh, spec.setting.handles) = (cloth.mesh, cloth.handles);
        spec.motion = selvedge_cloth::Motion::still(1.0);
        let scene = spec.build("".as_ref());
        stages.push(stage(
            sheet.name.to_owned(),
            scene.with_context(|| format!("mesh {}", sheet.name))?,
        )?);
    }
    Ok(stages)
}

fn sheets(names: &[String]) -> anyhow::Result<Vec<NamedSheet>> {
    if names == ["all"] {
        return Ok(named_sheets().to_vec());
    }
    let by_name = |name: &String| {
        NamedSheet::by_name(name).ok_or_else(|| {
            let known: Vec<&str> = named_sheets().iter().map(|sheet| sheet.name).collect();
            let known = known.join(", ");
            WrongUsage::new(format!(
                "--mesh: no mesh is called {name:?}; known are {known}"
            ))
        })
    };
    let sheets: Result<Vec<NamedSheet>, WrongUsage> = names.iter().map(by_name).collect();
    Ok(sheets?)
}

fn stage(mesh: String, scene: Scene) -> anyhow::Result<Stage> {
    let rest = physics::rest_pose(&scene, &mut progress::listener())?;
    let cloth = Cloth::of_scene(&scene, physics::rounded(&rest.positions))?;
    let graph = models::graph_of_scene(&scene, &cloth)?;
    Ok(Stage {
        mesh,
        scene: Arc::new(scene),
        cloth,
        graph,
    })
}

/// One run; none where an end was asked for.
fn one_run(
    args: &StressArgs,
    model: &NamedModel,
    stage: &Stage,
    number: usize,
    progress: &Progress,
) -> Option<Run> {
    if interrupt::requested() {
        return None;
    }
    let mut run = Run {
        number,
        mesh: stage.mesh.clone(),
        diverged_frame: None,
        largest_strain: None,
        guarded: Guarded::default(),
        failure: None,
        ms_per_frame: 0.0,
    };
    let mut strains = Vec::with_capacity(args.frames as usize);
    let driven = drive(args, model, stage, (&mut run, &mut strains), progress);
    if interrupt::requested() {
        return None;
    }
    // The first strain is that after the first step.
    run.diverged_frame =
        metrics::diverged_frame(&strains, DIVERGED_STRAIN, DIVERGED_FRAMES).map(|frame| frame + 1);
    match driven {
        Ok(()) => run.largest_strain = Some(strains.into_iter().fold(0.0, f64::max)),
        Err(error) => {
            run.failure = Some(failure::chain(&error));
            run.diverged_frame = run.diverged_frame.or(Some(strains.len() + 1));
        }
    }
    Some(run)
}

/// Steps along the motion of the run and notes the largest strain of every frame.
fn drive(
    args: &StressArgs,
    model: &NamedModel,
    stage: &Stage,
    (run, strains): (&mut Run, &mut Vec<f64>),
    progress: &Progress,
) -> anyhow::Result<()> {
    let rate = stage.scene.frame_rate;
    let motion = RandomMotion {
        seed: args.seed,
        number: run.number as u64,
        duration: f64::from(args.frames) / rate,
        speed: args.speed,
    };
    let start = stage.cloth.rest_positions();
    let held = stage.scene.handles.select(stage.scene.mesh.positions());
    let path = motion.motion().bind(&held, rate)?;
    let stepper = models::stepper(model, stage.graph.clone(), start, &Machine::Cpu)?;
    let scene = Some(Arc::clone(&stage.scene));
    let mut watched = Watched::new(stepper, &stage.cloth, rate, scene, args.guard.settings())?;
    let started = Instant::now();
    let mut stepped = || -> anyhow::Result<()> {
        for frame in 0..args.frames as usize {
            if interrupt::requested() {
                return Ok(());
            }
            watched.step(&path.targets(frame, 1)?)?;
            progress.advance();
        }
        Ok(())
    };
    let result = stepped();
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
    strains.extend(watched.log().iter().map(|trust| trust.given.largest_strain));
    run.ms_per_frame = elapsed_ms / strains.len().max(1) as f64;
    run.guarded = watched.summary();
    result
}

/// The runs of this mesh, or all.
fn summary(mesh: &str, vertices: usize, runs: &[Run]) -> Summary {
    let here = || runs.iter().filter(|run| mesh == "all" || run.mesh == mesh);
    let stable = here().filter(|run| run.diverged_frame.is_none()).count();
    let strains: Vec<f64> = here()
        .map(|run| run.largest_strain.unwrap_or(f64::INFINITY))
        .collect();
    Summary {
        mesh: mesh.to_owned(),
        vertices,
        runs: strains.len(),
        stable,
        stable_share: stable as f64 / strains.len().max(1) as f64,
        guarded: Guarded::sum(here().map(|run| run.guarded)),
        strain_quantiles: QUANTILES
            .map(|share| quantile(strains.clone(), share).filter(|strain| strain.is_finite())),
    }
}

/// The value below which `share` of the others are, to the nearest.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((share * last as f64).round() as usize).copied()
}

fn write_runs(path: &Path, runs: &[Run]) -> anyhow::Result<()> {
    write_atomically(path, |out| {
        writeln!(
            out,
            "run,mesh,diverged_frame,largest_strain,frames,corrected,lost,largest_correction,ms_per_frame,failure"
        )?;
        for run in runs {
            let Guarded {
                frames,
                corrected,
                lost,
                largest_correction,
                ..
            } = run.guarded;
            let text = |value: Option<String>| value.unwrap_or_default();
            let diverged = text(run.diverged_frame.map(|frame| frame.to_string()));
            let strain = text(run.largest_strain.map(|strain| strain.to_string()));
            let failure = text(run.failure.as_ref().map(|f| f.replace('"', "'")));
            writeln!(
                out,
                "{},\"{}\",{diverged},{strain},{frames},{corrected},{lost},{largest_correction},{},\"{failure}\"",
                run.number, run.mesh, run.ms_per_frame
            )?;
        }
        Ok(())
    })?;
    Ok(())
}

fn text(report: &Report) -> String {
    let mut facts = Facts::new();
    let all = &report.all;
    facts.add("model", &report.model);
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
        format!("{} ({})", all.stable, percent(all.stable_share)),
    );
    facts.add("lost frames", all.guarded.lost_in_words());
    facts.add("frames corrected", percent(all.guarded.share()));
    facts.add("largest correction", length(all.guarded.largest_correction));
    facts.add(
        "model and guard",
        format!("{:.2} ms per frame (median run)", report.ms_per_frame),
    );
    if report.interrupted {
        facts.add("interrupted", "only the runs until then are here");
    }
    if let Some(path) = &report.wrote {
        facts.add("wrote", path.display());
    }
    let mut table = Table::new([
        "largest strain of a run",
        "vertices",
        "runs",
        "stable",
        "lost frames",
        "corrected",
        "least",
        "1/4",
        "median",
        "3/4",
        "95 %",
        "most",
    ]);
    for summary in std::iter::once(all).chain(&report.meshes) {
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
    format!("{facts}\n{table}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(number: usize, mesh: &str, strain: Option<f64>) -> Run {
        Run {
            number,
            mesh: mesh.to_owned(),
            diverged_frame: strain.is_none().then_some(7),
            largest_strain: strain,
            guarded: Guarded {
                frames: 10,
                corrected: 2,
                lost: 1,
                lost_to_physics: 1,
                physics_failures: 0,
                largest_correction: 0.001 * number as f64,
            },
            failure: None,
            ms_per_frame: 1.0,
        }
    }

    #[test]
    fn runs_are_summed_up_by_mesh() {
        let strains = [Some(0.4), Some(0.1), None, Some(0.2), Some(0.3)];
        let runs: Vec<Run> = strains
            .into_iter()
            .enumerate()
            .map(|(k, strain)| run(k, if k < 2 { "a" } else { "b" }, strain))
            .collect();
        let all = summary("all", 4, &runs);
        assert_eq!((all.runs, all.stable, all.stable_share), (5, 4, 0.8));
        // A run that failed counts as the most strained.
        let expected = [Some(0.1), Some(0.2), Some(0.3), Some(0.4), None, None];
        assert_eq!(all.strain_quantiles, expected);
        assert_eq!((all.guarded.lost, all.guarded.frames), (5, 50));
        assert_eq!(all.guarded.share(), 0.3);
        let a = summary("a", 4, &runs);
        assert_eq!((a.runs, a.stable), (2, 2));
        assert_eq!(a.guarded.largest_correction, 0.001);
        assert_eq!(summary("c", 4, &runs).strain_quantiles, [None; 6]);
    }
}
