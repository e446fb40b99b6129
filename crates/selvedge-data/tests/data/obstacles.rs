//! Obstacles of trajectories: baked beside the cloth, written and read back, and damage named.

use glam::{DQuat, DVec3, Vec2};
use selvedge_cloth::{Obstacle, ObstaclePath, RigidKey};
use selvedge_data::{ObstacleTrack, Trajectory};

use crate::help::{refuses, run, sheet, with_header};

fn trajectory(frames: usize) -> Trajectory {
    let flat = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let corners = flat.map(|c| c.extend(0.0));
    let cloth = sheet(&corners, &flat, &[[0, 1, 2]], &[0]);
    run(cloth, 10.0, corners.repeat(frames))
}

fn triangle(name: &str) -> Obstacle {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
    Obstacle::new(name, points, vec![[0, 2, 1]]).unwrap()
}

/// One that stands, one that turns as it rises, one that bends.
fn obstacles() -> Vec<Obstacle> {
    let key = |time: f64| RigidKey {
        time,
        rotation: DQuat::from_rotation_y(time),
        translation: DVec3::new(1.0, time, 0.0),
    };
    let turning = ObstaclePath::Rigid(vec![key(0.1), key(0.5)]);
    let frame = |y: f64| vec![DVec3::Y * y, DVec3::X, DVec3::Z];
    let bending = ObstaclePath::Points {
        frame_rate: 5.0,
        frames: vec![frame(0.0), frame(1.0), frame(4.0)],
    };
    vec![
        triangle("still"),
        triangle("turning").moving(turning).unwrap(),
        triangle("bending").moving(bending).unwrap(),
    ]
}

fn with_obstacles(first: usize) -> Trajectory {
    let tracks = obstacles();
    let tracks = tracks.iter().map(|o| ObstacleTrack::of(o, 10.0, first, 4));
    trajectory(4).with_obstacles(tracks.collect()).unwrap()
}

#[test]
fn tracks_are_where_the_obstacles_are_in_every_frame() {
    for first in [0, 2] {
        let trajectory = with_obstacles(first);
        for (track, obstacle) in trajectory.obstacles().iter().zip(obstacles()) {
            assert_eq!(track.name(), obstacle.name());
            assert_eq!(track.faces(), obstacle.faces());
            for frame in 0..4 {
                let time = (first + frame) as f64 / 10.0;
                let expected: Vec<DVec3> = obstacle.positions_at(time).collect();
                for (found, expected) in track.frame(frame).iter().zip(expected) {
                    // Single precision: pose and point are rounded once each, below 2 m.
                    assert!(found.as_dvec3().distance(expected) < 1e-6, "{time}");
                }
            }
        }
        assert!(trajectory.obstacles()[0].is_still());
    }
}

#[test]
fn what_is_written_is_read_back() {
    let trajectory = with_obstacles(0);
    let bytes = trajectory.to_bytes();
    let read = Trajectory::from_bytes(&bytes).unwrap();
    assert_eq!(read, trajectory);
    assert_eq!(read.to_bytes(), bytes);
    // Without obstacles the file is that of a version before.
    let bare = self::trajectory(4).to_bytes();
    let header = String::from_utf8_lossy(&bare[8..500]);
    assert!(header.contains("\"version\":\"1\""), "{header}");
    assert!(!header.contains("obstacle"), "{header}");
}

#[test]
fn what_does_not_fit_or_is_damaged_is_named() {
    let track = |frames| ObstacleTrack::of(&obstacles()[1], 10.0, 0, frames);
    let error = trajectory(4).with_obstacles(vec![track(3)]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "obstacle \"turning\": has 3 frames, the cloth has 4"
    );
    let bytes = with_obstacles(0).to_bytes();
    let edited = |from: &str, to: &str| {
        let edited = with_header(&bytes, |header| {
            assert!(header.contains(from), "{from}: {header}");
            header.replacen(from, to, 1)
        });
        Trajectory::from_bytes(&edited).map_err(|error| error.to_string())
    };
    let cases = r#"
        "version":"3" | "version":"9" | expected 1, 2, 3 or 4
        "obstacles" | "obstickle" | metadata obstickle
        [\"still\" |  \"still\" | a JSON list of names
        "obstacle_1.poses" | "obstacle_1.prose" | obstacle_1.prose, which this version
        "obstacle_2.faces" | "obstacle_9.faces" | obstacle_9.faces, which this version
    "#;
    refuses(cases, edited);
}
