//! A fabric: density, damping, and the stiffness tables of the data-driven model of Wang,
//! O'Brien and Ramamoorthi 2011, measured or made from the constants of an isotropic sheet
//! ([`crate::Isotropic`]). The laws that read the tables are physics and live in `selvedge-sim`.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, is_default, require};

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
    /// Resistance to being pressed together.
    #[serde(default, skip_serializing_if = "is_default")]
    pub compression: Compression,
}

/// How a fabric that two bodies squeeze yields to pressure: the pressures under which its gap to either is a
/// half and a third of the scene's `contact.thickness`, at which it begins to bear.
///
/// Half of that is the nominal thickness, which compression testers measure at about 0.5 kPa; most fabrics
/// have two thirds of it at 5 kPa. The pressure of a gap g is p₀ (exp(s (1 - g/ĝ)) - 1), ĝ being the
/// thickness, with p₀ and s from the two. `[eq:contact-pressure]`
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compression {
    /// Pressure at half of `contact.thickness` `[Pa]`.
    pub half: f64,
    /// Pressure at a third of it `[Pa]`, more than 1.5 times as much.
    pub third: f64,
}

impl Default for Compression {
    fn default() -> Self {
        Self {
            half: 500.0,
            third: 5000.0,
        }
    }
}

impl Compression {
    /// p₀ `[Pa]` and s.
    pub fn constants(self) -> [f64; 2] {
        // With x = exp(s/6) the ratio of the two pressures is (x⁴ - 1)/(x³ - 1).
        let ratio = self.third / self.half;
        let mut x = ratio;
        for _ in 0..64 {
            x = ratio - (ratio - 1.0) / (x * x * x);
        }
        [self.half / (x * x * x - 1.0), 6.0 * libm::log(x)]
    }

    /// Pressure of a gap `[Pa]`, which is this part of `contact.thickness`.
    pub fn pressure(self, part: f64) -> f64 {
        let [least, rise] = self.constants();
        least * libm::expm1(rise * (1.0 - part)).max(0.0)
    }

    /// Gap under this pressure `[Pa]`, as a part of `contact.thickness`.
    pub fn gap(self, pressure: f64) -> f64 {
        let [least, rise] = self.constants();
        1.0 - libm::log1p(pressure / least) / rise
    }
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
        let Compression { half, third } = self.compression;
        let holds = half.is_finite() && half > 0.0;
        check(holds, "compression.half", "finite and positive", half)?;
        let holds = third.is_finite() && third > 1.5 * half;
        let expected = "finite and more than 1.5 times compression.half";
        check(holds, "compression.third", expected, third)?;
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
            compression: Compression::default(),
        }
    }

    #[test]
    fn a_gap_bears_what_its_fabric_says() {
        for compression in [
            Compression::default(),
            Compression {
                half: 80.0,
                third: 200.0,
            },
        ] {
            let Compression { half, third } = compression;
            for (part, pressure) in [(0.5, half), (1.0 / 3.0, third), (1.0, 0.0)] {
                let found = compression.pressure(part);
                assert!((found - pressure).abs() < 1e-9 * third, "{part}: {found}");
                assert!((compression.gap(pressure) - part).abs() < 1e-12);
            }
            assert_eq!(compression.pressure(1.2), 0.0);
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
                ("material felt: compression.half must", |m| {
                    m.compression.half = 0.0;
                }),
                ("material felt: compression.third must", |m| {
                    m.compression.third = 700.0;
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
