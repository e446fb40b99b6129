//! Positions that the frames of a window are compared with, from which accelerations, expected
//! moves and rest offsets are measured. Each is computed only if the spec has the feature.

use glam::Vec3;

use crate::features::Pose;
use crate::features::frames::Frames;
use crate::graph::ClothGraph;
use crate::spec::integration::{LastFrames, ReferenceSlope, carried_rest};
use crate::spec::{ModelSpec, NodeFeature};

/// Buffers of the positions that one frame is compared with.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Compared {
    /// Reference of the previous frame, from which the past acceleration is measured,
    /// `[vertices]`.
    before: Vec<Vec3>,
    /// Reference of the current frame, from which uniform motion leads to the next frame,
    /// `[vertices]`.
    reference: Vec<Vec3>,
    /// The rest pose, carried along by the handles, `[vertices]`.
    rest: Vec<Vec3>,
    /// Current and next positions of the handles, `[handles]`.
    handles: [Vec<Vec3>; 2],
    /// Derivatives of `before` and `reference` with respect to the positions.
    slopes: [Option<ReferenceSlope>; 2],
}

impl Compared {
    /// Computes the positions that frame `current` is compared with.
    pub(super) fn compute<F: AsRef<[Vec3]>>(
        &mut self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        frames: &Frames<'_, F>,
        current: usize,
    ) {
        let has = |feature| spec.node_features.contains(&feature);
        let (integration, yaw) = (spec.integration, frames.yaw);
        let (previous, now) = (frames.at(current - 1), frames.at(current));
        let [handles, next] = &mut self.handles;
        handles.clear();
        handles.extend(graph.handles().of(now));
        self.slopes = [None, None];
        if has(NodeFeature::Acceleration) {
            let last = LastFrames {
                graph,
                previous: frames.at(current - 2),
                current: previous,
                next_handles: handles,
                yaw,
            };
            integration.reference(&last, &mut self.before);
            self.slopes[0] = Some(integration.reference_slope(&last));
        }
        if has(NodeFeature::ExpectedMove) {
            next.clear();
            match frames.positions.get(current + 1) {
                Some(positions) => next.extend(graph.handles().of(positions.as_ref())),
                None => next.extend_from_slice(frames.next_handles),
            }
            let last = LastFrames {
                graph,
                previous,
                current: now,
                next_handles: next,
                yaw,
            };
            integration.reference(&last, &mut self.reference);
            self.slopes[1] = Some(integration.reference_slope(&last));
        }
        if has(NodeFeature::RestOffset) {
            let yaw = graph.frame().yaw(handles, yaw);
            carried_rest(graph, handles, yaw, now, &mut self.rest);
        }
    }

    /// Frame `current` with what [`Self::compute`] left.
    pub(super) fn pose<'a, F: AsRef<[Vec3]>>(
        &'a self,
        frames: &'a Frames<'_, F>,
        current: usize,
    ) -> Pose<'a> {
        Pose {
            before: &self.before,
            previous: frames.at(current - 1),
            current: frames.at(current),
            reference: &self.reference,
            rest: &self.rest,
            yaw: frames.yaw,
        }
    }

    /// Passes the gradients of `before` and `reference` on to the frames up to the current one, the
    /// last of `to`.
    pub(super) fn backward(&self, gradients: [&[Vec3]; 2], to: &mut [Vec<Vec3>]) {
        for (steps_back, (slope, gradient)) in self.slopes.iter().zip(gradients).enumerate() {
            let Some(slope) = slope else { continue };
            // The frames of the acceleration are one frame older.
            let current = to.len() - 2 + steps_back;
            let (earlier, later) = to.split_at_mut(current);
            slope.backward(gradient, &mut earlier[current - 1], &mut later[0]);
        }
    }
}
