//! The sagged rest pose.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{
    ConjugateGradients, ElasticLaw, Gust, HandleConstraint, Handles, Integrator, LinearSolver,
    Motion, Scene, VertexId,
};
use selvedge_sim::{RestPoseContent, SagError, SagProgress, SaggedRest, sag, sag_with_progress};

use crate::scenes::{DENIM, GRAY, NAVY, at_rest, hanging, held, material};

/// Time of a solve in which a cloth hardly moves [s].
const INSTANT: f64 = 1e-6;

/// Velocities [m/s] of a cloth that was still at `positions`, after an instant.
fn first_velocities(scene: &Scene, positions: &[DVec3]) -> Vec<DVec3> {
    let mut scene = scene.clone();
    // One solve: its change of velocity over dt is the acceleration.
    scene.physics.integrator = Integrator::Linearised;
    let mut simulator = at_rest(&scene, positions.to_vec());
    simulator.substep(INSTANT, &held(&scene)).unwrap();
    simulator.velocities_f64().to_vec()
}

/// Largest acceleration of a free vertex [m/s²] that hangs still at `positions`, as a solve over a
/// vanishing time sees it: Δv/dt → F/m.
fn residual(scene: &Scene, positions: &[DVec3]) -> f64 {
    let velocities = first_velocities(scene, positions).into_iter();
    velocities.map(|v| v.length()).fold(0.0, f64::max) / INSTANT
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
fn progress_is_told_of_every_solve_and_may_stop_the_search() {
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
    for limit in [rest.solves, 2] {
        let stopped = sag_with_progress(&scene, &mut |progress| {
            if progress.solves < limit { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        assert_eq!(stopped, Err(SagError::Stopped { solves: limit }));
    }
}

/// The end of a search, and the vertex that was told of last.
fn search(scene: &Scene) -> (Result<SaggedRest, SagError>, VertexId) {
    let mut vertex = VertexId(0);
    let end = sag_with_progress(scene, &mut |now| {
        vertex = now.vertex;
        ControlFlow::Continue(())
    });
    (end, vertex)
}

#[test]
fn what_cannot_hang_says_why_and_names_the_vertex() {
    let mut scene = hanging(6);
    let (rest, vertex) = search(&scene);
    let velocities = first_velocities(&scene, &rest.unwrap().positions);
    let speed = |v: &usize| velocities[*v].length();
    let fastest = (0..36).max_by(|a, b| speed(a).total_cmp(&speed(b)));
    assert_eq!(Some(vertex.index()), fastest);

    scene.sag.max_steps = 2;
    let (end, vertex) = search(&scene);
    let error = end.unwrap_err();
    let named = format!("no equilibrium after 2 solves: vertex {vertex} is still accelerated");
    assert!(error.to_string().starts_with(&named), "{error}");
    scene.handles = Handles::new(&[], 36).unwrap();
    assert_eq!(sag(&scene), Err(SagError::NoHandles));
}

fn content(scene: &Scene) -> String {
    serde_json::to_string(&RestPoseContent::of(scene).unwrap()).unwrap()
}

#[test]
fn scenes_of_the_same_content_have_the_same_rest_pose() {
    let scene = hanging(7);
    let mut other = scene.clone();
    other.name = "another".to_owned();
    other.motion = Motion::still(3.0);
    // Wind in which it flutters.
    other.environment.wind = DVec3::new(4.0, 0.0, 1.0);
    other.environment.gust = Some(Gust {
        speed: DVec3::ONE,
        period: 1.0,
        seed: 1,
    });
    other.frame_rate = 24.0;
    other.material.damping = 50.0;
    other.physics.substeps = 7;
    other.physics.integrator = Integrator::Linearised;
    other.physics.least_damping = Some(0.1);
    other.physics.solver = LinearSolver::ConjugateGradients(ConjugateGradients::default());
    assert_eq!(content(&scene), content(&other));
    assert_eq!(sag(&scene).unwrap(), sag(&other).unwrap());
}

#[test]
fn every_change_of_a_rest_pose_is_a_change_of_content() {
    let scene = hanging(7);
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 8] = [
        ("bulge", |scene| scene.sag.bulge = -scene.sag.bulge),
        ("tolerance", |scene| scene.sag.tolerance *= 0.5),
        ("handles", |scene| {
            scene.handles = Handles::new(&[3], 49).unwrap();
        }),
        ("stiffness", |scene| {
            scene.material.stretch.0[0][0] *= 1.0 + 1e-15
        }),
        ("density", |scene| scene.material.density *= 1.1),
        ("gravity", |scene| scene.environment.gravity *= 1.1),
        ("law", |scene| scene.physics.law = ElasticLaw::Measured),
        ("mesh", |scene| {
            let mut positions = scene.mesh.positions().to_vec();
            positions[5].x += 1e-9;
            scene.mesh = scene.mesh.clone().with_positions(positions).unwrap();
        }),
    ];
    for (what, change) in changes {
        let mut changed = scene.clone();
        change(&mut changed);
        assert_ne!(content(&scene), content(&changed), "{what}");
    }
}

/// Numbers of this version of the laws and the search. With other ones: raise `VERSION` in
/// `rest_pose/mod.rs`, so that nobody is given a pose of before, and put in the new numbers.
#[test]
fn the_search_is_that_of_its_version() {
    for (fabric, solves, depth) in [
        (GRAY, 20_u32, 0.531_402),
        (DENIM, 151, 0.507_026),
        (NAVY, 20, 0.542_514),
    ] {
        let mut scene = hanging(9);
        scene.material = material(fabric);
        let rest = sag(&scene).unwrap();
        let middle = -rest.positions[40].y;
        // Other processors round otherwise, which can cost a few solves; the tolerance leaves a
        // hundredth of a millimetre open.
        assert!(
            rest.solves.abs_diff(solves) <= 1 + solves / 30,
            "{}",
            rest.solves
        );
        assert!((middle - depth).abs() < 1e-5, "{middle}");
    }
}
