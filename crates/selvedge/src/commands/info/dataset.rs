//! What a data set holds, and a picture of every trajectory. Every file is read and checked against its hash.

use std::path::{Path, PathBuf};

use anyhow::bail;
use selvedge_data::{Dataset, Split};
use selvedge_lab::pictures::{Show, sheet};
use selvedge_lab::{folder, generation};
use serde_json::json;

use crate::output::{Answer, Facts, Table, length};
use crate::progress::Progress;
use crate::{interrupt, place};

const SPLITS: [(Split, &str); 2] = [(Split::Train, "train"), (Split::Test, "test")];

/// Says what a data set holds, after checking all its files; with `pictures`, a folder, also draws
/// every trajectory.
pub(crate) fn run(folder: &Path, pictures: Option<&Path>) -> anyhow::Result<Answer> {
    let dataset = generation::open(folder)?;
    if let Some(out) = pictures {
        folder::check_kind(out, None)?;
        place::check_new_folder(out)?;
        folder::make_folder(out)?;
    }
    let drawn = read_all(&dataset, pictures)?;
    let text = format!("{}\n{}", facts(&dataset, &drawn), motions(&dataset));
    let mut report = serde_json::to_value(dataset.index())?;
    report["kind"] = json!("dataset");
    report["folder"] = json!(folder);
    if !drawn.is_empty() {
        report["pictures"] = json!(drawn);
    }
    Ok(Answer::new(text, report))
}

/// Reads every trajectory, which checks its hash, and draws it where that is wanted.
fn read_all(dataset: &Dataset, pictures: Option<&Path>) -> anyhow::Result<Vec<PathBuf>> {
    let count = dataset.index().statistics.trajectories;
    let progress = Progress::new("reading", count, "trajectories");
    let mut drawn = Vec::new();
    for (split, name) in SPLITS {
        for entry in dataset.entries(split) {
            if interrupt::requested() {
                bail!("interrupted before every trajectory was read");
            }
            let trajectory = dataset.read(entry)?;
            if let Some(out) = pictures {
                let path = out.join(format!("{name}-{}.png", entry.motion));
                let show = Show {
                    title: &format!("{}: {} ({name})", dataset.index().name, entry.motion),
                    label: name,
                    prediction: &trajectory,
                    truth: None,
                };
                place::write(&path, &sheet(&show)?)?;
                drawn.push(path);
            }
            progress.advance();
        }
    }
    Ok(drawn)
}

fn facts(dataset: &Dataset, drawn: &[PathBuf]) -> Facts {
    let index = dataset.index();
    let mut facts = Facts::new();
    facts.add("kind", "data set");
    facts.add("name", &index.name);
    facts.add("folder", dataset.folder().display());
    let [train, test] = [Split::Train, Split::Test].map(|split| dataset.entries(split));
    let split = format!("{} to train on, {} to test on", train.len(), test.len());
    facts.add("trajectories", split);
    let frames: usize = train.iter().chain(test).map(|entry| entry.frames).sum();
    facts.add("frames", frames);
    facts.add("training frames", index.statistics.train_frames);
    facts.add("sections", index.sections.len());
    facts.add("samples", index.statistics.samples);
    facts.add("files", "complete, all hashes right");
    if let Some(last) = drawn.last() {
        let folder = last.parent().unwrap_or(last).display();
        facts.add("pictures", format!("{} in {folder}", drawn.len()));
    }
    facts
}

fn motions(dataset: &Dataset) -> Table {
    let headings = [
        "motion",
        "split",
        "frames",
        "vertices",
        "mean speed",
        "largest speed",
        "mean edge",
    ];
    let mut table = Table::new(headings);
    for (split, name) in SPLITS {
        for entry in dataset.entries(split) {
            table.row([
                entry.motion.clone(),
                name.to_owned(),
                entry.frames.to_string(),
                entry.vertices.to_string(),
                format!("{:.3} m/s", entry.mean_speed),
                format!("{:.3} m/s", entry.max_speed),
                length(entry.mean_edge_length),
            ]);
        }
    }
    table
}
