//! Motions as people write them in TOML, and what is said to them when a key is wrong.

use glam::DVec3;

use super::super::{Motion, Profile, TurnSense};
use super::{METRE, bound, corners, of_blocks, speed, translation_block, turn_block};

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
    let arc = speed(0.0, 0.02, Profile::Smooth);
    let expected = of_blocks(vec![
        translation_block(1.0, DVec3::X, METRE),
        turn_block(0.5, -1.0, TurnSense::Clockwise, arc),
    ]);
    assert_eq!(motion, expected);
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
        ("kind =", "repeat = 3\nkind =", "repeat"),
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

#[test]
fn the_shipped_examples_play() {
    let the_loop = include_str!("../../../../../assets/motions/loop.toml");
    let motion: Motion = toml::from_str(the_loop).unwrap();
    let path = bound(&motion);
    assert_eq!(path.frame_count(), 390);
    // Each swing from 0.02 to -0.02 ends 0.02 m short of where it began: the two cancel.
    assert!(path.at(2.5)[0].distance(corners()[0]) < 1e-13);
    let curtsey = include_str!("../../../../../assets/motions/curtsey.toml");
    let motion: Motion = toml::from_str(curtsey).unwrap();
    let path = bound(&motion);
    assert_eq!(path.at(6.0), [0, 1].map(|k| corners()[k] + DVec3::X * 0.4));
}
