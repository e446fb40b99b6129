//! Random scenes: whatever the mesh, the fabric, the motion and the settings, a frame either comes out
//! finite or is an error that names it and leaves the cloth as it was.
//!
//! Seeds of failures are kept beside this file's folder, in `proptest-regressions`.

use glam::DVec3;
use proptest::prelude::*;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    AdaptiveSubsteps, AirLaw, BendingLaw, ConjugateGradients, HandleConstraint, HandleTargets,
    Handles, Integrator, LinearSolver, Newton, PhysicsSettings, Scene, Stepper, StretchLookup,
    Substepping,
};
use selvedge_sim::Simulator;

use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, hanging, material};

/// What the handles do: a velocity up to 10 m/s `[m/s]`, turned about the vertical `[rad/s]`.
#[derive(Clone, Debug)]
struct Drag {
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
        1 => Just(Integrator::Newton(Newton::default())),
    ];
    let substepping = prop_oneof![
        3 => Just(Substepping::Fixed),
        1 => Just(Substepping::Adaptive(AdaptiveSubsteps::default())),
    ];
    let laws = (
        prop_oneof![Just(AirLaw::Explicit), Just(AirLaw::Implicit)],
        prop_oneof![Just(BendingLaw::Symmetric), Just(BendingLaw::Arcsim)],
        prop_oneof![
            Just(HandleConstraint::Exact),
            Just(HandleConstraint::Spring)
        ],
        prop_oneof![Just(StretchLookup::Grid), Just(StretchLookup::Exact)],
    );
    (1..=16_u32, solver, integrator, substepping, laws).prop_map(
        |(substeps, solver, integrator, substepping, (air, bending, handles, stretch_lookup))| {
            PhysicsSettings {
                substeps,
                handles,
                bending,
                stretch_lookup,
                air,
                integrator,
                substepping,
                solver,
            }
        },
    )
}

fn scenes() -> impl Strategy<Value = Scene> {
    let fabric = prop_oneof![Just(GRAY), Just(CAMEL), Just(DENIM), Just(NAVY)];
    let stiffness = (-1.0..1.0_f64, -1.0..1.0_f64);
    let mesh = (4..60_usize, 0.1..2.0_f64, any::<u64>());
    let held = proptest::collection::btree_set(0..60_u32, 0..6);
    (settings(), fabric, stiffness, mesh, held).prop_map(
        |(physics, fabric, (stretch, bend), (vertices, size, seed), held)| {
            let sheet = square(&SquareSpec {
                vertices,
                size,
                seed,
            })
            .unwrap();
            let mut scene = hanging(2);
            scene.mesh = sheet.mesh;
            let held: Vec<u32> = held.into_iter().filter(|&v| v < vertices as u32).collect();
            scene.handles = Handles::new(&held, vertices).unwrap();
            scene.material = material(fabric);
            let rows = scene.material.stretch.0.iter_mut().flatten();
            rows.for_each(|k| *k *= 10_f64.powf(stretch));
            let rows = scene.material.bend.0.iter_mut().flatten();
            rows.for_each(|k| *k *= 10_f64.powf(bend));
            scene.physics = physics;
            scene
        },
    )
}

fn drags() -> impl Strategy<Value = Drag> {
    let axis = || -5.7..5.7_f64;
    (axis(), axis(), axis(), -6.0..6.0_f64).prop_map(|(x, y, z, turn)| Drag {
        velocity: DVec3::new(x, y, z),
        turn,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_frame_is_finite_or_an_error_that_names_it(scene in scenes(), drag in drags()) {
        let start = scene.handles.select(scene.mesh.positions());
        let mut simulator = Simulator::new(&scene).unwrap();
        for frame in 0..12_u32 {
            let time = f64::from(frame + 1) / scene.frame_rate;
            let turned = glam::DQuat::from_rotation_y(drag.turn * time);
            let targets = start.iter().map(|x| turned * *x + drag.velocity * time).collect();
            let before = simulator.positions_f64().to_vec();
            match simulator.step(&HandleTargets::at_frame_end(targets).unwrap()) {
                Ok(()) => {
                    let finite = |vectors: &[DVec3]| vectors.iter().all(|v| v.is_finite());
                    prop_assert!(finite(simulator.positions_f64()));
                    prop_assert!(finite(simulator.velocities_f64()));
                }
                Err(error) => {
                    let text = error.to_string();
                    prop_assert!(text.starts_with(&format!("frame {frame}: ")), "{}", text);
                    prop_assert_eq!(simulator.positions_f64(), &before[..]);
                    break;
                }
            }
        }
    }
}
