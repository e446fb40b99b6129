//! Studies that are shipped are whole; those that make no sense are refused with what is wrong.

use super::*;

const STUDY: &str = r#"
title = "Two"
budget = { steps = 3 }

[data]
tiny = { preset = "tiny" }

[evaluation]
baselines = ["rigid"]

[[train]]
name = "a"
config = "first"
set = ["model.latent=8", "model.blocks=1"]

[[train]]
name = "b"
config = "first"
set = ["model.latent=8", "model.blocks=1"]
budget = { time = "2s" }
after = "a"
"#;

fn read(from: &str, to: &str) -> Result<Study, String> {
    assert!(STUDY.contains(from), "{from}");
    let text = STUDY.replace(from, to);
    parse(&text, Path::new(""), "two.toml").map_err(|error| format!("{error:#}"))
}

#[test]
fn every_shipped_study_can_be_opened() {
    for (name, _) in STUDIES {
        let study = open(name).unwrap();
        assert!(!study.train.is_empty(), "{name}");
    }
}

/// The changes of table 1 lead to the configurations that ship under a name of their own.
#[test]
fn the_rows_of_table_1_are_the_ablations_that_ship() {
    let study = open("table1").unwrap();
    assert_eq!(study.train.len(), 9);
    for entry in &study.train {
        let name = match entry.name.as_str() {
            "full" => "rp-gru10".to_owned(),
            name => format!("rp-{name}"),
        };
        let text = assets::training(&name).unwrap();
        let shipped = TrainConfig::parse(text, Path::new(&name)).unwrap();
        let cfg = study.config(entry).unwrap();
        // Schedules are shrunk to the steps that there are.
        let expected = TrainConfig {
            name: cfg.name.clone(),
            learning_rate: cfg.learning_rate,
            scheduled_sampling: cfg.scheduled_sampling,
            ..shipped
        };
        assert_eq!(cfg, expected);
    }
}

#[test]
fn a_study_says_what_is_trained_and_for_how_long() {
    let study = read("Two", "Two").unwrap();
    let [a, b] = &study.train[..] else {
        panic!("two trainings");
    };
    let cfg = study.config(a).unwrap();
    assert_eq!((cfg.model.latent, cfg.model.blocks), (8, 1));
    assert_eq!(study.budget(a).unwrap(), Budget::Steps(3));
    // Limited in time: the steps are those of the configuration.
    let first = assets::training("first").unwrap();
    let first = TrainConfig::parse(first, Path::new("first")).unwrap();
    assert_eq!(study.config(b).unwrap().steps, first.steps);
    let seconds = Duration::from_secs(2);
    assert_eq!(study.budget(b).unwrap(), Budget::Time(seconds));
    assert_eq!(study.data_of(b).unwrap(), "tiny");
}

/// A place in the study, what it becomes, and a word of the error; `\n` is the end of a line.
const NONSENSE: &str = r#"
title = => titel = => titel
name = "b" => name = "a" => two entries are called "a"
name = "b" => name = "rigid" => a baseline has this name
name = "b" => name = "../b" => letters, digits
{ steps = 3 } => { steps = 0 } => budget: 0 steps
"2s" => "0s" => no span of time
budget = { steps = 3 } =>  => there is no budget
after = "a" => after = "c" => no training before this one is called "c"
config = "first"\nset => config = "none"\nset => none
latent=8 => latents=8 => latents
latent=8 => latent => equals sign
latent=8 => latent=2 => between 4 and 4096
blocks=1"]\nbudget => blocks=2"]\nbudget => after: "a" has another network
[evaluation] => u = { folder = "u" }\n[evaluation]\ndata = ["v"] => "v"
["rigid"] => ["model"] => no baseline "model"
baselines = ["rigid"] => starts = 0 => evaluation.starts
baselines = ["rigid"] => horizons = [0] => evaluation.horizons
baselines = ["rigid"] => data = ["big"] => "big"
tiny = { preset = "tiny" } =>  => no data set
tiny = { preset = "tiny" } => t = { preset = "tiny" }\nu = { folder = "u" } => say which one
{ preset = "tiny" } => { presets = "tiny" } => presets
"#;

#[test]
fn what_makes_no_sense_is_refused() {
    for line in NONSENSE.trim().lines() {
        let columns: Vec<String> = line.split(" => ").map(|c| c.replace("\\n", "\n")).collect();
        let [from, to, word] = &columns[..] else {
            panic!("{line}: three columns");
        };
        let error = read(from, to).err();
        let error = error.unwrap_or_else(|| panic!("{line} was accepted"));
        assert!(error.starts_with("two.toml"), "{error}");
        assert!(error.contains(word), "{line}: {error}");
    }
}
