//! What ships with the program: the model that `rollout` runs when none is named.

/// The weights of the shipped model, and what they are called in answers.
pub(crate) const MODEL: (&str, &[u8]) = (
    "first",
    include_bytes!("../../../assets/models/first.safetensors"),
);

/// The shipped training configurations: names and TOML texts.
const TRAININGS: &[(&str, &str)] =
    &[("first", include_str!("../../../assets/training/first.toml"))];

/// The text of the shipped training configuration of this name, if there is one.
pub(crate) fn training(name: &str) -> Option<&'static str> {
    let mut shipped = TRAININGS.iter();
    shipped.find(|entry| entry.0 == name).map(|entry| entry.1)
}
