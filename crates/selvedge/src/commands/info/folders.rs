//! Folders that a training or a study has made, by the files in them.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use selvedge_lab::folder::{EVALUATIONS, FolderKind, TRAININGS};
use selvedge_lab::report::TrainingLog;
use selvedge_train::{TrainConfig, files};
use serde_json::json;

use super::dataset;
use crate::output::{Answer, Facts, folded};

/// Says what is in `folder`.
pub(super) fn inspect(folder: &Path) -> anyhow::Result<Answer> {
    match FolderKind::of(folder) {
        Some(FolderKind::DataSet) => dataset::run(folder, None),
        Some(FolderKind::Training) => inspect_training(folder),
        Some(FolderKind::Study) => inspect_study(folder),
        other => Err(unknown(folder, other)),
    }
}

/// The configuration in the folder of a training.
pub(super) fn config_in(folder: &Path) -> anyhow::Result<TrainConfig> {
    let path = folder.join(files::CONFIG);
    let text = selvedge_data::read_text(&path)
        .with_context(|| format!("{}: could not be read", path.display()))?;
    Ok(TrainConfig::parse(&text, &path)?)
}

/// Says that there is nothing to say on a folder of this kind.
pub(super) fn unknown(folder: &Path, kind: Option<FolderKind>) -> anyhow::Error {
    match kind {
        Some(kind) => anyhow!(
            "{}: holds {kind}, of which only the files are inspected: name one of them",
            folder.display()
        ),
        None => anyhow!(
            "{}: is no folder that Selvedge makes: a data set has an index.json, a training a {}, a study a folder {TRAININGS}",
            folder.display(),
            files::LOG
        ),
    }
}

fn inspect_training(folder: &Path) -> anyhow::Result<Answer> {
    let cfg = config_in(folder)?;
    let log = TrainingLog::read(&folder.join(files::LOG))?;
    let [first, last] = [log.rows().first(), log.rows().last()];
    let mut facts = Facts::new();
    facts.add("kind", "training");
    facts.add("folder", folder.display());
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
    facts.add("files", there.join(", "));
    let report = json!({
        "kind": "training-folder",
        "folder": folder,
        "steps_logged": steps,
        "first_loss": first.map(|row| row.loss),
        "last_loss": last.map(|row| row.loss),
        "files": there,
        "config": cfg,
    });
    Answer::new(facts, &report)
}

fn inspect_study(folder: &Path) -> anyhow::Result<Answer> {
    let trainings = names_in(&folder.join(TRAININGS))?;
    let evaluations = names_in(&folder.join(EVALUATIONS))?;
    let report = folder.join("report").join("report.md");
    let mut facts = Facts::new();
    facts.add("kind", "study");
    facts.add("folder", folder.display());
    facts.add("trainings", folded(&trainings));
    facts.add("evaluations", evaluations.len());
    let is_done = report.exists();
    match is_done {
        true => facts.add("report", report.display()),
        false => facts.add("report", "not yet: the study is not done"),
    }
    let answer = json!({
        "kind": "study-folder",
        "folder": folder,
        "trainings": trainings,
        "evaluations": evaluations,
        "report": is_done.then_some(report),
    });
    Answer::new(facts, &answer)
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
