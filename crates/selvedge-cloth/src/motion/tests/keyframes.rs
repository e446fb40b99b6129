//! Keyframed motion: keyframes are met, with no speed; wrong ones are named.

use glam::DVec3;

use super::super::{Keyframe, KeyframeGroup, KeyframeMotion, Motion};
use super::{bound, corners, refused};
use crate::{HandleSchedule, Release};

fn keyframed(handles: Vec<usize>, keyframes: &[(f64, f64, f64)]) -> Motion {
    let keyframes = keyframes
        .iter()
        .map(|&(time, x, rotation_deg)| Keyframe {
            time,
            translation: DVec3::X * x,
            rotation_deg,
        })
        .collect();
    Motion::Keyframes(KeyframeMotion {
        duration: 2.0,
        groups: vec![KeyframeGroup {
            handles,
            axis: DVec3::Y,
            keyframes,
        }],
    })
}

#[test]
fn keyframes_are_met_with_no_speed() {
    let motion = keyframed(vec![1, 0], &[(0.5, 1.0, 90.0), (1.5, 3.0, -90.0)]);
    let path = bound(&motion);
    assert_eq!(path.frame_count(), 120);
    assert_eq!(path.at(0.0), corners());
    // Turned by +90° about y, +z goes to +x; at the start the centroid is the origin.
    let first = path.at(0.5);
    assert!(first[1].distance(DVec3::new(1.5, 0.0, 0.0)) < 1e-15);
    assert!(first[0].distance(DVec3::new(0.5, 0.0, 0.0)) < 1e-15);
    let last = path.at(1.5);
    assert!(last[1].distance(DVec3::new(2.5, 0.0, 0.0)) < 1e-15);
    assert_eq!(path.at(5.0), last);
    // Half way in time is half way in place, and angle (symmetry of 3s² - 2s³).
    assert!(path.at(1.0)[1].distance(DVec3::new(2.0, 0.0, 0.5)) < 1e-15);
    // Level ends: 3 (2 m)(h/1 s)² after h = 1e-4 s, and the turn's part, is 1e-7 at most.
    assert!(path.at(0.5001)[0].distance(first[0]) < 2e-7);
}

#[test]
fn a_handle_in_no_group_stays() {
    let path = bound(&keyframed(vec![1], &[(1.0, 0.7, 40.0)]));
    assert_eq!(path.at(1.0)[0], corners()[0]);
    // A single handle is its own centroid: the turn does not move it.
    assert!(path.at(1.0)[1].distance(corners()[1] + DVec3::X * 0.7) < 1e-15);
}

#[test]
fn wrong_keyframes_are_errors() {
    // Handles, keyframes, and what is said.
    let cases = "\
    [0, 2] | { time = 1 } | groups[0] names handle 2, but the scene has 2 handles (numbered from 0)
    [0, 0] | { time = 1 } | handle 0 is named by groups[0] and again by groups[0]
    [0] | { time = 1 }, { time = 1, rotation_deg = 2 } | groups[0].keyframes[1].time must be later
    [0] | { time = 2.5 } | groups[0].keyframes[0].time must be between
    [0] | { time = 0, translation = [1, 0, 0] } | groups[0].keyframes[0].time must be later than 0
    [0] | { time = 0, rotation_deg = 9 } | groups[0].keyframes[0].time must be later than 0
    [0] | { time = 1, rotation_deg = nan } | groups[0].keyframes[0].rotation_deg
    [0] | { time = 1, translation = [1.1e6, 0, 0] } | groups[0].keyframes[0].translation
    [] | { time = 1 } | groups[0].handles";
    for case in cases.lines() {
        let [handles, keyframes, words] = case.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("three columns: {case}");
        };
        let group = format!("handles = {handles}\nkeyframes = [{keyframes}]");
        let text = format!("kind = \"keyframes\"\nduration = 2\n[[groups]]\n{group}");
        let text = refused(&toml::from_str(&text).unwrap());
        assert!(text.starts_with(&format!("motion: {words}")), "{text}");
    }
}

#[test]
fn a_group_moves_rigidly_about_its_own_axis() {
    let start = [
        DVec3::new(1.0, 2.0, 3.0),
        DVec3::new(1.5, 2.0, 3.0),
        DVec3::new(1.0, 2.6, 3.2),
    ];
    let Motion::Keyframes(mut motion) = keyframed(vec![0, 1, 2], &[(1.0, 0.5, 450.0)]) else {
        unreachable!()
    };
    motion.groups[0].axis = DVec3::new(0.0, 0.0, 2.0);
    let path = Motion::Keyframes(motion.clone())
        .bind(&start, 60.0)
        .unwrap();
    // A turn and a quarter about z through the centroid, then half a metre along x.
    let center = (start[0] + start[1] + start[2]) / 3.0;
    for (found, from) in path.at(1.0).iter().zip(start) {
        let arm = from - center;
        let expected = center + DVec3::new(-arm.y, arm.x, arm.z) + DVec3::X * 0.5;
        assert!(found.distance(expected) < 1e-14);
    }
    // Between keyframes all distances stay.
    let between = path.at(0.37);
    for k in 0..3 {
        let before = start[k].distance(start[(k + 1) % 3]);
        assert!((between[k].distance(between[(k + 1) % 3]) - before).abs() < 1e-14);
    }
    motion.groups[0].axis = DVec3::ZERO;
    let error = Motion::Keyframes(motion).bind(&start, 60.0).unwrap_err();
    assert_eq!(
        error.to_string(),
        "motion: groups[0].axis must be a direction, found [0, 0, 0]"
    );
}

#[test]
fn a_schedule_goes_with_the_targets() {
    let schedule = HandleSchedule {
        releases: vec![Release {
            handles: vec![1],
            from: 0.5,
            to: None,
        }],
    };
    let path = bound(&keyframed(vec![1], &[(1.0, 0.7, 40.0)])).scheduled(schedule);
    let holds = |frame| {
        let targets = path.targets(frame, 2).unwrap();
        [targets.holds(0), targets.holds(1)]
    };
    assert_eq!(holds(29), [true, true]);
    assert_eq!(holds(30), [true, false]);
}
