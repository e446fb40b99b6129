//! What ships with Selvedge, as bytes: materials, scenes, motions, bodies, presets and models.
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

/// Materials, measured fabrics as TOML.
pub mod materials {
    /// `gray-interlock`, the default.
    pub const GRAY_INTERLOCK: &str = include_str!("materials/gray-interlock.toml");
    /// `camel-ponte-roma`.
    pub const CAMEL_PONTE_ROMA: &str = include_str!("materials/camel-ponte-roma.toml");
    /// `11oz-black-denim`.
    pub const DENIM: &str = include_str!("materials/11oz-black-denim.toml");
    /// `navy-sparkle-sweat`.
    pub const NAVY_SPARKLE_SWEAT: &str = include_str!("materials/navy-sparkle-sweat.toml");

    /// All of them by name, the default first: the four above as they were published, the same with
    /// their bending tables read as a plate's, and two that were fitted to drapes.
    pub const ALL: &[(&str, &str)] = &[
        ("gray-interlock", GRAY_INTERLOCK),
        ("camel-ponte-roma", CAMEL_PONTE_ROMA),
        ("11oz-black-denim", DENIM),
        ("navy-sparkle-sweat", NAVY_SPARKLE_SWEAT),
        ("interlock", include_str!("materials/interlock.toml")),
        ("ponte", include_str!("materials/ponte.toml")),
        ("denim", include_str!("materials/denim.toml")),
        ("sweat", include_str!("materials/sweat.toml")),
        ("blue-cotton", include_str!("materials/blue-cotton.toml")),
        ("red-wool", include_str!("materials/red-wool.toml")),
    ];
}

/// Motions of handles, as TOML.
pub mod motions {
    /// `loop`.
    pub const LOOP: &str = include_str!("motions/loop.toml");
    /// `curtsey`.
    pub const CURTSEY: &str = include_str!("motions/curtsey.toml");
}

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
