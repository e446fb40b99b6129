//! The way back from the gradient of normalised features and of predicted positions to that of the
//! positions before: the table of `kernels/features_backward.cu` and its schedules.
//!
//! Gradients of positions lie in a ring like the positions themselves. Its kernels use those of
//! `losses.cu`, which come before them in a program.

use crate::cloths::ClothArrays;
use crate::cloths::features::{FeatureSources, NormalizerArrays};
use crate::cloths::frames::FrameArrays;
use crate::cloths::losses::LossArrays;
use crate::kernels::{Access, Kernel, Parameter, Part, Shape, Width};
use crate::network::InputArrays;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Argument, Schedule};

use Access::{Count, Doubles, DoublesOrNothing, DoublesOut, In, InOrNothing, InOut, Indices};

const fn rows(name: &'static str, access: Access, width: usize) -> Parameter {
    Parameter::per_count(name, access, Width::Numbers(width))
}

/// The file and its kernels.
pub static PART: Part = Part {
    name: "features_backward.cu",
    text: include_str!("../kernels/features_backward.cu"),
    kernels: &[
        &HINGES_BACKWARD,
        &POSITIONS_BACKWARD,
        &JOIN_PREDICTION,
        &INTEGRATION_BACKWARD,
    ],
};

/// Bending angles.
pub static HINGES_BACKWARD: Kernel = Kernel {
    name: "hinges_backward",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", In),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::any("back", Count),
        rows("hinges", Indices, 4),
        rows("edge_arcs", Indices, 2),
        Parameter::any("rows", In),
        Parameter::fixed("scale", In, Width::EdgeColumns),
        rows("by_hinge", DoublesOut, 12),
    ],
};

/// All features of a frame, vertex by vertex.
pub static POSITIONS_BACKWARD: Kernel = Kernel {
    name: "positions_backward",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", In),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::any("back", Count),
        Parameter::any("step", Count),
        Parameter::any("steps", Count),
        Parameter::per_count("nodes", In, Width::NodeColumns),
        Parameter::fixed("node_scale", In, Width::NodeColumns),
        Parameter::any("edges", InOrNothing),
        Parameter::fixed("edge_scale", In, Width::EdgeColumns),
        rows("cloth_of", Indices, 1),
        Parameter::any("numbers", In),
        Parameter::any("carries", Doubles),
        Parameter::any("air", In),
        rows("mass", In, 1),
        Parameter::any("first_face", Indices),
        Parameter::any("faces", Indices),
        Parameter::any("corners", Indices),
        Parameter::any("areas", In),
        Parameter::any("first_arc", Indices),
        Parameter::any("senders", Indices),
        Parameter::any("twins", Indices),
        Parameter::any("arc_material", In),
        rows("corner_ends", Indices, 2),
        Parameter::any("hinge_corners", Indices),
        Parameter::any("by_hinge", DoublesOrNothing),
        Parameter::any("gradient", InOut),
    ],
};

/// A frame's own loss and what came of its prediction.
pub static JOIN_PREDICTION: Kernel = Kernel {
    name: "join_prediction",
    shape: Shape::Element,
    parameters: &[
        rows("gradient", InOut, 3),
        rows("handle_of", Indices, 1),
        rows("cloth_of", Indices, 1),
        Parameter::any("numbers", In),
        Parameter::fixed("spread", In, Width::Numbers(3)),
        rows("by_next", InOut, 3),
    ],
};

/// The integration.
pub static INTEGRATION_BACKWARD: Kernel = Kernel {
    name: "integration_backward",
    shape: Shape::Element,
    parameters: &[
        rows("by_next", In, 3),
        Parameter::any("carries", Doubles),
        rows("cloth_of", Indices, 1),
        rows("current", InOut, 3),
        rows("previous", InOut, 3),
    ],
};

/// A frame on the way back.
#[derive(Clone, Copy, Debug)]
pub struct FrameBack<'a> {
    /// What its features were made from.
    pub from: FeatureSources<'a>,
    /// Edges and hinges.
    pub losses: &'a LossArrays,
    /// The gradient of the positions, a ring like theirs, `[slots, vertices, 3]`; added to.
    pub by_position: Region,
    /// The slot of the newest frame.
    pub newest: usize,
}

impl FrameBack<'_> {
    /// The gradient of the frame so many after the newest; before it for negative numbers.
    fn slot(&self, after: isize) -> Region {
        let slots = self.from.frames.slots;
        let slot = (self.newest as isize + after).rem_euclid(slots as isize) as usize;
        let size = self.by_position.count() / slots;
        self.by_position.part(slot * size..(slot + 1) * size)
    }

    /// Adds the joining of the frame's own gradient of its prediction with that of later frames.
    pub fn join(&self, schedule: &mut Schedule, gradient: Region) {
        let (cloths, frames): (&ClothArrays, &FrameArrays) = (self.from.cloths, self.from.frames);
        let [_, spread] = self.from.normalizers.acceleration;
        let arguments = [
            gradient,
            cloths.handle_of,
            cloths.cloth_of,
            frames.numbers,
            spread,
            self.slot(1),
        ];
        let arguments = arguments.map(Argument::from);
        schedule.launch(&JOIN_PREDICTION, cloths.sizes.vertices, &arguments);
    }

    /// Adds the way from the gradients of features and of the predicted positions to those of the
    /// positions before.
    pub fn to_positions(&self, plan: &mut Plan, schedule: &mut Schedule, to_input: &InputArrays) {
        let mark = plan.mark();
        let edges = self.losses.lanes * self.losses.place.edges();
        let by_hinge = plan.doubles("gradient of angles by corner", 12 * edges);
        let [node_steps, edge_steps] = to_input.steps;
        for step in 0..node_steps {
            let of_edges = (step + edge_steps).checked_sub(node_steps);
            self.features(schedule, to_input, (step, of_edges), by_hinge);
        }
        plan.release(mark);
        let cloths = self.from.cloths;
        let arguments = [
            self.slot(1),
            self.from.frames.last,
            cloths.cloth_of,
            self.slot(0),
            self.slot(-1),
        ];
        let arguments = arguments.map(Argument::from);
        schedule.launch(&INTEGRATION_BACKWARD, cloths.sizes.vertices, &arguments);
    }

    /// One frame of the window; arcs have fewer.
    fn features(
        &self,
        schedule: &mut Schedule,
        to_input: &InputArrays,
        (step, of_edges): (usize, Option<usize>),
        by_hinge: Region,
    ) {
        let FeatureSources {
            cloths,
            frames,
            normalizers,
        } = self.from;
        let (graph, losses, sizes) = (&cloths.graph, self.losses, cloths.sizes);
        let count = |count: usize| Argument::Count(count as u32);
        let [steps, _] = to_input.steps;
        let back = count(steps - 1 - step);
        let ring = [
            frames.positions.into(),
            frames.newest.into(),
            count(frames.slots),
            count(sizes.vertices),
            back,
        ];
        let part = |all: Region, step: usize, steps: usize| {
            let size = all.count() / steps;
            all.part(step * size..(step + 1) * size)
        };
        let edges = of_edges.map(|step| part(to_input.edges, step, to_input.steps[1]));
        let NormalizerArrays {
            nodes: [_, node_scale],
            edges: [_, edge_scale],
            ..
        } = *normalizers;
        if let Some(edges) = edges {
            let rest = [losses.hinges, losses.edge_arcs, edges, edge_scale, by_hinge];
            let arguments = [&ring[..], &rest.map(Argument::from)].concat();
            let count = losses.lanes * losses.place.edges();
            schedule.launch(&HINGES_BACKWARD, count, &arguments);
        }
        let rest = [
            count(step),
            count(steps),
            part(to_input.nodes, step, steps).into(),
            node_scale.into(),
            edges.into(),
            edge_scale.into(),
            cloths.cloth_of.into(),
            frames.numbers.into(),
            frames.carries(steps).into(),
            cloths.air.into(),
            cloths.mass.into(),
            cloths.first_face.into(),
            cloths.faces.into(),
            cloths.corners.into(),
            cloths.areas.into(),
            graph.first_arc.into(),
            graph.senders.into(),
            graph.twins.into(),
            cloths.arc_material.into(),
            losses.corner_ends.into(),
            losses.corners.into(),
            edges.map(|_| by_hinge).into(),
            self.by_position.into(),
        ];
        let arguments = [&ring[..], &rest].concat();
        schedule.launch(&POSITIONS_BACKWARD, sizes.vertices, &arguments);
    }
}
