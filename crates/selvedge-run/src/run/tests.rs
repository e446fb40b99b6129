//! Runs by the solver, by a network and by any stepper.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use selvedge_cloth::{ContactSettings, Handles, Release, Scene as Built, Stop};
use selvedge_data::{Drive, Playback, StartSpec, open_scene, record};

use super::*;
use crate::models::Model;

/// A square of 36 vertices that hangs flat from its upper corners.
pub(crate) fn hanging() -> Built {
    Built::clone(scene("").built())
}

/// The same as a scene whose handles go forward, with more lines.
fn scene(more: &str) -> Scene {
    Scene::parse(&text(more)).unwrap()
}

fn text(more: &str) -> String {
    format!(
        "name = \"hanging\"\nmaterial = \"gray-interlock\"\nmotion = {{ named = \"forward\" }}\n\
         mesh = {{ generator = {{ kind = \"square\", vertices = 36, size = 1.0, seed = 1 }} }}\n\
         handles = {{ label = \"upper-corners\" }}\n{more}"
    )
}

/// The same with its handles let go for a while, one for ever.
fn let_go() -> Scene {
    let mut built = hanging();
    let release = |handle, from, to| Release {
        handles: vec![handle],
        from,
        to,
    };
    built.schedule.releases = vec![release(0, 0.1, Some(0.2)), release(1, 0.25, None)];
    Scene::of(built)
}

fn paper() -> Model {
    Model::open(Some("paper".as_ref())).unwrap()
}

const GO_ON: ControlFlow<()> = ControlFlow::Continue(());

#[test]
fn a_step_takes_one_target_per_substep() {
    for substeps in [1, 3, 8] {
        let scene = scene(&format!("physics = {{ substeps = {substeps} }}\n"));
        let mut run = Run::new(&scene).unwrap();
        assert_eq!(run.samples(), substeps);
        let rest = scene.rest_pose(&mut ignore_events).unwrap();
        let still = vec![DVec3::ZERO; rest.positions.len()];
        let alone = Simulator::with_state(scene.built(), rest.positions.clone(), still);
        let path = scene.built().handle_path().unwrap();
        let drive = Drive {
            path: &path,
            samples_per_frame: substeps,
        };
        let alone = record(&mut alone.unwrap(), drive, 20, &mut |_| GO_ON);
        assert_eq!(run.record(20, &mut |_| GO_ON), alone);
    }
}

/// Steps to the middle of a motion, on, back, and on again; and from the beginning.
fn goes_back(mut run: Run, frames: usize) {
    let whole = run.record(frames, &mut |_| GO_ON).positions;
    let vertices = run.positions().len();
    let last = (run.frame(), run.velocities(), run.warnings());
    run.reset().unwrap();
    assert_eq!(run.positions(), &whole[..vertices]);
    assert_eq!(
        run.record(frames / 2, &mut |_| GO_ON).end,
        selvedge_data::RecordingEnd::Complete
    );
    let (there, frame) = (run.snapshot().unwrap(), run.frame());
    for _ in 0..2 {
        let on = run.record(frames - frames / 2, &mut |_| GO_ON).positions;
        assert!(
            on == whole[frames / 2 * vertices..],
            "from frame {frame} on"
        );
        assert_eq!((run.frame(), run.velocities(), run.warnings()), last);
        run.restore(&there).unwrap();
    }
    let other = Snapshot::of(5_usize);
    assert!(matches!(
        run.restore(&other),
        Err(StepError::Snapshot { .. })
    ));
    assert_eq!(run.frame(), frame);
}

#[test]
fn every_run_goes_back_to_the_byte() {
    goes_back(Run::new(&scene("")).unwrap(), 30);
    goes_back(Run::new(&scene("physics = \"arcsim\"\n")).unwrap(), 12);
    goes_back(Run::new(&let_go()).unwrap(), 24);
    goes_back(Run::of_model(&scene(""), &paper()).unwrap(), 20);
    let scene = scene("");
    let mut run = Run::new(&scene).unwrap();
    let positions = run.record(8, &mut |_| GO_ON).positions;
    let played = Playback::new(run.trajectory(positions).unwrap());
    goes_back(Run::of_stepper(&scene, Box::new(played)).unwrap(), 8);
}

/// Engines keep their parts where any thread may read them.
#[test]
fn a_snapshot_of_another_scene_is_refused() {
    let own = scene("");
    let mut run = Run::new(&own).unwrap();
    run.step().unwrap();
    let before = run.positions_f64();
    // As many vertices, which other edges join; another motion; another fabric.
    let changes = [
        ("seed = 1", "seed = 2"),
        ("forward", "side"),
        ("gray-interlock", "denim"),
    ];
    for (from, to) in changes {
        let other = Scene::parse(&text("").replace(from, to)).unwrap();
        let there = Run::new(&other).unwrap().snapshot().unwrap();
        let refused = run.restore(&there).unwrap_err();
        assert_eq!(refused, StepError::Snapshot { frame: 1 });
        assert_eq!(run.positions_f64(), before);
    }
    // The same text is the same scene.
    let there = Run::new(&scene("")).unwrap().snapshot().unwrap();
    run.restore(&there).unwrap();
    assert_eq!(run.frame(), 0);
}

/// What no solver moves, or has no such obstacle, leads none.
#[test]
fn obstacles_that_are_not_there_are_not_led() {
    let mut run = Run::new(&scene("")).unwrap();
    let mut learned = Run::of_model(&scene(""), &paper()).unwrap();
    for run in [&mut run, &mut learned] {
        let refused = run.lead_obstacle(0, DVec3::X).unwrap_err();
        assert!(
            refused.to_string().contains("no obstacle 0: 0 can"),
            "{refused}"
        );
    }
    assert!(run.teleport(DVec3::X.into(), &[2]).is_err());
}

#[test]
fn a_run_is_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Run>();
}

/// Handles that are set 2 m away at once tear the cloth, unless it is set there with them.
#[test]
fn a_cloth_is_set_where_its_handles_are() {
    let scene = scene("");
    let mut run = Run::new(&scene).unwrap();
    for _ in 0..12 {
        run.step().unwrap();
    }
    let to = Rigid::about(DVec3::ZERO, DQuat::from_rotation_y(1.0), DVec3::X * 2.0);
    let places = run.handle_places().into_iter().map(|place| to.of(place));
    let targets = HandleTargets::at_frame_end(places.collect()).unwrap();
    let torn = run.step_to(&targets).unwrap_err().to_string();
    assert!(
        torn.contains("teleport the cloth where its handles are set elsewhere"),
        "{torn}"
    );
    let before = run.positions_f64();
    run.teleport(to, &[]).unwrap();
    for (now, before) in run.positions_f64().iter().zip(&before) {
        assert!(now.distance(to.of(*before)) < 1e-12);
    }
    for _ in 0..12 {
        run.step_to(&targets).unwrap();
    }
    assert!(
        run.frame_warnings().is_empty(),
        "{:?}",
        run.frame_warnings()
    );
    let mut learned = Run::of_model(&scene, &paper()).unwrap();
    let refused = learned.teleport(to, &[]).unwrap_err().to_string();
    assert!(
        refused.contains("only the solver can teleport"),
        "{refused}"
    );
}

#[test]
fn a_run_in_contact_goes_back_to_the_byte() {
    let scene = Scene::named("tablecloth").unwrap();
    goes_back(Run::new(&scene).unwrap(), 30);
}

/// A light knit in a storm holds to the bound of a step, but no cloth is so long.
#[test]
fn a_run_that_strains_the_cloth_too_far_is_warned_of() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/elsewhere");
    let built = open_scene(&format!("{folder}/wind-8.toml")).unwrap().scene;
    let in_wind = |wind: f64| {
        let mut built = built.clone();
        built.environment.wind = DVec3::X * wind;
        let start = built.mesh.positions().to_vec();
        let mut run = Run::new(&Scene::at(built, start)).unwrap();
        run.record(30, &mut |_| GO_ON);
        run.warnings().join("\n")
    };
    let words = in_wind(25.0);
    assert!(words.contains("strained by more than 50 %"), "{words}");
    assert!(words.contains("physics.max_strain (1.5 now)"), "{words}");
    assert_eq!(in_wind(2.0), "");
}

#[test]
fn a_scene_starts_as_it_says() {
    let at_rest = scene("");
    let rest = at_rest.rest_pose(&mut ignore_events).unwrap();
    let run = Run::new(&at_rest).unwrap();
    assert_eq!(run.positions_f64(), rest.positions);
    assert!(at_rest.begins_at_rest() && run.rest().is_some());
    let from_mesh = scene("start = \"mesh\"\n");
    let run = Run::new(&from_mesh).unwrap();
    assert_eq!(run.positions_f64(), from_mesh.built().mesh.positions());
    assert!(run.rest().is_none() && run.warnings().is_empty());
    assert_eq!(from_mesh.spec().unwrap().start, StartSpec::Mesh);
}

/// A network compares with the rest pose of the scene's own law, and says what it does not see.
#[test]
fn a_network_begins_at_rest_and_says_what_it_leaves_out() {
    let run = |more: &str| Run::of_model(&scene(more), &paper()).unwrap();
    let usual = run("");
    assert!(usual.start_warnings().is_empty());
    let from_mesh = run("start = \"mesh\"\n");
    assert_eq!(from_mesh.positions(), usual.positions());
    let said = from_mesh.warnings().join("\n");
    assert!(said.contains("start in the sagged rest pose"), "{said}");
    let mut built = hanging();
    built.contact = Some(ContactSettings::default());
    built.environment.wind = DVec3::X * 9.0;
    let run = Run::of_model(&Scene::of(built), &paper()).unwrap();
    let said = run.warnings().join("\n");
    assert!(said.contains("contact: this model does not see"), "{said}");
    assert!(said.contains("beyond training: wind"), "{said}");
    let arcsim = scene("physics = \"arcsim\"\n");
    let rest = arcsim.rest_pose(&mut ignore_events).unwrap();
    let run = Run::of_model(&arcsim, &paper()).unwrap();
    assert_eq!(run.positions(), crate::rounded(&rest.positions));
}

#[test]
fn a_search_that_is_stopped_says_so_and_not_how_to_do_without() {
    let stopped = Run::begin(&scene(""), &mut |_| ControlFlow::Break(())).err();
    let stopped = stopped.unwrap();
    assert!(stopped.is_stopped());
    let words = crate::cause::chain(&stopped);
    assert!(words.starts_with("the rest pose of scene"), "{words}");
    let mut loaded = open_scene("default").unwrap();
    loaded.scene.handles = Handles::new(&[], 400).unwrap();
    let unheld = Run::new(&Scene::from(loaded)).err().unwrap();
    assert!(unheld.to_string().contains("start = \"mesh\""), "{unheld}");
    let hasty = Run::new(&scene("sag = { max_steps = 3 }\n")).err().unwrap();
    let words = crate::cause::chain(&hasty);
    assert!(
        words.contains("start = \"fit\"") && words.contains("sag.max_steps"),
        "{words}"
    );
}

#[test]
fn a_run_that_is_asked_to_stop_is_as_it_was() {
    let mut run = Run::new(&scene("")).unwrap();
    let stop = Stop::default();
    run.stop_by(stop.clone());
    run.step().unwrap();
    let (before, velocities) = (run.positions().to_vec(), run.velocities());
    stop.ask();
    assert!(matches!(run.step(), Err(StepError::Stopped { frame: 2 })));
    assert_eq!(
        (run.positions(), run.velocities()),
        (&before[..], velocities)
    );
}

/// A sheet of 3 cm on a ball is thrown off with two substeps, and lies on it with eight.
#[test]
fn edges_too_short_for_the_substeps_are_warned_of() {
    let said = |size: f64, substeps: u32| {
        let mut built = hanging();
        built.mesh = built.mesh.with_pattern_scaled(size).unwrap();
        built.physics.substeps = substeps;
        built.contact = Some(ContactSettings::default());
        start::thrown(&built)
    };
    let warning = said(0.01, 2).unwrap();
    assert!(
        warning.contains("physics.substeps to 4 or more"),
        "{warning}"
    );
    assert_eq!((said(0.01, 4), said(1.0, 2)), (None, None));
}

/// Handles of the cape of web/npm that jump in a frame, too slow to tear it: it comes along, through no
/// body, strained beyond what cloth is measured for.
#[test]
fn handles_that_jump_are_warned_of() {
    let cape = include_str!("../../../../web/npm/cape.toml");
    let scene = Scene::parse(&cape.replace("vertices = 1000", "vertices = 150")).unwrap();
    let jump = |far: f64| {
        let mut run = Run::new(&scene).unwrap();
        let places = run.handle_places();
        let targets = places.into_iter().map(|place| place + far * DVec3::X);
        let targets = HandleTargets::at_frame_end(targets.collect()).unwrap();
        run.step_to(&targets).unwrap();
        assert_eq!(run.solver().unwrap().intersection_count(), 0);
        run.warnings().join("\n")
    };
    assert_eq!(jump(0.1), "");
    let words = jump(2.0);
    assert!(words.contains("strained by more than 50 %"), "{words}");
    assert!(
        words.contains("teleport the cloth where its handles"),
        "{words}"
    );
}
