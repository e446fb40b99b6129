//! The losses on the device: their arrays, and the schedule from predicted accelerations to the
//! terms of every rollout slot and their gradient.
//!
//! All rollout slots have the same size ([`SlotSizes`]). A smaller cloth is padded: with vertices
//! that are handles at the origin, and with edges from one of them to itself.

use selvedge_train::{LossStatistics, LossWeights};

use crate::cloths::ClothArrays;
use crate::kernels::losses::{
    EDGE_LOSSES, LOSS_PARTS, LOSS_TERMS, PREDICT_POSITIONS, VERTEX_LOSSES, WEIGH,
};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, Schedule, args};

/// The number of statistics and weights of the terms, as in `kernels/losses.cu`.
const NUMBERS: usize = 19;

/// The number of terms: acceleration, kinetic energy, edge vector, edge length, bending angle.
pub const TERMS: usize = 5;

/// Vertices and edges that one warp sums. The parts of a cloth are always the same.
const PER_PART: usize = 256;

/// Sizes of a rollout slot in the union.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlotSizes {
    /// Vertices.
    pub vertices: usize,
    /// Arcs, two per edge.
    pub arcs: usize,
    /// Faces.
    pub faces: usize,
}

impl SlotSizes {
    /// Edges.
    #[must_use]
    pub fn edges(self) -> usize {
        self.arcs / 2
    }
}

/// The constant arrays of the losses beside [`ClothArrays`].
#[derive(Clone, Copy, Debug)]
pub struct LossArrays {
    /// The number of rollout slots.
    pub slots: usize,
    /// The sizes of each slot.
    pub slot: SlotSizes,
    /// Both vertices of the edges, `[edges, 2]`.
    pub ends: Region,
    /// From, to, left and right of the hinges, `[edges, 4]`; four equal vertices at a border.
    pub hinges: Region,
    /// The edge of each arc, `[arcs]`.
    pub arc_edges: Region,
    /// The arcs of each edge, from its first end and from its second, `[edges, 2]`.
    pub edge_arcs: Region,
    /// Begin and end of the corners of each vertex in `corners`, `[vertices, 2]`.
    pub corner_ends: Region,
    /// The corners of hinges of each vertex: 4 times the edge plus the number of the corner,
    /// `[4 edges]`.
    pub corners: Region,
    /// The weights of one vertex and of one edge in the means of their slot, `[slots, 2]`.
    pub shares: Region,
    /// Statistics and weights.
    pub numbers: Region,
}

impl LossArrays {
    /// Room for `slots` rollout slots of one size.
    pub fn new(plan: &mut Plan, slots: usize, slot: SlotSizes) -> Self {
        let [vertices, arcs, edges] = [slot.vertices, slot.arcs, slot.edges()].map(|n| n * slots);
        Self {
            slots,
            slot,
            ends: plan.indices("edges", 2 * edges),
            hinges: plan.indices("hinges of edges", 4 * edges),
            arc_edges: plan.indices("edges of arcs", arcs),
            edge_arcs: plan.indices("arcs of edges", 2 * edges),
            corner_ends: plan.indices("corners of vertices", 2 * vertices),
            corners: plan.indices("corners of hinges", 4 * edges),
            shares: plan.doubles("shares of losses", 2 * slots),
            numbers: plan.doubles("statistics of losses", NUMBERS),
        }
    }

    /// The vertices of all slots.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.slots * self.slot.vertices
    }

    /// The edges of all slots.
    #[must_use]
    pub fn edges(&self) -> usize {
        self.slots * self.slot.edges()
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
    let LossWeights {
        kinetic_energy,
        edge_vector,
        edge_length,
        bending_angle,
        ..
    } = *weights;
    numbers.extend([kinetic_energy, edge_vector, edge_length, bending_angle]);
    numbers
}

/// Three frames of every rollout slot in the arena, in the local axes of its cloth.
#[derive(Clone, Copy, Debug)]
pub struct TripletArrays {
    /// Positions one frame before the current ones, `[vertices, 3]` `[m]`.
    pub previous: Region,
    /// Positions from which the prediction starts.
    pub current: Region,
    /// Positions that the prediction should reach.
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

/// A prediction to judge, with room for the results.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    /// The cloths.
    pub cloths: &'a ClothArrays,
    /// The frames around the prediction.
    pub triplet: &'a TripletArrays,
    /// Normalised accelerations, `[vertices, 3]`.
    pub predicted: Region,
    /// Room for the gradient of each slot's loss with respect to `predicted`, `[vertices, 3]`.
    pub gradient: Region,
    /// Room for the terms of each slot before their weights, `[slots, 5]`.
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
        per_slot: losses.slot.edges(),
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
        per_slot: losses.slot.vertices,
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
    let (slots, slot) = (losses.slots, losses.slot);
    let parts = slot.vertices.max(slot.edges());
    let parts = parts.div_ceil(PER_PART).max(1);
    let sums = plan.doubles("losses of parts", TERMS * parts * slots);
    let arguments = args! {
        of_vertices: between.of_vertices,
        of_edges: between.of_edges,
        vertices: slot.vertices,
        edges: slot.edges(),
        per_part: PER_PART,
        parts,
        sums,
    };
    schedule.launch(&LOSS_PARTS, slots * parts, arguments);
    let arguments = args! { sums, shares: losses.shares, parts, terms };
    schedule.launch(&LOSS_TERMS, slots, arguments);
}

/// Multiplies the gradient of each slot by its weight, `[slots]`.
pub fn weigh(schedule: &mut Schedule, losses: &LossArrays, gradient: Region, weights: Region) {
    let arguments = args! { gradient, weights, per_slot: losses.slot.vertices };
    schedule.launch(&WEIGH, losses.vertices(), arguments);
}
