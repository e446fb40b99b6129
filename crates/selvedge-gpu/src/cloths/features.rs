//! The features of vertices and arcs on the device: the table of `kernels/features.cu`, the definitions
//! that say which columns there are, and the schedule that fills a window of them, normalised.
//!
//! Columns and their order are `selvedge_model`'s. What depends on the handles alone is computed on the
//! CPU, frame by frame, and uploaded ([`crate::cloths::frames`]).

use selvedge_model::{EdgeFeature, Integration, ModelSpec, NodeFeature, Normalizers};

use crate::cloths::ClothArrays;
use crate::cloths::frames::{CarryLayout, FrameArrays};
use crate::device::{DeviceError, Loaded};
use crate::kernels::{Access, Kernel, Parameter, Part, Program, Shape, Width};
use crate::network::InputArrays;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Argument, Schedule};

use Access::{Count, Doubles, In, Indices, Out};

/// The file and its kernels.
pub static PART: Part = Part {
    name: "features.cu",
    text: include_str!("../kernels/features.cu"),
    kernels: &[&NODE_FEATURES, &EDGE_FEATURES],
};

/// The features of every vertex in every frame of a window.
pub static NODE_FEATURES: Kernel = Kernel {
    name: "node_features",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", In),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::any("steps", Count),
        Parameter::any("cloth_of", Indices),
        Parameter::any("numbers", In),
        Parameter::any("carries", Doubles),
        Parameter::any("air", In),
        Parameter::any("mass", In),
        Parameter::any("handle_of", Indices),
        Parameter::any("rest", In),
        Parameter::any("first_face", Indices),
        Parameter::any("faces", Indices),
        Parameter::any("corners", Indices),
        Parameter::any("areas", In),
        Parameter::fixed("shift", In, Width::NodeColumns),
        Parameter::fixed("scale", In, Width::NodeColumns),
        Parameter::per_count("out", Out, Width::NodeColumns),
    ],
};

/// The features of every arc in every frame of a window.
pub static EDGE_FEATURES: Kernel = Kernel {
    name: "edge_features",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", In),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::any("arcs", Count),
        Parameter::any("steps", Count),
        Parameter::any("cloth_of", Indices),
        Parameter::any("numbers", In),
        Parameter::any("senders", Indices),
        Parameter::any("receivers", Indices),
        Parameter::any("arc_rest", In),
        Parameter::any("arc_material", In),
        Parameter::any("hinges", Indices),
        Parameter::fixed("shift", In, Width::EdgeColumns),
        Parameter::fixed("scale", In, Width::EdgeColumns),
        Parameter::per_count("out", Out, Width::EdgeColumns),
    ],
};

/// Adds the kernels, and what of the spec they have to know.
pub fn define(program: &mut Program, spec: &ModelSpec) {
    let mut column = 0;
    for feature in &spec.node_features {
        program.define(node_name(*feature), column);
        column += feature.width();
    }
    column = 0;
    for feature in &spec.edge_features {
        program.define(edge_name(*feature), column);
        column += feature.width();
    }
    if let Integration::Carried { damping, stiffness } = spec.integration {
        program.define("CARRIED", 1);
        // The shortest decimal that reads as the same f64.
        program.define("DAMPING", format!("{damping:e}"));
        program.define("STIFFNESS", format!("{stiffness:e}"));
    }
    let layout = CarryLayout::of(spec);
    program.define("CARRY_ACCELERATION", layout.acceleration);
    program.define("CARRY_EXPECTED", layout.expected);
    program.define("CARRY_REST", layout.rest);
    program.define("CARRY_NUMBERS", layout.count);
    program.add(&PART);
}

fn node_name(feature: NodeFeature) -> &'static str {
    match feature {
        NodeFeature::Velocity => "NODE_VELOCITY",
        NodeFeature::ExternalForce => "NODE_EXTERNAL_FORCE",
        NodeFeature::KineticEnergy => "NODE_KINETIC_ENERGY",
        NodeFeature::NodeType => "NODE_TYPE",
        NodeFeature::Acceleration => "NODE_ACCELERATION",
        NodeFeature::ExpectedMove => "NODE_EXPECTED_MOVE",
        NodeFeature::RestOffset => "NODE_REST_OFFSET",
    }
}

fn edge_name(feature: EdgeFeature) -> &'static str {
    match feature {
        EdgeFeature::Vector => "EDGE_VECTOR",
        EdgeFeature::RestVector => "EDGE_REST_VECTOR",
        EdgeFeature::MaterialVector => "EDGE_MATERIAL_VECTOR",
        EdgeFeature::Elongation => "EDGE_ELONGATION",
        EdgeFeature::BendingAngle => "EDGE_BENDING_ANGLE",
        EdgeFeature::CoarseVector => "EDGE_COARSE_VECTOR",
        EdgeFeature::CoarseRestVector => "EDGE_COARSE_REST_VECTOR",
    }
}

/// Frozen statistics in the arena: what is taken off, and what then multiplies.
#[derive(Clone, Copy, Debug)]
pub struct NormalizerArrays {
    /// Shift and scale of vertices, `[node width]`.
    pub nodes: [Region; 2],
    /// Shift and scale of arcs, `[edge width]`.
    pub edges: [Region; 2],
    /// Shift and spread of accelerations, `[3]`.
    pub acceleration: [Region; 2],
}

impl NormalizerArrays {
    /// Room for the statistics of a spec.
    pub fn new(plan: &mut Plan, spec: &ModelSpec) -> Self {
        let mut pair = |name: &str, width: usize| {
            ["shift", "scale"].map(|what| plan.floats(format!("{what} of {name}"), width))
        };
        Self {
            nodes: pair("vertices", spec.node_width()),
            edges: pair("arcs", spec.edge_width()),
            acceleration: pair("accelerations", 3),
        }
    }

    /// All of them.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        [self.nodes, self.edges, self.acceleration].concat()
    }

    /// Writes statistics there.
    ///
    /// # Errors
    /// When the device fails.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        normalizers: &Normalizers,
    ) -> Result<(), DeviceError> {
        let inputs = [
            (self.nodes, normalizers.nodes.factors()),
            (self.edges, normalizers.edges.factors()),
        ];
        for (regions, [shift, scale, _]) in inputs {
            loaded.put(regions[0], shift)?;
            loaded.put(regions[1], scale)?;
        }
        let [shift, _, spread] = normalizers.acceleration.factors();
        loaded.put(self.acceleration[0], shift)?;
        loaded.put(self.acceleration[1], spread)
    }
}

/// What features are made from.
#[derive(Clone, Copy, Debug)]
pub struct FeatureSources<'a> {
    /// The cloths.
    pub cloths: &'a ClothArrays,
    /// Positions and what the handles do.
    pub frames: &'a FrameArrays,
    /// The statistics.
    pub normalizers: &'a NormalizerArrays,
}

/// Adds the filling of a window of normalised features to a schedule. `frames` must have the carries of
/// as many steps as `input` has of vertices.
pub fn features(schedule: &mut Schedule, from: FeatureSources<'_>, input: &InputArrays) {
    let FeatureSources {
        cloths,
        frames,
        normalizers,
    } = from;
    let [node_steps, edge_steps] = input.steps;
    let [vertices, arcs] = [cloths.sizes.vertices, cloths.sizes.arcs];
    let count = |count: usize| Argument::Count(count as u32);
    let ring = [
        frames.positions.into(),
        frames.newest.into(),
        count(frames.slots),
        count(vertices),
    ];
    let rest = [
        count(node_steps),
        cloths.cloth_of.into(),
        frames.numbers.into(),
        frames.carries(node_steps).into(),
        cloths.air.into(),
        cloths.mass.into(),
        cloths.handle_of.into(),
        cloths.rest.into(),
        cloths.first_face.into(),
        cloths.faces.into(),
        cloths.corners.into(),
        cloths.areas.into(),
        normalizers.nodes[0].into(),
        normalizers.nodes[1].into(),
        input.nodes.into(),
    ];
    let arguments = [&ring[..], &rest].concat();
    schedule.launch(&NODE_FEATURES, node_steps * vertices, &arguments);
    let rest = [
        count(arcs),
        count(edge_steps),
        cloths.cloth_of.into(),
        frames.numbers.into(),
        cloths.graph.senders.into(),
        cloths.graph.receivers.into(),
        cloths.arc_rest.into(),
        cloths.arc_material.into(),
        cloths.hinges.into(),
        normalizers.edges[0].into(),
        normalizers.edges[1].into(),
        input.edges.into(),
    ];
    let arguments = [&ring[..], &rest].concat();
    schedule.launch(&EDGE_FEATURES, edge_steps * arcs, &arguments);
}

#[cfg(test)]
mod tests;
