//! `selvedge train`: the loop of `selvedge-train`, with a bar, Ctrl-C and a summary.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, anyhow, bail};
use selvedge_data::Dataset;
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::models::NamedModel;
use selvedge_lab::{assets, folder, generation, training};
use selvedge_train::{EngineMaker, OverRanks, RunEnd, RunLimits, TrainConfig, Trainer, files};
use serde::Serialize;

use crate::cli::TrainArgs;
use crate::output::{Answer, End, Facts, percent};
use crate::progress::{self, Progress};
use crate::{interrupt, ranks};

/// Weight of the newest loss in the one that is shown.
const NEWEST: f64 = 0.02;

#[derive(Serialize)]
struct TrainReport {
    name: String,
    /// The device of the arithmetic.
    device: String,
    out: PathBuf,
    parameters: usize,
    /// Samples of the data set.
    samples: u64,
    steps_done: u64,
    steps: u64,
    /// A moving mean over about fifty steps; none where no step was made.
    loss: Option<f64>,
    seconds: f64,
    /// Samples that it learned from, in the whole time with checkpoints; a sample of several frames
    /// counts once.
    samples_per_second: f64,
    /// Ranks that shared it.
    ranks: usize,
    /// Bytes that rank 0 sent in a step.
    bytes_per_step: f64,
    /// The part of its time that rank 0 summed over ranks, or waited for others.
    talk_share: f64,
    interrupted: bool,
}

/// A training that was interrupted before its first step.
#[derive(Serialize)]
struct StoppedReport {
    out: PathBuf,
    steps_done: u64,
    steps: u64,
    interrupted: bool,
}

/// Trains, or goes on with training.
pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Answer> {
    let cfg = config(args)?;
    let machine = args.machine.open()?;
    let data = generation::open(&args.data)?;
    let ranks = ranks::all();
    let _claimed = match ranks.is_first() {
        true => Some(folder::claim_folder(&args.output, FolderKind::Training)?),
        false => None,
    };
    let steps = cfg.steps;
    let micro_batch = args.micro_batch.map_or(1, NonZeroUsize::get);
    let engine = OverRanks {
        engine: &*machine.engine(micro_batch),
        ranks: ranks.clone(),
    };
    let Some(mut trainer) = trainer(cfg, &data, args, &engine)? else {
        let report = StoppedReport {
            out: args.output.clone(),
            steps_done: 0,
            steps,
            interrupted: true,
        };
        return Ok(Answer::new(stopped(steps), &report)?.ended(End::Interrupted));
    };
    training::with_expert(&mut trainer, &data)?;
    let (started, first) = (Instant::now(), trainer.steps_done());
    let before = ranks.traffic();
    let (end, loss) = steps_until_end(&mut trainer, args)?;
    let seconds = started.elapsed().as_secs_f64();
    let talk = ranks.traffic();
    let made = (trainer.steps_done() - first).max(1) as f64;
    let shown = (trainer.steps_done() - first) * trainer.config().batch.samples as u64;
    let report = TrainReport {
        name: trainer.config().name.clone(),
        device: machine.name(),
        out: args.output.clone(),
        parameters: trainer.parameter_count(),
        samples: trainer.sample_count(),
        steps_done: trainer.steps_done(),
        steps: trainer.config().steps,
        loss,
        seconds,
        samples_per_second: shown as f64 / seconds.max(f64::MIN_POSITIVE),
        ranks: ranks.count(),
        bytes_per_step: (talk.bytes - before.bytes) as f64 / made,
        talk_share: (talk.time - before.time).as_secs_f64() / seconds.max(f64::MIN_POSITIVE),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// The text of a configuration: a shipped one's, or that of a file.
fn text_of(config: &str) -> anyhow::Result<String> {
    match assets::training(config) {
        Some(text) => Ok(text.to_owned()),
        None if !Path::new(config).exists() => {
            let known: Vec<&str> = assets::TRAININGS.iter().map(|entry| entry.0).collect();
            bail!(
                "{config}: is neither a file nor a shipped configuration; shipped are {}",
                known.join(", ")
            )
        }
        None => selvedge_data::read_text(Path::new(config))
            .map_err(|error| anyhow!("cannot read {config}: {error}")),
    }
}

/// The configuration with the changes of the call.
fn config(args: &TrainArgs) -> anyhow::Result<TrainConfig> {
    let text = text_of(&args.config)?;
    let mut cfg = TrainConfig::parse_with(&text, args.config.as_ref(), &args.set)?;
    if let Some(steps) = args.steps {
        cfg.steps = steps;
    }
    Ok(cfg)
}

/// Steps until the training ends; also returns the moving mean of the loss.
fn steps_until_end(trainer: &mut Trainer, args: &TrainArgs) -> anyhow::Result<(End, Option<f64>)> {
    let limits = RunLimits {
        time: args.span,
        checkpoint_every: args.checkpoint_every,
    };
    let left = trainer.config().steps.saturating_sub(trainer.steps_done());
    let progress = Progress::new("training", usize::try_from(left)?, "steps").within(args.span);
    let mut loss = None;
    trainer.stop_by(interrupt::flag().into());
    let end = selvedge_train::run(trainer, &args.output, limits, &mut |step| {
        let newest = step.terms.total;
        let mean = loss.map_or(newest, |mean| mean + NEWEST * (newest - mean));
        loss = Some(mean);
        progress.note(format!("loss {mean:.4}"));
        progress.advance();
        interrupt::flow()
    })
    .with_context(|| format!("training into {}", args.output.display()))?;
    let end = match end {
        RunEnd::Finished | RunEnd::TimeUp => End::Complete,
        RunEnd::Stopped => End::Interrupted,
    };
    Ok((end, loss))
}

/// Opens the training that is asked for; none where an end was asked for before the first step.
fn trainer(
    cfg: TrainConfig,
    data: &Dataset,
    args: &TrainArgs,
    engine: &dyn EngineMaker,
) -> anyhow::Result<Option<Trainer>> {
    if args.resume {
        let checkpoint = args.output.join(files::CHECKPOINT);
        return Ok(Some(Trainer::resume(cfg, data, &checkpoint, engine)?));
    }
    require_empty(&args.output)?;
    let Some(from) = &args.from else {
        return Ok(training::fresh(
            cfg,
            data,
            engine,
            &mut progress::listener(),
        )?);
    };
    let file = match from.is_dir() {
        true => from.join(files::MODEL),
        false => from.clone(),
    };
    let model = NamedModel::open(Some(&file))?;
    training::from_model(cfg, data, engine, &model, &mut progress::listener())
        .with_context(|| format!("--from {}", from.display()))
}

/// Refuses a folder with a training. A log alone is of one that ended before there was anything to
/// go on from.
fn require_empty(out: &Path) -> anyhow::Result<()> {
    let kept = [files::CHECKPOINT, files::MODEL];
    if let Some(kept) = kept.iter().find(|name| out.join(name).exists()) {
        bail!(
            "{}: there is a training in this folder ({kept}): go on with it with --resume, or choose another folder",
            out.display()
        );
    }
    Ok(())
}

fn stopped(steps: u64) -> Facts {
    let mut facts = Facts::new();
    facts.add("steps", format!("0 of {steps}"));
    let how = "the same command: nothing is written yet";
    facts.add("to go on", how);
    facts
}

fn text(report: &TrainReport) -> Facts {
    let mut facts = Facts::new();
    facts.add("training", &report.name);
    facts.add("device", &report.device);
    facts.add("parameters", report.parameters);
    facts.add("samples", report.samples);
    facts.add(
        "steps",
        format!("{} of {}", report.steps_done, report.steps),
    );
    let (seconds, pace) = (report.seconds, report.samples_per_second);
    facts.add(
        "time",
        format!("{seconds:.0} s, {pace:.1} samples per second"),
    );
    if report.ranks > 1 {
        let share = percent(report.talk_share);
        let sent = report.bytes_per_step / 1e6;
        let words = format!(
            "{}: {share} of the time for sums, {sent:.2} MB per step",
            report.ranks
        );
        facts.add("ranks", words);
    }
    if let Some(loss) = report.loss {
        facts.add("loss", format!("{loss:.5} (mean of the last steps)"));
    }
    add_files(&mut facts, &report.out, report.steps_done < report.steps);
    facts
}

/// Adds the files of a training, and how to go on with one that is not at its end.
fn add_files(facts: &mut Facts, out: &Path, goes_on: bool) {
    if goes_on {
        facts.add("to go on", "the same command with --resume");
    }
    for file in [files::MODEL, files::CHECKPOINT, files::LOG, files::CONFIG] {
        let path = out.join(file);
        // There is no log of fewer steps than a line is of.
        if path.exists() {
            facts.add("wrote", path.display());
        }
    }
}
