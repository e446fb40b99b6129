//! A cloth that is ready to be moved, by whom it may be.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Environment, HandlePath, Motion, RecordedMotion, Scene};
use selvedge_data::{Provenance, SavedState, SceneSpec};
use selvedge_lab::machine::Machine;
use selvedge_lab::physics;
use selvedge_live::{Bench, Hold, LiveStepper, MoverKind, Start};
use selvedge_model::Model;

use super::movers::{LiveModel, LivePhysics};

/// A scene with its rest pose and a model.
pub(super) struct SceneBench {
    /// As it will be written beside recordings.
    pub(super) spec: SceneSpec,
    /// As it is, with its own motion.
    pub(super) scene: Scene,
    /// As steppers have it: its handles go where the hands lead them.
    pub(super) led: Arc<Scene>,
    /// With the rest pose.
    pub(super) cloth: Arc<Cloth>,
    /// Where it starts.
    pub(super) start: SavedState,
    /// What moves it, where no physics does.
    pub(super) model: Arc<Model>,
    /// Where that runs.
    pub(super) machine: Machine,
    /// What people should know.
    pub(super) remarks: Vec<String>,
}

impl Bench for SceneBench {
    fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    fn frame_rate(&self) -> f64 {
        self.scene.frame_rate
    }

    fn environment(&self) -> Environment {
        self.scene.environment
    }

    fn scene_path(&self) -> Result<HandlePath, String> {
        self.scene.handle_path().map_err(|error| error.to_string())
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
    ) -> Result<Box<dyn LiveStepper>, String> {
        let beginning = [physics::rounded(&self.start.positions)];
        let frames = match start {
            Start::Beginning => &beginning[..],
            Start::Frames(frames) => frames,
        };
        match kind {
            MoverKind::Model => {
                let frames: Vec<&[Vec3]> = frames.iter().map(Vec::as_slice).collect();
                let model = (&self.model, &self.machine);
                let (scene, cloth) = (&self.led, &self.cloth);
                Ok(Box::new(LiveModel::start(
                    model, scene, cloth, hold, &frames,
                )?))
            }
            MoverKind::Physics => {
                let (state, frame) = match start {
                    Start::Beginning => {
                        let SavedState {
                            positions,
                            velocities,
                            frame,
                        } = self.start.clone();
                        ((positions, velocities), frame)
                    }
                    Start::Frames(frames) => (moving(frames, self.scene.frame_rate)?, 0),
                };
                Ok(Box::new(LivePhysics::start(&self.led, hold, state, frame)?))
            }
        }
    }

    fn provenance(&self, hold: &Hold, handles: Vec<Vec<DVec3>>) -> Result<Provenance, String> {
        let mut spec = self.spec.clone();
        spec.setting.handles = hold.handles.vertices().iter().map(|v| v.0).collect();
        spec.setting.schedule.releases.clear();
        spec.setting.environment = hold.environment;
        spec.motion = Motion::Recorded(RecordedMotion { positions: handles });
        physics::provenance(&spec, &self.scene).map_err(|error| crate::failure::chain(&error))
    }
}

/// Positions `[m]` and velocities `[m/s]` in the last of `frames`.
fn moving(frames: &[Vec<Vec3>], rate: f64) -> Result<(Vec<DVec3>, Vec<DVec3>), String> {
    let last = frames.last().ok_or("there is no frame to go on from")?;
    let before = match frames.len() {
        0 | 1 => last,
        count => &frames[count - 2],
    };
    let velocity = |(now, before): (&Vec3, &Vec3)| (now.as_dvec3() - before.as_dvec3()) * rate;
    let velocities = last.iter().zip(before).map(velocity).collect();
    Ok((last.iter().map(|p| p.as_dvec3()).collect(), velocities))
}
