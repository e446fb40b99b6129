//! Times the simulator on the moving square: `cargo bench -p selvedge-sim --bench simulate --
//! VERTICES [SIZE [FRAMES]]`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program"
)]

use std::time::Instant;

use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::motion::named::by_name;
use selvedge_cloth::{
    ConjugateGradients, Environment, Handles, LinearSolver, Material, PhysicsSettings, SagSettings,
    Scene, Stepper,
};
use selvedge_sim::Simulator;

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let number = |k: usize, or: f64| args.get(k).map_or(or, |a| a.parse().unwrap());
    let vertices = number(0, 1024.0) as usize;
    let size = number(1, 1.0);
    let frames = number(2, 60.0) as usize;
    let sheet = square(&SquareSpec {
        vertices,
        size,
        seed: 1,
    })
    .unwrap();
    let material: Material = toml::from_str(include_str!(
        "../../../assets/materials/gray-interlock.toml"
    ))
    .unwrap();
    let scene = Scene {
        name: "bench".into(),
        handles: Handles::new(&sheet.labels["upper-corners"], vertices).unwrap(),
        mesh: sheet.mesh,
        material,
        environment: Environment::default(),
        motion: by_name("forward").unwrap(),
        physics: PhysicsSettings {
            solver: match std::env::var("SOLVER").as_deref() {
                Ok("cholesky") => LinearSolver::Cholesky,
                Ok(t) => LinearSolver::ConjugateGradients(ConjugateGradients {
                    tolerance: t.parse().unwrap(),
                    ..Default::default()
                }),
                _ => LinearSolver::Automatic,
            },
            ..PhysicsSettings::default()
        },
        sag: SagSettings::default(),
        frame_rate: 60.0,
    };
    let begin = Instant::now();
    let mut simulator = Simulator::new(&scene).unwrap();
    let setup = begin.elapsed().as_secs_f64();
    let path = scene.handle_path().unwrap();
    let mut total = 0;
    let cpu = || -> f64 {
        std::fs::read_to_string("/proc/thread-self/schedstat")
            .unwrap()
            .split(' ')
            .next()
            .unwrap()
            .parse::<f64>()
            .unwrap()
            * 1e-6
    };
    let mut run = |from: usize, to: usize| {
        let begin = cpu();
        for frame in from..to {
            let targets = path.targets(60 + frame, 4).unwrap();
            if let Err(e) = simulator.step(&targets) {
                println!("{e}");
                std::process::exit(0)
            }
            total += simulator.solver_iterations().unwrap_or(0);
        }
        (cpu() - begin) / (to - from) as f64
    };
    run(0, frames / 2);
    let ms = run(frames / 2, frames / 2 + frames);
    let v = simulator.velocities_f64();
    let fast = v.iter().map(|v| v.length()).fold(0.0, f64::max);
    println!("total {total} ");
    println!(
        "{vertices} vertices: set-up {setup:.3} s, {ms:.3} ms per frame, fastest {fast:.2} m/s, {:?} iterations, {:?}",
        simulator.solver_iterations(),
        simulator.positions_f64()[vertices / 2]
    );
}
