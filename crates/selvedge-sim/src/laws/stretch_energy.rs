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

mod backward;
mod fit;

pub(crate) use backward::{EnergySums, Form};
use selvedge_cloth::StretchTable;

use crate::laws::number::Number;
use crate::laws::stretch::{Elastic, Strain, StretchLaw};

/// The span m over which a ramp stiffens: two thirds of the strain of the measurements, 0.18.
const SPAN: f64 = 0.12;

/// A fabric's energy of stretching.
#[derive(Clone, Debug, PartialEq)]
pub struct StretchEnergy {
    /// (C0, C1, C2, C3) `[N/m]`: G·C·G = C0 G00² + 2 C1 G00 G11 + C2 G11² + 2 C3 G01².
    constant: [f64; 4],
    ramps: Vec<Ramp>,
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
    pub fn new(table: &StretchTable) -> Self {
        fit::fit(table)
    }

    /// Energy density `[J/m²]` at `strain`.
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

impl<N: Number> StretchLaw<N> for StretchEnergy {
    /// ∂W/∂G and ∂²W/∂G², both exact.
    #[inline(always)]
    fn at(&self, strain: Strain<N>, _stiffening: bool) -> Elastic<N> {
        let [c0, c1, c2, c3] = self.constant;
        let Strain { uu, vv, uv } = strain;
        let zero = uu.same(0.0);
        let (mut s0, mut s1, mut s2) = (zero, zero, zero);
        let [mut t0, mut t1, mut t2, mut t3, mut t4, mut t5] = [zero; 6];
        for Ramp { direction, weight } in &self.ramps {
            let [a0, a1, a2] = *direction;
            let rise = (uu * a0 + vv * a1 + uv * a2).at_least(0.0);
            let part = rise.at_most(SPAN);
            let stiffness = part * (weight * (1.0 / SPAN));
            // weight (part²/(2 SPAN) + rise - part), which is the same within and beyond.
            let slope = stiffness * (rise - part * 0.5);
            (s0, s1, s2) = (s0 + slope * a0, s1 + slope * a1, s2 + slope * a2);
            let (b0, b1, b2) = (stiffness * a0, stiffness * a1, stiffness * a2);
            (t0, t1, t2) = (t0 + b0 * a0, t1 + b0 * a1, t2 + b1 * a1);
            (t3, t4, t5) = (t3 + b2 * a2, t4 + b0 * a2, t5 + b1 * a2);
        }
        let stress = Strain {
            uu: uu * c0 + vv * c1 + s0,
            vv: vv * c2 + uu * c1 + s1,
            uv: (uv * (2.0 * c3) + s2) * 0.5,
        };
        Elastic {
            stress,
            tangent: [t0 + c0, t1 + c1, t2 + c2, t3 + 2.0 * c3, t4, t5],
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
fn positive_part<N: Number>(stress: Strain<N>) -> [N; 3] {
    let Strain { uu, vv, uv } = stress;
    let mean = (uu + vv) * 0.5;
    let difference = (uu - vv) * 0.5;
    let radius = (difference * difference + uv * uv).sqrt();
    let zero = uu.same(0.0);
    let (smallest, largest) = (mean - radius, mean + radius);
    // largest (I/2 + (S - mean I)/(2 radius)), with radius > 0 where it counts.
    let factor = N::pick(zero.below(largest), largest / (radius * 2.0), zero);
    let is_mixed = smallest.below(zero);
    [
        N::pick(is_mixed, factor * (radius + uu - mean), uu),
        N::pick(is_mixed, factor * (radius + vv - mean), vv),
        N::pick(is_mixed, factor * uv, uv),
    ]
}

#[cfg(test)]
mod tests;
