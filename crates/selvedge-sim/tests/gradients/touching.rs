//! Gradients of runs with contact against central differences.

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Obstacle, bodies};

use crate::differences::{Case, vectors};
use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, material};
use crate::sheets::{grid, scene};

/// A rumpled sheet of 6 by 6 squares that falls on these bodies.
fn falling(obstacles: Vec<Obstacle>, friction: f64, frames: usize) -> Case {
    let mesh = grid(6, 6, 0.05, |p| DVec3::new(p.x - 0.15, 0.004, p.y - 0.15));
    let mut scene = scene(mesh, material(GRAY), &[]);
    scene.obstacles = obstacles;
    scene.contact = Some(ContactSettings {
        thickness: 2e-3,
        friction,
        ..ContactSettings::default()
    });
    scene.environment.air_density = 1.2;
    let start = scene.mesh.positions();
    let count = start.len();
    let rumpled = start.iter().zip(vectors(0, count));
    Case {
        positions: rumpled.map(|(x, n)| *x + n * 1e-3).collect(),
        velocities: vectors(500, count).iter().map(|n| *n * 0.02).collect(),
        targets: vec![(Vec::new(), Vec::new()); frames],
        scene,
    }
}

impl Case {
    /// Errors of the gradient along some directions of the start and by gravity, relative to the greater of
    /// the slope and the size of what it belongs to.
    fn errors(&self) -> Vec<(String, f64)> {
        let gradient = self.gradient();
        let count = self.positions.len();
        let dot =
            |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let mut errors = Vec::new();
        let mut keep = |name: String, found: f64, slope: f64, scale: f64| {
            let error = (found - slope).abs() / found.abs().max(slope.abs()).max(scale);
            errors.push((name, error));
        };
        for k in 0..4 {
            let along = vectors(3000 + 100 * k, count);
            let by = &gradient.start.positions;
            let is = dot(by, &along);
            let slope = self.slope(is, 1e-8, |case, part| {
                let moved = case.positions.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
            keep(format!("positions {k}"), is, slope, dot(by, by).sqrt());
            let by = &gradient.start.velocities;
            let is = dot(by, &along);
            let slope = self.slope(is, 1e-7, |case, part| {
                let moved = case.velocities.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
            keep(format!("velocities {k}"), is, slope, dot(by, by).sqrt());
        }
        for number in 0..self.scene.obstacles.len() {
            let all = gradient.obstacles.iter().map(|frame| frame[number]);
            let (mut translation, mut rotation) = (DVec3::ZERO, DVec3::ZERO);
            for one in all {
                translation += one.translation;
                rotation += one.rotation;
            }
            let mut move_all = |name: &str,
                                by: DVec3,
                                step: f64,
                                scale: f64,
                                to: &dyn Fn(DVec3, DVec3) -> DVec3| {
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let is = by.dot(axis);
                    let slope = self.slope(is, step, |case, part| {
                        let old = &case.scene.obstacles[number];
                        let body = bodies::Body {
                            points: old.positions_at(0.0).map(|p| to(p, axis * part)).collect(),
                            faces: old.faces().to_vec(),
                            core: old.core_at(0.0).map(|core| bodies::Core {
                                ends: core.ends.map(|p| to(p, axis * part)),
                                ..core
                            }),
                        };
                        case.scene.obstacles[number] = Obstacle::of("moved", body).unwrap();
                    });
                    keep(format!("{name} {number}"), is, slope, scale);
                }
            };
            move_all(
                "translation",
                translation,
                1e-8,
                translation.length(),
                &|p, by| p + by,
            );
            move_all("rotation", rotation, 1e-8, rotation.length(), &|p, by| {
                glam::DQuat::from_scaled_axis(by) * p
            });
        }
        for axis in 0..3 {
            let by = gradient.gravity;
            let slope = self.slope(by[axis], 1e-5, |case, part| {
                case.scene.environment.gravity[axis] += part;
            });
            keep(format!("gravity {axis}"), by[axis], slope, by.length());
        }
        errors
    }
}

fn ball() -> Vec<Obstacle> {
    let ball = bodies::sphere(0.2, 0.1).placed(1.0, |p| p + DVec3::new(0.01, -0.2, 0.02));
    vec![Obstacle::of("ball", ball).unwrap()]
}

fn floor() -> Vec<Obstacle> {
    let floor = bodies::plane([1.0, 1.0]);
    vec![Obstacle::of("floor", floor).unwrap()]
}

/// A case of one of many kinds, by its number.
fn many(number: usize, frames: usize) -> (String, Case) {
    let kind = number % 6;
    let friction = [0.0, 0.3, 0.7][number / 6 % 3];
    let at = |body: bodies::Body, place: DVec3| body.placed(1.0, |p| p + place);
    let shift = vectors(9000 + number, 1)[0] * 0.03;
    let bodies = match kind {
        0 => vec![at(
            bodies::sphere(0.2, 0.1),
            DVec3::new(0.0, -0.2, 0.0) + shift * DVec3::new(1.0, 0.0, 1.0),
        )],
        1 => vec![bodies::plane([1.0, 1.0])],
        2 => vec![at(
            bodies::cuboid(DVec3::new(0.2, 0.1, 0.15)),
            DVec3::new(0.0, -0.05, 0.0) + shift * DVec3::new(1.0, 0.0, 1.0),
        )],
        3 => vec![at(
            bodies::capsule(0.05, 0.4, 0.05)
                .placed(1.0, |p| glam::DQuat::from_rotation_x(1.57) * p),
            DVec3::new(0.0, -0.05, 0.0) + shift * DVec3::new(1.0, 0.0, 1.0),
        )],
        4 => vec![at(
            bodies::cuboid(DVec3::new(0.3, 0.02, 0.3))
                .placed(1.0, |p| glam::DQuat::from_rotation_z(0.3) * p),
            DVec3::new(0.0, -0.06, 0.0),
        )],
        _ => Vec::new(),
    };
    let obstacles = bodies
        .into_iter()
        .enumerate()
        .map(|(k, body)| Obstacle::of(&format!("body {k}"), body).unwrap());
    let mut case = falling(obstacles.collect(), friction, frames);
    case.scene.material = material([GRAY, CAMEL, DENIM, NAVY][number % 4]);
    if kind == 5 {
        // Folded over itself: the far half lies above the near one.
        let half = |p: DVec3| {
            let angle = ((p.x + 0.03) / 0.06).clamp(0.0, 1.0) * std::f64::consts::PI;
            let radius = 0.06 / std::f64::consts::PI;
            match p.x {
                x if x < -0.03 => DVec3::new(x, 0.0, p.z),
                x if x > 0.03 => DVec3::new(-0.03 - (x - 0.03), 2.0 * radius, p.z),
                _ => DVec3::new(
                    -0.03 + radius * angle.sin(),
                    radius * (1.0 - angle.cos()),
                    p.z,
                ),
            }
        };
        let noise = vectors(0, case.positions.len());
        let flat = case.scene.mesh.positions().to_vec();
        for (k, p) in case.positions.iter_mut().enumerate() {
            *p = half(flat[k] * DVec3::new(1.0, 0.0, 1.0)) + noise[k] * 1e-3;
        }
        case.scene.obstacles = vec![
            Obstacle::of(
                "floor",
                bodies::plane([1.0, 1.0]).placed(1.0, |p| p - DVec3::Y * 0.004),
            )
            .unwrap(),
        ];
    }
    case.velocities.iter_mut().for_each(|v| *v += shift * 10.0);
    (format!("{number} kind {kind} friction {friction}"), case)
}

fn show(name: &str, case: &Case) {
    if std::env::var("SHOW").is_ok() {
        println!("{name}");
        case.gradient();
    }
    use selvedge_cloth::Stepper;
    let start = (case.positions.clone(), case.velocities.clone());
    if let Err(error) = selvedge_sim::Simulator::with_state(&case.scene, start.0, start.1) {
        println!("{name}: {error}");
        return;
    }
    let mut simulator = case.simulator();
    for _ in 0..case.targets.len() {
        if let Err(error) =
            simulator.step(&selvedge_cloth::HandleTargets::at_frame_end(Vec::new()).unwrap())
        {
            println!("{name}: {error}");
            return;
        }
    }
    let stats = simulator.stats();
    let mut errors = case.errors();
    errors.sort_by(|a, b| a.1.total_cmp(&b.1));
    let c = stats.contact;
    println!(
        "{name}: median {:.1e} worst {:?}; fell back {} repeated {} projected {} divisions {} touching {}",
        errors[errors.len() / 2].1,
        errors.last().unwrap(),
        stats.substeps.fell_back,
        c.repeated,
        c.projected,
        c.divisions,
        c.touching
    );
}

#[test]
fn errors() {
    let which = std::env::var("WHICH").unwrap_or_default();
    for friction in [0.0, 0.4] {
        for frames in std::env::var("FRAMES")
            .map_or(vec![1, 2, 3, 4, 6, 10, 30], |f| vec![f.parse().unwrap()])
        {
            if which.contains("floor") {
                let mut case = falling(floor(), friction, frames);
                for (k, p) in case.positions.iter_mut().enumerate() {
                    *p = case.scene.mesh.positions()[k] + vectors(0, 49)[k] * 1e-4
                        - DVec3::Y * 0.0022;
                }
                show(&format!("floor {friction} {frames}"), &case);
                case.velocities.iter_mut().for_each(|v| v.x += 0.3);
                show(&format!("floor, slides {friction} {frames}"), &case);
            }
            if which.contains("fall") {
                show(
                    &format!("fall {friction} {frames}"),
                    &falling(floor(), friction, frames),
                );
            }
            if which.contains("many") && friction == 0.0 {
                for number in 0..24 {
                    let (name, case) = many(number, frames);
                    show(&format!("{name} frames {frames}"), &case);
                }
            }
            if which.contains("warm") {
                use selvedge_cloth::Stepper;
                for warm in 1..12 {
                    let mut case = falling(ball(), friction, frames);
                    let mut simulator = case.simulator();
                    for _ in 0..warm {
                        simulator
                            .step(&selvedge_cloth::HandleTargets::at_frame_end(Vec::new()).unwrap())
                            .unwrap();
                    }
                    case.positions = simulator.positions_f64().to_vec();
                    case.velocities = simulator.velocities_f64().to_vec();
                    case.scene.physics.substeps =
                        std::env::var("SUB").map_or(1, |s| s.parse().unwrap());
                    show(&format!("warm {warm} {friction} {frames}"), &case);
                }
            }
            if which.contains("ball") {
                show(
                    &format!("ball {friction} {frames}"),
                    &falling(ball(), friction, frames),
                );
            }
        }
    }
}
