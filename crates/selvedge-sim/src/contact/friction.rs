//! Friction with an anchor: a spring along the surface that holds until it reaches μ times the
//! normal force, and then is dragged along.

use glam::{DMat3, DVec3};

/// The force along a surface, linearised: at a further slip Δs it is `force` - `block` Δs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag {
    /// Force `[N]`.
    pub(super) force: DVec3,
    /// Symmetric, positive semidefinite `[N/m]`.
    pub(super) block: DMat3,
}

impl Drag {
    /// The same at this further slip `[m]`.
    pub(super) fn moved_by(self, slip: DVec3) -> Self {
        Self {
            force: self.force - self.block * slip,
            ..self
        }
    }
}

/// The part of `vector` across `normal`.
#[inline]
pub(super) fn along_surface(normal: DVec3, vector: DVec3) -> DVec3 {
    vector - normal * normal.dot(vector)
}

/// The force of an anchor that has slipped by `slip` `[m]`, across `normal`, on a spring of
/// `stiffness` `[N/m]` that bears at most `most` `[N]`. `[eq:contact-friction]`
pub(super) fn drag(normal: DVec3, slip: DVec3, stiffness: f64, most: f64) -> Drag {
    let across = DMat3::IDENTITY - outer(normal, normal);
    let length = slip.length();
    if stiffness * length <= most {
        return Drag {
            force: slip * -stiffness,
            block: across * stiffness,
        };
    }
    let direction = slip / length;
    Drag {
        force: direction * -most,
        block: (across - outer(direction, direction)) * (most / length),
    }
}

/// The slip that is left of an anchor once its spring bears at most `most` `[N]`.
pub(super) fn kept(slip: DVec3, stiffness: f64, most: f64) -> DVec3 {
    let pull = stiffness * slip.length();
    if pull <= most { slip } else { slip * (most / pull) }
}

/// a bᵀ.
#[inline]
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_block_is_the_derivative_of_the_force() {
        let normal = DVec3::new(0.3, 0.9, -0.2).normalize();
        let slip = along_surface(normal, DVec3::new(2e-4, 1e-4, -3e-4));
        for most in [1.0, 1e-3] {
            let at = |slip: DVec3| drag(normal, slip, 11.5, most);
            for direction in [DVec3::X, DVec3::Y, DVec3::Z] {
                let step = along_surface(normal, direction) * 1e-9;
                let change = (at(slip + step).force - at(slip - step).force) / 2e-9;
                let expected = -(at(slip).block * direction);
                assert!(
                    change.distance(expected) < 1e-5 * 11.5,
                    "{change} {expected}"
                );
            }
            assert!(at(slip).force.length() <= most);
            assert!(at(slip).force.dot(normal).abs() < 1e-15);
        }
        assert!((kept(slip, 11.5, 1e-3) * 11.5).length() <= 1e-3 + 1e-15);
        assert_eq!(kept(slip, 11.5, 1.0), slip);
    }
}
