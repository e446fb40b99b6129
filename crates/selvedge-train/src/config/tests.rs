//! What is written is read back; every value out of range is named with what it should be.

use std::path::PathBuf;

use selvedge_model::Encoder;

use super::*;
use crate::schedule::TruthProbability;
use crate::test_data::config;

fn path() -> PathBuf {
    PathBuf::from("training.toml")
}

#[test]
fn toml_round_trips() {
    let mut cfg = config(Encoder::Gru { window: 3 });
    cfg.gradient_clip = Some(0.1);
    cfg.learning_rate = LearningRate::Cosine {
        warmup: 3,
        from: 1.0 / 3.0,
        to: 1e-7,
        end: 99,
    };
    cfg.scheduled_sampling.truth = TruthProbability::Linear {
        start: 1,
        end: 7,
        probability: 0.2,
    };
    for cfg in [cfg, config(Encoder::MLP)] {
        let text = toml::to_string(&cfg).expect("plain");
        assert_eq!(TrainConfig::parse(&text, &path()).expect("its own"), cfg);
    }
}

#[test]
fn what_is_left_out_is_the_papers() {
    let cfg = config(Encoder::MLP);
    assert_eq!((cfg.gradient_clip, cfg.dropout), (None, 0.0));
    assert_eq!(cfg.losses, LossWeights::default());
    assert_eq!(cfg.optimizer, AdamSettings::default());
    assert_eq!(cfg.scheduled_sampling, ScheduledSampling::default());
    assert_eq!(cfg.noise.correction, NoiseConfig::default().correction);
}

#[test]
fn unknown_keys_are_named() {
    let text = toml::to_string(&config(Encoder::MLP)).expect("plain");
    let unknown = format!("colour = 3\n{text}");
    let error = TrainConfig::parse(&unknown, &path()).expect_err("unknown");
    let error = error.to_string();
    assert!(error.starts_with("training.toml: ") && error.contains("unknown field `colour`"));
}

#[test]
fn values_out_of_range_are_named() {
    type Edit = fn(&mut TrainConfig);
    let cases: [(Edit, &str); 17] = [
        (
            |c| c.steps = u64::MAX,
            "steps must be between 1 and 1000000000, found 18446744073709551615",
        ),
        (
            |c| c.statistics_samples = 0,
            "statistics_samples must be between 1 and 1000000, found 0",
        ),
        (
            |c| c.log_every = 0,
            "log_every must be between 1 and 100000, found 0",
        ),
        (
            |c| c.gradient_clip = Some(-1.0),
            "gradient_clip must be finite and positive, found -1",
        ),
        (
            |c| c.loss_cap = Some(0.0),
            "loss_cap must be finite and positive, found 0",
        ),
        (
            |c| c.dropout = 1.0,
            "dropout must be at least 0 and below 1, found 1",
        ),
        (
            |c| c.dropout = 0.2,
            "dropout must be 0 where model.encoder is no gru: it acts between recurrent layers, found 0.2",
        ),
        (
            |c| c.scheduled_sampling.longest = 0,
            "scheduled_sampling.longest must be between 1 and 1000000, found 0",
        ),
        (
            |c| c.batch.samples = 0,
            "batch.samples must be between 1 and 65536, found 0",
        ),
        (
            |c| c.noise.deviation = f64::NAN,
            "noise.deviation must be at least 0 and below 1, found NaN",
        ),
        (
            |c| c.noise.correction = 1.5,
            "noise.correction must be between 0 and 1, found 1.5",
        ),
        (
            |c| c.scheduled_sampling.correction = -0.5,
            "scheduled_sampling.correction must be between 0 and 1, found -0.5",
        ),
        (
            |c| c.scheduled_sampling.farthest = f64::INFINITY,
            "scheduled_sampling.farthest must be finite and positive, found inf",
        ),
        (
            |c| {
                c.learning_rate = LearningRate::Cosine {
                    warmup: 3,
                    from: 1.0,
                    to: 0.1,
                    end: u64::MAX,
                }
            },
            "learning_rate.end must be at most 1000000000, found 18446744073709551615",
        ),
        (
            |c| {
                c.scheduled_sampling.truth = TruthProbability::Linear {
                    start: 0,
                    end: 2_000_000_000,
                    probability: 0.5,
                };
            },
            "scheduled_sampling.truth.end must be at most 1000000000, found 2000000000",
        ),
        (
            |c| {
                c.unroll = UnrollFrames::Growing {
                    start: 0,
                    end: u64::MAX,
                    frames: 9,
                }
            },
            "unroll.end must be at most 1000000000, found 18446744073709551615",
        ),
        (
            |c| c.model.latent = 1,
            "model.latent must be between 4 and 4096, found 1",
        ),
    ];
    for (edit, expected) in cases {
        let mut cfg = config(Encoder::MLP);
        edit(&mut cfg);
        let found = cfg.validate().expect_err(expected).to_string();
        assert_eq!(found, expected);
    }
}

fn with(settings: &[&str]) -> Result<TrainConfig, String> {
    let text = toml::to_string(&config(Encoder::Gru { window: 3 })).expect("plain");
    let settings: Result<Vec<Setting>, _> = settings.iter().map(|text| text.parse()).collect();
    let settings = settings.map_err(|error: ConfigError| error.to_string())?;
    TrainConfig::parse_with(&text, &path(), &settings).map_err(|error| error.to_string())
}

#[test]
fn settings_change_what_they_name_and_nothing_else() {
    let mut expected = config(Encoder::Gru { window: 3 });
    expected.model.latent = 32;
    expected.gradient_clip = Some(2.5);
    expected.losses.bending_angle = 0.0;
    expected.learning_rate = LearningRate::Constant { rate: 1e-2 };
    let found = with(&[
        "model.latent = 16",
        "gradient_clip=2.5",
        "losses.bending_angle=0.0",
        "learning_rate = { kind = \"constant\", rate = 1e-2 }",
        "model.latent=32",
    ]);
    assert_eq!(found.as_ref(), Ok(&expected));
    expected.name = "another".to_owned();
    // A plain word is a text, as every shell leaves it.
    let found = with(&[
        "model.latent=32",
        "gradient_clip=2.5",
        "losses.bending_angle=0",
        "learning_rate.rate=1e-2",
        "name=another",
    ]);
    assert_eq!(found, Ok(expected));
}

#[test]
fn settings_that_do_not_fit_are_named() {
    let cases = [
        ("model.latnet=32", "training.toml with model.latnet = 32: "),
        ("model.latnet=32", "unknown field `latnet`, expected one of"),
        ("colour=3", "unknown field `colour`"),
        ("model.latent=wide", "invalid type: string \"wide\""),
        ("model.latent=2.5", "invalid type: floating point `2.5`"),
        ("model.latent=2", "model.latent must be between 4 and 4096"),
        ("model.latent.size=2", "model.latent is no table"),
        ("model.encoder.kind=lstm", "unknown variant `lstm`"),
        (
            "model.encoder={ kind = \"mlp\", window = 2 }",
            "model.encoder.window of the kind \"mlp\" must be 1, found 2: choose the kind \"gru\"",
        ),
        ("model.latent", "\"model.latent\" is no setting"),
        ("=3", "\"=3\" is no setting"),
        ("model..latent=3", "\"model..latent=3\" is no setting"),
        ("model.latent=[3", "\"model.latent=[3\" is no setting"),
        ("steps=3\nseed=4", "is no setting"),
        (
            "model.node_features=[\"velocity\", \"node-type\", \"velocity\"]",
            "\"velocity\" stands twice in a list of features",
        ),
    ];
    for (setting, expected) in cases {
        let found = with(&[setting]).expect_err(expected);
        assert!(found.contains(expected), "{setting}: {found}");
    }
}
