//! Kernels of the losses.

use super::part;

part!("losses.cu":
    PREDICT_POSITIONS = "predict_positions",
    EDGE_LOSSES = "edge_losses",
    VERTEX_LOSSES = "vertex_losses",
    LOSS_PARTS = "loss_parts",
    LOSS_TERMS = "loss_terms",
    WEIGH = "weigh",
    SQUARE_ERROR = "square_error",
);
