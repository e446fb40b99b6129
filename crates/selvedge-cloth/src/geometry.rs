//! Areas, normals and the signed dihedral angle, each for one element.

use glam::{DQuat, DVec2, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// A number in [0, 1), the same on every machine.
pub(crate) fn unit(rng: &mut ChaCha8Rng) -> f64 {
    const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * SCALE
}

/// Signed area of a triangle in material space `[m²]`; positive when counter-clockwise.
#[inline]
pub fn signed_area_2d(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    0.5 * (b - a).perp_dot(c - a)
}

/// Area vector of a triangle: unit normal times area `[m²]`.
#[inline]
pub fn area_vector(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    0.5 * (b - a).cross(c - a)
}

/// Least and greatest corner of the box around `points`; the origin where there are none.
pub fn bounds(points: &[DVec3]) -> [DVec3; 2] {
    let first = points.first().copied().unwrap_or_default();
    let corners = [first, first];
    points
        .iter()
        .fold(corners, |[low, high], p| [low.min(*p), high.max(*p)])
}

/// Sides of the box around `points`.
pub fn extent(points: &[DVec3]) -> DVec3 {
    let [low, high] = bounds(points);
    high - low
}

/// Returns true where a triangle has no area to speak of by its sides.
#[inline]
pub fn is_without_area([a, b, c]: [DVec3; 3]) -> bool {
    let (along, across) = (b - a, c - a);
    let area = along.cross(across).length();
    area <= 1e-12 * along.length_squared().max(across.length_squared())
}

/// Signed dihedral angle at the edge `from` → `to` `[rad]`, in [-π, π].
///
/// 0 where the two faces are flat, ±π where they fold onto each other. `left` is the opposite
/// vertex of the face in which `from` → `to` runs counter-clockwise, `right` that of the other.
/// Positive where the wings rise towards the normals (a valley seen from the side of the normals),
/// θ = atan2(n_left × n_right · ê, n_left · n_right) with the sign so chosen. `[eq:dihedral]`
/// Angle: Bridson, Marino and Fedkiw 2003; sign: Narain et al. 2012.
/// Swapping the faces together with the edge's direction leaves it unchanged, as does any rigid
/// motion. 0 for a degenerate face, and also where an argument is not finite: an angle is no sign
/// of a lost cloth, so positions are checked where they are made.
#[inline]
pub fn dihedral_angle(from: DVec3, to: DVec3, left: DVec3, right: DVec3) -> f64 {
    let along = to - from;
    let normal_left = along.cross(left - from);
    let normal_right = (right - from).cross(along);
    // sin θ · |n_l||n_r| = -(n_l × n_r) · ê, for wings that rise towards the normals.
    let sine = -normal_left.cross(normal_right).dot(along) / along.length();
    let cosine = normal_left.dot(normal_right);
    if sine.is_finite() && (sine != 0.0 || cosine != 0.0) { atan2(sine, cosine) } else { 0.0 }
}

/// Sine and cosine of `angle` `[rad]`, with the same bits on every system. A system's own differ in
/// the last one, and what stands there at the start decides where folds fall.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    libm::sincos(angle)
}

/// The angle of the direction (`cosine`, `sine`) `[rad]`, with the same bits on every system.
pub fn atan2(sine: f64, cosine: f64) -> f64 {
    libm::atan2(sine, cosine)
}

/// The turn by `angle` `[rad]` about `axis`, of length 1, with the same bits on every system.
pub fn turn(axis: DVec3, angle: f64) -> DQuat {
    let (sine, cosine) = sin_cos(0.5 * angle);
    let v = axis * sine;
    DQuat::from_xyzw(v.x, v.y, v.z, cosine)
}

/// e to the power of `x`, with the same bits on every system.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// The rotation at this `part` of the way from one to another, the short way round, with the same bits
/// on every system.
pub fn slerp(from: DQuat, to: DQuat, part: f64) -> DQuat {
    let dot = from.dot(to);
    let to = if dot < 0.0 { -to } else { to };
    let sine = (1.0 - dot * dot).max(0.0).sqrt();
    if sine < 1e-7 {
        return from.lerp(to, part);
    }
    let angle = atan2(sine, dot.abs());
    let [left, right] = [1.0 - part, part].map(|part| sin_cos(part * angle).0 / sine);
    (from * left + to * right).normalize()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;

    /// Two wings on the edge 0 → y, each raised by `angle / 2` from the plane z = 0 towards +z.
    fn folded(angle: f64, left_size: f64, right_size: f64) -> [DVec3; 4] {
        let (sin, cos) = (angle / 2.0).sin_cos();
        [
            DVec3::ZERO,
            DVec3::Y * 1.3,
            DVec3::new(-left_size * cos, 0.4, left_size * sin),
            DVec3::new(right_size * cos, 0.9, right_size * sin),
        ]
    }

    fn dihedral(p: [DVec3; 4]) -> f64 {
        dihedral_angle(p[0], p[1], p[2], p[3])
    }

    #[test]
    fn rotations_are_passed_at_an_even_rate_the_short_way_round() {
        let [from, to] = [0.3, 2.1].map(|angle| turn(DVec3::Y, angle));
        for (part, to) in [(0.0, to), (0.25, to), (0.6, -to), (1.0, to)] {
            let found = slerp(from, to, part);
            assert!(found.angle_between(turn(DVec3::Y, 0.3 + 1.8 * part)) < 1e-7);
            assert!((found.length() - 1.0).abs() < 1e-15);
        }
        assert_eq!(slerp(to, to, 0.5), to);
    }

    #[test]
    fn triangles_have_their_areas() {
        let (a, b, c) = (DVec2::ZERO, DVec2::X * 2.0, DVec2::Y * 3.0);
        assert_eq!(signed_area_2d(a, b, c), 3.0);
        assert_eq!(signed_area_2d(a, c, b), -3.0);
        let [a, b, c] = [a, b, c].map(|p| p.extend(7.0));
        assert_eq!(area_vector(a, b, c), DVec3::Z * 3.0);
    }

    #[test]
    fn a_folded_pair_has_its_angle() {
        // Both wings turn by θ/2 about the edge, so that the normals differ by θ: positive where
        // the wings rise to the side of the normals (+z).
        for degrees in [
            -179.0_f64, -90.0, -1.0, -1e-7, 0.0, 1e-7, 1.0, 60.0, 90.0, 179.0,
        ] {
            let angle = degrees.to_radians();
            let found = dihedral(folded(angle, 0.7, 1.9));
            // The rounding of the points (1e-16 of 2 m) over the smaller height, 0.7 m.
            assert!((found - angle).abs() < 1e-15, "{degrees}°: {found}");
        }
        assert!((dihedral(folded(PI, 0.7, 1.9)).abs() - PI).abs() < 1e-15);
    }

    #[test]
    fn faces_that_are_degenerate_or_not_finite_are_flat() {
        let p = folded(1.0, 0.7, 1.9);
        for [a, b, c, d] in [
            [p[0], p[0], p[2], p[3]],
            [p[0], p[1], p[1], p[3]],
            [p[0], p[1], p[2], p[0]],
            [p[0], p[1], p[2], DVec3::NAN],
            [p[0], p[1], p[2], DVec3::INFINITY],
        ] {
            assert_eq!(dihedral_angle(a, b, c, d), 0.0, "{a} {b} {c} {d}");
        }
    }

    proptest! {
        #[test]
        fn the_dihedral_angle_does_not_depend_on_the_view(
            angle in -3.0..3.0_f64,
            axis in prop::array::uniform3(-1.0..1.0_f64),
            turn in -3.0..3.0_f64,
            shift in prop::array::uniform3(-5.0..5.0_f64),
        ) {
            let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
            let rotation = DQuat::from_axis_angle(axis, turn);
            let p = folded(angle, 0.7, 1.9);
            let moved = p.map(|p| rotation * p + DVec3::from_array(shift));
            // Coordinates of up to 11 m are rounded to 1e-15, over a height of 0.7 m; a few of
            // them.
            prop_assert!((dihedral(moved) - angle).abs() < 2e-14);
            // The other face first: the edge runs the other way in it. The same numbers with other
            // signs.
            let swapped = dihedral_angle(p[1], p[0], p[3], p[2]);
            prop_assert!((swapped - angle).abs() < 1e-14);
            // A mirror turns a valley into a ridge: both wings' orientation flips, and so do left
            // and right.
            let [from, to, left, right] = p.map(|p| p * DVec3::new(1.0, 1.0, -1.0));
            prop_assert!((dihedral_angle(from, to, left, right) + angle).abs() < 1e-14);
        }
    }
}
