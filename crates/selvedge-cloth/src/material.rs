//! A fabric: density, damping, and the stiffness tables of the data-driven model of Wang,
//! O'Brien and Ramamoorthi 2011, measured or made from the constants of an isotropic sheet
//! ([`crate::Isotropic`]). The laws that read the tables are physics and live in `selvedge-sim`.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, require};

/// Largest damping `[s]`: some ten thousand times that of cloth, and far from where the numbers of
/// a solve lose their digits.
const LARGEST_DAMPING: f64 = 100.0;

/// A fabric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Name of the material.
    pub name: String,
    /// Source of the numbers.
    #[serde(default)]
    pub source: String,
    /// Mass per area `[kg/m²]`.
    pub density: f64,
    /// Stiffness-proportional damping `[s]`, at most 100.
    #[serde(default)]
    pub damping: f64,
    /// Resistance to stretching.
    pub stretch: StretchTable,
    /// Resistance to bending.
    pub bend: BendTable,
}

/// In-plane stiffness: rows = zero strain, then principal stretch 1 + 1/6 with its direction at
/// 0, 22.5, 45, 67.5 and 90° from the course axis; columns = k0 (uu), k1 (coupling), k2 (vv),
/// k3 (shear) `[N/m]`, before the factor 2 of the law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StretchTable(pub [[f64; 4]; 6]);

/// Bending stiffness `[N·m]`: rows = edge direction in material space at 0, 45 and 90°, columns =
/// curvature 0 to 4.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BendTable(pub [[f64; 5]; 3]);

impl Material {
    /// The material with its tables multiplied: `stretch` and `bend` times as stiff.
    #[must_use]
    pub fn multiplied(mut self, stretch: f64, bend: f64) -> Self {
        let tables = self.stretch.0.as_flattened_mut().iter_mut();
        tables.for_each(|k| *k *= stretch);
        let tables = self.bend.0.as_flattened_mut().iter_mut();
        tables.for_each(|k| *k *= bend);
        self
    }

    /// Checks density, damping and that the tables are finite.
    ///
    /// # Errors
    /// Names the material, the field and the value.
    pub fn validate(&self) -> Result<(), SceneError> {
        let check = |holds, field: &str, expected, found: f64| {
            let field = format!("material {}: {field}", self.name);
            require(holds, &field, expected, found)
        };
        let holds = self.density.is_finite() && self.density > 0.0;
        check(holds, "density", "finite and positive", self.density)?;
        let holds = (0.0..=LARGEST_DAMPING).contains(&self.damping);
        check(holds, "damping", "between 0 and 100 s", self.damping)?;
        for &k in self.stretch.0.as_flattened() {
            check(k.is_finite(), "stretch", "finite everywhere", k)?;
        }
        for &k in self.bend.0.as_flattened() {
            let holds = k.is_finite() && k >= 0.0;
            check(holds, "bend", "finite and not negative everywhere", k)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses;

    fn material() -> Material {
        Material {
            name: "felt".into(),
            source: String::new(),
            density: 0.2,
            damping: 0.0,
            // Coupling and shear may be negative: the law cuts them off where it must.
            stretch: StretchTable([[30.0, -12.5, 44.0, -30.0]; 6]),
            bend: BendTable([[2e-5, 3e-5, 3e-5, 2.5e-5, 1e-5]; 3]),
        }
    }

    #[test]
    fn wrong_values_are_named() {
        refuses(
            &material(),
            Material::validate,
            &[
                ("material felt: density must", |m| m.density = 0.0),
                ("material felt: density must", |m| m.density = f64::NAN),
                ("material felt: damping must", |m| m.damping = -1.0),
                ("material felt: damping must", |m| m.damping = 1e9),
                ("material felt: stretch must", |m| {
                    m.stretch.0[5][3] = f64::INFINITY;
                }),
                ("material felt: bend must", |m| m.bend.0[2][4] = -1e-6),
                ("material felt: bend must", |m| m.bend.0[0][0] = f64::NAN),
            ],
        );
    }

    #[test]
    fn multipliers_act_on_every_entry_of_their_table() {
        let (mut expected, found) = (material(), material().multiplied(2.0, 10.0));
        expected.stretch.0 = expected.stretch.0.map(|row| row.map(|k| 2.0 * k));
        expected.bend.0 = expected.bend.0.map(|row| row.map(|k| 10.0 * k));
        assert_eq!(found, expected);
    }
}
