//! Handle motion: blocks, keyframes, splines and recordings, bound to the handles' start positions
//! as a [`HandlePath`] that tells where every handle is at any time.
//!
//! Conventions: y is up; the handles' line is through the first and the last handle; rotations turn
//! handles about a vertical axis, a positive angle being counter-clockwise seen from above. Times
//! in seconds; speeds in metres per frame of 1/60 s, the unit of the paper's figures, whatever the
//! frame rate of the scene. The forms that people write (and their TOML) are here, what is computed
//! from them in one file per form; [`named`] holds the motions of the paper and of our tests.

mod apart;
mod blocks;
mod bounds;
mod keyframes;
pub mod named;
mod pace;
mod path;
mod random;
mod recorded;
mod splines;
mod written;

pub use self::apart::apart;
pub use self::pace::{Pace, Profile};
pub use self::path::HandlePath;
pub use self::random::RandomMotion;
pub use self::written::{
    Block, Keyframe, KeyframeGroup, KeyframeMotion, Motion, PoseKeyframe, RecordedMotion, Rotation,
    SplineGroup, SplineMotion, Translation, TurnSense,
};

#[cfg(test)]
mod tests;
