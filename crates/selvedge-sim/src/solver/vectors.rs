//! The vectors of conjugate gradients, and what an iteration does with parts of them.

use glam::Vec3A;

/// Vectors of the iteration in the scaled space, `[unknowns]` each.
pub(super) struct Vectors {
    pub(super) solution: Vec<Vec3A>,
    pub(super) residual: Vec<Vec3A>,
    pub(super) direction: Vec<Vec3A>,
    /// The direction, taken out of the scaled space but for its scale.
    pub(super) solved: Vec<Vec3A>,
    /// The matrix times the direction.
    pub(super) product: Vec<Vec3A>,
}

impl Vectors {
    pub(super) fn new(unknowns: usize) -> Self {
        let zeros = || vec![Vec3A::ZERO; unknowns];
        Self {
            solution: zeros(),
            residual: zeros(),
            direction: zeros(),
            solved: zeros(),
            product: zeros(),
        }
    }
}

/// `direction` = `residual` + `part` · `direction`, also into `solved`.
pub(super) fn turn(part: f32, residual: &[Vec3A], direction: &mut [Vec3A], solved: &mut [Vec3A]) {
    for ((direction, residual), solved) in direction.iter_mut().zip(residual).zip(solved) {
        *direction = *residual + *direction * part;
        *solved = *direction;
    }
}

/// Adds `step` times the direction to the solution, takes `step` times the product from the
/// residual, and gives that one's size squared.
#[inline(always)]
pub(super) fn go(
    step: f32,
    direction: &[Vec3A],
    product: impl Fn(usize) -> Vec3A,
    [solution, residual]: [&mut [Vec3A]; 2],
) -> f64 {
    let mut size = 0.0;
    let ends = solution.iter_mut().zip(residual).zip(direction);
    for (k, ((solution, residual), direction)) in ends.enumerate() {
        *solution += *direction * step;
        *residual -= product(k) * step;
        size += f64::from(residual.length_squared());
    }
    size
}

pub(super) fn dot(a: &[Vec3A], b: impl Iterator<Item = Vec3A>) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.dot(b))).sum()
}

pub(super) fn length_squared(a: &[Vec3A]) -> f64 {
    dot(a, a.iter().copied())
}
