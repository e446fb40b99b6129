//! Assets of the program: the model that `rollout` runs when none is named, and the configurations
//! that `train` knows by name.

/// The weights of the shipped model, and what they are called in answers.
pub const MODEL: (&str, &[u8]) = (
    "small",
    include_bytes!("../../../assets/models/small.safetensors"),
);

/// The shipped models by their names, the one above first.
pub const MODELS: [(&str, &[u8]); 2] = [
    MODEL,
    (
        "corrected",
        include_bytes!("../../../assets/models/corrected.safetensors"),
    ),
];

/// A list of pairs of names and texts of the files in a folder.
macro_rules! trainings {
    ($($name:literal),+ $(,)?) => {
        &[$((
            $name,
            include_str!(concat!("../../../assets/training/", $name, ".toml")),
        )),+]
    };
}

/// The shipped training configurations, names and TOML texts: those of our own models, the paper's
/// models, its ablations, and one that is trained in another way.
pub const TRAININGS: &[(&str, &str)] = trainings![
    "first",
    "small",
    "meshgraphnets",
    "meshgraphnets-ss",
    "rp-mlp",
    "rp-gru5",
    "rp-gru10",
    "rp-without-external-force",
    "rp-without-rest-vector",
    "rp-without-elongation",
    "rp-without-edge-vector-loss",
    "rp-without-edge-length-loss",
    "rp-without-kinetic-energy",
    "rp-without-bending",
    "rp-without-physics",
    "rp-gru10-better",
    "corrected",
];

/// The text of the shipped training configuration of this name, if there is one.
pub fn training(name: &str) -> Option<&'static str> {
    let mut shipped = TRAININGS.iter();
    shipped.find(|entry| entry.0 == name).map(|entry| entry.1)
}
