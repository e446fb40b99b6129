//! A stretch law that is the gradient of an energy, fitted to a measured fabric.
//!
//! The measured law (Wang, O'Brien and Ramamoorthi 2011) is a stress k(G) G whose looked-up
//! stiffness k depends on strain. It is the gradient of no energy: around a closed path of strains
//! it does work, in three of the four shipped fabrics more than the elastic energy of the path. The
//! energy density here is
//!
//! W(G) = G·C·G/2 + Σ w_j R(a_j·G), R''(s) = clamp(s/m, 0, 1),
//!
//! an orthotropic quadratic form, and ramps along directions a_j in the space of strains that
//! stiffen up to a span m, with weights w_j ≥ 0. It is convex in G whatever the weights, and its
//! stress and tangent are exact. C and w are the least-squares fit to the measured
//! stress. `[eq:stretch-energy]`

mod fit;

use selvedge_cloth::StretchTable;

use crate::laws::strain::Strain;
use crate::laws::stretch::{Elastic, StretchLaw};

/// The span m over which a ramp stiffens: two thirds of the strain of the measurements, 0.18.
const SPAN: f64 = 0.12;

/// A fabric's energy of stretching.
#[derive(Clone, Debug, PartialEq)]
pub struct StretchEnergy {
    /// (C0, C1, C2, C3) `[N/m]`: G·C·G = C0 G00² + 2 C1 G00 G11 + C2 G11² + 2 C3 G01².
    constant: [f64; 4],
    ramps: Vec<Ramp>,
    /// The ramps again, as [`StretchLaw::at`] takes them.
    lanes: Vec<Lanes>,
}

/// Ramps that are evaluated side by side.
const LANES: usize = 2;

/// As many ramps as are evaluated side by side; those that are missing have no weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Lanes {
    direction: [[f64; LANES]; 3],
    weight: [f64; LANES],
}

/// A ramp of stiffness along a direction of strains.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ramp {
    /// a·G = a0 G00 + a1 G11 + a2 G01.
    direction: [f64; 3],
    /// Stiffness at the end of the span `[N/m]`.
    weight: f64,
}

impl StretchEnergy {
    /// The energy fitted to `table`. A table that says the same at all strains, with k1² ≤ k0 k2,
    /// is met exactly.
    #[must_use]
    pub fn new(table: &StretchTable) -> Self {
        fit::fit(table)
    }

    fn of(constant: [f64; 4], ramps: Vec<Ramp>) -> Self {
        let lanes = ramps.chunks(LANES).map(|chunk| {
            let mut lanes = Lanes::default();
            for (lane, ramp) in chunk.iter().enumerate() {
                for (of_axis, along) in lanes.direction.iter_mut().zip(ramp.direction) {
                    of_axis[lane] = along;
                }
                lanes.weight[lane] = ramp.weight;
            }
            lanes
        });
        Self {
            constant,
            lanes: lanes.collect(),
            ramps,
        }
    }

    /// Energy density `[J/m²]` at `strain`.
    #[must_use]
    pub fn energy(&self, strain: Strain) -> f64 {
        let [c0, c1, c2, c3] = self.constant;
        let Strain { uu, vv, uv } = strain;
        let quadratic = 0.5 * (c0 * uu * uu + c2 * vv * vv) + c1 * uu * vv + c3 * uv * uv;
        let ramps = self.ramps.iter().map(|ramp| {
            let along = ramp.along(strain);
            let (part, beyond) = (along.clamp(0.0, SPAN), (along - SPAN).max(0.0));
            let within = part.powi(3) / (6.0 * SPAN);
            ramp.weight * (within + 0.5 * beyond * (SPAN + beyond))
        });
        quadratic + ramps.sum::<f64>()
    }
}

impl StretchLaw for StretchEnergy {
    /// ∂W/∂G and ∂²W/∂G², both exact.
    #[inline(always)]
    fn at(&self, strain: Strain, _stiffening: bool) -> Elastic {
        let [c0, c1, c2, c3] = self.constant;
        // Three sums of the stress and six of the tangent.
        let mut sums = [[0.0; LANES]; 9];
        for Lanes { direction, weight } in &self.lanes {
            for lane in 0..LANES {
                let [a0, a1, a2] = direction.map(|along| along[lane]);
                let along = a0 * strain.uu + a1 * strain.vv + a2 * strain.uv;
                // Not `clamp`: a NaN must stay one.
                let rise = if along < 0.0 { 0.0 } else { along };
                let part = if rise > SPAN { SPAN } else { rise };
                let stiffness = weight[lane] * (1.0 / SPAN) * part;
                // weight (part²/(2 SPAN) + rise - part), which is the same within and beyond.
                let slope = stiffness * (rise - 0.5 * part);
                let (b0, b1, b2) = (stiffness * a0, stiffness * a1, stiffness * a2);
                let terms = [
                    slope * a0,
                    slope * a1,
                    slope * a2,
                    b0 * a0,
                    b0 * a1,
                    b1 * a1,
                    b2 * a2,
                    b0 * a2,
                    b1 * a2,
                ];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[lane] += term;
                }
            }
        }
        let [s0, s1, s2, t0, t1, t2, t3, t4, t5] = sums.map(|lanes| lanes.iter().sum::<f64>());
        let stress = [
            c0 * strain.uu + c1 * strain.vv + s0,
            c2 * strain.vv + c1 * strain.uu + s1,
            2.0 * c3 * strain.uv + s2,
        ];
        let tangent = [c0 + t0, c1 + t1, c2 + t2, 2.0 * c3 + t3, t4, t5];
        let stress = Strain {
            uu: stress[0],
            vv: stress[1],
            uv: 0.5 * stress[2],
        };
        Elastic {
            stress,
            tangent,
            tension: positive_part(stress),
        }
    }
}

impl Ramp {
    #[inline(always)]
    fn along(&self, strain: Strain) -> f64 {
        let [a0, a1, a2] = self.direction;
        a0 * strain.uu + a1 * strain.vv + a2 * strain.uv
    }
}

/// The positive semidefinite part of a stress: without its compression.
#[inline(always)]
fn positive_part(stress: Strain) -> [f64; 3] {
    let Strain { uu, vv, uv } = stress;
    let mean = 0.5 * (uu + vv);
    let difference = 0.5 * (uu - vv);
    let radius = (difference * difference + uv * uv).sqrt();
    if mean - radius >= 0.0 {
        return [uu, vv, uv];
    }
    let largest = mean + radius;
    if largest <= 0.0 {
        return [0.0; 3];
    }
    // largest (I/2 + (S - mean I)/(2 radius)), and radius > 0 here.
    let factor = largest / (2.0 * radius);
    [
        factor * (radius + uu - mean),
        factor * (radius + vv - mean),
        factor * uv,
    ]
}

#[cfg(test)]
mod tests;
