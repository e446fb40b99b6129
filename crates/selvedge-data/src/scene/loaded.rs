//! A scene that has been read: its spec, what is built from it, and what to warn of.

use std::path::PathBuf;

use selvedge_cloth::{LoosePanels, Scene};

use super::spec::SceneSpec;
use super::start::StartSpec;
use super::strained;
use crate::trajectory::state_file::SavedState;

/// A scene, and the spec that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedScene {
    /// Resolved: what results carry.
    pub spec: SceneSpec,
    /// Built: what is run.
    pub scene: Scene,
    /// The state in which a run starts, if it starts in a saved one.
    pub state: Option<SavedState>,
    /// The panels before they are sewn, where the scene names seams.
    pub loose: Option<LoosePanels>,
    /// True where each face of the cloth rests as it stands in its file: there is no pattern.
    pub is_own_shape: bool,
    /// Warnings of requests that cannot be met or are hardly meant.
    pub warnings: Vec<String>,
    /// The files that it was read from: its own, and all that it names.
    pub files: Vec<PathBuf>,
}

impl LoadedScene {
    /// A scene that starts as its spec says, from no saved state.
    pub(crate) fn new(spec: SceneSpec, scene: Scene) -> Self {
        Self {
            spec,
            scene,
            state: None,
            loose: None,
            is_own_shape: false,
            warnings: Vec::new(),
            files: Vec::new(),
        }
    }

    /// The same, with warnings where the cloth starts far from its material size (`remedy` says how
    /// its file can be mended). A start that fits the cloth says itself what it cannot mend.
    pub(super) fn looked_over(mut self, remedy: &str) -> Self {
        let mesh = &self.scene.mesh;
        let state = self.state.as_ref();
        let start = state.map_or(mesh.positions(), |state| &state.positions);
        if self.spec.start != StartSpec::Fit {
            self.warnings
                .extend(strained::warnings(mesh, start, remedy));
        }
        let setting = &self.spec.setting;
        let is_free = setting.handles.is_empty() && setting.obstacles.is_empty();
        // From a rest pose it does not start at all.
        if is_free && self.spec.start != StartSpec::Rest {
            self.warnings.push(
                "the scene has neither handles nor obstacles: the cloth falls freely".to_owned(),
            );
        }
        self
    }
}
