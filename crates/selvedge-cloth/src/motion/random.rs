//! Motions drawn at random: moves in every direction and turns about every place on the handles'
//! line, none faster than the motions of the training set. The same number gives the same motion
//! on every machine.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::pace::Pace;
use super::written::{Block, Motion, Rotation, Translation, TurnSense};
use crate::geometry::{sin_cos, unit};

/// Moves between the still start and the still end.
const MOVES: usize = 8;
/// Shortest and longest move, in frames of 1/60 s.
const FRAMES: Range<f64> = 30.0..90.0;
/// Slowest and fastest move: its mean speed `[m/s]`. 1 m/s peaks at π/2 m/s, as in training.
const SPEEDS: Range<f64> = 0.2..1.0;

/// One of endlessly many motions, for tests: none of them is a motion that has a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomMotion {
    /// Seed of a family of motions.
    pub seed: u64,
    /// Number of the motion in the family.
    pub number: u64,
    /// Shortest duration `[s]`.
    pub duration: f64,
    /// Peak speed, in parts of that of the training motions.
    pub speed: f64,
}

impl RandomMotion {
    /// Half a second still, then moves as in the random motions that have a name, at `speed` times
    /// their speed, until the duration is over.
    pub fn motion(&self) -> Motion {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // The named ones are stream 0 of their seeds.
        rng.set_stream(self.number.wrapping_add(1));
        let mut blocks = vec![Block::still(0.5)];
        let mut lasted = 0.5;
        while lasted < self.duration {
            let block = one_move(&mut rng, self.speed);
            lasted += block.duration;
            blocks.push(block);
        }
        Motion::Blocks { blocks }
    }
}

/// Motion number `seed`: half a second still, eight moves of 0.5 to 1.5 s (half of them along a
/// direction, uniform on the sphere, a quarter turns about a centre between the outer handles, a
/// quarter both at half the speed), two seconds still; about 10.5 s.
pub(super) fn motion(seed: u32) -> Motion {
    let mut rng = ChaCha8Rng::seed_from_u64(u64::from(seed));
    let mut blocks = vec![Block::still(0.5)];
    blocks.extend((0..MOVES).map(|_| one_move(&mut rng, 1.0)));
    blocks.push(Block::still(2.0));
    Motion::Blocks { blocks }
}

/// A move at `speed` times the trained speed.
fn one_move(rng: &mut ChaCha8Rng, speed: f64) -> Block {
    let duration = between(rng, FRAMES).round() / 60.0;
    let distance = speed * duration * between(rng, SPEEDS);
    let kind = rng.next_u32() % 4;
    let share = if kind == 3 { 0.5 } else { 1.0 };
    let pace = Pace::Distance {
        distance: share * distance,
    };
    Block {
        duration,
        translations: match kind {
            2 => Vec::new(),
            _ => vec![Translation {
                direction: direction(rng),
                pace,
            }],
        },
        rotation: (kind >= 2).then(|| Rotation {
            center: between(rng, -1.0..1.0),
            sense: match rng.next_u32() % 2 {
                0 => TurnSense::Clockwise,
                _ => TurnSense::CounterClockwise,
            },
            arc: pace,
        }),
    }
}

/// Uniform on the unit sphere: its height is uniform (Archimedes).
fn direction(rng: &mut ChaCha8Rng) -> DVec3 {
    let height = between(rng, -1.0..1.0);
    let angle = between(rng, 0.0..TAU);
    let radius = (1.0 - height * height).sqrt();
    let (sine, cosine) = sin_cos(angle);
    DVec3::new(radius * cosine, height, radius * sine)
}

/// A number from `range`, uniform; the end is left out.
fn between(rng: &mut ChaCha8Rng, range: Range<f64>) -> f64 {
    range.start + (range.end - range.start) * unit(rng)
}
