//! `selvedge fit`: the three orders of the book, what it refuses, and Ctrl-C.

use std::path::Path;

use serde_json::Value;

use crate::common::{PUSH, TestFolder};

/// A folder with the orders of the book.
fn orders() -> TestFolder {
    let dir = TestFolder::new();
    let fits = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/fits");
    for entry in std::fs::read_dir(fits).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        dir.write(&name, std::fs::read(path).unwrap());
    }
    dir
}

fn number(answer: &Value, name: &str) -> [f64; 2] {
    let numbers = answer["numbers"].as_array().unwrap();
    let found = numbers
        .iter()
        .find(|number| number["name"] == name)
        .unwrap();
    ["value", "error"].map(|key| found[key].as_f64().unwrap())
}

/// Distances at the start and the end of the first search [mm].
fn distances(answer: &Value) -> [f64; 2] {
    [0, 1].map(|k| answer["searches"][0][k].as_f64().unwrap())
}

#[test]
fn a_fabric_is_found_from_twenty_markers_of_its_swing() {
    let dir = orders();
    let answer = dir.json("fit swing.toml -o swing");
    let truth = [("stretch", 0.5), ("bend", 0.4), ("density", 0.187)];
    for (name, truth) in truth {
        let [value, error] = number(&answer, &format!("material.{name}"));
        assert!(
            (value / truth - 1.0).abs() < 0.05,
            "{name}: {value} for {truth}"
        );
        assert!(
            (value - truth).abs() < 3.0 * error,
            "{name}: {value} ± {error} for {truth}"
        );
    }
    let runs = ["runs", "runs_back"].map(|key| answer[key].as_u64().unwrap());
    assert!(runs[0] <= 20 && runs[1] <= 12, "{runs:?}");
    let names = ["fabric.toml", "fit.json", "report.md", "run.safetensors"];
    assert_eq!(
        dir.files("swing")
            .into_iter()
            .map(|file| file.0)
            .collect::<Vec<_>>(),
        names
    );
    // What was found moves as it was seen to, and is a fabric for scenes.
    let scene = dir
        .text("swing-true.toml")
        .replace("\"gray-interlock\"", "\"swing/fabric.toml\"");
    dir.write("again.toml", scene);
    for (scene, out) in [("swing-true.toml", "true"), ("again.toml", "again")] {
        dir.json(&format!("run {scene} -o {out}.safetensors"));
    }
    let compared = dir.json("compare true.safetensors again.safetensors");
    let distance = compared["position_rmse"].as_f64().unwrap();
    assert!(distance < 5e-4, "{distance}");
    // The same bytes on one thread, and no second fit in the same folder.
    let mut one = dir.command("fit swing.toml -o one");
    assert!(
        one.env("RAYON_NUM_THREADS", "1")
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(dir.files("one"), dir.files("swing"));
    let said = dir.run("fit swing.toml -o swing");
    assert_eq!(said.code, Some(1));
    assert!(
        said.err.contains("not empty: choose another name"),
        "{}",
        said.err
    );
}

#[test]
fn a_throw_lands_flat_on_its_goal() {
    let dir = orders();
    let answer = dir.json("fit throw.toml -o throw");
    let [from, to] = distances(&answer);
    assert!(from > 200.0 && to < 12.0, "{from} to {to} mm");
    let files = dir.files("throw").into_iter().map(|file| file.0);
    assert!(files.into_iter().any(|name| name == "start.safetensors"));
    // The start is one for scenes.
    let start = "start = { state = { file = \"throw/start.safetensors\" } }";
    dir.write(
        "again.toml",
        dir.text("throw-scene.toml")
            .replace("start = \"mesh\"", start),
    );
    dir.json("run again.toml --frames 60 -o again.safetensors");
    let [run, again] =
        ["throw/run", "again"].map(|name| dir.trajectory(&format!("{name}.safetensors")));
    assert_eq!(run.positions(), again.positions());
}

#[test]
fn a_towel_is_folded_by_the_motion_of_two_corners() {
    let dir = orders();
    let answer = dir.json("fit fold.toml -o fold");
    let [from, to] = distances(&answer);
    assert!(from > 30.0 && to < 14.0, "{from} to {to} mm");
    let run = dir.trajectory("fold/run.safetensors");
    // The half with the handles lies on the other: all of it is beyond the fold.
    let (first, last) = (run.frame(0), run.frame(run.frame_count() - 1));
    let half = first.iter().zip(last).filter(|(first, _)| first.x < 0.1);
    let beyond = half.clone().filter(|(_, last)| last.x > 0.2).count();
    assert_eq!(beyond, half.count());
    // The motion is one for scenes.
    let scene = dir.text("fold-scene.toml");
    let (above, rest) = scene.split_once("[motion.inline]").unwrap();
    let below = rest.split_once("[[obstacles]]").unwrap().1;
    dir.write(
        "again.toml",
        format!("{above}motion = {{ file = \"fold/motion.toml\" }}\n[[obstacles]]{below}"),
    );
    dir.json("run again.toml -o again.safetensors");
    assert_eq!(
        run.positions(),
        dir.trajectory("again.safetensors").positions()
    );
}

#[test]
fn a_trajectory_is_data_and_several_searches_have_one_end() {
    let dir = TestFolder::new();
    // Its rest pose is no stable one.
    let push = PUSH.replace("name = \"push\"", "name = \"push\"\nstart = \"mesh\"");
    dir.write("push.toml", &push);
    dir.json("run push.toml -o truth.safetensors");
    let heavy = "{ from = \"gray-interlock\", density = 0.25 }";
    dir.write("other.toml", push.replace("\"gray-interlock\"", heavy));
    let order = "scene = \"other.toml\"\nstarts = 2\nseed = 3\nruns = 20\n\
        data = { trajectory = \"truth.safetensors\" }\nmaterial = { density = [0.1, 0.4] }\n";
    dir.write("order.toml", order);
    let answer = dir.json("fit order.toml -o found");
    let [density, _] = number(&answer, "material.density");
    assert!((density - 0.187).abs() < 1e-3, "{density}");
    assert_eq!(answer["searches"].as_array().unwrap().len(), 2);
}

#[test]
fn a_wrong_order_is_identified_what_is_wrong_and_leaves_nothing() {
    let dir = TestFolder::with_push();
    dir.write("marks.csv", "frame,vertex,x,y,z\n3,4,0.1,0.2,0.3\n");
    dir.write(
        "beyond.csv",
        "frame,vertex,x,y,z\n3,4,0.1,0.2,0.3\n3,36,0.1,0.2,0.3\n",
    );
    dir.write(
        "twice.csv",
        "frame,vertex,x,y,z\n3,4,0.1,0.2,0.3\n3,4,0.1,0.2,0.3\n",
    );
    dir.write("words.csv", "frame,vertex,x,y,z\n3,4,0.1,here,0.3\n");
    dir.write("hidden.csv", "frame,vertex,x,y,z\n3,4,0.1,nan,0.3\n");
    dir.write("none.csv", "frame,vertex,x,y,z\n");
    let data = "data = { markers = \"marks.csv\" }";
    let bounds = "material = { bend = [0.5, 2.0] }";
    let with = |csv: &str| format!("data = {{ markers = \"{csv}.csv\" }}\n{bounds}");
    let of = |bounds: &str| format!("{data}\n{bounds}");
    for (order, words) in [
        (
            with("beyond"),
            vec!["beyond.csv", "row 2: vertex 36", "36 vertices, from 0"],
        ),
        (
            with("twice"),
            vec!["(3, 4) are there twice: leave out one row"],
        ),
        (
            with("words"),
            vec!["words.csv", "line: 2", "frame,vertex,x,y,z, in metres"],
        ),
        (with("hidden"), vec!["row 1", "leave out what was not seen"]),
        (with("none"), vec!["none.csv: nothing was seen"]),
        (with("absent"), vec!["absent.csv"]),
        (
            format!("data = {{ noise = 0.1 }}\n{bounds}"),
            vec!["data: give markers"],
        ),
        (
            format!("data = {{ markers = \"marks.csv\", noise = 0.0 }}\n{bounds}"),
            vec!["noise must be positive"],
        ),
        (
            of("material = { weight = [0.1, 1.0] }"),
            vec![
                "material.weight: there is no such number",
                "material.density",
            ],
        ),
        (
            of("material = { bend = [2.0, 0.5] }"),
            vec!["material.bend = [2, 0.5]: bounds are [least, most]"],
        ),
        (
            of("material = { bend = [0.0, 2.0] }"),
            vec!["the lower bound must be positive"],
        ),
        (
            of("material = { density = [0.5, 2.0] }"),
            vec![
                "material.density",
                "begins at the scene's",
                "change these, or the scene",
            ],
        ),
        (
            of("start = { place = [-1.0, 1.0] }"),
            vec!["start.place", "handles say where it is"],
        ),
        (
            of("motion = { translation = [-1.0, 1.0] }"),
            vec!["has no keyframes"],
        ),
        (
            of("start = { speed = [-1.0, 1.0] }"),
            vec!["start.speed: there is no such number"],
        ),
        (of(""), vec!["0 numbers are to be found, 1 to 500 can be"]),
        (of("runs = 0"), vec!["runs 1 to 100000"]),
        (of("colour = 3"), vec!["unknown field `colour`"]),
    ] {
        dir.write("order.toml", format!("scene = \"push.toml\"\n{order}\n"));
        let said = dir.run("fit order.toml -o found");
        assert_eq!(said.code, Some(1), "{order}: {}", said.err);
        for word in words.into_iter().chain(["order.toml"]) {
            assert!(
                said.err.contains(word),
                "{order}: {word:?} is not in {}",
                said.err
            );
        }
        assert!(!dir.path("found").exists(), "{order}");
    }
    let measured = PUSH.replace(
        "name = \"push\"",
        "name = \"push\"\nphysics = { law = \"measured\" }",
    );
    dir.write("push.toml", measured);
    dir.write(
        "order.toml",
        format!("scene = \"push.toml\"\n{data}\n{bounds}\n"),
    );
    let said = dir.run("fit order.toml -o found");
    assert!(
        said.err.contains("no gradients with physics.law"),
        "{}",
        said.err
    );
    assert!(!dir.path("found").exists());
}

#[cfg(unix)]
#[test]
fn a_fit_that_is_stopped_writes_the_best_by_then() {
    let dir = orders();
    let order = dir
        .text("fold.toml")
        .replace("scene =", "starts = 50\nscene =");
    dir.write("fold.toml", order);
    let mut running = dir.start("fit fold.toml -o fold --json");
    running.wait_for("run 8:");
    running.press();
    let said = running.ended();
    assert_eq!(said.code, Some(130), "{}", said.err);
    let answer: Value = serde_json::from_str(&said.out).unwrap();
    assert!(answer["directions"].is_null() && answer["searches"].as_array().unwrap().len() == 1);
    let names = ["fit.json", "motion.toml", "report.md", "run.safetensors"];
    assert_eq!(
        dir.files("fold")
            .into_iter()
            .map(|file| file.0)
            .collect::<Vec<_>>(),
        names
    );
    assert!(
        dir.text("fold/report.md")
            .contains("Interrupted: the best by then")
    );
}
