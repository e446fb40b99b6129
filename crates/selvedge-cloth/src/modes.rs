//! Modes of a cloth: the smoothest functions on its flat pieces, eigenfunctions of the Laplacian
//! `[eq:modes]`. They are waves along the cloth, the longest first, and hardly depend on how it is
//! divided into faces.

mod laplacian;
mod subspace;
#[cfg(test)]
mod tests;

use crate::cloth::Cloth;

use laplacian::Laplacian;
use subspace::lowest;

/// The longest waves of a cloth. With the share `a_i` of vertex i in the area, which sum to 1, mode
/// k has Σ `a_i` `φ_ik`² = 1, and two modes Σ `a_i` `φ_ik` `φ_il` = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// Share of each vertex in the area, `[vertices]`.
    pub shares: Vec<f64>,
    /// Eigenvalue of each mode, ascending `[1/m²]`: the square of its wave number.
    pub eigenvalues: Vec<f64>,
    /// Modes at the vertices, `[vertices, modes]`.
    pub values: Vec<f64>,
    /// Eigenvalue of the first mode that is left out `[1/m²]`; infinite where none is.
    pub next: f64,
}

impl Modes {
    /// The `count` modes of the smallest eigenvalues; all of them where the cloth has fewer
    /// vertices. Same cloth, same numbers. Each piece of a cloth of several has a constant mode.
    #[must_use]
    pub fn of(cloth: &Cloth, count: usize) -> Self {
        let laplacian = Laplacian::of(cloth);
        let pairs = lowest(&laplacian.scaled(), count);
        let shares = laplacian.shares();
        let modes = pairs.values.len();
        let mut values = pairs.vectors;
        if modes > 0 {
            for (row, share) in values.chunks_exact_mut(modes).zip(&shares) {
                row.iter_mut().for_each(|value| *value /= share.sqrt());
            }
        }
        Self {
            shares,
            eigenvalues: pairs.values,
            values,
            next: pairs.next,
        }
    }

    /// The number of modes.
    #[must_use]
    pub fn count(&self) -> usize {
        self.eigenvalues.len()
    }
}
