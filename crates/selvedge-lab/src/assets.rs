//! Assets of the program: the model that `rollout` runs when none is named, and the configurations
//! that `train` knows by name.

pub use selvedge_assets::{MODELS, TRAININGS};

/// The weights of the shipped model, and what they are called in answers.
pub const MODEL: (&str, &[u8]) = MODELS[0];

/// The text of the shipped training configuration of this name, if there is one.
pub fn training(name: &str) -> Option<&'static str> {
    let mut shipped = TRAININGS.iter();
    shipped.find(|entry| entry.0 == name).map(|entry| entry.1)
}
