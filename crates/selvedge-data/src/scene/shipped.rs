//! The materials and scenes that are built in, under `assets/`.

macro_rules! assets {
    ($folder:literal: $($name:literal),+ $(,)?) => {
        [$((
            $name,
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/", $folder, "/", $name, ".toml")),
        )),+]
    };
}
pub(crate) use assets;

const MATERIALS: [(&str, &str); 4] = assets!("materials":
    "gray-interlock",
    "camel-ponte-roma",
    "11oz-black-denim",
    "navy-sparkle-sweat",
);

const SCENES: [(&str, &str); 2] = assets!("scenes": "default", "square-1024");

/// The shipped materials: names and TOML texts, the default first.
#[must_use]
pub fn materials() -> &'static [(&'static str, &'static str)] {
    &MATERIALS
}

/// The shipped scenes: names and TOML texts.
#[must_use]
pub fn shipped_scenes() -> &'static [(&'static str, &'static str)] {
    &SCENES
}

/// The text of a shipped scene.
pub(super) fn shipped_scene_text(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|scene| scene.0 == name).map(|s| s.1)
}

/// The shipped material of this name, if there is one.
pub(super) fn material_text(name: &str) -> Option<&'static str> {
    MATERIALS.iter().find(|entry| entry.0 == name).map(|e| e.1)
}
