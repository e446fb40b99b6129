//! Kernels of the optimiser.

use super::{Program, part};

/// Elements of the gradient whose squares one row of a launch sums.
pub const SQUARES_PER_ROW: usize = 4096;

part!("adam.cu":
    GRADIENT_SQUARES = "gradient_squares",
    GRADIENT_NORM = "gradient_norm",
    ADAM = "adam",
    RUNNING_MEAN = "running_mean",
);

/// Adds the kernels and their definitions.
pub fn define(program: &mut Program) {
    program.define("SQUARES_PER_ROW", SQUARES_PER_ROW);
    program.define("LARGEST_NORM", "1.7976931348623157e308");
    program.add(&PART);
}
