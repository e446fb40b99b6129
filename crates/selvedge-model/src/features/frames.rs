//! The frames of positions that a window of features is made from.

use glam::Vec3;

use crate::graph::frame::Yaw;
use crate::spec::ModelSpec;

/// Positions that a window of one cloth is made from.
#[derive(Clone, Copy, Debug)]
pub struct Frames<'a, F> {
    /// Positions `[m]` in the frames before the window and in each frame of it, oldest first,
    /// `[history][vertices]` with [`ModelSpec::history`] frames.
    pub positions: &'a [F],
    /// Positions of the handles one frame after the newest `[m]`, `[handles]`.
    pub next_handles: &'a [Vec3],
    /// The local frame of the newest frame.
    pub yaw: Yaw,
}

impl<F: AsRef<[Vec3]>> Frames<'_, F> {
    /// Positions of frame `number`, oldest first.
    pub(crate) fn at(&self, number: usize) -> &[Vec3] {
        self.positions[number].as_ref()
    }

    /// The numbers of the last `count` frames.
    pub(super) fn last(&self, spec: &ModelSpec, count: usize) -> std::ops::Range<usize> {
        let history = self.positions.len();
        assert_eq!(history, spec.history(), "frames of a window");
        history - count..history
    }
}
