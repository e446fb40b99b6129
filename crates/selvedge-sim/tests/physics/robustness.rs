//! Random scenes: with any mesh, fabric, air, motion, releases and settings, a frame is either
//! finite or an error that names it and its cause and leaves the cloth as it was. The share of
//! finished runs is tested too.
//!
//! The scenes are the same in every run ([`SEED`]), so their shares can be measured.

use std::cell::RefCell;

use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use selvedge_cloth::generate::{Shape, SheetSpec, sheet};
use selvedge_cloth::{
    AirLaw, ConjugateGradients, ElasticLaw, Environment, Gust, HandleConstraint, HandleSchedule,
    HandleTargets, Handles, Integrator, LinearSolver, Mesh, PhysicsSettings, Release, Scene,
    StepError, Stepper,
};
use selvedge_sim::Simulator;

use crate::scenes::{BDF2, CAMEL, DENIM, GRAY, NAVY, hanging, material, square_mesh};
use crate::sheets::{grid, triangle_strip};

/// Scenes, and frames of each.
const SCENES: u32 = 64;
const FRAMES: usize = 12;
/// A bound on strains that no run reaches: what the solvers do with any motion is tested here.
const UNBOUNDED: f64 = 1e6;
/// Seed of the random scenes.
const SEED: [u8; 32] = *b"any thirty-two bytes are a seed.";

/// Motion of the handles: a velocity up to 10 m/s `[m/s]`, turned about the vertical `[rad/s]`.
#[derive(Clone, Debug)]
pub(crate) struct Drag {
    velocity: DVec3,
    turn: f64,
}

fn settings() -> impl Strategy<Value = PhysicsSettings> {
    let solver = prop_oneof![
        Just(LinearSolver::Automatic),
        Just(LinearSolver::Cholesky),
        (-9_i32..-3).prop_map(|power| {
            LinearSolver::ConjugateGradients(ConjugateGradients {
                tolerance: 10_f64.powi(power),
                ..ConjugateGradients::default()
            })
        }),
    ];
    let integrator = prop_oneof![
        3 => Just(Integrator::Linearised),
        2 => Just(BDF2),
        3 => Just(Integrator::default()),
    ];
    let laws = (
        prop_oneof![Just(AirLaw::Explicit), Just(AirLaw::Implicit)],
        prop_oneof![
            Just(ElasticLaw::Energy),
            Just(ElasticLaw::Measured),
            Just(ElasticLaw::Arcsim)
        ],
        prop_oneof![
            Just(HandleConstraint::Exact),
            Just(HandleConstraint::Spring)
        ],
    );
    (1..=16_u32, solver, integrator, laws).prop_map(
        |(substeps, solver, integrator, (air, law, handles))| PhysicsSettings {
            substeps,
            handles,
            law,
            even_bending: substeps % 2 == 0,
            air: match integrator.order() {
                1 => air,
                _ => AirLaw::Implicit,
            },
            integrator,
            least_damping: None,
            max_strain: UNBOUNDED,
            solver,
        },
    )
}

/// Meshes of every generator and by hand, of 6 to 150 vertices and 0.1 to 2 m.
fn meshes() -> impl Strategy<Value = Mesh> {
    let shapes = prop_oneof![
        Just(Shape::Square),
        Just(Shape::Long),
        Just(Shape::Wide),
        Just(Shape::Triangle),
        Just(Shape::Diamond),
        Just(Shape::Disc),
        Just(Shape::LShape),
        Just(Shape::Holed),
    ];
    let generated = (shapes, 60..150_usize, 0.1..2.0_f64, any::<u64>()).prop_map(
        |(shape, vertices, size, seed)| {
            let spec = SheetSpec {
                shape,
                vertices,
                size,
                width: None,
                seed,
            };
            sheet(&spec).unwrap().mesh
        },
    );
    let rolled = |radius: f64| {
        move |c: DVec2| {
            let angle = c.x / radius;
            DVec3::new(radius * angle.cos(), c.y, radius * angle.sin())
        }
    };
    prop_oneof![
        4 => generated,
        1 => (2..12_usize).prop_map(square_mesh),
        1 => (1..12_usize, 1..10_usize, 0.02..0.2_f64, 0.2..2.0_f64)
            .prop_map(move |(columns, rows, spacing, radius)| {
                grid(columns, rows, spacing, rolled(radius))
            }),
        1 => (4..60_usize, 0.02..0.2_f64)
            .prop_map(|(count, side)| triangle_strip(count, side, |c| c.extend(0.0))),
    ]
}

fn environments() -> impl Strategy<Value = Environment> {
    let wind = || (-20.0..20.0_f64, -5.0..5.0_f64, -20.0..20.0_f64);
    let gust =
        (0.0..10.0_f64, 0.05..5.0_f64, any::<u64>()).prop_map(|(speed, period, seed)| Gust {
            speed: DVec3::splat(speed),
            period,
            seed,
        });
    let still = Just((0.0, 0.0, 0.0));
    let winds = prop_oneof![still, wind()];
    (
        winds,
        proptest::option::of(gust),
        0.0..2.0_f64,
        0.0..1.0_f64,
    )
        .prop_map(|((x, y, z), gust, air_density, air_drag)| Environment {
            wind: DVec3::new(x, y, z),
            gust,
            air_density,
            air_drag,
            ..Environment::default()
        })
}

/// Up to two spans, in frames, in which every other handle or all of them are let go.
fn releases() -> impl Strategy<Value = Vec<(usize, usize, usize)>> {
    let span = || (0..FRAMES / 3, 1..FRAMES / 3, 1..3_usize);
    proptest::collection::vec(span(), 0..3)
}

fn schedule(spans: &[(usize, usize, usize)], handles: usize, frame_rate: f64) -> HandleSchedule {
    let third = FRAMES / 3;
    let spans = spans.iter().enumerate();
    let releases = spans.map(|(k, (from, length, every))| Release {
        handles: (0..handles).step_by(*every).collect(),
        from: (k * third + from) as f64 / frame_rate,
        to: Some((k * third + (from + length).min(third)) as f64 / frame_rate),
    });
    HandleSchedule {
        releases: releases.collect(),
    }
}

pub(crate) fn scenes() -> impl Strategy<Value = Scene> {
    let fabric = prop_oneof![Just(GRAY), Just(CAMEL), Just(DENIM), Just(NAVY)];
    let stiffness = (-1.0..1.0_f64, -1.0..1.0_f64);
    let damping = prop_oneof![Just(0.0), (-5.0..-1.0_f64).prop_map(|p| 10_f64.powf(p))];
    let cloth = (meshes(), fabric, stiffness, damping);
    let held = proptest::collection::vec(any::<prop::sample::Index>(), 0..6);
    (settings(), cloth, environments(), held, releases()).prop_map(
        |(physics, (mesh, fabric, (stretch, bend), damping), environment, held, spans)| {
            let vertices = mesh.positions().len();
            let mut held: Vec<u32> = held.iter().map(|v| v.index(vertices) as u32).collect();
            held.sort_unstable();
            held.dedup();
            let mut scene = hanging(2);
            scene.schedule = schedule(&spans, held.len(), scene.frame_rate);
            scene.handles = Handles::new(&held, vertices).unwrap();
            scene.mesh = mesh;
            scene.material = material(fabric).multiplied(10_f64.powf(stretch), 10_f64.powf(bend));
            scene.material.damping = damping;
            scene.environment = environment;
            scene.physics = physics;
            scene
        },
    )
}

pub(crate) fn drags() -> impl Strategy<Value = Drag> {
    let axis = || -5.7..5.7_f64;
    (axis(), axis(), axis(), -6.0..6.0_f64).prop_map(|(x, y, z, turn)| Drag {
        velocity: DVec3::new(x, y, z),
        turn,
    })
}

/// Targets of the handles of `scene` in the step from `frame`.
pub(crate) fn targets(scene: &Scene, drag: &Drag, frame: usize) -> HandleTargets {
    let start = scene.handles.select(scene.mesh.positions());
    let time = (frame + 1) as f64 / scene.frame_rate;
    let turned = DQuat::from_rotation_y(drag.turn * time);
    let targets = start.iter().map(|x| turned * *x + drag.velocity * time);
    let targets = HandleTargets::at_frame_end(targets.collect()).unwrap();
    let rate = scene.frame_rate;
    let released = scene.schedule.released(frame, rate, start.len());
    targets.releasing(released).unwrap()
}

/// Runs `test` on so many values of `strategy`, the same every time.
pub(crate) fn run_all<S: Strategy>(
    cases: u32,
    strategy: S,
    test: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let config = ProptestConfig {
        cases,
        failure_persistence: None,
        max_shrink_iters: 0,
        ..ProptestConfig::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &SEED);
    let mut runner = TestRunner::new_with_rng(config, rng);
    runner.run(&strategy, test).unwrap();
}

/// Runs a scene. Gives the error that stopped it, if any.
fn run(scene: &Scene, drag: &Drag) -> Result<Option<StepError>, TestCaseError> {
    let mut simulator = Simulator::new(scene).unwrap();
    for frame in 0..FRAMES {
        let before = simulator.positions_f64().to_vec();
        match simulator.step(&targets(scene, drag, frame)) {
            Ok(()) => {
                let finite = |vectors: &[DVec3]| vectors.iter().all(|v| v.is_finite());
                prop_assert!(finite(simulator.positions_f64()));
                prop_assert!(finite(simulator.velocities_f64()));
            }
            Err(error) => {
                names_frame_and_cause(&error, frame + 1)?;
                prop_assert_eq!(simulator.positions_f64(), &before[..]);
                prop_assert_eq!(simulator.frame(), frame);
                return Ok(Some(error));
            }
        }
    }
    Ok(None)
}

fn names_frame_and_cause(error: &StepError, next: usize) -> Result<(), TestCaseError> {
    let text = error.to_string();
    prop_assert!(text.starts_with(&format!("frame {next}: ")), "{}", text);
    // What is wrong, and where; or what the solver could not do, and how far it came.
    let known = match error {
        StepError::NonFinite { vertex, .. } => text.contains(&format!("vertex {vertex} ")),
        StepError::Solve { cause, .. } => {
            let causes = ["not positive definite", "conjugate gradients"];
            text.contains(cause) && causes.iter().any(|known| cause.contains(known))
        }
        _ => false,
    };
    prop_assert!(known, "no cause: {}", text);
    Ok(())
}

/// Measured with this seed: all runs but one come to their end. A table of the measured law may have
/// k1² > k0 k2, and long substeps let it show.
#[test]
fn a_scene_comes_to_its_end_or_says_in_which_frame_and_why_not() {
    let runs = RefCell::new(Vec::new());
    run_all(SCENES, (scenes(), drags()), |(mut scene, drag)| {
        runs.borrow_mut().push(run(&scene, &drag)?);
        // In place of a draw of its own, so that the scenes stay the same.
        if scene.physics.integrator == BDF2 {
            scene.physics.integrator = Integrator::default();
            runs.borrow_mut().push(run(&scene, &drag)?);
        }
        Ok(())
    });
    let runs = runs.into_inner();
    let failed: Vec<_> = runs.iter().flatten().collect();
    assert!(20 * failed.len() <= runs.len(), "{failed:?}");
}
