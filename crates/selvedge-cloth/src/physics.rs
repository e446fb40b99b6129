//! How the reference simulator is to run a scene. These are nouns of a scene; the laws are in
//! `selvedge-sim`.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Settings of the reference simulator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsSettings {
    /// Implicit solves per frame.
    pub substeps: u32,
    /// How handles hold the cloth.
    pub handles: HandleConstraint,
    /// Bending stiffness of a fold towards and away from the normals.
    pub bending: BendingLaw,
    /// How the stretching table is looked up.
    pub stretch_lookup: StretchLookup,
}

/// How handles hold the cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HandleConstraint {
    /// The vertex is where its target is.
    #[default]
    Exact,
    /// An implicit spring of 1000 N/m per axis to the target, as in ARCSim.
    Spring,
}

/// Which curvature the bending table is read at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BendingLaw {
    /// |θ|: a fold is as stiff to either side.
    #[default]
    Symmetric,
    /// θ as it is, so that column 0 is extrapolated for θ < 0, as in ARCSim.
    Arcsim,
}

/// How the stretching table is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StretchLookup {
    /// Sampled on a 30³ grid of Green strains and read trilinearly, as in ARCSim.
    #[default]
    Grid,
    /// The table itself, at the exact strain.
    Exact,
}

/// How the sagged rest pose is found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SagSettings {
    /// Height of the smooth bulge that the flat start is given along its normals `[m]`. Its sign
    /// decides to which side the cloth buckles, so that all data lie on one branch.
    pub bulge: f64,
    /// The pose is at rest when no free vertex is accelerated by more than this `[m/s²]`.
    pub tolerance: f64,
    /// Give up after this many solves.
    pub max_steps: u32,
}

/// A setting of the physics that cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{field} must be {expected}, found {found}")]
pub struct PhysicsError {
    field: &'static str,
    expected: &'static str,
    found: f64,
}

impl Default for PhysicsSettings {
    fn default() -> Self {
        Self {
            substeps: 4,
            handles: HandleConstraint::default(),
            bending: BendingLaw::default(),
            stretch_lookup: StretchLookup::default(),
        }
    }
}

impl Default for SagSettings {
    fn default() -> Self {
        Self {
            bulge: 0.02,
            tolerance: 1e-3,
            max_steps: 20_000,
        }
    }
}

impl PhysicsSettings {
    /// Checks the number of substeps.
    ///
    /// # Errors
    /// Names the field and the value.
    pub fn validate(&self) -> Result<(), PhysicsError> {
        if !(1..=1000).contains(&self.substeps) {
            return Err(PhysicsError {
                field: "physics.substeps",
                expected: "between 1 and 1000",
                found: f64::from(self.substeps),
            });
        }
        Ok(())
    }
}

impl SagSettings {
    /// Checks that the numbers are finite, the tolerance and the number of solves positive.
    ///
    /// # Errors
    /// Names the field and the value.
    pub fn validate(&self) -> Result<(), PhysicsError> {
        if !self.bulge.is_finite() {
            return Err(PhysicsError {
                field: "sag.bulge",
                expected: "finite",
                found: self.bulge,
            });
        }
        if !(self.tolerance.is_finite() && self.tolerance > 0.0) {
            return Err(PhysicsError {
                field: "sag.tolerance",
                expected: "finite and positive",
                found: self.tolerance,
            });
        }
        if self.max_steps == 0 {
            return Err(PhysicsError {
                field: "sag.max_steps",
                expected: "at least 1",
                found: 0.0,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Spoil = fn(&mut SagSettings);

    #[test]
    fn wrong_settings_are_named() {
        PhysicsSettings::default().validate().unwrap();
        SagSettings::default().validate().unwrap();
        for substeps in [0, 1001] {
            let settings = PhysicsSettings {
                substeps,
                ..PhysicsSettings::default()
            };
            let text = settings.validate().unwrap_err().to_string();
            let expected = format!("physics.substeps must be between 1 and 1000, found {substeps}");
            assert_eq!(text, expected);
        }
        let wrong: [(&str, Spoil); 5] = [
            ("sag.bulge", |s| s.bulge = f64::NAN),
            ("sag.tolerance", |s| s.tolerance = 0.0),
            ("sag.tolerance", |s| s.tolerance = f64::INFINITY),
            ("sag.tolerance", |s| s.tolerance = f64::NAN),
            ("sag.max_steps", |s| s.max_steps = 0),
        ];
        for (field, spoil) in wrong {
            let mut settings = SagSettings::default();
            spoil(&mut settings);
            let text = settings.validate().unwrap_err().to_string();
            assert!(text.starts_with(field), "{text}");
        }
    }

    #[test]
    fn toml_keeps_defaults_and_names_unknown_keys() {
        let text = "handles = \"spring\"\nbending = \"arcsim\"";
        let settings: PhysicsSettings = toml::from_str(text).unwrap();
        assert_eq!(settings.substeps, PhysicsSettings::default().substeps);
        assert_eq!(settings.handles, HandleConstraint::Spring);
        assert_eq!(settings.bending, BendingLaw::Arcsim);
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<PhysicsSettings>(&text).unwrap(), settings);
        for (text, named) in [
            ("sub_steps = 4", "sub_steps"),
            ("handles = \"glue\"", "glue"),
            ("substeps = -1", "-1"),
        ] {
            let error = toml::from_str::<PhysicsSettings>(text).unwrap_err();
            assert!(error.to_string().contains(named), "{error}");
        }
        let error = toml::from_str::<SagSettings>("bulge = 0.1\nheight = 1").unwrap_err();
        assert!(error.to_string().contains("height"), "{error}");
    }
}
