//! `selvedge study`: trainings, evaluations and their report, as a file says.

use anyhow::Context;
use selvedge_lab::folder::{self, FolderKind};
use selvedge_lab::study::{self, StudyOrder};
use serde_json::json;

use crate::cli::StudyArgs;
use crate::output::{Answer, End, Facts};
use crate::progress;

/// Makes a study as a file says, or goes on with one.
pub(crate) fn run(args: &StudyArgs) -> anyhow::Result<Answer> {
    let study = study::open(&args.study)?;
    let machine = args.machine.open()?;
    // Parts share the folder, and each training has a lock of its own.
    let claim = || folder::claim_folder(&args.output, FolderKind::Study);
    let _claimed = args.shard.is_none().then(claim).transpose()?;
    let order = StudyOrder {
        study: &study,
        out: &args.output,
        machine: &machine,
        threads: args.jobs.map(usize::from),
        part: args.shard,
    };
    let outcome = study::run(order, &mut progress::listener())
        .with_context(|| format!("study {}", args.study))?;
    let mut facts = Facts::new();
    facts.add("study", &study.title);
    facts.tell("device", machine.name());
    facts.tell("trained", outcome.trained);
    facts.tell("measured", outcome.measured);
    if let Some(part) = args.shard {
        facts.add("part", part);
        let how = "when all parts are done, the same command without --shard";
        facts.add("then", how);
    }
    if outcome.end == End::Interrupted {
        facts.add("to go on", "the same command again");
    }
    facts.add_paths("wrote", &outcome.wrote);
    let report = json!({
        "title": study.title,
        "out": args.output,
        "wrote": outcome.wrote,
        "part": args.shard.map(|part| part.to_string()),
    });
    Ok(facts.answer_at(outcome.end, report))
}
