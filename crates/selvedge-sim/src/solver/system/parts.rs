//! Parts of a system that others read: its vertices, their masses and its handles.

use glam::DVec3;

use super::System;
use crate::state::State;

impl System {
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub(crate) fn mass(&self) -> &[f64] {
        &self.elements.mass
    }

    /// Vertices that are unknowns.
    pub(crate) fn unknown_vertices(&self) -> &[u32] {
        self.pattern.vertices()
    }

    /// Positions of the active handles `[m]`, `[handles]`.
    pub(crate) fn handle_positions(&self, state: &State) -> impl Iterator<Item = DVec3> {
        let vertices = self.handles.vertices().iter();
        vertices.map(|vertex| state.positions[vertex.index()])
    }
}
