//! Splines of transforms.

use glam::DVec3;

use super::super::{Motion, PoseKeyframe, SplineGroup, SplineMotion};
use super::{bound, corners};
use crate::error::refuses;

fn pose(time: f64, translation: DVec3, angle_deg: f64) -> PoseKeyframe {
    PoseKeyframe {
        time,
        scale: 1.0,
        axis: DVec3::Y,
        angle_deg,
        translation,
    }
}

fn motion(keyframes: Vec<PoseKeyframe>) -> SplineMotion {
    SplineMotion {
        duration: 4.0,
        taken: 0.0,
        groups: vec![SplineGroup {
            handles: vec![0, 1],
            keyframes,
        }],
    }
}

#[test]
fn a_quadratic_motion_is_met_between_inner_keyframes() {
    // The slope between two neighbours at equal distances is exact for t², and so is the cubic.
    let keyframes = (0..5)
        .map(|k| pose(f64::from(k), DVec3::X * f64::from(k * k), 0.0))
        .collect();
    let path = bound(&Motion::Splines(motion(keyframes)));
    assert_eq!(path.frame_count(), 240);
    for k in 0..=40 {
        let time = 1.0 + 0.05 * f64::from(k);
        let expected = corners()[1] + DVec3::X * time * time;
        assert!(path.at(time)[1].distance(expected) < 1e-14, "{time}");
    }
    // The outermost slopes are zero. Between 0 and 1 that is right for t²:
    assert!((path.at(0.25)[0].x - 0.0625).abs() < 1e-15);
    // but between 3 and 4 it is not: 9 + 7 (3s² - 2s³) + 6 (s³ - 2s² + s), at s = 1/2 this is 9 +
    // 3.5 + 0.75.
    assert!((path.at(3.5)[0].x - 13.25).abs() < 1e-14);
    assert_eq!(path.at(9.0), path.at(4.0));
}

#[test]
fn a_turn_is_rigid_and_goes_the_shorter_way() {
    let keyframes = vec![
        pose(0.0, DVec3::ZERO, 0.0),
        pose(1.0, DVec3::Y, 170.0),
        pose(2.0, DVec3::Y, -170.0),
    ];
    let path = bound(&Motion::Splines(motion(keyframes)));
    for k in 0..=40 {
        let place = path.at(0.05 * f64::from(k));
        assert!((place[0].distance(place[1]) - 1.0).abs() < 1e-14);
    }
    let (sine, cosine) = 170_f64.to_radians().sin_cos();
    let expected = DVec3::new(0.5 * sine, 1.0, 0.5 * cosine);
    assert!(path.at(1.0)[1].distance(expected) < 1e-15);
    // From 170° to 190° it stays behind the middle.
    for k in 0..=20 {
        assert!(path.at(1.0 + 0.05 * f64::from(k))[1].z < -0.45);
    }
}

#[test]
fn handles_are_where_the_mesh_has_them_when_they_are_taken() {
    let mut motion = motion(vec![
        pose(0.0, DVec3::X, 30.0),
        pose(1.0, DVec3::Y, 80.0),
        pose(2.0, DVec3::Z, 10.0),
    ]);
    motion.groups[0].keyframes[1].scale = 1.5;
    motion.groups[0].handles = vec![1];
    motion.taken = 0.7;
    let path = bound(&Motion::Splines(motion));
    assert!(path.at(0.7)[1].distance(corners()[1]) < 1e-15);
    assert!(path.at(1.5)[1].distance(corners()[1]) > 0.1);
    assert_eq!(path.at(1.5)[0], corners()[0]);
}

#[test]
fn handles_are_not_led_out_of_sight() {
    let mut keyframes = vec![pose(0.0, DVec3::ZERO, 0.0), pose(1.0, DVec3::ZERO, 0.0)];
    keyframes[1].scale = 1e7;
    let path = bound(&Motion::Splines(motion(keyframes)));
    let start: Vec<DVec3> = path.targets(0, 4).unwrap().end().to_vec();
    assert_eq!(start.len(), corners().len());
    assert!(start.iter().all(|p| p.length() < 1e6));
    let error = path.targets(60, 4).unwrap_err();
    let text = "the target of handle 0 is more than 1e6 m from the origin";
    assert!(error.to_string().starts_with(text), "{error}");
}

#[test]
fn toml_reads_and_wrong_values_are_named() {
    let text = r#"
        kind = "splines"
        duration = 1.5
        [[groups]]
        handles = [0]
        keyframes = [{ time = 0 }, { time = 1, axis = [0, 1, 0], angle_deg = 20, translation = [0, 1, 0] }]
    "#;
    let read: Motion = toml::from_str(text).unwrap();
    assert_eq!(read.bind(&corners(), 25.0).unwrap().frame_count(), 38);
    let keyframes = vec![pose(0.0, DVec3::ZERO, 0.0), pose(1.0, DVec3::X, 5.0)];
    refuses(
        &motion(keyframes),
        |motion| Motion::Splines(motion.clone()).bind(&corners(), 60.0),
        &[
            ("motion: duration must be", |m| m.duration = 0.0),
            ("motion: taken must be", |m| m.taken = f64::NAN),
            ("motion: groups[0].handles must be", |m| {
                m.groups[0].handles.clear();
            }),
            ("motion: groups[0] names handle 7", |m| {
                m.groups[0].handles = vec![7];
            }),
            ("motion: groups[0].keyframes must be", |m| {
                m.groups[0].keyframes.clear();
            }),
            ("motion: groups[0].keyframes[1].time must be later", |m| {
                m.groups[0].keyframes[1].time = 0.0;
            }),
            ("motion: groups[0].keyframes[1].scale must be", |m| {
                m.groups[0].keyframes[1].scale = -1.0;
            }),
            ("motion: groups[0].keyframes[0].axis must be", |m| {
                m.groups[0].keyframes[0].axis = DVec3::ZERO;
            }),
            ("motion: groups[0].keyframes[0].translation must be", |m| {
                m.groups[0].keyframes[0].translation.x = f64::INFINITY;
            }),
        ],
    );
}
