//! The sagged rest pose.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{Gust, HandleConstraint, Handles, Integrator, SagMethod, Scene, StrainLimits};
use selvedge_sim::{SagError, SagProgress, Simulator, sag, sag_with_progress};

use crate::scenes::{DENIM, NAVY, hanging, material};

/// Largest acceleration of a free vertex [m/s²] that hangs still at `positions`, as a solve over a
/// vanishing time sees it: Δv/dt → F/m.
fn residual(scene: &Scene, positions: &[DVec3]) -> f64 {
    let dt = 1e-6;
    let still = vec![DVec3::ZERO; positions.len()];
    let mut scene = scene.clone();
    // One solve: its change of velocity over dt is the acceleration.
    scene.physics.integrator = Integrator::Linearised;
    let scene = &scene;
    let mut simulator = Simulator::with_state(scene, positions.to_vec(), still).unwrap();
    let targets = scene.handles.select(scene.mesh.positions());
    simulator.substep(dt, &targets).unwrap();
    let fastest = simulator.velocities_f64().iter().map(|v| v.length());
    fastest.fold(0.0, f64::max) / dt
}

#[test]
fn nothing_moves_in_the_rest_pose() {
    for text in [DENIM, NAVY] {
        let mut scene = hanging(8);
        scene.material = material(text);
        let rest = sag(&scene).unwrap();
        assert!(rest.residual <= scene.sag.tolerance);
        // dt² K/M < 1e-6 at this dt, and rounding of F/m is 1e-10 m/s².
        let measured = residual(&scene, &rest.positions);
        assert!((measured - rest.residual).abs() < 1e-5 * scene.sag.tolerance.max(measured));
    }
}

#[test]
fn wind_and_damping_are_no_part_of_the_rest_pose() {
    for method in [SagMethod::Equilibrium, SagMethod::Motion] {
        let mut scene = hanging(5);
        scene.sag.method = method;
        scene.environment.air_density = 20.0;
        let still = sag(&scene).unwrap();
        // Wind in which it flutters.
        scene.environment.wind = DVec3::new(4.0, 0.0, 1.0);
        scene.environment.gust = Some(Gust {
            speed: DVec3::ONE,
            period: 1.0,
            seed: 1,
        });
        assert_eq!(sag(&scene).unwrap(), still);
        if method == SagMethod::Equilibrium {
            scene.material.damping = 50.0;
            assert_eq!(sag(&scene).unwrap(), still);
        }
    }
}

#[test]
fn a_cloth_that_falls_to_rest_is_in_equilibrium() {
    let mut scene = hanging(5);
    scene.sag.method = SagMethod::Motion;
    // Heavier air brings it to rest sooner.
    scene.environment.air_density = 20.0;
    let fallen = sag(&scene).unwrap();
    assert!(fallen.residual <= scene.sag.tolerance);
    let measured = residual(&scene, &fallen.positions);
    assert!((measured - fallen.residual).abs() < 1e-5 * scene.sag.tolerance.max(measured));
    // Not before the first moments have passed, of three seconds.
    let least = 3.0 * scene.frame_rate * f64::from(scene.physics.substeps);
    assert!(f64::from(fallen.solves) >= least, "{}", fallen.solves);
}

#[test]
fn the_cloth_hangs_from_where_its_handles_are() {
    let scene = hanging(8);
    let rest = sag(&scene).unwrap();
    assert_eq!(
        scene.handles.select(&rest.positions),
        scene.handles.select(scene.mesh.positions())
    );
    let middle_of_the_top = 0.5 * (rest.positions[3].y + rest.positions[4].y);
    assert!((-0.2..-0.02).contains(&middle_of_the_top));
}

#[test]
fn the_sign_of_the_bulge_mirrors_the_pose() {
    let mut scene = hanging(8);
    let one = sag(&scene).unwrap();
    scene.sag.bulge = -scene.sag.bulge;
    let other = sag(&scene).unwrap();
    let mirrored: Vec<DVec3> = one
        .positions
        .iter()
        .map(|x| DVec3::new(-x.x, x.y, x.z))
        .collect();
    // Every operation commutes with the reflection, rounding included.
    assert_eq!(mirrored, other.positions);
    let depth = one.positions.iter().map(|x| x.x.abs()).fold(0.0, f64::max);
    assert!(depth > 0.02, "the cloth has stayed flat: {depth} m");
}

#[test]
fn spring_handles_carry_the_weight() {
    let mut scene = hanging(6);
    scene.physics.handles = HandleConstraint::Spring;
    let rest = sag(&scene).unwrap();
    let pull: DVec3 = scene
        .handles
        .vertices()
        .iter()
        .map(|h| 1e3 * (scene.mesh.positions()[h.index()] - rest.positions[h.index()]))
        .sum();
    let mass: f64 = scene
        .mesh
        .rest_shape(scene.material.density)
        .vertex_mass
        .iter()
        .sum();
    let weight = DVec3::new(0.0, 9.8 * mass, 0.0);
    // The forces that are left sum to at most mass times tolerance.
    assert!(pull.distance(weight) <= mass * scene.sag.tolerance + 1e-9);
}

#[test]
fn progress_is_told_of_every_solve() {
    let scene = hanging(4);
    let mut heard: Vec<SagProgress> = Vec::new();
    let rest = sag_with_progress(&scene, &mut |progress| {
        heard.push(progress);
        ControlFlow::Continue(())
    })
    .unwrap();
    let solves: Vec<u32> = heard.iter().map(|progress| progress.solves).collect();
    assert_eq!(solves, (0..=rest.solves).collect::<Vec<u32>>());
    assert_eq!(heard.last().unwrap().residual, rest.residual);
    assert_eq!(sag(&scene).unwrap(), rest);
}

#[test]
fn a_sag_stops_where_it_is_told_to() {
    let limits = StrainLimits {
        min: 0.995,
        max: 1.001,
    };
    let limited = |scene: &mut Scene| scene.material.strain_limits = Some(limits);
    let by_motion = |scene: &mut Scene| scene.sag.method = SagMethod::Motion;
    let ways: [&dyn Fn(&mut Scene); 3] = [&|_| (), &limited, &by_motion];
    for way in ways {
        let mut scene = hanging(4);
        way(&mut scene);
        let all = sag(&scene).unwrap().solves;
        let mut last = 0;
        let mut stop_after = |limit: u32| {
            sag_with_progress(&scene, &mut |progress| {
                last = progress.solves;
                if last >= limit {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            })
        };
        let stopped = stop_after(all);
        assert_eq!(stopped, Err(SagError::Stopped { solves: all }));
        let stopped = stop_after(2);
        assert_eq!(stopped, Err(SagError::Stopped { solves: 2 }));
    }
}

#[test]
fn what_cannot_hang_says_why() {
    let mut scene = hanging(6);
    scene.sag.max_steps = 3;
    match sag(&scene) {
        Err(SagError::NotConverged {
            solves, residual, ..
        }) => assert!(solves == 3 && residual > scene.sag.tolerance),
        other => panic!("{other:?}"),
    }
    scene.handles = Handles::new(&[], 36).unwrap();
    assert_eq!(sag(&scene), Err(SagError::NoHandles));
}
