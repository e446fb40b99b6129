//! Times the simulator on a square of gray interlock whose two upper corners move forward, from the
//! first move on: a table row per run, for `docs/src/benchmarks.md`.
//!
//! `cargo bench -p selvedge-sim --bench simulate -- [KEY=VALUE ...]` with `vertices` (1024), `size`
//! of the square's side in m (1), `frames` that count (60; half as many before them do not),
//! `substeps` (4), `threads` (1), `solver` (automatic, cholesky, or the tolerance of conjugate
//! gradients in m/s), `integrator` (generalised-alpha or linearised). Wall time says
//! what one waits, processor time what is left of it where the machine is shared. The largest
//! memory is that of the whole process, mesh generation included.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

use std::collections::BTreeMap;
use std::time::Instant;

use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::motion::named::by_name;
use selvedge_cloth::{
    ConjugateGradients, Environment, HandleSchedule, Handles, Integrator, LinearSolver,
    PhysicsSettings, SagSettings, Scene, Stepper,
};
use selvedge_sim::Simulator;

/// Frames that the shipped motion stands still before its first move.
const STILL: usize = 60;

fn main() {
    let keys = [
        ("vertices", "1024"),
        ("size", "1"),
        ("frames", "60"),
        ("substeps", "4"),
        ("threads", "1"),
        ("solver", "automatic"),
        ("integrator", "generalised-alpha"),
    ];
    let mut settings = BTreeMap::from(keys.map(|(key, value)| (key, value.to_owned())));
    for argument in std::env::args().skip(1).filter(|a| a != "--bench") {
        let Some((key, value)) = argument.split_once('=') else {
            panic!("expected KEY=VALUE, found {argument:?}")
        };
        let Some(setting) = settings.get_mut(key) else {
            let keys: Vec<&str> = settings.keys().copied().collect();
            panic!("{key:?} is none of {}", keys.join(", "))
        };
        value.clone_into(setting);
    }
    let threads = settings["threads"].parse().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build_global().unwrap();
    measure(&settings);
}

fn measure(settings: &BTreeMap<&str, String>) {
    let scene = scene(settings);
    let begin = Instant::now();
    let mut simulator = Simulator::new(&scene).unwrap();
    let set_up = begin.elapsed().as_secs_f64();
    let path = scene.handle_path().unwrap();
    let frames: usize = settings["frames"].parse().unwrap();
    let (mut begin, mut processor) = (Instant::now(), processor_seconds());
    let mut iterations = 0;
    for frame in 0..frames / 2 + frames {
        if frame == frames / 2 {
            (begin, processor) = (Instant::now(), processor_seconds());
        }
        let targets = path.targets(STILL + frame, scene.physics.substeps as usize);
        simulator.step(&targets.unwrap()).unwrap();
        iterations += simulator.solver_iterations().unwrap_or(0);
    }
    let per_frame = 1e3 / frames as f64;
    println!(
        "| {} vertices | {} m | {} substeps | {} threads | {} | {:.2} ms wall | {:.2} ms processor | {:.1} iterations | set-up {set_up:.2} s | {:.0} MB |",
        settings["vertices"],
        settings["size"],
        settings["substeps"],
        settings["threads"],
        settings["solver"],
        begin.elapsed().as_secs_f64() * per_frame,
        (processor_seconds() - processor) * per_frame,
        f64::from(iterations) / (frames / 2 + frames) as f64,
        largest_memory_mb(),
    );
}

fn scene(settings: &BTreeMap<&str, String>) -> Scene {
    let vertices = settings["vertices"].parse().unwrap();
    let sheet = square(&SquareSpec {
        vertices,
        size: settings["size"].parse().unwrap(),
        seed: 1,
    })
    .unwrap();
    let material = selvedge_assets::materials::GRAY_INTERLOCK;
    Scene {
        name: "forward".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], vertices).unwrap(),
        fabrics: BTreeMap::new(),
        schedule: HandleSchedule::default(),
        mesh: sheet.mesh,
        material: toml::from_str(material).unwrap(),
        environment: Environment::default(),
        motion: by_name("forward").unwrap(),
        physics: PhysicsSettings {
            substeps: settings["substeps"].parse().unwrap(),
            solver: match settings["solver"].as_str() {
                "automatic" => LinearSolver::Automatic,
                "cholesky" => LinearSolver::Cholesky,
                tolerance => LinearSolver::ConjugateGradients(ConjugateGradients {
                    tolerance: tolerance.parse().unwrap(),
                    max_iterations: 10_000,
                }),
            },
            integrator: match settings["integrator"].as_str() {
                "linearised" => Integrator::Linearised,
                "generalised-alpha" => Integrator::GeneralisedAlpha(Default::default()),
                other => panic!("{other:?} is none of generalised-alpha, linearised"),
            },
            ..PhysicsSettings::default()
        },
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}

/// Processor time of all threads of this process so far `[s]`, where Linux tells it.
fn processor_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return f64::NAN;
    };
    let nanoseconds = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse().ok()
    };
    tasks.flatten().filter_map(nanoseconds).sum::<f64>() * 1e-9
}

/// Largest memory of this process so far `[MB]`, where Linux tells it.
fn largest_memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |kilobytes| kilobytes / 1e3)
}
