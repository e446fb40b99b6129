//! The physics whose frames a network corrects.

use selvedge_cloth::Integrator;
use serde::{Deserialize, Serialize};

/// Least latent width of a network that corrects physics: that of its outputs.
pub(crate) const LEAST_LATENT: usize = 8;

/// Cheap physics that predicts a frame, to which the network adds what truncation lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhysicsBase {
    /// Formula of a substep.
    #[serde(default)]
    pub integrator: Integrator,
    /// Implicit solves per frame, at least 1.
    pub substeps: u32,
    /// Every frame starts anew, without the substep before it: a formula of second order then takes
    /// one solve more.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub forgets: bool,
}
