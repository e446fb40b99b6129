//! Trajectory files: what is written is read back, equal runs make equal bytes, and whatever is
//! wrong with a file is an error that says what.

use std::ops::ControlFlow;

use crate::conformance::{HandlesEnd, check};
use glam::{Vec2, Vec3};
use proptest::prelude::*;
use selvedge_cloth::{Cloth, HandleTargets, Motion, StepError, Stepper};
use selvedge_data::{Drive, Playback, Provenance, RecordingEnd, Trajectory, record};
use serde_json::json;

use crate::help::{refuses, says, sheet, with_header};

fn cloth() -> Cloth {
    let flat = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let faces = [[0, 1, 2], [0, 2, 3]];
    sheet(&flat.map(|c| c.extend(0.0)), &flat, &faces, &[3, 2])
}

fn provenance() -> Provenance {
    Provenance {
        frame_rate: 60.0,
        scene: json!({"name": "a \"quoted\" scene", "damping": 0.1}),
        made_by: "selvedge tests".to_owned(),
    }
}

fn trajectory(frames: usize) -> Trajectory {
    let positions = (0..frames * 4)
        .map(|k| Vec3::new(k as f32, 0.1 * k as f32, -1.0))
        .collect();
    Trajectory::new(cloth(), positions, provenance()).unwrap()
}

#[test]
fn equal_trajectories_make_equal_bytes_and_the_data_are_aligned() {
    let bytes = trajectory(3).to_bytes();
    assert_eq!(bytes, trajectory(3).to_bytes());
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap());
    assert_eq!(header % 8, 0);
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let bytes = trajectory(2).to_bytes();
    for length in 0..bytes.len() {
        let cut = Trajectory::from_bytes(&bytes[..length]);
        assert!(cut.is_err(), "{length}");
    }
    let mut longer = bytes;
    longer.push(0);
    assert!(Trajectory::from_bytes(&longer).is_err());
}

#[test]
fn errors_name_the_file_and_what_is_wrong() {
    let bytes = trajectory(2).to_bytes();
    let swap = |from: &str, to: &str| {
        let edited = with_header(&bytes, |header| {
            assert!(header.contains(from), "{from} is not in {header}");
            header.replace(from, to)
        });
        Trajectory::from_bytes(&edited).map_err(|error| error.to_string())
    };
    let cases = r#"
        selvedge-trajectory | something-else | found "something-else"
        "version":"1" | "version":"5" | expected 1, 2, 3 or 4, found "5 (made by selvedge tests
        "made_by" | "made_at" | made_at
        "fps":"60" | "fps":"fast" | fps: expected a number
        "fps":"60" | "fps":"-1" | frame rate must be finite and positive
        "vertex_mass": | "vertex_weight": | vertex_weight
        "shape":[2,4,3] | "shape":[2,3,4] | array positions: expected F32 [any, any, 3]
        "shape":[4,2] | "shape":[2,4] | expected F32 [4, 2], found F32 [2, 4]
        "U32","shape":[2] | "F32","shape":[2] | array handles: expected U32, I32 or I64, found F32 [2]
    "#;
    refuses(cases, swap);
    let error = Trajectory::read(std::path::Path::new("no/such/file"));
    says(error.unwrap_err(), &["no/such/file: could not be read"]);
}

#[test]
fn a_position_that_is_not_finite_is_named() {
    let mut positions = trajectory(3).positions().to_vec();
    positions[2 * 4 + 1].y = f32::NAN;
    let error = Trajectory::new(cloth(), positions, provenance());
    says(error.unwrap_err(), &["frame 2: the position of vertex 1"]);
    let bytes = trajectory(2).to_bytes();
    let needle = 0.7_f32.to_le_bytes();
    let at = bytes.windows(4).position(|w| w == needle).unwrap();
    let mut broken = bytes;
    broken[at..at + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let error = Trajectory::from_bytes(&broken).unwrap_err();
    says(error, &["frame 1: the position of vertex 3"]);
}

#[test]
fn positions_that_are_no_frames_are_an_error() {
    for count in [7, 0] {
        let error = Trajectory::new(cloth(), vec![Vec3::ZERO; count], provenance());
        says(error.unwrap_err(), &["no whole number of frames of 4"]);
    }
}

#[test]
fn a_playback_conforms() {
    let make = || Playback::new(trajectory(16));
    check(make, HandlesEnd::Elsewhere);
}

#[test]
fn recording_a_playback_gives_the_trajectory_back() {
    let original = trajectory(5);
    let start = original.handles().select(original.frame(0));
    let start: Vec<_> = start.iter().map(|p| p.as_dvec3()).collect();
    let path = Motion::still(1.0).bind(&start, 60.0).unwrap();
    let drive = Drive {
        path: &path,
        samples_per_frame: 1,
    };
    // Records this many frames, or until one.
    let go = |frames: usize, last: usize| {
        let mut playback = Playback::new(original.clone());
        let mut seen = Vec::new();
        let recording = record(&mut playback, drive, frames, &mut |playback| {
            seen.push(playback.frame());
            if playback.frame() == last {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        (recording, seen)
    };
    let (recording, seen) = go(4, 9);
    assert_eq!(recording.end, RecordingEnd::Complete);
    assert_eq!(recording.positions, original.positions());
    assert_eq!(seen, [1, 2, 3, 4]);
    // However many frames are asked for, memory is taken as they come.
    for (frames, last) in [(4, 2), (usize::MAX, 1)] {
        let (stopped, _) = go(frames, last);
        assert_eq!(stopped.end, RecordingEnd::Stopped);
        let expected = &original.positions()[..(last + 1) * 4];
        assert_eq!(stopped.positions, expected);
    }
    let (failed, _) = go(9, 9);
    assert_eq!(failed.positions, original.positions());
    let (frame, frames) = (5, 5);
    let end = StepError::EndOfRecording { frame, frames };
    assert_eq!(failed.end, RecordingEnd::Failed(end));

    let mut playback = Playback::new(original);
    let none = HandleTargets::at_frame_end(Vec::new()).unwrap();
    assert!(playback.step(&none).is_err());
    assert_eq!(playback.frame(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn writing_and_reading_changes_nothing(
        values in prop::collection::vec(prop::array::uniform3(-1e30_f32..1e30), 1..8),
        frame_rate in 1e-3..1e5_f64,
        made_by in ".*",
    ) {
        let positions = values.iter().flat_map(|&v| [Vec3::from(v); 4]).collect();
        let provenance = Provenance { frame_rate, made_by, ..provenance() };
        let original = Trajectory::new(cloth(), positions, provenance).unwrap();
        let read = Trajectory::from_bytes(&original.to_bytes()).unwrap();
        prop_assert_eq!(read, original);
    }

    #[test]
    fn random_bytes_are_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Trajectory::from_bytes(&bytes).is_err());
    }

    #[test]
    fn a_damaged_file_never_panics(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut bytes = trajectory(2).to_bytes();
        let at = at.index(bytes.len());
        bytes[at] = byte;
        // A damaged number may still be a valid one: only that it returns is asserted.
        let _ = Trajectory::from_bytes(&bytes);
    }
}
