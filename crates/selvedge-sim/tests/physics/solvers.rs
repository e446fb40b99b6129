//! Solvers and integrators: the same motion by each, the same bytes by any number of threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use glam::DVec3;
use selvedge_cloth::generate::square;
use selvedge_cloth::{
    AirLaw, ConjugateGradients, Correctable, HandleTargets, Handles, Integrator, LinearSolver,
    Scene, StepError, Stepper,
};
use selvedge_sim::Simulator;

use crate::scenes::{BDF2, floating, hanging, largest_distance};

fn start(scene: &Scene) -> Vec<DVec3> {
    scene.handles.select(scene.mesh.positions())
}

fn moved(scene: &Scene, by: DVec3) -> HandleTargets {
    HandleTargets::at_frame_end(start(scene).iter().map(|x| *x + by).collect()).unwrap()
}

/// A few frames of a sheet whose handles jerk sideways.
fn run(scene: &Scene, frames: u32) -> Simulator {
    let mut simulator = Simulator::new(scene).unwrap();
    for frame in 1..=frames {
        let by = DVec3::new(0.02, 0.0, 0.005) * f64::from(frame);
        simulator.step(&moved(scene, by)).unwrap();
    }
    simulator
}

#[test]
fn conjugate_gradients_move_the_cloth_as_cholesky_does() {
    let mut scene = hanging(12);
    scene.physics.solver = LinearSolver::Cholesky;
    let direct = run(&scene, 5);
    scene.physics.solver = LinearSolver::ConjugateGradients(ConjugateGradients::default());
    let iterative = run(&scene, 5);
    // Each is moved by its own solver.
    assert_eq!(direct.solver_iterations(), None);
    assert!(iterative.solver_iterations() > Some(0));
    // 20 solves, each wrong by dt times 1e-7 m/s: 1e-8 m, grown by little in 0.08 s.
    let distance = largest_distance(direct.positions_f64(), iterative.positions_f64());
    assert!(distance < 3e-8, "{distance}");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    // More than one tile of the preconditioner, and enough vertices for threads to be used.
    let mut scene = hanging(48);
    let iterative = LinearSolver::ConjugateGradients(ConjugateGradients::default());
    for (solver, integrator) in [
        (iterative, Integrator::Linearised),
        (iterative, BDF2),
        (iterative, Integrator::GeneralisedAlpha(Default::default())),
        (LinearSolver::Cholesky, Integrator::Linearised),
        (LinearSolver::Cholesky, BDF2),
        (
            LinearSolver::Cholesky,
            Integrator::GeneralisedAlpha(Default::default()),
        ),
    ] {
        scene.physics.solver = solver;
        scene.physics.integrator = integrator;
        // The second looks back at the first.
        scene.physics.substeps = 2;
        let runs = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let run = pool.build().unwrap().install(|| run(&scene, 1));
            run.positions_f64().to_vec()
        });
        assert!(
            runs[0] == runs[1] && runs[0] == runs[2],
            "{solver:?} {integrator:?}"
        );
    }
}

/// A press comes before a step or at any place within it: the cloth is then as before, and goes on
/// as if nothing had been.
#[test]
fn a_step_that_is_stopped_leaves_no_trace() {
    let mut scene = hanging(24);
    scene.physics.integrator = Integrator::default();
    let targets = HandleTargets::at_frame_end(scene.handles.select(scene.mesh.positions()));
    let targets = targets.unwrap();
    for solver in [
        LinearSolver::Cholesky,
        LinearSolver::ConjugateGradients(Default::default()),
    ] {
        scene.physics.solver = solver;
        let mut alone = Simulator::new(&scene).unwrap();
        let mut stopped = Simulator::new(&scene).unwrap();
        let flag = Arc::new(AtomicBool::new(false));
        stopped.stop_by(Arc::clone(&flag).into());
        for frame in 1..=4 {
            alone.step(&targets).unwrap();
            for wait in [0, 100, 400, 1600, 6400].map(Duration::from_micros) {
                let before = stopped.positions_f64().to_vec();
                let outcome = thread::scope(|scope| {
                    flag.store(wait.is_zero(), Ordering::Relaxed);
                    scope.spawn(|| {
                        thread::sleep(wait);
                        flag.store(true, Ordering::Relaxed);
                    });
                    stopped.step(&targets)
                });
                match outcome {
                    // The press came too late.
                    Ok(()) => {
                        assert!(!wait.is_zero());
                        stopped.undo_step();
                    }
                    Err(error) => assert_eq!(error, StepError::Stopped { frame }),
                }
                assert_eq!(stopped.frame(), frame - 1);
                assert!(stopped.positions_f64() == before);
            }
            flag.store(false, Ordering::Relaxed);
            stopped.step(&targets).unwrap();
            assert!(
                stopped.positions_f64() == alone.positions_f64(),
                "{solver:?} {frame}"
            );
        }
    }
}

#[test]
fn integrators_have_their_order() {
    let mut scene = hanging(5);
    scene.physics.solver = LinearSolver::Cholesky;
    // A smooth start: the stiff modes of a rough one would need far shorter steps.
    let shape = |x: &DVec3| {
        let wave = DVec3::new((2.0 * x.y).sin(), (3.0 * x.z).cos(), (2.0 * x.y).cos());
        *x + 0.02 * wave
    };
    let positions: Vec<DVec3> = scene.mesh.positions().iter().map(shape).collect();
    let targets = scene.handles.select(&positions);
    let mut end = |integrator: Integrator, steps: u32| -> Vec<DVec3> {
        scene.physics.integrator = integrator;
        let still = vec![DVec3::ZERO; 25];
        let mut simulator = Simulator::with_state(&scene, positions.clone(), still).unwrap();
        for _ in 0..steps {
            simulator
                .substep(0.05 / f64::from(steps), &targets)
                .unwrap();
        }
        simulator.positions_f64().to_vec()
    };
    let all = [
        Integrator::Linearised,
        BDF2,
        Integrator::GeneralisedAlpha(Default::default()),
    ];
    for integrator in all {
        // Substeps so short that no prediction is projected.
        let exact = end(integrator, 12800);
        let errors = [200, 400, 800].map(|steps| largest_distance(&end(integrator, steps), &exact));
        // Error C dt + D dt²: the order measured from halving dt nears its own from either side;
        // the run that counts as exact has at most 1/16 of the error of the finest one.
        for (coarse, fine) in [(0, 1), (1, 2)] {
            let order = (errors[coarse] / errors[fine]).log2() - f64::from(integrator.order());
            assert!(
                (-0.2..0.25).contains(&order),
                "{integrator:?} {order} {errors:?}"
            );
        }
    }
}

#[test]
fn implicit_air_takes_energy_where_explicit_air_adds_it() {
    // Thrown at 300 m/s in one substep per frame, dt ρ_air |v| / ρ = 27: the explicit force turns
    // faces round and blows up, the implicit one only brakes. There is no other energy: the sheet
    // is flat and moves as a whole.
    let mut scene = floating(4);
    scene.environment.air_density = 1.0;
    let thrown = vec![DVec3::new(300.0, 0.0, 0.0); 16];
    let energies = |scene: &Scene, steps: u32| -> Vec<f64> {
        let positions = scene.mesh.positions().to_vec();
        let mut simulator = Simulator::with_state(scene, positions, thrown.clone()).unwrap();
        let mut energies = vec![simulator.kinetic_energy()];
        for _ in 0..steps {
            simulator.substep(1.0 / 60.0, &[]).unwrap();
            energies.push(simulator.kinetic_energy());
        }
        energies
    };
    scene.physics.air = AirLaw::Implicit;
    for integrator in [
        Integrator::Linearised,
        BDF2,
        Integrator::GeneralisedAlpha(Default::default()),
    ] {
        scene.physics.integrator = integrator;
        assert!(energies(&scene, 20).is_sorted_by(|a, b| a > b));
    }
    scene.physics.integrator = Integrator::Linearised;
    scene.physics.air = AirLaw::Explicit;
    let explicit = energies(&scene, 1);
    assert!(explicit[1] > 100.0 * explicit[0]);
}

/// A few unknowns are solved in as many iterations, to all digits of f32. What is left then is no
/// residual of the iteration any more, and must not be taken for one.
#[test]
fn conjugate_gradients_end_however_few_the_unknowns_and_however_small_the_tolerance() {
    for vertices in [4, 5, 6, 9] {
        let size = 0.1;
        let sheet = square(vertices, size, 1).unwrap();
        let mut scene = hanging(2);
        scene.handles = Handles::new(&sheet.labels["upper-corners"], vertices).unwrap();
        scene.mesh = sheet.mesh;
        for integrator in [
            Integrator::Linearised,
            BDF2,
            Integrator::GeneralisedAlpha(Default::default()),
        ] {
            scene.physics.integrator = integrator;
            scene.physics.substeps = 1;
            scene.physics.solver = LinearSolver::ConjugateGradients(ConjugateGradients {
                tolerance: 1e-10,
                max_iterations: 200,
            });
            let mut simulator = Simulator::new(&scene).unwrap();
            for frame in 0..150 {
                let by = DVec3::X * 0.3 * (0.1 * f64::from(frame)).sin();
                let moved = simulator.step(&moved(&scene, by));
                assert_eq!(moved, Ok(()), "{vertices} vertices, {integrator:?}");
            }
        }
    }
}
