//! `selvedge dataset generate`: simulates the motions of a preset, scenes side by side.
//!
//! The rest pose of a cloth serves all scenes that it is in. Each scene is the work
//! of one thread from its start to its end, and the index is sorted: the files do not depend on the
//! number of threads. A finished trajectory is in the index at once, so that an interrupted run
//! loses at most the scenes under way. A run that ends before the first leaves nothing behind: its
//! preset may be another the next time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context, anyhow};
use glam::DVec3;
use rayon::prelude::*;
use selvedge_data::{Dataset, DatasetPreset, DatasetWriter, LoadedScene, Split};
use selvedge_sim::Threads;
use serde::Serialize;

use crate::cli::GenerateArgs;
use crate::output::{Answer, End, Facts};
use crate::progress::Progress;
use crate::{interrupt, place, reference};

#[derive(Serialize)]
struct Report {
    name: String,
    out: PathBuf,
    train: usize,
    test: usize,
    samples: usize,
    frames_made: usize,
    trajectories_kept: usize,
    trajectories_missing: usize,
    seconds: f64,
    interrupted: bool,
}

/// A trajectory that is still to be made.
struct Job {
    split: Split,
    motion: String,
    /// Its cloth, where it is not the setting's own.
    cloth: Option<String>,
    scene: LoadedScene,
    frames: usize,
}

/// Makes a data set, or goes on with one.
///
/// # Errors
/// What of the preset, a scene, the folder or a file went wrong.
pub(crate) fn generate(args: &GenerateArgs) -> anyhow::Result<Answer> {
    let started = Instant::now();
    let preset = DatasetPreset::open(&args.preset)?;
    let plan = preset.plan()?;
    let _claimed = place::claim_folder(&args.out)?;
    let mut writer = DatasetWriter::open(&args.out, plan)?;
    let jobs = match make(&preset, &mut writer, args.threads) {
        Ok(jobs) => jobs,
        Err(error) => {
            writer.withdraw();
            return Err(error);
        }
    };
    let planned = preset.motions(Split::Train).len() + preset.motions(Split::Test).len();
    let kept = planned - jobs.len();
    let missing = writer.missing().len();
    let made = |job: &&Job| writer.written(job.split, &job.motion).is_some();
    let mut report = Report {
        name: preset.config().name.clone(),
        out: args.out.clone(),
        train: preset.motions(Split::Train).len(),
        test: preset.motions(Split::Test).len(),
        samples: 0,
        frames_made: jobs.iter().filter(made).map(|job| job.frames + 1).sum(),
        trajectories_kept: kept,
        trajectories_missing: missing,
        seconds: 0.0,
        interrupted: missing > 0,
    };
    let end = if missing > 0 {
        writer.withdraw();
        End::Interrupted
    } else {
        report.samples = writer.finish()?.index().statistics.samples;
        End::Complete
    };
    report.seconds = started.elapsed().as_secs_f64();
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// Makes what is missing, until an end is asked for, and says what that was.
fn make(
    preset: &DatasetPreset,
    writer: &mut DatasetWriter,
    threads: Option<u16>,
) -> anyhow::Result<Vec<Job>> {
    let jobs = jobs(preset, writer)?;
    let rests = rest_poses(&jobs)?;
    simulate_all(&jobs, &rests, writer, threads)?;
    Ok(jobs)
}

fn jobs(preset: &DatasetPreset, writer: &DatasetWriter) -> anyhow::Result<Vec<Job>> {
    let missing = writer.missing();
    let mut jobs = Vec::with_capacity(missing.len());
    for (split, name) in missing {
        let motion = preset.motions(split).iter().find(|m| m.name == name);
        let motion = motion.ok_or_else(|| anyhow!("motion {name:?} is not in the preset"))?;
        let scene = preset.scene(motion)?;
        jobs.push(Job {
            split,
            motion: name,
            cloth: motion.cloth.clone(),
            frames: scene.scene.frame_count()?,
            scene,
        });
    }
    Ok(jobs)
}

/// Rest poses by cloth `[m]`, `[vertices]`.
type Rests = BTreeMap<Option<String>, Vec<DVec3>>;

/// The rest pose of every cloth that the jobs have, until an end is asked for.
fn rest_poses(jobs: &[Job]) -> anyhow::Result<Rests> {
    let mut rests = Rests::new();
    for job in jobs {
        if rests.contains_key(&job.cloth) {
            continue;
        }
        let rest = reference::rest_pose(&job.scene.scene);
        if interrupt::requested() {
            break;
        }
        rests.insert(job.cloth.clone(), rest?.positions);
    }
    Ok(rests)
}

/// Simulates the jobs from the rest poses of their cloths, until all are done or an end is asked for.
fn simulate_all(
    jobs: &[Job],
    rests: &Rests,
    writer: &mut DatasetWriter,
    threads: Option<u16>,
) -> anyhow::Result<()> {
    let frames = jobs.iter().map(|job| job.frames).sum();
    let progress = Progress::new("simulating", frames, "frames");
    let writer = Mutex::new(writer);
    // Zero threads mean one per processor.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, usize::from))
        .build()
        .context("starting the threads")?;
    // One job at a time for each thread: blocks of them would leave threads idle at the end.
    let simulate = |job: &Job| -> anyhow::Result<()> {
        let scene = &job.scene.scene;
        // There is none where an end was asked for before.
        let Some(rest) = rests.get(&job.cloth) else {
            return Ok(());
        };
        let run = reference::run(scene, rest.clone(), job.frames, Threads::One, &mut || {
            progress.advance();
            interrupt::flow()
        })?;
        if run.end == End::Interrupted {
            return Ok(());
        }
        let trajectory = reference::trajectory(&job.scene.spec, scene, rest, run.positions)?;
        // `add` leaves the writer as it was where it fails, so that it is never half done.
        let mut writer = writer.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(writer.add(job.split, &job.motion, &trajectory)?)
    };
    pool.install(|| {
        jobs.par_iter().with_max_len(1).try_for_each(|job| {
            if interrupt::requested() {
                return Ok(());
            }
            simulate(job)
        })
    })
}

fn text(report: &Report) -> Facts {
    let mut facts = Facts::new();
    facts.add("data set", &report.name);
    facts.add(
        "trajectories",
        format!("{} to train on, {} to test on", report.train, report.test),
    );
    if report.trajectories_kept > 0 {
        facts.add("already there", report.trajectories_kept);
    }
    facts.add(
        "simulated",
        format!("{} frames in {:.1} s", report.frames_made, report.seconds),
    );
    if report.interrupted {
        let missing = report.trajectories_missing;
        facts.add(
            "interrupted",
            format!("{missing} trajectories are missing: run the same command again"),
        );
    } else {
        facts.add("samples", report.samples);
    }
    if report.trajectories_missing < report.train + report.test {
        facts.add("wrote", report.out.display());
    }
    facts
}

/// Opens a complete data set, and says of an incomplete one how to complete it.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn open(folder: &Path) -> anyhow::Result<Dataset> {
    let dataset = Dataset::open(folder);
    let begun = folder.join("index.partial.json").is_file();
    match dataset {
        Err(error) if begun && !folder.join("index.json").exists() => Err(anyhow!(error).context(
            format!(
                "{}: this data set is not complete: run again the command that began it, `selvedge dataset generate` or `selvedge dataset import`",
                folder.display()
            ),
        )),
        other => Ok(other?),
    }
}
