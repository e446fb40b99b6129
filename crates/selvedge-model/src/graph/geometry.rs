//! Length of an edge and bending angle of a hinge with their gradients, in f64.
//!
//! The angle has the sign of the network's feature: positive for a ridge seen from the side of the
//! normals. A configuration in which a quantity is not differentiable (an edge or a face without
//! extent) has gradient 0.

use glam::DVec3;

/// Length of `d` `[m]` and its gradient d / |d|.
pub fn length_with_gradient(d: DVec3) -> (f64, DVec3) {
    let length = d.length();
    let gradient = if length > 0.0 { d / length } else { DVec3::ZERO };
    (length, gradient)
}

/// The bending angle `[rad]` of the hinge `[from, to, left, right]`, as the feature has it.
pub fn bending_angle(hinge: [DVec3; 4]) -> f64 {
    let [from, to, left, right] = hinge;
    let (along, to_right) = (to - from, right - from);
    let normal_left = along.cross(left - from);
    let sine = 0.0 - along.length() * normal_left.dot(to_right);
    sine.atan2(normal_left.dot(to_right.cross(along)))
}

/// The bending angle `[rad]` and its gradient `[rad/m]` with respect to the four points
/// `[eq:bending-angle-gradient]`: with e = to - from, n_l = e × (left - from),
/// n_r = (right - from) × e and the feet of the wings at the parts s_l, s_r of the edge,
/// ∂θ/∂left = g_l = -|e| n_l/|n_l|², ∂θ/∂right = g_r = -|e| n_r/|n_r|²,
/// ∂θ/∂to = -s_l g_l - s_r g_r, ∂θ/∂from = -(1 - s_l) g_l - (1 - s_r) g_r.
pub fn bending_angle_with_gradient(hinge: [DVec3; 4]) -> (f64, [DVec3; 4]) {
    let [from, to, left, right] = hinge;
    let along = to - from;
    let normal_left = along.cross(left - from);
    let normal_right = (right - from).cross(along);
    let (square_left, square_right) = (normal_left.length_squared(), normal_right.length_squared());
    if !(square_left.is_normal() && square_right.is_normal()) {
        return (bending_angle(hinge), [DVec3::ZERO; 4]);
    }
    let length_squared = along.length_squared();
    let length = length_squared.sqrt();
    let by_left = -length / square_left * normal_left;
    let by_right = -length / square_right * normal_right;
    let foot_left = (left - from).dot(along) / length_squared;
    let foot_right = (right - from).dot(along) / length_squared;
    let by_to = -(foot_left * by_left + foot_right * by_right);
    let by_from = -(by_left + by_right + by_to);
    (bending_angle(hinge), [by_from, by_to, by_left, by_right])
}

/// An angle difference wrapped into (-π, π], the shorter way round.
pub fn wrapped(difference: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if difference > PI {
        difference - TAU
    } else if difference <= -PI {
        difference + TAU
    } else {
        difference
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use selvedge_cloth::geometry::dihedral_angle;

    const STEP: f64 = 1e-6;

    fn point() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0, -1.0..1.0, -1.0..1.0_f64].prop_map(DVec3::from)
    }

    fn hinge() -> impl Strategy<Value = [DVec3; 4]> {
        [point(), point(), point(), point()]
    }

    /// The central difference of `value` at coordinate `axis` of point `k`.
    fn slope(
        mut points: [DVec3; 4],
        k: usize,
        axis: usize,
        value: impl Fn([DVec3; 4]) -> f64,
    ) -> f64 {
        let start = points[k][axis];
        points[k][axis] = start + STEP;
        let above = value(points);
        points[k][axis] = start - STEP;
        wrapped(above - value(points)) / (2.0 * STEP)
    }

    proptest! {
        #[test]
        fn the_gradient_of_the_angle_matches_finite_differences(points in hinge()) {
            let [from, to, left, right] = points;
            let along = (to - from).normalize_or_zero();
            let height = |p: DVec3| along.cross(p - from).length();
            // Curvature grows with 1/height²; keep the wings and the edge of order 1.
            prop_assume!(from.distance(to) > 0.3 && height(left) > 0.3 && height(right) > 0.3);
            let (angle, gradient) = bending_angle_with_gradient(points);
            prop_assert!((angle + dihedral_angle(from, to, left, right)).abs() < 1e-12);
            for (k, by_point) in gradient.iter().enumerate() {
                for (axis, found) in by_point.to_array().into_iter().enumerate() {
                    let expected = slope(points, k, axis, bending_angle);
                    // Third derivatives below 1e3 times STEP², and rounding 1e-16 / STEP.
                    prop_assert!((found - expected).abs() < 2e-8 * (1.0 + expected.abs()));
                }
            }
        }

        #[test]
        fn the_gradient_of_the_length_matches_finite_differences(d in point()) {
            prop_assume!(d.length() > 0.1);
            let (length, gradient) = length_with_gradient(d);
            prop_assert_eq!(length, d.length());
            for axis in 0..3 {
                let expected = slope([d; 4], 0, axis, |p| p[0].length());
                prop_assert!((gradient[axis] - expected).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn degenerate_hinges_and_edges_have_gradient_0() {
        let flat = [DVec3::ZERO, DVec3::Z, 0.5 * DVec3::Z, DVec3::X];
        assert_eq!(bending_angle_with_gradient(flat).1, [DVec3::ZERO; 4]);
        assert_eq!(
            bending_angle_with_gradient([DVec3::ONE; 4]),
            (0.0, [DVec3::ZERO; 4])
        );
        assert_eq!(length_with_gradient(DVec3::ZERO), (0.0, DVec3::ZERO));
    }

    #[test]
    fn angles_on_both_sides_of_a_full_fold_are_close() {
        assert!((wrapped(3.1 - -3.1) + std::f64::consts::TAU - 6.2).abs() < 1e-15);
        assert!((wrapped(-3.1 - 3.1) - std::f64::consts::TAU + 6.2).abs() < 1e-15);
        assert_eq!(wrapped(1.5), 1.5);
    }
}
