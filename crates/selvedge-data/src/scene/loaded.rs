//! A scene that has been read: its spec, what is built from it, and what to warn of; also with
//! another material or another motion in the place of its own.

use std::path::{Path, PathBuf};

use selvedge_cloth::{Checkpoint, LoosePanels, Scene};

use super::material_source::MaterialSource;
use super::motion_source::{MotionSource, Stand};
use super::spec::{SceneSpec, StartSpec};
use super::strained;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::ending_of;
use crate::formats::polygons::ReadMesh;

/// A scene, and the spec that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedScene {
    /// Resolved: what results carry.
    pub spec: SceneSpec,
    /// Built: what is run.
    pub scene: Scene,
    /// The state in which a run starts, if it starts in a saved one.
    pub state: Option<Checkpoint>,
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
    /// The scene of `spec` on the mesh that was read for it. It starts in `state`, or with the
    /// velocities of the mesh's file; `files` are those that the spec does not name, and `remedy`
    /// says how a mesh can be mended that starts far from its material size.
    pub(super) fn of(
        spec: SceneSpec,
        read: ReadMesh,
        state: Option<Checkpoint>,
        mut files: Vec<PathBuf>,
        folder: &Path,
        remedy: &str,
    ) -> Result<Self, Problem> {
        let mut warnings = read.warnings;
        let mesh = read.sheet.mesh;
        // A cloth that is put onto a body has no velocity there.
        let is_as_read = spec.start == StartSpec::Mesh && spec.dress.is_none();
        let velocities = read.velocities.filter(|_| is_as_read);
        let moving = |v| Checkpoint::of(0, mesh.positions().to_vec(), v);
        let state = state.or_else(|| velocities.map(moving));
        files.extend(spec.files(folder));
        let scene = spec.with_mesh(mesh, folder, &mut warnings)?;
        let start = state.as_ref().map(|state| &state.positions[..]);
        let start = start.unwrap_or(scene.mesh.positions());
        // A start that fits the cloth says itself what it cannot mend.
        if spec.start != StartSpec::Fit {
            warnings.extend(strained::warnings(&scene.mesh, start, remedy));
        }
        // From a rest pose a free cloth does not start at all.
        let is_free = scene.handles.is_empty() && scene.obstacles.is_empty();
        if is_free && spec.start != StartSpec::Rest {
            let text = "the scene has neither handles nor obstacles: the cloth falls freely";
            warnings.push(text.to_owned());
        }
        Ok(Self {
            spec,
            scene,
            state,
            loose: read.loose,
            is_own_shape: read.is_own_shape,
            warnings,
            files,
        })
    }

    /// The scene that was resolved to `spec`; the files that this names are relative to `folder`.
    ///
    /// # Errors
    /// [`Problem`] names the part that cannot be used, and a file that is another one by now.
    pub fn of_spec(spec: SceneSpec, folder: &Path) -> Result<Self, Problem> {
        let read = spec.setting.mesh.read(folder)?;
        let vertices = read.sheet.mesh.topology().vertex_count();
        let state = match &spec.start {
            StartSpec::State(kept) => Some(kept.read(folder, vertices)?),
            _ => None,
        };
        let remedy = spec.setting.mesh.remedy();
        Self::of(spec, read, state, Vec::new(), folder, &remedy)
    }

    /// The same scene of another material: the name of a shipped one, or a TOML file relative to
    /// the current folder.
    ///
    /// # Errors
    /// [`FileError`] names the scene, the field and what is wrong.
    pub fn of_material(self, name_or_file: &str) -> Result<Self, FileError<Problem>> {
        self.changed(|loaded| {
            let source = MaterialSource::Named(name_or_file.to_owned());
            let material = source.resolve(Path::new(""), &mut loaded.files)?;
            loaded.spec.setting.material = material.clone();
            loaded.scene.material = material;
            Ok(())
        })
    }

    /// The same scene with another motion: a name, a TOML file, or a recorded motion (.csv, .npz);
    /// files are relative to the current folder.
    ///
    /// # Errors
    /// As for [`Self::of_material`].
    pub fn of_motion(self, name_or_file: &str) -> Result<Self, FileError<Problem>> {
        self.changed(|loaded| {
            let path = PathBuf::from(name_or_file);
            let source = match ending_of(&path).as_str() {
                "toml" => MotionSource::File(path),
                "csv" | "npz" => MotionSource::Recorded(path),
                _ => MotionSource::Named(name_or_file.to_owned()),
            };
            let groups = Vec::new();
            let stand = Stand::of(&loaded.spec.setting, &loaded.scene.mesh, &groups);
            let motion = source.resolve(Path::new(""), &stand)?;
            loaded.files.extend(source.file().map(Path::to_owned));
            loaded.spec.motion = motion.clone();
            loaded.scene.motion = motion;
            Ok(())
        })
    }

    /// Changes a part and checks the whole.
    fn changed(
        mut self,
        change: impl FnOnce(&mut Self) -> Result<(), Problem>,
    ) -> Result<Self, FileError<Problem>> {
        let changed = change(&mut self).and_then(|()| Ok(self.scene.validate()?));
        changed.map_err(FileError::at(self.spec.name.as_ref()))?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::super::file::open_scene;
    use super::*;
    use crate::test_help::says;

    #[test]
    fn another_material_and_motion_are_in_scene_and_spec_alike() {
        let own = open_scene("default").unwrap();
        let changed = own.clone().of_material("11oz-black-denim").unwrap();
        let changed = changed.of_motion("side").unwrap();
        assert_eq!(changed.scene.material.name, "11oz-black-denim");
        assert_ne!(changed.scene.motion, own.scene.motion);
        // The spec makes the very scene.
        assert_eq!(changed.spec.build(Path::new("")).unwrap(), changed.scene);
    }

    #[test]
    fn files_are_read_and_known() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let stiff = "from = \"gray-interlock\"\nbend_multiplier = 2\n";
        let material = file("stiff.toml", stiff);
        let still = "kind = \"blocks\"\nblocks = [{ duration = 1.0 }]\n";
        let motion = file("still.toml", still);
        let changed = open_scene("default").unwrap();
        let changed = changed.of_material(&material.to_string_lossy()).unwrap();
        let changed = changed.of_motion(&motion.to_string_lossy()).unwrap();
        assert_eq!(changed.files, [material, motion]);
        assert_eq!(changed.scene.frame_count().unwrap(), 60);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_remedy() {
        let open = || open_scene("default").unwrap();
        let material = open().of_material("silk").unwrap_err();
        says(material, &["default: material", "gray-interlock"]);
        let motion = open().of_motion("dance").unwrap_err();
        says(motion, &["default: motion.named", "forward"]);
        let gone = open().of_motion("gone.toml").unwrap_err();
        says(gone, &["motion.file", "gone.toml"]);
    }
}
