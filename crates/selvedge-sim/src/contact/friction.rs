//! Friction with an anchor: a damped spring along the surface that holds until it bears μ times
//! the normal force, and then is dragged along.

use glam::{DMat3, DVec3};

/// The force along a surface, linearised: at a further slip Δs it is `force` - `block` Δs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag {
    /// Force `[N]`.
    pub(super) force: DVec3,
    /// Symmetric, positive semidefinite `[N/m]`.
    pub(super) block: DMat3,
}

/// Part of an anchor's stiffness against a slip that is its spring's, and lasts; the rest is a
/// damper's, for one substep. With springs alone a house of cards sways at 1.9 mm/s for ever. With
/// a third it sways as little as with a half, but cloth that folds takes a tenth longer.
const LASTING: f64 = 0.5;

/// The part of `vector` across `normal`.
#[inline]
pub(super) fn along_surface(normal: DVec3, vector: DVec3) -> DVec3 {
    vector - normal * normal.dot(vector)
}

/// The force of an anchor that pulled by `pull` `[N]` and slips further by `slip` `[m]`, both
/// across `normal`: a spring and a damper, together of `stiffness` `[N/m]`, which bear at most
/// `most` `[N]`. `[eq:contact-friction]`
pub(super) fn drag(normal: DVec3, pull: DVec3, slip: DVec3, stiffness: f64, most: f64) -> Drag {
    let across = DMat3::IDENTITY - outer(normal, normal);
    let held = pull + slip * stiffness;
    let size = held.length();
    if size <= most {
        return Drag {
            force: -held,
            block: across * stiffness,
        };
    }
    let direction = held / size;
    Drag {
        force: direction * -most,
        block: (across - outer(direction, direction)) * (stiffness * most / size),
    }
}

/// The pull `[N]` that such an anchor leaves for the next substep: its spring's, which was dragged
/// along where it would bear more than `most` `[N]`.
pub(super) fn kept(pull: DVec3, slip: DVec3, stiffness: f64, most: f64) -> DVec3 {
    (pull + slip * (LASTING * stiffness)).clamp_length_max(most)
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
        let pull = along_surface(normal, DVec3::new(-4e-4, 6e-4, 1e-4));
        for most in [1.0, 1e-3] {
            let at = |slip: DVec3| drag(normal, pull, slip, 11.5, most);
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
        let left = pull + slip * (11.5 / 2.0);
        assert!(kept(pull, slip, 11.5, 1.0).distance(left) < 1e-18);
        assert!(kept(pull, slip, 11.5, 1e-4).distance(left.normalize() * 1e-4) < 1e-18);
    }
}
