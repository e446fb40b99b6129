//! A small data set for the tests of trainings: two cloths that swing in wind.

use std::path::Path;

use selvedge_data::SectionRule;
use selvedge_model::ModelSpec;
use selvedge_train::TrainConfig;
use serde_json::json;

pub(crate) use self::shared::Swinging;

#[path = "../../../selvedge-train/src/test_data/swinging.rs"]
mod shared;

/// Two cloths of 9 and 12 vertices.
pub(crate) fn two_cloths() -> Swinging {
    let air = json!({ "air_density": 1.2, "air_drag": 0.3, "wind": [0.5, 0.1, -0.4] });
    let scene = json!({ "setting": { "environment": air } });
    let plans = [("a", 9, 20), ("b", 12, 16)];
    shared::swinging_in(&scene, &plans, SectionRule::Whole)
}

/// A training of a model on ground truth.
pub(crate) fn config(model: ModelSpec) -> TrainConfig {
    let text = r#"
        name = "tiny"
        seed = 3
        steps = 1000
        statistics_samples = 12
        log_every = 2

        [model]
        node_features = ["velocity", "node-type"]
        edge_features = ["vector"]
        encoder = { kind = "mlp" }
        latent = 8
        blocks = 1

        [learning_rate]
        kind = "constant"
        rate = 1e-3

        [batch]
        samples = 3
    "#;
    let cfg = TrainConfig::parse(text, Path::new("tiny.toml")).expect("a configuration");
    TrainConfig { model, ..cfg }
}
