//! Evaluations of a small scene: against its converged physics, and along a recorded run of it.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use selvedge_data::{LoadedScene, StateRun, parse_scene};
use selvedge_guard::Correction;
use selvedge_model::{Encoder, Model, ModelSpec, Network, Normalizer, Normalizers};

use super::*;
use crate::event::Event;
use crate::machine::Machine;

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

fn push() -> LoadedScene {
    parse_scene(PUSH, Path::new(""), "push").unwrap()
}

fn linearised(substeps: u32) -> PhysicsMethod {
    format!("linearised:{substeps}").parse().unwrap()
}

fn cases() -> Vec<Case> {
    Case::converged(&[push()], &[], &[], &linearised(64)).unwrap()
}

fn methods() -> Vec<Method> {
    [1, 2, 4].map(|n| Method::physics(linearised(n))).to_vec()
}

/// A network without acceleration: vertices go on as they went.
fn model() -> Method {
    let spec = ModelSpec::physical(Encoder::MLP, 8, 1);
    let network = Network::new(&spec).unwrap();
    let weights = network.initialise(&mut || 0.5);
    let even = |width| Normalizer::new(vec![0.0; width], vec![1.0; width]).unwrap();
    let normalizers = Normalizers {
        nodes: even(spec.node_width()),
        edges: even(spec.edge_width()),
        acceleration: even(3),
    };
    let model = Model::new(&spec, weights, normalizers, String::new()).unwrap();
    let guard = Correction::None;
    Method {
        name: "mine".to_owned(),
        mover: Mover::Model(Arc::new(model), guard, Machine::Cpu),
    }
}

fn horizons() -> Horizons {
    Horizons {
        from: Some(6),
        ..Horizons::new([5, 1, 5], 3)
    }
}

fn plan<'a>(
    cases: &'a [Case],
    methods: &'a [Method],
    horizons: &'a Horizons,
    folder: &Path,
) -> EvaluationPlan<'a> {
    EvaluationPlan {
        cases,
        methods,
        horizons,
        references: Some(folder.to_owned()),
        threads: Some(1),
    }
}

fn complete(plan: &EvaluationPlan<'_>) -> Evaluation {
    let (found, end) = evaluate(plan, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(end, End::Complete);
    found
}

fn summed(found: &Evaluation) -> Vec<Summary> {
    summaries(&found.runs.iter().collect::<Vec<_>>())
}

fn position(at: FrameErrors) -> f64 {
    at.errors.unwrap().position_rmse
}

#[test]
fn starts_are_spread_from_the_first_frame_to_the_last_that_leaves_room() {
    let case = &cases()[0];
    let on = |change: fn(&mut Horizons)| {
        let mut horizons = Horizons::new([1, 5, 500], 3);
        change(&mut horizons);
        horizons.on(case).map(|on| (on.starts, on.frames, on.span))
    };
    let whole = on(|_| {}).unwrap();
    assert_eq!(whole, (vec![0, 8, 16], vec![1, 5], [0, 21]));
    let part = on(|h| (h.from, h.to) = (Some(4), Some(10))).unwrap();
    assert_eq!(part, (vec![4, 5], vec![1, 5], [0, 10]));
    // One start is in the middle.
    assert_eq!(on(|h| h.starts = 1).unwrap().0, [8]);
    let error = on(|h| h.to = Some(22)).unwrap_err().to_string();
    assert!(
        error.contains("push: to: the motion has 21 frames"),
        "{error}"
    );
}

#[test]
fn errors_fall_with_substeps_and_are_those_of_first_order() {
    let folder = tempfile::tempdir().unwrap();
    let (cases, methods, horizons) = (cases(), methods(), horizons());
    let found = complete(&plan(&cases, &methods, &horizons, folder.path()));
    let mut starts: Vec<usize> = found.runs.iter().map(|run| run.start).collect();
    starts.dedup();
    assert_eq!(starts, [6, 11, 16, 0]);
    let summaries = summed(&found);
    let errors: Vec<f64> = summaries.iter().map(|s| position(s.after[1])).collect();
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    // Errors c (h - h₀) of first order, h₀ the reference's step. The next terms are of the size of
    // h in parts of the first: at most a quarter for steps of a quarter and of half a frame.
    let ratio = errors[1] / errors[2];
    let expected = (1.0 / 2.0 - 1.0 / 64.0) / (1.0 / 4.0 - 1.0 / 64.0);
    assert!((ratio / expected - 1.0).abs() < 0.25, "{ratio} {expected}");
    // The reference's own error by Richardson is that of the same law: c h₀.
    let own = own_errors(&found.runs, 1)[1];
    let law = errors[2] / (1.0 / 4.0 - 1.0 / 64.0) / 64.0;
    assert_eq!(own.0, 5);
    assert!((own.1 / law - 1.0).abs() < 0.25, "{own:?} {law}");
    // Over whole runs as well: the motion is too gentle for another buckling mode.
    let whole: Vec<FrameErrors> = summaries.iter().map(|s| s.whole.unwrap()).collect();
    assert!(position(whole[0]) > position(whole[1]) && position(whole[1]) > position(whole[2]));
    // Two and four substeps end as fast as each other.
    let speeds: Vec<f64> = summaries.iter().map(|s| s.final_speed.unwrap()).collect();
    assert!(
        speeds[2] > 0.0 && (speeds[1] / speeds[2] - 1.0).abs() < 0.25,
        "{speeds:?}"
    );
    let folds = whole[2].errors.unwrap().fold_ratio().unwrap();
    assert!((folds - 1.0).abs() < 0.1, "{folds}");
    assert!(found.timings.iter().all(|timing| timing.ms_per_frame > 0.0));
    assert_eq!(found.timings.len(), 3);
}

/// A handle that takes hold again does so of the cloth where that is, in whole runs and from true states.
#[test]
fn a_handle_that_takes_hold_again_starts_where_the_cloth_is() {
    let groups = r#"
[[handles.groups]]
name = "first"
select = { vertices = [0] }
released = [{ from = 0.05, to = 0.1 }]
[[handles.groups]]
name = "last"
select = { vertices = [3] }
"#;
    let scene = PUSH.replace("handles = { label = \"upper-corners\" }\n", groups);
    let scene = parse_scene(&scene, Path::new(""), "let-go").unwrap();
    let cases = Case::converged(&[scene], &[], &[], &linearised(64)).unwrap();
    let methods = [Method::physics(linearised(32)), model()];
    let folder = tempfile::tempdir().unwrap();
    let horizons = horizons();
    let found = complete(&plan(&cases, &methods, &horizons, folder.path()));
    let summaries = summed(&found);
    let whole = position(summaries[0].whole.unwrap());
    assert!(whole < 5e-3, "{whole} m");
    for summary in &summaries {
        let after_one = position(summary.after[0]);
        assert!(after_one < 5e-3, "{}: {after_one} m", summary.method);
    }
}

#[test]
fn threads_and_a_kept_reference_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (cases, methods, horizons) = (cases(), methods(), horizons());
    let mut plan = plan(&cases, &methods, &horizons, folder.path());
    let first = complete(&plan);
    plan.threads = Some(3);
    assert_eq!(complete(&plan).runs, first.runs);
    // A reference that this program does not make is made again.
    let file = std::fs::read_dir(folder.path()).unwrap().next().unwrap();
    let path = file.unwrap().path();
    let bytes = std::fs::read(&path).unwrap();
    let mut other = StateRun::from_bytes(&bytes).unwrap();
    other.states[1].positions[2].x += 1e-9;
    let provenance = selvedge_data::Provenance {
        frame_rate: 60.0,
        scene: serde_json::Value::Null,
        made_by: String::new(),
    };
    other.write(&path, &provenance).unwrap();
    assert_eq!(complete(&plan).runs, first.runs);
    assert!(bytes == std::fs::read(&path).unwrap());
}

#[test]
fn an_end_that_is_asked_for_leaves_the_starts_that_are_done() {
    let folder = tempfile::tempdir().unwrap();
    let (cases, methods, horizons) = (cases(), methods(), horizons());
    let plan = plan(&cases, &methods, &horizons, folder.path());
    // The reference, and the runs of two starts.
    let enough = 21 + 2 * 5 * 4;
    let mut frames = 0;
    let mut is_running = false;
    let stopped = evaluate(&plan, &mut |event| {
        if let Event::Begun { task, .. } = event {
            is_running = task == "evaluating";
        }
        frames += usize::from(is_running && event == Event::Advanced);
        if frames > enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let (found, end) = stopped.unwrap();
    assert_eq!(end, End::Interrupted);
    let starts: Vec<usize> = found.runs.iter().map(|run| run.start).collect();
    assert_eq!(starts, [6, 6, 6, 6, 11, 11, 11, 11]);
    assert!(found.timings.is_empty());
}

#[test]
fn models_and_baselines_run_beside_physics_from_the_same_states() {
    let folder = tempfile::tempdir().unwrap();
    let methods = [
        Method::physics(linearised(1)),
        model(),
        Method::baseline("rigid").unwrap(),
    ];
    let (cases, horizons) = (cases(), horizons());
    let found = complete(&plan(&cases, &methods, &horizons, folder.path()));
    for run in &found.runs {
        assert_eq!(run.failure, None, "{}", run.method);
    }
    let summaries = summed(&found);
    let names: Vec<&str> = summaries.iter().map(|s| s.method.as_str()).collect();
    let expected = [
        "linearised, 1 substep",
        "mine",
        "rigid",
        "linearised, 32 substeps",
    ];
    assert_eq!(names, expected);
    let own = position(summaries[1].after[1]);
    assert!(own > 0.0 && own < 0.05, "{own}");
    assert!(summaries[1].ratios.is_some());
}

#[test]
fn a_recorded_run_of_a_method_is_followed_by_the_same_method() {
    let loaded = push();
    let mut run = selvedge::Run::new(&loaded.clone().into()).unwrap();
    let positions = run.record(12, &mut |_| ControlFlow::Continue(())).positions;
    let trajectory = run.trajectory(positions).unwrap();
    let truth = truth::recorded(trajectory.clone(), true).unwrap();
    // Velocities are those between frames.
    let state = truth.state(3).unwrap();
    let rate = trajectory.frame_rate();
    for (v, (p, q)) in state
        .velocities
        .iter()
        .zip(trajectory.frame(3).iter().zip(trajectory.frame(2)))
    {
        assert!((*v - (p.as_dvec3() - q.as_dvec3()) * rate).length() < 1e-12);
    }
    assert_eq!(
        truth.known(3, 2),
        [trajectory.frame(2), trajectory.frame(3)]
    );
    assert_eq!(truth.known(0, 2), [trajectory.frame(0)]);
    let prepared = Prepared {
        case: &cases()[0],
        on: horizons().on(&cases()[0]).unwrap(),
        mesh: String::new(),
        start: None,
    };
    let substeps = loaded.scene.physics.substeps;
    let same = Method::physics(substeps.to_string().parse().unwrap());
    let mut runner = Runner::start(&same, &prepared, &truth, 0).unwrap();
    for frame in 1..=12 {
        runner.step().unwrap();
        for (found, expected) in runner.positions().iter().zip(trajectory.frame(frame)) {
            // Rounded to f32 at its start.
            assert!(
                (*found - expected.as_dvec3()).length() < 1e-5,
                "frame {frame}"
            );
        }
    }
    // Without its scene there is no physics.
    let alone = truth::recorded(trajectory, false).unwrap();
    assert!(Runner::start(&same, &prepared, &alone, 0).is_err());
    let rigid = Method::baseline("rigid").unwrap();
    Runner::start(&rigid, &prepared, &alone, 0)
        .unwrap()
        .step()
        .unwrap();
}

#[test]
fn what_makes_no_sense_is_named_with_its_remedy() {
    let folder = Path::new("");
    let (cases, methods) = (cases(), methods());
    let error_of = |cases: &[Case], methods: &[Method], horizons: &Horizons| {
        let checked = check(&plan(cases, methods, horizons, folder), true);
        checked.unwrap_err().to_string()
    };
    let usual = horizons();
    let with = |frames: &[usize], starts| Horizons::new(frames.iter().copied(), starts);
    for (horizons, word) in [
        (with(&[1], 0), "starts"),
        (with(&[0, 3], 1), "1 at least"),
        (
            with(&[22], 1),
            "22 frames fit into no case: the longest has 21",
        ),
    ] {
        let error = error_of(&cases, &methods, &horizons);
        assert!(error.contains(word), "{error}");
    }
    assert!(error_of(&cases, &[], &usual).contains("name a model or physics"));
    let twice = [cases[0].clone(), cases[0].clone()];
    assert!(error_of(&twice, &methods, &usual).contains("\"push\""));
    for (substeps, word) in [(15, "even"), (2, "no coarser")] {
        let cases = Case::converged(&[push()], &[], &[], &linearised(substeps)).unwrap();
        let error = error_of(&cases, &methods, &usual);
        assert!(
            error.starts_with("reference") && error.contains(word),
            "{error}"
        );
    }
}
