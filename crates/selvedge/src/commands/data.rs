//! `selvedge data generate`: simulates the motions of a preset, scenes side by side.

use std::path::PathBuf;
use std::time::Instant;

use selvedge_data::DatasetPreset;
use selvedge_lab::generation::{self, Order};
use selvedge_sim::DividedFrames;
use serde::Serialize;

use crate::cli::GenerateArgs;
use crate::output::{Answer, End, Facts};
use crate::progress;

#[derive(Serialize)]
struct Report {
    name: String,
    out: PathBuf,
    train: usize,
    test: usize,
    samples: usize,
    frames_made: usize,
    /// Those of them that took more substeps than their scene asks for.
    divided_frames: u64,
    trajectories_kept: usize,
    trajectories_missing: usize,
    seconds: f64,
    /// The part of the data set that this is, as 2/8.
    part: Option<String>,
    interrupted: bool,
}

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
    let report = Report {
        name: made.name.clone(),
        out: args.output.clone(),
        train: made.train,
        test: made.test,
        samples: made.samples,
        frames_made: made.frames_made,
        divided_frames: made.divided.frames,
        trajectories_kept: made.kept,
        trajectories_missing: made.missing,
        seconds: started.elapsed().as_secs_f64(),
        part: made.part.map(|part| part.to_string()),
        interrupted: made.end() == End::Interrupted,
    };
    Ok(Answer::new(text(&report, made.divided), &report)?.ended(made.end()))
}

fn text(report: &Report, made: DividedFrames) -> Facts {
    let mut facts = Facts::new();
    facts.add("data set", &report.name);
    facts.add(
        "trajectories",
        format!("{} to train on, {} to test on", report.train, report.test),
    );
    if let Some(part) = &report.part {
        facts.add("part", part);
    }
    if report.trajectories_kept > 0 {
        facts.add("already there", report.trajectories_kept);
    }
    facts.add(
        "simulated",
        format!("{} frames in {:.1} s", report.frames_made, report.seconds),
    );
    if let Some(words) = crate::output::divided(made) {
        facts.add("divided", words);
    }
    if report.interrupted {
        let missing = report.trajectories_missing;
        facts.add(
            "interrupted",
            format!("{missing} trajectories are missing: run the same command again"),
        );
    } else if report.part.is_some() {
        facts.add("to go on", "`selvedge data merge`, with the other parts");
    } else {
        facts.add("samples", report.samples);
    }
    if report.trajectories_missing < report.train + report.test {
        facts.add("wrote", report.out.display());
    }
    facts
}
