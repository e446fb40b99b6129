//! Solves against the equations that they are to satisfy, as products over all vertices.

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    BendTable, ConjugateGradients as Settings, ElasticLaw, Environment, FaceFabrics,
    HandleConstraint, Handles, Material, Mesh, Scene, StretchTable,
};

use super::*;
use crate::laws::external::slow_air;

const DT: f64 = 1.0 / 120.0;

/// A bent strip of eight faces and two fabrics with two handles that are no neighbours in number.
fn scene(handles: HandleConstraint, law: ElasticLaw) -> Scene {
    let coordinates: Vec<DVec2> = (0..10)
        .map(|k| {
            let k = f64::from(k);
            DVec2::new(0.05 * (k / 2.0).floor() + 0.004 * k.sin(), 0.06 * (k % 2.0))
        })
        .collect();
    let faces: Vec<[u32; 3]> = (0..4)
        .flat_map(|k| {
            let a = 2 * k;
            [[a, a + 2, a + 1], [a + 1, a + 2, a + 3]]
        })
        .collect();
    let positions = coordinates
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let wave = 0.02 * (70.0 * c.x + 0.3 * k as f64).sin();
            DVec3::new(1.1 * c.x, wave, 0.95 * c.y + 0.2 * wave)
        })
        .collect();
    let material = Material {
        name: "test".to_owned(),
        source: String::new(),
        density: 0.2,
        damping: 0.004,
        stretch: StretchTable([[40.0, 15.0, 80.0, 30.0]; 6]),
        bend: BendTable([[3e-5; 5], [2e-5; 5], [1e-5; 5]]),
        compression: selvedge_cloth::Compression::default(),
    };
    // The second half is of a fabric that differs in its damping.
    let fabrics = FaceFabrics {
        names: vec!["damped".to_owned()],
        of_face: (0..8).map(|face| (face >= 4).then_some(0)).collect(),
    };
    let damped = Material {
        damping: 0.03,
        ..material.clone()
    };
    let mesh = Mesh::new(&faces, coordinates, positions)
        .and_then(|mesh| mesh.with_fabrics(fabrics))
        .unwrap();
    let mut scene = Scene::of("strip", mesh, Handles::new(&[7, 2], 10).unwrap(), material);
    scene.fabrics.insert("damped".to_owned(), damped);
    scene.environment.wind = DVec3::new(0.5, -0.3, 0.2);
    scene.environment.air_drag = 0.1;
    scene.physics.handles = handles;
    scene.physics.law = law;
    scene.physics.air = AirLaw::Explicit;
    scene
}

fn state(scene: &Scene) -> State {
    let positions = scene.mesh.positions().to_vec();
    let velocities = (0..positions.len())
        .map(|k| {
            let k = k as f64;
            DVec3::new(k.sin(), (2.0 * k).cos(), (0.7 * k).sin())
        })
        .collect();
    State {
        positions,
        velocities,
    }
}

/// What a solve from `before` to `after` leaves of b - A Δv, per mass `[m/s]`, `[vertices]`; nothing
/// at exact handles. A and b are those of a cloth without handles, of which other tests compare the
/// elements with energies, and the springs'.
fn left_over(scene: &Scene, [before, after]: [&State; 2], targets: &[DVec3]) -> Vec<DVec3> {
    let mut free = scene.clone();
    free.handles = Handles::new(&[], 10).unwrap();
    let mut system = System::new(&free).unwrap();
    system.assemble(DT, before, &[]);
    let velocities = after.velocities.iter().zip(&before.velocities);
    let changes: Vec<DVec3> = velocities.map(|(after, before)| *after - *before).collect();
    let mut left = vec![DVec3::ZERO; 10];
    system.elements.multiply(Threads::One, &changes, &mut left);
    for (v, left) in left.iter_mut().enumerate() {
        *left = (system.impulses()[v] - *left) / system.mass()[v];
    }
    for (handle, target) in scene.handles.vertices().iter().zip(targets) {
        let h = handle.index();
        let end = before.positions[h] + after.velocities[h] * DT;
        match scene.physics.handles {
            HandleConstraint::Exact => left[h] = DVec3::ZERO,
            HandleConstraint::Spring => left[h] -= (end - *target) * (DT * 1e3 / system.mass()[h]),
        }
    }
    left
}

fn targets(scene: &Scene) -> Vec<DVec3> {
    let shift = DVec3::new(0.004, -0.002, 0.003);
    let start = scene.handles.select(scene.mesh.positions());
    start.iter().map(|x| *x + shift).collect()
}

/// The state after one solve.
fn solved(scene: &Scene, solver: LinearSolver) -> State {
    let mut after = state(scene);
    let mut system = System::with_solver(scene, solver).unwrap();
    system.advance(DT, &mut after, &targets(scene)).unwrap();
    after
}

#[test]
fn a_solve_satisfies_its_equations() {
    let fine = LinearSolver::ConjugateGradients(Settings {
        tolerance: 1e-12,
        ..Settings::default()
    });
    for constraint in [HandleConstraint::Exact, HandleConstraint::Spring] {
        for law in [ElasticLaw::Measured, ElasticLaw::Arcsim] {
            for solver in [LinearSolver::Cholesky, fine] {
                let scene = scene(constraint, law);
                let (before, targets) = (state(&scene), targets(&scene));
                let after = solved(&scene, solver);
                let name = format!("{constraint:?} {law:?} {solver:?}");
                for (v, left) in left_over(&scene, [&before, &after], &targets)
                    .iter()
                    .enumerate()
                {
                    // Entries of A are up to a thousand times the mass, velocities about 1 m/s.
                    assert!(left.length() < 1e-9, "{name} {v}: {left}");
                    let end = before.positions[v] + after.velocities[v] * DT;
                    assert!(after.positions[v].distance(end) < 1e-15, "{name} {v}");
                }
                if constraint == HandleConstraint::Exact {
                    assert_eq!(scene.handles.select(&after.positions), targets, "{name}");
                }
            }
        }
    }
}

#[test]
fn error_of_conjugate_gradients_is_what_was_asked_for() {
    let scene = scene(HandleConstraint::Exact, ElasticLaw::Measured);
    let expected = solved(&scene, LinearSolver::Cholesky);
    let mass = scene.mesh.rest_shape(scene.material.density).vertex_mass;
    for tolerance in [1e-2, 1e-4, 1e-6, 1e-8] {
        let after = solved(
            &scene,
            LinearSolver::ConjugateGradients(Settings {
                tolerance,
                ..Settings::default()
            }),
        );
        let squares = after.velocities.iter().zip(&expected.velocities).zip(&mass);
        let sum: f64 = squares.map(|((a, b), m)| m * a.distance_squared(*b)).sum();
        let error = (sum / mass.iter().sum::<f64>()).sqrt();
        // The preconditioner is not A: where P > A the error is underestimated, here by little.
        assert!(error <= 2.0 * tolerance, "{tolerance}: {error}");
    }
}

#[test]
fn implicit_air_is_a_linear_drag_at_the_end_of_the_step() {
    // A flat sheet without stiffness across it that moves along its normal. With drag ρ a |v| v per
    // face all of it keeps one velocity: v' = v - dt (ρ_air/ρ) |v| v', v' = v / (1 + dt ρ_air
    // |v|/ρ).
    for solver in [
        LinearSolver::Cholesky,
        LinearSolver::ConjugateGradients(Settings {
            tolerance: 1e-12,
            ..Settings::default()
        }),
    ] {
        let mut scene = scene(HandleConstraint::Exact, ElasticLaw::Measured);
        let uv = scene.mesh.material_coordinates().iter();
        let flat = uv.map(|c| c.extend(0.0)).collect();
        scene.mesh = scene.mesh.with_positions(flat).unwrap();
        scene.handles = Handles::new(&[], 10).unwrap();
        scene.physics.air = AirLaw::Implicit;
        scene.environment = Environment {
            gravity: DVec3::ZERO,
            air_density: 1.3,
            ..Environment::default()
        };
        let mut system = System::with_solver(&scene, solver).unwrap();
        let mut after = state(&scene);
        after.velocities.fill(DVec3::new(0.0, 0.0, 80.0));
        system.advance(DT, &mut after, &[]).unwrap();
        let expected = 80.0 / (1.0 + DT * (1.3 * 80.0 + slow_air(1.3)) / 0.2);
        for velocity in &after.velocities {
            assert!(velocity.distance(DVec3::Z * expected) < 1e-10, "{velocity}");
        }
    }
}

/// Solve after solve of the same stage, each linearised at the end of the last, leads to the
/// solution of the equations that one of them approaches.
#[test]
fn repeated_solves_reach_the_solution_of_the_implicit_equations() {
    let scene = scene(HandleConstraint::Exact, ElasticLaw::Measured);
    let (before, targets) = (state(&scene), targets(&scene));
    let mut system = System::with_solver(&scene, LinearSolver::Cholesky).unwrap();
    let mut solved = before.clone();
    system.advance(DT, &mut solved, &targets).unwrap();
    let mut largest = Vec::new();
    for _ in 0..100 {
        system.linearise(DT, &before.velocities, &solved, &targets);
        let impulses = system.impulses();
        let free = system.unknown_vertices().iter();
        let sizes = free.map(|v| impulses[*v as usize].length());
        largest.push(sizes.fold(0.0, f64::max));
        system.solve(DT).unwrap();
        let base = solved.clone();
        system.apply(DT, &base, &mut solved);
    }
    assert!(largest[99] < 1e-12, "{}", largest[99]);
    assert!(largest[0] > 1e5 * largest[99]);
    assert_eq!(scene.handles.select(&solved.positions), targets);
}

#[test]
fn an_iteration_limit_is_an_error_that_says_what_to_do() {
    let mut scene = scene(HandleConstraint::Exact, ElasticLaw::Measured);
    scene.physics.solver = LinearSolver::ConjugateGradients(Settings {
        max_iterations: 1,
        ..Settings::default()
    });
    let mut system = System::new(&scene).unwrap();
    let error = system
        .advance(DT, &mut state(&scene), &targets(&scene))
        .unwrap_err();
    assert!(error.to_string().contains("max_iterations"), "{error}");
}
