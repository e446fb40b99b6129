//! Schedules of the way back from the gradient of normalised features and of predicted positions to
//! that of the positions before.
//!
//! Gradients of positions lie in a ring like the positions themselves.

use crate::cloths::features::FeatureSources;
use crate::cloths::losses::LossArrays;
use crate::kernels::features_backward::{
    HINGES_BACKWARD, INTEGRATION_BACKWARD, JOIN_PREDICTION, POSITIONS_BACKWARD,
};
use crate::network::InputArrays;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, args};

/// A frame on the way back.
#[derive(Clone, Copy, Debug)]
pub struct FrameBack<'a> {
    /// The sources of its features.
    pub from: FeatureSources<'a>,
    /// Edges and hinges.
    pub losses: &'a LossArrays,
    /// The gradient of the positions, a ring like theirs, `[slots, vertices, 3]`; added to.
    pub by_position: Region,
    /// The slot of the newest frame.
    pub newest: usize,
}

/// One step of the window on the way back.
struct Step<'a> {
    /// The gradient of the features of the whole window.
    to_input: &'a InputArrays,
    /// The number of the step.
    number: usize,
    /// The gradient of the features of arcs in this step.
    arcs: Region,
    /// Room for the gradient of hinges by corner, `[edges, 12]`.
    by_hinge: Region,
}

impl FrameBack<'_> {
    /// The gradient of the frame `after` frames after the newest; before it for negative numbers.
    fn slot(&self, after: isize) -> Region {
        let slots = self.from.frames.slots;
        let slot = (self.newest as isize + after).rem_euclid(slots as isize) as usize;
        part(self.by_position, slot, slots)
    }

    /// Adds the joining of the frame's own gradient of its prediction with that of later frames.
    pub fn join(&self, schedule: &mut Schedule, gradient: Region) {
        let cloths = self.from.cloths;
        let arguments = args! {
            gradient,
            handle_of: cloths.handle_of,
            cloth_of: cloths.cloth_of,
            numbers: self.from.frames.numbers,
            spread: self.from.normalizers.acceleration.scale,
            by_next: self.slot(1),
        };
        schedule.launch(&JOIN_PREDICTION, cloths.sizes.vertices, arguments);
    }

    /// Adds the way from the gradients of features and of the predicted positions to those of the
    /// positions before.
    pub fn to_positions(&self, plan: &mut Plan, schedule: &mut Schedule, to_input: &InputArrays) {
        let mark = plan.mark();
        let by_hinge = plan.doubles("gradient of angles by corner", 12 * self.losses.edges());
        let steps = to_input.steps;
        for number in 0..steps {
            let step = Step {
                to_input,
                number,
                arcs: part(to_input.arcs, number, steps),
                by_hinge,
            };
            self.hinges(schedule, &step);
            self.positions(schedule, &step);
        }
        plan.release(mark);
        let cloths = self.from.cloths;
        let arguments = args! {
            by_next: self.slot(1),
            current: self.slot(0),
            previous: self.slot(-1),
        };
        schedule.launch(&INTEGRATION_BACKWARD, cloths.sizes.vertices, arguments);
    }

    /// The gradients of the hinges in one step.
    fn hinges(&self, schedule: &mut Schedule, step: &Step<'_>) {
        let losses = self.losses;
        let arguments = args! {
            ..self.from.frames.ring(),
            back: step.back(),
            hinges: losses.hinges,
            edge_arcs: losses.edge_arcs,
            rows: step.arcs,
            scale: self.from.normalizers.arcs.scale,
            by_hinge: step.by_hinge,
        };
        schedule.launch(&HINGES_BACKWARD, losses.edges(), arguments);
    }

    /// The gradients of the positions from all features in one step.
    fn positions(&self, schedule: &mut Schedule, step: &Step<'_>) {
        let (cloths, losses) = (self.from.cloths, self.losses);
        let (graph, normalizers) = (&cloths.graph, self.from.normalizers);
        let steps = step.to_input.steps;
        let arguments = args! {
            ..self.from.frame(),
            ..cloths.forces(),
            back: step.back(),
            nodes: part(step.to_input.nodes, step.number, steps),
            node_scale: normalizers.nodes.scale,
            edges: step.arcs,
            edge_scale: normalizers.arcs.scale,
            first_arc: graph.first_arc,
            senders: graph.senders,
            reverse_arcs: graph.reverse_arcs,
            corner_ends: losses.corner_ends,
            hinge_corners: losses.corners,
            by_hinge: step.by_hinge,
            gradient: self.by_position,
        };
        schedule.launch(&POSITIONS_BACKWARD, cloths.sizes.vertices, arguments);
    }
}

impl Step<'_> {
    /// Frames from this step to the newest.
    fn back(&self) -> usize {
        self.to_input.steps - 1 - self.number
    }
}

/// Part `number` of an array of `count` parts of one size.
fn part(all: Region, number: usize, count: usize) -> Region {
    let size = all.count() / count;
    all.part(number * size..(number + 1) * size)
}
