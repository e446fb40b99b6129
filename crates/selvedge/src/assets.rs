//! What ships with the program: the model that `rollout` runs when none is named.

/// The weights of the shipped model, and what they are called in answers.
pub(crate) const MODEL: Option<(&str, &[u8])> = None;

/// The shipped training configurations: names and TOML texts.
const TRAININGS: &[(&str, &str)] = &[];

/// The text of the shipped training configuration of this name, if there is one.
pub(crate) fn training(name: &str) -> Option<&'static str> {
    let mut shipped = TRAININGS.iter();
    shipped.find(|entry| entry.0 == name).map(|entry| entry.1)
}
