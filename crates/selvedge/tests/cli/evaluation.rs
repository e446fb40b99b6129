//! `eval`: methods side by side on data sets, on scenes against their converged physics, and in
//! random motions; the same numbers for any number of threads; reports.

use crate::common::{PUSH, TRAINING, TestFolder, column, names_in, number, rows};
use serde_json::Value;

/// A folder with the data set `tiny` and two models that have barely learned.
fn two_models() -> TestFolder {
    let dir = TestFolder::new();
    dir.model();
    let other = TRAINING.replace("seed = 1", "seed = 2");
    dir.write("other.toml", other);
    dir.json("train other.toml --data tiny -o other");
    dir
}

const MODELS: &str = "--model run/model.safetensors --model theirs=other/model.safetensors";

/// The runs of an answer, those from true states and the whole ones.
fn runs(answer: &Value) -> [Vec<&Value>; 2] {
    let all = || rows(answer, "runs").iter();
    [false, true].map(|is_whole| all().filter(|run| run["is_whole"] == is_whole).collect())
}

#[test]
fn two_models_stand_side_by_side_as_each_stands_alone() {
    let dir = two_models();
    let both = dir.json(&format!("eval {MODELS} --data tiny --horizons 5,1,5 -o r"));
    let files = ["errors.csv", "report.md", "times.csv", "times.md"];
    assert_eq!(names_in(&dir.path("r")), files);
    let [started, whole] = runs(&both);
    let names = column(whole.iter().copied(), "method");
    assert_eq!(names, ["run", "theirs", "rigid"]);
    // Eight starts of each.
    assert_eq!(started.len(), 3 * 8);
    let alone = dir.json("eval --model theirs=other/model.safetensors --data tiny --horizons 1,5");
    assert_eq!(*whole[1], *runs(&alone)[1][0]);
    let mean = &both["means"][0];
    let frames = |k: usize| number(mean, &format!("/after/{k}/frame"));
    assert_eq!([frames(0), frames(1)], [1.0, 5.0]);
    let error = |k: usize| number(mean, &format!("/after/{k}/errors/position_rmse"));
    assert!(error(0) < error(1), "{mean}");
    assert_eq!(mean["whole_runs"], 1);
    assert_eq!(whole[0]["mesh"], "square, 36 vertices, 2 handles");
    assert_eq!(number(whole[0], "/whole/frame"), 60.0);
}

#[test]
fn the_physics_runs_beside_the_models_with_the_substeps_asked_for() {
    let dir = two_models();
    let answer = dir.json(
        "eval --model run/model.safetensors --data tiny --horizons 1 --baselines none --physics 2,1,2 -o r",
    );
    let [_, whole] = runs(&answer);
    let error = |name: &str| {
        let run = whole.iter().find(|run| run["method"] == name).unwrap();
        assert_eq!(run["failure"], Value::Null);
        number(run, "/whole/errors/position_rmse")
    };
    assert_eq!(whole.len(), 3);
    // The truth was made with two; it starts from the same rest pose, rounded to f32.
    let (own, coarse) = (error("physics, 2 substeps"), error("physics, 1 substep"));
    assert!(coarse > 1e-4, "{coarse}");
    assert!(own < 1e-2 * coarse, "{own} {coarse}");
    let times = dir.text("r/times.md");
    assert!(times.contains("physics"), "{times}");
}

#[test]
fn guards_stand_side_by_side() {
    let dir = TestFolder::new();
    dir.model();
    let call = "eval --model run/model.safetensors --data tiny --horizons 1";
    let answer = dir.json(&format!("{call} --guard none,limit,limit"));
    let [_, whole] = runs(&answer);
    let names = column(whole.iter().copied(), "method");
    assert_eq!(names, ["run (none)", "run (limit)", "rigid"]);
    assert_eq!(whole[0]["guarded"], Value::Null);
    let limited = &whole[1];
    assert_eq!(number(limited, "/guarded/frames"), 60.0);
    assert_eq!(limited["diverged_frame"], Value::Null);
    assert!(number(limited, "/whole/largest_strain") < 0.2815);
    assert_eq!(answer["means"][1]["diverged"], 0);
    assert_eq!(answer["means"][1]["guarded"], whole[1]["guarded"]);
    // Limit is what nobody asks for.
    let usual = dir.json(call);
    assert_eq!(runs(&usual)[1][0]["whole"], whole[1]["whole"]);
    assert_eq!(usual["guards"][0], "limit");
}

/// A moment of a scene against 32 substeps: 2 starts, 5 frames each.
const SCENE: &str = "eval scene.toml -o c --physics linearised:1,linearised:2,linearised:4 \
    --baselines none --reference linearised:32 --horizons 1,5 --starts 2 --from 16";

#[test]
fn scenes_are_measured_against_their_converged_physics() {
    let dir = TestFolder::new();
    dir.write("scene.toml", PUSH);
    let answer = dir.json(SCENE);
    assert_eq!(answer["means"][3]["kind"], "reference");
    let page = dir.text("c/report.md");
    for text in [
        "The truth is a run by linearised, 32 substeps.",
        "| position RMSE (mm) | k = 1 | k = 5 | whole runs |",
        "| linearised, 4 substeps |",
        "| reference (linearised, 16 substeps) |",
        "The reference's own error is about",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    // Again, with fewer: the reference is kept, and what was measured is the same.
    let reference = names_in(&dir.path("c/references"));
    assert_eq!(reference.len(), 1);
    let others = dir.json(&SCENE.replace("linearised:1,", ""));
    assert_eq!(others["means"][0]["after"], answer["means"][1]["after"]);
    assert_eq!(reference, names_in(&dir.path("c/references")));
}

#[test]
fn materials_and_motions_take_the_place_of_the_scenes_own() {
    let dir = TestFolder::new();
    dir.write("scene.toml", PUSH);
    let answer = dir.json(
        "eval scene.toml -o c --material gray-interlock,11oz-black-denim --motion forward \
         --physics 1 --reference 4 --horizons 1 --starts 1 --no-whole --to 64",
    );
    let [started, whole] = runs(&answer);
    let mut names = column(started, "case");
    names.dedup();
    let expected = [
        "push, gray-interlock, forward",
        "push, 11oz-black-denim, forward",
    ];
    assert_eq!(names, expected);
    assert!(whole.is_empty());
}

#[test]
fn random_motions_are_the_same_for_any_number_of_threads() {
    let dir = TestFolder::with_push();
    dir.model();
    let drive = "eval push.toml --model run/model.safetensors --random 5 --frames 40";
    let one = dir.json(&format!("{drive} -j 1"));
    assert_eq!(one["runs"], dir.json(&format!("{drive} -j 3"))["runs"]);
    let mean = &one["means"][0];
    assert_eq!(mean["whole_runs"], 5);
    assert_eq!(mean["diverged"], 0);
    assert_eq!(number(mean, "/guarded/frames"), 200.0);
    assert!(number(mean, "/whole/largest_strain") < 0.2815);
    assert_eq!(mean["whole"]["errors"], Value::Null);
    assert_ne!(one["runs"], dir.json(&format!("{drive} --seed 2"))["runs"]);
}

#[test]
fn random_motions_take_cloths_in_turn_and_physics_too() {
    let dir = TestFolder::with_push();
    let answer = dir.json(
        "eval push.toml --random 4 --frames 60 --mesh wide,triangle --density 40 --physics 1,4 -o r",
    );
    let sets = column(rows(&answer, "runs"), "set");
    assert_eq!(sets, ["wide", "wide", "triangle", "triangle"].repeat(2));
    assert_eq!(answer["means"][0]["method"], "physics, 1 substep");
    let strain = |k: usize| number(&answer, &format!("/means/{k}/whole/largest_strain"));
    assert_ne!(strain(0), strain(1));
    let text = dir.text("r/errors.csv");
    assert_eq!(text.lines().count(), 1 + 4 * 2 * 60);
}

#[cfg(unix)]
#[test]
fn an_interrupted_evaluation_leaves_whole_files() {
    use crate::common::Running;

    let dir = TestFolder::new();
    dir.write("scene.toml", PUSH);
    let call = SCENE.replace("linearised:32", "linearised:1000");
    for words in ["sagging to rest: begun", Running::HAS_RESULTS] {
        let mut evaluation = dir.start(&call);
        evaluation.wait_for(words);
        evaluation.press();
        let said = evaluation.ended();
        assert_eq!(said.code, Some(130), "{words}: {}", said.err);
    }
    // What is there is whole: the same call goes on from it.
    assert_eq!(dir.json(&call)["interrupted"], false);
}

#[test]
fn data_sets_that_are_called_alike_are_told_apart_by_their_folders() {
    let dir = TestFolder::new();
    dir.model();
    dir.json("data generate tiny -o a/tiny");
    let answer = dir.json(
        "eval --model run/model.safetensors --data a/tiny --data tiny --horizons 1 --baselines rigid",
    );
    let mut names = column(rows(&answer, "runs"), "set");
    names.dedup();
    assert_eq!(names, ["a/tiny", "tiny"]);
}

#[test]
fn calls_that_make_no_sense_are_refused() {
    let dir = two_models();
    dir.write("push.toml", PUSH);
    let groups = r#"handles = { groups = [
        { name = "left", select = { vertices = [0] } },
        { name = "right", select = { vertices = [5] }, released = [{ from = 0.2 }] },
    ] }"#;
    let drop = PUSH.replace("handles = { label = \"upper-corners\" }", groups);
    dir.write("drop.toml", drop);
    let run = "eval --data tiny --model run/model.safetensors";
    let twice = "--model a=run/model.safetensors --model a=other/model.safetensors";
    dir.refuses(&format!(
        "2 | {run} {twice} | two are called a | name
         2 | eval --model rigid=run/model.safetensors --data tiny | rigid
         2 | {run} --horizons 1,61 | 61 frames fit into no case | the longest has 60
         2 | {run} --data ./tiny | --data ./tiny: stands twice
         2 | {run} --horizons 0 | 0
         2 | {run} --physics 0 | --physics | 0
         1 | eval --model gone.safetensors --data tiny -o r | gone.safetensors
         2 | {run} --motion drop | drop | lift
         2 | eval | nothing to measure on | --data | --random
         2 | eval push.toml | --output | references
         2 | eval push.toml -o c --starts 0 | --starts
         2 | eval push.toml -o c --physics euler:2 | --physics | \"euler\" | linearised
         2 | eval push.toml -o c --physics 1 --reference 33 | reference | even
         2 | eval push.toml -o c --physics 1 --to 31 | push: to | 30 frames
         1 | eval push.toml -o c --physics 1 --material silk | push: material | silk
         1 | eval none.toml -o c | none.toml | default
         2 | eval --random 4 --mesh sock | \"sock\" | triangle-17
         2 | eval --random 4 --mesh wide --density=-3 | density | positive
         2 | eval --random 4 --density 40 | --mesh
         2 | eval --random 4 --speed 0 | above 0
         2 | eval drop.toml --random 4 | push | releases handles",
    ));
}
