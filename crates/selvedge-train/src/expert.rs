//! Expert labels on the model's own states (`DAgger`, Ross et al. 2011): the frames that the physics
//! of the data set makes of a cloth that a rollout has led off the recorded motion.

use glam::{DVec3, Vec3};

/// The physics behind a data set.
pub trait Expert: Send + Sync {
    /// World positions after each of the next `frames` frames from `state` `[m]`, `[frames,
    /// vertices]`; none where the physics cannot go on from there.
    fn label(&self, state: ExpertState<'_>, frames: usize) -> Option<Vec<Vec<DVec3>>>;
}

/// A state to be labelled.
///
/// Two frames give the mean velocity between them. What the velocity has become at the end of the
/// second is estimated from the recorded motion, whose three frames about it are known.
#[derive(Clone, Copy, Debug)]
pub struct ExpertState<'a> {
    /// The number of the training trajectory.
    pub trajectory: usize,
    /// The number of its frame.
    pub frame: usize,
    /// World positions in the frame before and in this one `[m]`, `[vertices]`.
    pub positions: [&'a [Vec3]; 2],
    /// Recorded world positions two frames ago, in the frame before, in this one and one frame
    /// later `[m]`, `[vertices]`.
    pub recorded: [&'a [Vec3]; 4],
}
