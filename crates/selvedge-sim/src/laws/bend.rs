//! Resistance to bending, per interior edge, of the data-driven model of Wang, O'Brien and
//! Ramamoorthi 2011 as ARCSim integrates it.
//!
//! The four corners of an edge are its ends 0 → 1 (counter-clockwise in the left face), the
//! opposite vertex of the left face, and that of the right face. The angle θ is positive if the
//! wings rise towards the normals; θ₀ is the rest angle. With [`ElasticLaw::Energy`] the force is the
//! gradient of an energy of θ alone; the other laws read the edge's length now, and hold stiffness
//! and length constant when differentiating. Degenerate faces (height below 10⁻³ of the edge) count as if they
//! had that height.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use selvedge_cloth::geometry::{atan2, dihedral_angle};
use selvedge_cloth::{BendTable, EdgeSide, ElasticLaw, FaceId};

use crate::laws::number::{Dual, DualVector, Number, Vector, direction};

/// An interior edge's rest shape and its row of the material's table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BendElement<N = f64> {
    /// Bending stiffness at curvatures 0 to 4 for this edge's direction `[N·m]`.
    stiffness: [N; 5],
    /// Material area of the two faces together `[m²]`.
    area: N,
    /// Length of the edge in the pattern `[m]`.
    length: N,
    /// Angle without torque θ₀ `[rad]`.
    rest_angle: N,
}

/// Force and Jacobian of one edge at one configuration.
#[derive(Clone, Copy, Debug)]
pub struct BendResponse<N: Number = f64> {
    /// ∂θ/∂x of the four corners `[1/m]`.
    pub gradient: [N::Vector; 4],
    /// Signed dihedral angle beyond the rest angle, θ - θ₀ `[rad]`.
    pub angle: N,
    /// Stiffness of the hinge, coeff/2 = ke l²/(4 (a_A + a_B)) `[N·m]`: the torque over the angle.
    pub stiffness: N,
    /// The torque's derivative by the angle `[N·m]`, never negative. Laws without an energy hold
    /// the stiffness constant.
    pub tangent: N,
}

/// Columns of the bending table.
const COLUMNS: usize = 5;

impl BendElement {
    /// The element of an edge with these corners in material space `[m]`.
    ///
    /// Rows of the table are read at the edge's direction, folded into 0 to 90° from the course
    /// axis and linear between 0, 45 and 90°. `[eq:bend-direction]`
    pub fn new(table: &BendTable, corners: [DVec2; 4]) -> Self {
        let [from, to, left, right] = corners;
        let side = |opposite| {
            let (face, ends) = (FaceId(0), [from, to]);
            let side = EdgeSide {
                face,
                ends,
                opposite,
            };
            (table, side)
        };
        Self::across([side(left), side(right)])
    }

    /// The element of an edge that its two faces see in patterns or fabrics of their own, each with
    /// the table of its fabric: its stiffness is the mean of the two sides', each read in its own
    /// direction. `[eq:seam-bending]`
    pub fn across(sides: [(&BendTable, EdgeSide<DVec2>); 2]) -> Self {
        let along = |side: EdgeSide<DVec2>| side.ends[1] - side.ends[0];
        let [left, right] = sides.map(|(table, side)| stiffness_along(table, along(side)));
        let lengths = sides.map(|(_, side)| along(side).length());
        Self {
            stiffness: std::array::from_fn(|column| 0.5 * (left[column] + right[column])),
            area: sides[0].1.area() + sides[1].1.area(),
            length: 0.5 * (lengths[0] + lengths[1]),
            rest_angle: 0.0,
        }
    }

    /// The same element with this rest angle `[rad]`. `[eq:rest-angle]`
    pub fn resting_at(self, rest_angle: f64) -> Self {
        Self { rest_angle, ..self }
    }

    /// The same element, `factor` times as stiff.
    pub fn stiffened(mut self, factor: f64) -> Self {
        self.stiffness.iter_mut().for_each(|k| *k *= factor);
        self
    }

    /// Bending stiffness ke `[N·m]` at a dimensionless curvature: linear between columns ⌊value⌋
    /// (0 to 3) and the next, value at most 4, never negative. Below 0 the first columns are
    /// extrapolated. `[eq:bend-table]`
    #[inline(always)]
    pub fn stiffness_at(&self, curvature: f64) -> f64 {
        let value = curvature.at_most((COLUMNS - 1) as f64);
        let low = (value.at_least(0.0) as usize).min(COLUMNS - 2);
        let between = value - low as f64;
        ((1.0 - between) * self.stiffness[low] + between * self.stiffness[low + 1]).at_least(0.0)
    }

    /// Force and Jacobian at these corner positions `[m]`.
    ///
    /// coeff = ke l²/(2 (a_A + a_B)), ke read at 0.1 |θ - θ₀| l/(a_A + a_B), l the edge's length in
    /// the pattern. [`ElasticLaw::Measured`] takes the length now, and so does
    /// [`ElasticLaw::Arcsim`], which reads ke at θ - θ₀ whatever its sign. `[eq:bend-stiffness]`
    #[inline(always)]
    pub fn respond(&self, law: ElasticLaw, corners: [DVec3; 4]) -> BendResponse {
        if law == ElasticLaw::Energy {
            return self.respond_by_energy(corners);
        }
        let [from, to, left, right] = corners;
        let angle = beyond(dihedral_angle(from, to, left, right), self.rest_angle);
        let length = from.distance(to);
        let read_at = match law {
            ElasticLaw::Arcsim => angle,
            _ => angle.abs(),
        };
        let ke = self.stiffness_at(0.1 * read_at * length / self.area);
        let stiffness = ke * (length * length / (4.0 * self.area));
        BendResponse {
            gradient: angle_gradient::<f64>(corners),
            angle,
            stiffness,
            tangent: stiffness,
        }
    }

    /// Energy of [`ElasticLaw::Energy`] at these corner positions `[J]`: ∫ coeff/2 φ dφ from 0 to
    /// |θ - θ₀|, in closed form between two columns of the table. `[eq:bend-energy]`
    pub fn energy(&self, corners: [DVec3; 4]) -> f64 {
        let [from, to, left, right] = corners;
        let angle = beyond(dihedral_angle(from, to, left, right), self.rest_angle).abs();
        // The curvature is this many times the angle.
        let rate = 0.1 * self.length / self.area;
        let end = rate * angle;
        // ∫ (k + s (u - low)) u du.
        let integral = |low: usize, k: f64, slope: f64| {
            let (from, to) = (low as f64, end.min((low + 1) as f64));
            let (k, cubes) = (k - slope * from, (to.powi(3) - from.powi(3)) / 3.0);
            0.5 * k * (to * to - from * from) + slope * cubes
        };
        let columns = (0..COLUMNS - 1).take_while(|low| end > *low as f64);
        let table: f64 = columns
            .map(|low| {
                let k = self.stiffness[low];
                integral(low, k, self.stiffness[low + 1] - k)
            })
            .sum();
        let last = (COLUMNS - 1) as f64;
        let beyond = 0.5 * self.stiffness[COLUMNS - 1] * (end * end - last * last).max(0.0);
        self.length * self.length / (4.0 * self.area) * (table + beyond) / (rate * rate)
    }
}

impl<N: Number> BendElement<N> {
    /// The element of these numbers.
    #[inline(always)]
    pub(crate) fn of([k0, k1, k2, k3, k4, area, length, rest_angle]: [N; 8]) -> Self {
        Self {
            stiffness: [k0, k1, k2, k3, k4],
            area,
            length,
            rest_angle,
        }
    }

    /// The inverse of [`Self::of`].
    #[inline(always)]
    pub(crate) fn numbers(&self) -> [N; 8] {
        let [k0, k1, k2, k3, k4] = self.stiffness;
        [k0, k1, k2, k3, k4, self.area, self.length, self.rest_angle]
    }

    /// [`BendElement::respond`] by [`ElasticLaw::Energy`].
    #[inline(always)]
    pub(crate) fn respond_by_energy(&self, corners: [N::Vector; 4]) -> BendResponse<N> {
        let (area, length) = (self.area, self.length);
        let zero = area.same(0.0);
        let angle = beyond(angle_of(corners), self.rest_angle);
        let curvature = angle.abs() * 0.1 * length / area;
        // Linear between columns, and its slope in the column where the curvature is.
        let (mut ke, mut slope) = (self.stiffness[0], zero);
        for (low, ends) in self.stiffness.windows(2).enumerate() {
            let rise = ends[1] - ends[0];
            let part = curvature - low as f64;
            ke = ke + rise * part.at_least(0.0).at_most(1.0);
            let is_here = part.below(zero);
            slope = N::pick(is_here, slope, rise);
        }
        let last = zero + (COLUMNS - 1) as f64;
        slope = N::pick(curvature.below(last), slope, zero);
        let scale = length * length / (area * 4.0);
        BendResponse {
            gradient: angle_gradient::<N>(corners),
            angle,
            stiffness: ke * scale,
            tangent: (ke + curvature * slope).at_least(0.0) * scale,
        }
    }
}

/// Row of the table for an edge in this direction, folded into 0 to 90° from the course axis.
pub(crate) fn stiffness_along(table: &BendTable, along: DVec2) -> [f64; 5] {
    let (low, between) = row_place(along);
    let rows = &table.0;
    std::array::from_fn(|column| {
        (1.0 - between) * rows[low][column] + between * rows[low + 1][column]
    })
}

/// The lower row for an edge in this direction, and the weight of the next.
fn row_place(along: DVec2) -> (usize, f64) {
    let direction = atan2(along.y.abs(), along.x.abs());
    let place = (direction / std::f64::consts::FRAC_PI_4).clamp(0.0, 2.0);
    let low = (place as usize).min(1);
    (low, place - low as f64)
}

/// Adds to `by_table` what derivatives by the stiffness of an edge along this direction are by the
/// entries of the `table`. Returns those by the direction.
pub(crate) fn pull_stiffness(
    along: DVec2,
    table: &BendTable,
    by_stiffness: [f64; 5],
    by_table: &mut [[f64; 5]; 3],
) -> DVec2 {
    let (low, between) = row_place(along);
    let mut by_place = 0.0;
    for (column, by) in by_stiffness.into_iter().enumerate() {
        by_table[low][column] += (1.0 - between) * by;
        by_table[low + 1][column] += between * by;
        by_place += by * (table.0[low + 1][column] - table.0[low][column]);
    }
    let turn = DVec2::new(
        -along.y.abs() * along.x.signum(),
        along.x.abs() * along.y.signum(),
    );
    turn * (by_place / std::f64::consts::FRAC_PI_4 / along.length_squared())
}

/// Derivatives of λᵀ(γ F - (-J) w) of a hinge, F its force and J its Jacobian, by positions and by w.
pub(crate) struct BendSlopes {
    pub(crate) by_places: [DVec3; 4],
    pub(crate) by_w: [DVec3; 4],
    /// By the stiffness of the element.
    pub(crate) by_stiffness: [f64; 5],
    /// By the rest angle.
    pub(crate) by_rest_angle: f64,
    /// By length and area.
    pub(crate) by_shape: [f64; 2],
}

impl BendElement {
    /// The derivatives of λᵀ(γ F - (-J) w) by [`ElasticLaw::Energy`] at these corners. The stiffness is
    /// piecewise linear in the curvature, and differentiated so.
    pub(crate) fn slopes(
        &self,
        gamma: f64,
        corners: [DVec3; 4],
        multipliers: [DVec3; 4],
        w: [DVec3; 4],
    ) -> BendSlopes {
        let at = self.respond_by_energy(corners);
        let (along_l, along_w) = (at.rate(multipliers), at.rate(w));
        let scale = self.length * self.length / (4.0 * self.area);
        let to_curvature = 0.1 * self.length / self.area;
        let curvature = at.angle.abs() * to_curvature;
        let low = (curvature as usize).min(COLUMNS - 2);
        let part = (curvature - low as f64).min(1.0);
        let mut weights = [0.0; COLUMNS];
        (weights[low], weights[low + 1]) = (1.0 - part, part);
        let mut rises = [0.0; COLUMNS];
        let is_within = curvature < (COLUMNS - 1) as f64;
        if is_within {
            (rises[low], rises[low + 1]) = (-1.0, 1.0);
        }
        let slope = if is_within { self.stiffness[low + 1] - self.stiffness[low] } else { 0.0 };
        // Where the stiffness falls faster than the curvature grows the tangent is cut off at 0.
        let is_cut = at.tangent <= 0.0;
        let growth = 2.0 * slope * to_curvature * at.angle.signum() * scale;
        let (exact, growth) = if is_cut {
            (at.stiffness + curvature * slope * scale, 0.0)
        } else {
            (at.tangent, growth)
        };
        let by_angle = -along_l * (gamma * exact + growth * along_w);
        // The form is one in l²/a, and has this derivative by the curvature, which is one in l/a.
        let grown = if is_cut { 0.0 } else { 2.0 * along_w };
        let by_curvature = -along_l * scale * slope * (gamma * at.angle + grown);
        let torque = gamma * at.stiffness * at.angle + at.tangent * along_w;
        let by_gradient: [DVec3; 4] =
            std::array::from_fn(|k| -(multipliers[k] * torque + w[k] * (along_l * at.tangent)));
        // The gradient's own derivative is symmetric: that along `by_gradient` is what it has to give.
        let moved = std::array::from_fn(|k| DualVector::new(corners[k], [by_gradient[k]]));
        let turned = angle_gradient::<Dual>(moved);
        BendSlopes {
            by_places: std::array::from_fn(|k| turned[k].rates()[0] + at.gradient[k] * by_angle),
            by_w: at.gradient.map(|g| g * (-along_l * at.tangent)),
            by_stiffness: std::array::from_fn(|j| {
                let tangent = if is_cut { 0.0 } else { weights[j] + curvature * rises[j] };
                -along_l * scale * (gamma * at.angle * weights[j] + along_w * tangent)
            }),
            by_rest_angle: -by_angle,
            by_shape: [
                (by_curvature * curvature - 2.0 * along_l * torque) / self.length,
                (along_l * torque - by_curvature * curvature) / self.area,
            ],
        }
    }
}

/// θ - θ₀ in [-π, π]: the shorter way round, so that a hinge that rests folded does not jump where
/// its wings pass through each other.
#[inline(always)]
fn beyond<N: Number>(angle: N, rest: N) -> N {
    let (half, turn) = (angle.same(0.5 * TAU), angle.same(TAU));
    let far = angle - rest;
    let down = N::pick(half.below(far), far - turn, far);
    N::pick(far.below(-half), far + turn, down)
}

/// The angle of [`dihedral_angle`], by [`direction`].
#[inline(always)]
fn angle_of<N: Number>(corners: [N::Vector; 4]) -> N {
    let [from, to, left, right] = corners;
    let along = to - from;
    let normal_left = along.cross(left - from);
    let normal_right = (right - from).cross(along);
    let sine = -normal_left.cross(normal_right).dot(along) / along.dot(along).sqrt();
    let cosine = normal_left.dot(normal_right);
    // Neither infinite nor no number.
    let is_finite = sine.abs().below(sine.same(f64::INFINITY));
    N::pick(is_finite, direction(sine, cosine), sine.same(0.0))
}

impl<N: Number> BendResponse<N> {
    /// ∂θ/∂x applied to one vector per corner.
    #[inline(always)]
    pub fn rate(&self, vectors: [N::Vector; 4]) -> N {
        let [a, b, c, d] = self.gradient;
        a.dot(vectors[0]) + b.dot(vectors[1]) + c.dot(vectors[2]) + d.dot(vectors[3])
    }
}

impl BendResponse {
    /// Force on the four corners `[N]`: F = -coeff/2 (θ - θ₀) ∂θ/∂x. `[eq:bend-force]`
    #[inline(always)]
    pub fn force(&self) -> [DVec3; 4] {
        let scale = -self.stiffness * self.angle;
        self.gradient.map(|gradient| gradient * scale)
    }
}

/// n/h of a wing with this normal, as long as twice its area, on an edge of this `length`.
#[inline(always)]
fn rise<N: Number>(normal: N::Vector, length: N) -> N::Vector {
    let zero = length.same(0.0);
    let twice_area = normal.dot(normal).sqrt();
    let (height, least) = (twice_area / length, length * 1e-3);
    let height = N::pick(height.below(least), least, height);
    normal / N::pick(zero.below(twice_area), twice_area, zero + 1.0) / height
}

/// Derivative of the dihedral angle by the four corners `[1/m]`. With unit normals n, heights h
/// over the edge and foot points w along it (0 at corner 0, 1 at corner 1), ∂θ/∂x2 = n_A/h_A,
/// ∂θ/∂x3 = n_B/h_B, ∂θ/∂x0 = -((1-w_A) n_A/h_A + (1-w_B) n_B/h_B), ∂θ/∂x1 = -(w_A n_A/h_A + w_B
/// n_B/h_B). `[eq:bend-gradient]`
#[inline(always)]
pub fn angle_gradient<N: Number>(corners: [N::Vector; 4]) -> [N::Vector; 4] {
    let [from, to, left, right] = corners;
    let along = to - from;
    let squared = along.dot(along);
    let length = squared.sqrt();
    let foot_left = (left - from).dot(along) / squared;
    let foot_right = (right - from).dot(along) / squared;
    let rise_left = rise(along.cross(left - from), length);
    let rise_right = rise((right - from).cross(along), length);
    [
        -(rise_left * (-foot_left + 1.0) + rise_right * (-foot_right + 1.0)),
        -(rise_left * foot_left + rise_right * foot_right),
        rise_left,
        rise_right,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: BendTable = BendTable([
        [23e-6, 33e-6, 34e-6, 39e-6, 23e-6],
        [25e-6, 18e-6, 16e-6, 25e-6, 9e-6],
        [14e-6, 7e-6, 15e-6, 25e-6, 19e-6],
    ]);

    const REST: [DVec2; 4] = [
        DVec2::new(0.0, 0.0),
        DVec2::new(0.04, 0.01),
        DVec2::new(0.01, 0.03),
        DVec2::new(0.03, -0.02),
    ];

    fn folded() -> [DVec3; 4] {
        [
            DVec3::new(0.0, 0.0, 0.0),
            DVec3::new(0.041, 0.01, 0.002),
            DVec3::new(0.01, 0.03, 0.012),
            DVec3::new(0.03, -0.02, 0.009),
        ]
    }

    #[test]
    fn symmetric_law_answers_to_either_side_alike() {
        let element = BendElement::new(&TABLE, REST);
        let mirrored = folded().map(|x| DVec3::new(x.x, x.y, -x.z));
        let (one, other) = (
            element.respond(ElasticLaw::Measured, folded()),
            element.respond(ElasticLaw::Measured, mirrored),
        );
        assert_eq!(one.angle, -other.angle);
        assert_eq!(one.stiffness, other.stiffness);
        for (one, other) in one.force().iter().zip(other.force()) {
            assert_eq!(*one, DVec3::new(other.x, other.y, -other.z));
        }
        let positive = element.respond(ElasticLaw::Arcsim, folded());
        let negative = element.respond(ElasticLaw::Arcsim, mirrored);
        assert_eq!(positive.stiffness, one.stiffness);
        assert!((negative.stiffness - one.stiffness).abs() > 1e-3 * one.stiffness);
    }

    #[test]
    fn a_hinge_that_rests_nearly_shut_takes_the_shorter_way() {
        assert!((beyond(-3.0, 3.0) - (TAU - 6.0)).abs() < 1e-15);
        assert!((beyond(3.0, -3.0) + (TAU - 6.0)).abs() < 1e-15);
        assert_eq!(beyond(1.0, 0.25), 0.75);
    }

    #[test]
    fn flat_and_folded_shut_are_finite() {
        let element = BendElement::new(&TABLE, REST);
        let flat = REST.map(|c| c.extend(0.0));
        assert_eq!(element.respond(ElasticLaw::Measured, flat).angle, 0.0);
        let collapsed = [flat[0], flat[1], flat[0], flat[0]];
        for corners in [collapsed, [flat[0], flat[1], flat[2], flat[2]]] {
            let response = element.respond(ElasticLaw::Measured, corners);
            assert!(response.force().iter().all(|f| f.is_finite()));
        }
    }
}
