//! The folder of a training, by the files in them.

use std::path::Path;

use anyhow::{Context, bail};
use selvedge_lab::folder::FolderKind;
use selvedge_lab::report::{TrainingLog, training_chart};
use selvedge_train::{TrainConfig, files};
use serde_json::json;

use super::picture::Picture;
use super::{Seen, dataset};
use crate::failure::wrong;
use crate::output::Facts;

/// Says what is in `folder`.
pub(super) fn inspect(folder: &Path) -> anyhow::Result<Seen> {
    match FolderKind::of(folder) {
        Some(FolderKind::DataSet) => {
            let problem = "--picture: a data set is drawn into a folder: name one";
            let picture = Picture::Nothing(wrong(problem));
            Ok((dataset::run(folder, None)?, picture))
        }
        Some(FolderKind::Training) => inspect_training(folder),
        Some(kind) => bail!(
            "{}: holds {kind}, of which only the files are inspected: name one of them",
            folder.display()
        ),
        None => bail!(
            "{}: is no folder that Selvedge makes: a data set has an index.json, a training a {}",
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
