//! Settings of contact: the cloth with obstacles, and with itself. Nouns of a scene; the laws are
//! in `selvedge-sim`, the geometry in `selvedge-contact`.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, is_default, require};

/// Contact of the cloth with the scene's obstacles and with itself. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactSettings {
    /// Gap below which two layers push each other apart `[m]`.
    pub thickness: f64,
    /// Coefficient of friction of the cloth. A pair has the lesser of its two.
    pub friction: f64,
    /// True if the cloth touches itself.
    #[serde(rename = "self")]
    pub self_contact: bool,
    /// Rounds of projection after a solve before the substep is shortened.
    pub rounds: u32,
    /// Gap that no pair goes below `[m]`, unless it starts there.
    pub floor: f64,
    /// An error after this many parts of a substep.
    pub max_divisions: u32,
    /// Where two bodies, or two parts of one, leave the cloth between them no room.
    #[serde(skip_serializing_if = "is_default")]
    pub squeezed: Squeezed,
}

/// What becomes of cloth between bodies that leave it no room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Squeezed {
    /// Contact with the weaker body is released there and reported, and the run goes on: bodies of
    /// most animations pass through each other somewhere.
    #[default]
    Yield,
    /// An error, for those who need every frame free of intersections.
    Stop,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self {
            thickness: 1e-3,
            friction: 0.6,
            self_contact: true,
            rounds: 8,
            floor: 2e-5,
            max_divisions: 64,
            squeezed: Squeezed::default(),
        }
    }
}

/// The usual thickness as a part of the shortest edge, at most.
const THIN: f64 = 0.2;

impl ContactSettings {
    /// The usual settings for a cloth whose shortest edge has this length `[m]`.
    pub fn for_edges(shortest: f64) -> Self {
        let usual = Self::default().thickness;
        Self::of_thickness(usual.min(THIN * shortest).max(1e-5))
    }

    /// The usual settings for this thickness `[m]`.
    pub fn of_thickness(thickness: f64) -> Self {
        let usual = Self::default();
        Self {
            thickness,
            floor: usual.floor.min(0.05 * thickness).max(1e-6),
            ..usual
        }
    }

    /// Checks that every value can be used.
    ///
    /// # Errors
    /// Names the field, what it must be and what was found.
    pub fn validate(&self) -> Result<(), SceneError> {
        let (thickness, floor) = (self.thickness, 1e-6..=0.1 * self.thickness);
        let within = |holds, key: &str, expected, found: &dyn std::fmt::Display| {
            require(holds, format_args!("contact.{key}"), expected, found)
        };
        let holds = (1e-5..=1.0).contains(&thickness);
        within(holds, "thickness", "between 1e-5 and 1 m", &thickness)?;
        let holds = (0.0..=100.0).contains(&self.friction);
        within(holds, "friction", "between 0 and 100", &self.friction)?;
        let expected = "between 1e-6 m and a tenth of contact.thickness";
        within(floor.contains(&self.floor), "floor", expected, &self.floor)?;
        let holds = (1..=1000).contains(&self.rounds);
        within(holds, "rounds", "between 1 and 1000", &self.rounds)?;
        let (most, expected) = (self.max_divisions, "between 1 and 100000");
        within(
            (1..=100_000).contains(&most),
            "max_divisions",
            expected,
            &most,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses_toml;

    #[test]
    fn wrong_values_are_named() {
        refuses_toml(
            ContactSettings::validate,
            "thickness = 0.0 | contact.thickness
             thickness = nan | contact.thickness
             friction = -0.1 | contact.friction
             floor = 2e-4 | contact.floor
             rounds = 0 | contact.rounds
             max_divisions = 0 | contact.max_divisions
             thicknes = 1 | thicknes
             law = 'barrier' | `law`",
        );
    }
}
