//! The named motions are as they are meant to be: lengths, closure, speeds, angles.

use glam::DVec3;

use super::super::{HandlePath, Motion, RandomMotion, named};
use super::{bound, corners};

/// The path of the paper's handles by the motion of this name.
fn path(name: &str) -> HandlePath {
    bound(&named::by_name(name).unwrap())
}

/// The longest way that a handle goes in a frame of the first `frames`, and the farthest that one
/// goes along each axis and against it `[m]`.
fn fastest(path: &HandlePath, frames: usize) -> (f64, [f64; 6]) {
    let (mut fastest, mut reached) = (0.0_f64, [0.0_f64; 6]);
    for frame in 0..frames {
        let at = |frame: usize| path.at(frame as f64 / 60.0);
        for (now, next) in at(frame).iter().zip(at(frame + 1)) {
            let moved = next - *now;
            fastest = fastest.max(moved.length());
            for axis in 0..3 {
                reached[axis] = reached[axis].max(moved[axis]);
                reached[3 + axis] = reached[3 + axis].max(-moved[axis]);
            }
        }
    }
    (fastest, reached)
}

#[test]
fn training_motions_close_and_last_1261_positions() {
    for name in named::training().into_iter().chain(named::test()) {
        let path = path(name);
        assert_eq!(path.frame_count() + 1, 1261, "{name}");
        for (end, start) in path.at(21.0).iter().zip(corners()) {
            assert!(end.distance(start) < 1e-12, "{name} ends at {end}");
        }
        // Still for a second, then a move of one metre (of arc, for the farthest handle).
        assert_eq!(path.at(1.0), corners(), "{name}");
        let turn = name.contains("rotation");
        let moved = |handle: usize| -> f64 {
            let at = |frame: i32| path.at(1.0 + f64::from(frame) / 60.0)[handle];
            (0..60).map(|k| at(k).distance(at(k + 1))).sum()
        };
        let longest = moved(0).max(moved(1));
        // 60 chords of an arc of up to 2 rad: each is short by a share of at most
        // (2 · 0.02618)²/24 = 1.1e-4; straight moves have no such defect.
        let tolerance = if turn { 1.2e-4 } else { 1e-12 };
        let off = (longest - 1.0).abs();
        assert!(off < tolerance, "{name} moves {longest} m");
    }
}

#[test]
fn a_factor_after_a_name_makes_a_motion_so_many_times_as_fast() {
    for name in ["test-xy-minus-z", "speed-0.03", "random-7"] {
        let (own, fast) = (path(name), path(&format!("{name}@1.5")));
        assert_eq!(own.frame_count(), fast.frame_count());
        if name.starts_with("random") {
            // It turns: the arcs of the farthest handle are longer, not its chords.
            assert_ne!(own.at(3.0), fast.at(3.0));
            continue;
        }
        for frame in 0..=own.frame_count() {
            let time = frame as f64 / 60.0;
            for ((p, q), start) in own.at(time).iter().zip(fast.at(time)).zip(corners()) {
                assert!((1.5 * (*p - start)).distance(q - start) < 1e-12);
            }
        }
    }
    let turn = named::by_name("test-rotation-first-cw@0.5").unwrap();
    let arc = |motion: &Motion| match motion {
        Motion::Blocks { blocks } => blocks[1].rotation.unwrap().arc,
        _ => unreachable!("made of blocks"),
    };
    assert_eq!(arc(&turn), super::super::Pace::Distance { distance: 0.5 });
    for none in [
        "apart@2", "side@", "side@0", "side@-1", "side@NaN", "side@1e9", "nobody@2",
    ] {
        assert_eq!(named::by_name(none), None, "{none}");
    }
}

#[test]
fn random_motions_keep_to_the_trained_speed_and_go_everywhere() {
    let mut reached = [0.0_f64; 6];
    for number in 0..40 {
        let motion = named::by_name(&format!("random-{number}")).unwrap();
        assert_eq!(named::by_name(&format!("random-{number}")).unwrap(), motion);
        let path = bound(&motion);
        let (fastest, ways) = fastest(&path, path.frame_count());
        for (reached, way) in reached.iter_mut().zip(ways) {
            *reached = way.max(*reached);
        }
        // A move of 1 m in 60 frames peaks at π/2/60 m/frame.
        assert!(fastest <= std::f64::consts::FRAC_PI_2 / 60.0 + 1e-12);
        let end = path.frame_count() as f64 / 60.0;
        assert_eq!(path.at(0.5), corners(), "still for half a second");
        assert_eq!(path.at(end), path.at(end - 2.0), "still at the end");
    }
    // 320 moves of which each goes along a uniform direction or turns: every way is taken fast.
    assert!(reached.iter().all(|&speed| speed > 0.015), "{reached:?}");
    for number in ["", "01", "+1", "-1", "4294967296"] {
        let name = format!("random-{number}");
        assert_eq!(named::by_name(&name), None, "{name}");
    }
}

#[test]
fn each_opposite_mirrors_its_move() {
    for name in named::training().into_iter().chain(named::test()) {
        let Some(original) = name.strip_suffix("-opposite") else {
            continue;
        };
        let (there, back) = (path(original), path(name));
        for (handle, start) in corners().into_iter().enumerate() {
            let sum = there.at(1.7)[handle] + back.at(1.7)[handle];
            assert!(sum.distance(2.0 * start) < 1e-15, "{name}");
        }
    }
}

#[test]
fn bouncy_is_as_described() {
    let path = path("bouncy");
    assert_eq!(path.frame_count(), 30 + 5 * 60 + 180);
    assert_eq!(path.at(0.5), corners());
    // Forward: (60 + 1)/2 + 3 · 60 + (60 - 1)/2 frames at 0.01. Up and down: -0.02 a block.
    let end = path.at(5.5)[0] - corners()[0];
    let expected = DVec3::new(0.01 * 240.0, -0.1, 0.0);
    assert!(end.distance(expected) < 1e-13, "{end}");
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
        let path = path(name);
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
    let path = path("snake");
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
fn every_name_binds_and_is_unique() {
    let names = named::names();
    let unique: std::collections::HashSet<_> = names.iter().collect();
    assert_eq!(unique.len(), names.len());
    assert_eq!((named::training().len(), named::test().len()), (16, 15));
    for name in names {
        let motion = named::by_name(name).unwrap();
        bound(&motion);
        let text = toml::to_string(&motion).unwrap();
        assert_eq!(toml::from_str::<Motion>(&text).unwrap(), motion, "{name}");
    }
    assert_eq!(named::by_name("sideways"), None);
}

#[test]
fn motions_drawn_for_a_test_keep_to_their_speed_and_are_none_of_the_named() {
    let drawn = |number, speed| RandomMotion {
        seed: 3,
        number,
        duration: 4.0,
        speed,
    };
    let mut most = 0.0_f64;
    for number in 0..20 {
        let motion = drawn(number, 2.0).motion();
        assert_eq!(motion, drawn(number, 2.0).motion());
        assert_ne!(motion, drawn(number + 1, 2.0).motion());
        let path = bound(&motion);
        assert!(path.frame_count() >= 240);
        most = most.max(fastest(&path, 240).0);
    }
    let peak = 2.0 * std::f64::consts::FRAC_PI_2 / 60.0;
    assert!(most <= peak + 1e-12 && most > 0.8 * peak, "{most}");
    let named = named::by_name("random-3").unwrap();
    assert_ne!(drawn(0, 1.0).motion(), named);
}

#[test]
fn five_test_motions_are_images_of_training_motions() {
    let unseen = named::unseen();
    let mut images = named::test();
    images.retain(|name| !unseen.contains(name));
    let expected = [
        "test-x-minus-z",
        "test-x-minus-z-opposite",
        "test-x-minus-y",
        "test-yz-minus-x",
        "test-yz-minus-x-opposite",
    ];
    assert_eq!((unseen.len(), images.as_slice()), (10, expected.as_slice()));
}
