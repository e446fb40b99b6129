//! Resistance to stretching, per face: force and Jacobian from a law's stress and tangent.
//!
//! With F = ∂x/∂(u, v) (columns f_u, f_v), G = (FᵀF - I)/2 and the shape derivatives d_u, d_v of
//! the three corners, the force is that of the second Piola-Kirchhoff stress S(G). The Jacobian has
//! two parts: the tangent of the law, and the stress that turns with the cloth, of which only a
//! positive semidefinite part counts. The laws are [`crate::laws::stretch_energy`] and
//! [`crate::laws::stretch_table`].

use glam::DVec2;
use selvedge_cloth::geometry::signed_area_2d;

use crate::laws::number::{Number, Vector};

/// Green strain G of a face in material axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain<N = f64> {
    /// G00, along the course axis u.
    pub uu: N,
    /// G11, along the wale axis v.
    pub vv: N,
    /// G01, half the shear.
    pub uv: N,
}

/// A law of stretching.
pub trait StretchLaw<N = f64> {
    /// Stress and tangent at `strain`. `stiffening` asks a law whose tangent is not exact for one
    /// that knows how the stiffness grows with strain.
    fn at(&self, strain: Strain<N>, stiffening: bool) -> Elastic<N>;
}

/// A law's answer at one strain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elastic<N = f64> {
    /// S00, S11 and S01 `[N/m]`. Where there is an energy, ∂W/∂G00, ∂W/∂G11 and half of ∂W/∂G01.
    pub stress: Strain<N>,
    /// ∂(S00, S11, 2 S01)/∂(G00, G11, G01) `[N/m]`, symmetric: its entries 00, 01, 11, 22, 02, 12.
    pub tangent: [N; 6],
    /// The part of the stress that counts in the Jacobian: T00, T11, T01 `[N/m]`, positive
    /// semidefinite.
    pub tension: [N; 3],
}

/// A face's rest shape, which turns corner positions into a deformation gradient.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StretchElement<N = f64> {
    /// ∂x/∂u = Σ shape_u\[a\] x_a `[1/m]`.
    pub shape_u: [N; 3],
    /// ∂x/∂v = Σ shape_v\[a\] x_a `[1/m]`.
    pub shape_v: [N; 3],
    /// Area in material space `[m²]`.
    pub area: N,
}

/// Force and Jacobian of one face at one configuration.
#[derive(Clone, Copy)]
pub struct StretchResponse<N: Number = f64> {
    pub(crate) element: StretchElement<N>,
    pub(crate) along_u: N::Vector,
    pub(crate) along_v: N::Vector,
    pub(crate) elastic: Elastic<N>,
}

impl StretchElement {
    /// The element of a face with these corners in material space `[m]`; any order of the corners.
    pub fn new(corners: [DVec2; 3]) -> Self {
        let [a, b, c] = corners;
        let (first, second) = (b - a, c - a);
        let determinant = first.perp_dot(second);
        let u = [second.y / determinant, -first.y / determinant];
        let v = [-second.x / determinant, first.x / determinant];
        Self {
            shape_u: [-(u[0] + u[1]), u[0], u[1]],
            shape_v: [-(v[0] + v[1]), v[0], v[1]],
            area: signed_area_2d(a, b, c).abs(),
        }
    }
}

impl<N: Number> StretchElement<N> {
    /// The element of these numbers: the last two corners' shapes by u and by v, and the area.
    #[inline(always)]
    pub(crate) fn of([u1, u2, v1, v2, area]: [N; 5]) -> Self {
        Self {
            shape_u: [-(u1 + u2), u1, u2],
            shape_v: [-(v1 + v2), v1, v2],
            area,
        }
    }

    /// The inverse of [`Self::of`].
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [N; 5] {
        let ([_, u1, u2], [_, v1, v2]) = (self.shape_u, self.shape_v);
        [u1, u2, v1, v2, self.area]
    }

    /// Columns f_u = ∂x/∂u and f_v = ∂x/∂v of the deformation gradient.
    #[inline(always)]
    pub fn gradient(&self, corners: [N::Vector; 3]) -> (N::Vector, N::Vector) {
        let [a, b, c] = corners;
        let (first, second) = (b - a, c - a);
        (
            first * self.shape_u[1] + second * self.shape_u[2],
            first * self.shape_v[1] + second * self.shape_v[2],
        )
    }

    /// Green strain of corners at these positions `[m]`: G = (FᵀF - I)/2. `[eq:green-strain]`
    #[inline(always)]
    pub fn strain(&self, corners: [N::Vector; 3]) -> Strain<N> {
        let (along_u, along_v) = self.gradient(corners);
        green_strain(along_u, along_v)
    }

    /// Force and Jacobian at these corner positions `[m]`, as [`StretchLaw::at`] has them.
    #[inline(always)]
    pub fn respond(
        &self,
        law: &impl StretchLaw<N>,
        stiffening: bool,
        corners: [N::Vector; 3],
    ) -> StretchResponse<N> {
        let (along_u, along_v) = self.gradient(corners);
        StretchResponse {
            element: *self,
            along_u,
            along_v,
            elastic: law.at(green_strain(along_u, along_v), stiffening),
        }
    }
}

#[inline(always)]
fn green_strain<N: Number>(along_u: N::Vector, along_v: N::Vector) -> Strain<N> {
    Strain {
        uu: (along_u.dot(along_u) - 1.0) * 0.5,
        vv: (along_v.dot(along_v) - 1.0) * 0.5,
        uv: along_u.dot(along_v) * 0.5,
    }
}

impl<N: Number> StretchResponse<N> {
    /// The response of an element with these numbers.
    #[inline(always)]
    pub(crate) fn of(element: StretchElement<N>, numbers: [N; 18]) -> Self {
        let [ux, uy, uz, vx, vy, vz, s0, s1, s2, rest @ ..] = numbers;
        let [k0, k1, k2, k3, k4, k5, t0, t1, t2] = rest;
        Self {
            element,
            along_u: N::Vector::of([ux, uy, uz]),
            along_v: N::Vector::of([vx, vy, vz]),
            elastic: Elastic {
                stress: Strain {
                    uu: s0,
                    vv: s1,
                    uv: s2,
                },
                tangent: [k0, k1, k2, k3, k4, k5],
                tension: [t0, t1, t2],
            },
        }
    }

    /// The inverse of [`Self::of`], but for the element.
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [N; 18] {
        let [ux, uy, uz] = self.along_u.components();
        let [vx, vy, vz] = self.along_v.components();
        let Elastic {
            stress: Strain { uu, vv, uv },
            tangent: [k0, k1, k2, k3, k4, k5],
            tension: [t0, t1, t2],
        } = self.elastic;
        [
            ux, uy, uz, vx, vy, vz, uu, vv, uv, k0, k1, k2, k3, k4, k5, t0, t1, t2,
        ]
    }

    /// Force on the three corners `[N]`: F = -a [S00 g_uu + S11 g_vv + 2 S01 g_uv] with
    /// g_uu = d_u ⊗ f_u, g_vv = d_v ⊗ f_v, g_uv = (d_u ⊗ f_v + d_v ⊗ f_u)/2. `[eq:stretch-force]`
    #[inline(always)]
    pub fn force(&self) -> [N::Vector; 3] {
        let (stress, area) = (self.elastic.stress, self.element.area);
        let by_u = (self.along_u * stress.uu + self.along_v * stress.uv) * -area;
        let by_v = (self.along_v * stress.vv + self.along_u * stress.uv) * -area;
        self.spread(by_u, by_v)
    }

    /// -J applied to one vector per corner.
    #[inline(always)]
    pub fn negative_jacobian_times(&self, vectors: [N::Vector; 3]) -> [N::Vector; 3] {
        let element = &self.element;
        let [a, b, c] = vectors;
        let (first, second) = (b - a, c - a);
        let rate_u = first * element.shape_u[1] + second * element.shape_u[2];
        let rate_v = first * element.shape_v[1] + second * element.shape_v[2];
        let [k0, k1, k2, k3, u3, v3] = self.elastic.tangent;
        let (uu, vv) = (self.along_u.dot(rate_u), self.along_v.dot(rate_v));
        let uv = self.along_v.dot(rate_u) + self.along_u.dot(rate_v);
        let shear = k3 * 0.25 * uv + (u3 * uu + v3 * vv) * 0.5;
        let [t0, t1, t2] = self.elastic.tension;
        let by_u = self.along_u * (k0 * uu + k1 * vv + u3 * 0.5 * uv)
            + self.along_v * shear
            + rate_u * t0
            + rate_v * t2;
        let by_v = self.along_v * (k2 * vv + k1 * uu + v3 * 0.5 * uv)
            + self.along_u * shear
            + rate_v * t1
            + rate_u * t2;
        self.spread(by_u * element.area, by_v * element.area)
    }

    #[inline(always)]
    fn spread(&self, by_u: N::Vector, by_v: N::Vector) -> [N::Vector; 3] {
        let element = &self.element;
        let ([u0, u1, u2], [v0, v1, v2]) = (element.shape_u, element.shape_v);
        [
            by_u * u0 + by_v * v0,
            by_u * u1 + by_v * v1,
            by_u * u2 + by_v * v2,
        ]
    }

    /// Columns of block (`row`, `column`) of the negative Jacobian `[N/m]`: with the tangent H and
    /// g = (g_uu, g_vv, g_uv),
    /// -J = a [Σ H_ij g_i g_jᵀ + (T00 d_u d_uᵀ + T11 d_v d_vᵀ + T01 (d_u d_vᵀ + d_v d_uᵀ)) ⊗ I].
    /// `[eq:stretch-jacobian]`
    #[inline(always)]
    pub fn negative_jacobian(&self, row: usize, column: usize) -> [N::Vector; 3] {
        let element = &self.element;
        let ([k0, k1, k2, k3, u3, v3], area) = (self.elastic.tangent, element.area);
        let (k0, k1, k2) = (k0 * area, k1 * area, k2 * area);
        let (shear, u3, v3) = (k3 * area * 0.25, u3 * area * 0.5, v3 * area * 0.5);
        let (row_u, row_v) = (element.shape_u[row], element.shape_v[row]);
        let (column_u, column_v) = (element.shape_u[column], element.shape_v[column]);
        let (uu, vv) = (row_u * column_u, row_v * column_v);
        let (uv, vu) = (row_u * column_v, row_v * column_u);
        // Left factor of f_uᵀ and of f_vᵀ.
        let left_u = self.along_u * (k0 * uu + shear * vv + u3 * (uv + vu))
            + self.along_v * (k1 * vu + shear * uv + (u3 * uu + v3 * vv));
        let left_v = self.along_u * (k1 * uv + shear * vu + (u3 * uu + v3 * vv))
            + self.along_v * (k2 * vv + shear * uu + v3 * (uv + vu));
        let [t0, t1, t2] = self.elastic.tension;
        let diagonal = element.area * (t0 * uu + t1 * vv + t2 * (uv + vu));
        let zero = diagonal.same(0.0);
        let ([ux, uy, uz], [vx, vy, vz]) = (self.along_u.components(), self.along_v.components());
        [
            left_u * ux + left_v * vx + N::Vector::of([diagonal, zero, zero]),
            left_u * uy + left_v * vy + N::Vector::of([zero, diagonal, zero]),
            left_u * uz + left_v * vz + N::Vector::of([zero, zero, diagonal]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};
    use selvedge_cloth::StretchTable;

    use super::*;
    use crate::laws::stretch_table::GridStiffness;

    const STIFFNESS: [f64; 4] = [50.0, 20.0, 90.0, 35.0];

    /// The measured law where it does not depend on strain.
    fn law() -> GridStiffness {
        GridStiffness::new(StretchTable([STIFFNESS.map(|k| 0.5 * k); 6]))
    }

    const REST: [DVec2; 3] = [
        DVec2::new(0.1, 0.2),
        DVec2::new(0.5, 0.1),
        DVec2::new(0.3, 0.6),
    ];

    fn block(response: &StretchResponse, row: usize, column: usize) -> DMat3 {
        let [x, y, z] = response.negative_jacobian(row, column);
        DMat3::from_cols(x, y, z)
    }

    fn deformed() -> [DVec3; 3] {
        [
            DVec3::new(0.1, -0.2, 0.3),
            DVec3::new(0.2, 0.35, 0.25),
            DVec3::new(-0.2, 0.1, 0.6),
        ]
    }

    #[test]
    fn corners_that_are_nowhere_have_no_finite_force_and_do_not_panic() {
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            let mut corners = deformed();
            corners[1] = DVec3::new(value, -value, value);
            let response = StretchElement::new(REST).respond(&law(), true, corners);
            assert!(response.force().iter().any(|force| !force.is_finite()));
        }
    }

    #[test]
    fn jacobian_is_symmetric_and_positive_semidefinite() {
        let element = StretchElement::new(REST);
        let response = element.respond(&law(), false, deformed());
        for (row, column) in [(0, 0), (0, 1), (1, 2), (2, 2)] {
            let difference =
                block(&response, row, column) - block(&response, column, row).transpose();
            assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-12));
        }
        for k in 0..50 {
            let t = f64::from(k);
            let direction = [0.0, 1.0, 2.0]
                .map(|c| DVec3::new((t + c).sin(), (2.0 * t + c).cos(), (3.0 * t - c * t).sin()));
            let answer = response.negative_jacobian_times(direction);
            let form: f64 = answer.iter().zip(direction).map(|(a, d)| a.dot(d)).sum();
            assert!(form >= -1e-12);
        }
    }
}
