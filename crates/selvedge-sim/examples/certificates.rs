//! Counts the pairs of features that a certificate shows to stay apart while cloth moves freely,
//! from substep to substep: a flag that is waved, and a sheet that falls from one corner.
//!
//! `cargo run --release -p selvedge-sim --example certificates`
#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use glam::DVec3;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    Environment, HandleSchedule, Handles, Isotropic, Material, Motion, PhysicsSettings,
    SagSettings, Scene,
};
use selvedge_contact::{Candidates, Path, Reach, Surface, Ways, certify, certify_straight, gap};
use selvedge_sim::Simulator;

/// Pairs by what became of them.
#[derive(Default)]
struct Count {
    all: u64,
    near: u64,
    straight: [u64; 2],
    halved: [u64; 2],
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (name, wave) in [
        ("waved by its upper corners", true),
        ("swinging from a corner", false),
    ] {
        let sheet = square(&SquareSpec {
            vertices: 1024,
            size: 1.0,
            seed: 1,
        })?;
        let corners = &sheet.labels["upper-corners"];
        let held = if wave { &corners[..] } else { &corners[..1] };
        let cloth = Isotropic {
            youngs_modulus: 1e5,
            poissons_ratio: 0.3,
            thickness: 5e-4,
        };
        let scene = Scene {
            name: name.to_owned(),
            handles: Handles::new(held, 1024)?,
            mesh: sheet.mesh,
            fabrics: std::collections::BTreeMap::new(),
            schedule: HandleSchedule::default(),
            material: Material {
                name: "sheet".to_owned(),
                source: String::new(),
                density: 0.2,
                damping: 0.0,
                stretch: cloth.stretch_table(),
                bend: cloth.bend_table(),
                strain_limits: None,
            },
            environment: Environment::default(),
            motion: Motion::still(5.0),
            physics: PhysicsSettings::default(),
            sag: SagSettings::default(),
            frame_rate: 60.0,
            contact: None,
            obstacles: Vec::new(),
        };
        let count = follow(&scene, wave)?;
        let part = |of: u64, all: u64| 100.0 * of as f64 / all.max(1) as f64;
        println!(
            "{name}: {} pairs of swept boxes, {} within 2 mm",
            count.all, count.near
        );
        for (what, all, k) in [("all", count.all, 0), ("within 2 mm", count.near, 1)] {
            println!(
                "  {what}: one direction settles {:.3} %, halves {:.3} % more",
                part(count.straight[k], all),
                part(count.halved[k], all)
            );
        }
    }
    Ok(())
}

/// Certifies every candidate of every substep of the scene's five seconds.
fn follow(scene: &Scene, wave: bool) -> Result<Count, Box<dyn std::error::Error>> {
    let surface = Surface::new(scene.mesh.topology(), &[]);
    let start = scene.mesh.positions().to_vec();
    let mut candidates = Candidates::new(&surface, &start, true);
    let mut simulator = Simulator::new(scene)?;
    let hold = scene.handles.select(&start);
    let mut from = start;
    let mut count = Count::default();
    let reach = Reach {
        gap: 1e-3,
        slack: 1e-3,
    };
    for substep in 1..=600 {
        let time = f64::from(substep) / 120.0;
        let shift = if wave {
            0.3 * (1.0 - (6.0 * time).cos())
        } else {
            0.0
        };
        let targets: Vec<DVec3> = hold.iter().map(|p| *p + DVec3::X * shift).collect();
        simulator.substep(1.0 / 120.0, &targets)?;
        let to = simulator.positions_f64().to_vec();
        let ways = Ways {
            from: &from,
            to: &to,
            later: &to,
        };
        candidates.find(&surface, ways, reach);
        for pair in candidates.pairs() {
            let path = Path {
                from: pair.places(&from),
                to: pair.places(&to),
            };
            let near = usize::from(gap(pair.kind, path.from).distance < 2e-3);
            count.all += 1;
            count.near += near as u64;
            let straight = certify_straight(pair.kind, path, 2e-5).is_ok();
            let halved = !straight && certify(pair.kind, path, 2e-5).is_ok();
            for k in 0..=near {
                count.straight[k] += u64::from(straight);
                count.halved[k] += u64::from(halved);
            }
        }
        from = to;
    }
    Ok(count)
}
