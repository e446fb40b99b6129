//! `selvedge train`: the loop of `selvedge-train`, with a bar, Ctrl-C and a summary.

use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail};
use selvedge_data::Dataset;
use selvedge_lab::folder::{self, FolderKind};
use selvedge_lab::{generation, training};
use selvedge_train::{EngineMaker, OverRanks, RunEnd, RunLimits, TrainConfig, Trainer, files};
use serde_json::json;

use crate::cli::TrainArgs;
use crate::output::{Answer, End, Facts, percent};
use crate::progress::{self, Progress};
use crate::{interrupt, ranks};

/// Weight of the newest loss in the one that is shown.
const NEWEST: f64 = 0.02;

/// Trains, or goes on with training.
pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<Answer> {
    let cfg = training::config(&args.config, &args.set, args.steps)?;
    let machine = args.machine.open()?;
    let data = generation::open(&args.data)?;
    let ranks = ranks::all();
    let claim = || folder::claim_folder(&args.output, FolderKind::Training);
    let _claimed = ranks.is_first().then(claim).transpose()?;
    let steps = cfg.steps;
    let micro_batch = args.micro_batch.map_or(1, NonZeroUsize::get);
    let engine = OverRanks {
        engine: &*selvedge_lab::machine::engine(&machine, micro_batch),
        ranks: ranks.clone(),
    };
    let mut facts = Facts::new();
    let Some(mut trainer) = trainer(cfg, &data, args, &engine)? else {
        facts.add("steps", format!("0 of {steps}"));
        facts.add("to go on", "the same command: nothing is written yet");
        let report = json!({ "out": args.output, "steps_done": 0, "steps": steps });
        return Ok(facts.answer_at(End::Interrupted, report));
    };
    training::with_expert(&mut trainer, &data)?;
    let (started, first) = (Instant::now(), trainer.steps_done());
    let before = ranks.time_of_talk();
    let (end, loss) = steps_until_end(&mut trainer, args)?;
    let seconds = started.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
    let talk = ranks.time_of_talk() - before;
    let done = trainer.steps_done();
    let shown = (done - first) * trainer.config().batch.samples as u64;
    // A sample of several frames counts once; the time is that with checkpoints.
    let pace = shown as f64 / seconds;
    // The part of its time that rank 0 summed over ranks or waited for them.
    let talk_share = talk.as_secs_f64() / seconds;
    facts.add("training", &trainer.config().name);
    facts.tell("device", machine.name());
    facts.tell("parameters", trainer.parameter_count());
    facts.tell("samples", trainer.sample_count());
    facts.add("steps", format!("{done} of {steps}"));
    let time = format!("{seconds:.0} s, {pace:.1} samples per second");
    facts.add("time", time);
    if ranks.are_several() {
        let (count, share) = (ranks.count(), percent(talk_share));
        facts.add("ranks", format!("{count}: {share} of the time for sums"));
    }
    let mean = loss.map(|loss| format!("{loss:.5} (mean of the last steps)"));
    facts.add_all("loss", mean);
    if done < steps {
        facts.add("to go on", "the same command with --resume");
    }
    // There is no log of fewer steps than a line is of.
    let files = [files::MODEL, files::CHECKPOINT, files::LOG, files::CONFIG];
    let mut there = files.map(|file| args.output.join(file)).to_vec();
    there.retain(|path| path.exists());
    facts.add_paths("wrote", &there);
    let report = json!({
        "name": trainer.config().name,
        "out": args.output,
        "steps_done": done,
        "steps": steps,
        // A moving mean over about fifty steps.
        "loss": loss,
        "seconds": seconds,
        "samples_per_second": pace,
        "ranks": ranks.count(),
        "talk_share": talk_share,
    });
    Ok(facts.answer_at(end, report))
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
        progress.step()
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
        return training::begin(None, cfg, data, engine, &mut progress::listener());
    };
    let file = if from.is_dir() { from.join(files::MODEL) } else { from.clone() };
    let model = selvedge::Model::open(Some(&file))?;
    let start = Some(&*model.model);
    training::begin(start, cfg, data, engine, &mut progress::listener())
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
