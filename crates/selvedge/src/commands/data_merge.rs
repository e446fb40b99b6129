//! `selvedge data merge`: parts of a data set made one.

use selvedge_data::{DatasetParts, Merged};
use selvedge_lab::generation;
use serde_json::json;

use crate::cli::MergeArgs;
use crate::output::{Answer, End, Facts};
use crate::progress;

/// Merges the parts.
pub(crate) fn run(args: &MergeArgs) -> anyhow::Result<Answer> {
    let parts = DatasetParts::open(&args.parts)?;
    let merged = generation::merge(&parts, &args.output, &mut progress::listener_of_files())?;
    let mut facts = Facts::new();
    facts.add("data set", parts.name());
    facts.add("parts", args.parts.len());
    facts.add("trajectories", parts.len());
    let (samples, end) = match &merged {
        Merged::Complete(dataset) => {
            let samples = dataset.index().statistics.samples;
            facts.add("samples", samples);
            (samples, End::Complete)
        }
        Merged::Stopped => {
            facts.add("interrupted", "run the same command again");
            (0, End::Interrupted)
        }
    };
    facts.add("wrote", args.output.display());
    let report = json!({
        "name": parts.name(),
        "out": args.output,
        "parts": args.parts.len(),
        "trajectories": parts.len(),
        "samples": samples,
        "interrupted": end == End::Interrupted,
    });
    Ok(Answer::new(facts, &report)?.ended(end))
}
