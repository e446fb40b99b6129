//! Watches on the strain of edges within a substep. If one strains too much, the frame is computed
//! again with more substeps, or a prediction is dropped.

use glam::DVec3;
use selvedge_cloth::{AdaptiveSubsteps as Settings, Handles, Mesh, VertexId};

/// The watch of adaptive substeps.
pub(crate) struct StrainWatch {
    settings: Settings,
    edges: WatchedEdges,
}

/// The watched edges of a cloth: all except those between two handles.
pub(crate) struct WatchedEdges(Vec<WatchedEdge>);

struct WatchedEdge {
    vertices: [VertexId; 2],
    /// 1/l₀ `[1/m]`.
    inverse_rest: f64,
}

/// An edge that strained too much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overstrained {
    /// Ends of the edge.
    pub(crate) vertices: [VertexId; 2],
    /// Change of its stretch l/l₀.
    pub(crate) change: f64,
}

impl StrainWatch {
    /// The watch on the cloth of `mesh`.
    pub(crate) fn new(settings: Settings, mesh: &Mesh, handles: &Handles) -> Self {
        Self {
            settings,
            edges: WatchedEdges::new(mesh, handles),
        }
    }

    /// Largest number of substeps of a frame.
    pub(crate) fn max_substeps(&self) -> u32 {
        self.settings.max_substeps
    }

    /// Largest change of an edge's stretch that passes.
    pub(crate) fn max_change(&self) -> f64 {
        self.settings.max_change
    }

    /// Checks the edges between `before` and `after` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// As for [`WatchedEdges::check`], with the bound of the settings.
    pub(crate) fn check(&self, before: &[DVec3], after: &[DVec3]) -> Result<(), Overstrained> {
        self.edges.check(before, after, self.settings.max_change)
    }
}

impl WatchedEdge {
    /// Returns true only if |l - l'|/l₀ ≤ `bound`, found without a root: (l² - l'²)² is
    /// (l - l')² (l + l')², and (l + l')² ≥ l² + l'².
    #[inline]
    fn is_surely_within(&self, bound: f64, before: &[DVec3], after: &[DVec3]) -> bool {
        let [a, b] = self.vertices.map(|v| v.index());
        let from = before[a].distance_squared(before[b]);
        let to = after[a].distance_squared(after[b]);
        let difference = (to - from) * self.inverse_rest;
        difference * difference <= bound * bound * (from + to)
    }
}

impl WatchedEdges {
    /// The edges of `mesh` that `handles` do not hold at both ends.
    pub(crate) fn new(mesh: &Mesh, handles: &Handles) -> Self {
        let held = handles.mask(mesh.topology().vertex_count());
        let edges = mesh
            .topology()
            .edges()
            .iter()
            .zip(mesh.pattern().edge_lengths());
        let watched = edges.filter(|(edge, _)| !edge.vertices.iter().all(|v| held[v.index()]));
        let watched = watched.map(|(edge, length)| WatchedEdge {
            vertices: edge.vertices,
            inverse_rest: length.recip(),
        });
        Self(watched.collect())
    }

    /// Checks the edges between `before` and `after` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// The edge whose stretch changed most, if |l - l'|/l₀ > `bound`. `[eq:substep-strain]`
    pub(crate) fn check(
        &self,
        before: &[DVec3],
        after: &[DVec3],
        bound: f64,
    ) -> Result<(), Overstrained> {
        let length = |[a, b]: [VertexId; 2], of: &[DVec3]| of[a.index()].distance(of[b.index()]);
        let mut worst = None;
        let mut most = bound;
        for edge in &self.0 {
            if edge.is_surely_within(most, before, after) {
                continue;
            }
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
