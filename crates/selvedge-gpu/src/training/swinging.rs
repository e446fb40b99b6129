//! A small data set for the tests of trainings: two cloths that swing by a formula, without
//! physics.

use std::path::Path;

use glam::{DVec3, Vec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::{Cloth, Handles, Mesh};
use selvedge_data::{
    Dataset, DatasetPlan, DatasetWriter, Provenance, SectionRule, Split, Trajectory,
};
use selvedge_model::ModelSpec;
use selvedge_train::TrainConfig;
use serde_json::json;
use tempfile::TempDir;

/// A data set in a folder that goes with it.
pub(crate) struct Swinging {
    pub(crate) folder: TempDir,
    pub(crate) dataset: Dataset,
}

fn cloth(mesh: &Mesh) -> Cloth {
    let count = mesh.positions().len();
    let upper = |p: &&DVec3| p.y == 0.0 && p.z > 0.0;
    let last = mesh.positions().iter().rposition(|p| upper(&p));
    let corners = [0, last.expect("an upper edge") as u32];
    let handles = Handles::new(&corners, count).expect("two corners");
    Cloth::of_mesh(mesh, 0.15, handles).expect("a cloth")
}

/// A swing whose lower parts lag behind, with ripples and a slow turn of the whole.
fn swung(p: DVec3, frame: usize, number: usize) -> Vec3 {
    let time = 0.11 * frame as f64 + number as f64;
    let lag = time + 0.8 * p.y;
    let ripple = -0.04 * p.y * (6.0 * p.z + 1.3 * time).sin();
    let across = 0.1 * (0.7 * lag).sin();
    let moved = p + DVec3::new(
        0.2 * lag.sin() + ripple,
        0.05 * lag.cos() * (1.0 - p.y),
        across,
    );
    let (sin, cos) = (0.3 * (0.5 * time).sin()).sin_cos();
    let (x, z) = (cos * moved.x + sin * moved.z, cos * moved.z - sin * moved.x);
    DVec3::new(x, moved.y, z).as_vec3()
}

fn trajectory(vertices: usize, frames: usize, number: usize) -> Trajectory {
    let mesh = square(vertices, 1.0, 7).expect("a square").mesh;
    let of_frame = |frame| {
        mesh.positions()
            .iter()
            .map(move |&p| swung(p, frame, number))
    };
    let air = json!({ "air_density": 1.2, "air_drag": 0.3, "wind": [0.5, 0.1, -0.4] });
    let provenance = Provenance {
        frame_rate: 60.0,
        scene: json!({ "setting": { "environment": air } }),
        made_by: "a formula".to_owned(),
    };
    let positions = (0..frames).flat_map(of_frame).collect();
    Trajectory::new(cloth(&mesh), positions, provenance).expect("a trajectory")
}

/// Two cloths of 9 and 12 vertices.
pub(crate) fn two_cloths() -> Swinging {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = DatasetPlan {
        name: "swinging".to_owned(),
        config: json!(null),
        train: vec!["a".to_owned(), "b".to_owned()],
        test: Vec::new(),
        sections: SectionRule::Whole,
    };
    let mut writer = DatasetWriter::open(folder.path(), plan).expect("an empty folder");
    for (number, (name, vertices, frames)) in [("a", 9, 20), ("b", 12, 16)].into_iter().enumerate()
    {
        let trajectory = trajectory(vertices, frames, number);
        writer.add(Split::Train, name, &trajectory).expect("room");
    }
    let dataset = writer.finish().expect("a data set");
    Swinging { folder, dataset }
}

/// A training of a model on ground truth.
pub(crate) fn config(model: ModelSpec) -> TrainConfig {
    let text = r#"
        name = "tiny"
        seed = 3
        steps = 1000
        statistics_samples = 12
        log_every = 2

        [model]
        node_features = ["velocity", "node-type"]
        edge_features = ["vector"]
        encoder = { kind = "mlp" }
        latent = 8
        blocks = 1

        [learning_rate]
        kind = "constant"
        rate = 1e-3

        [batch]
        samples = 3
    "#;
    let cfg = TrainConfig::parse(text, Path::new("tiny.toml")).expect("a configuration");
    TrainConfig { model, ..cfg }
}
