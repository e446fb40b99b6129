//! Blocks against closed forms; binding, frame rates and targets, which all forms share.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use proptest::prelude::*;

use super::super::{KeyframeMotion, RecordedMotion, named};
use super::*;

#[test]
fn a_smooth_metre_in_a_second_peaks_at_half_pi() {
    // s(t) = (1 - cos πt)/2 has the speed (π/2) sin πt.
    let path = bound(&along(1.0, DVec3::X, METRE));
    let h = 1e-5;
    let speed = |t: f64| (path.at(t + h)[0].x - path.at(t - h)[0].x) / (2.0 * h);
    // The central difference errs by h²/6 |s'''| ≤ h² π³/12 = 3e-10, its rounding by 1e-16/h =
    // 1e-11.
    for t in [0.1, 0.25, 0.5, 0.8] {
        assert!((speed(t) - FRAC_PI_2 * (PI * t).sin()).abs() < 1e-9);
    }
    // Per frame, as the paper gives it: 0.02618 m.
    let step = path.at(30.5 / 60.0)[0].x - path.at(29.5 / 60.0)[0].x;
    assert!((step - 0.02618).abs() < 5e-6);
}

#[test]
fn a_rotation_covers_its_arc_and_turns_the_right_way() {
    for (center, radius) in [(0.0, 0.5), (-1.0, 1.0), (1.0, 1.0), (2.0, 1.5), (0.4, 0.7)] {
        let block = turn_block(1.0, center, TurnSense::CounterClockwise, METRE);
        let path = bound(&of_blocks(vec![block]));
        let axis = DVec3::new(0.0, 0.0, 0.5 * center);
        for (start, end) in corners().into_iter().zip(path.at(1.0)) {
            let (a, b) = (start - axis, end - axis);
            assert!((a.length() - b.length()).abs() < 1e-15);
            // Counter-clockwise from above is positive about +y; the angle is arc / radius.
            let angle = a.cross(b).y.atan2(a.dot(b));
            assert!(a.length() < 1e-15 || (angle - 1.0 / radius).abs() < 1e-14);
        }
    }
}

#[test]
fn rotation_leaves_heights_and_adds_translations() {
    let start = [
        DVec3::new(1.0, 0.2, -0.5),
        DVec3::new(1.3, 0.9, 0.1),
        DVec3::new(1.0, -0.4, 0.5),
    ];
    let turn = turn_block(1.0, 0.0, TurnSense::Clockwise, METRE);
    let both = Block {
        translations: vec![
            Translation {
                direction: DVec3::Y * 3.0,
                pace: METRE,
            },
            Translation {
                direction: DVec3::X,
                pace: speed(0.01, 0.01, Profile::Linear),
            },
        ],
        ..turn.clone()
    };
    let bind = |block| of_blocks(vec![block]).bind(&start, 60.0).unwrap();
    let (turned, moved) = (bind(turn).at(1.0), bind(both).at(1.0));
    for ((from, turned), moved) in start.iter().zip(turned).zip(moved) {
        assert_eq!(turned.y, from.y);
        assert!((moved - turned).distance(DVec3::new(0.6, 1.0, 0.0)) < 1e-14);
    }
}

#[test]
fn speeds_add_up_frame_by_frame() {
    let linear = along(1.0, DVec3::X, speed(0.02, -0.02, Profile::Linear));
    let path = bound(&linear);
    let mut sum = 0.0;
    for k in 1..=60 {
        sum += 0.02 - 0.04 * f64::from(k) / 60.0;
        assert!((path.at(f64::from(k) / 60.0)[0].x - sum).abs() < 1e-15);
    }
    // 60 · 0.02 - 0.04 · (60 + 1)/2 = -0.02.
    assert!((sum + 0.02).abs() < 1e-15);
    // Σ (1 - cos(πk/n))/2 over k = 1 … n is (n + 1)/2: the cosines cancel but for the last.
    let smooth = along(1.0, DVec3::X, speed(0.0, 0.02, Profile::Smooth));
    let path = bound(&smooth);
    assert!((path.at(1.0)[1].x - 0.02 * 30.5).abs() < 1e-14);
    // Linear between frames.
    let middle = (path.at(19.0 / 60.0)[0] + path.at(20.0 / 60.0)[0]) / 2.0;
    assert!(path.at(19.5 / 60.0)[0].distance(middle) < 1e-15);
}

#[test]
fn wrong_blocks_are_errors() {
    for duration in [0.0, -1.0, 0.5001, 1e9, f64::NAN, f64::INFINITY] {
        let text = refused(&Motion::still(duration));
        assert!(text.contains("blocks[0].duration"), "{text}");
    }
    bound(&along(1.0, DVec3::ZERO, speed(0.0, 0.0, Profile::Linear)));
    let far = Pace::Distance { distance: 6e5 };
    let lost = speed(0.0, f64::NAN, Profile::Smooth);
    for (motion, words) in [
        (
            along(1.0, DVec3::ZERO, METRE),
            "blocks[0].translations[0].direction",
        ),
        (
            along(1.0, DVec3::X, lost),
            "blocks[0].translations[0].pace.end",
        ),
        (of_blocks(vec![]), "at least one block"),
        (
            of_blocks(vec![translation_block(1.0, DVec3::X, far); 2]),
            "blocks[1]",
        ),
    ] {
        let text = refused(&motion);
        assert!(text.starts_with("motion: "), "{text}");
        assert!(text.contains(words), "{text}");
    }
    let turn = of_blocks(vec![turn_block(1.0, 0.0, TurnSense::Clockwise, METRE)]);
    let few =
        "motion: a rotation about a point of the handles' line needs at least 2 handles, found";
    for (start, words) in [
        (&corners()[..0], &format!("{few} 0")[..]),
        (&corners()[..1], &format!("{few} 1")),
        (&[DVec3::ZERO, DVec3::Y], "rotation.center"),
        (&[DVec3::NAN], "handle 0"),
    ] {
        let text = turn.bind(start, 60.0).unwrap_err().to_string();
        assert!(text.contains(words), "{text}");
    }
    for rate in [0.0, -1.0, f64::NAN] {
        let text = turn.bind(&corners(), rate).unwrap_err().to_string();
        assert!(text.contains("frame_rate"), "{text}");
    }
}

#[test]
fn a_free_cloth_can_have_any_motion_but_a_rotation() {
    let recorded = Motion::Recorded(RecordedMotion {
        positions: vec![vec![]; 3],
    });
    let keyframes = Motion::Keyframes(KeyframeMotion {
        duration: 1.0,
        groups: vec![],
    });
    for motion in [recorded, keyframes, along(1.0, DVec3::X, METRE)] {
        let path = motion.bind(&[], 60.0).unwrap();
        assert!(path.at(0.3).is_empty());
        assert_eq!(path.targets(0, 4).unwrap().handle_count(), 0);
    }
}

#[test]
fn other_frame_rates_see_the_same_motion() {
    let motion = named::by_name("upward-spiral").unwrap();
    let bind = |rate| motion.bind(&corners(), rate).unwrap();
    let (at_60, at_24) = (bind(60.0), bind(24.0));
    assert_eq!(at_24.frame_count(), 276); // 11.5 s
    for t in [0.0, 0.7, 1.31, 4.0, 20.0] {
        assert_eq!(at_60.at(t), at_24.at(t));
    }
    // 1/60 s needs a whole frame of 1/24 s.
    let short = Motion::still(1.0 / 60.0).bind(&[], 24.0).unwrap();
    assert_eq!(short.frame_count(), 1);
}

#[test]
fn targets_end_where_the_next_frame_starts() {
    let path = bound(&named::by_name("xyz").unwrap());
    let targets = path.targets(75, 4).unwrap();
    assert_eq!(targets.end(), path.at(76.0 / 60.0));
    for (k, fraction) in [0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let expected = path.at((75.0 + fraction) / 60.0)[1];
        assert_eq!(targets.at(1, fraction, DVec3::ZERO), expected, "sample {k}");
    }
}

proptest! {
    /// Blocks join without a jump, whatever they are, and any there and back comes home.
    #[test]
    fn blocks_join_and_close(
        direction in prop::array::uniform3(-1.0..1.0_f64).prop_filter("a length", |d| d.iter().any(|x| x.abs() > 0.1)),
        distance in -2.0..2.0_f64,
        frames in 1..120_u32,
        center in -2.0..2.0_f64,
    ) {
        let duration = f64::from(frames) / 60.0;
        let direction = DVec3::from_array(direction);
        let there = Pace::Distance { distance };
        let back = Pace::Distance { distance: -distance };
        let turn = |arc| turn_block(duration, center, TurnSense::Clockwise, arc);
        let blocks = vec![
            translation_block(duration, direction, there),
            turn(there),
            turn(back),
            translation_block(duration, direction, back),
        ];
        let path = bound(&of_blocks(blocks));
        prop_assert_eq!(path.frame_count(), 4 * frames as usize);
        for (end, start) in path.at(4.0 * duration).into_iter().zip(corners()) {
            prop_assert!(end.distance(start) < 1e-12);
        }
        for joint in 1..4 {
            // |s''| ≤ π²/2 · 2 m/(1/60 s)² = 4e4 m/s²: from no speed, 1e-9 s are 4e-14 m.
            let t = f64::from(joint) * duration;
            let (a, b) = (path.at(t - 1e-9), path.at(t + 1e-9));
            prop_assert!(a[0].distance(b[0]) < 1e-11);
        }
    }
}
