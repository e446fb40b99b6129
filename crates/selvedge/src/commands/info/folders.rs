//! Folders that a training or a study has made, by the files in them.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use selvedge_lab::folder::{EVALUATIONS, FolderKind, TRAININGS};
use selvedge_lab::report::{TrainingLog, training_chart};
use selvedge_train::{TrainConfig, files};
use serde_json::json;

use super::picture::Picture;
use super::{Seen, bare, dataset};
use crate::failure::wrong;
use crate::output::{Answer, Facts, folded};

/// Says what is in `folder`.
pub(super) fn inspect(folder: &Path) -> anyhow::Result<Seen> {
    match FolderKind::of(folder) {
        Some(FolderKind::DataSet) => {
            let problem = "--picture: a data set is drawn into a folder: name one";
            let picture = Picture::Nothing(wrong(problem));
            Ok((dataset::run(folder, None)?, picture))
        }
        Some(FolderKind::Training) => inspect_training(folder),
        Some(FolderKind::Study) => {
            let why = "a study has its plots in the folder report, and each training its own";
            let why = format!("{}: {why}", folder.display());
            Ok(bare(inspect_study(folder)?, why))
        }
        Some(kind) => bail!(
            "{}: holds {kind}, of which only the files are inspected: name one of them",
            folder.display()
        ),
        None => bail!(
            "{}: is no folder that Selvedge makes: a data set has an index.json, a training a {}, a study a folder {TRAININGS}",
            folder.display(),
            files::LOG
        ),
    }
}

fn inspect_training(folder: &Path) -> anyhow::Result<Seen> {
    let path = folder.join(files::CONFIG);
    let text = selvedge_data::read_text(&path)
        .with_context(|| format!("{}: could not be read", path.display()))?;
    let cfg = TrainConfig::parse(&text, &path)?;
    let log = TrainingLog::read(&folder.join(files::LOG))?;
    let [first, last] = [log.rows().first(), log.rows().last()];
    let mut facts = Facts::new();
    facts.add("kind", "training");
    facts.tell_path("folder", folder);
    facts.add("name", &cfg.name);
    let steps = last.map_or(0, |row| row.step);
    facts.add("steps", format!("{steps} of {} in the log", cfg.steps));
    if let (Some(first), Some(last)) = (first, last) {
        facts.add(
            "loss",
            format!("{:.4e} first, {:.4e} last", first.loss, last.loss),
        );
        facts.add("learning rate", format!("{:.2e} last", last.learning_rate));
    }
    let there: Vec<&str> = [files::MODEL, files::CHECKPOINT]
        .into_iter()
        .filter(|name| folder.join(name).exists())
        .collect();
    facts.tell_as("files", there.join(", "), &there);
    let report = json!({
        "kind": "training-folder",
        "steps_logged": steps,
        "first_loss": first.map(|row| row.loss),
        "last_loss": last.map(|row| row.loss),
        "config": cfg,
    });
    let picture = Picture::Curves(training_chart(&cfg.name, &log));
    Ok((facts.answer(report), picture))
}

fn inspect_study(folder: &Path) -> anyhow::Result<Answer> {
    let trainings = names_in(&folder.join(TRAININGS))?;
    let evaluations = names_in(&folder.join(EVALUATIONS))?;
    let report = folder.join("report").join("report.md");
    let mut facts = Facts::new();
    facts.add("kind", "study");
    facts.tell_path("folder", folder);
    facts.tell_as("trainings", folded(&trainings), &trainings);
    facts.tell_as("evaluations", evaluations.len(), &evaluations);
    let is_done = report.exists();
    if is_done {
        facts.add("report", report.display())
    } else {
        facts.add("report", "not yet: the study is not done")
    }
    let answer = json!({
        "kind": "study-folder",
        "report": is_done.then_some(report),
    });
    Ok(facts.answer(answer))
}

/// Names of what is in a folder, sorted; none where there is no such folder.
fn names_in(folder: &Path) -> anyhow::Result<Vec<String>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let paths: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    let names = paths.iter().filter_map(|path| path.file_stem());
    let mut names: Vec<String> = names.map(|n| n.to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}
