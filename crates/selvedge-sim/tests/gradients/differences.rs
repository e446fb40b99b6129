//! A gradient is the slope of the run: every parameter against central differences.

use glam::DVec3;
use selvedge_cloth::{
    Gust, HandleConstraint, HandleTargets, Integrator, LinearSolver, Scene, Stepper,
};
use selvedge_sim::{Gradient, GradientError, GradientSettings, Simulator, StateGradient};

use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, by_default, hanging, material};

/// All that a run depends on.
#[derive(Clone)]
struct Case {
    scene: Scene,
    positions: Vec<DVec3>,
    velocities: Vec<DVec3>,
    /// Targets of each frame, `[frames][samples * handles]`, and the handles that are let go.
    targets: Vec<(Vec<DVec3>, Vec<bool>)>,
}

/// Numbers between -1 and 1 that look random.
fn noise(k: usize) -> f64 {
    (12.9898 * k as f64 + 4.1).sin() * 43_758.545_3 % 1.0
}

fn vector(k: usize) -> DVec3 {
    DVec3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2))
}

fn vectors(from: usize, count: usize) -> Vec<DVec3> {
    (from..from + count).map(vector).collect()
}

impl Case {
    /// Cloth of `fabric` in gusts, from a rumpled start, whose handles are led; one is let go in the
    /// second third, and takes hold again in the last.
    fn new(fabric: &str, side: usize, frames: usize) -> Self {
        let mut scene = hanging(side);
        scene.material = material(fabric);
        scene.material.damping = 2e-3;
        scene.environment.wind = DVec3::new(2.0, 0.3, -0.7);
        scene.environment.air_drag = 0.05;
        scene.environment.gust = Some(Gust {
            speed: DVec3::new(1.5, 0.5, 1.0),
            period: 0.4,
            seed: 3,
        });
        let count = side * side;
        let start = scene.mesh.positions();
        let rumpled = start.iter().zip(vectors(0, count));
        let positions: Vec<_> = rumpled.map(|(x, n)| *x * 0.98 + n * 0.004).collect();
        let held = scene.handles.select(&positions);
        let targets = (1..=frames).map(|frame| {
            let way = |sample: usize| {
                let time = (frame as f64 - 1.0 + 0.5 * sample as f64) / 60.0;
                DVec3::new(0.3, 0.1, -0.2) * (time - 0.1 * (6.0 * time).sin())
            };
            let places = (1..=2).flat_map(|s| held.iter().map(move |h| *h + way(s)));
            let is_free = frames > 2 && (frames / 3..2 * frames / 3).contains(&frame);
            (places.collect(), vec![false, is_free])
        });
        Self {
            velocities: vectors(500, count).iter().map(|n| *n * 0.2).collect(),
            targets: targets.collect(),
            positions,
            scene,
        }
    }

    fn targets(&self, frame: usize) -> HandleTargets {
        let (samples, released) = &self.targets[frame];
        let handles = self.scene.handles.len();
        let targets = HandleTargets::sampled(samples.clone(), handles).unwrap();
        targets.releasing(released.clone()).unwrap()
    }

    fn simulator(&self) -> Simulator {
        let start = (self.positions.clone(), self.velocities.clone());
        Simulator::with_state(&self.scene, start.0, start.1).unwrap()
    }

    /// The value of a run: places and velocities along some directions, in every fourth frame and
    /// the last.
    fn value(&self) -> f64 {
        let mut simulator = self.simulator();
        let mut value = 0.0;
        for frame in 0..self.targets.len() {
            simulator.step(&self.targets(frame)).unwrap();
            let by = self.seed(frame + 1);
            let dot = |a: &[DVec3], b: &[DVec3]| -> f64 {
                a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
            };
            value += dot(simulator.positions_f64(), &by.positions);
            value += dot(simulator.velocities_f64(), &by.velocities);
        }
        value
    }

    fn seed(&self, frame: usize) -> StateGradient {
        let count = self.positions.len();
        let weight = match frame == self.targets.len() || frame % 4 == 1 {
            true => 1.0,
            false => 0.0,
        };
        let of = |from, weight: f64| vectors(from, count).iter().map(|n| *n * weight).collect();
        StateGradient {
            positions: of(1000, weight),
            velocities: of(2000, 0.1 * weight),
        }
    }

    fn gradient_by(&self, settings: GradientSettings) -> Gradient {
        let mut simulator = self.simulator();
        simulator.record_gradient(settings).unwrap();
        for frame in 0..self.targets.len() {
            simulator.step(&self.targets(frame)).unwrap();
        }
        let made = simulator.backward(&mut |frame, by| {
            if frame > 0 {
                let seed = self.seed(frame);
                let both = [
                    (&mut by.positions, seed.positions),
                    (&mut by.velocities, seed.velocities),
                ];
                for (by, seed) in both {
                    by.iter_mut().zip(seed).for_each(|(by, seed)| *by += seed);
                }
            }
        });
        made.unwrap()
    }

    fn gradient(&self) -> Gradient {
        self.gradient_by(GradientSettings::default())
    }

    /// Slope of the value where `change` moves the case by a part.
    fn slope(&self, step: f64, change: impl Fn(&mut Self, f64)) -> f64 {
        let at = |part: f64| {
            let mut moved = self.clone();
            change(&mut moved, part);
            moved.value()
        };
        (at(step) - at(-step)) / (2.0 * step)
    }

    /// All parameters: name, slope by the gradient, slope by differences, and the scale below which
    /// a slope counts as this large.
    fn compare(&self) -> Vec<(String, f64, f64, f64)> {
        let gradient = self.gradient();
        let count = self.positions.len();
        let mut found = Vec::new();
        let dot = |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let size = |a: &[DVec3]| dot(a, a).sqrt();
        for k in 0..3 {
            let along = vectors(3000 + 100 * k, count);
            let mut add = |name: &str, by: &[DVec3], slope: f64| {
                found.push((format!("{name} {k}"), dot(by, &along), slope, size(by)));
            };
            let by = &gradient.start.positions;
            let slope = self.slope(1e-7, |case, part| {
                let moved = case.positions.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
            add("positions", by, slope);
            let by = &gradient.start.velocities;
            let slope = self.slope(1e-5, |case, part| {
                let moved = case.velocities.iter_mut().zip(&along);
                moved.for_each(|(x, n)| *x += *n * part);
            });
            add("velocities", by, slope);
        }
        let by: Vec<DVec3> = gradient.targets.concat();
        let along = vectors(4000, by.len());
        let slope = self.slope(1e-7, |case, part| {
            let moved = case.targets.iter_mut().flat_map(|(targets, _)| targets);
            moved.zip(&along).for_each(|(x, n)| *x += *n * part);
        });
        found.push(("targets".into(), dot(&by, &along), slope, size(&by)));
        for axis in 0..3 {
            let slope = self.slope(1e-4, |case, part| {
                case.scene.environment.gravity[axis] += part;
            });
            let by = gradient.gravity;
            found.push((format!("gravity {axis}"), by[axis], slope, by.length()));
            let slope = self.slope(1e-5, |case, part| {
                case.scene.environment.wind[axis] += part;
            });
            let by = gradient.wind;
            found.push((format!("wind {axis}"), by[axis], slope, by.length()));
        }
        let by = (gradient.air_density, gradient.air_drag);
        let slope = self.slope(1e-5, |case, part| case.scene.environment.air_density += part);
        found.push(("air_density".into(), by.0, slope, 0.0));
        let slope = self.slope(1e-5, |case, part| case.scene.environment.air_drag += part);
        found.push(("air_drag".into(), by.1, slope, 0.0));
        let by = &gradient.materials[0];
        let slope = self.slope(1e-6, |case, part| case.scene.material.density += part);
        found.push(("density".into(), by.density, slope, 0.0));
        let slope = self.slope(1e-7, |case, part| case.scene.material.damping += part);
        found.push(("damping".into(), by.damping, slope, 0.0));
        let size = |of: &[f64]| of.iter().map(|k| k * k).sum::<f64>().sqrt();
        let all = size(by.stretch.as_flattened());
        for (k, by) in by.stretch.as_flattened().iter().enumerate() {
            let slope = self.slope(1e-4, |case, part| {
                case.scene.material.stretch.0.as_flattened_mut()[k] += part;
            });
            found.push((format!("stretch {k}"), *by, slope, all));
        }
        let all = size(by.bend.as_flattened());
        for (k, by) in by.bend.as_flattened().iter().enumerate() {
            let slope = self.slope(1e-9, |case, part| {
                case.scene.material.bend.0.as_flattened_mut()[k] += part;
            });
            found.push((format!("bend {k}"), *by, slope, all));
        }
        let edges = self.scene.mesh.topology().edges().len();
        let along: Vec<f64> = (0..edges).map(|k| noise(7000 + k)).collect();
        let by = &gradient.rest_angles;
        let slope = self.slope(1e-6, |case, part| {
            let angles = along.iter().map(|n| n * part).collect();
            let mesh = case.scene.mesh.clone();
            case.scene.mesh = mesh.with_rest_angles(angles).unwrap();
        });
        let dot: f64 = by.iter().zip(&along).map(|(a, b)| a * b).sum();
        found.push(("rest angles".into(), dot, slope, size(by)));
        found
    }

    /// Checks all parameters; the largest error is at most `bound`.
    fn check(&self, name: &str, bound: f64) {
        let mut worst = (0.0, String::new());
        for (parameter, found, slope, scale) in self.compare() {
            let error = (found - slope).abs() / found.abs().max(slope.abs()).max(scale);
            if std::env::var("GRADIENTS").is_ok() {
                println!("{name} {parameter}: {found:.9e} {slope:.9e} {error:.1e}");
            }
            if error > worst.0 {
                worst = (error, parameter);
            }
        }
        println!("{name}: {:.1e} at {}", worst.0, worst.1);
        assert!(worst.0 <= bound, "{name}: {worst:?}");
    }
}

#[test]
fn one_frame() {
    Case::new(GRAY, 5, 1).check("one frame", 1e-6);
}

#[test]
fn ten_frames() {
    Case::new(GRAY, 5, 10).check("ten frames", 1e-6);
}

#[test]
fn sixty_frames_of_four_fabrics() {
    for fabric in [GRAY, CAMEL, DENIM, NAVY] {
        let case = Case::new(fabric, 5, 60);
        case.check(&case.scene.material.name, 1e-6);
    }
}

#[test]
fn backward_euler_and_springs() {
    let mut case = Case::new(CAMEL, 5, 12);
    case.scene.physics.integrator = Integrator::Linearised;
    case.check("backward Euler", 1e-6);
    case.scene.physics.handles = HandleConstraint::Spring;
    case.check("backward Euler with springs", 1e-6);
    case.scene.physics.integrator = selvedge_cloth::PhysicsSettings::default().integrator;
    case.check("springs", 1e-6);
}
