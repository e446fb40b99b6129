//! Small data sets for the tests of this crate: cloths that swing by a formula, without physics.

mod swinging;

use std::path::{Path, PathBuf};

use rayon::ThreadPoolBuilder;
use selvedge_data::{Dataset, SectionRule};
use selvedge_model::Encoder;
use serde_json::Value;

pub(crate) use self::swinging::{Plan, Swinging, swinging_in, trajectory};
use crate::config::TrainConfig;
use crate::engine::OnProcessor;
use crate::schedule::{TruthProbability, UnrollFrames};
use crate::trainer::Trainer;

/// An engine whose micro-batches are unions.
pub(crate) const ENGINE: OnProcessor = OnProcessor { micro_batch: 2 };

/// Writes the trajectories of no scene.
pub(crate) fn swinging(plans: &[Plan<'_>], sections: SectionRule) -> Swinging {
    swinging_in(&Value::Null, plans, sections)
}

/// Two cloths of 9 and 12 vertices over 14 and 11 frames: 12 + 9 samples.
pub(crate) fn two_cloths() -> Swinging {
    swinging(&[("a", 9, 14), ("b", 12, 11)], SectionRule::Whole)
}

/// A training of a tiny network on ground truth without noise.
pub(crate) fn config(encoder: Encoder) -> TrainConfig {
    let text = r#"
        name = "tiny"
        seed = 3
        steps = 1000
        statistics_samples = 12
        log_every = 2

        [model]
        node_features = ["velocity", "external-force", "kinetic-energy", "node-type"]
        edge_features = ["vector", "rest-vector", "elongation", "bending-angle"]
        encoder = { kind = "gru", window = 3 }
        latent = 8
        blocks = 2

        [learning_rate]
        kind = "constant"
        rate = 1e-3

        [batch]
        samples = 3

        [noise]
        deviation = 0.0
    "#;
    let mut cfg = TrainConfig::parse(text, Path::new("tiny.toml")).expect("a configuration");
    cfg.model.encoder = encoder;
    cfg
}

/// A training of `cfg` after so many steps.
pub(crate) fn stepped(cfg: TrainConfig, data: &Dataset, steps: usize) -> Trainer {
    let mut trainer = Trainer::new(cfg, data, &ENGINE).expect("a training");
    for _ in 0..steps {
        trainer.step().expect("a step");
    }
    trainer
}

/// The configuration above, in which noise, dropout, a mean of the weights and the model's own
/// predictions all play a part.
pub(crate) fn busy(encoder: Encoder) -> TrainConfig {
    let mut cfg = config(encoder);
    cfg.noise.deviation = 0.003;
    cfg.weight_average = Some(0.9);
    if matches!(encoder, Encoder::Gru { .. }) {
        cfg.dropout = 0.2;
    }
    cfg.scheduled_sampling.truth = TruthProbability::Linear {
        start: 1,
        end: 3,
        probability: 0.1,
    };
    cfg
}

/// After the first step a next sample is ground truth with this probability.
pub(crate) fn truth(probability: f64) -> TruthProbability {
    TruthProbability::Linear {
        start: 0,
        end: 1,
        probability,
    }
}

/// `cfg`, learning through so many frames.
pub(crate) fn through(frames: usize, cfg: TrainConfig) -> TrainConfig {
    let mut cfg = TrainConfig {
        unroll: UnrollFrames::Constant { frames },
        ..cfg
    };
    if frames > 1 {
        cfg.losses.kinetic_energy = 0.0;
    }
    cfg
}

/// The bytes of a checkpoint, and its path.
pub(crate) fn saved(trainer: &Trainer, data: &Swinging, name: &str) -> (PathBuf, Vec<u8>) {
    let path = data.folder.path().join(name);
    trainer.save(&path).expect("room");
    let bytes = std::fs::read(&path).expect("just written");
    (path, bytes)
}

/// What `work` gives on a pool of so many threads.
pub(crate) fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("a pool").install(work)
}
