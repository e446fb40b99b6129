//! The movers of a cloth of a scene: the physics, and a model.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge::rounded;
use selvedge_cloth::{Cloth, Environment, Motion, RecordedMotion, Scene};
use selvedge_data::{Provenance, SceneSpec};
use selvedge_live::{Influences, LiveError, LiveStepper, Mover, MoverKind, Movers, Start};
use selvedge_model::{Aspect, Domain, DomainWatch, Model};

use selvedge_sim::Checkpoint;

use super::movers::{LiveModel, LivePhysics, ModelOnMachine};

/// A scene with its rest pose and a model.
pub(super) struct SceneMovers {
    /// The scene as it is written beside recordings.
    pub(super) spec: SceneSpec,
    /// The scene with its own motion.
    pub(super) scene: Scene,
    /// The scene of the steppers: its handles go where the hands lead them.
    pub(super) led: Arc<Scene>,
    /// The cloth, with the rest pose.
    pub(super) cloth: Arc<Cloth>,
    pub(super) start: Checkpoint,
    pub(super) model_name: String,
    /// The model, for the learned mover.
    pub(super) model: ModelOnMachine,
}

impl Movers for SceneMovers {
    fn remark_on(&self, mover: Mover, influences: &Influences, places: &[DVec3]) -> Option<String> {
        let is_moved_by_it = mover.kinds().contains(&MoverKind::Model);
        let start = influences.handles.select(&self.start.positions);
        let hands = hands(influences, self.scene.frame_rate, [&start, places]);
        let beyond = untrained(&self.model_name, &self.model.model, &hands);
        beyond.filter(|_| is_moved_by_it)
    }

    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        influences: &Influences,
    ) -> Result<Box<dyn LiveStepper>, LiveError> {
        let beginning = [rounded(&self.start.positions)];
        let frames = match start {
            Start::Beginning => &beginning[..],
            Start::Frames(frames) => frames,
        };
        match kind {
            MoverKind::Model => {
                let frames: Vec<&[Vec3]> = frames.iter().map(Vec::as_slice).collect();
                let (scene, cloth) = (&self.led, &self.cloth);
                Ok(Box::new(LiveModel::start(
                    &self.model,
                    scene,
                    cloth,
                    influences,
                    &frames,
                )?))
            }
            MoverKind::Physics => {
                let state = match start {
                    Start::Beginning => self.start.clone(),
                    Start::Frames(frames) => moving(frames, self.scene.frame_rate)?,
                };
                Ok(Box::new(LivePhysics::start(&self.led, influences, &state)?))
            }
        }
    }

    fn provenance(
        &self,
        influences: &Influences,
        handles: Vec<Vec<DVec3>>,
    ) -> Result<Provenance, LiveError> {
        let mut spec = self.spec.clone();
        spec.setting.handles = influences.handles.vertices().iter().map(|v| v.0).collect();
        spec.setting.schedule.releases.clear();
        spec.setting.environment = influences.environment;
        spec.motion = Motion::Recorded(RecordedMotion { positions: handles });
        selvedge::provenance(&spec, &self.scene).map_err(LiveError::new)
    }
}

/// The domain of hands that went from the first of `places` to the second `[m]`, `[handles]`.
fn hands(influences: &Influences, frame_rate: f64, places: [&[DVec3]; 2]) -> Domain {
    let Environment { gravity, wind, .. } = influences.environment;
    let mut watch = DomainWatch::new(gravity, frame_rate);
    let held = vec![true; influences.handles.len()];
    for places in places {
        watch.see(places, &held, wind);
    }
    watch.now().clone()
}

/// A remark on hands and wind `now` in which a model was not trained; none where there is nothing
/// to say, or where its file does not say what it was trained in.
fn untrained(name: &str, model: &Model, now: &Domain) -> Option<String> {
    let trained = model.domain()?;
    let now = Domain {
        handles: now.handles,
        height_difference: now.height_difference,
        moved_apart: now.moved_apart,
        wind: now.wind,
        ..trained.clone()
    };
    let departures = trained.departures(&now);
    // How far apart handles are changes with every frame.
    let words = departures.iter().map(|departure| match departure.aspect {
        Aspect::Heights => "handles at different heights".to_owned(),
        Aspect::Apart => "handles that move apart or together".to_owned(),
        _ => departure.words.clone(),
    });
    let words: Vec<String> = words.collect();
    let words = words.join("; ");
    (!words.is_empty()).then(|| {
        format!("{words}: what the model {name} shows now is a guess, and the solver knows better")
    })
}

/// The state in the last of `frames`, frames counted from 0.
fn moving(frames: &[Vec<Vec3>], rate: f64) -> Result<Checkpoint, LiveError> {
    let last = frames.last();
    let last = last.ok_or_else(|| LiveError::new("there is no frame to go on from"))?;
    let before = match frames.len() {
        0 | 1 => last,
        count => &frames[count - 2],
    };
    let velocity = |(now, before): (&Vec3, &Vec3)| (now.as_dvec3() - before.as_dvec3()) * rate;
    Ok(Checkpoint::of(
        0,
        last.iter().map(|p| p.as_dvec3()).collect(),
        last.iter().zip(before).map(velocity).collect(),
    ))
}

#[cfg(test)]
mod tests {
    use selvedge_cloth::Handles;

    use super::*;

    #[test]
    fn what_a_model_has_not_seen_is_said() {
        let influences = |handles: &[u32], wind: f64| {
            let influences = Influences {
                handles: Handles::new(handles, 9).unwrap(),
                environment: Environment {
                    wind: DVec3::new(wind, 0.0, 0.0),
                    ..Environment::default()
                },
            };
            let places = vec![DVec3::ZERO; handles.len()];
            hands(&influences, 60.0, [&places, &places])
        };
        let paper = selvedge::Model::open(Some("paper".as_ref())).unwrap();
        let selvedge::Model { name, model } = paper;
        assert_eq!(untrained(&name, &model, &influences(&[0, 2], 0.0)), None);
        let mut silent = Model::clone(&model);
        silent.training = String::new();
        assert_eq!(untrained(&name, &silent, &influences(&[], 9.0)), None);
        for (held, wind, words) in [
            (
                &[0, 2][..],
                3.0,
                "wind of up to 3.0 m/s, trained in still air:",
            ),
            (&[0][..], 0.0, "1 handle held at once, trained with 2:"),
            (&[][..], 0.0, "0 handles held"),
            (
                &[0, 1, 2][..],
                2.0,
                "in still air; 3 handles held at once, trained with 2:",
            ),
        ] {
            let text = untrained(&name, &model, &influences(held, wind)).unwrap();
            assert!(text.contains(words), "{text}");
        }
    }
}
