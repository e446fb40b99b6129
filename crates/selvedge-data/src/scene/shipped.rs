//! The materials and scenes that are built in, from `selvedge-assets`.

use selvedge_assets::SCENES;
use selvedge_assets::materials::ALL as MATERIALS;

/// The shipped materials: names and TOML texts, the default first.
#[must_use]
pub fn materials() -> &'static [(&'static str, &'static str)] {
    MATERIALS
}

/// The shipped scenes: names and TOML texts.
#[must_use]
pub fn shipped_scenes() -> &'static [(&'static str, &'static str)] {
    SCENES
}

/// The text of a shipped scene.
pub(super) fn shipped_scene_text(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|scene| scene.0 == name).map(|s| s.1)
}

/// The shipped material of this name, if there is one.
pub(super) fn material_text(name: &str) -> Option<&'static str> {
    MATERIALS.iter().find(|entry| entry.0 == name).map(|e| e.1)
}
