//! Edges of a prediction, brought back to their lengths at the start of the substep:
//! position-based dynamics (Müller et al. 2007) of the lengths alone.
//!
//! Velocities that go on unchanged stretch what turns or is led at a corner, and cloth resists
//! that at once. A prediction without that stretch is nearer to the end of the substep, and the
//! error of a solve that is linearised there is quadratic in the distance. All edges of a pass see
//! the same positions, so that their order does not show; passes are accelerated (Wang 2015); edges that have their length ask for
//! nothing, so that a piece of cloth does not see how another one moves.

use glam::DVec3;
use selvedge_cloth::{Mesh, VertexId};

use crate::edges::{FreeEdge, free_edges};

mod backward;

/// Largest number of passes over the edges.
const MOST_PASSES: usize = 6;

/// Spectral radius of a pass of which the acceleration makes the most. With it six passes do what
/// sixteen do without.
const RADIUS: f64 = 0.9;

/// Change of an edge's stretch l/l₀ that is left as it is.
const BAND: f64 = 0.001;

/// Factor on the mean of the shifts that the edges of a vertex ask for.
const OVER_RELAXATION: f64 = 1.5;

/// The projection, with its workspaces. `[eq:projected-prediction]`
pub(crate) struct EdgeProjection {
    edges: Vec<FreeEdge>,
    /// Least and greatest squared lengths `[m²]`, `[edges]`.
    bands: Vec<[f64; 2]>,
    /// Sums of the shifts of a pass `[m]`, `[vertices]`.
    shifts: Vec<DVec3>,
    /// Factors from these sums to the shifts, `[vertices]`.
    factors: Vec<f64>,
    /// Positions before the last pass `[m]`, `[vertices]`.
    before: Vec<DVec3>,
}

impl EdgeProjection {
    /// The edges of `mesh`, in which `held` vertices do not move.
    pub(super) fn new(mesh: &Mesh, held: &[VertexId]) -> Self {
        let mut is_held = vec![false; mesh.topology().vertex_count()];
        for vertex in held {
            is_held[vertex.index()] = true;
        }
        let edges = free_edges(mesh, &is_held);
        let mut counts = vec![0_u32; is_held.len()];
        for vertex in edges.iter().flat_map(|edge| edge.ends) {
            counts[vertex] += 1;
        }
        let factor = |count: u32| OVER_RELAXATION / f64::from(count).max(OVER_RELAXATION);
        Self {
            bands: vec![[0.0; 2]; edges.len()],
            edges,
            shifts: vec![DVec3::ZERO; counts.len()],
            before: vec![DVec3::ZERO; counts.len()],
            factors: counts.into_iter().map(factor).collect(),
        }
    }

    /// Moves the `predicted` positions until edges are as long as at the `start`, but for their
    /// bands, or the passes are done; both `[m]`, `[vertices]`. Returns true if any moved.
    pub(super) fn project(&mut self, start: &[DVec3], predicted: &mut [DVec3]) -> bool {
        self.project_telling(start, predicted, |_, _, _| ())
    }

    /// As [`Self::project`]; `tell` hears of each pass: where it began, the sums of its shifts, and
    /// its weight.
    fn project_telling(
        &mut self,
        start: &[DVec3],
        predicted: &mut [DVec3],
        mut tell: impl FnMut(&[DVec3], &[DVec3], f64),
    ) -> bool {
        let _span = tracing::trace_span!("prediction").entered();
        for (limits, edge) in self.bands.iter_mut().zip(&self.edges) {
            let [a, b] = edge.ends;
            let length = start[a].distance(start[b]);
            let band = BAND * edge.length;
            *limits = [-1.0, 1.0].map(|side| (length + side * band).max(0.0).powi(2));
        }
        self.before.copy_from_slice(predicted);
        let mut weight = 1.0;
        for pass in 0..MOST_PASSES {
            if !self.pass(predicted, weight) {
                return pass > 0;
            }
            tell(&self.before, &self.shifts, weight);
            let first = if pass == 0 { 2.0 } else { 1.0 };
            weight = 4.0 / (4.0 - first * RADIUS * RADIUS * weight);
        }
        true
    }

    /// Moves vertices by the mean of what their edges ask for, `weight` times as far from where they
    /// were before the last pass; those that no edge asks stay. Returns true if an edge asked.
    fn pass(&mut self, predicted: &mut [DVec3], weight: f64) -> bool {
        let mut asked = false;
        for (edge, [least, greatest]) in self.edges.iter().zip(&self.bands) {
            let [a, b] = edge.ends;
            let way = predicted[b] - predicted[a];
            let squared = way.length_squared();
            let limit = squared.clamp(*least, *greatest);
            if limit == squared || squared == 0.0 {
                continue;
            }
            if !asked {
                self.shifts.fill(DVec3::ZERO);
                asked = true;
            }
            // 1 - √(limit/squared) to first order, without its root (Jakobsen 2001): the passes
            // end at the same lengths.
            let excess = way * ((squared - limit) / (squared + limit));
            self.shifts[a] += excess * edge.parts[0];
            self.shifts[b] -= excess * edge.parts[1];
        }
        if asked {
            let shifts = self.shifts.iter().zip(&self.factors);
            let places = predicted.iter_mut().zip(&mut self.before);
            for ((place, before), (shift, factor)) in places.zip(shifts) {
                let next = if *shift == DVec3::ZERO {
                    *place
                } else {
                    *before + (*place + *shift * *factor - *before) * weight
                };
                *before = std::mem::replace(place, next);
            }
        }
        asked
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2};

    use super::*;

    /// A square of side 1 m with four faces around vertex 4, tilted.
    fn fan() -> Mesh {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        let flat: Vec<_> = corners.into_iter().map(DVec2::from_array).collect();
        let tilt = DQuat::from_rotation_x(0.7);
        let places = flat.iter().map(|p| tilt * p.extend(0.0)).collect();
        let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        Mesh::new(&faces, flat, places).unwrap()
    }

    /// Largest difference of an edge of `mesh` between two places `[m]`.
    fn most(mesh: &Mesh, start: &[DVec3], now: &[DVec3]) -> f64 {
        let edges = mesh.topology().edges().iter();
        let edges = edges.map(|edge| edge.vertices.map(VertexId::index));
        let length = |[a, b]: [usize; 2], of: &[DVec3]| of[a].distance(of[b]);
        edges
            .map(|ends| (length(ends, now) - length(ends, start)).abs())
            .fold(0.0, f64::max)
    }

    /// A turn by ω goes on as x + γ ω × x, which stretches an edge across the axis by
    /// √(1 + γ²ω²). Brought back it nearly has its lengths, and its centre stays: what the ends of an edge
    /// ask for sums to 0, and a vertex shifts by the mean over its edges, so that their number is
    /// its weight.
    #[test]
    fn what_turns_keeps_its_lengths_and_its_centre() {
        let mesh = fan();
        let start = mesh.positions();
        let turn = DVec3::new(0.1, -0.3, 0.2);
        let mut predicted: Vec<_> = start.iter().map(|p| *p + turn.cross(*p)).collect();
        let raw = predicted.clone();
        let mut projection = EdgeProjection::new(&mesh, &[]);
        let raw_most = most(&mesh, start, &predicted);
        assert!(raw_most > 0.04);
        assert!(projection.project(start, &mut predicted));
        let left = most(&mesh, start, &predicted);
        assert!(left < 0.1 * raw_most, "{left} of {raw_most}");
        let weights = [3.0, 3.0, 3.0, 3.0, 4.0];
        let centre = |of: &[DVec3]| of.iter().zip(weights).map(|(p, w)| *p * w).sum::<DVec3>();
        assert!(centre(&predicted).distance(centre(&raw)) < 1e-12);
    }

    /// Held vertices stay where they are led, and the others follow; lengths that are right
    /// already are left alone.
    #[test]
    fn held_vertices_stay() {
        let mesh = fan();
        let start = mesh.positions();
        let held = [VertexId(0), VertexId(1)];
        let mut projection = EdgeProjection::new(&mesh, &held);
        let mut predicted = start.to_vec();
        predicted[4].z += 0.5 * BAND;
        let within = predicted.clone();
        assert!(!projection.project(start, &mut predicted));
        assert_eq!(predicted, within);
        let led = DVec3::new(0.0, 0.1, 0.1);
        for vertex in held {
            predicted[vertex.index()] += led;
        }
        let raw = most(&mesh, start, &predicted);
        assert!(projection.project(start, &mut predicted));
        for vertex in held {
            let place = start[vertex.index()] + led;
            assert_eq!(predicted[vertex.index()], place);
        }
        let left = most(&mesh, start, &predicted);
        assert!(left < 0.1 * raw, "{left} of {raw}");
    }
}
