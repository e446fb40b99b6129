//! What a prediction is judged by, on the device: the table of `kernels/losses.cu`, its arrays, and the
//! schedule from predicted accelerations to the terms of every lane and their gradient.
//!
//! Lanes stand in places of equal sizes ([`PlaceSizes`]), each with a cloth that may fill less of it: what
//! is left over is vertices that are handles, at the origin, and edges from one of them to itself.

use selvedge_train::{LossStatistics, LossWeights};

use crate::cloths::ClothArrays;
use crate::kernels::losses::{
    EDGE_LOSSES, LOSS_PARTS, LOSS_TERMS, PREDICT_POSITIONS, VERTEX_LOSSES, WEIGH,
};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, Schedule, args};

/// Statistics and weights of the terms, as in `kernels/losses.cu`.
const NUMBERS: usize = 19;

/// Terms of a loss: acceleration, kinetic energy, edge vector, edge length, bending angle.
pub const TERMS: usize = 5;

/// Vertices, and edges, that a warp sums: a large cloth is summed by many, always by the same parts.
const PER_PART: usize = 256;

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

    /// The vertices of all slots.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.lanes * self.place.vertices
    }

    /// The edges of all slots.
    #[must_use]
    pub fn edges(&self) -> usize {
        self.lanes * self.place.edges()
    }

    /// The arrays that are written from outside.
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

impl Judged<'_> {
    /// The arguments `JUDGED` of a kernel.
    fn arguments(&self, losses: &LossArrays) -> Vec<NamedArgument> {
        args! {
            predicted: self.predicted,
            previous: self.triplet.previous,
            current: self.triplet.current,
            target: self.triplet.target,
            handle_of: self.cloths.handle_of,
            numbers: losses.numbers,
        }
    }
}

/// Arrays between the kernels of the losses.
struct Between {
    /// Predicted positions, `[vertices, 3]` `[m]`.
    positions: Region,
    /// Gradients of edge vectors, `[edges, 3]`.
    by_edge: Region,
    /// Gradients of the corners of hinges, `[edges, 12]`.
    by_hinge: Region,
    /// Terms of edges, `[edges, 3]`.
    of_edges: Region,
    /// Terms of vertices, `[vertices, 2]`.
    of_vertices: Region,
}

/// Adds the judging of a frame to a schedule.
pub fn judge(plan: &mut Plan, schedule: &mut Schedule, losses: &LossArrays, what: Judged<'_>) {
    let (vertices, edges) = (losses.vertices(), losses.edges());
    let mark = plan.mark();
    let between = Between {
        positions: plan.doubles("predicted positions", 3 * vertices),
        by_edge: plan.doubles("losses by edge", 3 * edges),
        by_hinge: plan.doubles("losses by hinge", 12 * edges),
        of_edges: plan.doubles("losses of edges", 3 * edges),
        of_vertices: plan.doubles("losses of vertices", 2 * vertices),
    };
    let arguments = args! {
        ..what.arguments(losses),
        positions: between.positions,
    };
    schedule.launch(&PREDICT_POSITIONS, vertices, arguments);
    judge_edges(schedule, losses, what, &between);
    judge_vertices(schedule, losses, what, &between);
    sum_terms(plan, schedule, losses, &between, what.terms);
    plan.release(mark);
}

fn judge_edges(schedule: &mut Schedule, losses: &LossArrays, what: Judged<'_>, between: &Between) {
    let arguments = args! {
        positions: between.positions,
        target: what.triplet.target,
        ends: losses.ends,
        hinges: losses.hinges,
        shares: losses.shares,
        per_slot: losses.place.edges(),
        numbers: losses.numbers,
        by_edge: between.by_edge,
        by_hinge: between.by_hinge,
        terms: between.of_edges,
    };
    schedule.launch(&EDGE_LOSSES, losses.edges(), arguments);
}

fn judge_vertices(
    schedule: &mut Schedule,
    losses: &LossArrays,
    what: Judged<'_>,
    between: &Between,
) {
    let arguments = args! {
        ..what.arguments(losses),
        positions: between.positions,
        mass: what.cloths.mass,
        first_arc: what.cloths.graph.first_arc,
        arc_edges: losses.arc_edges,
        ends: losses.ends,
        by_edge: between.by_edge,
        corner_ends: losses.corner_ends,
        corners: losses.corners,
        by_hinge: between.by_hinge,
        shares: losses.shares,
        per_slot: losses.place.vertices,
        gradient: what.gradient,
        terms: between.of_vertices,
    };
    schedule.launch(&VERTEX_LOSSES, losses.vertices(), arguments);
}

/// Adds the sums of the terms of vertices and edges to the terms of their slots.
fn sum_terms(
    plan: &mut Plan,
    schedule: &mut Schedule,
    losses: &LossArrays,
    between: &Between,
    terms: Region,
) {
    let (lanes, place) = (losses.lanes, losses.place);
    let parts = place.vertices.max(place.edges());
    let parts = parts.div_ceil(PER_PART).max(1);
    let sums = plan.doubles("losses of parts", TERMS * parts * lanes);
    let arguments = args! {
        of_vertices: between.of_vertices,
        of_edges: between.of_edges,
        vertices: place.vertices,
        edges: place.edges(),
        per_part: PER_PART,
        parts,
        sums,
    };
    schedule.launch(&LOSS_PARTS, lanes * parts, arguments);
    let arguments = args! { sums, shares: losses.shares, parts, terms };
    schedule.launch(&LOSS_TERMS, lanes, arguments);
}

/// Multiplies the gradient of each slot by its weight, `[slots]`.
pub fn weigh(schedule: &mut Schedule, losses: &LossArrays, gradient: Region, weights: Region) {
    let arguments = args! { gradient, weights, per_slot: losses.place.vertices };
    schedule.launch(&WEIGH, losses.vertices(), arguments);
}
