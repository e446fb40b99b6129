//! The force of the air (Narain et al. 2012), and its resistance to a change of velocity.
//!
//! Air acts on each face with its material area and its current unit normal; a third goes to each
//! corner. With the current area, ARCSim's substeps are not met.

use glam::{DMat3, DVec3};
use selvedge_cloth::{AirLaw, Environment};

use crate::laws::number::{Number, Vector};

/// The air's resistance to a change of a face's velocity, in the matrix of an implicit step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag<N: Number = f64> {
    /// Unit normal of the face.
    pub normal: N::Vector,
    /// Resistance along the normal, and across it, to the mean velocity of the corners `[N s/m]`.
    pub resistance: [N; 2],
}

/// Speed below which the drag of a swaying sheet is no longer a square `[m/s]`.
const SLOW_AIR: f64 = 0.05;

/// Drag of the air on a sheet that hardly moves `[kg/(m² s)]`, along and across it: density · 0.05.
///
/// The drag of [`air_response`] is a square: with it alone a sway of a few mm/s lives for minutes.
/// The air's own is not a square at such speeds. The drag coefficient of an oscillating plate grows
/// as its sway becomes small (8 KC^(-1/3), Graham 1980), and friction on both sides is linear
/// (Stokes). Together they are 0.04 to 0.2 kg/(m² s) from 0.5 to 10 mm/s at 1 to 3 Hz.
/// `[eq:slow-air]`
#[inline(always)]
pub fn slow_air(density: f64) -> f64 {
    density * SLOW_AIR
}

/// Part of the air's force that a step takes at its end, to first order in the change of velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AirResistance {
    /// None: the force is ARCSim's, of the velocities given, and no more.
    #[default]
    None,
    /// D with F = D v_rel, |v_n| held. Its power in still air, -v·D v, is never positive.
    Secant,
    /// D = -∂F/∂v.
    Tangent,
}

impl From<AirLaw> for AirResistance {
    fn from(law: AirLaw) -> Self {
        match law {
            AirLaw::Explicit => Self::None,
            AirLaw::Implicit => Self::Secant,
        }
    }
}

/// Force `[N]` and resistance of the air on a face of material `area` `[m²]`, its corners at `positions`
/// `[m]` with `velocities` `[m/s]`.
///
/// v_rel = wind - mean corner velocity, n the unit normal, v_n = n·v_rel, v_t = v_rel - v_n n:
/// F = density · area · |v_n| v_n n + drag · area · v_t. `[eq:air-drag]`
///
/// With a resistance the force of [`slow_air`] is added, and
/// D = c · density · area · |v_n| n nᵀ + drag · area · (I - n nᵀ) + slow · area · I, c = 1 for
/// [`AirResistance::Secant`] and 2 for [`AirResistance::Tangent`]. The force on the face after the
/// step is F - D Δv, Δv the change of the mean corner velocity. `[eq:air-implicit]`
#[inline(always)]
pub fn air_response<N: Number>(
    environment: &Environment,
    resistance: AirResistance,
    area: N,
    positions: [N::Vector; 3],
    velocities: [N::Vector; 3],
) -> (N::Vector, Drag<N>) {
    let [a, b, c] = positions;
    let zero = area.same(0.0);
    let twice_area = (b - a).cross(c - a);
    let length = twice_area.dot(twice_area).sqrt();
    let one_over = N::pick(zero.below(length), area.same(1.0) / length, zero);
    let normal = twice_area * one_over;
    let [first, second, third] = velocities;
    let [x, y, z] = environment.wind.to_array();
    let wind = N::Vector::of([area.same(x), area.same(y), area.same(z)]);
    let relative = wind - (first + second + third) / area.same(3.0);
    let through = normal.dot(relative);
    let tangential = relative - normal * through;
    let force = normal * (area * environment.air_density * through.abs() * through)
        + tangential * (area * environment.air_drag);
    let factor = match resistance {
        AirResistance::None => {
            let resistance = [zero; 2];
            return (force, Drag { normal, resistance });
        }
        AirResistance::Secant => 1.0,
        AirResistance::Tangent => 2.0,
    };
    let slow = slow_air(environment.air_density);
    let through = through.abs() * (factor * environment.air_density);
    let resistance = [
        (through + slow) * area,
        area * (environment.air_drag + slow),
    ];
    let force = force + relative * (area * slow);
    (force, Drag { normal, resistance })
}

impl<N: Number> Drag<N> {
    /// The drag of these numbers.
    #[inline(always)]
    pub(crate) fn of([x, y, z, through, along]: [N; 5]) -> Self {
        Self {
            normal: N::Vector::of([x, y, z]),
            resistance: [through, along],
        }
    }

    /// The inverse of [`Self::of`].
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [N; 5] {
        let ([x, y, z], [through, along]) = (self.normal.components(), self.resistance);
        [x, y, z, through, along]
    }

    /// D times `velocity`, a change of the mean corner velocity `[m/s]`.
    #[inline(always)]
    pub fn resist(&self, velocity: N::Vector) -> N::Vector {
        let [through, along] = self.resistance;
        let normal = self.normal * self.normal.dot(velocity);
        normal * through + (velocity - normal) * along
    }
}

impl Drag {
    /// D times `scale`, as a matrix.
    #[inline(always)]
    pub(crate) fn matrix(&self, scale: f64) -> DMat3 {
        let column = |axis: DVec3| self.resist(axis) * scale;
        DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn air_force(
        environment: &Environment,
        area: f64,
        positions: [DVec3; 3],
        velocities: [DVec3; 3],
    ) -> DVec3 {
        air_response(
            environment,
            AirResistance::None,
            area,
            positions,
            velocities,
        )
        .0
    }

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
    fn resistance_takes_power_from_whatever_moves() {
        let environment = air(1.2, 0.4, DVec3::ZERO);
        let velocities = [
            DVec3::new(1.0, -2.0, 30.0),
            DVec3::new(0.0, 5.0, 40.0),
            DVec3::Z,
        ];
        let (force, drag) =
            air_response(&environment, AirResistance::Secant, 0.5, FACE, velocities);
        let mean = (velocities[0] + velocities[1] + velocities[2]) / 3.0;
        // In still air the force is the resistance to all of the velocity.
        assert!(force.distance(-drag.resist(mean)) < 1e-12 * force.length());
        for velocity in [DVec3::X, DVec3::NEG_Z, DVec3::new(1.0, -3.0, 0.2)] {
            assert!(velocity.dot(drag.resist(velocity)) > 0.0);
        }
        let (explicit, none) =
            air_response(&environment, AirResistance::None, 0.5, FACE, velocities);
        let slow = mean * (slow_air(1.2) * 0.5);
        assert!(explicit.distance(force + slow) < 1e-12);
        assert_eq!(none.resist(DVec3::ONE), DVec3::ZERO);
    }

    #[test]
    fn tangent_resistance_is_the_derivative_of_the_force() {
        let environment = air(1.2, 0.4, DVec3::new(0.5, -2.0, 3.0));
        let corners = [DVec3::ZERO, DVec3::new(1.0, 0.2, 0.1), DVec3::Y];
        let velocities = [
            DVec3::new(1.0, -2.0, 3.5),
            DVec3::new(0.0, 5.0, -4.0),
            DVec3::Z,
        ];
        let tangent = AirResistance::Tangent;
        let (_, drag) = air_response(&environment, tangent, 0.5, corners, velocities);
        let step = 1e-5;
        for axis in DVec3::AXES {
            let at = |sign: f64| {
                let moved = velocities.map(|v| v + axis * (sign * step));
                air_response(&environment, tangent, 0.5, corners, moved).0
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
            // The force is a square of the velocity: central differences are exact up to rounding.
            assert!(slope.distance(-drag.resist(axis)) < 1e-9, "{axis}");
        }
    }

    #[test]
    fn a_face_without_area_feels_nothing() {
        let wind = DVec3::new(0.3, -0.2, 4.0);
        let degenerate = air_force(&air(1.0, 0.0, wind), 0.5, [DVec3::ZERO; 3], [DVec3::X; 3]);
        assert_eq!(degenerate, DVec3::ZERO);
    }
}
