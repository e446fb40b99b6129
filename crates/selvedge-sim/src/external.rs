//! Gravity and air, explicit forces (method.md §2, simulator.md §2.3).
//!
//! Air acts on each face with its current area and unit normal; a third goes to each corner.

use glam::DVec3;
use selvedge_cloth::Environment;
use selvedge_cloth::geometry::area_vector;

/// Force of the air on a face with corners at `positions` [m] moving at `velocities` [m/s], [N].
///
/// v_rel = wind - mean corner velocity, n the unit normal, v_n = n·v_rel, v_t = v_rel - v_n n:
/// F = density · area · |v_n| v_n n + drag · area · v_t. `[eq:air-drag]`
#[must_use]
#[inline]
pub fn air_force(
    environment: &Environment,
    area: f64,
    positions: [DVec3; 3],
    velocities: [DVec3; 3],
) -> DVec3 {
    let [a, b, c] = positions;
    let normal = area_vector(a, b, c).normalize_or_zero();
    let [first, second, third] = velocities;
    let relative = environment.wind - (first + second + third) / 3.0;
    let through = normal.dot(relative);
    let tangential = relative - normal * through;
    normal * (environment.air_density * area * through.abs() * through)
        + tangential * (environment.air_drag * area)
}
