//! The motions that have a name: those that the network is trained on (of Libao et al. 2023), those
//! that it is tested on and never sees, and those that show how far it generalises.
//!
//! They are meant for a hanging sheet whose handles' line is z and 1 m long, as the paper's.
//! Translations fit any number of handles; rotations need two or more, with arcs and speeds of the
//! farthest one, so that a shorter line turns by a larger angle. `apart` is for two handles 1 m
//! apart along z, the first at the smaller z: others it moves as far, but not towards each other.

use std::sync::LazyLock;

use glam::DVec3;
use serde::Deserialize;

use super::pace::Pace;
use super::written::{Block, Motion, Rotation, Translation, TurnSense};

/// What `named.json` has: moves that a training or test motion repeats, there and back, and blocks.
#[derive(Deserialize)]
struct Catalogue {
    training: Vec<(String, Move)>,
    test: Vec<(String, Move)>,
    generalisation: Vec<(String, Vec<Block>)>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Move {
    /// A move along a direction.
    Along(DVec3),
    /// A turn about a centre on the handles' line.
    About(f64, TurnSense),
}

static CATALOGUE: LazyLock<Catalogue> = LazyLock::new(|| {
    serde_json::from_str(include_str!("named.json"))
        .expect("the embedded motions, which tests read")
});

/// The name of no motion at all, for ten seconds.
const STILL: &str = "still";
/// The handles of a line 1 m long come together to 0.6 m and part again to 1 m, twice, the last
/// one swinging forward before the first. Inward is +z for the first and -z for the last, wherever
/// they stand; one handle alone is an error when the motion is bound, a third stays where it is.
const APART: &str = "apart";

/// Every name that [`by_name`] knows, in the order still, training, test, generalisation.
pub fn names() -> Vec<&'static str> {
    [vec![STILL], training(), test(), generalisation()].concat()
}

fn names_of<T>(entries: &'static [(String, T)]) -> Vec<&'static str> {
    entries.iter().map(|(name, _)| name.as_str()).collect()
}

/// The 16 motions of the training set. Each lasts 1260 frames of 1/60 s: 60 still, ten moves of 60
/// frames and 1 m there and back in turn, 600 still. An `-opposite` starts the other way.
pub fn training() -> Vec<&'static str> {
    names_of(&CATALOGUE.training)
}

/// The 15 motions of the test set, timed as the training motions.
pub fn test() -> Vec<&'static str> {
    names_of(&CATALOGUE.test)
}

/// Those of the test set of which the training set has no likeness either. Seen from the handles,
/// the image of a training motion in a mirror is the motion with the other x; of five that is a
/// test motion.
pub fn unseen() -> Vec<&'static str> {
    let is_image = |way: &DVec3| {
        let image = Move::Along(DVec3::new(-way.x, way.y, way.z));
        CATALOGUE.training.iter().any(|(_, seen)| *seen == image)
    };
    let is_new = |(_, what): &&(String, Move)| !matches!(what, Move::Along(way) if is_image(way));
    let new = CATALOGUE.test.iter().filter(is_new);
    new.map(|(name, _)| name.as_str()).collect()
}

/// Motions unlike the training motions; each starts with 30 frames still and ends with 180. Of `snake`
/// and `spiral` three seconds up to 0.02617 m/frame, or down from it, are 2.355 m, which is 135° at 1 m
/// but for the sampling of the speeds: π/2/60 = 0.026180 is the peak speed of a training motion.
pub fn generalisation() -> Vec<&'static str> {
    [names_of(&CATALOGUE.generalisation), vec![APART]].concat()
}

/// Fastest that a motion with a name can be asked for, in parts of its speed.
const MOST_SPEED: f64 = 100.0;

/// The motion of that name: one of [`names`], or `random-` and a number (0 to 4294967295). With `@`
/// and a factor after it (`side@1.5`) it goes so many times as far in the same time
/// ([`Motion::at_speed`]).
pub fn by_name(name: &str) -> Option<Motion> {
    let Some((name, factor)) = name.split_once('@') else {
        return at_own_speed(name);
    };
    let factor: f64 = factor.parse().ok()?;
    let is_sensible = factor > 0.0 && factor <= MOST_SPEED;
    at_own_speed(name).filter(|_| is_sensible)?.at_speed(factor)
}

fn at_own_speed(name: &str) -> Option<Motion> {
    match name {
        STILL => return Some(Motion::still(10.0)),
        APART => {
            let line = [DVec3::ZERO, DVec3::Z];
            return Some(super::apart::along_line(&line, DVec3::Z, DVec3::X));
        }
        _ => {}
    }
    if let Some(number) = name.strip_prefix("random-") {
        let parsed: u32 = number.parse().ok()?;
        return (parsed.to_string() == number).then(|| super::random::motion(parsed));
    }
    let mut moves = CATALOGUE.training.iter().chain(&CATALOGUE.test);
    if let Some((_, what)) = moves.find(|entry| entry.0 == name) {
        return Some(there_and_back(*what));
    }
    let mut others = CATALOGUE.generalisation.iter();
    let (_, blocks) = others.find(|entry| entry.0 == name)?;
    let blocks = blocks.clone();
    Some(Motion::Blocks { blocks })
}

fn there_and_back(what: Move) -> Motion {
    let mut blocks = vec![Block::still(1.0)];
    for turn in 0..10 {
        let distance = if turn % 2 == 0 { 1.0 } else { -1.0 };
        let arc = Pace::Distance { distance };
        let mut block = Block::still(1.0);
        match what {
            Move::Along(direction) => {
                let pace = arc;
                block.translations.push(Translation { direction, pace });
            }
            Move::About(center, sense) => block.rotation = Some(Rotation { center, sense, arc }),
        }
        blocks.push(block);
    }
    blocks.push(Block::still(10.0));
    Motion::Blocks { blocks }
}
