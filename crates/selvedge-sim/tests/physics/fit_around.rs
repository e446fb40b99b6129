//! Fitting a cloth into its pattern around bodies that are in the way.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Handles, Obstacle, Scene, bodies};
use selvedge_sim::{ContactGauge, FitError, fit};

use crate::scenes::hanging;
use crate::sewn::tube;

/// Radius of the tube in its pattern `[m]`.
const RADIUS: f64 = 0.1;

/// A tube that stands open, at 1.8 times its radius, around a capsule of `radius` `[m]`.
fn around(radius: f64) -> Scene {
    let columns = 24;
    let side = 2.0 * RADIUS * (PI / columns as f64).sin();
    let mesh = tube(columns, 12, side);
    let open = mesh.positions().iter();
    let open = open
        .map(|p| DVec3::new(1.8 * p.x, p.y, 1.8 * p.z))
        .collect();
    let mut scene = hanging(4);
    scene.mesh = mesh.with_positions(open).unwrap();
    scene.handles = Handles::new(&[], scene.mesh.positions().len()).unwrap();
    scene.motion = selvedge_cloth::Motion::still(1.0);
    scene.contact = Some(ContactSettings::default());
    let body = bodies::capsule(radius, 1.0, 0.02);
    let points = body.points.iter().map(|p| *p - DVec3::Y * 0.15).collect();
    scene.obstacles = vec![Obstacle::new("post", points, body.faces).unwrap()];
    scene
}

fn fitted(scene: &Scene) -> selvedge_sim::Fitted {
    let found = fit(scene, &mut |_| ControlFlow::Continue(())).unwrap();
    let frame: Vec<_> = found.positions.iter().map(|p| p.as_vec3()).collect();
    let left = ContactGauge::of(scene).unwrap().measure(0, &frame);
    assert_eq!(left.intersections, 0);
    found
}

#[test]
fn a_tube_shrinks_to_its_size_around_a_thin_post_and_onto_a_thick_one() {
    let thin = fitted(&around(0.08));
    assert!(thin.before > 0.75, "{}", thin.before);
    assert!(thin.after < 0.02, "{}", thin.after);
    // Around a post that is thicker than it, the tube stays as wide as that.
    let radius = 0.125;
    let thick = fitted(&around(radius));
    let wanted = radius / RADIUS - 1.0;
    assert!(
        (0.8 * wanted..1.3 * wanted).contains(&thick.after),
        "{} instead of {wanted}",
        thick.after
    );
    let axis = |p: &DVec3| p.with_y(0.0).length();
    let inside = thick.positions.iter().filter(|p| axis(p) < 0.99 * radius);
    assert_eq!(inside.count(), 0);
}

#[test]
fn a_start_that_intersects_is_refused_and_a_fit_can_be_stopped() {
    let mut scene = around(0.08);
    let through = scene.mesh.positions().iter();
    let through = through.map(|p| *p + DVec3::X * 0.15).collect();
    scene.mesh = scene.mesh.with_positions(through).unwrap();
    let error = fit(&scene, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, FitError::Start(_)), "{error}");
    assert!(error.to_string().contains("\"post\""), "{error}");
    let stopped = fit(&around(0.08), &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(FitError::Stopped));
}
