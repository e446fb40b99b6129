//! `selvedge export`: a trajectory in the format of another program.

use std::path::PathBuf;
use std::time::Instant;

use selvedge_data::Trajectory;
use serde_json::json;

use crate::cli::ExportArgs;
use crate::exporting::{self, Export};
use crate::output::{Answer, End, Facts};
use crate::place;

/// Writes what is asked for.
pub(crate) fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    let export = Export::new(&args.output, args.format)?.with(args.choice());
    check_places(args, &export.outputs())?;
    let trajectory = Trajectory::read(&args.trajectory)?;
    check_places(args, &export.outputs_of(&trajectory))?;
    export.check(trajectory.frame_count())?;
    let started = Instant::now();
    let end = export.write(&trajectory)?;
    let seconds = started.elapsed().as_secs_f64();
    let wrote = match end {
        End::Complete => export.outputs_of(&trajectory),
        End::Interrupted => Vec::new(),
    };
    let frames = export.count(trajectory.frame_count())?;
    let bytes: u64 = wrote.iter().map(|path| exporting::size_of(path)).sum();
    let mut facts = Facts::new();
    match end {
        End::Interrupted => facts.add("interrupted", "nothing was written"),
        End::Complete => {
            facts.add("frames", frames);
            facts.add("size", exporting::bytes(bytes));
            facts.add("time", format!("{seconds:.2} s"));
            facts.add_paths("wrote", &wrote);
        }
    }
    let report = json!({
        "trajectory": args.trajectory,
        "wrote": wrote,
        "bytes": bytes,
        "frames": frames,
        "seconds": seconds,
    });
    Ok(facts.answer_at(end, report))
}

/// Checks that nothing is written over the trajectory or over something else that is written.
fn check_places(args: &ExportArgs, outputs: &[PathBuf]) -> anyhow::Result<()> {
    let outputs: Vec<_> = outputs.iter().map(|to| ("--output", to)).collect();
    place::check_outputs(&outputs, &[("the trajectory", &args.trajectory)])
}
