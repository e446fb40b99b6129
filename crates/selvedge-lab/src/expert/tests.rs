//! Labels of recorded states are the recorded frames.

use std::ops::ControlFlow;

use selvedge_data::{
    DatasetPlan, DatasetPreset, DatasetWriter, Provenance, SectionRule, Trajectory, shipped_presets,
};
use selvedge_model::ClothGraph;
use selvedge_train::graph_of;
use serde_json::json;
use tempfile::TempDir;

use super::*;
use crate::generation::{Order, generate};

/// The preset `tiny` by the physics of this name.
fn made_by(physics: &str) -> (TempDir, Dataset) {
    let (_, text) = shipped_presets()
        .iter()
        .find(|(name, _)| *name == "tiny")
        .unwrap();
    made_from(&text.replace("[setting]", &format!("[setting]\nphysics = {physics:?}")))
}

fn made_from(text: &str) -> (TempDir, Dataset) {
    let folder = tempfile::tempdir().unwrap();
    let preset = DatasetPreset::parse(text, folder.path()).unwrap();
    let order = Order {
        preset: &preset,
        folder: &folder.path().join("data"),
        part: None,
    };
    generate(order, Some(1), &mut |_| ControlFlow::Continue(())).unwrap();
    let data = Dataset::open(order.folder).unwrap();
    (folder, data)
}

/// RMS acceleration of the recorded frames `[m/frame²]`, and RMS error of the first label and of the
/// fifth `[m]`.
fn errors(physics: &str) -> [f64; 3] {
    let (_folder, data) = made_by(physics);
    let expert = PhysicsExpert::new(&data).unwrap();
    let truth = data.read(&data.entries(Split::Train)[0]).unwrap();
    let (mut sums, mut count) = ([0.0; 3], 0.0);
    for frame in 20..60 {
        let recorded = |after: i64| truth.frame((frame as i64 + after) as usize);
        let state = ExpertState {
            trajectory: 0,
            frame,
            positions: [-1, 0].map(recorded),
            recorded: [-2, -1, 0, 1].map(recorded),
        };
        let labels = expert.label(state, 5).unwrap();
        assert_eq!(labels.len(), 5);
        for (v, (first, fifth)) in labels[0].iter().zip(&labels[4]).enumerate() {
            let p = |after: i64| recorded(after)[v].as_dvec3();
            sums[0] += (p(1) - 2.0 * p(0) + p(-1)).length_squared();
            sums[1] += first.distance_squared(p(1));
            sums[2] += fifth.distance_squared(p(5));
            count += 1.0;
        }
    }
    sums.map(|sum| f64::sqrt(sum / count))
}

#[test]
fn labels_of_recorded_states_are_the_recorded_frames() {
    for physics in ["arcsim", "selvedge"] {
        let [acceleration, first, fifth] = errors(physics);
        assert!(acceleration > 2e-4, "{acceleration}");
        assert!(first < 0.005 * acceleration, "{first} of {acceleration}");
        assert!(fifth < 0.03 * acceleration, "{fifth} of {acceleration}");
    }
}

#[test]
fn a_cloth_of_a_data_set_is_learned_from_among_its_own_bodies() {
    let (_folder, data) = made_from(
        r#"
name = "among"
sections = "whole"
train = []
test = ["test-x-minus-y"]
[setting]
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 16, size = 0.3, seed = 1 } }
handles = { label = "upper-corners" }
[[cloths]]
name = "own"
mesh = { generator = { kind = "square", vertices = 25, size = 0.3, seed = 1 } }
handles = { label = "upper-corners" }
obstacles = [{ name = "ball", sphere = { radius = 0.1 }, transform = { translation = [0.12, -0.3, 0.0] }, motion = { keyframes = [{ time = 0.0 }, { time = 0.5, translation = [-0.3, 0.0, 0.0] }] } }]
train = ["random-1"]
"#,
    );
    let tested = data.read(&data.entries(Split::Test)[0]).unwrap();
    assert!(!graph_of("tested", &tested).unwrap().has_contact());
    let entry = &data.entries(Split::Train)[0];
    let truth = data.read(entry).unwrap();
    let graph = graph_of(&entry.motion, &truth).unwrap();
    let scene = physics::scene_of(&truth).unwrap();
    assert_eq!(scene.obstacles.len(), 1);
    assert!(graph.has_contact() && graph.has_moving_bodies());
    // As a rollout has it.
    assert_eq!(graph, ClothGraph::of_scene(truth.cloth(), &scene).unwrap());
    // The expert keeps it apart from the ball, which swings through where the cloth hangs.
    let expert = PhysicsExpert::new(&data).unwrap();
    let recorded = |after: usize| truth.frame(20 + after);
    let state = ExpertState {
        trajectory: 0,
        frame: 22,
        positions: [recorded(1), recorded(2)],
        recorded: [recorded(0), recorded(1), recorded(2), recorded(3)],
    };
    for (after, label) in expert.label(state, 8).unwrap().iter().enumerate() {
        let time = (23 + after) as f64 / scene.frame_rate;
        let ball = scene.obstacles[0].core_at(time).unwrap();
        for p in label {
            assert!(p.distance(ball.ends[0]) > ball.radius, "frame {after}");
        }
    }
}

#[test]
fn a_trajectory_without_a_scene_is_named() {
    let (_folder, data) = made_by("selvedge");
    let entry = &data.entries(Split::Train)[0];
    let truth = data.read(entry).unwrap();
    let positions = (0..truth.frame_count())
        .flat_map(|frame| truth.frame(frame))
        .copied();
    let provenance = Provenance {
        scene: json!(null),
        ..truth.provenance().clone()
    };
    let bare = Trajectory::new(truth.cloth().clone(), positions.collect(), provenance).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let plan = DatasetPlan {
        name: "bare".to_owned(),
        config: json!({}),
        sections: SectionRule::Whole,
        train: vec!["push".to_owned()],
        test: Vec::new(),
    };
    let mut writer = DatasetWriter::open(folder.path(), plan).unwrap();
    writer.add(Split::Train, "push", &bare).unwrap();
    let bare = writer.finish().unwrap();
    let error = PhysicsExpert::new(&bare).err().unwrap().to_string();
    assert!(
        error.contains("push") && error.contains("need the scene"),
        "{error}"
    );
}
