//! Handles that let go and take hold again; wind that gusts.

use glam::DVec3;
use selvedge_cloth::{
    Gust, HandleConstraint, HandleSchedule, HandleTargets, Handles, Integrator, LinearSolver,
    Release, Scene, StepError, Stepper,
};
use selvedge_sim::{Checkpoint, SagError, Simulator, sag};

use crate::scenes::{floating, hanging, held, largest_distance, led_by, still};
use crate::touching::copies;

/// `scene` with these handles let go for a while `[s]`.
pub(crate) fn released(mut scene: Scene, handles: Vec<usize>, from: f64, to: Option<f64>) -> Scene {
    let release = Release { handles, from, to };
    scene.schedule = HandleSchedule {
        releases: vec![release],
    };
    scene
}

/// Steps along the scene's own motion.
pub(crate) fn run(simulator: &mut Simulator, scene: &Scene, frames: usize) {
    let mut path = scene.handle_path().unwrap();
    for _ in 0..frames {
        path.follow(simulator.frame(), &simulator.handle_places());
        let targets = path.targets(simulator.frame(), 4).unwrap();
        simulator.step(&targets).unwrap();
    }
}

#[test]
fn a_cloth_that_is_let_go_falls_as_one_that_was_never_held() {
    // Both handles are let go at once from a flat, unstrained sheet in vacuum.
    for constraint in [HandleConstraint::Exact, HandleConstraint::Spring] {
        let mut held = released(hanging(5), vec![0, 1], 0.0, None);
        held.physics.handles = constraint;
        held.environment.air_density = 0.0;
        let mut free = floating(5);
        free.environment.gravity = held.environment.gravity;
        let mut one = Simulator::new(&held).unwrap();
        let mut other = Simulator::new(&free).unwrap();
        run(&mut one, &held, 20);
        run(&mut other, &free, 20);
        assert_eq!(one.positions_f64(), other.positions_f64());
    }
}

#[test]
fn a_handle_takes_hold_of_the_cloth_where_it_is() {
    for constraint in [HandleConstraint::Exact, HandleConstraint::Spring] {
        let mut scene = released(hanging(5), vec![1], 0.1, Some(0.3));
        scene.physics.handles = constraint;
        let vertex = scene.handles.vertices()[1].index();
        let mut simulator = Simulator::new(&scene).unwrap();
        run(&mut simulator, &scene, 6);
        let before = simulator.positions_f64()[vertex];
        run(&mut simulator, &scene, 12);
        let caught = simulator.positions_f64()[vertex];
        assert!(caught.distance(before) > 0.05, "it swings while it is free");
        // From now on it stays, or its spring does: that gives by load over stiffness, less than
        // the whole weight with its swing, some 4 N, over 1000 N/m.
        run(&mut simulator, &scene, 1);
        let now = simulator.positions_f64()[vertex];
        match constraint {
            HandleConstraint::Exact => assert_eq!(now, caught),
            HandleConstraint::Spring => assert!(now.distance(caught) < 0.02),
        }
    }
}

#[test]
fn after_taking_hold_a_handle_moves_by_as_much_as_its_path() {
    let scene = released(hanging(4), vec![0, 1], 0.0, Some(0.05));
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, &scene, 3);
    let before = scene.handles.select(simulator.positions_f64());
    let step = DVec3::new(0.01, -0.004, 0.002);
    let mut path = scene.handle_path().unwrap();
    path.follow(3, &before);
    let from = path.targets(3, 1).unwrap();
    assert_eq!(from.end(), before);
    let expected: Vec<DVec3> = before.iter().map(|p| *p + step).collect();
    let targets = HandleTargets::at_frame_end(expected.clone()).unwrap();
    simulator.step(&targets).unwrap();
    let after = scene.handles.select(simulator.positions_f64());
    // Differences and sums of numbers of size 1.
    assert!(largest_distance(&after, &expected) < 1e-15);
}

#[test]
fn a_step_that_fails_gives_the_active_handles_back() {
    let iterative = LinearSolver::ConjugateGradients(selvedge_cloth::ConjugateGradients::default());
    // The larger fits f64 no more, the smaller only f32.
    for (solver, far) in [(LinearSolver::Cholesky, 1e300), (iterative, 1e100)] {
        let mut scene = hanging(4);
        scene.physics.solver = solver;
        let held = still(&scene);
        let mut simulator = Simulator::new(&scene).unwrap();
        simulator.step(&held).unwrap();
        let mut undisturbed = Simulator::new(&scene).unwrap();
        undisturbed.step(&held).unwrap();
        let absurd = HandleTargets::at_frame_end(vec![DVec3::splat(far), held.end()[1]]).unwrap();
        let absurd = absurd.releasing(vec![false, true]).unwrap();
        let error = simulator.step(&absurd).unwrap_err();
        match &error {
            StepError::NonFinite { frame: 2, .. } => (),
            StepError::Solve { frame: 2, cause } => {
                assert!(cause.contains("not finite"), "{cause}")
            }
            other => panic!("{other}"),
        }
        simulator.step(&held).unwrap();
        undisturbed.step(&held).unwrap();
        assert_eq!(simulator.positions_f64(), undisturbed.positions_f64());
    }
}

#[test]
fn a_sheet_that_nothing_holds_rests_where_it_starts() {
    let whole = hanging(5);
    let rest = sag(&whole).unwrap();
    // The same sheet twice in one mesh; the second, elsewhere, has no handle.
    let mut twice = whole.clone();
    twice.mesh = copies(&whole.mesh, 2, |copy, p| p + DVec3::X * (3.0 * copy as f64));
    let both = sag(&twice).unwrap();
    assert_eq!(&both.positions[25..], &twice.mesh.positions()[25..]);
    // Only the scale of the steps and the order of the unknowns differ: both are at rest.
    assert!(largest_distance(&both.positions[..25], &rest.positions) < 1e-4);
    // A handle that holds only later does not help.
    let later = released(hanging(4), vec![0, 1], 0.0, Some(1.0));
    assert_eq!(sag(&later), Err(SagError::NoHandles));
    let one = sag(&released(hanging(4), vec![1], 0.0, Some(1.0))).unwrap();
    let mut alone = hanging(4);
    alone.handles = Handles::new(&[0], 16).unwrap();
    assert_eq!(one, sag(&alone).unwrap());
}

/// A simulator of `scene` in the positions and velocities of another.
fn continued(scene: &Scene, from: &Simulator) -> Simulator {
    let [x, v] = [from.positions_f64(), from.velocities_f64()].map(<[DVec3]>::to_vec);
    Simulator::with_state(scene, x, v).unwrap()
}

#[test]
fn a_substep_after_a_step_has_the_wind_of_its_own_frame() {
    let mut scene = hanging(4);
    scene.environment.gust = Some(Gust {
        speed: DVec3::new(4.0, 0.0, 0.0),
        period: 0.2,
        seed: 5,
    });
    scene.physics.integrator = Integrator::Linearised;
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, &scene, 1);
    let mut fresh = continued(&scene, &simulator).at_frame(1);
    for simulator in [&mut simulator, &mut fresh] {
        simulator.substep(1.0 / 120.0, &held(&scene)).unwrap();
    }
    let apart = largest_distance(simulator.positions_f64(), fresh.positions_f64());
    assert!(apart < 1e-12, "{apart}");
}

#[test]
fn gusts_are_those_of_the_frame() {
    let mut scene = hanging(5);
    scene.environment.wind = DVec3::new(2.0, 0.0, 1.0);
    scene.environment.gust = Some(Gust {
        speed: DVec3::new(1.5, 0.2, 1.0),
        period: 0.8,
        seed: 3,
    });
    // A substep of first order remembers positions and velocities alone.
    scene.physics.integrator = Integrator::Linearised;
    scene.physics.solver = LinearSolver::Cholesky;
    let mut whole = Simulator::new(&scene).unwrap();
    run(&mut whole, &scene, 12);
    // Frame by frame in the constant wind of each.
    let mut steady = scene.clone();
    let mut one = Simulator::new(&scene).unwrap();
    for frame in 0..12 {
        steady.environment = scene.environment.during_step(frame, scene.frame_rate);
        one = continued(&steady, &one);
        run(&mut one, &steady, 1);
    }
    assert_eq!(whole.positions_f64(), one.positions_f64());
}

/// One step from the state of any frame leads to the next frame of the run, where handles let go,
/// take hold elsewhere and are led on from there.
#[test]
fn a_step_from_any_state_of_a_run_leads_to_its_next_frame() {
    let mut scene = released(hanging(5), vec![1], 0.1, Some(0.2));
    scene.schedule.releases.push(Release {
        handles: vec![0, 1],
        from: 0.3,
        to: Some(0.35),
    });
    scene.motion = led_by(DVec3::new(0.2, 0.1, 0.0));
    let mut path = scene.handle_path().unwrap();
    let mut run = Simulator::new(&scene).unwrap();
    let mut offsets = 0.0_f64;
    for frame in 0..36 {
        let taken_up = Simulator::from_checkpoint(&scene, &run.checkpoint()).unwrap();
        path.follow(frame, &run.handle_places());
        let targets = path.targets(frame, 2).unwrap();
        run.step(&targets).unwrap();
        let mut taken_up = taken_up.taken_up_at(frame).unwrap();
        let mut path = scene.handle_path().unwrap();
        path.follow(frame, &taken_up.handle_places());
        let same = path.targets(frame, 2).unwrap();
        assert!(largest_distance(same.end(), targets.end()) < 1e-12 || !same.holds(1));
        taken_up.step(&same).unwrap();
        let apart = largest_distance(taken_up.positions_f64(), run.positions_f64());
        assert!(apart < 1e-12, "{frame}: {apart}");
        offsets = offsets
            .max(targets.end()[1].distance(path.at((frame + 1) as f64 / scene.frame_rate)[1]));
    }
    assert!(offsets > 0.02, "{offsets}");
}

/// Targets are places, also of a handle that took hold beside its path, and after a state was
/// put back.
#[test]
fn a_handle_that_took_hold_again_stays_where_it_is_told_to() {
    let scene = released(hanging(4), vec![1], 0.0, Some(0.1));
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, &scene, 8);
    let places = scene.handles.select(simulator.positions_f64());
    assert!(places[1].distance(held(&scene)[1]) > 0.02, "it was free");
    let still = vec![DVec3::ZERO; simulator.positions_f64().len()];
    let there = Checkpoint::of(9, simulator.positions_f64().to_vec(), still);
    simulator.restore(&there).unwrap();
    let places = scene.handles.select(simulator.positions_f64());
    let stay = HandleTargets::at_frame_end(places.clone()).unwrap();
    simulator.step(&stay).unwrap();
    assert_eq!(scene.handles.select(simulator.positions_f64()), places);
    let speeds = scene.handles.select(simulator.velocities_f64());
    assert!(speeds.iter().all(|v| v.length() < 1e-9), "{speeds:?}");
}
