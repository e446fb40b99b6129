//! Cases of a study: scenes with a material and a motion each.

use std::path::Path;

use selvedge_cloth::{Integrator, PhysicsSettings, Scene};
use selvedge_data::{LoadedScene, SavedState, SceneFileError, SceneSpec, StartSpec};
use selvedge_model::Aspect;

use super::error::{ChoiceError, ConvergenceError};
use super::method::Method;
use crate::domain;
use crate::event::Reporter;
use crate::report::slug;
use crate::{fitting, physics};

/// A scene that is run.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name in tables.
    pub name: String,
    loaded: LoadedScene,
}

impl Case {
    /// Every one of `scenes` of every one of `materials` and with every one of `motions`; with its
    /// own where there are none.
    ///
    /// # Errors
    /// A material or a motion that is not there, or does not fit a scene.
    pub fn all(
        scenes: &[LoadedScene],
        materials: &[String],
        motions: &[String],
    ) -> Result<Vec<Self>, SceneFileError> {
        let mut cases: Vec<Self> = scenes.iter().map(Self::of).collect();
        cases = varied(cases, materials, LoadedScene::of_material)?;
        varied(cases, motions, LoadedScene::of_motion)
    }

    /// A scene as it is, but for its damping.
    fn of(loaded: &LoadedScene) -> Self {
        let mut loaded = loaded.clone();
        for physics in [&mut loaded.scene.physics, &mut loaded.spec.setting.physics] {
            // The same equations for every integrator.
            let usual = PhysicsSettings {
                integrator: Integrator::default(),
                ..*physics
            };
            physics.least_damping = Some(usual.damping(0.0));
        }
        Self {
            name: loaded.spec.name.clone(),
            loaded,
        }
    }

    /// The scene as it is.
    pub(super) fn scene(&self) -> &Scene {
        &self.loaded.scene
    }

    /// The scene by `method`.
    pub(super) fn scene_by(&self, method: &Method) -> Scene {
        let mut scene = self.loaded.scene.clone();
        scene.physics.integrator = method.integrator.integrator();
        scene.physics.substeps = method.substeps;
        scene
    }

    /// The resolved scene by `method`.
    pub(super) fn spec_by(&self, method: &Method) -> SceneSpec {
        let mut spec = self.loaded.spec.clone();
        spec.setting.physics.integrator = method.integrator.integrator();
        spec.setting.physics.substeps = method.substeps;
        spec
    }

    /// Frames of the motion that have passed where the run starts.
    pub(super) fn first_frame(&self) -> usize {
        self.loaded.state.as_ref().map_or(0, |state| state.frame)
    }

    /// The frame in which the cloth hangs at rest; none where the run does not begin so.
    pub(super) fn rest_frame(&self) -> Option<usize> {
        let begins_at_rest =
            self.loaded.state.is_none() && self.loaded.spec.start == StartSpec::Rest;
        begins_at_rest.then_some(0)
    }

    /// The name as a file may have it.
    pub(super) fn slug(&self) -> String {
        let plain = slug(&self.name);
        let words = plain.split('-').filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-")
    }

    /// Returns `true` where another case comes to rest as this one does: only the motion differs.
    pub(super) fn rests_as(&self, other: &Self) -> bool {
        let (own, its) = (&self.loaded.spec, &other.loaded.spec);
        own.start == its.start
            && own.setting == its.setting
            && self.loaded.state == other.loaded.state
    }

    /// Aspects of the first `frames` frames that the model of `method` was not trained on; none for
    /// physics and for a model that does not say.
    ///
    /// # Errors
    /// A model of another frame rate, or a motion that cannot drive the handles.
    pub(super) fn beyond(
        &self,
        method: &Method,
        frames: usize,
    ) -> Result<Option<Vec<Aspect>>, ChoiceError> {
        let Some(model) = method.integrator.model() else {
            return Ok(None);
        };
        let beyond = domain::of_scene(model, self.scene(), frames);
        let beyond = beyond.map_err(|error| {
            let (scene, model) = (&self.name, &method.integrator);
            ChoiceError::new(format!("scene {scene:?} by {model}: {error}"))
        })?;
        Ok(beyond.map(|beyond| beyond.departures.iter().map(|d| d.aspect).collect()))
    }

    /// The state in which the run starts, as the scene says.
    ///
    /// # Errors
    /// A scene that comes to no rest.
    pub(super) fn start(&self, reporter: &Reporter<'_>) -> Result<SavedState, ConvergenceError> {
        match (&self.loaded.state, &self.loaded.spec.start) {
            (Some(state), _) => Ok(state.clone()),
            (None, StartSpec::Rest) => {
                let rest = physics::find_rest_pose(self.scene(), reporter)?;
                Ok(SavedState::at_rest(rest.positions))
            }
            (None, StartSpec::Fit) => {
                let cloth = fitting::fit_within(&self.loaded, reporter)?;
                if let Some(warning) = &cloth.warning {
                    reporter.remark(warning);
                }
                Ok(SavedState::at_rest(cloth.fitted.positions))
            }
            (None, _) => Ok(SavedState::at_rest(self.scene().mesh.positions().to_vec())),
        }
    }
}

/// Every one of `cases` changed to every one of `names`; as they are where there are none.
fn varied(
    cases: Vec<Case>,
    names: &[String],
    change: fn(LoadedScene, &str) -> Result<LoadedScene, SceneFileError>,
) -> Result<Vec<Case>, SceneFileError> {
    if names.is_empty() {
        return Ok(cases);
    }
    let pairs = cases
        .iter()
        .flat_map(|case| names.iter().map(move |name| (case, name)));
    let changed = pairs.map(|(case, name)| {
        let stem = Path::new(name).file_stem();
        let short = stem.map_or(name.clone(), |stem| stem.to_string_lossy().into_owned());
        Ok(Case {
            name: format!("{}, {short}", case.name),
            loaded: change(case.loaded.clone(), name)?,
        })
    });
    changed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_are_scenes_times_materials_times_motions() {
        let scene = selvedge_data::open_scene("default").unwrap();
        let own = Case::all(std::slice::from_ref(&scene), &[], &[]).unwrap();
        assert_eq!(own[0].name, "default");
        let materials = ["gray-interlock", "11oz-black-denim"].map(str::to_owned);
        let motions = ["forward", "side"].map(str::to_owned);
        let all = Case::all(&[scene], &materials, &motions).unwrap();
        let names: Vec<&str> = all.iter().map(|case| case.name.as_str()).collect();
        let expected = [
            "default, gray-interlock, forward",
            "default, gray-interlock, side",
            "default, 11oz-black-denim, forward",
            "default, 11oz-black-denim, side",
        ];
        assert_eq!(names, expected);
        assert_eq!(all[1].slug(), "default-gray-interlock-side");
        assert!(all[0].rests_as(&all[1]) && !all[1].rests_as(&all[2]));
    }
}
