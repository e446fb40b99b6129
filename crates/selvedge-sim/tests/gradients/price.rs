//! The price of a gradient: `cargo test --release -p selvedge-sim --test gradients -- --ignored --nocapture`.

use std::sync::LazyLock;
use std::time::Instant;

use glam::{DQuat, DVec3};
use selvedge_cloth::{ContactSettings, HandleTargets, Handles, Obstacle, Scene, Stepper, bodies};
use selvedge_sim::{GradientSettings, Simulator, Threads};

use crate::scenes::{by_default, held};
use crate::sheets;

/// Bytes of a recording.
const BOTH: [(&str, usize); 2] = [("computed again", 1 << 20), ("all kept", 1 << 30)];

/// Largest memory so far `[MB]`, where the system tells.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let kilobytes = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kilobytes.unwrap_or(f64::NAN) / 1e3
}

/// Processor time of this thread so far, where the system tells; else the time that passes `[s]`.
fn seconds() -> f64 {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = statistics
        .split(' ')
        .next()
        .and_then(|n| n.parse::<f64>().ok());
    nanoseconds.map_or_else(|| BEGAN.elapsed().as_secs_f64(), |n| n * 1e-9)
}

/// A sheet of 1024 vertices that falls on a ball, and the same until it lies there.
#[test]
#[ignore = "it measures"]
fn sixty_frames_with_contact() {
    on_a_ball(60, &BOTH);
}

#[test]
#[ignore = "it measures"]
fn three_hundred_frames_with_contact() {
    on_a_ball(300, &[("default", GradientSettings::default().memory)]);
}

fn on_a_ball(frames: u32, memories: &[(&str, usize)]) {
    let mut scene = by_default(32);
    scene.handles = Handles::new(&[], 1024).unwrap();
    let flat = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let places = scene.mesh.positions().iter();
    let lying = places.map(|p| flat * *p - DVec3::X * 0.5).collect();
    let ball = bodies::sphere(0.3, 0.05).placed(1.0, |p| p - DVec3::Y * 0.33);
    scene.obstacles = vec![Obstacle::of("ball", ball).unwrap()];
    scene.contact = Some(ContactSettings::default());
    scene.mesh = scene.mesh.with_positions(lying).unwrap();
    measure(&scene, frames, memories, &|_| {
        HandleTargets::at_frame_end(Vec::new()).unwrap()
    });
}

/// The scene `sphere` of DiffCloth (Li et al. 2022; github.com/omegaiota/DiffCloth, 9180152): 625 vertices on 4.5 m
/// fall onto a ball of 2 m, for 350 steps of 1/180 s; and the same time in the default's steps.
#[test]
#[ignore = "it measures"]
fn the_sphere_of_diffcloth() {
    let mesh = sheets::grid(24, 24, 4.5 / 24.0, |c| {
        DVec3::new(c.x - 2.25, 0.0, c.y - 2.25)
    });
    let sheet = sheets::elastic(1.5e5, 0.3, 1e-3);
    let material = sheets::isotropic(sheet, 0.3);
    let mut scene = sheets::scene(mesh, material, &[]);
    scene.physics = by_default(3).physics;
    let ball = bodies::sphere(2.0, 0.2).placed(1.0, |p| p + DVec3::new(0.6, -2.1, 0.2));
    scene.obstacles = vec![Obstacle::of("ball", ball).unwrap()];
    scene.contact = Some(ContactSettings {
        friction: 0.9,
        ..ContactSettings::default()
    });
    for (rate, substeps, frames) in [(180.0, 1, 350), (60.0, 2, 117)] {
        scene.frame_rate = rate;
        scene.physics.substeps = substeps;
        println!("{frames} frames of 1/{rate} s, {substeps} substeps");
        measure(&scene, frames, &BOTH, &|_| {
            HandleTargets::at_frame_end(Vec::new()).unwrap()
        });
    }
}

#[test]
#[ignore = "it measures"]
fn three_hundred_frames_of_1024_vertices() {
    let mut scene = by_default(32);
    scene.environment.wind = DVec3::new(1.0, 0.2, -0.5);
    measure(&scene, 300, &BOTH, &|frame| {
        let time = f64::from(frame) / 60.0;
        let way = DVec3::new(
            0.3 * (3.0 * time).sin(),
            0.0,
            0.1 * (5.0 * time).cos() - 0.1,
        );
        let places = held(&scene).into_iter().map(|place| place + way);
        HandleTargets::at_frame_end(places.collect()).unwrap()
    });
}

/// Prints the time of a run alone, recorded and back, and the memory of the process.
fn measure(
    scene: &Scene,
    frames: u32,
    memories: &[(&str, usize)],
    targets: &dyn Fn(u32) -> HandleTargets,
) {
    let run = |settings: Option<GradientSettings>| {
        let mut simulator = Simulator::new(scene).unwrap();
        simulator.set_threads(Threads::One);
        if let Some(settings) = settings {
            simulator.record_gradient(settings).unwrap();
        }
        let began = seconds();
        for frame in 1..=frames {
            simulator.step(&targets(frame)).unwrap();
        }
        (simulator, seconds() - began)
    };
    let (_, plain) = run(None);
    let before = peak();
    for (name, memory) in memories {
        let settings = GradientSettings {
            memory: *memory,
            ..GradientSettings::default()
        };
        let (mut simulator, forward) = run(Some(settings));
        let began = seconds();
        let seed = &mut |frame, by: &mut selvedge_sim::StateGradient| {
            if frame == frames as usize {
                by.positions.iter_mut().for_each(|by| by.y += 1.0);
            }
        };
        simulator.backward(seed).unwrap();
        let backward = seconds() - began;
        println!(
            "{name}: plain {plain:.2} s, recorded {forward:.2}, backward {backward:.2}: {:.2} times; peak {before:.0} -> {:.0} MB",
            (forward + backward) / plain,
            peak()
        );
    }
}
