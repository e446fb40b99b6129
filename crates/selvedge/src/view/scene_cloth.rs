//! A cloth of a scene that is ready to be moved, by the physics or by a model.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Environment, HandlePath, Motion, MotionError, RecordedMotion, Scene};
use selvedge_data::{Provenance, SavedState, SceneSpec};
use selvedge_lab::physics;
use selvedge_live::{Hold, LiveStepper, MoverError, MoverKind, ProvenanceError, ReadyCloth, Start};

use super::movers::{LiveModel, LivePhysics, ModelOnMachine};

/// A scene with its rest pose and a model.
pub(super) struct SceneCloth {
    /// The scene as it is written beside recordings.
    pub(super) spec: SceneSpec,
    /// The scene with its own motion.
    pub(super) scene: Scene,
    /// The scene of the steppers: its handles go where the hands lead them.
    pub(super) led: Arc<Scene>,
    /// The cloth, with the rest pose.
    pub(super) cloth: Arc<Cloth>,
    /// The state at the start.
    pub(super) start: SavedState,
    /// The model, for the learned mover.
    pub(super) model: ModelOnMachine,
    /// Remarks for people.
    pub(super) remarks: Vec<String>,
}

impl ReadyCloth for SceneCloth {
    fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    fn frame_rate(&self) -> f64 {
        self.scene.frame_rate
    }

    fn environment(&self) -> Environment {
        self.scene.environment
    }

    fn scene_path(&self) -> Result<HandlePath, MotionError> {
        self.scene.handle_path()
    }

    fn start_frame(&self) -> usize {
        self.start.frame
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }

    fn start(
        &self,
        kind: MoverKind,
        start: Start<'_>,
        hold: &Hold,
    ) -> Result<Box<dyn LiveStepper>, MoverError> {
        let beginning = [physics::rounded(&self.start.positions)];
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
                    hold,
                    &frames,
                )?))
            }
            MoverKind::Physics => {
                let state = match start {
                    Start::Beginning => self.start.clone(),
                    Start::Frames(frames) => moving(frames, self.scene.frame_rate)?,
                };
                Ok(Box::new(LivePhysics::start(&self.led, hold, state)?))
            }
        }
    }

    fn provenance(
        &self,
        hold: &Hold,
        handles: Vec<Vec<DVec3>>,
    ) -> Result<Provenance, ProvenanceError> {
        let mut spec = self.spec.clone();
        spec.setting.handles = hold.handles.vertices().iter().map(|v| v.0).collect();
        spec.setting.schedule.releases.clear();
        spec.setting.environment = hold.environment;
        spec.motion = Motion::Recorded(RecordedMotion { positions: handles });
        physics::provenance(&spec, &self.scene).map_err(ProvenanceError::new)
    }
}

/// The state in the last of `frames`, frames counted from 0.
fn moving(frames: &[Vec<Vec3>], rate: f64) -> Result<SavedState, MoverError> {
    let last = frames
        .last()
        .ok_or_else(|| MoverError::new("there is no frame to go on from"))?;
    let before = match frames.len() {
        0 | 1 => last,
        count => &frames[count - 2],
    };
    let velocity = |(now, before): (&Vec3, &Vec3)| (now.as_dvec3() - before.as_dvec3()) * rate;
    Ok(SavedState {
        positions: last.iter().map(|p| p.as_dvec3()).collect(),
        velocities: last.iter().zip(before).map(velocity).collect(),
        frame: 0,
        previous: None,
    })
}
