//! Recorded motion is played as it is; wrong recordings are named.

use glam::DVec3;

use super::super::{Motion, RecordedMotion};
use super::{bound, corners, refused};

fn recording(mut edit: impl FnMut(&mut Vec<Vec<DVec3>>)) -> Motion {
    let mut positions: Vec<Vec<DVec3>> = (0..4)
        .map(|k| {
            corners()
                .into_iter()
                .map(|p| p + DVec3::X * f64::from(k * k))
                .collect()
        })
        .collect();
    edit(&mut positions);
    Motion::Recorded(RecordedMotion { positions })
}

#[test]
fn a_recording_is_played_as_it_is() {
    for frame_rate in [24.0, 60.0, 144.0] {
        let path = recording(|_| ()).bind(&corners(), frame_rate).unwrap();
        assert_eq!(path.frame_count(), 3);
        for k in 0..4 {
            assert_eq!(path.at(f64::from(k) / frame_rate)[1].x, f64::from(k * k));
        }
        // Linear between frames, and the last frame for good.
        assert!((path.at(1.5 / frame_rate)[0].x - 2.5).abs() < 1e-13);
        assert_eq!(path.at(100.0)[0].x, 9.0);
    }
}

#[test]
fn wrong_recordings_are_errors() {
    type Edit = fn(&mut Vec<Vec<DVec3>>);
    let cases: [(Edit, &str); 5] = [
        (
            |p| p[2].truncate(1),
            "frame 2 has positions for 1 handles, the scene has 2",
        ),
        (
            |p| p[3][1].y = f64::NAN,
            "the position of handle 1 in frame 3 must be finite",
        ),
        (
            |p| p[1][0].z = -1.1e6,
            "the position of handle 0 in frame 1 must be finite and at most 1e6 m",
        ),
        (
            |p| p[0][1].y = 0.002,
            "the recording starts with handle 1 at [0, 0.002, 0.5], 2.000 mm from",
        ),
        (Vec::clear, "positions must be at least one frame"),
    ];
    for (edit, words) in cases {
        let text = refused(&recording(edit));
        assert!(text.starts_with(&format!("motion: {words}")), "{text}");
    }
    bound(&recording(|p| p[0][1].y = 0.0009));
}
