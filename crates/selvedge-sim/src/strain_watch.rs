//! Watches on the strain of edges: on its change within a substep, and on what a frame ends with.
//! If one strains too much, the frame is computed again with more substeps, or a prediction is
//! dropped.

use glam::DVec3;
use selvedge_cloth::{Handles, Mesh, PhysicsSettings, Substepping, VertexId};

/// The watch on a simulator's frames.
pub(crate) struct StrainWatch {
    /// Largest change of a stretch in a substep; none with fixed substeps.
    max_change: Option<f64>,
    /// Largest strain at the end of a frame.
    max_strain: f64,
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

/// An edge that is strained beyond what cloth can.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overstretched {
    /// Ends of the edge.
    pub(crate) vertices: [VertexId; 2],
    /// Its strain l/l₀ - 1.
    pub(crate) strain: f64,
}

impl StrainWatch {
    /// The watch on the cloth of `mesh`.
    pub(crate) fn new(settings: &PhysicsSettings, mesh: &Mesh, handles: &Handles) -> Self {
        Self {
            max_change: match settings.substepping {
                Substepping::Fixed => None,
                Substepping::Adaptive(adaptive) => Some(adaptive.max_change),
            },
            max_strain: settings.max_strain,
            edges: WatchedEdges::new(mesh, handles),
        }
    }

    /// Largest change of an edge's stretch in a substep that passes; none with fixed substeps.
    pub(crate) fn max_change(&self) -> Option<f64> {
        self.max_change
    }

    /// Returns true if substeps are checked.
    pub(crate) fn is_of_substeps(&self) -> bool {
        self.max_change.is_some()
    }

    /// Checks the edges between `before` and `after` a substep `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// As for [`WatchedEdges::check`], with the bound of the settings; none with fixed substeps.
    pub(crate) fn check(&self, before: &[DVec3], after: &[DVec3]) -> Result<(), Overstrained> {
        self.max_change
            .map_or(Ok(()), |bound| self.edges.check(before, after, bound))
    }

    /// Checks the edges at the end of a frame, `after`, which began at `before` `[m]`,
    /// `[vertices]`.
    ///
    /// # Errors
    /// As for [`WatchedEdges::check_stretch`], with the bound of the settings.
    pub(crate) fn check_frame(
        &self,
        before: &[DVec3],
        after: &[DVec3],
    ) -> Result<(), Overstretched> {
        self.edges.check_stretch(before, after, self.max_strain)
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
    /// Checks the lengths of the edges `after` a frame that began at `before` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// The edge with the largest strain of those that are longer than before, if
    /// l/l₀ - 1 > `bound`.
    fn check_stretch(
        &self,
        before: &[DVec3],
        after: &[DVec3],
        bound: f64,
    ) -> Result<(), Overstretched> {
        let square =
            |[a, b]: [VertexId; 2], of: &[DVec3]| of[a.index()].distance_squared(of[b.index()]);
        let mut most = (1.0 + bound).powi(2);
        let mut worst = None;
        for edge in &self.0 {
            let now = square(edge.vertices, after);
            let stretch = now * edge.inverse_rest * edge.inverse_rest;
            if stretch > most && now > square(edge.vertices, before) {
                most = stretch;
                worst = Some(edge.vertices);
            }
        }
        let strain = most.sqrt() - 1.0;
        worst.map_or(Ok(()), |vertices| Err(Overstretched { vertices, strain }))
    }
}
