//! `selvedge list`: what ships with the program.

use anyhow::Context;
use selvedge_cloth::motion::named;
use selvedge_data::{materials, shipped_presets, shipped_scenes};
use selvedge_lab::assets;
use selvedge_model::{Encoder, Network};
use selvedge_train::TrainConfig;
use serde_json::json;

use crate::cli::Shipped;
use crate::output::{Answer, Table};

/// Lists them.
pub(crate) fn run(what: Shipped) -> anyhow::Result<Answer> {
    match what {
        Shipped::Scenes => names(shipped_scenes().iter().map(|scene| scene.0)),
        Shipped::Materials => names(materials().iter().map(|material| material.0)),
        Shipped::Models => names(assets::MODELS.iter().map(|model| model.0)),
        Shipped::Motions => names(named::names().into_iter()),
        Shipped::Presets => names(shipped_presets().iter().map(|preset| preset.0)),
        Shipped::Configs => configs(),
    }
}

fn names(all: impl Iterator<Item = &'static str>) -> anyhow::Result<Answer> {
    let all: Vec<&str> = all.collect();
    Ok(Answer::new(all.join("\n"), json!({ "names": all })))
}

/// The training configurations, with their networks.
fn configs() -> anyhow::Result<Answer> {
    let headings = [
        "config",
        "encoder",
        "latent",
        "blocks",
        "parameters",
        "steps",
    ];
    let mut table = Table::new(headings);
    let mut all = Vec::with_capacity(assets::TRAININGS.len());
    for &(name, text) in assets::TRAININGS {
        let cfg = TrainConfig::parse(text, name.as_ref())?;
        let network = Network::new(&cfg.model).with_context(|| name.to_owned())?;
        let (model, parameters) = (&cfg.model, network.parameter_count());
        let encoder = match model.encoder {
            Encoder::Mlp { .. } => "mlp".to_owned(),
            Encoder::Gru { window } => format!("gru {window}"),
        };
        let numbers = [model.latent, model.blocks, parameters].map(|n| n.to_string());
        let cells = [name.to_owned(), encoder].into_iter().chain(numbers);
        table.row(cells.chain([cfg.steps.to_string()]));
        all.push(json!({
            "name": name,
            "encoder": model.encoder,
            "latent": model.latent,
            "blocks": model.blocks,
            "parameters": parameters,
            "steps": cfg.steps,
        }));
    }
    Ok(Answer::new(table, json!({ "configs": all })))
}
