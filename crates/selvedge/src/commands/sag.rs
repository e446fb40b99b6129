//! `selvedge run --rest`: the sagged rest pose of a scene, as a trajectory of one frame or as a mesh.

use std::path::Path;

use glam::{DVec2, DVec3};
use selvedge_cloth::Scene;
use selvedge_data::{LoadedScene, ending_of, write_obj};
use selvedge_lab::physics;
use serde_json::json;

use crate::cli::RunArgs;
use crate::output::{Answer, Facts, length, percent};
use crate::{place, progress, scenes};

/// Finds the rest pose and writes it.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    place::check_file(args.file(), "--output", &["safetensors", "obj"])?;
    place::tell_of_former(args.output.as_deref(), args.file());
    let loaded = scenes::open(&args.scene)?;
    place::check_outputs(&[("--output", args.file())], &scenes::inputs(&loaded))?;
    let scene = &loaded.scene;
    let rest = physics::rest_pose(scene, &mut progress::listener())?;
    let largest_strain = write(args.file(), &loaded, &rest.positions)?;
    let middle_sag = below_handles(scene, rest.positions[middle(scene)]);
    let depths = rest.positions.iter().map(|p| below_handles(scene, *p));
    let lowest = depths.fold(f64::NEG_INFINITY, f64::max);
    let mut facts = Facts::new();
    facts.tell("scene", &scene.name);
    facts.tell("vertices", rest.positions.len());
    facts.add("middle", below(middle_sag));
    facts.add("lowest point", below(lowest));
    facts.tell_as("largest strain", percent(largest_strain), largest_strain);
    let residual = format!("{:.1e} m/s² after {} solves", rest.residual, rest.solves);
    facts.add("residual", residual);
    facts.add("wrote", args.file().display());
    let report = json!({
        "out": args.file(),
        "middle_sag": middle_sag,
        "lowest": lowest,
        "solves": rest.solves,
        "residual": rest.residual,
        "warnings": loaded.warnings,
    });
    Ok(facts.answer(report))
}

fn below(metres: f64) -> String {
    format!("{} below the handles", length(metres))
}

/// Writes `rest` `[m]`, `[vertices]`, and gives its largest strain.
fn write(out: &Path, loaded: &LoadedScene, rest: &[DVec3]) -> anyhow::Result<f64> {
    let scene = &loaded.scene;
    let frame = physics::rounded(rest);
    let trajectory = physics::trajectory(0, &loaded.spec, scene, rest, frame)?;
    if ending_of(out) == "obj" {
        let cloth = trajectory.cloth();
        write_obj(out, cloth, cloth.rest_positions())?;
    } else {
        trajectory.write(out)?;
    }
    physics::largest_strain(&trajectory)
}

/// The vertex nearest in the material to the middle of the handles: for a square held by two
/// corners, the middle of its upper edge.
fn middle(scene: &Scene) -> usize {
    let places = scene.mesh.material_coordinates();
    let held = scene.handles.select(places);
    let middle = held.iter().sum::<DVec2>() / held.len().max(1) as f64;
    let distance = |v: &usize| places[*v].distance_squared(middle);
    (0..places.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap_or_default()
}

/// Depth of `position` `[m]` below the mean height of the handles `[m]`.
fn below_handles(scene: &Scene, position: DVec3) -> f64 {
    let held = scene.handles.select(scene.mesh.positions());
    let height: f64 = held.iter().map(|p| p.y).sum::<f64>() / held.len().max(1) as f64;
    height - position.y
}
