//! Watches how much edges strain within a substep, so that a frame can be computed again with more
//! of them.

use glam::DVec3;
use selvedge_cloth::{AdaptiveSubsteps as Settings, Handles, Mesh, VertexId};

/// The edges of a cloth that are watched: all but those between two handles.
pub(crate) struct StrainWatch {
    settings: Settings,
    edges: Vec<WatchedEdge>,
}

struct WatchedEdge {
    vertices: [VertexId; 2],
    /// 1/l₀ `[1/m]`.
    inverse_rest: f64,
}

/// An edge that strained too much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overstrained {
    /// Its ends.
    pub(crate) vertices: [VertexId; 2],
    /// Change of its stretch l/l₀.
    pub(crate) change: f64,
}

impl StrainWatch {
    /// Of the cloth of `mesh`.
    pub(crate) fn new(settings: Settings, mesh: &Mesh, handles: &Handles) -> Self {
        let held = handles.mask(mesh.topology().vertex_count());
        let uv = mesh.material_coordinates();
        let edges = mesh.topology().edges().iter();
        let watched = edges.filter(|edge| !edge.vertices.iter().all(|v| held[v.index()]));
        Self {
            settings,
            edges: watched
                .map(|edge| {
                    let [a, b] = edge.vertices.map(|v| uv[v.index()]);
                    WatchedEdge {
                        vertices: edge.vertices,
                        inverse_rest: a.distance(b).recip(),
                    }
                })
                .collect(),
        }
    }

    /// Most substeps of a frame.
    pub(crate) fn max_substeps(&self) -> u32 {
        self.settings.max_substeps
    }

    /// Largest change of an edge's stretch that is let pass.
    pub(crate) fn max_change(&self) -> f64 {
        self.settings.max_change
    }

    /// The edge whose stretch changed most from `before` to `after` `[m]`, `[vertices]`, if by more
    /// than is let pass: |l - l'|/l₀ > bound. `[eq:substep-strain]`
    pub(crate) fn check(&self, before: &[DVec3], after: &[DVec3]) -> Result<(), Overstrained> {
        let length = |[a, b]: [VertexId; 2], of: &[DVec3]| of[a.index()].distance(of[b.index()]);
        let mut worst = None;
        let mut most = self.settings.max_change;
        for edge in &self.edges {
            let [from, to] = [before, after].map(|of| length(edge.vertices, of));
            let change = (to - from).abs() * edge.inverse_rest;
            if change > most {
                most = change;
                worst = Some(edge.vertices);
            }
        }
        match worst {
            None => Ok(()),
            Some(vertices) => Err(Overstrained {
                vertices,
                change: most,
            }),
        }
    }
}
