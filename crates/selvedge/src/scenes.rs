//! Opening a scene, and saying what of it cannot be had.

use selvedge_data::{LoadedScene, open_scene};

/// Opens a scene by the path of its file or by the name of a shipped one; warns of what the file asks
/// for and cannot have.
///
/// # Errors
/// What of the scene is wrong.
pub(crate) fn open(path_or_name: &str) -> anyhow::Result<LoadedScene> {
    let loaded = open_scene(path_or_name)?;
    for warning in &loaded.warnings {
        tracing::warn!("{path_or_name}: {warning}");
    }
    Ok(loaded)
}
