//! Solvers and integrators: the same bytes by any number of threads.

use glam::DVec3;
use selvedge_cloth::generate::square;
use selvedge_cloth::{ConjugateGradients, Handles, LinearSolver, Stepper};
use selvedge_sim::Simulator;

use crate::scenes::{INTEGRATORS, hanging, in_pool, moved};

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    // More than one tile of the preconditioner, and enough vertices for threads to be used.
    let mut scene = hanging(48);
    let iterative = LinearSolver::ConjugateGradients(ConjugateGradients::default());
    let solvers = [iterative, LinearSolver::Cholesky];
    let cases = solvers.map(|solver| INTEGRATORS.map(|integrator| (solver, integrator)));
    for (solver, integrator) in cases.into_iter().flatten() {
        scene.physics.solver = solver;
        scene.physics.integrator = integrator;
        // The second looks back at the first.
        scene.physics.substeps = 2;
        let [one, three] = [1, 3].map(|threads| {
            in_pool(threads, || {
                let mut simulator = Simulator::new(&scene).unwrap();
                let jerk = moved(&scene, DVec3::new(0.02, 0.0, 0.005));
                simulator.step(&jerk).unwrap();
                simulator.positions_f64().to_vec()
            })
        });
        assert!(one == three, "{solver:?} {integrator:?}");
    }
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
        for integrator in INTEGRATORS {
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
