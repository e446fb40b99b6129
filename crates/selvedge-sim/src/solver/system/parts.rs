//! Parts of a system that others read: its vertices, their masses, its handles and its gravity.

use glam::DVec3;
use selvedge_cloth::VertexId;

use super::System;
use crate::state::State;

impl System {
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub(crate) fn mass(&self) -> &[f64] {
        &self.elements.mass
    }

    /// Gravity of the solves that follow `[m/s²]`.
    pub(crate) fn gravity(&self) -> DVec3 {
        self.elements.gravity()
    }

    /// The vertices of the active handles, in the order of their targets.
    pub(crate) fn held(&self) -> &[VertexId] {
        self.handles.vertices()
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
