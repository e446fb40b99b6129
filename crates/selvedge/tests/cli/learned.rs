//! The learned simulator from the command line: `train`, `eval`, `run --model`.

use crate::common::{PUSH, PUSH_FRAMES, TRAINING, TestFolder, column, names_in, number, rows};
use selvedge_data::Trajectory;

/// The files of a training.
const TRAINED: [&str; 4] = [
    "checkpoint.safetensors",
    "config.toml",
    "log.jsonl",
    "model.safetensors",
];

#[test]
fn a_resumed_training_ends_with_the_same_weights() {
    let dir = TestFolder::new();
    dir.model();
    let report = dir.json("train moment.toml --data tiny -o halves --steps 2");
    assert_eq!(number(&report, "/steps_done"), 2.0);
    dir.refuses("1 | train moment.toml --data tiny -o halves | halves | --resume");
    dir.json("train moment.toml --data tiny -o halves --resume");
    assert_eq!(names_in(&dir.path("halves")), TRAINED);
    for name in ["checkpoint.safetensors", "model.safetensors"] {
        let [whole, halves] = ["run", "halves"].map(|folder| dir.read(&format!("{folder}/{name}")));
        assert!(whole == halves, "{name}");
    }
    // What failed before it wrote anything leaves no folder behind, nor those above it. A model will
    // do, by its file or its name, if it is of the same network.
    let (train, another) = ("train moment.toml --data tiny -o", "is another one");
    dir.refuses(&format!(
        "1 | {train} nothing --resume | checkpoint.safetensors
         1 | {train} deep/other --from run --set model.latent=16 | --from run | {another} \
             | model.latent is 8 there, 16 here
         1 | {train} deep/other --from paper | --from paper | {another} \
             | model.latent is 64 there
         1 | {train} deep/other --from nobody | nobody | paper",
    ));
    dir.json("train moment.toml --data tiny -o on --from run/model.safetensors --steps 2");
    assert_eq!(names_in(&dir.path("on")), TRAINED);
}

/// Two runs in one folder would mix their logs, and the last one's weights would win.
#[cfg(unix)]
#[test]
fn a_folder_is_trained_into_by_one_run_at_a_time() {
    use std::process::Stdio;

    let dir = TestFolder::new();
    dir.tiny();
    let long = TRAINING.replace("steps = 6", "steps = 100000000");
    dir.write("long.toml", long);
    let call = "train long.toml --data tiny -o run --checkpoint-every 1s";
    let mut command = dir.command(call);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut first = command.spawn().unwrap();
    while !dir.path("run/checkpoint.safetensors").is_file() {
        assert!(first.try_wait().unwrap().is_none(), "it ended early");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let owner = format!("process {}", first.id());
    for call in [call, "train long.toml --data tiny -o run --resume"] {
        dir.fails(call, 1, &["another run writes", &owner, "another folder"]);
    }
    // Killed, it leaves its lock and perhaps a part of a file; the next run takes over.
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(dir.path("run/.selvedge.lock").is_file());
    dir.write("run/.model.safetensors.left.part", "half");
    let span = "train long.toml --data tiny -o run --resume --for 1s --micro-batch 2";
    let report = dir.json(span);
    let done = number(&report, "/steps_done");
    assert!(done > 0.0 && done < 1e8, "{done}");
    assert_eq!(report["interrupted"], false);
    assert_eq!(names_in(&dir.path("run")), TRAINED);
}

#[test]
fn a_model_is_measured_beside_the_baselines() {
    let dir = TestFolder::new();
    dir.model();
    let report = dir.json(
        "eval --model run/model.safetensors --data tiny --motion lift --horizons 5 --baselines rigid",
    );
    let means = || rows(&report, "means").iter();
    let mean = |name: &str| means().find(|mean| mean["method"] == name).unwrap();
    // The rigid baseline keeps the rest pose's strain.
    let rest = dir.trajectory("tiny/test/lift.safetensors");
    let rest = Trajectory::new(
        rest.cloth().clone(),
        rest.cloth().rest_positions().to_vec(),
        rest.provenance().clone(),
    )
    .unwrap();
    rest.write(&dir.path("rest.safetensors")).unwrap();
    let still = dir.json("info rest.safetensors");
    let strain = number(mean("rigid"), "/whole/largest_strain");
    // f32 positions: a relative error of 1e-7 of positions over edges five times shorter.
    assert!((strain - number(&still, "/largest_strain")).abs() < 3e-6);
    let timings = rows(&report, "timings");
    assert_eq!(column(timings, "method"), ["run", "rigid"]);
    assert!(timings.iter().all(|t| number(t, "/ms_per_frame") > 0.0));
}

#[test]
fn a_rollout_stands_beside_the_truth() {
    let dir = TestFolder::new();
    dir.model();
    dir.write("push.toml", PUSH);
    let report = dir.json("run --compare push.toml --model run/model.safetensors -o out");
    let names = [
        "clip.gif",
        "rollout.safetensors",
        "sheet.png",
        "truth.safetensors",
    ];
    assert_eq!(names_in(&dir.path("out")), names);
    assert_eq!(rows(&report, "wrote").len(), 4);
    dir.json("run push.toml -o simulated.safetensors");
    assert!(dir.read("out/truth.safetensors") == dir.read("simulated.safetensors"));
    let compared = dir.json("compare out/truth.safetensors out/rollout.safetensors");
    let reported = number(&report, "/comparison/position_rmse");
    assert_eq!(number(&compared, "/position_rmse"), reported);
    let [truth, rollout] =
        ["truth", "rollout"].map(|name| dir.trajectory(&format!("out/{name}.safetensors")));
    for frame in 0..=PUSH_FRAMES {
        let held = |run: &Trajectory| run.handles().select(run.frame(frame));
        assert_eq!(held(&truth), held(&rollout));
    }
    assert!(dir.read("out/sheet.png").starts_with(b"\x89PNG"));
    assert!(dir.read("out/clip.gif").starts_with(b"GIF89a"));
}

#[test]
fn a_rollout_into_a_used_folder_leaves_nothing_of_the_earlier_one() {
    let dir = TestFolder::with_push();
    // The shipped scene, where none is named, into the folder that none is named for.
    let first = dir.json("run --model paper --compare --frames 3");
    assert_eq!(first["scene"], "default");
    assert_eq!(first["model"], "paper");
    let run = dir.trajectory("out/rollout.safetensors");
    assert_eq!((run.frame_count(), run.vertex_count()), (4, 400));
    assert_eq!(rows(&first, "removed").len(), 0);
    dir.write("out/notes.txt", "mine");
    let again = dir.json("run --compare push.toml --model paper -o out --frames 2");
    assert_eq!(again["model"], "paper");
    assert_eq!(rows(&again, "removed").len(), 0);
    let all = dir.run("run --model paper push.toml -o out --frames 2 --no-clip");
    assert_eq!(all.code, Some(0), "{}", all.err);
    let names = ["notes.txt", "rollout.safetensors", "sheet.png"];
    assert_eq!(names_in(&dir.path("out")), names);
    for name in ["truth.safetensors", "clip.gif"] {
        let reported = std::path::Path::new("out").join(name);
        let line = format!("{}, of an earlier rollout", reported.display());
        assert!(all.out.contains(&line), "{}", all.out);
    }
}
