//! Reads a measured fabric's in-plane stiffness k = (k0, k1, k2, k3) at a strain (Wang, O'Brien and
//! Ramamoorthi 2011; simulator.md §2.1): the table itself, or ARCSim's 30³ samples of it.
//!
//! Conventions: k in N/m after the law's factor 2, never negative; the sign of the shear does not
//! matter. The samples do not hit zero strain, so the two differ even at rest (`[eq:stretch-grid]`).

use std::f64::consts::PI;

use selvedge_cloth::StretchTable;

use crate::stretch::Strain;

/// Anything that gives a stiffness at a strain.
pub trait StretchStiffness {
    /// Stiffness (k0, k1, k2, k3) [N/m] at `strain`.
    fn at(&self, strain: Strain) -> [f64; 4];
}

/// The table, evaluated at the exact strain.
#[derive(Clone, Debug, PartialEq)]
pub struct ExactStiffness {
    table: StretchTable,
}

/// The table sampled on a grid of strains and read trilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct GridStiffness {
    samples: Vec<[f64; 4]>,
}

/// Samples per axis, and samples per unit of strain.
const GRID: usize = 30;
const SAMPLES_PER_STRAIN: f64 = GRID as f64;
/// Strain of the first sample of the two normal components.
const GRID_START: f64 = -0.25;
/// Keeps an index below the last sample or row, so that the next one exists.
const INDEX_MARGIN: f64 = 1e-5;
const ROW_MARGIN: f64 = 1e-6;

impl ExactStiffness {
    /// The law of `table`.
    #[must_use]
    pub fn new(table: StretchTable) -> Self {
        Self { table }
    }
}

impl StretchStiffness for ExactStiffness {
    /// For C = 2G + I with largest eigenpair (λ, V): w = clamp(6(√λ - 1), 0, 1 - 10⁻⁶),
    /// a = clamp(8|∠V|/π, 0, 4 - 10⁻⁶), k = 2 max(0, (1 - w) row 0 + w (linear in a between rows
    /// 1 + ⌊a⌋ and 2 + ⌊a⌋)). `[eq:stretch-table]`
    fn at(&self, strain: Strain) -> [f64; 4] {
        let mean = strain.uu + strain.vv;
        let half_difference = strain.uu - strain.vv;
        let shear = 2.0 * strain.uv.abs();
        let largest = 1.0 + mean + half_difference.hypot(shear);
        let direction = 0.5 * shear.atan2(half_difference);
        let weight = (6.0 * (largest.max(0.0).sqrt() - 1.0)).clamp(0.0, 1.0 - ROW_MARGIN);
        let angle = (8.0 * direction / PI).clamp(0.0, 4.0 - ROW_MARGIN);
        let rows = &self.table.0;
        let low = angle as usize;
        let between = angle - low as f64;
        std::array::from_fn(|column| {
            let strained =
                (1.0 - between) * rows[1 + low][column] + between * rows[2 + low][column];
            2.0 * ((1.0 - weight) * rows[0][column] + weight * strained).max(0.0)
        })
    }
}

impl GridStiffness {
    /// Samples `table` at G00, G11 = -0.25 + i/30 and |G01| = i/30, i = 0 to 29.
    #[must_use]
    pub fn new(table: StretchTable) -> Self {
        let exact = ExactStiffness::new(table);
        let normal = |index: usize| GRID_START + index as f64 / SAMPLES_PER_STRAIN;
        let mut samples = Vec::with_capacity(GRID * GRID * GRID);
        for i in 0..GRID {
            for j in 0..GRID {
                for k in 0..GRID {
                    samples.push(exact.at(Strain {
                        uu: normal(i),
                        vv: normal(j),
                        uv: k as f64 / SAMPLES_PER_STRAIN,
                    }));
                }
            }
        }
        Self { samples }
    }
}

impl StretchStiffness for GridStiffness {
    /// Trilinear between the samples, at the grid's rim beyond it. `[eq:stretch-grid]`
    #[inline]
    fn at(&self, strain: Strain) -> [f64; 4] {
        let (i, s) = place((strain.uu - GRID_START) * SAMPLES_PER_STRAIN);
        let (j, t) = place((strain.vv - GRID_START) * SAMPLES_PER_STRAIN);
        let (k, r) = place(strain.uv.abs() * SAMPLES_PER_STRAIN);
        let corner = |di: usize, dj: usize| {
            let first = ((i + di) * GRID + j + dj) * GRID + k;
            let (near, far) = (&self.samples[first], &self.samples[first + 1]);
            std::array::from_fn::<f64, 4, _>(|c| (1.0 - r) * near[c] + r * far[c])
        };
        let (c00, c01, c10, c11) = (corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1));
        std::array::from_fn(|c| {
            (1.0 - s) * ((1.0 - t) * c00[c] + t * c01[c]) + s * ((1.0 - t) * c10[c] + t * c11[c])
        })
    }
}

/// Cell and place in it of an index clamped to the grid; a NaN reads the first cell.
#[inline]
fn place(index: f64) -> (usize, f64) {
    let index = index.clamp(0.0, (GRID - 1) as f64 - INDEX_MARGIN);
    let cell = index as usize;
    (cell, index - cell as f64)
}
