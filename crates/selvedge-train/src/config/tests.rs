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
fn unknown_keys_are_named() {
    let text = toml::to_string(&config(Encoder::MLP)).expect("plain");
    let unknown = format!("colour = 3\n{text}");
    let error = TrainConfig::parse(&unknown, &path()).expect_err("unknown");
    let error = error.to_string();
    assert!(error.starts_with("training.toml: ") && error.contains("unknown field `colour`"));
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

/// Settings of one value, and how the error ends.
const OUT_OF_RANGE: &str = r#"
steps=9223372036854775807 => steps must be between 1 and 1000000000, found 9223372036854775807
statistics_samples=0 => statistics_samples must be between 1 and 1000000, found 0
log_every=0 => log_every must be between 1 and 100000, found 0
gradient_clip=-1.0 => gradient_clip must be finite and positive, found -1
loss_cap=0.0 => loss_cap must be finite and positive, found 0
weight_average=1.0 => weight_average must be at least 0 and below 1, found 1
dropout=1.0 => dropout must be at least 0 and below 1, found 1
batch.samples=0 => batch.samples must be between 1 and 65536, found 0
noise.deviation=nan => noise.deviation must be at least 0 and below 1, found NaN
noise.correction=1.5 => noise.correction must be between 0 and 1, found 1.5
losses.edge_length=-1.0 => losses.edge_length must be finite and not negative, found -1
optimizer.beta2=1.0 => optimizer.beta2 must be at least 0 and below 1, found 1
model.latent=1 => model.latent must be between 4 and 4096, found 1
scheduled_sampling.longest=0 => longest must be between 1 and 1000000, found 0
scheduled_sampling.correction=-0.5 => correction must be between 0 and 1, found -0.5
scheduled_sampling.farthest=inf => farthest must be finite and positive, found inf
unroll={ kind="constant", frames=0 } => unroll.frames must be between 1 and 1000, found 0
learning_rate.rate=nan => learning_rate.rate must be finite and positive, found NaN
"#;

/// Settings of a schedule of three numbers, from step 5 on, and how the error ends.
const SCHEDULES: &str = r#"
cosine from=0.0, to=0.0, end=20 => learning_rate.from must be finite and positive, found 0
cosine from=1.0, to=2.0, end=20 => learning_rate.to must be between 0 and 1, found 2
cosine from=1.0, to=0.5, end=5 => learning_rate.end must be after the warm-up of 5 steps, found 5
cosine from=1.0, to=0.1, end=2000000000 => end must be at most 1000000000, found 2000000000
linear end=6, probability=1.5 => truth.probability must be between 0 and 1, found 1.5
linear end=5, probability=0.5 => scheduled_sampling.truth.end must be after its start 5, found 5
linear end=2000000000, probability=0.5 => truth.end must be at most 1000000000, found 2000000000
growing end=5, frames=2 => unroll.end must be after start = 5, found 5
growing end=2000000000, frames=9 => unroll.end must be at most 1000000000, found 2000000000
"#;

/// The columns of a table of the two above.
fn rows(table: &str) -> impl Iterator<Item = (&str, &str)> {
    let lines = table.trim().lines();
    lines.map(|line| line.split_once(" => ").expect("two columns"))
}

#[test]
fn values_out_of_range_are_named() {
    for (setting, expected) in rows(OUT_OF_RANGE) {
        let found = with(&[setting]).expect_err(setting);
        assert!(found.ends_with(expected), "{setting}: {found}");
        assert!(found.starts_with("training.toml: "), "{setting}: {found}");
    }
    for (schedule, expected) in rows(SCHEDULES) {
        let (kind, numbers) = schedule.split_once(' ').expect("a kind");
        let (field, start) = match kind {
            "cosine" => ("learning_rate", "warmup"),
            "linear" => ("scheduled_sampling.truth", "start"),
            _ => ("unroll", "start"),
        };
        let setting = format!("{field}={{ kind={kind:?}, {start}=5, {numbers} }}");
        let found = with(&[&setting]).expect_err(schedule);
        assert!(found.ends_with(expected), "{schedule}: {found}");
    }
}

#[test]
fn values_that_do_not_go_together_are_named() {
    let found = with(&["model.encoder={ kind=\"mlp\" }", "dropout=0.2"]).expect_err("no gru");
    let expected = "dropout must be 0 where model.encoder is no gru";
    assert!(found.contains(expected), "{found}");
    let unrolled = "unroll={ kind=\"constant\", frames=4 }";
    with(&[unrolled, "losses.kinetic_energy=0.0"]).expect("a good one");
    let found = with(&[unrolled, "losses.kinetic_energy=1.0"]).expect_err("a mix");
    let expected = "losses.kinetic_energy must be 0 where unroll.frames is above 1, found 1";
    assert!(found.ends_with(expected), "{found}");
}

/// Settings of one value, and words of the error.
const MISFITS: &str = r#"
model.latnet=32 => training.toml with model.latnet = 32:
model.latnet=32 => unknown field `latnet`, expected one of
colour=3 => unknown field `colour`
losses.bending=1.0 => unknown field `bending`
learning_rate.at=3 => unknown field `at`
learning_rate={ kind="cosin", rate=1.0 } => unknown variant `cosin`
scheduled_sampling.truth={ kind="always", end=3 } => unknown field `end`
model.latent=wide => invalid type: string "wide"
model.latent=2.5 => invalid type: floating point `2.5`
model.latent.size=2 => model.latent is no table
model.encoder.kind=lstm => unknown variant `lstm`
model.encoder={ kind="mlp", window=2 } => of the kind "mlp" must be 1, found 2: choose the kind "gru"
model.latent => "model.latent" is no setting
=3 => "=3" is no setting
model..latent=3 => "model..latent=3" is no setting
model.latent=[3 => "model.latent=[3" is no setting
steps=3\nseed=4 => is no setting
model.node_features=["velocity", "velocity"] => "velocity" stands twice in a list of features
"#;

#[test]
fn settings_that_do_not_fit_are_named() {
    for (setting, expected) in rows(MISFITS) {
        let found = with(&[&setting.replace("\\n", "\n")]).expect_err(setting);
        assert!(found.contains(expected), "{setting}: {found}");
    }
}
