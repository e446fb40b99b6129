//! The state of a moving cloth: positions and velocities.

use glam::DVec3;

/// Positions `[m]` and velocities `[m/s]`, `[vertices]` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Positions `[m]`.
    pub(crate) positions: Vec<DVec3>,
    /// Velocities `[m/s]`.
    pub(crate) velocities: Vec<DVec3>,
}

impl State {
    /// Makes this a copy of `other`, of the same size.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.velocities.copy_from_slice(&other.velocities);
    }
}
