//! The learned simulator from the command line: `train`, `eval`, `run --model`.

use crate::common::{Desk, PUSH, PUSH_FRAMES, TRAINING, names_in, number};
use selvedge_data::Trajectory;
use serde_json::Value;

/// The files of a training.
const TRAINED: [&str; 4] = [
    "checkpoint.safetensors",
    "config.toml",
    "log.jsonl",
    "model.safetensors",
];

#[test]
fn a_resumed_training_ends_with_the_same_weights() {
    let desk = Desk::new();
    desk.model();
    let report = desk.json("train moment.toml --data tiny -o halves --steps 2");
    assert_eq!(number(&report, "/steps_done"), 2.0);
    desk.fails(
        "train moment.toml --data tiny -o halves",
        1,
        &["halves", "--resume"],
    );
    desk.json("train moment.toml --data tiny -o halves --resume");
    assert_eq!(names_in(&desk.path("halves")), TRAINED);
    for name in ["checkpoint.safetensors", "model.safetensors"] {
        let [whole, halves] =
            ["run", "halves"].map(|folder| desk.read(&format!("{folder}/{name}")));
        assert!(whole == halves, "{name}");
    }
    // What failed before it wrote anything leaves no folder behind, nor those above it. A model will
    // do, by its file or its name, if it is of the same network.
    let another = "is another one";
    for (options, words) in [
        ("-o nothing --resume", &["checkpoint.safetensors"][..]),
        (
            "-o deep/other --from run --set model.latent=16",
            &["--from run", another, "model.latent is 8 there, 16 here"],
        ),
        (
            "-o deep/other --from paper",
            &["--from paper", another, "model.latent is 64 there"],
        ),
        ("-o deep/other --from nobody", &["nobody", "paper"]),
    ] {
        desk.fails(
            &format!("train moment.toml --data tiny {options}"),
            1,
            words,
        );
    }
    desk.json("train moment.toml --data tiny -o on --from run/model.safetensors --steps 2");
    assert_eq!(names_in(&desk.path("on")), TRAINED);
    for folder in ["nothing", "deep"] {
        assert!(!desk.path(folder).exists(), "{folder}");
    }
}

/// Two runs in one folder would mix their logs, and the last one's weights would win.
#[cfg(unix)]
#[test]
fn a_folder_is_trained_into_by_one_run_at_a_time() {
    use std::process::Stdio;

    let desk = Desk::new();
    desk.tiny();
    let long = TRAINING.replace("steps = 6", "steps = 100000000");
    desk.write("long.toml", long);
    let call = "train long.toml --data tiny -o run --checkpoint-every 1s";
    let mut command = desk.command(call);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut first = command.spawn().unwrap();
    while !desk.path("run/checkpoint.safetensors").is_file() {
        assert!(first.try_wait().unwrap().is_none(), "it ended early");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let owner = format!("process {}", first.id());
    for call in [call, "train long.toml --data tiny -o run --resume"] {
        desk.fails(call, 1, &["another run writes", &owner, "another folder"]);
    }
    // Killed, it leaves its lock and perhaps a part of a file; the next run takes over.
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(desk.path("run/.selvedge.lock").is_file());
    desk.write("run/.model.safetensors.left.part", "half");
    let report = desk.json("train long.toml --data tiny -o run --resume --for 1s");
    assert!(number(&report, "/steps_done") > 0.0);
    assert_eq!(names_in(&desk.path("run")), TRAINED);
}

#[cfg(unix)]
#[test]
fn statistics_can_be_interrupted() {
    let desk = Desk::new();
    desk.tiny();
    let recurrent = "encoder = { kind = \"gru\", window = 64 }";
    desk.write(
        "moment.toml",
        TRAINING.replace("encoder = { kind = \"mlp\" }", recurrent),
    );
    // Hours of them, if it went on.
    let train = "train moment.toml --data tiny -o run --set statistics_samples=1000000";
    let mut train = desk.start(&format!("{train} --json"));
    train.wait_for("gathering statistics: begun");
    assert!(desk.path("run").is_dir());
    train.press();
    let said = train.ended();
    assert_eq!(said.code, Some(130));
    let report: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(report["interrupted"], true);
    assert_eq!(number(&report, "/steps_done"), 0.0);
    assert!(!desk.path("run").exists(), "there was nothing to keep");
}

#[test]
fn a_span_ends_a_training_cleanly() {
    let desk = Desk::new();
    desk.to_train();
    let report =
        desk.json("train moment.toml --data tiny -o run --steps 1000000 --for 1s --micro-batch 2");
    let done = number(&report, "/steps_done");
    assert!(done > 0.0 && done < 1e6);
    assert_eq!(report["interrupted"], false);
    assert_eq!(desk.json("info run/model.safetensors")["kind"], "model");
}

#[test]
fn a_model_is_measured_beside_the_baselines() {
    let desk = Desk::new();
    desk.model();
    let report = desk.json(
        "eval --model run/model.safetensors --data tiny --motion lift --horizons 5 --baselines rigid,mirror",
    );
    let means = report["means"].as_array().unwrap();
    let mean = |name: &str| means.iter().find(|mean| mean["method"] == name).unwrap();
    // The rigid baseline keeps the rest pose's strain.
    let rest = desk.trajectory("tiny/test/lift.safetensors");
    let rest = Trajectory::new(
        rest.cloth().clone(),
        rest.cloth().rest_positions().to_vec(),
        rest.provenance().clone(),
    )
    .unwrap();
    rest.write(&desk.path("rest.safetensors")).unwrap();
    let still = desk.json("info rest.safetensors");
    let strain = number(mean("rigid"), "/whole/largest_strain");
    // f32 positions: a relative error of 1e-7 of positions over edges five times shorter.
    assert!((strain - number(&still, "/largest_strain")).abs() < 3e-6);
    // The mirrored mode is as good a cloth as the truth, but another one.
    assert!(number(mean("mirror"), "/whole/errors/position_rmse") > 1e-3);
    let timings = report["timings"].as_array().unwrap();
    let names: Vec<&str> = timings
        .iter()
        .map(|t| t["method"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["run", "rigid", "mirror"]);
    assert!(timings.iter().all(|t| number(t, "/ms_per_frame") > 0.0));
}

#[test]
fn a_rollout_stands_beside_the_truth() {
    let desk = Desk::new();
    desk.model();
    // A rollout takes the law from which models learn.
    desk.write("push.toml", format!("physics.law = \"measured\"{PUSH}"));
    let report = desk.json("run --compare push.toml --model run/model.safetensors -o out");
    let names = [
        "clip.gif",
        "rollout.safetensors",
        "sheet.png",
        "truth.safetensors",
    ];
    assert_eq!(names_in(&desk.path("out")), names);
    assert_eq!(report["wrote"].as_array().unwrap().len(), 4);
    desk.json("run push.toml -o simulated.safetensors");
    assert!(desk.read("out/truth.safetensors") == desk.read("simulated.safetensors"));
    let compared = desk.json("compare out/truth.safetensors out/rollout.safetensors");
    let told = number(&report, "/comparison/position_rmse");
    assert_eq!(number(&compared, "/position_rmse"), told);
    let [truth, rollout] =
        ["truth", "rollout"].map(|name| desk.trajectory(&format!("out/{name}.safetensors")));
    for frame in 0..=PUSH_FRAMES {
        let held = |run: &Trajectory| run.handles().select(run.frame(frame));
        assert_eq!(held(&truth), held(&rollout));
    }
    assert!(desk.read("out/sheet.png").starts_with(b"\x89PNG"));
    assert!(desk.read("out/clip.gif").starts_with(b"GIF89a"));
}

#[test]
fn a_rollout_into_a_used_folder_leaves_nothing_of_the_earlier_one() {
    let desk = Desk::with_push();
    // The shipped scene, where none is named, into the folder that none is named for.
    let first = desk.json("run --model paper --compare --frames 3");
    assert_eq!(
        (&first["scene"], &first["model"]),
        (&"default".into(), &"paper".into())
    );
    let run = desk.trajectory("out/rollout.safetensors");
    assert_eq!((run.frame_count(), run.vertex_count()), (4, 400));
    assert_eq!(first["removed"].as_array().unwrap().len(), 0);
    desk.write("out/notes.txt", "mine");
    let again = desk.json("run --compare push.toml --model paper -o out --frames 2");
    assert_eq!(again["model"], "paper");
    assert_eq!(again["removed"].as_array().unwrap().len(), 0);
    let all = desk.run("run --model paper push.toml -o out --frames 2 --no-clip");
    assert_eq!(all.code, Some(0), "{}", all.err);
    assert_eq!(
        names_in(&desk.path("out")),
        ["notes.txt", "rollout.safetensors", "sheet.png"]
    );
    for name in ["truth.safetensors", "clip.gif"] {
        let told = std::path::Path::new("out").join(name);
        let line = format!("{}, of an earlier rollout", told.display());
        assert!(all.out.contains(&line), "{}", all.out);
    }
}
