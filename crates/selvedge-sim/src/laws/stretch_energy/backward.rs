//! Derivatives of a solve's force and Jacobian by strain and by the numbers of the energy.

use selvedge_cloth::StretchTable;

use super::{Ramp, SPAN, StretchEnergy, fit, positive_part};
use crate::laws::number::Dual;
use crate::laws::stretch::Strain;

/// A sum of derivatives by the numbers of an energy.
#[derive(Clone, Debug)]
pub(crate) struct EnergySums {
    constant: [f64; 4],
    ramps: Vec<f64>,
    /// Numbers of the ramps that rise in the form under way, with slope and stiffness of each for a weight of 1,
    /// and the product of its rises along l and w.
    rising: Vec<(usize, [f64; 3])>,
}

/// The form γ W'·l + l·W''·w + T:X of an element at its strain, where strains, and what multiplies
/// them, are (G00, G11, G01).
#[derive(Clone, Copy)]
pub(crate) struct Form {
    pub(crate) strain: Strain,
    pub(crate) gamma: f64,
    /// Strain along the multipliers.
    pub(crate) l: [f64; 3],
    /// Strain along the velocities.
    pub(crate) w: [f64; 3],
    /// X: what multiplies T00, T11 and T01.
    pub(crate) x: [f64; 3],
}

/// Derivatives of a [`Form`], and its tension.
pub(crate) struct FormSlopes {
    pub(crate) by_strain: [f64; 3],
    pub(crate) by_l: [f64; 3],
    pub(crate) by_w: [f64; 3],
    pub(crate) tension: [f64; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn add(sum: &mut [f64; 3], direction: [f64; 3], by: f64) {
    for (sum, direction) in sum.iter_mut().zip(direction) {
        *sum += direction * by;
    }
}

impl StretchEnergy {
    /// Sums of 0.
    pub(crate) fn no_sums(&self) -> EnergySums {
        EnergySums {
            constant: [0.0; 4],
            ramps: vec![0.0; self.ramps.len()],
            rising: Vec::with_capacity(self.ramps.len()),
        }
    }

    /// The derivatives of `form`; those by this energy's numbers times `scale` go into `sums`.
    pub(crate) fn slopes(&self, form: &Form, scale: f64, sums: &mut EnergySums) -> FormSlopes {
        let Form {
            strain: Strain { uu, vv, uv },
            gamma,
            l,
            w,
            x,
        } = *form;
        let [c0, c1, c2, c3] = self.constant;
        let strain = [uu, vv, uv];
        // W', W''l and W''w.
        let constant = |[a, b, c]: [f64; 3]| [c0 * a + c1 * b, c2 * b + c1 * a, 2.0 * c3 * c];
        let [mut stress, mut by_w, mut along_w] = [strain, l, w].map(constant);
        let mut by_strain = [0.0; 3];
        sums.rising.clear();
        for (k, Ramp { direction, weight }) in self.ramps.iter().enumerate() {
            let a = *direction;
            let rise = dot(a, strain);
            if rise <= 0.0 {
                continue;
            }
            let part = rise.min(SPAN);
            let stiffness = part * (1.0 / SPAN);
            let slope = stiffness * (rise - 0.5 * part);
            let (along_l, with_w) = (dot(a, l), dot(a, w));
            let stiff = weight * stiffness;
            add(&mut stress, a, weight * slope);
            add(&mut by_w, a, stiff * along_l);
            add(&mut along_w, a, stiff * with_w);
            if rise < SPAN {
                add(&mut by_strain, a, weight * (1.0 / SPAN) * along_l * with_w);
            }
            sums.rising.push((k, [slope, stiffness, along_l * with_w]));
        }
        // T is the gradient of a function of the stress: the derivative of T:X is that of T along X.
        let dual = |value, rate| Dual {
            value,
            rates: [rate],
        };
        let [s0, s1, s2] = [stress[0], stress[1], 0.5 * stress[2]];
        let tension = positive_part(Strain {
            uu: dual(s0, x[0]),
            vv: dual(s1, x[1]),
            uv: dual(s2, 0.5 * x[2]),
        });
        // What multiplies W' as the strain changes.
        let mut by_stress = tension.map(|t| t.rates[0]);
        add(&mut by_stress, l, gamma);
        add(&mut by_strain, constant(by_stress), 1.0);
        for (k, [slope, stiffness, product]) in &sums.rising {
            let Ramp { direction, weight } = self.ramps[*k];
            let along = dot(direction, by_stress);
            add(&mut by_strain, direction, weight * stiffness * along);
            sums.ramps[*k] += scale * (slope * along + stiffness * product);
        }
        let q = by_stress;
        let products = [
            uu * q[0] + l[0] * w[0],
            vv * q[0] + uu * q[1] + l[0] * w[1] + l[1] * w[0],
            vv * q[1] + l[1] * w[1],
            2.0 * (uv * q[2] + l[2] * w[2]),
        ];
        for (sum, product) in sums.constant.iter_mut().zip(products) {
            *sum += scale * product;
        }
        add(&mut along_w, stress, gamma);
        FormSlopes {
            by_strain,
            by_l: along_w,
            by_w,
            tension: tension.map(|t| t.value),
        }
    }

    /// The derivatives by the entries of the `table` to which this energy was fitted. Those of a
    /// table that says the same at all strains are of all rows alike.
    pub(crate) fn by_table(&self, table: &StretchTable, sums: &EnergySums) -> StretchTable {
        fit::pull_back(table, sums.constant, &sums.ramps)
    }
}
