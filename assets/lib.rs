//! What ships with Selvedge, as bytes: materials, scenes, bodies, presets and models.
//!
//! The files lie beside this one, so that a package has them. Those who read them check them:
//! `selvedge-data` the scenes, materials, bodies and data sets, `selvedge-lab` the models
//! and trainings.

/// A list of pairs of names and texts of the files in a folder.
macro_rules! texts {
    ($folder:literal: $($name:literal),+ $(,)?) => {
        &[$((
            $name,
            include_str!(concat!($folder, "/", $name, ".toml")),
        )),+]
    };
}

/// Materials, measured fabrics as TOML, the default first: four as they were published, the same with
/// their bending tables read as a plate's, and two that were fitted to drapes.
pub const MATERIALS: &[(&str, &str)] = texts!("materials":
    "gray-interlock",
    "camel-ponte-roma",
    "11oz-black-denim",
    "navy-sparkle-sweat",
    "interlock",
    "ponte",
    "denim",
    "sweat",
    "blue-cotton",
    "red-wool",
);

/// Scenes that are known by name.
pub const SCENES: &[(&str, &str)] =
    texts!("scenes": "default", "drape", "poncho", "square-1024", "tablecloth");

/// Bodies that are known by name, as glTF.
pub const BODIES: &[(&str, &[u8])] = &[("mannequin", include_bytes!("bodies/mannequin.glb"))];

/// Presets of data sets.
pub const DATASETS: &[(&str, &str)] = texts!("datasets":
    "first",
    "tiny",
    "small",
    "square-100",
    "square-400",
    "paper",
    "generalisation",
    "generalisation-small",
    "speeds-400",
    "cloths-400",
    "fine-400",
);

/// Models by their names, in the files that `selvedge train` writes.
pub const MODELS: &[(&str, &[u8])] = &[("paper", PAPER)];

/// The model `paper`, which needs no physics to move a cloth.
pub const PAPER: &[u8] = include_bytes!("models/paper.safetensors");

/// Configurations of trainings: those of our own models, the paper's models, its ablations, and
/// one that is trained in another way.
pub const TRAININGS: &[(&str, &str)] = texts!("training":
    "first",
    "any",
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
);
