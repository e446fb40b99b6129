//! A resumed training is the uninterrupted one, bit for bit; what it cannot go on from is refused.

use std::path::PathBuf;

use selvedge_data::SectionRule;
use selvedge_model::Encoder;
use serde_json::Value;

use super::*;
use crate::schedule::LearningRate;
use crate::test_data::{ENGINE, Swinging, busy, saved, stepped, swinging, two_cloths};

fn steps(trainer: &mut Trainer, count: usize) -> Vec<StepReport> {
    (0..count)
        .map(|_| trainer.step().expect("a step"))
        .collect()
}

/// A checkpoint after five steps.
fn five(cfg: TrainConfig, data: &Swinging) -> (PathBuf, Vec<u8>) {
    saved(&stepped(cfg, &data.dataset, 5), data, "five")
}

/// The message when `cfg` resumes from `bytes`.
fn refusal(cfg: TrainConfig, data: &Swinging, bytes: &[u8]) -> String {
    let path = data.folder.path().join("refused");
    std::fs::write(&path, bytes).expect("room");
    let error = Trainer::resume(cfg, &data.dataset, &path, &ENGINE).err();
    let text = error.expect("a refusal").to_string();
    let path = path.display().to_string();
    text.replacen(&path, "FILE", 1)
}

/// The checkpoint with one entry of its metadata edited as text.
fn edited(bytes: &[u8], key: &str, edit: impl FnOnce(String) -> String) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
    let mut header: Value = serde_json::from_slice(&bytes[8..8 + length]).expect("a header");
    let entry = &mut header["__metadata__"][key];
    let text = edit(entry.as_str().expect("text").to_owned());
    *entry = text.into();
    let header = header.to_string();
    let size = (header.len() as u64).to_le_bytes();
    [&size, header.as_bytes(), &bytes[8 + length..]].concat()
}

#[test]
fn a_resumed_training_is_the_uninterrupted_one() {
    let data = two_cloths();
    for encoder in [Encoder::MLP, Encoder::Gru { window: 3 }] {
        let mut whole = Trainer::new(busy(encoder), &data.dataset, &ENGINE).expect("a training");
        let reports = steps(&mut whole, 12);
        for first in [0, 1, 5, 8] {
            let mut before =
                Trainer::new(busy(encoder), &data.dataset, &ENGINE).expect("a training");
            assert_eq!(steps(&mut before, first), reports[..first]);
            let (path, bytes) = saved(&before, &data, "part");
            let mut after =
                Trainer::resume(busy(encoder), &data.dataset, &path, &ENGINE).expect("resumed");
            assert_eq!(saved(&after, &data, "again").1, bytes, "nothing is lost");
            assert_eq!(steps(&mut after, 12 - first), reports[first..]);
            assert_eq!(saved(&after, &data, "b").1, saved(&whole, &data, "a").1);
            let model = |trainer: &Trainer| trainer.model(String::new()).expect("a model");
            let bytes = [&after, &whole].map(|trainer| model(trainer).to_bytes().expect("bytes"));
            assert_eq!(bytes[0], bytes[1]);
        }
    }
}

#[test]
fn name_steps_and_log_may_change() {
    let data = two_cloths();
    let (path, _) = five(busy(Encoder::MLP), &data);
    let cfg = TrainConfig {
        name: "longer".to_owned(),
        steps: 5000,
        log_every: 7,
        ..busy(Encoder::MLP)
    };
    let trainer = Trainer::resume(cfg, &data.dataset, &path, &ENGINE).expect("resumed");
    assert_eq!((trainer.steps_done(), trainer.config().steps), (5, 5000));
}

#[test]
fn another_configuration_is_refused_by_its_field() {
    let data = two_cloths();
    let (_, bytes) = five(busy(Encoder::MLP), &data);
    type Edit = fn(&mut TrainConfig);
    let cases: [(Edit, &str); 5] = [
        (|c| c.seed = 9, "seed (3, now 9)"),
        (
            |c| c.noise.deviation = 0.01,
            "noise.deviation (0.003, now 0.01)",
        ),
        (|c| c.model.latent = 16, "model.latent (8, now 16)"),
        (
            |c| c.gradient_clip = Some(2.0),
            "gradient_clip (null, now 2.0)",
        ),
        (
            |c| {
                c.learning_rate = LearningRate::Drop {
                    from: 1e-3,
                    to: 1e-4,
                    at: 9,
                };
            },
            "learning_rate ({",
        ),
    ];
    for (edit, expected) in cases {
        let mut cfg = busy(Encoder::MLP);
        edit(&mut cfg);
        let text = refusal(cfg, &data, &bytes);
        let start = format!("FILE was made with another {expected}");
        assert!(text.starts_with(&start), "{text}");
        assert!(text.ends_with("train into a new folder, or restore it"));
    }
    let mut cfg = busy(Encoder::MLP);
    cfg.log_every = 0;
    let text = refusal(cfg, &data, &bytes);
    assert_eq!(text, "log_every must be between 1 and 100000, found 0");
}

#[test]
fn another_data_set_is_refused() {
    let data = two_cloths();
    let (_, bytes) = five(busy(Encoder::MLP), &data);
    let other = swinging(&[("a", 9, 14), ("b", 12, 10)], SectionRule::Whole);
    let text = refusal(busy(Encoder::MLP), &other, &bytes);
    assert!(text.starts_with("FILE was made on other data"), "{text}");
    assert!(text.contains("\"swinging\""));
}

#[test]
fn damaged_checkpoints_are_refused() {
    let data = two_cloths();
    let cfg = || busy(Encoder::MLP);
    let (_, bytes) = five(cfg(), &data);
    for length in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
        let text = refusal(cfg(), &data, &bytes[..length]);
        assert!(text.starts_with("FILE is no complete safetensors file"));
    }
    let text = refusal(
        cfg(),
        &data,
        &edited(&bytes, "format", |_| "selvedge-model".into()),
    );
    let expected =
        "FILE: metadata \"format\" is \"selvedge-model\", expected \"selvedge-checkpoint\"";
    assert_eq!(text, expected);
    let text = refusal(cfg(), &data, &edited(&bytes, "version", |_| "7".into()));
    assert_eq!(text, "FILE: metadata \"version\" is \"7\", expected \"1\"");
    let missing = data.folder.path().join("missing");
    let error = Trainer::resume(cfg(), &data.dataset, &missing, &ENGINE).err();
    let text = error.expect("no file").to_string();
    assert!(text.starts_with("cannot read "), "{text}");
}

#[test]
fn states_that_fit_nothing_are_refused() {
    let data = two_cloths();
    let cfg = || busy(Encoder::MLP);
    let (_, bytes) = five(cfg(), &data);
    let state = |edit: fn(&mut Value)| {
        let edited = edited(&bytes, "state", |text| {
            let mut value = serde_json::from_str(&text).expect("JSON");
            edit(&mut value);
            value.to_string()
        });
        refusal(cfg(), &data, &edited)
    };
    let text = state(|state| {
        state["lanes"].as_array_mut().expect("slots").pop();
    });
    assert_eq!(text, "FILE: state: 2 slots, expected 3");
    let text = state(|state| {
        for slot in state["lanes"].as_array_mut().expect("slots") {
            slot["section"]["end"] = 1000.into();
        }
    });
    assert!(text.ends_with("is in no section of the data set"), "{text}");
    let text = state(|state| state["inputs"][0] = state["inputs"][1].clone());
    let expected = "FILE: state: statistics: groups of [4, 4, 1, 1] columns, expected [3, 3, 1, 9]";
    assert_eq!(text, expected);
    let text = state(|state| state["targets"]["edge_length"]["count"] = (-1.0).into());
    assert!(text.contains("statistics: count of component 0"), "{text}");
    let text = state(|state| state["colour"] = 3.into());
    assert!(text.contains("unknown field `colour`"), "{text}");
    let mut broken = bytes.clone();
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
    broken[8 + length..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let text = refusal(cfg(), &data, &broken);
    assert_eq!(text, "FILE: weights: entry 0 is not finite");
}
