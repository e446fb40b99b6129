//! The measured stretch law (Wang, O'Brien and Ramamoorthi 2011): the stress of an anisotropic Green
//! strain energy whose stiffness k = (k0, k1, k2, k3) is looked up at the strain, and held constant
//! when differentiating. [`measured_stiffness`] is the look-up in the table itself,
//! [`GridStiffness`] that in ARCSim's 30³ samples of it.
//!
//! Conventions: k in N/m after the law's factor 2, never negative; the sign of the shear does not
//! matter. No sample of the grid is at zero strain, so the two differ even at rest. ARCSim takes
//! two absolute values in single precision, of a sample's direction and of the shear in a look-up.
//! With these roundings its numbers are met to 2e-15, without them to 2e-8.

use std::f64::consts::PI;

use selvedge_cloth::StretchTable;
use selvedge_cloth::geometry::atan2;

use crate::laws::stretch::{Elastic, Strain, StretchLaw};

/// The table sampled on a grid of strains and read trilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct GridStiffness {
    samples: Vec<[f64; 4]>,
}

/// Samples per axis.
const GRID: usize = 30;
/// Samples per unit of strain.
const SAMPLES_PER_STRAIN: f64 = GRID as f64;
/// Strain of the first sample of the two normal components.
const GRID_START: f64 = -0.25;
/// Margin that keeps an index below the last sample, so that the next one exists.
const INDEX_MARGIN: f64 = 1e-5;
/// Margin that keeps an index below the last row.
const ROW_MARGIN: f64 = 1e-6;

/// Stiffness (k0, k1, k2, k3) `[N/m]` of the table itself at `strain`.
///
/// For C = 2G + I with largest eigenpair (λ, V): w = clamp(6(√λ - 1), 0, 1 - 10⁻⁶),
/// a = clamp(8|∠V|/π, 0, 4 - 10⁻⁶), k = 2 max(0, (1 - w) row 0 + w (linear in a between rows
/// 1 + ⌊a⌋ and 2 + ⌊a⌋)). `[eq:stretch-table]`
pub fn measured_stiffness(table: &StretchTable, strain: Strain) -> [f64; 4] {
    let (largest, direction) = principal(strain);
    between_rows(table, largest, direction)
}

/// Largest eigenvalue of C = 2G + I, and the direction of its vector as a part of π, from 0 to 1/2.
fn principal(strain: Strain) -> (f64, f64) {
    let mean = strain.uu + strain.vv;
    let half_difference = strain.uu - strain.vv;
    let shear = 2.0 * strain.uv.abs();
    let spread = (half_difference * half_difference + shear * shear).sqrt();
    let direction = atan2(shear, half_difference);
    (1.0 + mean + spread, 0.5 * direction / PI)
}

/// Stiffness at an eigenvalue of C and a direction (part of π), linear between the rows.
fn between_rows(table: &StretchTable, largest: f64, direction: f64) -> [f64; 4] {
    let (weight, low, between) = row_place(largest, direction);
    let rows = &table.0;
    std::array::from_fn(|column| {
        let strained = (1.0 - between) * rows[1 + low][column] + between * rows[2 + low][column];
        2.0 * ((1.0 - weight) * rows[0][column] + weight * strained).max(0.0)
    })
}

/// Weight of the strained rows, the lower one of the two, and the weight of the other.
fn row_place(largest: f64, direction: f64) -> (f64, usize, f64) {
    let weight = (6.0 * (largest.max(0.0).sqrt() - 1.0)).clamp(0.0, 1.0 - ROW_MARGIN);
    let angle = (8.0 * direction).clamp(0.0, 4.0 - ROW_MARGIN);
    let low = angle as usize;
    (weight, low, angle - low as f64)
}

/// Adds to `by_table` the derivatives by the entries of `table`, from those by its stiffness at
/// `strain`, the inverse of [`measured_stiffness`].
pub(crate) fn pull_stiffness(
    table: &StretchTable,
    strain: Strain,
    by_stiffness: [f64; 4],
    by_table: &mut StretchTable,
) {
    let (largest, direction) = principal(strain);
    let (weight, low, between) = row_place(largest, direction);
    let stiffness = between_rows(table, largest, direction);
    for column in (0..4).filter(|column| stiffness[*column] > 0.0) {
        let by = 2.0 * by_stiffness[column];
        by_table.0[0][column] += by * (1.0 - weight);
        by_table.0[1 + low][column] += by * weight * (1.0 - between);
        by_table.0[2 + low][column] += by * weight * between;
    }
}

/// `value` in the precision of a single-precision absolute value of ARCSim.
#[inline(always)]
fn single(value: f64) -> f64 {
    f64::from(value.abs() as f32)
}

impl GridStiffness {
    /// Samples `table` at G00, G11 = -0.25 + i/30 and |G01| = i/30, i = 0 to 29, each with the
    /// principal direction (part of π) in single precision.
    pub fn new(table: StretchTable) -> Self {
        let normal = |index: usize| GRID_START + index as f64 / SAMPLES_PER_STRAIN;
        let mut samples = Vec::with_capacity(GRID * GRID * GRID);
        for i in 0..GRID {
            for j in 0..GRID {
                for k in 0..GRID {
                    let (largest, direction) = principal(Strain {
                        uu: normal(i),
                        vv: normal(j),
                        uv: k as f64 / SAMPLES_PER_STRAIN,
                    });
                    samples.push(between_rows(&table, largest, single(direction)));
                }
            }
        }
        Self { samples }
    }
}

impl StretchLaw for GridStiffness {
    /// The stress of k held constant, and a Jacobian that counts only tension: it is positive
    /// semidefinite if k0 k2 ≥ k1². With `stiffening` the Jacobian has k + dk/ds in place of k, no
    /// less than k on the diagonal, and is positive semidefinite: a linear solve far from its end
    /// needs that, since with k alone the Jacobian of a fabric that stiffens is too small by half
    /// and more. `[eq:stretch-growth]`
    #[inline(always)]
    fn at(&self, strain: Strain, stiffening: bool) -> Elastic {
        if !stiffening {
            let k = self.stiffness(strain);
            return elastic(strain, k, k);
        }
        let [stiffness, growth] = self.with_growth(strain);
        let grown = |index: usize| stiffness[index] + growth[index].max(0.0);
        let (k0, k2) = (grown(0), grown(2));
        let most = (k0 * k2).sqrt();
        // Not `clamp`, which panics where `most` is NaN: the solve names what is not finite.
        let k1 = (stiffness[1] + growth[1]).max(-most).min(most);
        elastic(strain, stiffness, [k0, k1, k2, grown(3)])
    }
}

/// Stress of `stiffness`, with a Jacobian of `grown`.
#[inline(always)]
fn elastic(strain: Strain, stiffness: [f64; 4], grown: [f64; 4]) -> Elastic {
    let [k0, k1, k2, k3] = stiffness;
    let (uu, vv) = (strain.uu.max(0.0), strain.vv.max(0.0));
    Elastic {
        stress: Strain {
            uu: k0 * strain.uu + k1 * strain.vv,
            vv: k2 * strain.vv + k1 * strain.uu,
            uv: k3 * strain.uv,
        },
        tangent: [grown[0], grown[1], grown[2], 2.0 * grown[3], 0.0, 0.0],
        tension: [k0 * uu + k1 * vv, k2 * vv + k1 * uu, 0.0],
    }
}

impl GridStiffness {
    /// Stiffness (k0, k1, k2, k3) `[N/m]` at `strain`. Trilinear between the samples at (G00, G11, |G01| in single precision); beyond the grid,
    /// that of its rim. `[eq:stretch-grid]`
    #[inline(always)]
    pub fn stiffness(&self, strain: Strain) -> [f64; 4] {
        let [stiffness, _] = self.with_growth(strain);
        stiffness
    }

    /// The stiffness, and dk/ds at s = 0 as the strain grows to (1 + s) times itself, both in N/m:
    /// G00 ∂k/∂G00 + G11 ∂k/∂G11 + |G01| ∂k/∂|G01| of the cell, nothing along an axis beyond the grid.
    #[inline(always)]
    fn with_growth(&self, strain: Strain) -> [[f64; 4]; 2] {
        let shear = single(strain.uv);
        let along = |value: f64, start: f64| {
            let index = (value - start) * SAMPLES_PER_STRAIN;
            let (cell, part) = place(index);
            let inside = (0.0..(GRID - 1) as f64 - INDEX_MARGIN).contains(&index);
            let rate = if inside { value * SAMPLES_PER_STRAIN } else { 0.0 };
            (cell, part, rate)
        };
        let (i, s, rate_s) = along(strain.uu, GRID_START);
        let (j, t, rate_t) = along(strain.vv, GRID_START);
        let (k, r, rate_r) = along(shear, 0.0);
        let corner = |di: usize, dj: usize| {
            let first = ((i + di) * GRID + j + dj) * GRID + k;
            let (near, far) = (&self.samples[first], &self.samples[first + 1]);
            (between(near, far, r), minus(far, near))
        };
        let ((c00, d00), (c01, d01)) = (corner(0, 0), corner(0, 1));
        let ((c10, d10), (c11, d11)) = (corner(1, 0), corner(1, 1));
        let (low, high) = (between(&c00, &c01, t), between(&c10, &c11, t));
        let by_r = between(&between(&d00, &d01, t), &between(&d10, &d11, t), s);
        let by_t = between(&minus(&c01, &c00), &minus(&c11, &c10), s);
        let by_s = minus(&high, &low);
        let growth =
            std::array::from_fn(|c| rate_r * by_r[c] + rate_t * by_t[c] + rate_s * by_s[c]);
        [between(&low, &high, s), growth]
    }
}

/// Linear between `from` and `to`.
#[inline(always)]
fn between(from: &[f64; 4], to: &[f64; 4], part: f64) -> [f64; 4] {
    std::array::from_fn(|c| (1.0 - part) * from[c] + part * to[c])
}

#[inline(always)]
fn minus(a: &[f64; 4], b: &[f64; 4]) -> [f64; 4] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// Cell and place in it of an index clamped to the grid; a NaN reads the first cell.
#[inline(always)]
fn place(index: f64) -> (usize, f64) {
    let index = index.clamp(0.0, (GRID - 1) as f64 - INDEX_MARGIN);
    let cell = index as usize;
    (cell, index - cell as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: StretchTable = StretchTable([
        [16.0, -14.0, 34.0, 36.0],
        [46.0, 53.0, 261.0, -29.0],
        [49.0, 87.0, 206.0, 22.0],
        [123.0, 105.0, 365.0, 44.0],
        [139.0, 73.0, 413.0, -174.0],
        [127.0, 85.0, 405.0, 32.0],
    ]);

    #[test]
    fn growth_is_the_derivative_along_the_strain() {
        let law = GridStiffness::new(TABLE);
        let check = |strain: Strain| {
            let [_, growth] = law.with_growth(strain);
            let scaled = |s: f64| {
                law.stiffness(Strain {
                    uu: (1.0 + s) * strain.uu,
                    vv: (1.0 + s) * strain.vv,
                    uv: (1.0 + s) * strain.uv,
                })
            };
            let step = 1e-4;
            let (before, after) = (scaled(-step), scaled(step));
            for c in 0..4 {
                let slope = (after[c] - before[c]) / (2.0 * step);
                // The shear is rounded to single precision: 1e-8 of slopes of up to 1e3 over 1e-4.
                let found = growth[c];
                assert!(
                    (found - slope).abs() < 0.2,
                    "{strain:?} {c}: {found} {slope}"
                );
            }
        };
        let strains = [
            [0.06, 0.02, 0.01],
            [0.12, -0.06, 0.03],
            [-0.08, 0.09, -0.05],
            [-0.1, -0.12, 0.01],
            [0.9, 0.11, 0.02],
        ];
        for [uu, vv, uv] in strains {
            check(Strain { uu, vv, uv });
        }
        // It does grow: these fabrics stiffen. Half of the strain of a stretch of 7/6.
        let half = Strain {
            uu: 0.25 * ((7.0_f64 / 6.0).powi(2) - 1.0),
            ..Strain::default()
        };
        let [stiffness, growth] = law.with_growth(half);
        assert!(growth[0] > 0.3 * stiffness[0]);
    }
}
