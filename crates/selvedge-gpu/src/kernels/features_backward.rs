//! Kernels of the way back from the gradient of features to that of positions.

use super::part;

part!("features_backward.cu":
    HINGES_BACKWARD = "hinges_backward",
    POSITIONS_BACKWARD = "positions_backward",
    JOIN_PREDICTION = "join_prediction",
    INTEGRATION_BACKWARD = "integration_backward",
);
