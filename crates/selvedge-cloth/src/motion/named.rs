//! The motions that have a name: those that the network is trained on (of Libao et al. 2023), those
//! that it is tested on and never sees, and those that show how far it generalises.
//!
//! They are meant for a hanging sheet whose handles' line is z and 1 m long, as the paper's.
//! Translations fit any number of handles; rotations need two or more, with arcs and speeds of the
//! farthest one, so that a shorter line turns by a larger angle. `apart` is for two handles 1 m
//! apart along z, the first at the smaller z: others it moves as far, but not towards each other.

use glam::DVec3;

use super::pace::{Pace, Profile};
use super::written::{Block, Motion, Rotation, Translation, TurnSense};
use TurnSense::{Clockwise, CounterClockwise};

/// A move that a training or test motion repeats, there and back.
#[derive(Clone, Copy)]
enum Move {
    /// A move along a direction.
    Along([f64; 3]),
    /// A turn about a centre on the handles' line.
    About(f64, TurnSense),
}

const TRAINING: [(&str, Move); 16] = [
    ("forward", Move::Along([1.0, 0.0, 0.0])),
    ("forward-opposite", Move::Along([-1.0, 0.0, 0.0])),
    ("side", Move::Along([0.0, 0.0, 1.0])),
    ("side-opposite", Move::Along([0.0, 0.0, -1.0])),
    ("updown", Move::Along([0.0, 1.0, 0.0])),
    ("updown-opposite", Move::Along([0.0, -1.0, 0.0])),
    ("xy", Move::Along([1.0, 0.0, 1.0])),
    ("xy-opposite", Move::Along([-1.0, 0.0, -1.0])),
    ("yz", Move::Along([0.0, 1.0, 1.0])),
    ("yz-opposite", Move::Along([0.0, -1.0, -1.0])),
    ("xz", Move::Along([1.0, 1.0, 0.0])),
    ("xz-opposite", Move::Along([-1.0, -1.0, 0.0])),
    ("xyz", Move::Along([1.0, 1.0, 1.0])),
    ("xyz-opposite", Move::Along([-1.0, -1.0, -1.0])),
    ("rotation-ccw", Move::About(0.0, CounterClockwise)),
    ("rotation-cw", Move::About(0.0, Clockwise)),
];

const TEST: [(&str, Move); 15] = [
    ("test-x-minus-z", Move::Along([1.0, 0.0, -1.0])),
    ("test-x-minus-z-opposite", Move::Along([-1.0, 0.0, 1.0])),
    ("test-y-minus-z", Move::Along([0.0, 1.0, -1.0])),
    ("test-y-minus-z-opposite", Move::Along([0.0, -1.0, 1.0])),
    ("test-x-minus-y", Move::Along([1.0, -1.0, 0.0])),
    ("test-xy-minus-z", Move::Along([1.0, 1.0, -1.0])),
    ("test-xy-minus-z-opposite", Move::Along([-1.0, -1.0, 1.0])),
    ("test-xz-minus-y", Move::Along([1.0, -1.0, 1.0])),
    ("test-xz-minus-y-opposite", Move::Along([-1.0, 1.0, -1.0])),
    ("test-yz-minus-x", Move::Along([-1.0, 1.0, 1.0])),
    ("test-yz-minus-x-opposite", Move::Along([1.0, -1.0, -1.0])),
    (
        "test-rotation-first-ccw",
        Move::About(-1.0, CounterClockwise),
    ),
    ("test-rotation-first-cw", Move::About(-1.0, Clockwise)),
    ("test-rotation-last-ccw", Move::About(1.0, CounterClockwise)),
    ("test-rotation-last-cw", Move::About(1.0, Clockwise)),
];

type Recipe = fn() -> Motion;

const GENERALISATION: [(&str, Recipe); 12] = [
    ("bouncy", bouncy),
    ("rotate-bounce", rotate_bounce),
    ("spiral", spiral),
    ("snake", snake),
    ("upward-spiral", upward_spiral),
    ("speed-0.015", || forward_to(0.015)),
    ("speed-0.02", || forward_to(0.02)),
    ("speed-0.02617", || forward_to(TRAINED_SPEED)),
    ("speed-0.03", || forward_to(0.03)),
    ("speed-0.04", || forward_to(0.04)),
    ("speed-0.05", || forward_to(0.05)),
    ("apart", apart),
];

/// Peak speed of a training motion as the paper rounds it `[m/frame]`: π/2/60 = 0.026180.
const TRAINED_SPEED: f64 = 0.02617;

/// The name of no motion at all, for ten seconds.
const STILL: &str = "still";

/// Every name that [`by_name`] knows, in the order still, training, test, generalisation.
#[must_use]
pub fn names() -> Vec<&'static str> {
    [vec![STILL], training(), test(), generalisation()].concat()
}

/// The 16 motions of the training set. Each lasts 1260 frames of 1/60 s: 60 still, ten moves of 60
/// frames and 1 m there and back in turn, 600 still. An `-opposite` starts the other way.
#[must_use]
pub fn training() -> Vec<&'static str> {
    TRAINING.map(|(name, _)| name).to_vec()
}

/// The 15 motions of the test set, timed as the training motions.
#[must_use]
pub fn test() -> Vec<&'static str> {
    TEST.map(|(name, _)| name).to_vec()
}

/// Those of the test set of which the training set has no likeness either. Seen from the handles,
/// the image of a training motion in a mirror is the motion with the other x; of five that is a
/// test motion.
#[must_use]
pub fn unseen() -> Vec<&'static str> {
    let is_image = |[x, y, z]: [f64; 3]| {
        let mut seen = TRAINING.iter();
        seen.any(|(_, what)| matches!(what, Move::Along(way) if *way == [-x, y, z]))
    };
    let is_new = |(_, what): &&(&str, Move)| !matches!(what, Move::Along(way) if is_image(*way));
    TEST.iter().filter(is_new).map(|(name, _)| *name).collect()
}

/// Motions unlike the training motions; each starts with 30 frames still and ends with 180.
#[must_use]
pub fn generalisation() -> Vec<&'static str> {
    GENERALISATION.map(|(name, _)| name).to_vec()
}

/// Fastest that a motion with a name can be asked for, in parts of its speed.
const MOST_SPEED: f64 = 100.0;

/// The motion of that name: one of [`names`], or `random-` and a number (0 to 4294967295). With `@`
/// and a factor after it (`side@1.5`) it goes so many times as far in the same time
/// ([`Motion::at_speed`]).
#[must_use]
pub fn by_name(name: &str) -> Option<Motion> {
    let Some((name, factor)) = name.split_once('@') else {
        return at_own_speed(name);
    };
    let factor: f64 = factor.parse().ok()?;
    let is_sensible = factor > 0.0 && factor <= MOST_SPEED;
    at_own_speed(name).filter(|_| is_sensible)?.at_speed(factor)
}

fn at_own_speed(name: &str) -> Option<Motion> {
    if name == STILL {
        return Some(Motion::still(10.0));
    }
    if let Some(number) = name.strip_prefix("random-") {
        let parsed: u32 = number.parse().ok()?;
        return (parsed.to_string() == number).then(|| super::random::motion(parsed));
    }
    let mut moves = TRAINING.iter().chain(&TEST);
    if let Some((_, what)) = moves.find(|entry| entry.0 == name) {
        return Some(there_and_back(*what));
    }
    let (_, make) = GENERALISATION.iter().find(|entry| entry.0 == name)?;
    Some(make())
}

fn there_and_back(what: Move) -> Motion {
    let mut blocks = vec![Block::still(1.0)];
    for turn in 0..10 {
        let distance = if turn % 2 == 0 { 1.0 } else { -1.0 };
        let pace = Pace::Distance { distance };
        blocks.push(match what {
            Move::Along(direction) => block(1.0, vec![along(direction, pace)], None),
            Move::About(center, sense) => block(1.0, vec![], Some(about(center, sense, pace))),
        });
    }
    blocks.push(Block::still(10.0));
    Motion::Blocks { blocks }
}

fn bouncy() -> Motion {
    let forward = |pace| along([1.0, 0.0, 0.0], pace);
    let paces = ramped(5, 0.01);
    framed(paces.map(|pace| block(1.0, vec![forward(pace), bounce()], None)))
}

fn rotate_bounce() -> Motion {
    let turn = |pace| Some(about(2.0, CounterClockwise, pace));
    framed(ramped(4, 0.02).map(|pace| block(1.0, vec![bounce()], turn(pace))))
}

fn spiral() -> Motion {
    let blocks = ramped(21, TRAINED_SPEED).enumerate().map(|(step, pace)| {
        let center = (20 - step as i32) as f64 / 10.0;
        block(0.5, vec![], Some(about(center, CounterClockwise, pace)))
    });
    framed(blocks)
}

/// Turns of 135°, 270° and 135°. Three seconds up to 0.02617 m/frame, or down from it, are
/// 2.355 m, which is 135° at 1 m but for the sampling of the speeds (half a sample more or less).
fn snake() -> Motion {
    let turns = [
        (1.0, CounterClockwise, smooth(0.0, TRAINED_SPEED)),
        (-1.0, Clockwise, steady(TRAINED_SPEED)),
        (1.0, CounterClockwise, smooth(TRAINED_SPEED, 0.0)),
    ];
    let blocks = turns.map(|(center, sense, arc)| {
        let rotation = about(center, sense, arc);
        block(3.0, vec![], Some(rotation))
    });
    framed(blocks.into_iter())
}

fn upward_spiral() -> Motion {
    let part = |duration, pace: fn(f64) -> Pace| {
        let rise = along([0.0, 1.0, 0.0], pace(0.0175));
        let turn = about(1.0, CounterClockwise, pace(TRAINED_SPEED));
        block(duration, vec![rise], Some(turn))
    };
    let parts = [
        part(1.0, |speed| smooth(0.0, speed)),
        part(6.0, steady),
        part(1.0, |speed| smooth(speed, 0.0)),
    ];
    framed(parts.into_iter())
}

fn forward_to(speed: f64) -> Motion {
    let forward = along([1.0, 0.0, 0.0], smooth(0.0, speed));
    framed(std::iter::once(block(4.0, vec![forward], None)))
}

/// The handles of a line 1 m long come together to 0.6 m and part again to 1 m, twice, the last
/// one swinging forward before the first. Inward is +z for the first and -z for the last, wherever
/// they stand; one handle alone is an error when the motion is bound, a third stays where it is.
fn apart() -> Motion {
    super::apart::along_line(&[DVec3::ZERO, DVec3::Z], DVec3::Z, DVec3::X)
}

/// Half a second still, the blocks, three seconds still.
fn framed(blocks: impl Iterator<Item = Block>) -> Motion {
    let before = std::iter::once(Block::still(0.5));
    let after = std::iter::once(Block::still(3.0));
    Motion::Blocks {
        blocks: before.chain(blocks).chain(after).collect(),
    }
}

/// The paces of `count` blocks: eased in, steady, eased out.
fn ramped(count: usize, speed: f64) -> impl Iterator<Item = Pace> {
    (0..count).map(move |number| match number {
        0 => smooth(0.0, speed),
        n if n + 1 == count => smooth(speed, 0.0),
        _ => steady(speed),
    })
}

fn block(duration: f64, translations: Vec<Translation>, rotation: Option<Rotation>) -> Block {
    Block {
        duration,
        translations,
        rotation,
    }
}

fn along(direction: [f64; 3], pace: Pace) -> Translation {
    Translation {
        direction: DVec3::from_array(direction),
        pace,
    }
}

fn about(center: f64, sense: TurnSense, arc: Pace) -> Rotation {
    Rotation { center, sense, arc }
}

/// Up and down again: the speed falls from 0.02 m/frame through zero to -0.02.
fn bounce() -> Translation {
    let pace = Pace::Speed {
        start: 0.02,
        end: -0.02,
        profile: Profile::Linear,
    };
    along([0.0, 1.0, 0.0], pace)
}

fn steady(speed: f64) -> Pace {
    smooth(speed, speed)
}

fn smooth(start: f64, end: f64) -> Pace {
    Pace::Speed {
        start,
        end,
        profile: Profile::Smooth,
    }
}
