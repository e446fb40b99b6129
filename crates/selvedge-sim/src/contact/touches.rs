//! Pairs that push in a substep, as the linear system sees them.

use glam::{DMat3, DVec3, Mat3A, Vec3A};

use super::barrier::{Barrier, Tangent};
use super::friction::{along_surface, drag, outer};

/// A pair that pushes, frozen for a substep: its direction and weights stay.
#[derive(Clone, Debug)]
pub(crate) struct Touch {
    /// Points of the pair; obstacles' are not below the number of the cloth's vertices.
    pub(super) corners: [u32; 4],
    /// Weights of the cloth's corners; 0 for those of obstacles.
    pub(super) weights: [f64; 4],
    /// Unit direction of the gap.
    pub(super) normal: DVec3,
    /// Gap at the start of the substep, along `normal` `[m]`.
    pub(super) gap: f64,
    /// ĝ `[m]`.
    pub(super) thickness: f64,
    /// Mean mass of the free corners by the squares of their weights `[kg]`.
    pub(super) mean_mass: f64,
    /// Mass of the relative motion `[kg]`.
    pub(super) mass: f64,
    /// Σ w x of the cloth's corners at the start `[m]`.
    pub(super) base: DVec3,
    /// Σ w Δx of obstacles over the substep `[m]`.
    pub(super) drift: DVec3,
    /// Coefficient of friction.
    pub(super) friction: f64,
    /// Other body of a vertex, which has an anchor there; none of two edges.
    pub(super) body: Option<u32>,
    /// Pull of the anchor at the start, along the surface `[N]`.
    pub(super) pull: DVec3,
    /// Gap at which to linearise, because a solve has shown that the usual one pushes too little
    /// `[m]`.
    pub(super) at: Option<f64>,
    /// Response of the last linearisation.
    pub(super) response: Response,
}

/// A touch, linearised.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Response {
    pub(super) tangent: Tangent,
    /// Stiffness of an anchor `[N/m]`.
    pub(super) grip: f64,
    /// γ² times the derivative of the force `[kg]`.
    block: DMat3,
}

/// All touches of a substep.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touches {
    pub(super) list: Vec<Touch>,
}

impl Touch {
    /// Displacement of the first side against the second since the start of the substep `[m]`.
    #[inline]
    pub(super) fn displacement(&self, cloth: impl Fn(usize) -> DVec3) -> DVec3 {
        let mut sum = self.drift - self.base;
        for (corner, weight) in self.corners.iter().zip(self.weights) {
            if weight != 0.0 {
                sum += cloth(*corner as usize) * weight;
            }
        }
        sum
    }

    /// Linearises the touch for a stage of γ `[s]` whose estimated end has this `displacement`.
    /// Gives the force on the first side `[N]`.
    fn linearise(&mut self, gamma: f64, displacement: DVec3) -> DVec3 {
        let square = gamma * gamma;
        let barrier = Barrier {
            thickness: self.thickness,
            base: self.mean_mass / square,
            inertia: self.mass / square,
        };
        let estimate = self.gap + self.normal.dot(displacement);
        let tangent = match self.at {
            None => barrier.linearise(self.gap, estimate),
            Some(gap) => barrier.at(gap),
        };
        let bears = barrier.bears(&tangent, estimate);
        let grip = barrier.inertia;
        let slip = along_surface(self.normal, self.pull / grip + displacement);
        let drag = drag(self.normal, slip, grip, self.friction * bears);
        let block = outer(self.normal, self.normal) * tangent.stiffness + drag.block;
        self.response = Response {
            tangent,
            grip,
            block: block * square,
        };
        self.normal * tangent.force_at(estimate) + drag.force
    }
}

impl Touches {
    /// Returns true if nothing touches.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns true if a touch couples vertices with each other.
    pub(crate) fn couple(&self) -> bool {
        let mut touches = self.list.iter();
        touches.any(|touch| touch.weights.iter().filter(|w| **w != 0.0).count() > 1)
    }

    /// Linearises all touches for a stage of γ `[s]` whose estimated end has the cloth's vertices
    /// at `place` `[m]`, and adds their impulses `[N s]`.
    pub(crate) fn linearise(
        &mut self,
        gamma: f64,
        place: impl Fn(usize) -> DVec3,
        impulses: &mut [DVec3],
    ) {
        for touch in &mut self.list {
            let displacement = touch.displacement(&place);
            let impulse = touch.linearise(gamma, displacement) * gamma;
            for (corner, weight) in touch.corners.iter().zip(touch.weights) {
                if weight != 0.0 {
                    impulses[*corner as usize] += impulse * weight;
                }
            }
        }
    }

    /// Adds `sign` times the touches' part of the matrix times `vector` to `product`.
    pub(crate) fn multiply(&self, sign: f64, vector: &[DVec3], product: &mut [DVec3]) {
        for touch in &self.list {
            let mut sum = DVec3::ZERO;
            for (corner, weight) in touch.corners.iter().zip(touch.weights) {
                if weight != 0.0 {
                    sum += vector[*corner as usize] * weight;
                }
            }
            let resisting = touch.response.block * sum * sign;
            for (corner, weight) in touch.corners.iter().zip(touch.weights) {
                if weight != 0.0 {
                    product[*corner as usize] += resisting * weight;
                }
            }
        }
    }

    /// Each vertex and what a touch adds to its diagonal block `[kg]`.
    pub(crate) fn diagonal(&self) -> impl Iterator<Item = (u32, DMat3)> {
        self.list.iter().flat_map(|touch| {
            let parts = touch.corners.iter().zip(touch.weights);
            parts
                .filter(|(_, weight)| *weight != 0.0)
                .map(|(corner, weight)| (*corner, touch.response.block * (weight * weight)))
        })
    }

    /// Vertices of each touch that couples some; in the place of an obstacle's point stands the
    /// first of them.
    pub(crate) fn stencils(&self) -> impl Iterator<Item = [u32; 4]> {
        self.list.iter().filter_map(|touch| {
            let has_weight = touch.weights.map(|weight| weight != 0.0);
            let first = has_weight.iter().position(|has| *has)?;
            let own = |k: usize| touch.corners[if has_weight[k] { k } else { first }];
            Some([own(0), own(1), own(2), own(3)])
        })
    }

    /// Each two vertices of a touch and the block that couples them `[kg]`.
    pub(crate) fn couplings(&self) -> impl Iterator<Item = ([u32; 2], DMat3)> {
        const TWO: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        let two = self
            .list
            .iter()
            .flat_map(|touch| TWO.map(|two| (touch, two)));
        two.filter_map(|(touch, two)| {
            let [a, b] = two.map(|k| touch.weights[k]);
            let block = touch.response.block * (a * b);
            (a * b != 0.0).then(|| (two.map(|k| touch.corners[k]), block))
        })
    }

    /// `product` = the part beside the diagonal in the scaled space of an incomplete factor: C⁻¹ E
    /// C⁻ᵀ `solved` times `scale`. `unknown` gives the unknown of a vertex; the count of unknowns
    /// where it is held.
    pub(crate) fn beside_diagonal(
        &self,
        scale: f64,
        scaling: &[Mat3A],
        unknown: impl Fn(u32) -> u32,
        solved: &[Vec3A],
        product: &mut Vec<Vec3A>,
    ) {
        product.clear();
        product.resize(solved.len(), Vec3A::ZERO);
        for touch in &self.list {
            let corners = touch.corners.iter().zip(touch.weights);
            let parts = corners.filter(|(_, weight)| *weight != 0.0);
            let parts = parts.map(|(corner, weight)| (unknown(*corner) as usize, weight as f32));
            let mut values = [(0_usize, 0.0_f32, Vec3A::ZERO); 4];
            let (mut count, mut sum) = (0, Vec3A::ZERO);
            for (u, weight) in parts.filter(|(u, _)| *u < solved.len()) {
                let value = scaling[u].transpose() * solved[u];
                sum += value * weight;
                values[count] = (u, weight, value);
                count += 1;
            }
            if count < 2 {
                continue;
            }
            let block = to_single(touch.response.block * scale);
            for (u, weight, value) in &values[..count] {
                let pushed = block * (sum - *value * *weight) * *weight;
                product[*u] += scaling[*u] * pushed;
            }
        }
    }
}

fn to_single(matrix: DMat3) -> Mat3A {
    Mat3A::from_cols(
        matrix.x_axis.as_vec3a(),
        matrix.y_axis.as_vec3a(),
        matrix.z_axis.as_vec3a(),
    )
}
