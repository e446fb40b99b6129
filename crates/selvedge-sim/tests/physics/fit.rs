//! Fitting a cloth into its pattern from a start that is far from it.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::Handles;
use selvedge_sim::{FitError, fit};

use crate::scenes::{hanging, largest_distance, noise, stretches};

fn carry_on(_: selvedge_sim::FitProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn a_cloth_that_starts_far_too_large_relaxes_to_its_size() {
    let mut scene = hanging(15);
    let middle = DVec3::new(0.0, -0.5, 0.0);
    // Held in one point only, so that nothing keeps it from its pattern.
    scene.handles = Handles::new(&[7], 225).unwrap();
    let held = scene.mesh.positions()[7];
    for scale in [36.0, 0.2] {
        let start = scene.mesh.positions().iter().zip(noise(225, 0.01));
        let grown: Vec<DVec3> = start.map(|(p, n)| held + scale * (*p - held) + n).collect();
        let mut far = scene.clone();
        far.mesh = far.mesh.with_positions(grown).unwrap();
        let fitted = fit(&far, &mut carry_on).unwrap();
        assert!(fitted.before > 0.7, "{}", fitted.before);
        assert!(fitted.after < 0.02, "{scale}: {}", fitted.after);
        // The noise moved the handle, and there it stays.
        assert_eq!(fitted.positions[7], far.mesh.positions()[7]);
        let bounds = 0.97..1.03;
        for stretch in stretches(&far.mesh, &fitted.positions) {
            assert!(
                stretch.iter().all(|s| bounds.contains(s)),
                "{scale}: {stretch:?}"
            );
        }
        assert!(fitted.positions.iter().all(|p| p.distance(middle) < 2.0));
    }
}

#[test]
fn a_vertex_that_was_dragged_away_comes_back() {
    let mut scene = hanging(15);
    let mut positions = scene.mesh.positions().to_vec();
    positions[100] += DVec3::new(1.2, 0.8, -2.0);
    let flat = scene.mesh.positions().to_vec();
    scene.mesh = scene.mesh.with_positions(positions).unwrap();
    let fitted = fit(&scene, &mut carry_on).unwrap();
    assert!(fitted.before > 10.0 && fitted.after < 0.02, "{fitted:?}");
    // The others keep their places but for a few centimetres.
    assert!(largest_distance(&fitted.positions, &flat) < 0.2);
}

#[test]
fn a_cloth_in_its_pattern_stays_as_it_is_and_one_that_cannot_fit_keeps_its_strain() {
    let scene = hanging(9);
    let fitted = fit(&scene, &mut carry_on).unwrap();
    assert!(fitted.before < 1e-12 && fitted.after < 1e-9, "{fitted:?}");
    assert!(largest_distance(&fitted.positions, scene.mesh.positions()) < 1e-9);
    let mut torn = scene.clone();
    let mut positions = torn.mesh.positions().to_vec();
    for corner in [0, 8] {
        positions[corner].z *= 3.0;
    }
    torn.mesh = torn.mesh.with_positions(positions).unwrap();
    let held = fit(&torn, &mut carry_on).unwrap();
    // Corners 3 m apart hold an edge of 1 m.
    assert!(held.after > 0.5, "{}", held.after);
    assert!(held.positions.iter().all(|p| p.is_finite()));
}

#[test]
fn a_fit_can_be_stopped() {
    let mut scene = hanging(9);
    let positions = scene.mesh.positions().iter().map(|p| *p * 5.0).collect();
    scene.mesh = scene.mesh.with_positions(positions).unwrap();
    let stopped = fit(&scene, &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(FitError::Stopped));
}
