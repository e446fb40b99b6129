//! A report says the numbers of its runs and nothing else.

use super::*;
use crate::evaluation::{Errors, FrameErrors, Kind, Timing};

/// A frame of which all measures are multiples of `size` `[m]`.
fn at(frame: usize, size: f64) -> FrameErrors {
    FrameErrors {
        frame,
        largest_strain: 0.1,
        errors: Some(Errors {
            position_rmse: size,
            mean_vertex_error: 0.5 * size,
            largest_vertex_error: 2.0 * size,
            relative_error: size,
            edge_length_rmse: 0.01 * size,
            fold_rmse: size,
            folds: 0.5,
            true_folds: 1.0,
            true_largest_strain: 0.05,
        }),
    }
}

fn kind(method: &str) -> Kind {
    if method.starts_with("physics") { Kind::Physics } else { Kind::Model }
}

fn run(method: &str, case: &str, start: usize, is_whole: bool, size: f64) -> Run {
    Run {
        set: "d".to_owned(),
        case: case.to_owned(),
        mesh: "square, 4 vertices".to_owned(),
        method: method.to_owned(),
        kind: kind(method),
        start,
        is_whole,
        frame_rate: 2.0,
        frames: if is_whole { vec![at(1, size), at(2, size)] } else { vec![at(1, 0.1 * size)] },
        diverged_frame: None,
        final_speed: None,
        guarded: None,
        character: None,
        out_of_distribution: Vec::new(),
        failure: None,
    }
}

fn evaluation() -> Evaluation {
    let mut failed = run("b|c", "m2", 0, true, 0.01);
    failed.frames.pop();
    failed.diverged_frame = Some(2);
    failed.failure = Some("frame 2, \"all\" is lost".to_owned());
    let mut runs = Vec::new();
    for (method, sizes) in [
        ("a, old", [0.01, 0.03]),
        ("physics, 1 substep", [0.04, 0.04]),
        ("physics, 2 substeps", [0.01, 0.01]),
    ] {
        for (case, size) in ["m1", "m2"].into_iter().zip(sizes) {
            runs.push(run(method, case, 0, false, size));
            runs.push(run(method, case, 0, true, size));
        }
    }
    runs.extend([run("b|c", "m1", 0, true, 0.01), failed]);
    let timing = |method: &str, ms_per_frame| Timing {
        mesh: "square, 4 vertices".to_owned(),
        method: method.to_owned(),
        kind: kind(method),
        ms_per_frame,
    };
    let timings = vec![
        timing("a, old", 1.0),
        timing("physics, 1 substep", 4.0),
        timing("physics, 2 substeps", 16.0),
    ];
    Evaluation { runs, timings }
}

/// The files of the report by name.
fn report() -> std::collections::BTreeMap<String, String> {
    let heading = Heading {
        title: "T".to_owned(),
        note: "N".to_owned(),
        ..Heading::default()
    };
    let files = files(&heading, &evaluation()).into_iter();
    let texts = files.map(|(name, bytes)| (name.to_owned(), String::from_utf8(bytes).unwrap()));
    texts.collect()
}

#[test]
fn tables_have_the_means_and_no_mean_where_one_failed() {
    let page = &report()["report.md"];
    for line in [
        "# T\n\nN\n\nMeasured on d (2 cases).\n",
        // Means of 1 and 3 mm from true states, of 10 and 30 mm over whole runs.
        "| position RMSE (mm) | k = 1 | whole runs |",
        "| a, old | 2.00 | 20.0 |",
        "| b\\|c | – | – |",
        "| a, old | 20.0 | 10.0 | 60.0 | 2.00 | 0.200 | 0.500 | 10.0 % | 5.0 % | – | 2 | 0 | – | – |",
        "| b\\|c | failed |",
        "| d: m1 | 10.0 / 0.100 | 40.0 / 0.400 | 10.0 / 0.100 | 10.0 / 0.100 |",
        "| d: m2 | 30.0 / 0.300 | 40.0 / 0.400 | 10.0 / 0.100 | – |",
        "- b|c, m2, whole run: frame 2, \"all\" is lost",
    ] {
        assert!(page.contains(line), "{line}\n{page}");
    }
    assert!(!page.contains("Mesh by mesh"));
}

#[test]
fn the_time_of_physics_at_equal_error_stands_beside_the_times() {
    let files = report();
    let times = &files["times.md"];
    // 2 mm is the geometric mean of 4 and 1 mm, and 8 ms that of 4 and 16 ms.
    assert!(times.contains("| a, old | 8.00 |"), "{times}");
    assert!(files["times.csv"].contains("\"a, old\",\"square, 4 vertices\",1\n"));
}

#[test]
fn every_row_has_all_fields_and_they_are_quoted_where_they_must_be() {
    let text = &report()["errors.csv"];
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let head = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(|row| row.unwrap()).collect();
    // Two whole runs of two frames and two starts of one for each of three methods; 2 + 1 more.
    assert_eq!(rows.len(), 3 * 6 + 3);
    let column = |name: &str| head.iter().position(|own| own == name).unwrap();
    let last = rows.last().unwrap();
    assert_eq!(&last[column("failure")], "frame 2, \"all\" is lost");
    assert_eq!(&last[column("diverged_frame")], "2");
    assert_eq!(&rows[0][column("position_rmse")], "0.001");
    assert_eq!(&rows[0][column("whole")], "false");
}
