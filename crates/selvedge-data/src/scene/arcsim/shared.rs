//! The parts of an ARCSim scene that several of its readers need: the pace, and files by name.

use std::path::{Path, PathBuf};

use selvedge_cloth::{PhysicsMode, PhysicsSettings};

/// The pace of a scene.
pub(super) struct Times {
    pub(super) frame_time: f64,
    pub(super) substeps: u32,
    /// `[s]`
    pub(super) duration: f64,
}

impl Times {
    /// ARCSim's physics at this pace.
    pub(super) fn physics(&self) -> PhysicsSettings {
        PhysicsSettings {
            substeps: self.substeps,
            ..PhysicsSettings::in_mode(PhysicsMode::Arcsim)
        }
    }
}

/// The file that `path` means, as a scene in `folder` names it.
pub(super) fn find_file(path: &str, folder: &Path) -> Option<String> {
    if folder.join(path).is_file() {
        return Some(path.to_owned());
    }
    let here: PathBuf = std::path::absolute(path).ok()?;
    here.is_file().then(|| here.to_string_lossy().into_owned())
}
