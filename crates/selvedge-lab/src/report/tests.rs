//! A report says the numbers of its rows and nothing else.

use super::*;
use crate::evaluation::{Curves, Horizon, Measures, Timing};

/// A run of which all measures are multiples of `size` `[m]`.
fn row(name: &str, who: Who, motion: &str, size: f64) -> Row {
    Row {
        data: "d".to_owned(),
        mesh: "square, 4 vertices".to_owned(),
        motion: motion.to_owned(),
        name: name.to_owned(),
        who,
        frame_rate: 2.0,
        measures: Some(Measures {
            position_rmse: size,
            mean_vertex_error: 0.5 * size,
            largest_vertex_error: 2.0 * size,
            relative_error: size,
            edge_length_rmse: 0.01 * size,
            largest_strain: 0.1,
            final_speed: size,
        }),
        unstable_frame: None,
        diverged_frame: None,
        guarded: None,
        horizons: vec![Horizon {
            steps: 1,
            position_rmse: 0.1 * size,
            last_position_rmse: 0.1 * size,
            edge_length_rmse: 0.0,
        }],
        character: None,
        beyond: Vec::new(),
        failure: None,
        curves: Curves {
            position_rmse: vec![0.0, size, 2.0 * size],
            edge_length_rmse: vec![0.0; 3],
            largest_strain: vec![0.0; 3],
        },
    }
}

fn rows() -> Vec<Row> {
    let mut failed = row("b|c", Who::Model, "m2", 0.01);
    failed.measures = None;
    failed.unstable_frame = Some(2);
    failed.failure = Some("frame 2, all is lost".to_owned());
    vec![
        row("a, old", Who::Model, "m1", 0.01),
        row("b|c", Who::Model, "m1", 0.01),
        row("truth", Who::Truth, "m1", 0.0),
        row("a, old", Who::Model, "m2", 0.03),
        failed,
        row("truth", Who::Truth, "m2", 0.0),
    ]
}

#[test]
fn tables_have_the_means_and_no_mean_where_one_failed() {
    let rows = rows();
    let contest = Contest::of(&rows);
    let table = summary_table(&contest);
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 5);
    // Means of 10 and 30 mm.
    assert!(
        lines[2].starts_with("| a, old | 20.0 | 10.0 | 40.0 | 2.00 | 0.200 |"),
        "{table}"
    );
    assert!(lines[2].contains("| 2 of 2 |"));
    assert!(lines[3].starts_with("| b\\|c | failed |"), "{table}");
    assert!(lines[3].contains("| 1 of 2 | 2 |"));
    assert!(ablation_table(&contest).contains("| a, old | 2.00 | 2.00 |"));
    assert!(horizon_table(&contest).contains("| a, old | 2.00 | 20.0 |"));
    let motions = motion_table(&contest);
    assert!(
        motions.contains("| m1 | 10.0 / 0.100 | 10.0 / 0.100 | 0.000 / 0.000 |"),
        "{motions}"
    );
    assert!(
        motions.contains("| m2 | 30.0 / 0.300 | failed |"),
        "{motions}"
    );
    assert_eq!(mesh_table(&contest), None);
    assert_eq!(failures(&contest), "- b|c, m2: frame 2, all is lost\n");
}

#[test]
fn csv_fields_are_quoted_where_they_must_be_and_every_line_has_all() {
    let rows = rows();
    let contest = Contest::of(&rows);
    let motions = csv::motions_csv(&contest);
    let lines: Vec<&str> = motions.lines().collect();
    assert_eq!(lines.len(), 7);
    assert!(lines[1].starts_with("\"a, old\",d,\"square, 4 vertices\",m1,,0.01,0.005,"));
    assert!(
        lines
            .iter()
            .any(|line| line.ends_with(",\"frame 2, all is lost\""))
    );
    let curves = curves_csv(&contest);
    assert!(
        curves.contains("\"a, old\",d,m2,2,1,0.06,0,0\n"),
        "{curves}"
    );
    assert!(!curves.contains("truth"));
    for text in [
        motions,
        curves,
        csv::means_csv(&contest),
        csv::steps_csv(&contest),
    ] {
        let fields = |line: &str| {
            // Commas within quotes are no separators.
            let outside = line.split('"').step_by(2);
            outside.map(|part| part.matches(',').count()).sum::<usize>()
        };
        let expected = fields(text.lines().next().unwrap());
        assert!(text.lines().all(|line| fields(line) == expected), "{text}");
    }
}

#[test]
fn plots_show_everyone_but_the_truth() {
    let rows = rows();
    let contest = Contest::of(&rows);
    let svg = over_time(&contest, Measure::Position, None)
        .unwrap()
        .unwrap();
    assert!(svg.contains("a, old") && svg.contains("b|c") && !svg.contains("truth"));
    let one = over_time(&contest, Measure::Position, Some(("d", "m1"))).unwrap();
    assert!(one.unwrap().contains("m1"));
    assert!(
        over_time(&contest, Measure::Position, Some(("d", "m3")))
            .unwrap()
            .is_none()
    );
    let plot = bars(&contest, Measure::EdgeLength).unwrap().unwrap();
    assert!(plot.contains("failed") && plot.contains("<svg"));
    let plot = horizons_plot(&contest).unwrap().unwrap();
    assert!(plot.contains("steps k") && plot.contains("<svg"));
}

#[test]
fn errors_by_cost_need_the_physics_and_a_time() {
    let time = |name: &str, who, ms_per_frame| Timing {
        mesh: "square".to_owned(),
        name: name.to_owned(),
        who,
        ms_per_frame,
    };
    let mut rows = rows();
    let model = time("a, old", Who::Model, 3.0);
    let alone = by_cost(&Contest::of(&rows), std::slice::from_ref(&model));
    assert!(alone.unwrap().is_none());
    rows.push(row("physics, 2 per frame", Who::Physics, "m1", 0.02));
    let contest = Contest::of(&rows);
    assert!(by_cost(&contest, &[]).unwrap().is_none());
    let physics = time("physics, 2 per frame", Who::Physics, 1.0);
    let plot = by_cost(&contest, &[model, physics]).unwrap().unwrap();
    // The one that failed has no error, and the truth none that is worth a point.
    assert!(plot.contains("a, old") && plot.contains("physics"));
    assert!(!plot.contains("b|c") && !plot.contains("truth"));
}

/// Writes the report of `rows` into `folder`, and says where its files are.
fn write_report(rows: &[Row], folder: &Path) -> Vec<PathBuf> {
    let contest = Contest::of(rows);
    let heading = Heading {
        title: "t",
        note: "",
        models: Vec::new(),
    };
    let page = evaluation_page(heading, &contest).unwrap();
    let report = page.finish(&contest, &[]).unwrap();
    report.write(folder).unwrap()
}

/// The files that the page in `folder` links to.
fn links(folder: &Path) -> Vec<String> {
    let page = std::fs::read_to_string(folder.join("report.md")).unwrap();
    let links = page.split("](").skip(1);
    links
        .map(|link| link.split(')').next().unwrap().to_owned())
        .collect()
}

#[test]
fn a_report_of_the_same_rows_has_the_same_bytes() {
    let rows = rows();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let files = write_report(&rows, &folder.path().join(name));
        assert_eq!(files.last().unwrap().file_name().unwrap(), "report.md");
        files
            .iter()
            .map(|file| std::fs::read(file).unwrap())
            .collect::<Vec<_>>()
    };
    assert_eq!(write("one"), write("two"));
    let one = folder.path().join("one");
    for file in links(&one) {
        assert!(one.join(&file).is_file(), "{file}");
    }
}

#[test]
fn plots_whose_names_come_out_alike_have_files_of_their_own() {
    let rows = ["to and", "to-and", "To.and"].map(|motion| row("a", Who::Model, motion, 0.01));
    let folder = tempfile::tempdir().unwrap();
    write_report(&rows, folder.path());
    let links = links(folder.path());
    let own = [
        "time-d-to-and.svg",
        "time-d-to-and-2.svg",
        "time-d-To-and-3.svg",
    ];
    for file in own.map(str::to_owned) {
        assert!(links.contains(&file), "{file}: {links:?}");
        assert!(folder.path().join(&file).is_file(), "{file}");
    }
}
