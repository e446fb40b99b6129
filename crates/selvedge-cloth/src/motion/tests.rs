use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;

use super::*;

/// The handles of the paper's sheet.
fn corners() -> Vec<DVec3> {
    vec![DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 0.5)]
}

fn along(duration: f64, direction: DVec3, pace: Pace) -> Motion {
    Motion::Blocks {
        blocks: vec![translation_block(duration, direction, pace)],
    }
}

fn translation_block(duration: f64, direction: DVec3, pace: Pace) -> Block {
    Block {
        translations: vec![Translation { direction, pace }],
        ..Block::still(duration)
    }
}

fn turn_block(duration: f64, center: f64, sense: TurnSense, arc: Pace) -> Block {
    Block {
        rotation: Some(Rotation { center, sense, arc }),
        ..Block::still(duration)
    }
}

fn speed(start: f64, end: f64, profile: Profile) -> Pace {
    Pace::Speed {
        start,
        end,
        profile,
    }
}

const METRE: Pace = Pace::Distance { distance: 1.0 };

#[test]
fn a_smooth_metre_in_a_second_peaks_at_half_pi() {
    // s(t) = (1 - cos πt)/2 has the speed (π/2) sin πt.
    let path = along(1.0, DVec3::X, METRE).bind(&corners(), 60.0).unwrap();
    let h = 1e-5;
    let speed = |t: f64| (path.at(t + h)[0].x - path.at(t - h)[0].x) / (2.0 * h);
    // The central difference errs by h²/6 |s'''| ≤ h² π³/12 = 3e-10, its rounding by 1e-16/h = 1e-11.
    for t in [0.1, 0.25, 0.5, 0.8] {
        assert!((speed(t) - FRAC_PI_2 * (PI * t).sin()).abs() < 1e-9);
    }
    // Per frame, as the paper gives it: 0.02618 m.
    let step = path.at(30.5 / 60.0)[0].x - path.at(29.5 / 60.0)[0].x;
    assert!((step - 0.02618).abs() < 5e-6);
}

#[test]
fn training_motions_close_and_last_1261_positions() {
    for name in named::training().into_iter().chain(named::test()) {
        let path = named::by_name(name)
            .unwrap()
            .bind(&corners(), 60.0)
            .unwrap();
        assert_eq!(path.frame_count() + 1, 1261, "{name}");
        for (end, start) in path.at(21.0).iter().zip(corners()) {
            assert!(end.distance(start) < 1e-12, "{name} ends at {end}");
        }
        // Still for a second, then a move of one metre (of arc, for the farthest handle).
        assert_eq!(path.at(1.0), corners(), "{name}");
        let turn = name.contains("rotation");
        let moved = |handle: usize| {
            (0..60).map(move |k| 1.0 + f64::from(k) / 60.0).fold(0.0, {
                let path = &path;
                move |sum: f64, t| {
                    sum + path.at(t)[handle].distance(path.at(t + 1.0 / 60.0)[handle])
                }
            })
        };
        let longest = moved(0).max(moved(1));
        // 60 chords of an arc of up to 2 rad: each is short by a share of at most
        // (2 · 0.02618)²/24 = 1.1e-4; straight moves have no such defect.
        let tolerance = if turn { 1.2e-4 } else { 1e-12 };
        assert!(
            (longest - 1.0).abs() < tolerance,
            "{name} moves {longest} m"
        );
    }
}

#[test]
fn each_opposite_mirrors_its_move() {
    for name in named::training().into_iter().chain(named::test()) {
        let Some(original) = name.strip_suffix("-opposite") else {
            continue;
        };
        let bind = |name| {
            named::by_name(name)
                .unwrap()
                .bind(&corners(), 60.0)
                .unwrap()
        };
        let (there, back) = (bind(original), bind(name));
        for (handle, start) in corners().into_iter().enumerate() {
            let sum = there.at(1.7)[handle] + back.at(1.7)[handle];
            assert!(sum.distance(2.0 * start) < 1e-15, "{name}");
        }
    }
}

#[test]
fn a_rotation_covers_its_arc_and_turns_the_right_way() {
    for (center, radius) in [(0.0, 0.5), (-1.0, 1.0), (1.0, 1.0), (2.0, 1.5), (0.4, 0.7)] {
        let block = turn_block(1.0, center, TurnSense::CounterClockwise, METRE);
        let motion = Motion::Blocks {
            blocks: vec![block],
        };
        let path = motion.bind(&corners(), 60.0).unwrap();
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
    let bind = |block: Block| {
        let blocks = vec![block];
        Motion::Blocks { blocks }.bind(&start, 60.0).unwrap()
    };
    let (turned, moved) = (bind(turn).at(1.0), bind(both).at(1.0));
    for ((from, turned), moved) in start.iter().zip(turned).zip(moved) {
        assert_eq!(turned.y, from.y);
        assert!((moved - turned).distance(DVec3::new(0.6, 1.0, 0.0)) < 1e-14);
    }
}

#[test]
fn speeds_add_up_frame_by_frame() {
    let linear = along(1.0, DVec3::X, speed(0.02, -0.02, Profile::Linear));
    let path = linear.bind(&corners(), 60.0).unwrap();
    let mut sum = 0.0;
    for k in 1..=60 {
        sum += 0.02 - 0.04 * f64::from(k) / 60.0;
        assert!((path.at(f64::from(k) / 60.0)[0].x - sum).abs() < 1e-15);
    }
    // 60 · 0.02 - 0.04 · (60 + 1)/2 = -0.02.
    assert!((sum + 0.02).abs() < 1e-15);
    // Σ (1 - cos(πk/n))/2 over k = 1 … n is (n + 1)/2: the cosines cancel but for the last.
    let smooth = along(1.0, DVec3::X, speed(0.0, 0.02, Profile::Smooth));
    let path = smooth.bind(&corners(), 60.0).unwrap();
    assert!((path.at(1.0)[1].x - 0.02 * 30.5).abs() < 1e-14);
    // Linear between frames.
    let middle = (path.at(19.0 / 60.0)[0] + path.at(20.0 / 60.0)[0]) / 2.0;
    assert!(path.at(19.5 / 60.0)[0].distance(middle) < 1e-15);
}

#[test]
fn bouncy_is_as_described() {
    let path = named::by_name("bouncy")
        .unwrap()
        .bind(&corners(), 60.0)
        .unwrap();
    assert_eq!(path.frame_count(), 30 + 5 * 60 + 180);
    assert_eq!(path.at(0.5), corners());
    // Forward: (60 + 1)/2 + 3 · 60 + (60 - 1)/2 frames at 0.01. Up and down: -0.02 a block.
    let end = path.at(5.5)[0] - corners()[0];
    assert!(
        end.distance(DVec3::new(0.01 * 240.0, -0.1, 0.0)) < 1e-13,
        "{end}"
    );
    // Top of the first bounce: the first 30 speeds are 0.02(1 - k/30), their sum 0.02 · 14.5.
    assert!((path.at(1.0)[0].y - 0.29).abs() < 1e-14);
    assert_eq!(path.at(5.5), path.at(8.5));
}

#[test]
fn generalisation_motions_have_their_lengths_and_peak_speeds() {
    let expected = [
        ("rotate-bounce", 4.0, 0.02),
        ("spiral", 10.5, 0.02617),
        ("snake", 9.0, 0.02617),
        ("upward-spiral", 8.0, 0.02617_f64.hypot(0.0175)),
        ("speed-0.015", 4.0, 0.015),
        ("speed-0.05", 4.0, 0.05),
    ];
    for (name, seconds, peak) in expected {
        let motion = named::by_name(name).unwrap();
        let path = motion.bind(&corners(), 60.0).unwrap();
        let frames = (seconds * 60.0) as usize;
        assert_eq!(path.frame_count(), 30 + frames + 180, "{name}");
        let mut fastest: f64 = 0.0;
        for k in 0..path.frame_count() {
            let (a, b) = (path.at(k as f64 / 60.0), path.at((k + 1) as f64 / 60.0));
            let arc = |h: usize| (b[h] - a[h]).with_y(0.0).length();
            let rise = b[0].y - a[0].y;
            let along = if name == "upward-spiral" { rise } else { 0.0 };
            fastest = fastest.max(arc(0).max(arc(1)).hypot(along));
        }
        // A chord is shorter than its arc by a share of at most (0.02617/0.5)²/24 = 1.1e-4.
        assert!((fastest / peak - 1.0).abs() < 1.2e-4, "{name}: {fastest}");
    }
}

#[test]
fn snake_turns_by_135_270_and_135_degrees() {
    let path = named::by_name("snake")
        .unwrap()
        .bind(&corners(), 60.0)
        .unwrap();
    let heading = |t: f64| {
        let [a, b] = path.at(t)[..] else { panic!() };
        (b.x - a.x).atan2(b.z - a.z).to_degrees()
    };
    // 0.02617 · (180 ± 1)/2 and 0.02617 · 180 metres at 1 m, in degrees.
    assert!((heading(3.5) - 135.7).abs() < 0.1);
    assert!((heading(6.5) + 134.2).abs() < 0.1);
    assert!(heading(9.5).abs() < 0.1);
}

#[test]
fn apart_keeps_the_handles_between_0_6_and_1() {
    let path = named::by_name("apart")
        .unwrap()
        .bind(&corners(), 60.0)
        .unwrap();
    let distances: Vec<f64> = (0..=path.frame_count())
        .map(|k| path.at(k as f64 / 60.0))
        .map(|p| p[0].distance(p[1]))
        .collect();
    let least = distances.iter().copied().fold(f64::MAX, f64::min);
    let most = distances.iter().copied().fold(0.0, f64::max);
    assert!((least - 0.6).abs() < 1e-12 && (most - 1.0).abs() < 1e-12);
    assert_eq!(path.frame_count(), 30 + 300 + 180);
    assert_eq!(path.at(8.5), corners());
}

#[test]
fn every_name_binds_and_is_unique() {
    let names = named::names();
    let unique: std::collections::HashSet<_> = names.iter().collect();
    assert_eq!(unique.len(), names.len());
    assert_eq!((named::training().len(), named::test().len()), (16, 15));
    for name in names {
        let motion = named::by_name(name).unwrap();
        motion.bind(&corners(), 60.0).unwrap();
        let text = toml::to_string(&motion).unwrap();
        assert_eq!(toml::from_str::<Motion>(&text).unwrap(), motion, "{name}");
    }
    assert_eq!(named::by_name("sideways"), None);
}

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
        groups: vec![KeyframeGroup { handles, keyframes }],
    })
}

#[test]
fn keyframes_are_met_with_no_speed() {
    let motion = keyframed(vec![1, 0], &[(0.5, 1.0, 90.0), (1.5, 3.0, -90.0)]);
    let path = motion.bind(&corners(), 60.0).unwrap();
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
    let path = keyframed(vec![1], &[(1.0, 0.7, 40.0)]);
    let path = path.bind(&corners(), 60.0).unwrap();
    assert_eq!(path.at(1.0)[0], corners()[0]);
    // A single handle is its own centroid: the turn does not move it.
    assert!(path.at(1.0)[1].distance(corners()[1] + DVec3::X * 0.7) < 1e-15);
}

#[test]
fn wrong_keyframes_are_errors() {
    let error = |motion: Motion| motion.bind(&corners(), 60.0).unwrap_err().to_string();
    assert_eq!(
        error(keyframed(vec![0, 2], &[(1.0, 1.0, 0.0)])),
        "motion: groups[0] names handle 2, but the scene has 2 handles (numbered from 0)"
    );
    assert_eq!(
        error(keyframed(vec![0, 0], &[(1.0, 1.0, 0.0)])),
        "motion: handle 0 is named by groups[0] and again by groups[0]"
    );
    let disorder = error(keyframed(vec![0], &[(1.0, 1.0, 0.0), (1.0, 2.0, 0.0)]));
    assert!(
        disorder.contains("groups[0].keyframes[1].time"),
        "{disorder}"
    );
    let late = error(keyframed(vec![0], &[(2.5, 1.0, 0.0)]));
    assert!(late.contains("duration"), "{late}");
    let jump = error(keyframed(vec![0], &[(0.0, 1.0, 0.0)]));
    assert!(jump.contains("cannot jump"), "{jump}");
    let nan = error(keyframed(vec![0], &[(1.0, 1.0, f64::NAN)]));
    assert!(nan.contains("rotation_deg"), "{nan}");
    let nobody = error(keyframed(vec![], &[(1.0, 1.0, 0.0)]));
    assert!(nobody.contains("groups[0].handles"), "{nobody}");
}

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
    let error = |motion: Motion| motion.bind(&corners(), 60.0).unwrap_err();
    assert_eq!(
        error(recording(|p| p[2].truncate(1))),
        MotionError::HandleCount {
            frame: 2,
            expected: 2,
            found: 1
        }
    );
    let nan = error(recording(|p| p[3][1].y = f64::NAN));
    assert!(matches!(
        nan,
        MotionError::NonFinite {
            frame: 3,
            handle: 1,
            ..
        }
    ));
    let away = error(recording(|p| p[0][1].y = 0.002)).to_string();
    assert!(
        away.contains("handle 1") && away.contains("2.000 mm"),
        "{away}"
    );
    recording(|p| p[0][1].y = 0.0009)
        .bind(&corners(), 60.0)
        .unwrap();
    let empty = error(recording(Vec::clear)).to_string();
    assert!(empty.contains("at least one frame"), "{empty}");
}

#[test]
fn wrong_blocks_are_errors() {
    let error = |motion: Motion| motion.bind(&corners(), 60.0).unwrap_err().to_string();
    for duration in [0.0, -1.0, 0.5001, 1e9, f64::NAN, f64::INFINITY] {
        let text = error(Motion::still(duration));
        assert!(text.contains("blocks[0].duration"), "{text}");
    }
    let text = error(along(1.0, DVec3::ZERO, METRE));
    assert!(
        text.contains("blocks[0].translations[0].direction"),
        "{text}"
    );
    let nowhere = along(1.0, DVec3::ZERO, speed(0.0, 0.0, Profile::Linear));
    nowhere.bind(&corners(), 60.0).unwrap();
    let text = error(along(1.0, DVec3::X, speed(0.0, f64::NAN, Profile::Smooth)));
    assert!(
        text.contains("blocks[0].translations[0].pace.end"),
        "{text}"
    );
    let text = error(Motion::Blocks { blocks: vec![] });
    assert!(text.contains("at least one block"), "{text}");
    let far = Pace::Distance { distance: 1e308 };
    let twice = vec![translation_block(1.0, DVec3::X, far); 2];
    let text = error(Motion::Blocks { blocks: twice });
    assert!(text.contains("blocks[1]"), "{text}");
}

#[test]
fn a_rotation_needs_a_line() {
    let turn = turn_block(1.0, 0.0, TurnSense::Clockwise, METRE);
    let motion = Motion::Blocks { blocks: vec![turn] };
    for count in [0, 1] {
        assert_eq!(
            motion.bind(&corners()[..count], 60.0),
            Err(MotionError::TooFewHandles {
                what: "a rotation about a point of the handles' line",
                needed: 2,
                found: count
            })
        );
    }
    let above = [DVec3::ZERO, DVec3::Y];
    let text = motion.bind(&above, 60.0).unwrap_err().to_string();
    assert!(text.contains("rotation.center"), "{text}");
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
fn the_start_and_the_frame_rate_are_checked() {
    let motion = Motion::still(1.0);
    let text = motion.bind(&[DVec3::NAN], 60.0).unwrap_err().to_string();
    assert!(text.contains("handle 0"), "{text}");
    for rate in [0.0, -1.0, f64::NAN] {
        let text = motion.bind(&corners(), rate).unwrap_err().to_string();
        assert!(text.contains("frame_rate"), "{text}");
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
    assert_eq!(
        Motion::still(1.0 / 60.0)
            .bind(&[], 24.0)
            .unwrap()
            .frame_count(),
        1
    );
}

#[test]
fn targets_end_where_the_next_frame_starts() {
    let path = named::by_name("xyz")
        .unwrap()
        .bind(&corners(), 60.0)
        .unwrap();
    let targets = path.targets(75, 4).unwrap();
    assert_eq!(targets.end(), path.at(76.0 / 60.0));
    for (k, fraction) in [0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let expected = path.at((75.0 + fraction) / 60.0)[1];
        assert_eq!(targets.at(1, fraction, DVec3::ZERO), expected, "sample {k}");
    }
}

const OWN: &str = r#"
kind = "blocks"
[[blocks]]
duration = 1
translations = [{ direction = [1, 0, 0], pace = { distance = 1 } }]
[[blocks]]
duration = 0.5
rotation = { center = -1, sense = "clockwise", arc = { start = 0, end = 0.02, profile = "smooth" } }
"#;

#[test]
fn toml_reads_naturally() {
    let motion: Motion = toml::from_str(OWN).unwrap();
    let expected = Motion::Blocks {
        blocks: vec![
            translation_block(1.0, DVec3::X, METRE),
            turn_block(
                0.5,
                -1.0,
                TurnSense::Clockwise,
                speed(0.0, 0.02, Profile::Smooth),
            ),
        ],
    };
    assert_eq!(motion, expected);
    let keyframes = r#"
        kind = "keyframes"
        duration = 2.0
        [[groups]]
        handles = [0]
        keyframes = [{ time = 1.0, translation = [0, 0.1, 0] }, { time = 2, rotation_deg = 20 }]
    "#;
    let Motion::Keyframes(motion) = toml::from_str(keyframes).unwrap() else {
        panic!("read as another kind");
    };
    assert_eq!(motion.groups[0].keyframes[1].rotation_deg, 20.0);
    let recorded = "kind = \"recorded\"\npositions = [[[0, 0, 0]], [[0, 1, 0]]]";
    let motion: Motion = toml::from_str(recorded).unwrap();
    assert_eq!(motion.bind(&[DVec3::ZERO], 60.0).unwrap().frame_count(), 1);
}

#[test]
fn unknown_and_missing_keys_are_named() {
    let with = |from: &str, to: &str| {
        let text = OWN.replace(from, to);
        assert_ne!(text, OWN);
        toml::from_str::<Motion>(&text).unwrap_err().to_string()
    };
    for (from, to, named) in [
        (
            "kind = \"blocks\"",
            "kind = \"blocks\"\nrepeat = 3",
            "repeat",
        ),
        ("duration = 1\n", "duration = 1\nlength = 2\n", "length"),
        ("direction =", "dir =", "dir"),
        ("distance = 1", "distanse = 1", "distanse"),
        ("distance = 1", "distance = 1, start = 0", "not both"),
        ("start = 0, ", "", "start"),
        (", profile = \"smooth\"", "", "profile"),
        ("center = -1", "centre = -1", "centre"),
        ("\"clockwise\"", "\"left\"", "left"),
        ("\"smooth\"", "\"abrupt\"", "abrupt"),
        ("kind = \"blocks\"", "kind = \"dance\"", "dance"),
        ("kind = \"blocks\"", "", "kind"),
    ] {
        let message = with(from, to);
        assert!(message.contains(named), "{to}: {message}");
    }
    let extra = "kind = \"recorded\"\npositions = []\nrate = 3";
    let message = toml::from_str::<Motion>(extra).unwrap_err().to_string();
    assert!(message.contains("rate"), "{message}");
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
        let path = Motion::Blocks { blocks }.bind(&corners(), 60.0).unwrap();
        prop_assert_eq!(path.frame_count(), 4 * frames as usize);
        for (end, start) in path.at(4.0 * duration).into_iter().zip(corners()) {
            prop_assert!(end.distance(start) < 1e-12);
        }
        for joint in 1..4 {
            // An eased pace starts and ends with |s''| ≤ π²/2 · 2/duration² · 5 (the radius
            // is at most 5 handles' half distances per unit): within 1e-9 s that is below 1e-11.
            let t = f64::from(joint) * duration;
            let (a, b) = (path.at(t - 1e-9), path.at(t + 1e-9));
            prop_assert!(a[0].distance(b[0]) < 1e-11);
        }
    }
}
