//! The settings of the physics as files have them, also those of before there was one elastic law.

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::{AirLaw, ElasticLaw, HandleConstraint, Integrator, LinearSolver, PhysicsSettings};

/// [`PhysicsSettings`] as they are written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Written {
    substeps: u32,
    handles: HandleConstraint,
    law: ElasticLaw,
    air: AirLaw,
    integrator: Integrator,
    least_damping: Option<f64>,
    max_strain: f64,
    solver: LinearSolver,
    /// A key of before: substeps by the change of strain.
    substepping: Option<Substepping>,
    /// A key of before: the law of bending.
    bending: Option<Bending>,
    /// A key of before: the look-up of stretching.
    stretch_lookup: Option<StretchLookup>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Substepping {
    Fixed,
    Adaptive(IgnoredAny),
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Bending {
    Symmetric,
    Arcsim,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum StretchLookup {
    Grid,
    Exact,
}

impl Default for Written {
    fn default() -> Self {
        let settings = PhysicsSettings::default();
        Self {
            substeps: settings.substeps,
            handles: settings.handles,
            law: settings.law,
            air: settings.air,
            integrator: settings.integrator,
            least_damping: settings.least_damping,
            max_strain: settings.max_strain,
            solver: settings.solver,
            substepping: None,
            bending: None,
            stretch_lookup: None,
        }
    }
}

impl TryFrom<Written> for PhysicsSettings {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Self, Self::Error> {
        if let Some(Substepping::Adaptive(_)) = written.substepping {
            return Err(
                "substepping = \"adaptive\" is gone: leave it out and raise physics.substeps; a frame that ends beyond physics.max_strain is divided all the same",
            );
        }
        if written.stretch_lookup == Some(StretchLookup::Exact) {
            return Err(
                "stretch_lookup = \"exact\" is gone: leave it out for law = \"energy\", which is fitted to the exact table",
            );
        }
        // Settings of before name both keys; alone, each is a choice among the laws of before.
        let law = match (written.law, written.bending, written.stretch_lookup) {
            (law, None, None) => law,
            (_, Some(Bending::Arcsim), _) | (ElasticLaw::Arcsim, None, _) => ElasticLaw::Arcsim,
            (ElasticLaw::Energy, Some(Bending::Symmetric), None) => ElasticLaw::Energy,
            (_, _, Some(_)) | (_, Some(_), None) => ElasticLaw::Measured,
        };
        Ok(Self {
            substeps: written.substeps,
            handles: written.handles,
            law,
            air: written.air,
            integrator: written.integrator,
            least_damping: written.least_damping,
            max_strain: written.max_strain,
            solver: written.solver,
        })
    }
}
