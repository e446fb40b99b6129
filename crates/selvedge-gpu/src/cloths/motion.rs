//! From accelerations to the next positions, and the bounds of edges: the table of
//! `kernels/motion.cu` and the schedule of both.
//!
//! Edges are gone through colour by colour, those of a colour at once, so that where several edges are
//! out of bounds the result differs from the CPU's, which goes through them by number. Where none is,
//! both leave every position as it is.

use selvedge_model::ModelSpec;

use crate::cloths::ClothArrays;
use crate::cloths::features::NormalizerArrays;
use crate::cloths::frames::FrameArrays;
use crate::kernels::{Access, Kernel, Parameter, Part, Program, Shape, Width};
use crate::schedule::plan::Region;
use crate::schedule::{Argument, Schedule};

use Access::{Count, Doubles, In, InOut, Indices, IndicesInOut};

/// The file and its kernels, of a spec without bounds of edges.
pub static PART: Part = Part {
    name: "motion.cu",
    text: include_str!("../kernels/motion.cu"),
    kernels: &[&INTEGRATE],
};

/// The same for a spec with bounds of edges.
pub static LIMITED_PART: Part = Part {
    name: "motion.cu",
    text: include_str!("../kernels/motion.cu"),
    kernels: &[&INTEGRATE, &LIMIT_EDGES],
};

/// From accelerations to the next positions.
pub static INTEGRATE: Kernel = Kernel {
    name: "integrate",
    shape: Shape::Element,
    parameters: &[
        Parameter::any("positions", InOut),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::per_count("output", In, Width::Numbers(3)),
        Parameter::fixed("shift", In, Width::Numbers(3)),
        Parameter::fixed("spread", In, Width::Numbers(3)),
        Parameter::any("numbers", In),
        Parameter::any("carries", Doubles),
        Parameter::per_count("cloth_of", Indices, Width::Numbers(1)),
        Parameter::per_count("rest", In, Width::Numbers(3)),
        Parameter::per_count("handle_of", Indices, Width::Numbers(1)),
        Parameter::any("targets", In),
    ],
};

/// Brings the edges of each cloth back to their bounds.
pub static LIMIT_EDGES: Kernel = Kernel {
    name: "limit_edges",
    shape: Shape::Block,
    parameters: &[
        Parameter::any("positions", InOut),
        Parameter::fixed("newest", Indices, Width::Numbers(1)),
        Parameter::any("slots", Count),
        Parameter::any("vertices", Count),
        Parameter::any("edge_ends", Indices),
        Parameter::any("edge_rest", In),
        Parameter::any("inverse_mass", In),
        Parameter::any("colour_bounds", Indices),
        Parameter::any("colours", Count),
        Parameter::per_count("changed", IndicesInOut, Width::Numbers(1)),
    ],
};

/// Adds the kernels, and what of the spec they have to know.
pub fn define(program: &mut Program, spec: &ModelSpec) {
    let Some(limits) = spec.edge_limits else {
        program.add(&PART);
        return;
    };
    // As the CPU rounds them.
    program.define("LEAST_STRETCH", format!("{:e}f", limits.least as f32));
    program.define("MOST_STRETCH", format!("{:e}f", limits.most as f32));
    program.define("SWEEPS", limits.sweeps);
    program.add(&LIMITED_PART);
}

/// Adds the way from normalised accelerations `output` `[vertices, 3]` to the next positions, which go
/// to the slot after the newest. `changed` (`[cloths]`) is room for the bounds of edges, where the spec has
/// any.
pub fn advance(
    schedule: &mut Schedule,
    (cloths, frames): (&ClothArrays, &FrameArrays),
    normalizers: &NormalizerArrays,
    output: Region,
    changed: Option<Region>,
) {
    let sizes = cloths.sizes;
    let count = |count: usize| Argument::Count(count as u32);
    let ring = [
        frames.positions.into(),
        frames.newest.into(),
        count(frames.slots),
        count(sizes.vertices),
    ];
    let [shift, spread] = normalizers.acceleration;
    let rest = [
        output.into(),
        shift.into(),
        spread.into(),
        frames.numbers.into(),
        frames.last.into(),
        cloths.cloth_of.into(),
        cloths.rest.into(),
        cloths.handle_of.into(),
        frames.targets.into(),
    ];
    schedule.launch(&INTEGRATE, sizes.vertices, &[&ring[..], &rest].concat());
    let Some(changed) = changed else { return };
    let rest = [
        cloths.edge_ends.into(),
        cloths.edge_rest.into(),
        cloths.inverse_mass.into(),
        cloths.colour_bounds.into(),
        count(sizes.colours),
        changed.into(),
    ];
    schedule.launch(&LIMIT_EDGES, sizes.cloths, &[&ring[..], &rest].concat());
}
