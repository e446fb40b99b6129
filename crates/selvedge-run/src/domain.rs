//! What of a scene goes beyond what a model was trained on, known before the
//! first frame.

use selvedge_cloth::Scene;
use selvedge_model::{Aspect, Departure, Domain, Model};

use crate::Error;

/// The ways in which a motion goes beyond a model's training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Beyond {
    /// Over the whole motion.
    pub departures: Vec<Departure>,
    /// In each frame after the start, where the motion is a scene's.
    pub by_frame: Vec<Vec<Aspect>>,
}

/// Compares `frames` frames of a scene with what `model` was trained on; none where its file does
/// not say.
pub fn of_scene(model: &Model, scene: &Scene, frames: usize) -> Result<Option<Beyond>, Error> {
    let Some(trained) = model.domain() else {
        return Ok(None);
    };
    let mut by_frame = Vec::with_capacity(frames);
    let found = Domain::by_frame(scene, frames, |now| {
        let departures = trained.departures(now).into_iter();
        by_frame.push(departures.map(|departure| departure.aspect).collect());
    })?;
    let departures = checked(&trained, &found)?;
    Ok(Some(Beyond {
        departures,
        by_frame,
    }))
}

/// What of `found` goes beyond what a model was trained on.
///
/// # Errors
/// Another frame rate.
pub fn checked(trained: &Domain, found: &Domain) -> Result<Vec<Departure>, Error> {
    let departures = trained.departures(found);
    if let Some(rate) = departures.iter().find(|d| d.aspect == Aspect::FrameRate) {
        return Err(Error::Model(format!(
            "{}: a frame of the model is a step of that length, so its motion would be too fast or too slow; set frame_rate = {} in the scene",
            rate.words, trained.frame_rate.most
        )));
    }
    Ok(departures)
}

#[cfg(all(test, feature = "learned"))]
mod tests {
    use selvedge_cloth::Environment;

    use super::*;
    use crate::run::tests::hanging;

    /// The shipped model as if it had been trained on five frames of a scene.
    fn trained_on(scene: &Scene) -> Model {
        let model = crate::Model::open(Some("paper".as_ref())).unwrap().model;
        let domain = Domain::by_frame(scene, 5, |_| {}).unwrap();
        let training = serde_json::json!({ "domain": domain }).to_string();
        let mut model = Model::clone(&model);
        model.training = training;
        model
    }

    #[test]
    fn a_scene_is_compared_frame_by_frame() {
        let mut scene = hanging();
        let model = trained_on(&scene);
        let within = of_scene(&model, &scene, 5).unwrap().unwrap();
        assert_eq!(within.departures, []);
        assert_eq!(within.by_frame, vec![vec![]; 5]);
        scene.environment.wind.x = 6.0;
        let beyond = of_scene(&model, &scene, 3).unwrap().unwrap();
        assert_eq!(beyond.departures[0].aspect, Aspect::Wind);
        assert_eq!(beyond.by_frame, vec![vec![Aspect::Wind]; 3]);
    }

    #[test]
    fn another_frame_rate_is_an_error_with_its_remedy() {
        let mut scene = hanging();
        let model = trained_on(&scene);
        scene.frame_rate *= 2.0;
        let error = of_scene(&model, &scene, 2).unwrap_err().to_string();
        assert!(
            error.contains("120 frames per second, trained at 60"),
            "{error}"
        );
        assert!(error.contains("set frame_rate = 60"), "{error}");
    }

    #[test]
    fn a_model_that_does_not_say_is_not_judged() {
        let mut silent = Model::clone(&crate::Model::open(Some("paper".as_ref())).unwrap().model);
        silent.training = String::new();
        let mut scene = hanging();
        scene.environment = Environment {
            wind: glam::DVec3::X * 9.0,
            ..scene.environment
        };
        assert_eq!(of_scene(&silent, &scene, 2).unwrap(), None);
    }
}
