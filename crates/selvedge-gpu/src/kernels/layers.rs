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
    MODE_SUMS = "mode_sums",
    ADD_MODES = "add_modes",
    FILTER_MODES = "filter_modes",
    SLICE_WEIGHTS = "slice_weights",
    TOKEN_MEANS = "token_means",
);
