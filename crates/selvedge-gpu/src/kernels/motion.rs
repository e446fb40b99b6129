//! Kernels of the integration and of the bounds of edge lengths, with the definitions that a spec
//! gives them.

use selvedge_model::ModelSpec;

use super::{Kernel, Part, Program};

const NAME: &str = "motion.cu";
const TEXT: &str = include_str!("motion.cu");

/// The file and its kernels, for a spec without bounds of edges.
pub static PART: Part = Part {
    name: NAME,
    text: TEXT,
    kernels: &[&INTEGRATE],
};

/// The file and its kernels, for a spec with bounds of edges.
pub static LIMITED_PART: Part = Part {
    name: NAME,
    text: TEXT,
    kernels: &[&INTEGRATE, &LIMIT_EDGES],
};

/// The kernel `integrate` of `motion.cu`.
pub static INTEGRATE: Kernel = Kernel::of(TEXT, "integrate");

/// The kernel `limit_edges` of `motion.cu`.
pub static LIMIT_EDGES: Kernel = Kernel::of(TEXT, "limit_edges");

/// Adds the kernels and the definitions of a spec.
pub fn define(program: &mut Program, spec: &ModelSpec) {
    let Some(limits) = spec.edge_limits else {
        program.add(&PART);
        return;
    };
    // As the processor rounds them.
    program.define("LEAST_STRETCH", format!("{:e}f", limits.least as f32));
    program.define("MOST_STRETCH", format!("{:e}f", limits.most as f32));
    program.define("SWEEPS", limits.sweeps);
    program.add(&LIMITED_PART);
}
