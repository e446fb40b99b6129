//! What a prediction is judged by, on the device: the table of `kernels/losses.cu`, its arrays, and the
//! schedule from predicted accelerations to the terms of every lane and their gradient.
//!
//! Lanes stand in places of equal sizes ([`PlaceSizes`]), each with a cloth that may fill less of it: what
//! is left over is vertices that are handles, at the origin, and edges from one of them to itself.

use selvedge_train::{LossStatistics, LossWeights};

use crate::cloths::ClothArrays;
use crate::kernels::{Access, Kernel, Parameter, Part, Shape, Width};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Argument, Schedule};

use Access::{Count, Doubles, DoublesOut, In, InOut, Indices, Out};

/// Statistics and weights of the terms, as in `kernels/losses.cu`.
const NUMBERS: usize = 19;

/// Terms of a loss: acceleration, kinetic energy, edge vector, edge length, bending angle.
pub const TERMS: usize = 5;

/// Vertices, and edges, that a warp sums: a large cloth is summed by many, always by the same parts.
const PER_PART: usize = 256;

const VECTOR: Width = Width::Numbers(3);

const fn rows(name: &'static str, access: Access, width: usize) -> Parameter {
    Parameter::per_count(name, access, Width::Numbers(width))
}

const fn numbers() -> Parameter {
    Parameter::fixed("numbers", Doubles, Width::Numbers(NUMBERS))
}

/// The file and its kernels.
pub static PART: Part = Part {
    name: "losses.cu",
    text: include_str!("../kernels/losses.cu"),
    kernels: &[
        &PREDICT_POSITIONS,
        &EDGE_LOSSES,
        &VERTEX_LOSSES,
        &LOSS_PARTS,
        &LOSS_TERMS,
        &WEIGH,
        &SQUARE_ERROR,
    ],
};

/// From accelerations to positions.
pub static PREDICT_POSITIONS: Kernel = Kernel {
    name: "predict_positions",
    shape: Shape::Element,
    parameters: &[
        rows("predicted", In, 3),
        rows("previous", Doubles, 3),
        rows("current", Doubles, 3),
        rows("target", Doubles, 3),
        rows("handle_of", Indices, 1),
        numbers(),
        rows("positions", DoublesOut, 3),
    ],
};

/// What edges and hinges add.
pub static EDGE_LOSSES: Kernel = Kernel {
    name: "edge_losses",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", Doubles),
        Parameter::any("target", Doubles),
        rows("ends", Indices, 2),
        rows("hinges", Indices, 4),
        Parameter::any("shares", Doubles),
        Parameter::any("per_lane", Count),
        numbers(),
        rows("by_edge", DoublesOut, 3),
        rows("by_hinge", DoublesOut, 12),
        rows("terms", DoublesOut, 3),
    ],
};

/// What vertices add, and the gradient.
pub static VERTEX_LOSSES: Kernel = Kernel {
    name: "vertex_losses",
    shape: Shape::Element,
    parameters: &[
        rows("predicted", In, 3),
        rows("positions", Doubles, 3),
        rows("previous", Doubles, 3),
        rows("current", Doubles, 3),
        rows("target", Doubles, 3),
        rows("handle_of", Indices, 1),
        rows("mass", In, 1),
        Parameter::any("first_arc", Indices),
        Parameter::any("arc_edges", Indices),
        Parameter::any("ends", Indices),
        Parameter::any("by_edge", Doubles),
        rows("corner_ends", Indices, 2),
        Parameter::any("corners", Indices),
        Parameter::any("by_hinge", Doubles),
        Parameter::any("shares", Doubles),
        Parameter::any("per_lane", Count),
        numbers(),
        Parameter::per_count("gradient", Out, VECTOR),
        rows("terms", DoublesOut, 2),
    ],
};

/// Sums over parts of a lane.
pub static LOSS_PARTS: Kernel = Kernel {
    name: "loss_parts",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("of_vertices", Doubles),
        Parameter::any("of_edges", Doubles),
        Parameter::any("vertices", Count),
        Parameter::any("edges", Count),
        Parameter::any("per_part", Count),
        Parameter::any("parts", Count),
        rows("sums", DoublesOut, TERMS),
    ],
};

/// The terms of a lane.
pub static LOSS_TERMS: Kernel = Kernel {
    name: "loss_terms",
    shape: Shape::Row,
    parameters: &[
        Parameter::any("sums", Doubles),
        rows("shares", Doubles, 2),
        Parameter::any("parts", Count),
        rows("terms", DoublesOut, TERMS),
    ],
};

/// What lanes count.
pub static WEIGH: Kernel = Kernel {
    name: "weigh",
    shape: Shape::Element,
    parameters: &[
        Parameter::per_count("gradient", InOut, VECTOR),
        Parameter::any("weights", In),
        Parameter::any("per_lane", Count),
    ],
};

/// The gradient of the mean square error.
pub static SQUARE_ERROR: Kernel = Kernel {
    name: "square_error",
    shape: Shape::Element,
    parameters: &[
        rows("found", In, 1),
        rows("target", In, 1),
        Parameter::any("share", Access::Number),
        rows("gradient", Out, 1),
    ],
};

/// How many of everything the place of a lane has room for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlaceSizes {
    /// Vertices.
    pub vertices: usize,
    /// Arcs, two per edge.
    pub arcs: usize,
    /// Faces.
    pub faces: usize,
}

impl PlaceSizes {
    /// Edges.
    #[must_use]
    pub fn edges(self) -> usize {
        self.arcs / 2
    }
}

/// What does not change of the cloths of all lanes beside [`ClothArrays`], and the constants.
#[derive(Clone, Copy, Debug)]
pub struct LossArrays {
    /// Lanes.
    pub lanes: usize,
    /// What each has room for.
    pub place: PlaceSizes,
    /// Both ends of the edges, `[edges, 2]`.
    pub ends: Region,
    /// From, to, left and right of their hinges, `[edges, 4]`; four times the same at a border.
    pub hinges: Region,
    /// The edge of each arc, `[arcs]`.
    pub arc_edges: Region,
    /// The arcs of each edge, from its first end and from its second, `[edges, 2]`.
    pub edge_arcs: Region,
    /// Where in `corners` those of each vertex begin and end, `[vertices, 2]`.
    pub corner_ends: Region,
    /// Where each vertex is a corner of a hinge: 4 times the edge, and which of its corners,
    /// `[4 edges]`.
    pub corners: Region,
    /// What one vertex and what one edge count in the means of their lane, `[lanes, 2]`.
    pub shares: Region,
    /// Statistics and weights.
    pub numbers: Region,
}

impl LossArrays {
    /// Room for lanes in places of these sizes.
    pub fn new(plan: &mut Plan, lanes: usize, place: PlaceSizes) -> Self {
        let [vertices, arcs, edges] =
            [place.vertices, place.arcs, place.edges()].map(|n| n * lanes);
        Self {
            lanes,
            place,
            ends: plan.indices("edges", 2 * edges),
            hinges: plan.indices("hinges of edges", 4 * edges),
            arc_edges: plan.indices("edges of arcs", arcs),
            edge_arcs: plan.indices("arcs of edges", 2 * edges),
            corner_ends: plan.indices("corners of vertices", 2 * vertices),
            corners: plan.indices("corners of hinges", 4 * edges),
            shares: plan.doubles("shares of losses", 2 * lanes),
            numbers: plan.doubles("statistics of losses", NUMBERS),
        }
    }

    /// All that is written from outside.
    #[must_use]
    pub fn regions(&self) -> [Region; 8] {
        [
            self.ends,
            self.hinges,
            self.arc_edges,
            self.edge_arcs,
            self.corner_ends,
            self.corners,
            self.shares,
            self.numbers,
        ]
    }
}

/// The constants of the losses, for [`LossArrays::numbers`].
#[must_use]
pub fn loss_numbers(statistics: &LossStatistics, weights: &LossWeights) -> Vec<f64> {
    let inverse = |d: &f64| if *d > 0.0 { 1.0 / d } else { 0.0 };
    let scales = |of: &selvedge_model::Normalizer| of.deviation().iter().map(inverse).collect();
    let acceleration = &statistics.acceleration;
    let compared = [
        &statistics.kinetic_energy,
        &statistics.edge_vector,
        &statistics.edge_length,
        &statistics.bending_angle,
    ];
    let mut numbers = [acceleration.mean(), acceleration.deviation()].concat();
    let inverses: Vec<f64> = scales(acceleration);
    numbers.extend(inverses);
    numbers.extend(
        compared
            .into_iter()
            .flat_map(|of| -> Vec<f64> { scales(of) }),
    );
    numbers.extend([
        weights.kinetic_energy,
        weights.edge_vector,
        weights.edge_length,
        weights.bending_angle,
    ]);
    numbers
}

/// A frame of every lane in the arena, in axes of its own.
#[derive(Clone, Copy, Debug)]
pub struct TripletArrays {
    /// Positions one frame before the current ones, `[vertices, 3]` `[m]`.
    pub previous: Region,
    /// Positions that the prediction starts from.
    pub current: Region,
    /// Positions that it should lead to.
    pub target: Region,
}

impl TripletArrays {
    /// Room for a union.
    pub fn new(plan: &mut Plan, vertices: usize) -> Self {
        let mut room = |name: &str| plan.doubles(format!("{name} positions"), 3 * vertices);
        Self {
            previous: room("previous"),
            current: room("current"),
            target: room("target"),
        }
    }

    /// All of them.
    #[must_use]
    pub fn regions(&self) -> [Region; 3] {
        [self.previous, self.current, self.target]
    }
}

/// What is judged, and where that goes.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    /// The cloths.
    pub cloths: &'a ClothArrays,
    /// The frame.
    pub triplet: &'a TripletArrays,
    /// Normalised accelerations, `[vertices, 3]`.
    pub predicted: Region,
    /// Out: the gradient of each lane's loss with respect to them, `[vertices, 3]`.
    pub gradient: Region,
    /// Out: the terms of each lane before their weights, `[lanes, 5]`.
    pub terms: Region,
}

/// Adds the judging of a frame to a schedule.
pub fn judge(plan: &mut Plan, schedule: &mut Schedule, losses: &LossArrays, what: Judged<'_>) {
    let (lanes, place) = (losses.lanes, losses.place);
    let [vertices, edges] = [place.vertices, place.edges()].map(|n| n * lanes);
    let per_lane = [place.vertices, place.edges()].map(|n| Argument::Count(n as u32));
    let mark = plan.mark();
    let positions = plan.doubles("predicted positions", 3 * vertices);
    let by_edge = plan.doubles("losses by edge", 3 * edges);
    let by_hinge = plan.doubles("losses by hinge", 12 * edges);
    let of_edges = plan.doubles("losses of edges", 3 * edges);
    let of_vertices = plan.doubles("losses of vertices", 2 * vertices);
    let (cloths, numbers) = (what.cloths, losses.numbers.into());
    let [previous, current, target] = what.triplet.regions().map(Argument::from);
    let (predicted, handles) = (what.predicted.into(), cloths.handle_of.into());
    let arguments = [
        predicted,
        previous,
        current,
        target,
        handles,
        numbers,
        positions.into(),
    ];
    schedule.launch(&PREDICT_POSITIONS, vertices, &arguments);
    let arguments = [
        positions.into(),
        target,
        losses.ends.into(),
        losses.hinges.into(),
        losses.shares.into(),
        per_lane[1],
        numbers,
        by_edge.into(),
        by_hinge.into(),
        of_edges.into(),
    ];
    schedule.launch(&EDGE_LOSSES, edges, &arguments);
    let arguments = [
        predicted,
        positions.into(),
        previous,
        current,
        target,
        handles,
        cloths.mass.into(),
        cloths.graph.first_arc.into(),
        losses.arc_edges.into(),
        losses.ends.into(),
        by_edge.into(),
        losses.corner_ends.into(),
        losses.corners.into(),
        by_hinge.into(),
        losses.shares.into(),
        per_lane[0],
        numbers,
        what.gradient.into(),
        of_vertices.into(),
    ];
    schedule.launch(&VERTEX_LOSSES, vertices, &arguments);
    sum_terms(
        plan,
        schedule,
        losses,
        ([of_vertices, of_edges], what.terms),
    );
    plan.release(mark);
}

/// From what vertices and edges add to the terms of their lanes.
fn sum_terms(
    plan: &mut Plan,
    schedule: &mut Schedule,
    losses: &LossArrays,
    ([of_vertices, of_edges], terms): ([Region; 2], Region),
) {
    let (lanes, place) = (losses.lanes, losses.place);
    let counts = [place.vertices, place.edges()];
    let parts = counts[0].max(counts[1]).div_ceil(PER_PART).max(1);
    let sums = plan.doubles("losses of parts", TERMS * parts * lanes);
    let in_parts = Argument::Count(parts as u32);
    let arguments = [
        of_vertices.into(),
        of_edges.into(),
        Argument::Count(counts[0] as u32),
        Argument::Count(counts[1] as u32),
        Argument::Count(PER_PART as u32),
        in_parts,
        sums.into(),
    ];
    schedule.launch(&LOSS_PARTS, lanes * parts, &arguments);
    let arguments = [sums.into(), losses.shares.into(), in_parts, terms.into()];
    schedule.launch(&LOSS_TERMS, lanes, &arguments);
}

/// Multiplies the gradients of the lanes by what each counts, `[lanes]`.
pub fn weigh(schedule: &mut Schedule, losses: &LossArrays, gradient: Region, weights: Region) {
    let per_lane = Argument::Count(losses.place.vertices as u32);
    let vertices = losses.lanes * losses.place.vertices;
    schedule.launch(
        &WEIGH,
        vertices,
        &[gradient.into(), weights.into(), per_lane],
    );
}
