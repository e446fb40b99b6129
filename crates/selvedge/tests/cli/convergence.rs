//! `study convergence`: files and numbers of a small scene, what is kept, and calls that make no
//! sense.

use serde_json::Value;

use crate::common::{Desk, PUSH, number};

/// A study of a moment: 2 starts, 5 frames each, against 32 substeps.
const CALL: &str = "study convergence scene.toml --out c --substeps 1,2,4 --integrators linearised \
    --reference-integrator linearised --reference-substeps 32 --horizons 1,5 --starts 2 --from 16";

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("scene.toml", PUSH);
    desk
}

/// Position errors after five frames, by substeps.
fn errors(answer: &Value) -> Vec<f64> {
    let means = answer["means"].as_array().unwrap().iter();
    let last = means.filter(|mean| number(mean, "/horizon") == 5.0);
    last.map(|mean| number(mean, "/position_rmse")).collect()
}

#[test]
fn a_study_writes_its_files_and_errors_fall_with_substeps() {
    let desk = desk();
    let answer = desk.json(CALL);
    let found = errors(&answer);
    assert_eq!(found.len(), 3);
    assert!(
        found.is_sorted_by(|a, b| a > b) && found[2] > 0.0,
        "{found:?}"
    );
    assert!(number(&answer, "/times/0/ms_per_frame") > 0.0);
    assert_eq!(number(&answer, "/references_kept"), 0.0);
    assert_eq!(answer["cases"][0]["starts"], serde_json::json!([16, 25]));
    let page = String::from_utf8(desk.read("c/report.md")).unwrap();
    for text in [
        "# Convergence of the physics",
        "a run by linearised, 32 substeps",
        "| physics | k = 1 | k = 5 | ms per frame |",
        "| linearised, 4 substeps |",
        "*the reference itself, linearised, 32 substeps*",
        "![errors by substeps](substeps-5.svg)",
        "![errors by time](time-5.svg)",
        "| linearised, positions |",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    for file in ["substeps-1.svg", "time-1.svg", "times.csv"] {
        assert!(!desk.read(&format!("c/{file}")).is_empty());
    }
    // Three methods and the second reference run, in two horizons: of the case and of all.
    let lines = |file: &str| String::from_utf8(desk.read(file)).unwrap().lines().count();
    assert_eq!(lines("c/convergence.csv"), 1 + 4 * 2 * 2);
    assert_eq!(lines("c/starts.csv"), 1 + 4 * 2 * 2);
    // Again, with other rivals: the truth is kept, and what was measured is the same.
    let before = desk.read("c/starts.csv");
    let again = desk.json(&format!("{CALL} --threads 1"));
    assert_eq!(number(&again, "/references_kept"), 1.0);
    assert!(before == desk.read("c/starts.csv"));
    let second = desk.json(&CALL.replace(
        "--substeps 1,2,4 --integrators linearised",
        "--substeps 4 --integrators second-order",
    ));
    assert_eq!(number(&second, "/references_kept"), 1.0);
    assert_eq!(second["means"][0]["integrator"], "second-order");
}

#[test]
fn materials_and_motions_take_the_place_of_the_scenes_own() {
    let desk = desk();
    let answer = desk.json(
        "study convergence scene.toml --out c --material gray-interlock,11oz-black-denim \
         --motion forward --substeps 1 --reference-substeps 4 --horizons 1 --starts 1 --to 64",
    );
    let names: Vec<&str> = (0..2)
        .map(|k| answer["cases"][k]["name"].as_str().unwrap())
        .collect();
    let expected = [
        "push, gray-interlock, forward",
        "push, 11oz-black-denim, forward",
    ];
    assert_eq!(names, expected);
    let page = String::from_utf8(desk.read("c/report.md")).unwrap();
    assert!(page.contains("## Case by case"), "{page}");
}

#[test]
fn calls_that_make_no_sense_are_named_with_the_remedy() {
    let desk = desk();
    let names = desk.names();
    let wrong: [(&str, &[&str]); 7] = [
        ("--horizons 1,40", &["horizons", "40 frames", "shorter"]),
        ("--starts 0", &["--starts"]),
        ("--starts 30", &["starts", "fewer"]),
        (
            "--integrators euler",
            &["--integrators", "\"euler\"", "linearised"],
        ),
        ("--substeps 64", &["reference-substeps", "no coarser"]),
        ("--reference-substeps 33", &["reference-substeps", "even"]),
        ("--to 31", &["push: to", "30 frames"]),
    ];
    for (words, told) in wrong {
        // Shorter horizons than the default fit the half second.
        let horizons = if words.contains("horizons") {
            ""
        } else {
            "--horizons 1,5"
        };
        let call = format!("study convergence scene.toml --out c {horizons} {words}");
        desk.fails(&call, 2, told);
    }
    let call = "study convergence scene.toml --out c --horizons 1";
    desk.fails(
        &format!("{call} --material silk"),
        1,
        &["push: material", "silk"],
    );
    desk.fails(
        &format!("{call} --motion dance"),
        1,
        &["push: motion", "dance"],
    );
    desk.fails(
        "study convergence none.toml --out c",
        1,
        &["none.toml", "default"],
    );
    desk.fails("study convergence --out c", 2, &["<SCENE>"]);
    desk.fails("study --out c", 2, &["<STUDY>"]);
    assert_eq!(desk.names(), names);
}

#[cfg(unix)]
#[test]
fn an_interrupted_study_leaves_whole_files() {
    use crate::common::Running;

    let desk = desk();
    let call = CALL.replace("--reference-substeps 32", "--reference-substeps 1000");
    for words in ["sagging to rest: begun", Running::HAS_RESULTS] {
        let mut study = desk.start(&call);
        study.wait_for(words);
        study.press();
        let said = study.ended();
        assert_eq!(said.code, Some(1), "{words}: {}", said.err);
    }
    // What is there is whole: the same call goes on from it.
    assert_eq!(errors(&desk.json(&call)).len(), 3);
}
