//! The equations of one implicit stage of a substep.

use glam::DVec3;

use crate::state::State;

/// The equations M (v - v̄) = γ (f_ext + F(x) + c J v) with x = x̄ + γ v. Backward Euler is the
/// stage with γ = dt and v̄, x̄ of the substep's start. An estimate of (x, v) satisfies the second
/// equation already, so that x̄ is not needed here.
#[derive(Clone, Copy)]
pub(crate) struct Stage<'a> {
    /// γ `[s]`.
    pub(crate) gamma: f64,
    /// v̄ `[m/s]`, `[vertices]`.
    pub(crate) velocities: &'a [DVec3],
    /// State whose air acts.
    pub(crate) air: StageAir<'a>,
}

/// State whose air acts in a stage.
#[derive(Clone, Copy)]
pub(crate) enum StageAir<'a> {
    /// Normals of this start of the substep, and the scene's law of the air.
    OfStart(&'a State),
    /// Normals and velocities of the end, where the stage is linearised.
    OfEnd,
}
