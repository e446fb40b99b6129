//! The effect of the choices of the physics on a motion: the table of
//! `docs/src/concepts/physics.md`.
//!
//! `cargo run --release -p selvedge-sim --example choices`. A square of gray interlock with 289
//! vertices, held by two corners, starts in its rest pose and is moved diagonally for 90 frames.
//! Each row is one choice, with the root mean square distance over all vertices and frames to the
//! motion with short substeps and to that with the default settings, and with the time of a frame.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

use std::time::Instant;

use glam::{DVec3, Vec3};
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::motion::named::by_name;
use selvedge_cloth::{
    AdaptiveSubsteps, ElasticLaw, Environment, HandleConstraint, HandleSchedule, Handles,
    Integrator, LinearSolver, Newton, PhysicsMode, PhysicsSettings, SagSettings, Scene, StepError,
    Stepper, Substepping,
};
use selvedge_sim::{Simulator, sag};

/// Frames that the shipped motion stands still before its first move.
const STILL: usize = 60;
const FRAMES: usize = 90;

fn main() {
    let mut scene = scene();
    let rest = sag(&scene).unwrap().positions;
    let mut run = |physics: PhysicsSettings| {
        scene.physics = physics;
        frames(&scene, &rest)
    };
    let usual = PhysicsSettings::default();
    let (fine, _) = run(PhysicsSettings {
        substeps: 64,
        ..usual
    })
    .unwrap();
    let (base, _) = run(usual).unwrap();
    for (name, physics) in choices() {
        let (found, milliseconds) = match run(physics) {
            Ok(found) => found,
            Err(error) => {
                println!("| {name} | {error} |");
                continue;
            }
        };
        println!(
            "| {name} | {:.2} mm | {:.4} mm | {milliseconds:.2} ms |",
            1e3 * distance(&found, &fine),
            1e3 * distance(&found, &base),
        );
    }
}

fn choices() -> Vec<(&'static str, PhysicsSettings)> {
    let usual = PhysicsSettings::default();
    let substeps = |substeps: u32| PhysicsSettings { substeps, ..usual };
    let one = substeps(1);
    let first = PhysicsSettings::in_mode(PhysicsMode::FirstOrder);
    let first_order = |substeps: u32| PhysicsSettings { substeps, ..first };
    let newton = |physics: PhysicsSettings, integrator: fn(Newton) -> Integrator| PhysicsSettings {
        integrator: integrator(Newton::default()),
        ..physics
    };
    let substepping = Substepping::Adaptive(AdaptiveSubsteps {
        max_change: 0.02,
        ..AdaptiveSubsteps::default()
    });
    let solver = LinearSolver::Cholesky;
    let (handles, law) = (HandleConstraint::Spring, ElasticLaw::Measured);
    let bdf2 = PhysicsSettings {
        integrator: Integrator::SecondOrder,
        ..usual
    };
    let undamped = PhysicsSettings {
        least_damping: Some(0.0),
        ..usual
    };
    vec![
        ("default: generalised-alpha, 2 substeps", usual),
        ("1 substep", one),
        ("4 substeps", substeps(4)),
        ("8 substeps", substeps(8)),
        ("BDF2", bdf2),
        ("Newton", newton(usual, Integrator::SecondOrderNewton)),
        ("first order, 1 substep", first_order(1)),
        ("first order, 2 substeps", first_order(2)),
        ("first order, 4 substeps", first_order(4)),
        ("first order, 8 substeps", first_order(8)),
        ("first order, 16 substeps", first_order(16)),
        (
            "first order, 4 substeps, Newton",
            newton(first, Integrator::Newton),
        ),
        (
            "1 substep, divided where an edge changes by 0.02",
            PhysicsSettings { substepping, ..one },
        ),
        ("no damping", undamped),
        ("Cholesky", PhysicsSettings { solver, ..usual }),
        ("spring handles", PhysicsSettings { handles, ..usual }),
        ("measured law", PhysicsSettings { law, ..usual }),
    ]
}

/// Positions of all frames `[frames * vertices]`, and how long a frame took `[ms]`.
fn frames(scene: &Scene, rest: &[DVec3]) -> Result<(Vec<Vec3>, f64), StepError> {
    let still = vec![DVec3::ZERO; rest.len()];
    let mut simulator = Simulator::with_state(scene, rest.to_vec(), still).unwrap();
    let path = scene.handle_path().unwrap();
    let begin = Instant::now();
    let mut positions = Vec::with_capacity(FRAMES * rest.len());
    for frame in 0..FRAMES {
        let targets = path.targets(STILL + frame, scene.physics.substeps as usize);
        simulator.step(&targets.unwrap())?;
        positions.extend_from_slice(simulator.positions());
    }
    let milliseconds = begin.elapsed().as_secs_f64() * 1e3 / FRAMES as f64;
    Ok((positions, milliseconds))
}

/// Root mean square distance `[m]`.
fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    let squares = a
        .iter()
        .zip(b)
        .map(|(a, b)| a.as_dvec3().distance_squared(b.as_dvec3()));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

fn scene() -> Scene {
    let spec = SquareSpec {
        vertices: 289,
        size: 1.0,
        seed: 1,
    };
    let sheet = square(&spec).unwrap();
    let material = selvedge_assets::materials::GRAY_INTERLOCK;
    Scene {
        name: "choices".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], spec.vertices).unwrap(),
        fabrics: std::collections::BTreeMap::new(),
        schedule: HandleSchedule::default(),
        mesh: sheet.mesh,
        material: toml::from_str(material).unwrap(),
        environment: Environment::default(),
        motion: by_name("test-x-minus-z").unwrap(),
        physics: PhysicsSettings::default(),
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}
