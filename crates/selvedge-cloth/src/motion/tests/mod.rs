//! Tests of handle motion, a file per subject, and what they share.

mod blocks;
mod keyframes;
mod named;
mod recorded;
mod splines;
mod written;

use glam::DVec3;

use super::{Block, HandlePath, Motion, Pace, Profile, Rotation, Translation, TurnSense};

/// The handles of the paper's sheet.
fn corners() -> Vec<DVec3> {
    vec![DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 0.5)]
}

/// A motion of one block along a direction.
fn along(duration: f64, direction: DVec3, pace: Pace) -> Motion {
    of_blocks(vec![translation_block(duration, direction, pace)])
}

fn of_blocks(blocks: Vec<Block>) -> Motion {
    Motion::Blocks { blocks }
}

/// The path of the paper's handles at 60 frames per second.
fn bound(motion: &Motion) -> HandlePath {
    motion.bind(&corners(), 60.0).unwrap()
}

/// What is said of a motion that cannot lead the paper's handles.
fn refused(motion: &Motion) -> String {
    motion.bind(&corners(), 60.0).unwrap_err().to_string()
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
