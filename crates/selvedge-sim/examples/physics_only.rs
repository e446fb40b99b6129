//! The physics alone: a scene written in code, its rest pose, and a motion of two seconds.
//!
//! `cargo run --release -p selvedge-sim --example physics_only`. A curtain of 144 vertices hangs
//! from its upper edge, which moves by 20 cm in the first second. The program prints the lowest
//! point and the kinetic energy ten times a second.
#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::error::Error;

use glam::DVec3;
use selvedge_cloth::generate::square;
use selvedge_cloth::{HandleTargets, Handles, Isotropic, Motion, Scene, Stepper};
use selvedge_sim::{Simulator, sag};

/// Frames that are simulated, at 60 per second.
const FRAMES: usize = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = curtain()?;
    let rest = sag(&scene)?;
    println!(
        "rest pose: {} solves, residual {:.1e} m/s²",
        rest.solves, rest.residual
    );
    let still = vec![DVec3::ZERO; rest.positions.len()];
    let mut simulator = Simulator::with_state(&scene, rest.positions, still)?;
    println!("  time      lowest  kinetic energy");
    for frame in 0..FRAMES {
        simulator.step(&targets(&scene, frame)?)?;
        if simulator.frame().is_multiple_of(6) {
            let heights = simulator.positions().iter().map(|p| p.y);
            println!(
                "{:4.1} s  {:8.3} m  {:12.4} J",
                simulator.frame() as f64 / scene.frame_rate,
                heights.fold(f32::INFINITY, f32::min),
                simulator.kinetic_energy()
            );
        }
    }
    Ok(())
}

/// A square sheet of 1 m in still air, held along its upper edge.
fn curtain() -> Result<Scene, Box<dyn Error>> {
    let sheet = square(144, 1.0, 1)?;
    let elastic = Isotropic {
        youngs_modulus: 1e6,
        poissons_ratio: 0.3,
        thickness: 5e-4,
    };
    let material = elastic.material("isotropic", 0.2);
    let handles = Handles::new(sheet.label("upper-edge")?, 144)?;
    Ok(Scene {
        motion: Motion::still(2.0),
        ..Scene::of("curtain", sheet.mesh, handles, material)
    })
}

/// Targets of the step from `frame`: the edge moves by 20 cm over the first second and rests.
fn targets(scene: &Scene, frame: usize) -> Result<HandleTargets, Box<dyn Error>> {
    let time = ((frame + 1) as f64 / scene.frame_rate).min(1.0);
    let pull = DVec3::X * 0.2 * time;
    let edge = scene.handles.select(scene.mesh.positions());
    let places = edge.iter().map(|p| *p + pull).collect();
    Ok(HandleTargets::at_frame_end(places)?)
}

#[test]
fn the_example_runs() -> Result<(), Box<dyn Error>> {
    main()
}
