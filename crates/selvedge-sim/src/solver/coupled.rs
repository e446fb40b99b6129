//! A small system whose touches couple vertices that its factor does not: conjugate gradients on
//! the whole matrix, with the complete factor of the rest as preconditioner.

use glam::DVec3;
use selvedge_cloth::VertexId;

use crate::contact::Touches;
use crate::solver::cholesky::FactorError;
use crate::solver::conjugate_gradients::IterationError;
use crate::solver::elements::Elements;
use crate::solver::pattern::Pattern;
use crate::threads::Threads;

/// Error of the velocities, in the norm of the factor, at which a coupled solve ends `[m/s]`, and
/// its iterations at most; about as many take as long as a factor of the whole.
const COUPLED_TOLERANCE: f64 = 1e-7;
const COUPLED_ITERATIONS: u32 = 60;

/// Reason for a failed coupled solve.
pub(super) enum CoupledError {
    Factor(FactorError),
    Iteration(IterationError),
}

impl From<FactorError> for CoupledError {
    fn from(error: FactorError) -> Self {
        Self::Factor(error)
    }
}

/// Springs of handles, on the diagonal of A.
#[derive(Clone, Copy)]
pub(super) struct Springs<'a> {
    pub(super) vertices: &'a [VertexId],
    /// dt² k `[kg]`.
    pub(super) stiffness: f64,
}

impl<'a> Springs<'a> {
    /// Each vertex with its spring `[kg]`.
    pub(super) fn stiff(self) -> impl Iterator<Item = (u32, f64)> + 'a {
        let vertices = self.vertices.iter();
        vertices.map(move |v| (v.0, self.stiffness))
    }
}

/// A factor of all but the couplings.
pub(super) trait Factor {
    /// Factorises, and solves for `changes`.
    fn solve(
        &mut self,
        pattern: &Pattern,
        impulses: &[DVec3],
        changes: &mut [DVec3],
    ) -> Result<(), FactorError>;

    /// As [`Self::solve`], with the factor of its last call.
    fn solve_again(&mut self, pattern: &Pattern, impulses: &[DVec3], changes: &mut [DVec3]);
}

/// A matrix with couplings that its factor does not have.
pub(super) struct Whole<'a> {
    pub(super) threads: Threads,
    pub(super) elements: &'a mut Elements,
    pub(super) springs: Springs<'a>,
    pub(super) touches: &'a Touches,
}

impl Whole<'_> {
    /// `product` = A `vector`, `[vertices]`.
    fn multiply(&mut self, vector: &[DVec3], product: &mut [DVec3]) {
        self.elements.multiply(self.threads, vector, product);
        for v in self.springs.vertices.iter().map(|v| v.index()) {
            product[v] += vector[v] * self.springs.stiffness;
        }
        self.touches.multiply(1.0, vector, product);
    }
}

/// Solves by conjugate gradients with the factor of all but the couplings of touches, which
/// are few, as preconditioner.
pub(super) fn solve_coupled(
    factor: &mut impl Factor,
    pattern: &Pattern,
    whole: &mut Whole<'_>,
    impulses: &[DVec3],
    changes: &mut [DVec3],
) -> Result<(), CoupledError> {
    changes.fill(DVec3::ZERO);
    let mut residual = vec![DVec3::ZERO; changes.len()];
    for &v in pattern.vertices() {
        residual[v as usize] = impulses[v as usize];
    }
    let total: f64 = whole.elements.mass.iter().sum();
    let goal = COUPLED_TOLERANCE * COUPLED_TOLERANCE * total;
    let mut direction = vec![DVec3::ZERO; changes.len()];
    let mut solved = direction.clone();
    let mut product = direction.clone();
    factor.solve(pattern, &residual, &mut solved)?;
    let mut size = dot(pattern, &residual, &solved);
    let mut iterations = 0;
    direction.copy_from_slice(&solved);
    while size > goal || size.is_nan() {
        if iterations >= COUPLED_ITERATIONS || !size.is_finite() {
            let error = (size / total).sqrt();
            return Err(CoupledError::Iteration(IterationError::NotConverged {
                iterations,
                error,
                tolerance: COUPLED_TOLERANCE,
            }));
        }
        iterations += 1;
        whole.multiply(&direction, &mut product);
        let step = size / dot(pattern, &direction, &product);
        for &v in pattern.vertices() {
            let v = v as usize;
            changes[v] += direction[v] * step;
            residual[v] -= product[v] * step;
        }
        factor.solve_again(pattern, &residual, &mut solved);
        let next = dot(pattern, &residual, &solved);
        let part = next / size;
        for &v in pattern.vertices() {
            let v = v as usize;
            direction[v] = solved[v] + direction[v] * part;
        }
        size = next;
    }
    Ok(())
}

/// Σ a·b over the unknowns.
fn dot(pattern: &Pattern, a: &[DVec3], b: &[DVec3]) -> f64 {
    let unknowns = pattern.vertices().iter().map(|v| *v as usize);
    unknowns.map(|v| a[v].dot(b[v])).sum()
}
