//! Fitting a cloth into its pattern from a start that is far from it.

use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{Handles, LoosePanels, Scene};
use selvedge_sim::{FitError, fit, sew_and_fit};

use crate::scenes::{hanging, largest_distance, noise, stretches};

pub(crate) fn carry_on(_: selvedge_sim::FitProgress) -> ControlFlow<()> {
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

/// The faces of a sheet in the yz-plane beyond z = 0 as a panel of its own, moved by `shift`.
fn cut_apart(scene: &Scene, shift: DVec3) -> LoosePanels {
    let mesh = &scene.mesh;
    let count = mesh.positions().len() as u32;
    let mut places = mesh.positions().to_vec();
    places.extend(mesh.positions().iter().map(|p| *p + shift));
    let faces: Vec<[u32; 3]> = mesh
        .topology()
        .face_indices()
        .into_iter()
        .map(|face| {
            let middle: f64 = face.iter().map(|&v| mesh.positions()[v as usize].z).sum();
            let offset = if middle > 0.0 { count } else { 0 };
            face.map(|v| v + offset)
        })
        .collect();
    LoosePanels::new(&faces, &places).unwrap()
}

#[test]
fn panels_are_pulled_together_along_their_seam_and_become_one() {
    let mut scene = hanging(9);
    scene.handles = Handles::new(&[], 81).unwrap();
    // Nothing but the seam moves them, so that their centre of mass stays.
    scene.environment.air_density = 0.0;
    let shift = DVec3::new(0.1, 0.0, 0.3);
    let loose = cut_apart(&scene, shift);
    let (mut gaps, mut done) = (Vec::new(), 0.0);
    let fitted = sew_and_fit(&scene, &loose, &mut |now| {
        gaps.extend(now.gap);
        assert!(now.done >= done && now.done <= 1.0, "{}", now.done);
        done = now.done;
        ControlFlow::Continue(())
    })
    .unwrap();
    let gap = fitted.gap.unwrap();
    assert!((gap - shift.length()).abs() < 1e-9, "{gap}");
    // Over a second: closed bit by bit, half of it half way.
    assert!(
        gaps.len() >= 20 && gaps.is_sorted_by(|a, b| a >= b),
        "{gaps:?}"
    );
    assert!(
        (gaps[gaps.len() / 2 - 1] / gap - 0.5).abs() < 0.1,
        "{gaps:?}"
    );
    assert_eq!(gaps.last(), Some(&0.0));
    assert!(fitted.after < 0.02, "{}", fitted.after);
    let rest = scene.rest_shape();
    let all: f64 = rest.vertex_mass.iter().sum();
    let centre = |positions: &[DVec3]| -> DVec3 {
        let each = positions.iter().zip(&rest.vertex_mass);
        each.map(|(p, mass)| *p * *mass).sum::<DVec3>() / all
    };
    // Half of the faces are beyond the line, as nearly as the mesh is even.
    let moved = centre(&fitted.positions) - centre(scene.mesh.positions());
    assert!((moved - 0.5 * shift).length() < 0.01, "{moved}");
}

#[test]
fn held_seams_end_where_the_sewn_mesh_has_them() {
    let mut scene = hanging(9);
    // The whole upper edge, over the seam.
    scene.handles = Handles::new(&[0, 1, 2, 3, 4, 5, 6, 7, 8], 81).unwrap();
    let loose = cut_apart(&scene, DVec3::new(0.2, -0.1, 0.1));
    let fitted = sew_and_fit(&scene, &loose, &mut carry_on).unwrap();
    for handle in 0..9 {
        let distance = fitted.positions[handle].distance(scene.mesh.positions()[handle]);
        assert!(distance < 1e-12, "{handle}: {distance}");
    }
    assert!(fitted.after < 0.02, "{}", fitted.after);
    let stopped = sew_and_fit(&scene, &loose, &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(FitError::Stopped));
}
