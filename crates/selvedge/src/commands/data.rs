//! `selvedge data generate` and `merge`: simulates the motions of a preset, scenes side by side, and
//! makes the parts of a data set one.

use std::time::Instant;

use selvedge_data::{DatasetParts, DatasetPreset};
use selvedge_lab::generation::{self, Order};
use serde_json::json;

use crate::cli::{GenerateArgs, MergeArgs};
use crate::output::{self, Answer, End, Facts};
use crate::progress;

/// Makes a data set, or goes on with one.
pub(crate) fn generate(args: &GenerateArgs) -> anyhow::Result<Answer> {
    let started = Instant::now();
    let preset = DatasetPreset::open(&args.preset)?;
    for warning in preset.warnings() {
        tracing::warn!("{}: {warning}", args.preset);
    }
    let order = Order {
        preset: &preset,
        folder: &args.output,
        part: args.shard,
    };
    let threads = args.jobs.map(usize::from);
    let made = generation::generate(order, threads, &mut progress::listener_of_files())?;
    let seconds = started.elapsed().as_secs_f64();
    let (part, is_interrupted) = (made.part, made.end() == End::Interrupted);
    let split = format!("{} to train on, {} to test on", made.train, made.test);
    let mut facts = Facts::new();
    facts.add("data set", &made.name);
    facts.add("trajectories", split);
    facts.add_all("part", part);
    facts.add_all("already there", (made.kept > 0).then_some(made.kept));
    let simulated = format!("{} frames in {seconds:.1} s", made.frames_made);
    facts.add("simulated", simulated);
    facts.add_all("divided", output::divided(made.divided));
    match (part, made.missing) {
        (Some(_), _) if !is_interrupted => {
            facts.add("to go on", "`selvedge data merge`, with the other parts");
        }
        (_, 0) => facts.add("samples", made.samples),
        (_, missing) => {
            let again = "trajectories are missing: run the same command again";
            facts.add("interrupted", format!("{missing} {again}"));
        }
    }
    if made.missing < made.train + made.test {
        facts.add("wrote", args.output.display());
    }
    let report = json!({
        "name": made.name,
        "out": args.output,
        "train": made.train,
        "test": made.test,
        "samples": made.samples,
        "frames_made": made.frames_made,
        "divided_frames": made.divided.frames,
        "trajectories_kept": made.kept,
        "trajectories_missing": made.missing,
        "seconds": seconds,
        "part": part.map(|part| part.to_string()),
    });
    Ok(facts.answer_at(made.end(), report))
}

/// Merges the parts.
pub(crate) fn merge(args: &MergeArgs) -> anyhow::Result<Answer> {
    let parts = DatasetParts::open(&args.parts)?;
    let merged = generation::merge(&parts, &args.output, &mut progress::listener_of_files())?;
    let mut facts = Facts::new();
    facts.add("data set", parts.name());
    facts.tell("parts", args.parts.len());
    facts.tell("trajectories", parts.trajectory_count());
    let (samples, end) = match &merged {
        Some(dataset) => {
            let samples = dataset.index().statistics.samples;
            facts.add("samples", samples);
            (samples, End::Complete)
        }
        None => {
            facts.add("interrupted", "run the same command again");
            (0, End::Interrupted)
        }
    };
    facts.add("wrote", args.output.display());
    let report = json!({
        "name": parts.name(),
        "out": args.output,
        "samples": samples,
    });
    Ok(facts.answer_at(end, report))
}
