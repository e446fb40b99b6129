//! A training that begins with a model is that model, whatever else is new.

use std::ops::ControlFlow;

use selvedge_data::Dataset;
use selvedge_model::Encoder;
use serde_json::json;

use super::*;
use crate::test_data::{ENGINE, busy, stepped, two_cloths};
use crate::trainer::Trainer;

const MLP: Encoder = Encoder::MLP;

/// The model of five steps, with an account of its training.
fn learned(data: &Dataset, account: &str) -> Model {
    let mut trainer = stepped(busy(MLP), data, 5);
    trainer.collect().expect("weights");
    trainer.model(account.to_owned()).expect("a model")
}

fn started(cfg: TrainConfig, data: &Dataset, model: &Model) -> Result<Trainer, TrainError> {
    let observe = &mut || ControlFlow::Continue(());
    let trainer = Trainer::begin(cfg, data, &ENGINE, Some(model), observe)?;
    Ok(trainer.expect("nobody stops it"))
}

#[test]
fn a_training_begins_as_the_model_is() {
    let data = two_cloths();
    let account = json!({
        "config": {"name": "tiny"}, "steps_done": 5, "dataset": "swinging",
        "from": [{"name": "stage 1", "steps_done": 9, "dataset": "first"}],
    });
    let model = learned(&data.dataset, &account.to_string());
    let mut cfg = busy(MLP);
    cfg.seed = 9;
    let mut trainer = started(cfg, &data.dataset, &model).expect("the same network");
    assert_eq!(trainer.steps_done(), 0);
    let of = |name: &str, steps_done, dataset: &str| Origin {
        name: name.to_owned(),
        steps_done,
        dataset: dataset.to_owned(),
    };
    let origins = [of("stage 1", 9, "first"), of("tiny", 5, "swinging")];
    assert_eq!(trainer.origins(), origins);
    // And they stay known when the training goes on.
    let kept = data.folder.path().join("next.safetensors");
    trainer.save(&kept).expect("room");
    let cfg = trainer.config().clone();
    let on = Trainer::resume(cfg, &data.dataset, &kept, &ENGINE);
    assert_eq!(on.expect("the same").origins(), origins);
    // Before its first step it is that model, and then no more.
    let begun = trainer.model(String::new()).expect("a model");
    assert_eq!(begun.weights(), model.weights());
    let (ours, theirs) = (begun.normalizers(), model.normalizers());
    for (ours, theirs) in [
        (&ours.nodes, &theirs.nodes),
        (&ours.edges, &theirs.edges),
        (&ours.acceleration, &theirs.acceleration),
    ] {
        assert_eq!(ours.mean(), theirs.mean());
        for (ours, theirs) in ours.deviation().iter().zip(theirs.deviation()) {
            assert!((ours - theirs).abs() <= 1e-15 * theirs, "{ours} {theirs}");
        }
    }
    trainer.step().expect("a step");
    trainer.collect().expect("weights");
    let learned = trainer.model(String::new()).expect("a model");
    assert_ne!(learned.weights(), model.weights());
}

/// The tensors of a network whose names begin like this.
fn named<'a>(network: &Network, weights: &'a [f32], start: &str) -> Vec<&'a [f32]> {
    let all = network.parameters().iter();
    all.filter(|parameter| parameter.name.starts_with(start))
        .map(|parameter| &weights[parameter.range.clone()])
        .collect()
}

#[test]
fn a_new_encoder_joins_the_rest_of_a_model() {
    let data = two_cloths();
    let model = learned(&data.dataset, "a perceptron");
    let gru = || busy(Encoder::Gru { window: 3 });
    let trainer = started(gru(), &data.dataset, &model).expect("all but its encoder");
    let fresh = trainer.fresh_tensors();
    assert!(fresh.iter().all(|name| name.starts_with("encoder.")));
    // Of nodes and of edges two layers of four tensors, a linear layer and a norm.
    assert_eq!(fresh.len(), 24);
    let [ours, theirs] =
        [&gru().model, model.spec()].map(|spec| Network::new(spec).expect("a network"));
    let begun = trainer.model(String::new()).expect("a model");
    let nothing = Trainer::new(gru(), &data.dataset, &ENGINE).expect("a training");
    let nothing = nothing.model(String::new()).expect("a model");
    assert_eq!(
        named(&ours, begun.weights(), "encoder."),
        named(&ours, nothing.weights(), "encoder.")
    );
    for start in ["processor.", "decoder."] {
        let taken = named(&ours, begun.weights(), start);
        assert_eq!(taken, named(&theirs, model.weights(), start));
        assert!(!taken.is_empty());
    }
    assert_eq!(
        begun.normalizers().nodes.mean(),
        model.normalizers().nodes.mean()
    );
    // A longer window has no other weights.
    let longer = busy(Encoder::Gru { window: 5 });
    let trainer = started(longer, &data.dataset, &begun).expect("the same tensors");
    assert!(trainer.fresh_tensors().is_empty());
    let longer = trainer.model(String::new()).expect("a model");
    assert_eq!(longer.weights(), begun.weights());
}

#[test]
fn another_network_is_refused_and_an_observer_may_stop_it() {
    let data = two_cloths();
    let model = learned(&data.dataset, "of my own making");
    let mut cfg = busy(Encoder::Gru { window: 4 });
    cfg.model.latent = 16;
    cfg.model.blocks = 3;
    let text = started(cfg, &data.dataset, &model)
        .err()
        .expect("another network");
    assert_eq!(
        text.to_string(),
        "the model to start from is another one: model.blocks is 2 there, 3 here; model.latent is 8 there, 16 here: set these values as they are there, or train without it"
    );
    let stop = &mut || ControlFlow::Break(());
    let none = Trainer::begin(busy(MLP), &data.dataset, &ENGINE, Some(&model), stop);
    assert!(none.expect("no error").is_none());
    let trainer = started(busy(MLP), &data.dataset, &model).expect("the same network");
    assert_eq!(trainer.origins()[0].name, "a model");
}
