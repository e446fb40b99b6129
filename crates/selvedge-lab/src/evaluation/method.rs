//! The methods that are compared: models, physics with so many substeps, and a baseline.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use selvedge_cloth::{Integrator, Scene};
use selvedge_guard::Correction;
use selvedge_model::Model;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::ChoiceError;
use crate::machine::Machine;

/// A method with its name in tables.
#[derive(Clone)]
pub struct Method {
    /// The name.
    pub name: String,
    /// How it moves the cloth.
    pub mover: Mover,
}

/// How a method moves the cloth.
#[derive(Clone)]
pub enum Mover {
    /// A model, guarded so, on this machine.
    Model(Arc<Model>, Correction, Machine),
    /// The physics of the case.
    Physics(PhysicsMethod),
    /// Baseline: the rest pose moves rigidly with the handles.
    Rigid,
}

/// The kind of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A model.
    Model,
    /// The physics.
    Physics,
    /// A baseline.
    Baseline,
    /// The reference's method with half its substeps, whose difference tells the reference's error.
    Reference,
}

/// Physics with so many substeps per frame, by the case's integrator or another one.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicsMethod {
    /// Another integrator than the case's, by the name that scenes give it.
    pub integrator: Option<(String, Integrator)>,
    /// Substeps per frame.
    pub substeps: u32,
}

impl Method {
    /// Names of the baselines.
    pub const BASELINES: [&'static str; 1] = ["rigid"];

    /// The baseline of this name.
    pub fn baseline(name: &str) -> Option<Self> {
        let name = (name == "rigid").then(|| name.to_owned())?;
        let mover = Mover::Rigid;
        Some(Self { name, mover })
    }

    /// A model, once for every guard; the name says which, where there are several.
    pub fn guarded(
        name: &str,
        model: &Arc<Model>,
        guards: &[Correction],
        machine: &Machine,
    ) -> impl Iterator<Item = Self> {
        guards.iter().map(move |guard| Self {
            name: match guards.len() {
                1 => name.to_owned(),
                _ => format!("{name} ({})", guard.name()),
            },
            mover: Mover::Model(Arc::clone(model), *guard, machine.clone()),
        })
    }

    /// The physics.
    pub fn physics(physics: PhysicsMethod) -> Self {
        Self {
            name: physics.to_string(),
            mover: Mover::Physics(physics),
        }
    }

    /// The kind.
    pub fn kind(&self) -> Kind {
        match self.mover {
            Mover::Model(..) => Kind::Model,
            Mover::Physics(_) => Kind::Physics,
            Mover::Rigid => Kind::Baseline,
        }
    }

    /// Returns true where the method cannot do without the scene of its case, or does better with
    /// it.
    pub(super) fn wants_scene(&self) -> bool {
        match &self.mover {
            Mover::Model(_, guard, _) => *guard != Correction::None,
            Mover::Physics(_) => true,
            Mover::Rigid => false,
        }
    }
}

impl PhysicsMethod {
    /// The scene with this integrator and so many substeps.
    pub(super) fn scene(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.physics.substeps = self.substeps;
        if let Some((_, integrator)) = &self.integrator {
            scene.physics.integrator = *integrator;
        }
        scene
    }
}

impl fmt::Display for PhysicsMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.integrator.as_ref().map_or("physics", |known| &known.0);
        let plural = if self.substeps == 1 { "" } else { "s" };
        write!(f, "{name}, {} substep{plural}", self.substeps)
    }
}

/// `4`, or `linearised:4`.
impl FromStr for PhysicsMethod {
    type Err = ChoiceError;

    fn from_str(text: &str) -> Result<Self, ChoiceError> {
        let (name, count) = match text.rsplit_once(':') {
            Some((name, count)) => (Some(name), count),
            None => (None, text),
        };
        let substeps = count.parse().ok().filter(|n| (1..=1000).contains(n));
        let Some(substeps) = substeps else {
            return Err(ChoiceError(format!(
                "{text:?}: expected substeps per frame from 1 to 1000, or an integrator before them, as linearised:4"
            )));
        };
        let integrator = name.map(integrator_named).transpose()?;
        Ok(Self {
            integrator,
            substeps,
        })
    }
}

/// The integrator of this name in scenes, with its default settings.
fn integrator_named(name: &str) -> Result<(String, Integrator), ChoiceError> {
    let read = |value: Value| serde_json::from_value::<Integrator>(value);
    // One without settings is a word in a scene, one with settings a table.
    let found = read(json!(name)).or_else(|_| read(json!({ name: {} })));
    let found = found.map_err(|error| {
        let error = error.to_string();
        let known = error.split_once(", expected ").map_or("", |parts| parts.1);
        let known = known.trim_start_matches("one of ");
        ChoiceError(format!(
            "no integrator is called {name:?}; known are {known}"
        ))
    })?;
    Ok((name.to_owned(), found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn physics_is_named_by_integrator_and_substeps() {
        let named = |text: &str| text.parse::<PhysicsMethod>();
        assert_eq!(named("1").unwrap().to_string(), "physics, 1 substep");
        let linearised = named("linearised:4").unwrap();
        assert_eq!(linearised.to_string(), "linearised, 4 substeps");
        assert_eq!(linearised.integrator.unwrap().1, Integrator::Linearised);
        for (wrong, word) in [
            ("0", "1 to 1000"),
            ("x", "1 to 1000"),
            ("euler:2", "known are `linearised`"),
        ] {
            let error = named(wrong).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
