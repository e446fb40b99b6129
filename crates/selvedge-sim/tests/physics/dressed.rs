//! A cloth made ready from where it meets itself, or where a body is in the way.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Handles, Motion, Obstacle, Scene, Stepper, bodies};
use selvedge_sim::{ContactGauge, FitError, Simulator, dress, fit, untangle};

use crate::fit::carry_on;
use crate::scenes::{at_rest, hanging, noise, still};
use crate::sewn::tube;

fn meeting(scene: &Scene, positions: &[DVec3]) -> usize {
    let frame: Vec<_> = positions.iter().map(|p| p.as_vec3()).collect();
    ContactGauge::of(scene)
        .unwrap()
        .measure(0, &frame)
        .intersections
}

/// A sheet of `side`² vertices that nothing holds, at `place` of its unit square.
fn sheet(side: usize, place: impl Fn(f64, f64) -> DVec3) -> Scene {
    let mut scene = hanging(side);
    let flat = scene.mesh.positions().iter();
    let places = flat.map(|p| place(p.z + 0.5, -p.y)).collect();
    scene.mesh = scene.mesh.with_positions(places).unwrap();
    scene.handles = Handles::new(&[], side * side).unwrap();
    scene.motion = Motion::still(1.0);
    scene.contact = Some(ContactSettings::default());
    scene.environment.gravity = DVec3::ZERO;
    scene
}

/// A sheet that is rolled up once and a bit, its end through its begin.
fn roll() -> Scene {
    sheet(15, |u, v| {
        let angle = 2.2 * PI * u;
        let radius = 0.15 + 0.02 * (u - 0.5) * (PI * (2.0 * v - 1.0)).sin();
        DVec3::new(radius * angle.cos(), -v, radius * angle.sin())
    })
}

/// Runs ten frames from `positions`, and counts what meets in any.
fn run_from(scene: &Scene, positions: Vec<DVec3>) -> usize {
    let mut simulator = at_rest(scene, positions);
    let frames = (0..10).map(|_| {
        simulator.step(&still(scene)).unwrap();
        simulator.intersection_count()
    });
    frames.sum()
}

#[test]
fn a_sheet_that_is_rolled_through_itself_is_moved_apart_and_runs() {
    let scene = roll();
    let before = meeting(&scene, scene.mesh.positions());
    assert!(before > 5, "{before}");
    let refused = Simulator::new(&scene).err().unwrap().to_string();
    assert!(refused.contains("start = \"untangle\""), "{refused}");
    let found = untangle(&scene, &mut carry_on).unwrap();
    assert_eq!(found.before, before);
    assert_eq!(meeting(&scene, &found.positions), 0);
    assert!(found.farthest < 0.06, "{}", found.farthest);
    assert_eq!(run_from(&scene, found.positions), 0);
    let stopped = untangle(&scene, &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(FitError::Stopped));
}

#[test]
fn what_does_not_meet_itself_stays_to_the_bit_and_handles_that_cross_are_named() {
    let flat = sheet(9, |u, v| DVec3::new(u, -v, 0.0));
    let found = untangle(&flat, &mut carry_on).unwrap();
    assert_eq!((found.before, found.moved), (0, 0));
    assert_eq!(found.positions, flat.mesh.positions());
    let mut held = roll();
    let all: Vec<u32> = (0..225).collect();
    held.handles = Handles::new(&all, 225).unwrap();
    let error = untangle(&held, &mut carry_on).unwrap_err();
    assert!(matches!(error, FitError::Tangled { .. }), "{error}");
}

#[test]
fn crumpled_sheets_are_moved_apart() {
    let mut tangled = 0;
    for seed in 1..=8 {
        let bumps = noise(4 * seed, 1.0);
        let scene = sheet(13, |u, v| {
            let mut place = DVec3::new(0.7 * u, -0.7 * v, 0.0);
            for (k, bump) in bumps.iter().rev().take(4).enumerate() {
                let phase = (2 + k) as f64 * (u + bump.x * v) + bump.y;
                place += 0.06 * (2.0 * PI * phase).sin() * (DVec3::Z + 0.8 * *bump);
            }
            place
        });
        let found = untangle(&scene, &mut carry_on).unwrap();
        assert_eq!(meeting(&scene, &found.positions), 0, "{seed}");
        tangled += u32::from(found.before > 0);
    }
    assert!(tangled >= 6, "{tangled}");
}

/// Radius of the tube in its pattern `[m]`.
const RADIUS: f64 = 0.1;

/// A tube of cloth about the y axis that stands `open` times as wide as its pattern, with a capsule of
/// `radius` `[m]` through it, `aside` `[m]`.
fn around(open: f64, radius: f64, aside: f64) -> Scene {
    let columns = 24;
    let side = 2.0 * RADIUS * (PI / columns as f64).sin();
    let mesh = tube(columns, 12, side);
    let places = mesh.positions().iter();
    let places = places.map(|p| DVec3::new(open * p.x, p.y, open * p.z));
    let mut scene = sheet(4, |u, v| DVec3::new(u, -v, 0.0));
    scene.mesh = mesh.clone().with_positions(places.collect()).unwrap();
    scene.handles = Handles::new(&[], mesh.positions().len()).unwrap();
    scene.environment = hanging(4).environment;
    let body = bodies::capsule(radius, 1.0, 0.02);
    let points = body.points.iter();
    let points = points.map(|p| *p + DVec3::new(aside, -0.15, 0.0)).collect();
    scene.obstacles = vec![Obstacle::new("post", points, body.faces).unwrap()];
    scene
}

#[test]
fn a_tube_shrinks_to_its_size_around_a_thin_post_and_onto_a_thick_one() {
    let [thin, thick] = [0.08, 0.125].map(|radius| {
        let scene = around(1.8, radius, 0.0);
        let found = fit(&scene, &mut carry_on).unwrap();
        assert_eq!(meeting(&scene, &found.positions), 0);
        found
    });
    assert!(thin.before > 0.75, "{}", thin.before);
    assert!(thin.after < 0.02, "{}", thin.after);
    // Around a post that is thicker than it, the tube stays as wide as that.
    let wanted = 0.125 / RADIUS - 1.0;
    assert!(
        (0.8 * wanted..1.3 * wanted).contains(&thick.after),
        "{} instead of {wanted}",
        thick.after
    );
    let axis = |p: &DVec3| p.with_y(0.0).length();
    let inside = thick.positions.iter().filter(|p| axis(p) < 0.99 * 0.125);
    assert_eq!(inside.count(), 0);
}

#[test]
fn a_start_that_intersects_is_refused_and_a_fit_can_be_stopped() {
    let error = fit(&around(1.8, 0.08, -0.15), &mut carry_on).unwrap_err();
    assert!(matches!(error, FitError::Start(_)), "{error}");
    assert!(error.to_string().contains("\"post\""), "{error}");
    let stopped = fit(&around(1.8, 0.08, 0.0), &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(FitError::Stopped));
}

#[test]
fn a_tube_gets_around_a_body_that_goes_through_its_wall() {
    // The last body has the whole tube within it, and meets it nowhere.
    for (radius, aside) in [(0.08, 0.06), (0.105, 0.0)] {
        let scene = around(1.0, radius, aside);
        let before = meeting(&scene, scene.mesh.positions());
        if aside > 0.0 {
            assert!(before > 20, "{before}");
            let refused = Simulator::new(&scene).err().unwrap().to_string();
            assert!(refused.contains("dress = \"post\""), "{refused}");
        }
        let dressed = dress(&scene, "post", &mut carry_on).unwrap();
        assert_eq!(dressed.before, before);
        assert_eq!(meeting(&scene, &dressed.positions), 0);
        assert!(dressed.strains[1] < 0.25, "{:?}", dressed.strains);
        // Around it: every level of the tube winds once about the axis of the body.
        let axis = DVec3::X * aside;
        for level in dressed.positions.chunks(24) {
            let angle = |p: &DVec3| (p.z - axis.z).atan2(p.x - axis.x);
            let turns = (0..level.len()).map(|k| {
                let by = angle(&level[(k + 1) % level.len()]) - angle(&level[k]);
                (by + PI).rem_euclid(2.0 * PI) - PI
            });
            let turns: f64 = turns.sum();
            assert!((turns.abs() - 2.0 * PI).abs() < 1e-6, "{turns}");
        }
        assert_eq!(run_from(&scene, dressed.positions), 0);
    }
}

#[test]
fn what_cannot_be_dressed_says_where() {
    // Beside the tube's axis, and across it.
    let mut across = around(1.0, 0.08, 0.0);
    let turned = across.obstacles[0].positions_at(0.0);
    let turned = turned.map(|p| DVec3::new(p.y, p.x - 0.1, p.z)).collect();
    let faces = across.obstacles[0].faces().to_vec();
    across.obstacles = vec![Obstacle::new("bar", turned, faces).unwrap()];
    let error = dress(&across, "bar", &mut carry_on).unwrap_err();
    let FitError::NotClear { body, place, .. } = &error else {
        panic!("{error}");
    };
    assert!(body == "bar" && (place.y + 0.1).abs() < 0.1, "{error}");
    // The upper end of the tube is above the post: near it that is told, far from it the cloth is refused.
    let above = |way: f64| {
        let mut scene = around(1.0, 0.105, 0.0);
        let points = scene.obstacles[0].positions_at(0.0);
        let points = points.map(|p| p - way * DVec3::Y).collect();
        let faces = scene.obstacles[0].faces().to_vec();
        scene.obstacles = vec![Obstacle::new("post", points, faces).unwrap()];
        scene
    };
    let dressed = dress(&above(0.0), "post", &mut carry_on).unwrap();
    assert!(dressed.empty.is_empty(), "{:?}", dressed.empty);
    let dressed = dress(&above(0.6), "post", &mut carry_on).unwrap();
    assert!(
        dressed.empty.len() == 1 && dressed.empty[0].contains("cm around"),
        "{:?}",
        dressed.empty
    );
    let far = dress(&above(0.8), "post", &mut carry_on).unwrap_err();
    assert!(matches!(far, FitError::Beside { .. }), "{far}");
    assert!(far.to_string().contains("arms out"), "{far}");
    let unknown = dress(&across, "post", &mut carry_on).unwrap_err();
    assert!(matches!(unknown, FitError::NoBody { .. }));
    let stopped = dress(&around(1.0, 0.105, 0.0), "post", &mut |_| {
        ControlFlow::Break(())
    });
    assert_eq!(stopped, Err(FitError::Stopped));
}
