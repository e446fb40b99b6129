//! What a preset will make, without simulating anything.

use std::collections::BTreeMap;

use selvedge_data::{DatasetPreset, PlannedRun, Split};
use serde_json::json;

use crate::output::{Answer, Facts, Table};

/// Says what the preset `name`, a file or a shipped one, will make.
pub(crate) fn run(name: &str) -> anyhow::Result<Answer> {
    let preset = DatasetPreset::open(name)?;
    for warning in preset.warnings() {
        tracing::warn!("{name}: {warning}");
    }
    let (config, forecast) = (preset.config(), preset.forecast());
    let names = |split| -> Vec<&str> {
        let motions = preset.motions(split).iter();
        motions.map(|motion| motion.name.as_str()).collect()
    };
    let count = |split| forecast.of(split).count();
    let mut facts = Facts::new();
    facts.add("kind", "preset of a data set");
    facts.add("preset", name);
    facts.add("name", &config.name);
    facts.add("material", &config.setting.material.name);
    facts.add("handles", format!("{:?}", config.setting.handles));
    let (train, test) = (count(Split::Train), count(Split::Test));
    let split = format!("{train} to train on, {test} to test on");
    facts.add("trajectories", split);
    facts.add("frames", forecast.frames());
    facts.add("sections", forecast.sections.len());
    facts.add("samples", forecast.samples());
    // Positions are three numbers of four bytes; all else is small beside them.
    let gigabytes = 12.0 * forecast.positions() as f64 / 1e9;
    facts.add("size", format!("{gigabytes:.2} GB"));
    if train > 0 {
        facts.add("to train on", names(Split::Train).join(", "));
    }
    if config.cloths.is_empty() {
        facts.add("to test on", names(Split::Test).join(", "));
    }
    let report = json!({
        "kind": "preset",
        "file": name,
        "config": config,
        "frames": forecast.frames(),
        "positions": forecast.positions(),
        "samples": forecast.samples(),
        "forecast": forecast,
    });
    let text = format!("{facts}\n{}", sizes(&forecast.runs));
    Ok(Answer::new(text, report))
}

/// The trajectories by mesh size and length.
fn sizes(runs: &[PlannedRun]) -> Table {
    let mut counts: BTreeMap<(usize, usize), [usize; 2]> = BTreeMap::new();
    for run in runs {
        let count = counts.entry((run.vertices, run.frames)).or_default();
        count[usize::from(run.split == Split::Test)] += 1;
    }
    let mut table = Table::new(["vertices", "frames", "to train on", "to test on"]);
    for ((vertices, frames), [train, test]) in counts {
        table.row([vertices, frames, train, test].map(|n| n.to_string()));
    }
    table
}
