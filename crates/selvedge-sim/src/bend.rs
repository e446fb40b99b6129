//! Resistance to bending, per interior edge, of the data-driven model of Wang, O'Brien and
//! Ramamoorthi 2011 as ARCSim integrates it (simulator.md §2.2).
//!
//! Corners of an edge are in the order: its ends 0 → 1 (counter-clockwise in the left face), the
//! opposite vertex of the left face, that of the right face. The angle θ is positive where the
//! wings rise towards the normals; rest angles are 0. Bending stiffness and edge length are held
//! constant when differentiating. Degenerate faces (height below 10⁻³ of the edge) are treated as
//! if they had that height.

use glam::{DMat3, DVec2, DVec3};
use selvedge_cloth::geometry::{dihedral_angle, signed_area_2d};
use selvedge_cloth::{BendTable, BendingLaw};

/// An interior edge's rest shape and the row of the material's table that it reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BendElement {
    /// Bending stiffness at curvatures 0 to 4 for this edge's direction [N·m].
    stiffness: [f64; 5],
    /// Material area of the two faces together [m²].
    area: f64,
}

/// Force and Jacobian of one edge at one configuration.
#[derive(Clone, Copy, Debug)]
pub struct BendResponse {
    /// ∂θ/∂x of the four corners [1/m].
    pub gradient: [DVec3; 4],
    /// Signed dihedral angle θ [rad].
    pub angle: f64,
    /// Stiffness of the hinge, coeff/2 = ke l²/(4 (a_A + a_B)) [N·m].
    pub stiffness: f64,
}

/// Columns of the bending table.
const COLUMNS: usize = 5;

impl BendElement {
    /// The element of an edge whose corners are here in material space [m].
    ///
    /// Rows of the table are read at the edge's direction, folded into 0 to 90° from the course
    /// axis and linear between 0, 45 and 90°. `[eq:bend-direction]`
    #[must_use]
    pub fn new(table: &BendTable, corners: [DVec2; 4]) -> Self {
        let [from, to, left, right] = corners;
        let along = to - from;
        let direction = along.y.abs().atan2(along.x.abs());
        let place = (direction / std::f64::consts::FRAC_PI_4).clamp(0.0, 2.0);
        let low = (place as usize).min(1);
        let between = place - low as f64;
        let rows = &table.0;
        Self {
            stiffness: std::array::from_fn(|column| {
                (1.0 - between) * rows[low][column] + between * rows[low + 1][column]
            }),
            area: signed_area_2d(from, to, left).abs() + signed_area_2d(from, right, to).abs(),
        }
    }

    /// Bending stiffness ke [N·m] at a dimensionless curvature: linear between columns ⌊value⌋
    /// (0 to 3) and the next, value at most 4, never negative. Below 0 the first columns are
    /// extrapolated. `[eq:bend-table]`
    #[must_use]
    #[inline]
    pub fn stiffness_at(&self, curvature: f64) -> f64 {
        let value = curvature.min((COLUMNS - 1) as f64);
        let low = (value.max(0.0) as usize).min(COLUMNS - 2);
        let between = value - low as f64;
        ((1.0 - between) * self.stiffness[low] + between * self.stiffness[low + 1]).max(0.0)
    }

    /// Force and Jacobian at these corner positions [m].
    ///
    /// coeff = ke l²/(2 (a_A + a_B)), ke read at 0.1 θ l/(a_A + a_B), l the current length;
    /// [`BendingLaw::Symmetric`] reads it at |θ|. `[eq:bend-stiffness]`
    #[must_use]
    #[inline]
    pub fn respond(&self, law: BendingLaw, corners: [DVec3; 4]) -> BendResponse {
        let [from, to, left, right] = corners;
        let angle = dihedral_angle(from, to, left, right);
        let length = from.distance(to);
        let read_at = match law {
            BendingLaw::Symmetric => angle.abs(),
            BendingLaw::Arcsim => angle,
        };
        let ke = self.stiffness_at(0.1 * read_at * length / self.area);
        BendResponse {
            gradient: angle_gradient(corners),
            angle,
            stiffness: ke * length * length / (4.0 * self.area),
        }
    }
}

impl BendResponse {
    /// Force on the four corners [N]: F = -coeff/2 θ ∂θ/∂x. `[eq:bend-force]`
    #[must_use]
    #[inline]
    pub fn force(&self) -> [DVec3; 4] {
        let scale = -self.stiffness * self.angle;
        self.gradient.map(|gradient| gradient * scale)
    }

    /// Block (`row`, `column`) of the negative Jacobian -J = coeff/2 ∂θ ∂θᵀ [N/m].
    /// `[eq:bend-jacobian]`
    #[must_use]
    #[inline]
    pub fn negative_jacobian(&self, row: usize, column: usize) -> DMat3 {
        let left = self.gradient[row] * self.stiffness;
        let right = self.gradient[column];
        DMat3::from_cols(left * right.x, left * right.y, left * right.z)
    }

    /// -J applied to one vector per corner.
    #[must_use]
    #[inline]
    pub fn negative_jacobian_times(&self, vectors: [DVec3; 4]) -> [DVec3; 4] {
        let rate: f64 = self
            .gradient
            .iter()
            .zip(vectors)
            .map(|(gradient, vector)| gradient.dot(vector))
            .sum();
        let scale = self.stiffness * rate;
        self.gradient.map(|gradient| gradient * scale)
    }
}

/// Derivative of the dihedral angle by the four corners [1/m]: with unit normals n, heights h over
/// the edge and foot points w along it (0 at corner 0, 1 at corner 1),
/// ∂θ/∂x2 = n_A/h_A, ∂θ/∂x3 = n_B/h_B, ∂θ/∂x0 = -((1-w_A) n_A/h_A + (1-w_B) n_B/h_B),
/// ∂θ/∂x1 = -(w_A n_A/h_A + w_B n_B/h_B). `[eq:bend-gradient]`
#[must_use]
#[inline]
pub fn angle_gradient(corners: [DVec3; 4]) -> [DVec3; 4] {
    let [from, to, left, right] = corners;
    let along = to - from;
    let length = along.length();
    let wing = |tip: DVec3, normal: DVec3| {
        let foot = (tip - from).dot(along) / along.length_squared();
        let twice_area = normal.length();
        let height = (twice_area / length).max(1e-3 * length);
        let unit = if twice_area > 0.0 {
            normal / twice_area
        } else {
            DVec3::ZERO
        };
        (unit / height, foot)
    };
    let (rise_left, foot_left) = wing(left, along.cross(left - from));
    let (rise_right, foot_right) = wing(right, (right - from).cross(along));
    [
        -(rise_left * (1.0 - foot_left) + rise_right * (1.0 - foot_right)),
        -(rise_left * foot_left + rise_right * foot_right),
        rise_left,
        rise_right,
    ]
}
