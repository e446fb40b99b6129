//! Differences of a motion over substeps, of which the error of a formula is made, and the scale of
//! a vertex by which they are divided `[eq:substep-differences]`.

use glam::{DVec3, Vec3};

use super::{CorrectionColumns, MotionState, Moves, PredictedFrame};
use crate::graph::ClothGraph;
use crate::spec::FrameTimes;

/// A vertex's own vectors over substeps.
pub(super) const SUBSTEP_VECTORS: usize = 8;
/// Part of the scale over the whole cloth below which that of a vertex is not taken.
const LEAST_SCALE: f32 = 0.1;
/// Scale of a cloth at rest `[m]`.
const AT_REST: f32 = 1e-8;

/// The substeps of a predicted frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameSubsteps<'a> {
    /// The state one substep before the start of the frame; none where its first substep starts
    /// anew.
    pub earlier: Option<MotionState<'a>>,
    /// The state one substep before its end.
    pub middle: MotionState<'a>,
    /// Length of a substep over that of the frame.
    pub part: f64,
    /// The [`rough_fields`] through the matrix of the last solve `[m]`, `[vertices]` each.
    pub smoothed: &'a [Vec<DVec3>; 2],
    /// Part of the substeps that fell back to a formula of first order.
    pub fell_back: f32,
}

/// Fields of a frame that are to be smoothed `[m]`, `[vertices]` each, of its states at the start,
/// one substep before the end and at the end: the third difference of velocity, times the length of
/// the frame, and what the trapezoidal rule lacks in the last substep `[eq:smoothed-differences]`.
pub fn rough_fields(states: [MotionState<'_>; 3], times: FrameTimes, fields: &mut [Vec<DVec3>; 2]) {
    let [_, middle, end] = states;
    let [third, lack] = fields;
    third.clear();
    lack.clear();
    for v in 0..end.positions.len() {
        let [a, b, c] = states.map(|state| state.velocities[v]);
        third.push(times.frame * ((c - b) - (b - a)));
        lack.push(end.positions[v] - middle.positions[v] - (0.5 * times.substep) * (b + c));
    }
}

impl CorrectionColumns {
    /// Finds the vectors of a frame, and the scales by which they are divided
    /// `[eq:substep-differences]`.
    pub(super) fn find_differences(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>) {
        let substeps = frame.substeps;
        let (last, middle, next) = (frame.last, substeps.middle, frame.predicted);
        let h = self.dt;
        let change = |from: MotionState<'_>, to: MotionState<'_>, v: usize| {
            (h * (to.velocities[v] - from.velocities[v])).as_vec3()
        };
        let lack = |from: MotionState<'_>, to: MotionState<'_>, part: f64, v: usize| {
            let mean = 0.5 * part * h * (to.velocities[v] + from.velocities[v]);
            (to.positions[v] - from.positions[v] - mean).as_vec3()
        };
        for (v, moves) in self.moves.iter_mut().enumerate() {
            let (first, second) = (change(last, middle, v), change(middle, next, v));
            let before = substeps.earlier.map_or([Vec3::ZERO; 2], |earlier| {
                [
                    first - change(earlier, last, v),
                    lack(earlier, last, substeps.part, v),
                ]
            });
            *moves = Moves {
                velocity: (h * last.velocities[v]).as_vec3(),
                compared: [second, second - first],
                own: [
                    second,
                    second - first,
                    before[0],
                    lack(middle, next, substeps.part, v),
                    lack(last, middle, 1.0 - substeps.part, v),
                    before[1],
                    substeps.smoothed[0][v].as_vec3(),
                    substeps.smoothed[1][v].as_vec3(),
                ],
            };
        }
        find_scales(graph, &self.moves, frame.held, &mut self.scales);
        for (moves, scale) in self.moves.iter_mut().zip(&self.scales) {
            moves.own.iter_mut().for_each(|vector| *vector /= *scale);
        }
    }
}

/// Scales of the vertices `[m]`: root mean squares of the third differences of velocity of a vertex
/// and its neighbours, and no less than a part of that over all that are not `held`.
fn find_scales(graph: &ClothGraph, moves: &[Moves], held: &[bool], scales: &mut Vec<f32>) {
    let roughness = |moves: &Moves| moves.own[1].length_squared() + moves.own[2].length_squared();
    scales.clear();
    scales.extend(moves.iter().map(roughness));
    for edge in graph.topology().edges() {
        let [a, b] = edge.vertices.map(|v| v.index());
        scales[a] += roughness(&moves[b]);
        scales[b] += roughness(&moves[a]);
    }
    let first = graph.connectivity().first_arc();
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for (v, (scale, held)) in scales.iter_mut().zip(held).enumerate() {
        *scale /= (1 + first[v + 1] - first[v]) as f32;
        if !held {
            sum += f64::from(*scale);
            count += 1;
        }
    }
    let of_all = (sum / f64::from(count.max(1))).sqrt() as f32;
    let least = (LEAST_SCALE * of_all).max(AT_REST);
    for scale in scales {
        *scale = scale.sqrt().max(least);
    }
}

#[cfg(test)]
mod tests;
