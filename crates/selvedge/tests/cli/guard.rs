//! Guarded models from the command line: `run --guard --trust`.

use crate::common::{PUSH, PUSH_FRAMES, TestFolder, number};
use selvedge_data::{Trajectory, metrics};
use serde_json::Value;

/// Largest strain of each frame of a run, by the metrics of trajectories.
fn strains(run: &Trajectory) -> Vec<f64> {
    let lengths = run.cloth().pattern().edge_lengths();
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
    let dir = TestFolder::with_push();
    dir.model();
    let model = "--model run/model.safetensors --no-clip";
    for guard in ["none", "limit"] {
        let call = format!("run push.toml {model} -o {guard} --guard {guard} --trust {guard}.csv");
        let report = dir.json(&call);
        let run = dir.trajectory(&format!("{guard}/rollout.safetensors"));
        let text = dir.text(&format!("{guard}.csv"));
        let reported = column(&text, "largest_strain");
        assert_eq!(reported.len(), PUSH_FRAMES);
        // The same number by two routes, both in f64 from f32 positions; material coordinates
        // alike.
        for (reported, found) in reported.iter().zip(&strains(&run)[1..]) {
            assert!((reported.parse::<f64>().unwrap() - found).abs() < 1e-9);
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
        let beyond = count("corrected") + count("lost");
        let doubted = beyond > 0.03 * PUSH_FRAMES as f64;
        let words = format!("{beyond} of {PUSH_FRAMES} frames");
        let doubt = report["doubt"].as_str();
        assert_eq!(doubt.is_some_and(|doubt| doubt.contains(&words)), doubted);
        assert_eq!(report["guard"], guard);
        if guard != "none" {
            // The bound of 28 % and its slack; the rest pose of this cloth strains far less.
            assert!(number(&report, "/largest_strain") < 0.2815, "{guard}");
        }
    }
    let wrong = "run --model paper --compare push.toml --trust trust.txt -o other";
    dir.refuses(&format!("2 | {wrong} | --trust | csv"));
}

#[test]
fn the_shipped_model_needs_no_guard_where_it_was_trained() {
    let dir = TestFolder::new();
    let mut bytes = Vec::new();
    for guard in ["none", "limit"] {
        let report = dir.json(&format!(
            "run --model paper --frames 3 --no-clip --guard {guard} -o {guard}"
        ));
        assert_eq!(number(&report, "/guarded/corrected"), 0.0);
        assert_eq!(report["diverged_frame"], Value::Null);
        assert_eq!(report["doubt"], Value::Null);
        bytes.push(dir.read(&format!("{guard}/rollout.safetensors")));
    }
    assert!(bytes[0] == bytes[1], "bit for bit");
}

/// How far a cloth strains in so fast a motion only the solver knows.
#[test]
fn without_a_truth_that_a_run_diverges_is_a_suspicion() {
    let dir = TestFolder::new();
    dir.write(
        "fast.toml",
        PUSH.replace("distance = 0.2", "distance = 2.0"),
    );
    let by = "run fast.toml --model paper --guard none --no-clip";
    let alone = dir.run(&format!("{by} -o alone"));
    assert!(alone.out.contains("may diverge"), "{}", alone.out);
    assert!(alone.out.contains("--compare"), "{}", alone.out);
    let alone = dir.json(&format!("{by} -o alone"));
    assert_eq!(alone["diverged_frame"], Value::Null);
    let suspected = number(&alone, "/suspected_frame");
    assert!(suspected > 0.0);
    let compared = dir.json(&format!("{by} --compare -o compared"));
    assert_eq!(compared["suspected_frame"], Value::Null);
    assert!(number(&compared, "/diverged_frame") >= suspected);
}

/// There is no rigid body to compare with once a handle has let go.
#[test]
fn a_model_whose_handles_let_go_is_compared_with_its_truth() {
    let dir = TestFolder::new();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fronts/let-go.toml");
    let report = dir.json(&format!(
        "run {scene} --model paper --compare --frames 20 --no-clip -o out"
    ));
    assert!(number(&report, "/comparison/position_rmse") > 0.0);
    assert_eq!(report["rigid_rmse"], Value::Null);
}
