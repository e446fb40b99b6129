//! Studies of a small scene from its start to its report.

use std::ops::ControlFlow;
use std::path::Path;

use selvedge_model::Instructions;

use super::*;
use crate::event::Event;

/// A square of 16 vertices that is pushed for a third of a second.
const PUSH: &str = r#"
name = "push"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 16, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }

[motion.inline]
kind = "blocks"
blocks = [{ duration = 0.35, translations = [{ direction = [1.0, 0.0, 0.5], pace = { distance = 0.1 } }] }]
"#;

fn plan(threads: usize) -> Plan {
    let scene = selvedge_data::parse_scene(PUSH, Path::new(""), "push").unwrap();
    let linearised = ["linearised".parse().unwrap()];
    let settings = Settings {
        rivals: Method::all(&linearised, &[1, 2, 4]),
        reference: Method::all(&linearised, &[64]).remove(0),
        horizons: vec![1, 5],
        starts: 3,
        from: Some(6),
        to: None,
        whole: true,
        threads: Some(threads),
    };
    Plan::new(Case::all(&[scene], &[], &[]).unwrap(), settings).unwrap()
}

fn study(plan: &Plan, folder: &Path) -> Outcome {
    run(plan, folder, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The runs without the times.
fn runs(outcome: &Outcome) -> Vec<CaseOutcome> {
    let mut cases = outcome.cases.clone();
    for series in cases.iter_mut().flat_map(|case| &mut case.rivals) {
        assert!(series.ms_per_frame.take().is_some_and(|time| time > 0.0));
    }
    cases
}

#[test]
fn errors_fall_with_substeps_and_are_those_of_first_order() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = study(&plan(1), folder.path());
    assert_eq!((outcome.kept, outcome.end), (0, End::Complete));
    assert_eq!(outcome.cases[0].starts, [6, 11, 16]);
    let error = |rival| outcome.mean(rival, 1).unwrap().position_rmse;
    let errors = [0, 1, 2].map(error);
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    // Errors c (h - h₀) of first order, h₀ the reference's step. The next terms are of the size of
    // h in parts of the first: at most a quarter for steps of a quarter and of half a frame.
    let ratio = errors[1] / errors[2];
    let expected = (1.0 / 2.0 - 1.0 / 64.0) / (1.0 / 4.0 - 1.0 / 64.0);
    assert!((ratio / expected - 1.0).abs() < 0.25, "{ratio} {expected}");
    // The reference's own error by Richardson is that of the same law: c h₀.
    let own = order::richardson(outcome.half(1).unwrap().position_rmse, 1);
    let law = errors[2] / (1.0 / 4.0 - 1.0 / 64.0) / 64.0;
    assert!((own / law - 1.0).abs() < 0.25, "{own} {law}");
    // Over whole runs as well: the motion is too gentle for folds that fall the other way.
    let whole = |rival| outcome.whole(rival).unwrap();
    let errors = [0, 1, 2].map(|rival| whole(rival).position_rmse);
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    let folds = whole(2).fold_ratio().unwrap();
    assert!((folds - 1.0).abs() < 0.1, "{folds}");
    let page = report(&outcome).unwrap();
    assert!(page.write(folder.path()).unwrap().len() > 6);
    for plot in ["whole.svg", "folds.svg", "whole-folds.svg"] {
        assert!(folder.path().join(plot).exists(), "{plot}");
    }
}

#[test]
fn a_whole_run_is_the_mean_of_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = plan(1);
    plan.settings.horizons = (1..=21).collect();
    plan.settings.from = None;
    plan.cases[0].1.starts = vec![0];
    plan.settings.starts = 1;
    let outcome = study(&plan, folder.path());
    let run = &outcome.cases[0].rivals[0].runs[0];
    let squares = run.deviations.iter().map(|d| d.position_rmse.powi(2));
    let mean = (squares.sum::<f64>() / 21.0).sqrt();
    let folds = run.deviations.iter().map(|d| d.folds).sum::<f64>() / 21.0;
    let whole = outcome.whole(0).unwrap();
    assert!((whole.position_rmse / mean - 1.0).abs() < 1e-12);
    assert!((whole.folds / folds - 1.0).abs() < 1e-12);
    let last = run.deviations.last().unwrap();
    assert_eq!(whole.largest_strain, last.largest_strain);
}

#[test]
fn threads_and_a_kept_reference_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let first = study(&plan(1), folder.path());
    let again = study(&plan(3), folder.path());
    assert_eq!((first.kept, again.kept), (0, 1));
    assert_eq!(runs(&first), runs(&again));
    // A reference that this program does not make is made again.
    let file = std::fs::read_dir(folder.path()).unwrap().next().unwrap();
    let path = file.unwrap().path();
    let bytes = std::fs::read(&path).unwrap();
    let mut other = selvedge_data::StateRun::from_bytes(&bytes).unwrap();
    let vertices = other.states[0].positions.len();
    other.states[20 / vertices].positions[20 % vertices].x += 1e-9;
    let provenance = selvedge_data::Provenance {
        frame_rate: 60.0,
        scene: serde_json::Value::Null,
        made_by: String::new(),
    };
    other.write(&path, &provenance).unwrap();
    let third = study(&plan(1), folder.path());
    assert_eq!(third.kept, 0);
    assert_eq!(runs(&first), runs(&third));
    assert!(bytes == std::fs::read(&path).unwrap());
}

#[test]
fn an_end_that_is_asked_for_leaves_the_starts_that_are_done() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(1);
    // The reference, and the runs of two starts.
    let enough = 21 * 64 + 2 * 5 * (32 + 1 + 2 + 4);
    let mut substeps = 0;
    let mut is_running = false;
    let outcome = run(&plan, folder.path(), &mut |event| {
        if let Event::Begun { task, .. } = event {
            is_running = task.starts_with("running");
        }
        substeps += usize::from(is_running && event == Event::Advanced);
        match substeps > enough {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    });
    let outcome = outcome.unwrap();
    assert_eq!(outcome.end, End::Interrupted);
    assert_eq!(outcome.cases[0].starts, [6, 11]);
    assert!(outcome.mean(2, 1).is_some() && outcome.ms_per_frame(0).is_none());
    report(&outcome).unwrap();
    // The reference is there.
    assert_eq!(study(&plan, folder.path()).kept, 1);
}

#[test]
fn a_rival_that_fails_has_no_mean_and_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut outcome = study(&plan(1), folder.path());
    let broken = &mut outcome.cases[0].rivals[1].runs[2];
    broken.deviations.truncate(1);
    broken.failure = Some("the cloth flew away".to_owned());
    assert!(outcome.mean(1, 0).is_some() && outcome.mean(1, 1).is_none());
    report(&outcome).unwrap().write(folder.path()).unwrap();
    let page = std::fs::read_to_string(folder.path().join("report.md")).unwrap();
    for text in [
        "push, linearised, 2 substeps, from frame 16: the cloth flew away",
        "| failed |",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
}

#[test]
fn a_model_is_a_series_of_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = plan(1);
    let model = crate::teaching::tests::model();
    let mine = Method::of_model("mine".to_owned(), model, Instructions::default());
    let physics = vec![plan.settings.rivals[0].clone()];
    plan.settings.rivals = Method::with_models(physics, vec![mine]);
    let outcome = study(&plan, folder.path());
    assert_eq!(outcome.end, End::Complete);
    let names: Vec<String> = outcome.cases[0]
        .rivals
        .iter()
        .map(|series| series.method.to_string())
        .collect();
    // What it corrects, and that with a substep more, are measured with it.
    let expected = [
        "linearised, 1 substep",
        "second-order, 1 substep",
        "second-order, 2 substeps",
        "mine, 1 substep",
    ];
    assert_eq!(names, expected);
    let own = outcome.mean(3, 1).unwrap().position_rmse;
    assert!(own > 0.0 && own < 0.05, "{own}");
    assert_ne!(own, outcome.mean(1, 1).unwrap().position_rmse);
    let familiar = outcome.cases[0].rivals[3].familiar().unwrap();
    assert!((0.0..=1.0).contains(&familiar), "{familiar}");
    assert_eq!(outcome.cases[0].rivals[0].familiar(), None);
    let page = report(&outcome).unwrap();
    page.write(folder.path()).unwrap();
    let page = std::fs::read_to_string(folder.path().join("report.md")).unwrap();
    for text in [
        "| mine, 1 substep |",
        "mine, 1 substep / second-order, 1 substep / second-order, 2 substeps:",
        "| push | 16 | unknown |",
        "| *all* |",
        "| *times the physics alone* |",
        "| times nearer |",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
}

#[test]
fn the_scenes_elsewhere_can_be_studied_as_the_guide_says() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/elsewhere");
    let files = std::fs::read_dir(folder).unwrap();
    let opened = files.map(|file| {
        let path = file.unwrap().path();
        selvedge_data::open_scene(path.to_str().unwrap()).unwrap()
    });
    let opened: Vec<_> = opened.collect();
    let settings = Settings {
        horizons: vec![1, 10, 50],
        starts: 10,
        from: Some(70),
        to: Some(370),
        ..plan(1).settings
    };
    let plan = Plan::new(Case::all(&opened, &[], &[]).unwrap(), settings).unwrap();
    let vertices = |(case, _): &(Case, _)| case.scene().mesh.positions().len();
    let sizes: Vec<usize> = plan.cases.iter().map(vertices).collect();
    let (least, most) = (sizes.iter().min(), sizes.iter().max());
    assert_eq!((least, most), (Some(&100), Some(&4096)));
    assert!(plan.cases.len() > 20, "{}", plan.cases.len());
}
