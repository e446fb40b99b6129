//! Times the frames in which a ball is thrown into a sheet that hangs by two corners, as the viewer
//! does: by its own mass, which the cloth slows, or as nothing could stop it.
//!
//! `cargo run --release -p selvedge-sim --example contact_thrown -- [VERTICES] [SPEED] [MASS]`
#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::time::{Duration, Instant};

use glam::DVec3;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    ContactSettings, Environment, HandleSchedule, HandleTargets, Handles, Material, Motion,
    Obstacle, PhysicsSettings, SagSettings, Scene, StepError, Stepper, bodies,
};
use selvedge_sim::Simulator;

/// Anything that can go wrong.
type Failure = Box<dyn std::error::Error + Send + Sync>;

const GRAY: &str = selvedge_assets::materials::GRAY_INTERLOCK;
const RADIUS: f64 = 0.12;
const FRAMES: usize = 120;

fn main() -> Result<(), Failure> {
    let numbers: Vec<f64> = std::env::args()
        .skip(1)
        .map(|number| number.parse::<f64>())
        .collect::<Result<_, _>>()?;
    let number = |k: usize, usual: f64| numbers.get(k).copied().unwrap_or(usual);
    let (vertices, speed, mass) = (number(0, 400.0), number(1, 5.0), number(2, 0.3));
    let scene = scene(vertices as usize)?;
    let start = scene.handles.select(scene.mesh.positions());
    let hold = HandleTargets::at_frame_end(start)?;
    let mut simulator = Simulator::new(&scene)?;
    for _ in 0..90 {
        simulator.step(&hold)?;
    }
    let mut velocity = DVec3::new(-speed, 1.2, 0.0);
    let mut place = DVec3::new(1.0, -0.5, 0.05);
    simulator.put_obstacle(0, place + DVec3::Y * 1000.0)?;
    let mut times = Vec::new();
    let began = on_processor();
    for frame in 0..FRAMES {
        velocity -= DVec3::Y * (9.8 / 60.0);
        let next = place + velocity / 60.0;
        simulator.lead_obstacle(0, next + DVec3::Y * 1000.0);
        let before = simulator.stats().contact;
        let divided = simulator.stats().divided;
        let clock = Instant::now();
        let result = simulator.step(&hold);
        let mut note = "";
        match &result {
            Ok(()) => place = next,
            Err(StepError::Contact { .. } | StepError::Overstretched { .. }) => {
                note = "blocked";
                velocity = DVec3::ZERO;
                simulator.lead_obstacle(0, place + DVec3::Y * 1000.0);
                simulator.step(&hold)?;
            }
            Err(_) => result?,
        }
        let ms = clock.elapsed().as_secs_f64() * 1e3;
        times.push(ms);
        if mass.is_finite() {
            velocity += simulator.obstacle_impulses()[0] / mass;
        }
        let now = simulator.stats().contact;
        let most = simulator.stats().divided;
        println!(
            "{frame:3} {ms:6.1} ms {:4} solves {:4} repeated {:5} pushed {:3} held {:2} divided; {:4} touch; \
             frames divided {} ({}); ball {:.2} at {:.2}; strain {:.3} {note}",
            now.solves - before.solves,
            now.repeated - before.repeated,
            now.projected - before.projected,
            now.held_back - before.held_back,
            now.divisions - before.divisions,
            now.touching,
            most.frames - divided.frames,
            most.most_substeps,
            velocity,
            place,
            strain(&scene, simulator.positions_f64()),
        );
    }
    let late = times.iter().filter(|ms| **ms > 1e3 / 60.0).count();
    let longest = times.iter().copied().fold(0.0, f64::max);
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    let own = began.zip(on_processor());
    if let Some((from, to)) = own {
        let own = (to - from).as_secs_f64() * 1e3 / FRAMES as f64;
        println!("{own:.1} ms per frame on this thread");
    }
    println!("{mean:.1} ms per frame, longest {longest:.1} ms, {late} of {FRAMES} above 16.7 ms");
    Ok(())
}

/// Time that this thread has had a processor, where the system tells (Linux): other work on the
/// machine does not count. Steps of the scheduler's tick.
fn on_processor() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// Largest strain of an edge.
fn strain(scene: &Scene, positions: &[DVec3]) -> f64 {
    let lengths = scene.mesh.pattern().edge_lengths();
    let edges = scene.mesh.topology().edges().iter().zip(lengths);
    let strains = edges.map(|(edge, rest)| {
        let [a, b] = edge.vertices.map(|v| positions[v.index()]);
        a.distance(b) / rest - 1.0
    });
    strains.fold(0.0, f64::max)
}

fn scene(vertices: usize) -> Result<Scene, Failure> {
    let sheet = square(&SquareSpec {
        vertices,
        size: 1.0,
        seed: 1,
    })?;
    let material: Material = toml::from_str(GRAY)?;
    let ball = bodies::sphere(RADIUS, RADIUS / 4.0);
    let away = ball.points.iter().map(|p| *p - DVec3::Y * 1000.0).collect();
    Ok(Scene {
        name: "sheet".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], vertices)?,
        mesh: sheet.mesh,
        fabrics: std::collections::BTreeMap::new(),
        schedule: HandleSchedule::default(),
        material,
        environment: Environment::default(),
        motion: Motion::still(10.0),
        physics: PhysicsSettings::default(),
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: Some(ContactSettings::default()),
        obstacles: vec![Obstacle::new("ball", away, ball.faces)?],
    })
}
