//! Gravity and air, explicit forces (Narain et al. 2012).
//!
//! Air acts on each face with its material area and its current unit normal (that the area is not
//! the current one is a finding: only so ARCSim's substeps are met); a third goes to each corner.

use glam::DVec3;
use selvedge_cloth::Environment;
use selvedge_cloth::geometry::area_vector;

/// Force of the air on a face of material `area` `[m²]` with corners at `positions` `[m]` moving at `velocities` `[m/s]`, `[N]`.
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

#[cfg(test)]
mod tests {
    use super::*;

    const FACE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn air(density: f64, drag: f64, wind: DVec3) -> Environment {
        Environment {
            wind,
            air_density: density,
            air_drag: drag,
            ..Environment::default()
        }
    }

    #[test]
    fn normal_and_tangential_parts_follow_their_laws() {
        let environment = air(1.2, 0.4, DVec3::new(1.0, 0.0, -3.0));
        let force = air_force(&environment, 0.5, FACE, [DVec3::new(0.0, 2.0, -1.0); 3]);
        // Relative wind (1, -2, -2): through the face -2, along it (1, -2, 0).
        let expected = DVec3::new(0.4 * 0.5, 0.4 * 0.5 * -2.0, -1.2 * 0.5 * 4.0);
        assert!(force.distance(expected) < 1e-15);
    }

    #[test]
    fn side_of_the_face_does_not_matter() {
        let environment = air(1.0, 0.1, DVec3::new(0.3, 0.2, 4.0));
        let turned = [FACE[1], FACE[0], FACE[2]];
        let still = [DVec3::ZERO; 3];
        assert_eq!(
            air_force(&environment, 0.5, FACE, still),
            air_force(&environment, 0.5, turned, still)
        );
    }

    #[test]
    fn a_face_that_moves_with_the_air_feels_nothing() {
        let wind = DVec3::new(0.3, -0.2, 4.0);
        let force = air_force(&air(1.0, 1.0, wind), 0.5, FACE, [wind; 3]);
        assert!(force.length() < 1e-15);
        let degenerate = air_force(&air(1.0, 0.0, wind), 0.5, [DVec3::ZERO; 3], [DVec3::X; 3]);
        assert_eq!(degenerate, DVec3::ZERO);
    }
}
