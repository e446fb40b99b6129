//! `selvedge list`: what ships with the program.

use anyhow::Context;
use selvedge_cloth::motion::named;
use selvedge_data::{materials, shipped_presets, shipped_scenes};
use selvedge_lab::{assets, study};
use selvedge_model::{Encoder, Network};
use selvedge_train::TrainConfig;
use serde::Serialize;
use serde_json::json;

use crate::cli::Shipped;
use crate::output::{Answer, Table};

/// A training configuration.
#[derive(Serialize)]
struct Config {
    name: &'static str,
    encoder: Encoder,
    latent: usize,
    blocks: usize,
    parameters: usize,
    steps: u64,
}

/// Lists them.
pub(crate) fn run(what: Shipped) -> anyhow::Result<Answer> {
    match what {
        Shipped::Scenes => names(shipped_scenes().iter().map(|scene| scene.0)),
        Shipped::Materials => names(materials().iter().map(|material| material.0)),
        Shipped::Models => names(assets::MODELS.iter().map(|model| model.0)),
        Shipped::Motions => names(named::names().into_iter()),
        Shipped::Presets => names(shipped_presets().iter().map(|preset| preset.0)),
        Shipped::Studies => names(study::shipped()),
        Shipped::Configs => configs(),
    }
}

fn names(all: impl Iterator<Item = &'static str>) -> anyhow::Result<Answer> {
    let all: Vec<&str> = all.collect();
    Answer::new(all.join("\n"), &json!({ "names": all }))
}

fn configs() -> anyhow::Result<Answer> {
    let all = assets::TRAININGS
        .iter()
        .map(|&(name, text)| config(name, text));
    let all: Vec<Config> = all.collect::<anyhow::Result<_>>()?;
    let mut table = Table::new([
        "config",
        "encoder",
        "latent",
        "blocks",
        "parameters",
        "steps",
    ]);
    for config in &all {
        let encoder = match config.encoder {
            Encoder::Mlp { .. } => "mlp".to_owned(),
            Encoder::Gru { window } => format!("gru {window}"),
        };
        table.row([
            config.name.to_owned(),
            encoder,
            config.latent.to_string(),
            config.blocks.to_string(),
            config.parameters.to_string(),
            config.steps.to_string(),
        ]);
    }
    Answer::new(table, &json!({ "configs": all }))
}

fn config(name: &'static str, text: &str) -> anyhow::Result<Config> {
    let cfg = TrainConfig::parse(text, name.as_ref())?;
    let network = Network::new(&cfg.model).with_context(|| name.to_owned())?;
    Ok(Config {
        name,
        encoder: cfg.model.encoder,
        latent: cfg.model.latent,
        blocks: cfg.model.blocks,
        parameters: network.parameter_count(),
        steps: cfg.steps,
    })
}
