//! The parts of ARCSim that a scene can disable, and those that Selvedge lacks.

use super::super::problem::SceneProblem;
use super::object::Object;

/// ARCSim's names of its parts.
const KNOWN: [&str; 9] = [
    "proximity",
    "physics",
    "strainlimiting",
    "collision",
    "remeshing",
    "separation",
    "popfilter",
    "plasticity",
    "fracture",
];

/// Stiffness of ARCSim's handles that Selvedge has too `[N/m]`.
const HANDLE_STIFFNESS: f64 = 1e3;

/// Parts of ARCSim that a scene disables.
pub(super) struct Parts {
    disabled: Vec<String>,
}

impl Parts {
    pub(super) fn of(
        scene: &mut Object<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, SceneProblem> {
        let mut disabled = Vec::new();
        for entry in scene.list("disable")? {
            match entry.as_str() {
                Some(name) if KNOWN.contains(&name) => disabled.push(name.to_owned()),
                _ => {
                    let must = format!("must name one of {}", KNOWN.join(", "));
                    return Err(scene.wrong("disable", &must, entry));
                }
            }
        }
        let parts = Self { disabled };
        if parts.disables("physics") {
            warnings.push("disable: physics cannot be disabled: it is all that is run".to_owned());
        }
        for (names, what) in [
            (["remeshing", "remeshing"], "the mesh stays as it is"),
            (["popfilter", "popfilter"], "there is nothing to filter"),
        ] {
            if !parts.lacks(&names) {
                let mut missing = names.to_vec();
                missing.retain(|name| !parts.disables(name));
                missing.dedup();
                warnings.push(format!(
                    "{} is not disabled, but Selvedge has none: {what}",
                    missing.join(" and ")
                ));
            }
        }
        Ok(parts)
    }

    pub(super) fn disables(&self, name: &str) -> bool {
        self.disabled.iter().any(|disabled| disabled == name)
    }

    /// Returns true when nothing touches anything.
    fn disables_contact(&self) -> bool {
        self.disables("proximity") && self.disables("collision")
    }

    /// Returns true when all of `names` are disabled.
    fn lacks(&self, names: &[&str]) -> bool {
        names.iter().all(|name| self.disables(name))
    }

    /// Reads what the parts that Selvedge lacks would need, and the rest of `magic`.
    pub(super) fn finish(
        &self,
        scene: &mut Object<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<(), SceneProblem> {
        for key in ["morphs", "zones"] {
            let count = scene.list(key)?.len();
            if count > 0 {
                warnings.push(format!("{key} are not supported: {count} left out"));
            }
        }
        if let Some(mut magic) = scene.child("magic")? {
            let stiffness = magic.number("handle_stiffness")?;
            if stiffness.is_some_and(|stiffness| stiffness != HANDLE_STIFFNESS) {
                warnings.push(format!(
                    "magic.handle_stiffness is not supported: handles are springs of {HANDLE_STIFFNESS} N/m"
                ));
            }
            let stiffness = magic.number("collision_stiffness")?;
            if stiffness.is_some() && !self.disables_contact() {
                warnings.push(
                    "magic.collision_stiffness is not supported: Selvedge's contact is as stiff as masses and substeps allow"
                        .to_owned(),
                );
            }
            magic.pass_over(&[
                // Read with the obstacles.
                "repulsion_thickness",
                "projection_thickness",
                "edge_flip_threshold",
                "rib_stiffening",
                "combine_tensors",
                "preserve_creases",
            ]);
            magic.finish(warnings);
        }
        Ok(())
    }
}
