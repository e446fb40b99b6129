//! A program that embeds the learned simulator: it reads the shipped model and moves a cloth by its
//! handles. `cargo run -p selvedge-model --example embed`

use std::error::Error;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, Environment, HandleTargets, Handles, Stepper};
use selvedge_model::{ClothGraph, LearnedStepper, Model};

/// The shipped model that needs no physics; a program of yours reads a file:
/// `std::fs::read("model.safetensors")?`.
const MODEL: &[u8] = selvedge_assets::PAPER;

/// Carries a square of cloth 30 cm to the side by its upper corners, in one second.
#[allow(clippy::print_stdout, reason = "the result of the example")]
pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let model = Arc::new(Model::from_bytes(MODEL)?);
    let sheet = square(150, 1.0, 1)?;
    // The rest pose is the flat square. A pose that sags under gravity is closer to the training.
    let handles = Handles::new(sheet.label("upper-corners")?, 150)?;
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles)?;
    let graph = ClothGraph::new(&cloth, Environment::default(), 60.0)?;
    let rest = cloth.rest_positions();
    let mut stepper = LearnedStepper::new(model, graph, &[rest])?;
    for frame in 1..=60 {
        let moved = DVec3::X * 0.005 * f64::from(frame);
        let corners = cloth.handles().of(rest).map(|p| p.as_dvec3() + moved);
        stepper.step(&HandleTargets::at_frame_end(corners.collect())?)?;
    }
    let centre = |positions: &[Vec3]| positions.iter().sum::<Vec3>() / positions.len() as f32;
    let way = centre(stepper.positions()) - centre(rest);
    println!("the cloth has moved by {way} m");
    if way.x < 0.1 {
        return Err("the cloth did not follow its handles".into());
    }
    Ok(())
}
