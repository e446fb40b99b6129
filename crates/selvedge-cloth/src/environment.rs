//! Gravity and air.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What acts on the cloth from outside. Defaults: gravity (0, -9.8, 0), still air of density 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Acceleration of gravity [m/s²].
    pub gravity: DVec3,
    /// Velocity of the wind [m/s].
    pub wind: DVec3,
    /// Density of the air [kg/m³]: drag along a face's normal.
    pub air_density: f64,
    /// Drag along a face [kg/(m² s)].
    pub air_drag: f64,
}

/// A setting of the environment that is not physical.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("environment.{field} must be {expected}, found {found}")]
pub struct EnvironmentError {
    field: &'static str,
    expected: &'static str,
    found: String,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            gravity: DVec3::new(0.0, -9.8, 0.0),
            wind: DVec3::ZERO,
            air_density: 1.0,
            air_drag: 0.0,
        }
    }
}

impl Environment {
    /// Checks that every value is finite and no density negative.
    ///
    /// # Errors
    /// Names the field, what it must be and what was found.
    pub fn validate(&self) -> Result<(), EnvironmentError> {
        for (field, vector) in [("gravity", self.gravity), ("wind", self.wind)] {
            if !vector.is_finite() {
                return Err(EnvironmentError {
                    field,
                    expected: "finite",
                    found: vector.to_string(),
                });
            }
        }
        for (field, value) in [
            ("air_density", self.air_density),
            ("air_drag", self.air_drag),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(EnvironmentError {
                    field,
                    expected: "finite and not negative",
                    found: value.to_string(),
                });
            }
        }
        Ok(())
    }
}
