//! Kernels of the forward pass.

use super::part;

part!("layers.cu":
    ADD_BIAS = "add_bias",
    ADD_BIAS_RELU = "add_bias_relu",
    PACK_ENDS = "pack_ends",
    GATHER_ENDS = "gather_ends",
    NORM = "norm",
    NORM_MESSAGES = "norm_messages",
    GATES = "gates",
    DROPOUT = "dropout",
);
