//! Methods that are compared: an integrator by the name that scenes give it, or a model, and
//! substeps.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use selvedge_cloth::Integrator;
use selvedge_model::{Instructions, Model};
use serde::Serialize;
use serde_json::{Value, json};

use super::error::ChoiceError;

/// An integrator by the name that scenes give it, with the default settings; or a
/// model by its own name.
#[derive(Clone, Debug)]
pub struct NamedIntegrator {
    name: String,
    integrator: Integrator,
    model: Option<Arc<Model>>,
    instructions: Instructions,
}

/// Models are told apart by their names.
impl PartialEq for NamedIntegrator {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.integrator == other.integrator
    }
}

/// An integrator with so many substeps per frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Method {
    /// The integrator.
    pub integrator: NamedIntegrator,
    /// Substeps per frame.
    pub substeps: u32,
}

impl FromStr for NamedIntegrator {
    type Err = ChoiceError;

    fn from_str(name: &str) -> Result<Self, ChoiceError> {
        let read = |value: Value| serde_json::from_value::<Integrator>(value);
        // One without settings is a word in a scene, one with settings a table.
        let integrator = read(json!(name)).or_else(|_| read(json!({ name: {} })));
        let integrator = integrator.map_err(|error| {
            let error = error.to_string();
            let known = error.split_once(", expected ").map_or("", |parts| parts.1);
            let known = known.trim_start_matches("one of ");
            ChoiceError::new(format!(
                "no integrator is called {name:?}; known are {known}"
            ))
        })?;
        Ok(Self {
            name: name.to_owned(),
            integrator,
            model: None,
            instructions: Instructions::default(),
        })
    }
}

impl NamedIntegrator {
    /// The model that moves the cloth, or corrects it; none for physics alone.
    #[must_use]
    pub fn model(&self) -> Option<&Arc<Model>> {
        self.model.as_ref()
    }

    /// The model, if it corrects physics.
    #[must_use]
    pub fn corrector(&self) -> Option<&Arc<Model>> {
        self.model().filter(|model| model.spec().base.is_some())
    }

    /// The instructions of a model's products.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// An integrator as a scene has it, called by its kind.
    fn of(integrator: Integrator) -> Self {
        let kind = match serde_json::to_value(integrator) {
            Ok(Value::String(word)) => word,
            Ok(Value::Object(table)) => table.keys().next().cloned().unwrap_or_default(),
            _ => String::new(),
        };
        let named = kind.parse::<Self>().ok();
        let name = match named.filter(|named| named.integrator == integrator) {
            Some(named) => return named,
            None => format!("{kind} of the model"),
        };
        Self {
            name,
            integrator,
            model: None,
            instructions: Instructions::default(),
        }
    }

    /// As scenes have it; that of the physics that a model corrects.
    #[must_use]
    pub fn integrator(&self) -> Integrator {
        self.integrator
    }
}

impl fmt::Display for NamedIntegrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl Serialize for NamedIntegrator {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name)
    }
}

impl Method {
    /// A model called `name`, with the substeps of the physics that it corrects; 1 where it
    /// corrects none.
    #[must_use]
    pub fn of_model(name: String, model: Arc<Model>, instructions: Instructions) -> Self {
        let base = model.spec().base;
        Self {
            integrator: NamedIntegrator {
                name,
                integrator: base.map_or(Integrator::SecondOrder, |base| base.integrator),
                model: Some(model),
                instructions,
            },
            substeps: base.map_or(1, |base| base.substeps),
        }
    }

    /// The physics that a model corrects, alone: with its own substeps, and with one more, which
    /// costs about what the model does; none for others.
    #[must_use]
    pub fn bases(&self) -> Option<[Self; 2]> {
        let base = self.integrator.corrector()?.spec().base?;
        let with = |substeps| Self {
            integrator: NamedIntegrator::of(base.integrator),
            substeps,
        };
        Some([with(base.substeps), with(base.substeps + 1)])
    }

    /// `physics` and `models`, with the physics alone that they correct among the first, each
    /// integrator's substeps rising.
    #[must_use]
    pub fn with_models(physics: Vec<Self>, models: Vec<Self>) -> Vec<Self> {
        let bases = models.iter().filter_map(Self::bases).flatten();
        let mut all: Vec<Self> = Vec::new();
        let mut integrators: Vec<NamedIntegrator> = Vec::new();
        for method in physics.into_iter().chain(bases) {
            if !integrators.contains(&method.integrator) {
                integrators.push(method.integrator.clone());
            }
            if !all.contains(&method) {
                all.push(method);
            }
        }
        let place = |method: &Self| integrators.iter().position(|i| *i == method.integrator);
        all.sort_by_key(|method| (place(method), method.substeps));
        all.extend(models);
        all
    }

    /// Every one of `integrators` with every one of `substeps`, each once.
    #[must_use]
    pub fn all(integrators: &[NamedIntegrator], substeps: &[u32]) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for integrator in integrators {
            for &substeps in substeps {
                let method = Self {
                    integrator: integrator.clone(),
                    substeps,
                };
                if !all.contains(&method) {
                    all.push(method);
                }
            }
        }
        all
    }

    /// Order of the error in the substep.
    pub(super) fn order(&self) -> u32 {
        self.integrator.integrator.order()
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.integrator.model().is_some() && self.integrator.corrector().is_none() {
            return write!(f, "{}", self.integrator);
        }
        let plural = if self.substeps == 1 { "" } else { "s" };
        write!(f, "{}, {} substep{plural}", self.integrator, self.substeps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrators_are_called_as_in_scenes() {
        let linearised: NamedIntegrator = "linearised".parse().unwrap();
        assert_eq!(linearised.integrator(), Integrator::Linearised);
        let second: NamedIntegrator = "second-order".parse().unwrap();
        assert_eq!(second.integrator(), Integrator::SecondOrder);
        let error = "euler".parse::<NamedIntegrator>().unwrap_err().to_string();
        let words = ["\"euler\"", "known are `linearised`", "`second-order`"];
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
        let all = Method::all(&[linearised, second], &[1, 2, 1]);
        let names: Vec<String> = all.iter().map(Method::to_string).collect();
        let expected = [
            "linearised, 1 substep",
            "linearised, 2 substeps",
            "second-order, 1 substep",
            "second-order, 2 substeps",
        ];
        assert_eq!(names, expected);
    }
}
