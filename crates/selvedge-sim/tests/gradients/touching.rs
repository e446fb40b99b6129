//! Gradients of runs with contact against central differences.

use glam::{DQuat, DVec3};
use selvedge_cloth::bodies::{self, Body, Core};
use selvedge_cloth::{ContactSettings, Handles, Integrator, Mesh, Obstacle, Stepper};
use selvedge_sim::{Gradient, GradientSettings, Simulator};

use crate::differences::{Case, vectors};
use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, material};
use crate::sheets::{grid, scene};

const KINDS: [&str; 6] = ["ball", "floor", "box", "capsule", "slope", "fold"];

/// A rumpled sheet of 6 by 6 squares of 5 cm that falls on a body, with some slip, or a folded one that falls
/// onto a floor and its own half.
fn falling(number: usize, frames: usize) -> Case {
    let kind = KINDS[number % 6];
    let shift = vectors(9000 + number, 1)[0] * 0.03;
    let aside = shift * DVec3::new(1.0, 0.0, 1.0);
    let body = match kind {
        "ball" => bodies::sphere(0.2, 0.1).placed(1.0, |p| p - DVec3::Y * 0.2 + aside),
        "floor" => bodies::plane([1.0, 1.0]),
        "box" => {
            bodies::cuboid(DVec3::new(0.2, 0.1, 0.15)).placed(1.0, |p| p - DVec3::Y * 0.05 + aside)
        }
        "capsule" => bodies::capsule(0.05, 0.4, 0.05).placed(1.0, |p| {
            DQuat::from_rotation_x(1.57) * p - DVec3::Y * 0.05 + aside
        }),
        "slope" => bodies::cuboid(DVec3::new(0.3, 0.02, 0.3))
            .placed(1.0, |p| DQuat::from_rotation_z(0.3) * p - DVec3::Y * 0.06),
        _ => bodies::plane([1.0, 1.0]).placed(1.0, |p| p - DVec3::Y * 0.004),
    };
    let mesh = grid(6, 6, 0.05, |p| DVec3::new(p.x - 0.15, 0.004, p.y - 0.15));
    let mut scene = scene(mesh, material([GRAY, CAMEL, DENIM, NAVY][number % 4]), &[]);
    scene.environment.air_density = 1.2;
    scene.obstacles = vec![Obstacle::of("body", body).unwrap()];
    scene.contact = Some(ContactSettings {
        thickness: 2e-3,
        friction: [0.0, 0.3, 0.7][number / 6 % 3],
        ..ContactSettings::default()
    });
    let folded = |p: DVec3| {
        let (half, radius) = (0.03, 0.06 / std::f64::consts::PI);
        let angle = ((p.x + half) / radius).clamp(0.0, std::f64::consts::PI);
        let along = if p.x < -half { p.x } else { -half - (p.x - half).max(0.0) };
        let out = if p.x.abs() < half { radius * angle.sin() } else { 0.0 };
        DVec3::new(along + out, radius * (1.0 - angle.cos()), p.z)
    };
    let start = scene.mesh.positions();
    let places = start.iter().zip(vectors(0, start.len()));
    let place = |p: DVec3| if kind == "fold" { folded(p) } else { p };
    Case {
        positions: places.map(|(p, n)| place(*p) + n * 1e-3).collect(),
        velocities: vectors(500, start.len())
            .iter()
            .map(|n| *n * 0.02 + shift * 10.0)
            .collect(),
        targets: vec![(Vec::new(), Vec::new()); frames],
        scene,
    }
}

/// Two sheets of 2 by 2 squares of 5 cm that lie on a floor and on each other, until the fabric has come to bear
/// them by its curve.
fn pile(number: usize, frames: usize) -> Case {
    let mut case = falling(number, frames);
    let one = grid(2, 2, 0.05, |p| DVec3::new(p.x - 0.05, 0.0, p.y - 0.05));
    let faces = one.topology().face_indices();
    let above = faces.iter().map(|face| face.map(|v| v + 9));
    let faces: Vec<_> = faces.iter().copied().chain(above).collect();
    let flat = [one.material_coordinates(); 2].concat();
    let aside = DVec3::new(0.011, 0.0, 0.007);
    let place = |layer: usize| {
        let up = DVec3::Y * [1.42e-3, 3.11e-3][layer] + aside * layer as f64;
        one.positions().iter().map(move |p| *p + up)
    };
    let places = place(0).chain(place(1)).zip(vectors(0, 18));
    case.positions = places.map(|(p, n)| p + n * 3e-6).collect();
    case.velocities = vectors(500, 18).iter().map(|n| *n * 1e-4).collect();
    case.scene.handles = Handles::new(&[], 18).unwrap();
    case.scene.physics.substeps = 4;
    case.scene.mesh = Mesh::new(&faces, flat, case.positions.clone()).unwrap();
    case
}

impl Case {
    /// Errors of the gradient along some directions of the start, by gravity and by motions of the body, in
    /// ascending order: relative to the greater of the slope and the size of what it belongs to.
    fn errors(&self) -> Vec<f64> {
        let gradient = self.gradient();
        let count = self.positions.len();
        let dot =
            |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let mut errors = Vec::new();
        let mut compare = |is: f64, scale: f64, step: f64, change: &dyn Fn(&mut Self, f64)| {
            let slope = self.slope(is, step, change);
            errors.push((is - slope).abs() / is.abs().max(slope.abs()).max(scale));
        };
        for k in 0..3 {
            let along = vectors(3000 + 100 * k, count);
            let by = &gradient.start.positions;
            compare(dot(by, &along), dot(by, by).sqrt(), 1e-8, &|case, part| {
                let moved = case.positions.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
            let by = &gradient.start.velocities;
            compare(dot(by, &along), dot(by, by).sqrt(), 1e-7, &|case, part| {
                let moved = case.velocities.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
        }
        let density = gradient.materials[0].density;
        compare(density, 0.0, 1e-6, &|case, part| {
            case.scene.material.density += part
        });
        let frames = || gradient.obstacles.iter().map(|frame| frame[0]);
        let translation: DVec3 = frames().map(|by| by.translation).sum();
        let rotation: DVec3 = frames().map(|by| by.rotation).sum();
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let by = gradient.gravity;
            compare(by.dot(axis), by.length(), 1e-5, &|case, part| {
                case.scene.environment.gravity += axis * part;
            });
            let by = translation;
            compare(by.dot(axis), by.length(), 1e-8, &|case, part| {
                case.put_body(|p| p + axis * part);
            });
            let by = rotation;
            compare(by.dot(axis), by.length(), 1e-8, &|case, part| {
                case.put_body(|p| DQuat::from_scaled_axis(axis * part) * p);
            });
        }
        errors.sort_by(f64::total_cmp);
        errors
    }

    fn put_body(&mut self, place: impl Fn(DVec3) -> DVec3) {
        let old = &self.scene.obstacles[0];
        let body = Body {
            points: old.positions_at(0.0).map(&place).collect(),
            faces: old.faces().to_vec(),
            core: old.core_at(0.0).map(|core| Core {
                ends: core.ends.map(&place),
                ..core
            }),
        };
        self.scene.obstacles = vec![Obstacle::of("body", body).unwrap()];
    }
}

/// A test for each kind of body, so that they run beside each other.
macro_rules! touching {
    ($($name: ident, $number: expr;)*) => {$(
        #[test]
        fn $name() {
            let errors = falling($number, 6).errors();
            let [median, worst] = [errors[errors.len() / 2], errors[errors.len() - 1]];
            println!("{}: median {median:.1e}, worst {worst:.1e}", stringify!($name));
            assert!(median < 1e-6 && worst < 1e-4, "{median} {worst}");
        }
    )*};
}

touching! {
    on_a_ball, 12;
    on_a_floor, 7;
    on_a_box, 8;
    on_a_capsule, 9;
    on_a_slope, 16;
    on_itself, 5;
}

/// What has come to bear has a memory, whose derivatives go from substep to substep.
#[test]
fn a_pile_has_the_slopes_of_what_it_has_come_to_bear() {
    for number in [7, 13] {
        let frames = 45;
        let case = pile(number, frames);
        let mut simulator = case.simulator();
        for frame in 0..frames {
            simulator.step(&case.targets(frame)).unwrap();
        }
        let memory = simulator.checkpoint().contact.unwrap();
        let anchors = memory.anchors.iter();
        let borne = anchors.filter(|anchor| anchor.pressed > 0.01).count();
        assert!(borne >= 3, "{borne}");
        let errors = case.errors();
        let [median, worst] = [errors[errors.len() / 2], errors[errors.len() - 1]];
        println!("pile {number}: {borne} bear, median {median:.1e}, worst {worst:.1e}");
        assert!(median < 1e-6 && worst < 1e-4, "{median} {worst}");
    }
}

#[test]
fn frames_with_contact_that_are_computed_again_give_the_same_gradient() {
    let case = falling(6, 9);
    let all = case.gradient();
    for memory in [1, 50_000, 100_000, 200_000, 400_000] {
        let settings = GradientSettings { memory, segment: 3 };
        assert_eq!(case.gradient_by(settings), all);
    }
}

/// The ball is led upwards under the sheet, frame by frame, by as much as `lift` says beyond.
fn led(memory: usize, lift: [f64; 8]) -> (f64, Gradient) {
    let case = falling(12, 8);
    let mut simulator = case.simulator();
    let settings = GradientSettings { memory, segment: 3 };
    simulator.record_gradient(settings).unwrap();
    for (frame, lift) in lift.iter().enumerate() {
        let way = DVec3::Y * (0.002 * (frame + 1) as f64 + lift);
        simulator.lead_obstacle(0, way).unwrap();
        simulator.step(&case.targets(frame)).unwrap();
    }
    let along = vectors(1, case.positions.len());
    let ends = simulator.positions_f64().iter().zip(&along);
    let value = ends.map(|(x, n)| x.dot(*n)).sum();
    let made = simulator.backward(&mut |frame, by| {
        if frame == 8 {
            let by = by.positions.iter_mut().zip(&along);
            by.for_each(|(by, n)| *by += *n);
        }
    });
    (value, made.unwrap())
}

#[test]
fn a_body_is_led_the_same_way_again_and_has_slopes_of_each_frame() {
    let (_, kept) = led(1 << 30, [0.0; 8]);
    assert_eq!(led(1, [0.0; 8]).1, kept);
    for frame in [2, 5, 7] {
        let found = kept.obstacles[frame + 1][0].translation.y;
        let at = |part: f64| {
            let mut lift = [0.0; 8];
            lift[frame] = part;
            led(1 << 30, lift).0
        };
        let slope = (at(1e-8) - at(-1e-8)) / 2e-8;
        assert!(found.abs() > 1e-3, "{found}");
        assert!(
            (found / slope - 1.0).abs() < 1e-4,
            "{frame}: {found} {slope}"
        );
    }
}

#[test]
fn contact_with_the_linearised_formula_is_refused() {
    let mut case = falling(0, 1);
    case.scene.physics.integrator = Integrator::Linearised;
    let mut simulator = Simulator::new(&case.scene).unwrap();
    let error = simulator.record_gradient(GradientSettings::default());
    let text = error.unwrap_err().to_string();
    assert!(text.contains("physics.integrator"), "{text}");
}

/// `cargo test --release -p selvedge-sim --test gradients table_of_contact -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn table_of_contact() {
    let mut all = Vec::new();
    for number in 0..36 {
        let case = falling(number, 30);
        let errors = case.errors();
        let [median, worst] = [errors[errors.len() / 2], errors[errors.len() - 1]];
        let friction = case.scene.contact.unwrap().friction;
        println!(
            "{number} {}, friction {friction}: {median:.1e}, {worst:.1e}",
            KINDS[number % 6]
        );
        all.extend(errors);
    }
    all.sort_by(f64::total_cmp);
    let beyond = |bound: f64| all.iter().filter(|error| **error > bound).count();
    println!(
        "median {:.1e} of {}; beyond 1e-3: {}, 1e-2: {}",
        all[all.len() / 2],
        all.len(),
        beyond(1e-3),
        beyond(1e-2)
    );
}
