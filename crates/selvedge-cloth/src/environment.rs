//! Gravity and air.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What acts on the cloth from outside. Defaults: gravity (0, -9.8, 0), still air of density 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Acceleration of gravity `[m/s²]`.
    pub gravity: DVec3,
    /// Velocity of the wind `[m/s]`.
    pub wind: DVec3,
    /// Density of the air `[kg/m³]`: drag along a face's normal.
    pub air_density: f64,
    /// Drag along a face `[kg/(m² s)]`.
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

#[cfg(test)]
mod tests {
    use super::*;

    type Spoil = fn(&mut Environment);

    #[test]
    fn wrong_values_are_named() {
        Environment::default().validate().unwrap();
        let wrong: [(&str, Spoil); 5] = [
            ("environment.gravity", |e| e.gravity.y = f64::NAN),
            ("environment.wind", |e| e.wind.x = f64::INFINITY),
            ("environment.air_density", |e| e.air_density = -1.0),
            ("environment.air_density", |e| e.air_density = f64::NAN),
            ("environment.air_drag", |e| e.air_drag = -0.1),
        ];
        for (field, spoil) in wrong {
            let mut environment = Environment::default();
            spoil(&mut environment);
            let text = environment.validate().unwrap_err().to_string();
            assert!(text.starts_with(field), "{text}");
        }
    }

    #[test]
    fn toml_keeps_defaults_and_names_unknown_keys() {
        let environment: Environment = toml::from_str("wind = [1, 0, 0.5]").unwrap();
        assert_eq!(environment.wind, DVec3::new(1.0, 0.0, 0.5));
        assert_eq!(environment.gravity, DVec3::new(0.0, -9.8, 0.0));
        let text = toml::to_string(&environment).unwrap();
        assert_eq!(toml::from_str::<Environment>(&text).unwrap(), environment);
        let error = toml::from_str::<Environment>("gravty = [0, 0, 0]").unwrap_err();
        assert!(error.to_string().contains("gravty"), "{error}");
    }
}
