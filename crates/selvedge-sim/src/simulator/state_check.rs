//! The check of positions and velocities that a simulator is given.

use glam::DVec3;
use selvedge_cloth::VertexId;

use super::SimulatorError;

/// Checks that there is one of `values` per vertex, finite in single precision.
pub(super) fn check_state(
    what: &'static str,
    one: &'static str,
    values: &[DVec3],
    expected: usize,
) -> Result<(), SimulatorError> {
    if values.len() != expected {
        return Err(SimulatorError::Count {
            what,
            expected,
            found: values.len(),
        });
    }
    match values.iter().position(|value| !value.as_vec3().is_finite()) {
        Some(vertex) => Err(SimulatorError::NonFinite {
            what: one,
            vertex: VertexId(vertex as u32),
            value: values[vertex],
        }),
        None => Ok(()),
    }
}
