//! The physics as a scene file has it: the name of a mode, or a table in which a mode may be named
//! and settings chosen on top of it. What makes a mode is chosen as a whole.
//!
//! ```toml
//! physics = "arcsim"
//! physics = { mode = "arcsim", substeps = 2 }
//! ```

use selvedge_cloth::{ElasticLaw, PhysicsMode, PhysicsSettings};
use serde::Deserialize;
use toml::{Table, Value};

/// Settings of the physics, resolved.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(try_from = "Value")]
pub(crate) struct PhysicsFile(pub(crate) PhysicsSettings);

impl TryFrom<Value> for PhysicsFile {
    type Error = toml::de::Error;

    fn try_from(written: Value) -> Result<Self, toml::de::Error> {
        let mut own = match written {
            Value::Table(table) => table,
            word => Table::from_iter([("mode".to_owned(), word)]),
        };
        let mode = match own.remove("mode") {
            Some(word) => word.try_into::<PhysicsMode>()?,
            None => PhysicsMode::default(),
        };
        let whole = PhysicsSettings::in_mode(mode);
        let mut settings = Table::try_from(whole).map_err(serde::de::Error::custom)?;
        settings.extend(own);
        let settings: PhysicsSettings = settings.try_into()?;
        if is_of_mode(&settings, mode) {
            Ok(Self(settings))
        } else {
            Err(serde::de::Error::custom(
                "handles, air and law = \"arcsim\" are chosen by physics = \"arcsim\" alone, which chooses integrator, least_damping and even_bending too: leave these keys out, or the mode",
            ))
        }
    }
}

/// Returns true if what makes the mode is as in the mode.
fn is_of_mode(settings: &PhysicsSettings, mode: PhysicsMode) -> bool {
    let whole = PhysicsSettings::in_mode(mode);
    let formula = |of: &PhysicsSettings| {
        let (law, integrator) = (of.law, of.integrator);
        (law, of.even_bending, integrator, of.least_damping)
    };
    let is_formula = match mode {
        PhysicsMode::Selvedge => settings.law != ElasticLaw::Arcsim,
        PhysicsMode::Arcsim => formula(settings) == formula(&whole),
    };
    is_formula && (settings.handles, settings.air) == (whole.handles, whole.air)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::says;

    #[derive(Deserialize)]
    struct Holder {
        physics: PhysicsFile,
    }

    fn read(text: &str) -> Result<PhysicsSettings, String> {
        toml::from_str::<Holder>(text)
            .map(|holder| holder.physics.0)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn one_word_chooses_all_and_some_parts_can_be_chosen_alone() {
        let arcsim = PhysicsSettings::in_mode(PhysicsMode::Arcsim);
        let usual = PhysicsSettings::default();
        assert_eq!(read("physics = \"arcsim\""), Ok(arcsim));
        assert_eq!(read("physics = \"selvedge\""), Ok(usual));
        assert_eq!(read("physics = {}"), Ok(usual));
        let text = "[physics]\nmode = \"arcsim\"\nhandles = \"spring\"\nsubsteps = 7";
        let substeps = 7;
        assert_eq!(read(text), Ok(PhysicsSettings { substeps, ..arcsim }));
        let law = ElasticLaw::Measured;
        let alone = PhysicsSettings { law, ..usual };
        assert_eq!(read("physics.law = \"measured\""), Ok(alone));
    }

    #[test]
    fn what_makes_a_mode_is_chosen_as_a_whole() {
        for text in [
            "physics.handles = \"spring\"",
            "physics.air = \"explicit\"",
            "physics.law = \"arcsim\"",
            "physics = { mode = \"arcsim\", handles = \"exact\" }",
            "physics = { mode = \"arcsim\", law = \"measured\" }",
            "physics = { mode = \"arcsim\", air = \"implicit\" }",
            "physics = { mode = \"arcsim\", even_bending = true }",
            "physics = { mode = \"arcsim\", integrator = { generalised-alpha = {} } }",
        ] {
            says(read(text).unwrap_err(), &["leave these keys out"]);
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        for (text, named) in [
            ("physics = \"newton\"", "newton"),
            ("physics = { sub_steps = 4 }", "sub_steps"),
            ("physics.stretch_lookup = \"grid\"", "stretch_lookup"),
            ("physics = { handles = \"glue\" }", "glue"),
            ("physics = 4", "invalid type"),
        ] {
            says(read(text).unwrap_err(), &[named, "line 1"]);
        }
    }
}
