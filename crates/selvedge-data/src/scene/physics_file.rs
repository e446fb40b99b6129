//! The physics as a scene file has it: the name of a mode, or a table in which a mode may be named
//! and single settings chosen on top of it.
//!
//! ```toml
//! physics = "arcsim"
//! physics = { mode = "arcsim", handles = "exact", substeps = 2 }
//! ```

use selvedge_cloth::{PhysicsMode, PhysicsSettings};
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
        let mut settings =
            Table::try_from(PhysicsSettings::in_mode(mode)).map_err(serde::de::Error::custom)?;
        settings.extend(own);
        Ok(Self(settings.try_into()?))
    }
}

#[cfg(test)]
mod tests {
    use selvedge_cloth::{ElasticLaw, HandleConstraint};

    use super::*;

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
    fn one_word_chooses_all_and_each_part_can_be_chosen_alone() {
        let arcsim = PhysicsSettings::in_mode(PhysicsMode::Arcsim);
        assert_eq!(read("physics = \"arcsim\""), Ok(arcsim));
        assert_eq!(
            read("physics = \"selvedge\""),
            Ok(PhysicsSettings::default())
        );
        assert_eq!(read("physics = {}"), Ok(PhysicsSettings::default()));
        let text = "[physics]\nmode = \"arcsim\"\nhandles = \"exact\"\nsubsteps = 7";
        let handles = HandleConstraint::Exact;
        let substeps = 7;
        let mixed = PhysicsSettings {
            handles,
            substeps,
            ..arcsim
        };
        assert_eq!(read(text), Ok(mixed));
        let handles = HandleConstraint::Spring;
        let alone = PhysicsSettings {
            handles,
            ..PhysicsSettings::default()
        };
        assert_eq!(read("physics.handles = \"spring\""), Ok(alone));
        let law = ElasticLaw::Measured;
        let alone = PhysicsSettings {
            law,
            ..PhysicsSettings::default()
        };
        assert_eq!(read("physics.law = \"measured\""), Ok(alone));
        // Keys of before.
        let alone = PhysicsSettings { law, ..arcsim };
        let text = "physics = { mode = \"arcsim\", bending = \"symmetric\" }";
        assert_eq!(read(text), Ok(alone));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        for (text, named) in [
            ("physics = \"newton\"", "newton"),
            ("physics = { sub_steps = 4 }", "sub_steps"),
            ("physics = { handles = \"glue\" }", "glue"),
            ("physics = 4", "invalid type"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(named) && error.contains("line 1"), "{error}");
        }
    }
}
