//! Kernels of the backward pass.

use super::part;

part!("backward.cu":
    NORM_BACKWARD = "norm_backward",
    MASK_RELU = "mask_relu",
    GATHER_INCOMING = "gather_incoming",
    SUM_ENDS = "sum_ends",
    GATES_BACKWARD = "gates_backward",
    GATE_BIASES = "gate_biases",
    ADD = "add",
);
