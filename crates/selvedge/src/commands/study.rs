//! `selvedge study`: trainings, evaluations and their report, as a file says.

use std::path::PathBuf;

use anyhow::Context;
use selvedge_lab::folder;
use selvedge_lab::folder_kind::FolderKind;
use selvedge_lab::study::{self, StudyOrder};
use serde::Serialize;

use crate::cli::StudyArgs;
use crate::output::{Answer, End, Facts};
use crate::progress;

#[derive(Serialize)]
struct Answered {
    title: String,
    /// The device of the models.
    device: String,
    out: PathBuf,
    trained: usize,
    measured: usize,
    wrote: Vec<PathBuf>,
    /// The part of its trainings that was made, as 2/8.
    part: Option<String>,
    interrupted: bool,
}

/// Makes a study as a file says, or goes on with one.
pub(crate) fn run(args: &StudyArgs) -> anyhow::Result<Answer> {
    let study = study::open(&args.study)?;
    let machine = args.machine.open()?;
    // Parts share the folder, and each training has a lock of its own.
    let _claimed = match args.shard.is_none() {
        true => Some(folder::claim_folder(&args.output, FolderKind::Study)?),
        false => None,
    };
    let order = StudyOrder {
        study: &study,
        out: &args.output,
        machine: &machine,
        threads: args.jobs.map(usize::from),
        part: args.shard,
    };
    let outcome = study::run(order, &mut progress::listener())
        .with_context(|| format!("study {}", args.study))?;
    let answered = Answered {
        title: study.title,
        device: machine.name(),
        out: args.output.clone(),
        trained: outcome.trained,
        measured: outcome.measured,
        wrote: outcome.wrote,
        part: args.shard.map(|part| part.to_string()),
        interrupted: outcome.end == End::Interrupted,
    };
    Ok(Answer::new(text(&answered), &answered)?.ended(outcome.end))
}

fn text(answered: &Answered) -> Facts {
    let mut facts = Facts::new();
    facts.add("study", &answered.title);
    facts.add("device", &answered.device);
    facts.add("trained", answered.trained);
    facts.add("measured", answered.measured);
    if let Some(part) = &answered.part {
        facts.add("part", part);
        let how = "when all parts are done, the same command without --shard";
        facts.add("then", how);
    }
    if answered.interrupted {
        facts.add("to go on", "the same command again");
    }
    for path in &answered.wrote {
        facts.add("wrote", path.display());
    }
    facts
}
