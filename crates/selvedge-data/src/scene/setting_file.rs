//! A setting as people write it in a scene or in a preset of data sets: mesh, handles, material and
//! air.

use std::path::{Path, PathBuf};

use selvedge_cloth::{DEFAULT_FRAME_RATE, Environment, Mesh, SagSettings};
use serde::Deserialize;

use super::handle_selection::{Groups, HandleSelection, Selected};
use super::material_source::MaterialSource;
use super::mesh_spec::{GeneratorSpec, MeshSource, MeshSpec, Transform};
use super::physics_file::PhysicsFile;
use super::problem::{SceneProblem, field};
use super::spec::Setting;
use crate::formats::obj::{ObjOptions, Seams, TextureUnit};

/// A scene without name, motion and start, as a data set's preset has it.
///
/// `SceneFile` has the same keys again: flattened into it, they would lose their line numbers in
/// errors.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SettingFile {
    pub(super) mesh: MeshFile,
    pub(super) handles: HandleSelection,
    pub(super) material: MaterialSource,
    #[serde(default)]
    pub(super) environment: Environment,
    #[serde(default)]
    pub(super) physics: PhysicsFile,
    #[serde(default)]
    pub(super) sag: SagSettings,
    #[serde(default)]
    pub(super) frame_rate: FrameRate,
}

/// Frames per second.
#[derive(Deserialize)]
#[serde(transparent)]
pub(crate) struct FrameRate(f64);

impl Default for FrameRate {
    fn default() -> Self {
        Self(DEFAULT_FRAME_RATE)
    }
}

/// A mesh in the file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshFile {
    generator: Option<GeneratorSpec>,
    obj: Option<String>,
    seams: Option<Seams>,
    texture: Option<TextureUnit>,
    #[serde(default)]
    transform: Transform,
}

impl SettingFile {
    /// Looks up what is named, and builds the mesh; the groups are those of the handles. The files
    /// of the material are added to `files`: what is resolved does not name them.
    pub(crate) fn resolve(
        self,
        folder: &Path,
        files: &mut Vec<PathBuf>,
    ) -> Result<(Setting, Mesh, Groups), SceneProblem> {
        let mesh = self.mesh.resolve(folder)?;
        let sheet = mesh.build(folder)?;
        let Selected {
            vertices,
            groups,
            schedule,
        } = self.handles.select(&sheet)?;
        let setting = Setting {
            handles: vertices,
            schedule,
            mesh,
            material: self.material.resolve(folder, files)?,
            environment: self.environment,
            physics: self.physics.0,
            sag: self.sag,
            frame_rate: self.frame_rate.0,
        };
        Ok((setting, sheet.mesh, groups))
    }
}

impl MeshFile {
    /// Looks for an OBJ from `folder`.
    pub(crate) fn resolve(self, folder: &Path) -> Result<MeshSpec, SceneProblem> {
        let options = ObjOptions {
            seams: self.seams.unwrap_or_default(),
            texture: self.texture.unwrap_or_default(),
        };
        let source = match (self.generator, self.obj) {
            (Some(_), None) if self.seams.is_some() || self.texture.is_some() => {
                return Err(field("mesh", "seams and texture are for an obj"));
            }
            (Some(generator), None) => MeshSource::Generator(generator),
            (None, Some(path)) => MeshSource::obj(&path, folder, options)?,
            (None, None) => return Err(field("mesh", "needs a generator or an obj")),
            (Some(_), Some(_)) => {
                return Err(field("mesh", "has both a generator and an obj: keep one"));
            }
        };
        Ok(MeshSpec {
            source,
            transform: self.transform,
        })
    }
}
