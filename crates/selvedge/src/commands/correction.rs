//! `selvedge train` for a model that corrects physics: samples are made by an expert on the way.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use selvedge_lab::folder;
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::teaching::{Teaching, TeachingScenes};
use selvedge_train::{
    CorrectionConfig, CorrectionEvent, CorrectionTrainer, RunEnd, RunLimits, files, run_correction,
};
use serde::Serialize;

use super::train::NEWEST;
use crate::cli::TrainArgs;
use crate::output::{Answer, End, Facts};
use crate::progress::{self, Progress};
use crate::{interrupt, ranks};

#[derive(Serialize)]
struct CorrectionReport {
    name: String,
    out: PathBuf,
    parameters: usize,
    /// Samples that were made in this run.
    samples: u64,
    steps_done: u64,
    steps: u64,
    /// A moving mean over about fifty steps; none where no step was made.
    loss: Option<f64>,
    seconds: f64,
    interrupted: bool,
}

/// Trains by the configuration `text`, or goes on with training.
///
/// # Errors
/// What of the configuration, the scenes, the folder or a step went wrong.
pub(super) fn run(args: &TrainArgs, text: &str) -> anyhow::Result<Answer> {
    refuse(args)?;
    let mut cfg = CorrectionConfig::parse_with(text, Path::new(&args.config), &args.set)?;
    if let Some(steps) = args.steps {
        cfg.steps = steps;
    }
    let _claimed = folder::claim_folder(&args.output, FolderKind::Training)?;
    let mut trainer = trainer(cfg, args)?;
    let cfg = trainer.config().clone();
    let scenes = TeachingScenes::open(&cfg.teacher.scenes, &mut progress::listener())?;
    let started = Instant::now();
    let (end, loss) = match scenes {
        None => (End::Interrupted, None),
        Some(scenes) => {
            let teaching = Teaching::new(scenes, cfg.clone(), trainer.steps_done());
            steps_until_end(&mut trainer, teaching, args)?
        }
    };
    let report = CorrectionReport {
        name: cfg.name,
        out: args.output.clone(),
        parameters: trainer.parameter_count(),
        samples: trainer.samples_made(),
        steps_done: trainer.steps_done(),
        steps: cfg.steps,
        loss,
        seconds: started.elapsed().as_secs_f64(),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(facts(&report), &report)?.ended(end))
}

/// Refuses what only a training on a data set has.
fn refuse(args: &TrainArgs) -> anyhow::Result<()> {
    let config = &args.config;
    if ranks::all().are_several() {
        bail!("{config}: a training that corrects physics is of one rank: start it without mpirun");
    }
    let of_data = [
        ("--data", args.data.is_some()),
        ("--from", args.from.is_some()),
        (
            "--micro-batch",
            args.micro_batch.map_or(1, NonZeroUsize::get) > 1,
        ),
        ("--device", !args.machine.is_processor()),
    ];
    match of_data.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => bail!(
            "{config}: {option} is of a training on a data set: this one asks a teacher ([teacher]) on the processor; leave it out"
        ),
    }
}

fn trainer(cfg: CorrectionConfig, args: &TrainArgs) -> anyhow::Result<CorrectionTrainer> {
    let checkpoint = args.output.join(files::CHECKPOINT);
    if args.resume {
        return Ok(CorrectionTrainer::resume(cfg, &checkpoint)?);
    }
    super::train::require_empty(&args.output)?;
    Ok(CorrectionTrainer::new(cfg)?)
}

/// Steps until the training ends; also returns the moving mean of the loss.
fn steps_until_end(
    trainer: &mut CorrectionTrainer,
    mut teaching: Teaching,
    args: &TrainArgs,
) -> anyhow::Result<(End, Option<f64>)> {
    let limits = RunLimits {
        time: args.span,
        checkpoint_every: args.checkpoint_every,
    };
    let wanted = trainer.config().samples.statistics;
    let left = trainer.config().steps.saturating_sub(trainer.steps_done());
    let mut gathering = Some(Progress::new("gathering samples", wanted, "samples"));
    let mut training = None;
    let (mut gathered, mut loss) = (0, None);
    let left = usize::try_from(left)?;
    trainer.stop_by(interrupt::flag().into());
    teaching.stop_by(interrupt::flag().into());
    let end = run_correction(trainer, &mut teaching, &args.output, limits, &mut |event| {
        match event {
            CorrectionEvent::Samples(made) => {
                if let Some(progress) = &gathering {
                    (gathered..made.min(wanted)).for_each(|_| progress.advance());
                    gathered = made;
                }
            }
            CorrectionEvent::Step(step) => {
                gathering = None;
                let mean = loss.map_or(step.loss, |mean| mean + NEWEST * (step.loss - mean));
                loss = Some(mean);
                let progress = training.get_or_insert_with(|| {
                    Progress::new("training", left, "steps").within(args.span)
                });
                progress.note(format!("loss {mean:.4}"));
                progress.advance();
            }
        }
        let flow: ControlFlow<()> = interrupt::flow();
        flow
    })
    .with_context(|| format!("training into {}", args.output.display()))?;
    let end = match end {
        RunEnd::Finished | RunEnd::TimeUp => End::Complete,
        RunEnd::Stopped => End::Interrupted,
    };
    Ok((end, loss))
}

fn facts(report: &CorrectionReport) -> Facts {
    let mut facts = Facts::new();
    facts.add("training", &report.name);
    facts.add("parameters", report.parameters);
    facts.add("samples", format!("{} made by the teacher", report.samples));
    facts.add(
        "steps",
        format!("{} of {}", report.steps_done, report.steps),
    );
    facts.add("time", format!("{:.0} s", report.seconds));
    if let Some(loss) = report.loss {
        facts.add("loss", format!("{loss:.5} (mean of the last steps)"));
    }
    super::train::add_files(&mut facts, &report.out, report.steps_done < report.steps);
    facts
}
