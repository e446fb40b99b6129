//! Edges that strain by more than cloth is measured for.

use glam::Vec3;
use selvedge_cloth::{Scene, VertexId};

/// Strain of an edge from which a run is warned of: half as much again as fabrics reach in fast motion.
const WARNED_STRAIN: f64 = 0.5;

/// Looks at the edges in every frame, but at those that handles hold at both ends, and at those that
/// are no longer than at the start.
#[derive(Clone, Debug)]
pub(crate) struct StrainWatch {
    edges: Vec<Edge>,
    frames: usize,
    /// Frames in which an edge was beyond the strain.
    beyond: usize,
    /// Strain, frame and ends of the worst.
    worst: Option<(f64, usize, [usize; 2])>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [usize; 2],
    /// Length from which it is warned of, and in the material `[m]`.
    most: f64,
    rest: f64,
}

fn length(frame: &[Vec3], [a, b]: [usize; 2]) -> f64 {
    f64::from(frame[a].distance(frame[b]))
}

impl StrainWatch {
    pub(crate) fn new(scene: &Scene) -> Self {
        let mesh = &scene.mesh;
        let held = scene.handles.mask(mesh.positions().len());
        let lengths = mesh.pattern().edge_lengths();
        let edges = mesh.topology().edges().iter().zip(lengths);
        let edges = edges.map(|(edge, rest)| Edge {
            ends: edge.vertices.map(VertexId::index),
            most: (1.0 + WARNED_STRAIN) * rest,
            rest,
        });
        Self {
            edges: edges
                .filter(|edge| edge.ends.iter().any(|v| !held[*v]))
                .collect(),
            frames: 0,
            beyond: 0,
            worst: None,
        }
    }

    /// The positions at the start `[m]`, `[vertices]`.
    pub(crate) fn begin(&mut self, start: &[Vec3]) {
        for edge in &mut self.edges {
            edge.most = edge.most.max(length(start, edge.ends));
        }
    }

    /// The positions of the next frame `[m]`, `[vertices]`.
    pub(crate) fn see(&mut self, now: &[Vec3]) {
        self.frames += 1;
        let mut is_beyond = false;
        for Edge { ends, most, rest } in &self.edges {
            let length = length(now, *ends);
            if length > *most {
                is_beyond = true;
                let strain = length / rest - 1.0;
                if self.worst.is_none_or(|(worst, ..)| strain > worst) {
                    self.worst = Some((strain, self.frames, *ends));
                }
            }
        }
        self.beyond += usize::from(is_beyond);
    }

    /// What to say of the frames so far; nothing where no edge was strained so much.
    pub(crate) fn warning(&self, scene: &Scene) -> Option<String> {
        let (most, frame, [a, b]) = self.worst?;
        let (percent, bound) = (100.0 * most, scene.physics.max_strain);
        Some(format!(
            "in {} frames edges are strained by more than {:.0} %, the edge from vertex {a} to {b} by {percent:.0} % in frame {frame} after the start: fabrics are not measured so far, and tear; use less wind, slower handles or handles closer together, teleport the cloth where its handles are set elsewhere at once, or lower physics.max_strain ({bound} now) to stop there",
            self.beyond,
            100.0 * WARNED_STRAIN
        ))
    }
}
