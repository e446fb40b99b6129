//! A scene that was read, with another material or another motion in the place of its own.

use std::path::{Path, PathBuf};

use selvedge_cloth::SceneError;

use super::loaded::LoadedScene;
use super::material_source::MaterialSource;
use super::motion_source::{MotionSource, Stand};
use super::problem::{SceneFileError, SceneProblem};
use super::spec::SceneSpecError;

impl LoadedScene {
    /// The same scene of another material: the name of a shipped one, or a TOML file relative to
    /// the current folder.
    ///
    /// # Errors
    /// [`SceneFileError`] names the scene, the field and what is wrong.
    pub fn of_material(self, name_or_file: &str) -> Result<Self, SceneFileError> {
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
    pub fn of_motion(self, name_or_file: &str) -> Result<Self, SceneFileError> {
        self.changed(|loaded| {
            let path = PathBuf::from(name_or_file);
            let ending = path.extension().and_then(|ending| ending.to_str());
            let source = match ending {
                Some("toml") => MotionSource::File(path),
                Some("csv" | "npz") => MotionSource::Recorded(path),
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
        change: impl FnOnce(&mut Self) -> Result<(), SceneProblem>,
    ) -> Result<Self, SceneFileError> {
        let wrong = |error: SceneError| SceneProblem::Spec(SceneSpecError::Scene(error));
        let changed = change(&mut self).and_then(|()| self.scene.validate().map_err(wrong));
        changed.map_err(SceneFileError::at(&self.spec.name))?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::super::file::open_scene;
    use super::*;

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
        let motion = file(
            "still.toml",
            "kind = \"blocks\"\nblocks = [{ duration = 1.0 }]\n",
        );
        let changed = open_scene("default").unwrap();
        let changed = changed.of_material(&material.to_string_lossy()).unwrap();
        let changed = changed.of_motion(&motion.to_string_lossy()).unwrap();
        assert_eq!(changed.files, [material, motion]);
        assert_eq!(changed.scene.frame_count().unwrap(), 60);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_remedy() {
        let open = || open_scene("default").unwrap();
        let wrong = [
            (
                open().of_material("silk"),
                ["default: material", "gray-interlock"],
            ),
            (
                open().of_motion("dance"),
                ["default: motion.named", "forward"],
            ),
            (open().of_motion("gone.toml"), ["motion.file", "gone.toml"]),
        ];
        for (result, words) in wrong {
            let error = result.unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }
}
