//! Opening a scene, and saying what of it cannot be had.

use std::path::Path;

use selvedge_data::{LoadedScene, open_scene};

/// Opens a scene by the path of its file or by the name of a shipped one; warns of what the file
/// asks for and cannot have.
pub(crate) fn open(path_or_name: &str) -> anyhow::Result<LoadedScene> {
    let loaded = open_scene(path_or_name)?;
    for warning in &loaded.warnings {
        tracing::warn!("{path_or_name}: {warning}");
    }
    Ok(loaded)
}

/// The files that a scene was read from, for [`check_outputs`](crate::place::check_outputs).
pub(crate) fn inputs(loaded: &LoadedScene) -> Vec<(&str, &Path)> {
    let files = loaded.files.iter();
    files
        .map(|file| ("a file of the scene", file.as_path()))
        .collect()
}
