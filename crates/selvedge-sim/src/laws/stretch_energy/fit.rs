//! The fit of an energy to a measured fabric: non-negative least squares (Lawson and Hanson 1974).

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

use selvedge_cloth::StretchTable;
use selvedge_cloth::geometry::sin_cos;

use super::{Ramp, SPAN, StretchEnergy};
use crate::laws::stretch::Strain;
use crate::laws::stretch_table::{measured_stiffness, pull_stiffness};

/// Strain below which the error of the stress counts as at this strain: elsewhere it is relative to
/// the strain.
const LEAST_STRAIN: f64 = 0.004;

/// Directions of the rank-one forms of which the constant part is a sum, over half a turn.
const CONSTANTS: usize = 12;

/// A sum of these with non-negative weights is a fitted energy.
enum Term {
    /// (a·G)²/2 with a = (cos, sin, 0), or G01² with none.
    Constant(Option<[f64; 2]>),
    /// A ramp along a direction, and one along its mirror image, in which the shear changes sign.
    Ramp([f64; 3]),
}

/// The energy whose stress is nearest to that of `table`.
pub(super) fn fit(table: &StretchTable) -> StretchEnergy {
    if let Some(constant) = constant(table) {
        let ramps = Vec::new();
        return StretchEnergy { constant, ramps };
    }
    let Fitted { terms, weights, .. } = fitted(table);
    let (mut constant, mut ramps) = ([0.0; 4], Vec::new());
    for (term, weight) in terms.iter().zip(weights) {
        if weight > 0.0 {
            term.add_to(&mut constant, &mut ramps, weight);
        }
    }
    StretchEnergy { constant, ramps }
}

/// The least squares of a fit, and their solution.
struct Fitted {
    terms: Vec<Term>,
    gram: Vec<f64>,
    weights: Vec<f64>,
}

fn fitted(table: &StretchTable) -> Fitted {
    let terms = terms();
    let size = terms.len();
    let mut gram = vec![0.0; size * size];
    let mut right = vec![0.0; size];
    for strain in samples() {
        let columns = columns(&terms, strain);
        let measured = mandel(measured_stress(table, strain)).map(|s| s * weight(strain));
        for (row, a) in columns.iter().enumerate() {
            right[row] += dot(*a, measured);
            for (column, b) in columns.iter().enumerate() {
                gram[row * size + column] += dot(*a, *b);
            }
        }
    }
    let weights = non_negative_least_squares(&gram, &right);
    Fitted {
        terms,
        gram,
        weights,
    }
}

/// Weighted stresses of all terms at a sample.
fn columns(terms: &[Term], strain: Strain) -> Vec<[f64; 3]> {
    let weight = weight(strain);
    let columns = terms.iter();
    columns
        .map(|term| mandel(term.stress(strain)).map(|s| s * weight))
        .collect()
}

/// Derivatives by the entries of `table`, from those by the numbers of the energy that was fitted to
/// it: the terms that have a weight keep having one.
pub(super) fn pull_back(
    table: &StretchTable,
    by_constant: [f64; 4],
    by_ramps: &[f64],
) -> StretchTable {
    let mut by_table = StretchTable([[0.0; 4]; 6]);
    if constant(table).is_some() {
        let row: [f64; 4] =
            std::array::from_fn(
                |k| {
                    if table.0[0][k] > 0.0 { by_constant[k] / 3.0 } else { 0.0 }
                },
            );
        by_table.0 = [row; 6];
        return by_table;
    }
    let Fitted {
        terms,
        gram,
        weights,
    } = fitted(table);
    let free: Vec<usize> = (0..terms.len()).filter(|k| weights[*k] > 0.0).collect();
    let mut ramps = by_ramps.iter();
    let [c0, c1, c2, c3] = by_constant;
    let mut by_weights = vec![0.0; terms.len()];
    for &k in &free {
        by_weights[k] = match &terms[k] {
            Term::Constant(None) => c3,
            Term::Constant(Some([a0, a1])) => c0 * a0 * a0 + c1 * a0 * a1 + c2 * a1 * a1,
            Term::Ramp(direction) => ramps.by_ref().take(mirrored(*direction).count()).sum(),
        };
    }
    let Some(multipliers) = solve_free(&gram, &by_weights, &free) else {
        return by_table;
    };
    for strain in samples() {
        let columns = columns(&terms, strain);
        let mut by_stress = [0.0; 3];
        for (&k, multiplier) in free.iter().zip(&multipliers) {
            for (sum, entry) in by_stress.iter_mut().zip(columns[k]) {
                *sum += multiplier * entry * weight(strain);
            }
        }
        let Strain { uu, vv, uv } = strain;
        let [by_uu, by_vv, by_uv] = by_stress;
        let by_stiffness = [
            by_uu * uu,
            by_uu * vv + by_vv * uu,
            by_vv * vv,
            SQRT_2 * by_uv * uv,
        ];
        pull_stiffness(table, strain, by_stiffness, &mut by_table);
    }
    by_table
}

/// Stiffness of a fabric that is the same at all strains; none of one that changes, or whose
/// quadratic form is indefinite.
fn constant(table: &StretchTable) -> Option<[f64; 4]> {
    let [first, others @ ..] = table.0;
    let k = first.map(|k| 2.0 * k.max(0.0));
    let definite = k[1] * k[1] <= k[0] * k[2];
    (definite && others.iter().all(|row| *row == first)).then_some(k)
}

/// Stress of the measured law at `strain` `[N/m]`, whose shear is half of ∂W/∂G01.
pub(super) fn measured_stress(table: &StretchTable, strain: Strain) -> Strain {
    let [k0, k1, k2, k3] = measured_stiffness(table, strain);
    Strain {
        uu: k0 * strain.uu + k1 * strain.vv,
        vv: k2 * strain.vv + k1 * strain.uu,
        uv: k3 * strain.uv,
    }
}

/// Weight of a sample's error: that of the stress over the strain.
pub(super) fn weight(strain: Strain) -> f64 {
    1.0 / (dot(mandel(strain), mandel(strain)).sqrt() + LEAST_STRAIN)
}

/// Components whose product is that of the tensors.
pub(super) fn mandel(tensor: Strain) -> [f64; 3] {
    [tensor.uu, tensor.vv, SQRT_2 * tensor.uv]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Strain with principal values along `angle` and across it.
pub(super) fn principal(along: f64, across: f64, angle: f64) -> Strain {
    let (sine, cosine) = sin_cos(angle);
    Strain {
        uu: along * cosine * cosine + across * sine * sine,
        vv: along * sine * sine + across * cosine * cosine,
        uv: (along - across) * sine * cosine,
    }
}

/// Strains at which the stress is fitted: tension up to that of the measurements with any strain
/// across it, in nine directions, and some compression.
fn samples() -> Vec<Strain> {
    const TENSION: [f64; 10] = [
        0.0025, 0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.14, 0.18,
    ];
    const ACROSS: [f64; 7] = [-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0];
    let mut samples = Vec::new();
    for along in TENSION {
        for ratio in ACROSS {
            let angles = (0..9).map(|k| FRAC_PI_2 * f64::from(k) / 8.0);
            samples.extend(angles.map(|angle| principal(along, ratio * along, angle)));
        }
    }
    for across in [-0.005, -0.02] {
        for ratio in [0.0, 0.5, 1.0] {
            let angles = (0..5).map(|k| FRAC_PI_2 * f64::from(k) / 4.0);
            samples.extend(angles.map(|angle| principal(ratio * across, across, angle)));
        }
    }
    samples
}

/// Constant forms, and ramps in directions spread over half a sphere of strains, their shear not
/// negative: their mirror images come with them.
fn terms() -> Vec<Term> {
    const ELEVATIONS: usize = 3;
    let mut terms: Vec<Term> = (0..CONSTANTS)
        .map(|k| sin_cos(PI * k as f64 / CONSTANTS as f64))
        .map(|(sine, cosine)| Term::Constant(Some([cosine, sine])))
        .collect();
    terms.push(Term::Constant(None));
    for k in 0..=ELEVATIONS {
        let (height, radius) = sin_cos(FRAC_PI_2 * k as f64 / ELEVATIONS as f64);
        let around = ((4.0 * ELEVATIONS as f64 * radius).round() as usize).max(1);
        for j in 0..around {
            let (sine, cosine) = sin_cos(2.0 * PI * j as f64 / around as f64);
            let shear = if k == 0 { 0.0 } else { SQRT_2 * height };
            terms.push(Term::Ramp([radius * cosine, radius * sine, shear]));
        }
    }
    terms
}

impl Term {
    /// Stress of the term with weight 1.
    fn stress(&self, strain: Strain) -> Strain {
        match self {
            Self::Constant(None) => Strain {
                uv: strain.uv,
                ..Strain::default()
            },
            Self::Constant(Some([a0, a1])) => {
                let along = a0 * strain.uu + a1 * strain.vv;
                Strain {
                    uu: a0 * along,
                    vv: a1 * along,
                    uv: 0.0,
                }
            }
            Self::Ramp(direction) => {
                let mut stress = Strain::default();
                for direction in mirrored(*direction) {
                    let along = Ramp {
                        direction,
                        weight: 1.0,
                    }
                    .along(strain);
                    let part = along.clamp(0.0, SPAN);
                    let slope = part * part / (2.0 * SPAN) + (along - part).max(0.0);
                    stress.uu += slope * direction[0];
                    stress.vv += slope * direction[1];
                    stress.uv += 0.5 * slope * direction[2];
                }
                stress
            }
        }
    }

    fn add_to(&self, constant: &mut [f64; 4], ramps: &mut Vec<Ramp>, weight: f64) {
        match self {
            Self::Constant(None) => constant[3] += weight,
            Self::Constant(Some([a0, a1])) => {
                constant[0] += weight * a0 * a0;
                constant[1] += weight * a0 * a1;
                constant[2] += weight * a1 * a1;
            }
            Self::Ramp(direction) => {
                ramps.extend(mirrored(*direction).map(|direction| Ramp { direction, weight }));
            }
        }
    }
}

/// A direction and its mirror image, if that is another.
fn mirrored(direction: [f64; 3]) -> impl Iterator<Item = [f64; 3]> {
    let [a0, a1, a2] = direction;
    let image = (a2 != 0.0).then_some([a0, a1, -a2]);
    std::iter::once(direction).chain(image)
}

/// The x ≥ 0 that minimises xᵀ`gram` x/2 - `right`ᵀx.
///
/// The active-set method: one variable after the other is freed where the gradient wants it to
/// grow, and those that would become negative are held at 0 again.
fn non_negative_least_squares(gram: &[f64], right: &[f64]) -> Vec<f64> {
    let size = right.len();
    let scale = right.iter().fold(0.0_f64, |most, r| most.max(r.abs()));
    let mut x = vec![0.0; size];
    let mut free: Vec<usize> = Vec::new();
    // Each round lowers the objective, so the sets of free variables do not repeat; the bound is
    // for rounding.
    for _ in 0..10 * size {
        let descent = |k: usize| {
            let row = &gram[k * size..(k + 1) * size];
            right[k] - row.iter().zip(&x).map(|(g, x)| g * x).sum::<f64>()
        };
        let held = (0..size).filter(|k| !free.contains(k));
        let steepest = held
            .map(|k| (k, descent(k)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match steepest {
            Some((k, descent)) if descent > 1e-10 * scale => free.push(k),
            _ => break,
        }
        loop {
            // None: the last one is a combination of the others, and nothing is left to gain.
            let Some(solution) = solve_free(gram, right, &free) else {
                return x;
            };
            let bound = free.iter().zip(&solution).filter(|(_, s)| **s <= 0.0);
            let step = bound
                .map(|(k, s)| x[*k] / (x[*k] - s))
                .fold(1.0_f64, f64::min);
            for (k, solution) in free.iter().zip(&solution) {
                x[*k] += step * (solution - x[*k]);
            }
            if step >= 1.0 {
                break;
            }
            let negligible = 1e-14 * x.iter().fold(0.0_f64, |most, x| most.max(*x));
            free.retain(|k| x[*k] > negligible);
            for (k, x) in x.iter_mut().enumerate() {
                if !free.contains(&k) {
                    *x = 0.0;
                }
            }
        }
    }
    x
}

/// Solution of the equations of the `free` variables alone, by Cholesky; none if they are singular
/// to rounding.
fn solve_free(gram: &[f64], right: &[f64], free: &[usize]) -> Option<Vec<f64>> {
    let (size, count) = (right.len(), free.len());
    let mut factor = vec![0.0; count * count];
    for i in 0..count {
        for j in 0..=i {
            let known: f64 = (0..j)
                .map(|k| factor[i * count + k] * factor[j * count + k])
                .sum();
            let entry = gram[free[i] * size + free[j]];
            let rest = entry - known;
            factor[i * count + j] = if i > j {
                rest / factor[j * count + j]
            } else if rest > 1e-12 * entry {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    let mut solution: Vec<f64> = free.iter().map(|k| right[*k]).collect();
    for i in 0..count {
        let known: f64 = (0..i).map(|k| factor[i * count + k] * solution[k]).sum();
        solution[i] = (solution[i] - known) / factor[i * count + i];
    }
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count)
            .map(|k| factor[k * count + i] * solution[k])
            .sum();
        solution[i] = (solution[i] - known) / factor[i * count + i];
    }
    Some(solution)
}
