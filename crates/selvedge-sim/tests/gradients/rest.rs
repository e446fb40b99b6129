//! The gradient of a rest pose against central differences of the search for it.

use glam::{DVec2, DVec3};
use selvedge_cloth::{HandleConstraint, Mesh, Scene};
use selvedge_sim::{sag, sag_gradient};

use crate::differences::with_points;
use crate::scenes::{GRAY, NAVY, hanging, material};

/// Weights of the value, a sum over the positions.
fn seed(count: usize) -> Vec<DVec3> {
    let of = |k: usize| DVec3::new((2.3 * k as f64).sin(), 1.0, (1.1 * k as f64).cos());
    (0..count).map(of).collect()
}

fn value(scene: &Scene) -> f64 {
    let rest = sag(scene).unwrap();
    let places = rest.positions.iter().zip(seed(rest.positions.len()));
    places.map(|(x, by)| x.dot(by)).sum()
}

fn check(scene: &Scene, name: &str, found: f64, step: f64, change: impl Fn(&mut Scene, f64)) {
    let at = |part: f64| {
        let mut moved = scene.clone();
        change(&mut moved, part);
        value(&moved)
    };
    let slope = (at(step) - at(-step)) / (2.0 * step);
    let error = (found - slope).abs() / slope.abs();
    println!("{name}: {found:.6e} {slope:.6e} {error:.1e}");
    assert!(error < 1e-5, "{name}: {found} {slope}");
}

#[test]
fn a_hanging_cloth() {
    for (fabric, constraint) in [
        (GRAY, HandleConstraint::Exact),
        (NAVY, HandleConstraint::Exact),
        (GRAY, HandleConstraint::Spring),
    ] {
        let mut scene = hanging(6);
        scene.material = material(fabric);
        scene.physics.handles = constraint;
        // Handles nearer to each other than in the pattern: it hangs in folds.
        let mut places = scene.mesh.positions().to_vec();
        places[0].z += 0.08;
        let corners = scene.mesh.topology().face_indices();
        let points = scene.mesh.pattern().points().to_vec();
        scene.mesh = Mesh::new(&corners, points.clone(), places.clone()).unwrap();
        scene.sag.tolerance = 1e-9;
        let rest = sag(&scene).unwrap();
        let by = seed(rest.positions.len());
        let gradient = sag_gradient(&scene, &rest.positions, &by).unwrap();
        let material = &gradient.materials[0];
        check(&scene, "gravity", gradient.gravity.y, 1e-4, |s, part| {
            s.environment.gravity.y += part;
        });
        check(&scene, "density", material.density, 1e-6, |s, part| {
            s.material.density += part;
        });
        check(
            &scene,
            "stretch",
            material.stretch[0][0],
            1e-3,
            |s, part| {
                s.material.stretch.0[0][0] += part;
            },
        );
        check(&scene, "bend", material.bend[1][0], 1e-9, |s, part| {
            s.material.bend.0[1][0] += part;
        });
        let turn = |k: usize, part: f64| DVec2::from_angle(k as f64) * part;
        let by = gradient.pattern.iter().enumerate();
        let by: f64 = by.map(|(k, by)| by.dot(turn(k, 1.0))).sum();
        check(&scene, "pattern", by, 1e-7, |s, part| {
            s.mesh = with_points(&s.mesh, |_, k, p| p + turn(k, part));
        });
        check(&scene, "handle", gradient.handles[0].z, 1e-6, |s, part| {
            let mut places = places.clone();
            places[0].z += part;
            s.mesh = Mesh::new(&corners, points.clone(), places).unwrap();
        });
    }
}
