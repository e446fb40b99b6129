//! `evaluate`: several models side by side, the same numbers for any number of threads, reports.

use crate::common::{Desk, names_in, number};
use serde_json::Value;

/// A desk with the data set `tiny` and two models that have barely learned.
fn two_models() -> Desk {
    let desk = Desk::new();
    desk.model();
    let other = crate::common::TRAINING.replace("seed = 1", "seed = 2");
    desk.write("other.toml", other);
    desk.json("train other.toml --data tiny --out other");
    desk
}

const MODELS: &str = "--model run/model.safetensors --model theirs=other/model.safetensors";

/// The report of an evaluation, without what depends on the machine.
fn report(desk: &Desk, folder: &str) -> Vec<(String, Vec<u8>)> {
    let names = names_in(&desk.path(folder)).into_iter();
    let names = names.filter(|name| !name.starts_with("times."));
    names
        .map(|name| (name.clone(), desk.read(&format!("{folder}/{name}"))))
        .collect()
}

#[test]
fn the_numbers_are_the_same_for_any_number_of_threads() {
    let desk = two_models();
    for threads in ["1", "2", "5"] {
        let call = format!("evaluate {MODELS} --data tiny --report r{threads} --threads {threads}");
        desk.json(&call);
    }
    let one = report(&desk, "r1");
    assert!(one == report(&desk, "r2") && one == report(&desk, "r5"));
    let names: Vec<&str> = one.iter().map(|(name, _)| name.as_str()).collect();
    let expected = [
        "curves.csv",
        "edge-length.svg",
        "means.csv",
        "motions.csv",
        "position.svg",
        "report.md",
        "steps.csv",
        "steps.svg",
        "time-edge-length.svg",
        "time-position.svg",
        "time-tiny-lift.svg",
    ];
    assert_eq!(names, expected);
    let page = String::from_utf8(desk.read("r1/report.md")).unwrap();
    for word in ["| run |", "| theirs |", "| rigid |", "| mirror |", "lift"] {
        assert!(page.contains(word), "{word} {page}");
    }
}

#[test]
fn two_models_stand_side_by_side_as_each_stands_alone() {
    let desk = two_models();
    let both = desk.json(&format!(
        "evaluate {MODELS} --data tiny --steps 5,1,5 --no-mirror"
    ));
    let rows = both["rows"].as_array().unwrap();
    let names: Vec<&str> = rows
        .iter()
        .map(|row| row["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["run", "theirs", "rigid", "truth"]);
    let alone = desk.json(
        "evaluate --model theirs=other/model.safetensors --data tiny --steps 1,5 --no-mirror",
    );
    assert_eq!(rows[1], alone["rows"][0]);
    let steps = |row: &Value| -> Vec<u64> {
        let horizons = row["horizons"].as_array().unwrap().iter();
        horizons.map(|h| h["steps"].as_u64().unwrap()).collect()
    };
    assert_eq!(steps(&rows[0]), [1, 5]);
    // The first step from the truth is the best that a model can do, its only frame the last.
    let one = number(&rows[0], "/horizons/0/position_rmse");
    assert_eq!(one, number(&rows[0], "/horizons/0/last_position_rmse"));
    assert!(one < number(&rows[0], "/horizons/1/position_rmse"));
    assert_eq!(both["means"][0]["motions"], 1);
    assert_eq!(both["meshes"][0]["mesh"], "square, 36 vertices, 2 handles");
}

#[test]
fn the_physics_runs_beside_the_models_with_the_substeps_asked_for() {
    let desk = two_models();
    let answer = desk.json(
        "evaluate --model run/model.safetensors --data tiny --steps 1 --no-mirror --physics 2,1,2 --report r",
    );
    let rows = answer["rows"].as_array().unwrap();
    let error = |name: &str| {
        let row = rows.iter().find(|row| row["name"] == name).unwrap();
        assert_eq!(row["failure"], Value::Null);
        number(row, "/measures/position_rmse")
    };
    let names: Vec<_> = rows.iter().filter(|row| row["who"] == "physics").collect();
    assert_eq!(names.len(), 2);
    // The truth was made with two; it starts from the same rest pose, rounded to f32.
    let (own, coarse) = (error("physics, 2 per frame"), error("physics, 1 per frame"));
    assert!(coarse > 1e-4, "{coarse}");
    assert!(own < 1e-2 * coarse, "{own} {coarse}");
    let times = String::from_utf8(desk.read("r/times.md")).unwrap();
    assert!(times.contains("](times.svg)"), "{times}");
    let plot = String::from_utf8(desk.read("r/times.svg")).unwrap();
    assert!(plot.contains("time of a frame (ms)") && plot.contains("physics"));
    desk.fails(
        "evaluate --model run/model.safetensors --data tiny --physics 0",
        2,
        &["--physics", "0"],
    );
}

#[test]
fn data_sets_that_are_called_alike_are_told_apart_by_their_folders() {
    let desk = Desk::new();
    desk.model();
    desk.json("dataset generate tiny --out a/tiny");
    let answer = desk.json(
        "evaluate --model run/model.safetensors --data a/tiny --data tiny --steps 1 --no-mirror",
    );
    let rows = answer["rows"].as_array().unwrap().iter();
    let mut names: Vec<&str> = rows.map(|row| row["data"].as_str().unwrap()).collect();
    names.dedup();
    assert_eq!(names, ["a/tiny", "tiny"]);
}

#[test]
fn calls_that_make_no_sense_are_refused() {
    let desk = two_models();
    let model = "--model run/model.safetensors";
    desk.fails(
        &format!("evaluate {model} --model a=run/model.safetensors --model a=other/model.safetensors --data tiny"),
        2,
        &["two are called a", "name"],
    );
    desk.fails(
        "evaluate --model rigid=run/model.safetensors --data tiny",
        2,
        &["rigid"],
    );
    desk.fails(
        &format!("evaluate {model} --data tiny --steps 1,61"),
        2,
        &["steps: 61 fit into no trajectory", "60 steps"],
    );
    desk.fails(
        &format!("evaluate {model} --data tiny --data ./tiny"),
        2,
        &["--data ./tiny: stands twice"],
    );
    desk.fails(
        &format!("evaluate {model} --data tiny --steps 0"),
        2,
        &["0"],
    );
    desk.fails(
        "evaluate --model gone.safetensors --data tiny --report r",
        1,
        &["gone.safetensors"],
    );
    desk.fails(
        &format!("evaluate {model} --data tiny --motions drop"),
        2,
        &["drop", "lift"],
    );
}
