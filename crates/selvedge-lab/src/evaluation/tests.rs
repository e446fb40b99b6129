//! Rows of contestants whose errors are known.

use selvedge_cloth::Handles;
use selvedge_data::DatasetPreset;

use super::*;

#[test]
fn the_truth_has_no_error_and_meshes_are_told_in_words() {
    let preset = DatasetPreset::open("tiny").unwrap();
    let motion = &preset.motions(Split::Test)[0];
    let loaded = preset.scene(motion).unwrap();
    let rest: Vec<_> = loaded.scene.mesh.positions().to_vec();
    let still = crate::physics::rounded(&rest);
    let frames = 4;
    let positions = still.repeat(frames);
    let truth = crate::physics::trajectory(&loaded.spec, &loaded.scene, &rest, positions).unwrap();
    let mut meshes = Meshes::default();
    let name = "square, 36 vertices, 2 handles";
    assert_eq!(meshes.name(&truth), name);
    // Other handles, and the first again.
    assert_eq!(
        meshes.name(&held_by(&truth, &[7])),
        "square, 36 vertices, 1 handle"
    );
    assert_eq!(
        meshes.name(&held_by(&truth, &[7, 9])),
        format!("{name} (2)")
    );
    assert_eq!(meshes.name(&truth), name);
    // The truth plays itself, the rigid rest pose stands still with it: both are exact.
    let course = Course {
        motion: "m",
        truth: &truth,
        mirror: None,
        scene: None,
    };
    for contestant in Contestant::rivals() {
        if contestant.who() == Who::Mirror {
            assert!(contestant.runner(&course, 0).is_err());
            continue;
        }
        let mut runner = contestant.runner(&course, 0).unwrap();
        let recording = runner.run(frames - 1, &mut || ControlFlow::Continue(()));
        let measures = Measures::of(&truth, &recording.positions).unwrap();
        // Positions of at most 1 m in f32, turned by a yaw of a few roundings.
        assert!(measures.largest_vertex_error < 1e-6, "{}", contestant.name);
        assert!(measures.final_speed < 1e-4);
        let curves = Curves::of(&truth, &recording.positions).unwrap();
        assert_eq!(curves.position_rmse.len(), frames);
    }
}

fn held_by(truth: &Trajectory, vertices: &[u32]) -> Trajectory {
    let handles = Handles::new(vertices, truth.vertex_count()).unwrap();
    let cloth = truth.cloth().clone().with_handles(handles).unwrap();
    let positions = truth.frames().iter().flatten().copied().collect();
    Trajectory::new(cloth, positions, truth.provenance().clone()).unwrap()
}
