//! Guarded models from the command line: `rollout --guard --trust`, `evaluate --guard`, `stress`.

use crate::common::{Desk, PUSH, PUSH_FRAMES, number};
use selvedge_data::{Trajectory, metrics};
use serde_json::Value;

/// Largest strain of each frame of a run, by the metrics of trajectories.
fn strains(run: &Trajectory) -> Vec<f64> {
    let lengths = metrics::material_edge_lengths(run.cloth());
    metrics::largest_strain(run.frames(), run.topology(), &lengths).unwrap()
}

/// The columns of a CSV file by name.
fn column(text: &str, name: &str) -> Vec<String> {
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let at = head.iter().position(|found| *found == name).unwrap();
    lines.map(|line| line[at].to_owned()).collect()
}

#[test]
fn a_rollout_says_how_far_each_frame_can_be_trusted() {
    let desk = Desk::new();
    desk.model();
    desk.write("push.toml", PUSH);
    let model = "--model run/model.safetensors --no-truth --no-clip";
    for guard in ["none", "limit", "physics", "physics-always"] {
        let call =
            format!("rollout push.toml {model} --out {guard} --guard {guard} --trust {guard}.csv");
        let report = desk.json(&call);
        let run = Trajectory::read(&desk.path(&format!("{guard}/rollout.safetensors"))).unwrap();
        let text = String::from_utf8(desk.read(&format!("{guard}.csv"))).unwrap();
        let told = column(&text, "largest_strain");
        assert_eq!(told.len(), PUSH_FRAMES);
        // The same number by two routes, both in f64 from f32 positions; material coordinates
        // alike.
        for (told, found) in told.iter().zip(&strains(&run)[1..]) {
            assert!((told.parse::<f64>().unwrap() - found).abs() < 1e-9);
        }
        let verdicts = column(&text, "verdict");
        let count = |name: &str| verdicts.iter().filter(|v| *v == name).count() as f64;
        assert_eq!(number(&report, "/guarded/corrected"), count("corrected"));
        assert_eq!(number(&report, "/guarded/lost"), count("lost"));
        // Each lost frame says what replaced it; the scene is at hand and its physics never fails.
        let replaced = column(&text, "replaced_by");
        for (verdict, replaced) in verdicts.iter().zip(&replaced) {
            let expected = match (verdict.as_str(), guard) {
                ("lost", "none") => "nothing",
                ("lost", _) => "physics",
                _ => "",
            };
            assert_eq!(replaced, expected, "{guard}");
        }
        let by_physics = replaced.iter().filter(|r| *r == "physics").count() as f64;
        assert_eq!(number(&report, "/guarded/lost_to_physics"), by_physics);
        assert!(column(&text, "physics_failed").iter().all(|f| f == "false"));
        assert_eq!(number(&report, "/guarded/frames"), PUSH_FRAMES as f64);
        assert_eq!(report["guard"], guard);
        if guard != "none" {
            // The bound of 28 % and its slack; the rest pose of this cloth strains far less.
            assert!(number(&report, "/largest_strain") < 0.2815, "{guard}");
        }
    }
    let wrong = "rollout push.toml --trust trust.txt --out other";
    desk.fails(wrong, 2, &["--trust", "csv"]);
}

#[test]
fn the_shipped_model_needs_no_guard_where_it_was_trained() {
    let desk = Desk::new();
    let mut bytes = Vec::new();
    for guard in ["none", "limit"] {
        let report = desk.json(&format!(
            "rollout --frames 3 --no-truth --no-clip --guard {guard} --out {guard}"
        ));
        assert_eq!(number(&report, "/guarded/corrected"), 0.0);
        assert_eq!(report["diverged_frame"], Value::Null);
        bytes.push(desk.read(&format!("{guard}/rollout.safetensors")));
    }
    assert!(bytes[0] == bytes[1], "bit for bit");
}

#[test]
fn guards_stand_side_by_side_in_an_evaluation() {
    let desk = Desk::new();
    desk.model();
    let report = desk.json(
        "evaluate --model run/model.safetensors --data tiny --guard none,limit,physics,limit --no-mirror --steps 1 --report r",
    );
    let rows = report["rows"].as_array().unwrap();
    let names: Vec<&str> = rows
        .iter()
        .map(|row| row["name"].as_str().unwrap())
        .collect();
    let expected = [
        "run (none)",
        "run (limit)",
        "run (physics)",
        "rigid",
        "truth",
    ];
    assert_eq!(names, expected);
    assert_eq!(rows[0]["guarded"], Value::Null);
    for row in &rows[1..3] {
        assert_eq!(number(row, "/guarded/frames"), 60.0);
        assert_eq!(row["diverged_frame"], Value::Null);
        assert!(number(row, "/measures/largest_strain") < 0.2815);
    }
    assert_eq!(report["means"][1]["diverged"], 0);
    assert_eq!(report["means"][1]["guarded"], rows[1]["guarded"]);
    let means = String::from_utf8(desk.read("r/means.csv")).unwrap();
    assert_eq!(column(&means, "runs_diverged").len(), 10);
    // Limit is what nobody asks for.
    let usual =
        desk.json("evaluate --model run/model.safetensors --data tiny --no-mirror --steps 1");
    assert_eq!(usual["rows"][0]["measures"], rows[1]["measures"]);
    assert_eq!(usual["guards"][0], "limit");
}

#[test]
fn a_test_drive_is_the_same_for_any_number_of_threads() {
    let desk = Desk::new();
    desk.model();
    desk.write("push.toml", PUSH);
    let drive = "stress push.toml --model run/model.safetensors --runs 5 --frames 40";
    let without_time = |mut report: Value| {
        report.as_object_mut().unwrap().remove("ms_per_frame");
        report
    };
    let one = without_time(desk.json(&format!("{drive} --threads 1")));
    assert_eq!(
        one,
        without_time(desk.json(&format!("{drive} --threads 3")))
    );
    assert_eq!(one["all"]["runs"], 5);
    assert_eq!(one["all"]["stable"], 5);
    assert_eq!(number(&one, "/all/guarded/frames"), 200.0);
    assert!(number(&one, "/all/strain_quantiles/5") < 0.2815);
    let other = without_time(desk.json(&format!("{drive} --seed 2")));
    assert_ne!(one["runs"], other["runs"]);
    // The first runs of a longer drive are those of a shorter one.
    let fewer = without_time(desk.json(&format!("{drive} --runs 2").replace("--runs 5 ", "")));
    assert_eq!(fewer["runs"][1], one["runs"][1]);
    let chosen = drive.replace("--runs 5", "--only 4,1,4");
    let chosen = without_time(desk.json(&chosen));
    assert_eq!(
        chosen["runs"],
        serde_json::json!([one["runs"][1], one["runs"][4]])
    );
    assert_eq!(chosen["all"]["runs"], 2);
}

#[test]
fn a_test_drive_takes_cloths_in_turn_and_writes_its_runs() {
    let desk = Desk::new();
    desk.model();
    desk.write("push.toml", PUSH);
    let report = desk.json(
        "stress push.toml --model run/model.safetensors --runs 4 --frames 20 --mesh wide,triangle --density 40 --guard none --out runs.csv",
    );
    let meshes = report["meshes"].as_array().unwrap();
    assert_eq!(meshes.len(), 2);
    assert!(meshes.iter().all(|mesh| mesh["runs"] == 2));
    assert_eq!(report["runs"][1]["mesh"], "triangle");
    let text = String::from_utf8(desk.read("runs.csv")).unwrap();
    assert_eq!(column(&text, "run"), ["0", "1", "2", "3"]);
    let strain = column(&text, "largest_strain")[2].parse::<f64>().unwrap();
    assert_eq!(strain, number(&report, "/runs/2/largest_strain"));
}

#[test]
fn physics_can_be_driven_as_a_model_is() {
    let desk = Desk::new();
    desk.write("push.toml", PUSH);
    let drive = "stress push.toml --runs 2 --frames 60 --guard none --physics";
    let [coarse, fine] = [1, 4].map(|substeps| desk.json(&format!("{drive} {substeps}")));
    assert_eq!(coarse["model"], "physics, 1 substep");
    assert_eq!(fine["model"], "physics, 4 substeps");
    assert_eq!(
        (&coarse["all"]["stable"], &fine["all"]["stable"]),
        (&2.into(), &2.into())
    );
    assert_ne!(
        coarse["runs"][0]["largest_strain"],
        fine["runs"][0]["largest_strain"]
    );
}

#[test]
fn calls_that_make_no_sense_are_refused() {
    let desk = Desk::new();
    desk.fails(
        "stress --physics 2 --model small",
        2,
        &["--physics", "--model"],
    );
    desk.fails("stress --speed 0", 2, &["above 0"]);
    desk.fails("stress --only 3 --runs 4", 2, &["--only", "--runs"]);
    desk.fails("stress --mesh sock", 2, &["\"sock\"", "triangle-17"]);
    desk.fails(
        "stress --mesh wide --density=-3",
        2,
        &["density", "positive"],
    );
    desk.fails("stress --out runs.txt", 2, &["--out", "csv"]);
    desk.fails("stress --density 40", 2, &["--mesh"]);
    desk.write(
        "drop.toml",
        PUSH.replace(
            "handles = { label = \"upper-corners\" }",
            "handles = { groups = [{ name = \"left\", select = { vertices = [0] } }, { name = \"right\", select = { vertices = [5] }, released = [{ from = 0.2 }] }] }",
        ),
    );
    desk.fails("stress drop.toml", 2, &["drop.toml", "handles go"]);
}
