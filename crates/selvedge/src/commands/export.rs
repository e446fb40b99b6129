//! `selvedge export`: a trajectory in the format of another program.

use std::path::PathBuf;
use std::time::Instant;

use selvedge_data::Trajectory;
use serde::Serialize;

use crate::cli::ExportArgs;
use crate::exporting::{self, Choice, Wish};
use crate::output::{Answer, End, Facts};
use crate::place;

#[derive(Serialize)]
struct Report {
    trajectory: PathBuf,
    wrote: Vec<PathBuf>,
    bytes: u64,
    frames: usize,
    seconds: f64,
    interrupted: bool,
}

/// Writes what is asked for.
pub(crate) fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    let wish = Wish::new(&args.output, args.format)?.with(Choice {
        frames: args.frames(),
        up: args.up(),
        normals: args.normals(),
        velocities: args.velocities(),
        look: args.look(),
        of_pictures: args.of_pictures(),
    });
    check_places(args, &wish.outputs())?;
    let trajectory = Trajectory::read(&args.trajectory)?;
    check_places(args, &wish.outputs_of(&trajectory))?;
    wish.check(trajectory.frame_count())?;
    let started = Instant::now();
    let end = wish.fulfil(&trajectory)?;
    let seconds = started.elapsed().as_secs_f64();
    let wrote = match end {
        End::Complete => wish.outputs_of(&trajectory),
        End::Interrupted => Vec::new(),
    };
    let report = Report {
        trajectory: args.trajectory.clone(),
        bytes: wrote.iter().map(|path| exporting::size_of(path)).sum(),
        wrote,
        frames: wish.count(trajectory.frame_count())?,
        seconds,
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// Checks that nothing is written over the trajectory or over something else that is written.
fn check_places(args: &ExportArgs, outputs: &[PathBuf]) -> anyhow::Result<()> {
    let outputs: Vec<_> = outputs
        .iter()
        .map(|to| ("--output", to.as_path()))
        .collect();
    place::check_outputs(&outputs, &[("the trajectory", args.trajectory.as_path())])
}

fn text(report: &Report) -> Facts {
    let mut facts = Facts::new();
    if report.interrupted {
        facts.add("interrupted", "nothing was written");
        return facts;
    }
    facts.add("frames", report.frames);
    facts.add("size", exporting::bytes(report.bytes));
    facts.add("time", format!("{:.2} s", report.seconds));
    for path in &report.wrote {
        facts.add("wrote", path.display());
    }
    facts
}
