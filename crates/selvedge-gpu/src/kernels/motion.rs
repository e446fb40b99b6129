//! Kernels of the integration.

use super::part;

part!("motion.cu": INTEGRATE = "integrate");
