//! A measured fabric: density, and the stiffness tables of the data-driven model of Wang, O'Brien
//! and Ramamoorthi 2011 (simulator.md §2.1, §2.2, §3). The laws that read the tables are physics
//! and live in `selvedge-sim`.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A fabric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// What people call it.
    pub name: String,
    /// Where its numbers come from.
    #[serde(default)]
    pub source: String,
    /// Mass per area [kg/m²].
    pub density: f64,
    /// Stiffness-proportional damping [s].
    #[serde(default)]
    pub damping: f64,
    /// Resistance to stretching.
    pub stretch: StretchTable,
    /// Resistance to bending.
    pub bend: BendTable,
}

/// In-plane stiffness: rows = zero strain, then principal stretch 1 + 1/6 with its direction at
/// 0, 22.5, 45, 67.5 and 90° from the course axis; columns = k0 (uu), k1 (coupling), k2 (vv),
/// k3 (shear) [N/m], before the factor 2 of the law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StretchTable(pub [[f64; 4]; 6]);

/// Bending stiffness [N·m]: rows = edge direction in material space at 0, 45 and 90°, columns =
/// curvature 0 to 4.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BendTable(pub [[f64; 5]; 3]);

/// A number of a material that is not physical.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("material {material}: {field} must be {expected}, found {found}")]
pub struct MaterialError {
    material: String,
    field: &'static str,
    expected: &'static str,
    found: f64,
}

impl Material {
    /// Checks density, damping and that the tables are finite.
    ///
    /// # Errors
    /// Names the material, the field and the value.
    pub fn validate(&self) -> Result<(), MaterialError> {
        let error = |field, expected, found| MaterialError {
            material: self.name.clone(),
            field,
            expected,
            found,
        };
        if !(self.density.is_finite() && self.density > 0.0) {
            return Err(error("density", "finite and positive", self.density));
        }
        if !(self.damping.is_finite() && self.damping >= 0.0) {
            return Err(error("damping", "finite and not negative", self.damping));
        }
        let stretch = self.stretch.0.as_flattened();
        if let Some(&bad) = stretch.iter().find(|k| !k.is_finite()) {
            return Err(error("stretch", "finite everywhere", bad));
        }
        let bend = self.bend.0.as_flattened();
        if let Some(&bad) = bend.iter().find(|k| !(k.is_finite() && **k >= 0.0)) {
            return Err(error("bend", "finite and not negative everywhere", bad));
        }
        Ok(())
    }
}
