//! Samples are those of the data set, each once; cloths that are alike share their graph.

use std::collections::BTreeSet;

use selvedge_data::SectionRule;

use super::*;
use crate::test_data::{Plan, swinging, two_cloths};

#[test]
fn the_papers_6550_samples_are_drawn_each_once() {
    // The names decide which sections a trajectory has.
    let names = selvedge_cloth::motion::named::training();
    let plans: Vec<Plan<'_>> = names.into_iter().map(|name| (name, 4, 1261)).collect();
    let data = swinging(&plans, SectionRule::Paper);
    let set = TrainingSet::load(&data.dataset).expect("a set");
    assert_eq!(set.sample_count(), 6550);
    let drawn: Vec<Sample> = (0..6550).map(|number| set.sample(number).0).collect();
    assert_eq!(drawn, data.dataset.samples().collect::<Vec<_>>());
    let different: BTreeSet<_> = drawn.iter().map(|s| (s.trajectory, s.current)).collect();
    assert_eq!(different.len(), 6550);
    for number in 0..6550 {
        let (sample, section) = set.sample(number);
        assert_eq!(sample.trajectory, section.trajectory);
        assert!(set.has(section) && TrainingSet::section_has(section, sample.current));
    }
}

#[test]
fn a_section_has_the_frames_between_its_ends() {
    let section = Section {
        trajectory: 0,
        start: 5,
        end: 9,
    };
    let samples: Vec<usize> = section.samples().map(|sample| sample.current).collect();
    let has: Vec<usize> = (0..20)
        .filter(|&f| TrainingSet::section_has(&section, f))
        .collect();
    assert_eq!(samples, has);
}

#[test]
fn before_its_first_frame_a_cloth_stood_still() {
    let data = two_cloths();
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let motion = set.motion(1);
    assert_eq!(motion.frame(-7), motion.frame(0));
    assert_ne!(motion.frame(1), motion.frame(0));
    let entry = &data.dataset.entries(Split::Train)[1];
    let trajectory = data.dataset.read(entry).expect("a trajectory");
    assert_eq!(motion.frame(3), trajectory.frame(3));
}

#[test]
fn trajectories_of_one_cloth_share_its_graph() {
    let plans = [("a", 9, 5), ("b", 12, 5), ("c", 9, 6)];
    let data = swinging(&plans, SectionRule::Whole);
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let graphs = [0, 1, 2].map(|t| &set.motion(t).graph);
    assert!(Arc::ptr_eq(graphs[0], graphs[2]));
    assert!(!Arc::ptr_eq(graphs[0], graphs[1]));
}

#[test]
fn a_set_without_anything_to_train_on_is_refused() {
    let data = swinging(&[], SectionRule::Whole);
    let error = TrainingSet::load(&data.dataset).err().expect("no samples");
    assert!(matches!(error, TrainingSetError::NoSamples));
}

#[test]
fn the_environment_is_that_of_the_scene() {
    let plain = crate::test_data::trajectory(("a", 9, 3), 0, &Value::Null);
    let graph = graph_of("a", &plain).expect("a graph");
    assert_eq!(graph.environment(), &Environment::default());
    let with = |environment: Value| {
        let positions = plain.frames().iter().flatten().copied().collect();
        let mut provenance = plain.provenance().clone();
        provenance.scene = serde_json::json!({"setting": {"environment": environment}});
        Trajectory::new(plain.cloth().clone(), positions, provenance).expect("a trajectory")
    };
    let windy = Environment {
        wind: glam::DVec3::new(1.0, 0.0, 2.0),
        ..Environment::default()
    };
    let trajectory = with(serde_json::to_value(windy).expect("plain"));
    let graph = graph_of("a", &trajectory).expect("a graph");
    assert_eq!(graph.environment(), &windy);
    let error = graph_of("a", &with(serde_json::json!({"wind": "strong"}))).expect_err("no wind");
    let text = error.to_string();
    assert!(text.starts_with("training trajectory a: the environment of its scene: "));
}

/// Handles above each other have no direction: a frame has then that of the one before, as a
/// rollout has.
#[test]
fn a_frame_without_a_direction_keeps_the_one_before() {
    let plain = crate::test_data::trajectory(("a", 9, 5), 0, &Value::Null);
    let handles = plain.handles().vertices().to_vec();
    let [first, last] = [handles[0].index(), handles[handles.len() - 1].index()];
    assert_eq!(handles.len(), 2);
    let ways = [Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::X, Vec3::Y, Vec3::Y];
    let frames = (0..5).flat_map(|frame| {
        let mut positions = plain.frame(frame).to_vec();
        positions[first] = 0.5 * ways[frame];
        positions[last] = -0.5 * ways[frame];
        positions
    });
    let (cloth, provenance) = (plain.cloth().clone(), plain.provenance().clone());
    let trajectory = Trajectory::new(cloth, frames.collect(), provenance).expect("a trajectory");
    let graph = graph_of("a", &trajectory).expect("a graph");
    let mut yaw = graph.frame().rest_yaw();
    let expected: Vec<Yaw> = (0..5)
        .map(|frame| {
            let places = graph.handles().select(trajectory.frame(frame));
            yaw = graph.frame().yaw(&places, yaw);
            yaw
        })
        .collect();
    assert_eq!([expected[3], expected[4]], [expected[2]; 2]);
    assert_ne!(expected[2], graph.frame().rest_yaw());
    let motion = Motion::new("a", graph, trajectory, &[]).expect("a motion");
    assert!((0..5).all(|frame| motion.yaw(frame) == expected[frame]));
}

/// As in a rollout: the mask and the wind are those of the step, and the local frame stays while a
/// handle has let go.
#[test]
fn a_motion_knows_its_handles_and_its_air_in_each_step() {
    let plain = crate::test_data::trajectory(("a", 9, 6), 0, &Value::Null);
    let weather = serde_json::json!({
        "gust": { "speed": [2.0, 0.0, 1.0], "period": 1.0, "seed": 3 },
    });
    let frame = 1.0 / plain.frame_rate();
    let release = serde_json::json!([{ "handles": [1], "from": 2.0 * frame, "to": 4.0 * frame }]);
    let setting = serde_json::json!({ "environment": weather, "schedule": release });
    let mut provenance = plain.provenance().clone();
    provenance.scene = serde_json::json!({ "setting": setting });
    let turned = |frame: usize| {
        let turn = glam::Quat::from_rotation_y(0.2 * frame as f32);
        plain.frame(frame).iter().map(move |p| turn * *p)
    };
    let positions = (0..6).flat_map(turned).collect();
    let (cloth, rate) = (plain.cloth().clone(), plain.frame_rate());
    let trajectory = Trajectory::new(cloth, positions, provenance).expect("a trajectory");
    let graph = graph_of("a", &trajectory).expect("a graph");
    let handles = graph.handles().vertices().to_vec();
    let motion = Motion::new("a", graph, trajectory, &[]).expect("a motion");
    let air: Environment = serde_json::from_value(weather).expect("gusts");
    for frame in 0..5 {
        let graph = motion.graph_in(frame).expect("one for each step");
        let held: Vec<bool> = handles
            .iter()
            .map(|v| graph.handle_mask()[v.index()])
            .collect();
        assert_eq!(held, [true, !(2..4).contains(&frame)], "{frame}");
        assert_eq!(*graph.environment(), air.during_step(frame, rate));
    }
    let yaws: Vec<Yaw> = (0..6).map(|frame| motion.yaw(frame)).collect();
    assert_eq!([yaws[2], yaws[3]], [yaws[1]; 2]);
    assert_ne!(yaws[1], yaws[0]);
    assert_ne!(yaws[4], yaws[3]);
    // One that does not change shares its cloth.
    let graph = graph_of("a", &plain).expect("a graph");
    let motion = Motion::new("a", graph, plain, &[]).expect("a motion");
    assert!(motion.graph_in(3).is_none());
}
