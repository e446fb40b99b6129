//! The shipped training configurations: each is listed, has the network that its name promises, and
//! takes steps.

use std::path::{Path, PathBuf};

use crate::common::{TestFolder, column, names_in, number, rows};
use selvedge_data::Dataset;
use selvedge_train::{OnProcessor, Setting, TrainConfig, Trainer};

/// The paper's models with the parameters of their networks: those of the paper, counted by hand
/// from its layers, less or more 128 weights (384 of a recurrent layer) for each column less or
/// more.
const PAPERS: [(&str, usize); 13] = [
    ("meshgraphnets", 2_333_699),
    ("meshgraphnets-ss", 2_333_699),
    ("rp-mlp", 2_334_595),
    ("rp-gru5", 2_605_955),
    ("rp-gru10", 2_605_955),
    ("rp-without-external-force", 2_605_955 - 384 * 3),
    ("rp-without-rest-vector", 2_605_955 - 384),
    ("rp-without-elongation", 2_605_955 - 384),
    ("rp-without-edge-vector-loss", 2_605_955),
    ("rp-without-edge-length-loss", 2_605_955),
    ("rp-without-kinetic-energy", 2_605_955 - 384),
    ("rp-without-bending", 2_605_955 - 384),
    ("rp-without-physics", 2_605_955 - 384 * (4 + 3)),
];

/// The presets that are not in the paper.
const OWN: [&str; 3] = ["first", "any", "rp-gru10-better"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/training")
}

fn preset(name: &str, settings: &[&str]) -> TrainConfig {
    let settings: Vec<Setting> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let path = folder().join(format!("{name}.toml"));
    let text = std::fs::read_to_string(&path).unwrap();
    TrainConfig::parse_with(&text, &path, &settings).unwrap()
}

fn names() -> Vec<&'static str> {
    let papers = PAPERS.iter().map(|row| row.0);
    OWN.into_iter().chain(papers).collect()
}

#[test]
fn every_preset_is_listed_with_the_network_that_it_promises() {
    let report = TestFolder::new().json("list configs");
    let rows = rows(&report, "configs");
    let file = |name: &str| format!("{name}.toml");
    let mut listed: Vec<String> = column(rows, "name").into_iter().map(file).collect();
    let mut expected: Vec<String> = names().into_iter().map(file).collect();
    listed.sort();
    expected.sort();
    assert_eq!(listed, names_in(&folder()));
    assert_eq!(listed, expected);
    for (name, parameters) in PAPERS {
        let row = rows.iter().find(|row| row["name"] == name).unwrap();
        assert_eq!(number(row, "/parameters"), parameters as f64, "{name}");
        // What docs/src/reference/equations.md and the paper leave to the preset: the epochs of the
        // paper.
        let cfg = preset(name, &[]);
        assert_eq!(cfg.name, name);
        let epoch = 6550 - 42 * (cfg.model.window() as u64 - 1);
        assert_eq!(cfg.steps, 1200 * epoch, "{name}");
        assert_eq!(cfg.statistics_samples as u64, epoch, "{name}");
        let rates = [13 * epoch - 1, 13 * epoch].map(|step| cfg.learning_rate.at(step));
        assert_eq!(rates, [1e-4, 1e-5], "{name}");
        let truth = |epochs| cfg.scheduled_sampling.truth.at(epochs * epoch);
        let scheduled = name != "meshgraphnets";
        let expected = if scheduled { [1.0, 0.0] } else { [1.0, 1.0] };
        assert_eq!([truth(75), truth(300)], expected, "{name}");
    }
}

#[test]
fn every_preset_takes_two_steps_with_a_finite_loss() {
    let dir = TestFolder::new();
    dir.tiny();
    let data = Dataset::open(&dir.path("tiny")).unwrap();
    for name in names() {
        // Of the blocks, which are all alike, two: fifteen take ten times as long as everything else.
        let cfg = preset(name, &["statistics_samples=10", "model.blocks=2"]);
        let mut trainer = Trainer::new(cfg, &data, &OnProcessor::default()).unwrap();
        selvedge_lab::training::with_expert(&mut trainer, &data).unwrap();
        for _ in 0..2 {
            let report = trainer.step().unwrap();
            assert!(report.terms.total.is_finite(), "{name}");
            assert!(report.gradient_norm > 0.0, "{name}");
        }
    }
}

#[test]
fn a_preset_is_tried_at_reduced_size() {
    let dir = TestFolder::new();
    dir.tiny();
    let small = "--set model.latent=8 --set model.blocks=1 --set statistics_samples=10";
    let report = dir.json(&format!(
        "train rp-gru10 --data tiny -o run --steps 1 {small}"
    ));
    let file = dir.json("info run/model.safetensors");
    assert_eq!(number(&report, "/parameters"), number(&file, "/parameters"));
    assert_eq!(number(&file, "/spec/latent"), 8.0);
    assert_eq!(number(&file, "/spec/encoder/window"), 10.0);
    let set = "train rp-gru10 --data tiny -o again --set";
    dir.refuses(&format!(
        "1 | {set} model.latnet=8 | rp-gru10 | model.latnet = 8 | unknown field `latnet`
         2 | {set} model.latent | \"model.latent\" is no setting",
    ));
}
