//! Small data sets for tests of trainings, here and of other engines: cloths that swing by a formula,
//! without physics.

use std::path::Path;

use glam::{DVec3, Vec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, Handles, Mesh};
use selvedge_data::{
    Dataset, DatasetPlan, DatasetWriter, Provenance, SectionRule, Split, Trajectory,
};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A data set in a folder that goes with it.
pub(crate) struct Swinging {
    pub(crate) folder: TempDir,
    pub(crate) dataset: Dataset,
}

/// A training trajectory to be: its motion, its cloth's vertices, its frames.
pub(crate) type Plan<'a> = (&'a str, usize, usize);

fn mesh(vertices: usize) -> Mesh {
    square(vertices, 1.0, 7).expect("a square").mesh
}

fn cloth(mesh: &Mesh) -> Cloth {
    let count = mesh.positions().len();
    // The two upper corners: the first vertex, and the last with y = 0.
    let last = mesh
        .positions()
        .iter()
        .rposition(|p| p.y == 0.0 && p.z > 0.0);
    let corners = [0, last.expect("an upper edge") as u32];
    let handles = Handles::new(&corners, count).expect("two corners");
    Cloth::of_mesh(mesh, 0.15, handles).expect("a cloth")
}

/// A swing whose lower parts lag behind, with ripples and a slow turn of the whole.
fn swung(p: DVec3, frame: usize, number: usize) -> Vec3 {
    let time = 0.11 * frame as f64 + number as f64;
    let depth = -p.y;
    let lag = time - 0.8 * depth;
    let ripple = 0.04 * depth * (6.0 * p.z + 1.3 * time).sin();
    let moved = p + DVec3::new(
        0.2 * lag.sin() + ripple,
        0.05 * lag.cos() * (1.0 + depth),
        0.1 * (0.7 * lag).sin(),
    );
    let turn = 0.3 * (0.5 * time).sin();
    let (sin, cos) = turn.sin_cos();
    let turned = DVec3::new(
        cos * moved.x + sin * moved.z,
        moved.y,
        cos * moved.z - sin * moved.x,
    );
    turned.as_vec3()
}

pub(crate) fn trajectory(
    (_, vertices, frames): Plan<'_>,
    number: usize,
    scene: &Value,
) -> Trajectory {
    let mesh = mesh(vertices);
    let positions = (0..frames)
        .flat_map(|frame| {
            mesh.positions()
                .iter()
                .map(move |&p| swung(p, frame, number))
        })
        .collect();
    let provenance = Provenance {
        frame_rate: 60.0,
        scene: scene.clone(),
        made_by: "a formula".to_owned(),
    };
    Trajectory::new(cloth(&mesh), positions, provenance).expect("a trajectory")
}

/// Writes the trajectories of a scene, one section each or as the paper cuts them.
pub(crate) fn swinging_in(scene: &Value, plans: &[Plan<'_>], sections: SectionRule) -> Swinging {
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = write(folder.path(), scene, plans, sections);
    Swinging { folder, dataset }
}

fn write(folder: &Path, scene: &Value, plans: &[Plan<'_>], sections: SectionRule) -> Dataset {
    let plan = DatasetPlan {
        name: "swinging".to_owned(),
        config: json!(null),
        train: plans.iter().map(|plan| plan.0.to_owned()).collect(),
        test: Vec::new(),
        sections,
    };
    let mut writer = DatasetWriter::open(folder, plan).expect("an empty folder");
    for (number, &plan) in plans.iter().enumerate() {
        let trajectory = trajectory(plan, number, scene);
        writer.add(Split::Train, plan.0, &trajectory).expect("room");
    }
    writer.finish().expect("a data set")
}
