//! The frames of positions that a window of features is made from.

use glam::Vec3;

use crate::features::Pose;
use crate::graph::frame::Yaw;
use crate::spec::ModelSpec;

/// Positions that a window of one cloth is made from.
#[derive(Clone, Copy, Debug)]
pub struct Frames<'a, F> {
    /// Positions `[m]` in the frames before the window and in each frame of it, oldest first,
    /// `[history][vertices]` with [`ModelSpec::history`] frames.
    pub positions: &'a [F],
    /// The local frame of the newest frame.
    pub yaw: Yaw,
}

impl<F: AsRef<[Vec3]>> Frames<'_, F> {
    /// Frame `current` and the one before it, which features are made from.
    pub(super) fn pose(&self, current: usize) -> Pose<'_> {
        let at = |number: usize| self.positions[number].as_ref();
        Pose {
            previous: at(current - 1),
            current: at(current),
            yaw: self.yaw,
        }
    }

    /// The numbers of the frames of the window.
    pub(super) fn window(&self, spec: &ModelSpec) -> std::ops::Range<usize> {
        let history = self.positions.len();
        assert_eq!(history, spec.history(), "frames of a window");
        history - spec.window()..history
    }
}
