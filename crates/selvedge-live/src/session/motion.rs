//! How the cloth of a session is moved on by one frame: where its handles go, by hand or along a
//! motion, and what is kept of it.

use glam::DVec3;
use selvedge_cloth::motion::named;
use selvedge_cloth::{HandleError, HandlePath, HandleTargets};

use super::Session;
use crate::hand::Hands;
use crate::order::MoverKind;
use crate::state::{Level, MotionState};

/// The name of the motion that is the scene's own.
pub(super) const SCENE_MOTION: &str = "scene";

/// A motion that the handles follow, or will as soon as they have come to rest.
pub(super) struct Following {
    name: String,
    /// Where they go; not known yet while they brake.
    path: Option<HandlePath>,
    frame: usize,
    samples: usize,
}

impl Following {
    pub(super) fn state(&self) -> MotionState {
        MotionState {
            name: self.name.clone(),
            frame: self.frame,
            frames: self.path.as_ref().map_or(0, HandlePath::frame_count),
        }
    }
}

impl Session {
    /// Follows the motion of that name: the scene's own from the start, another from where the handles
    /// come to rest.
    pub(super) fn follow(&mut self, name: String) -> Result<(), String> {
        if name == SCENE_MOTION {
            self.end_recording("the scene's own motion starts from its beginning: ");
        }
        let stage = self.stage.as_mut().ok_or("there is no cloth yet")?;
        let path = if name == SCENE_MOTION {
            let path = stage.bench().scene_path()?;
            let mover = stage.mover();
            stage.restart(mover)?;
            self.hands = Hands::at(&stage.places(&stage.hold().handles));
            Some(path)
        } else {
            let motion = named::by_name(&name);
            let motion = motion.ok_or_else(|| format!("there is no motion {name:?}"))?;
            let rate = stage.bench().frame_rate();
            let trial = motion.bind(&self.hands.positions(), rate);
            trial.map_err(|error| error.to_string())?;
            self.hands.brake(&self.limits);
            None
        };
        self.following = Some(Following {
            name,
            path,
            frame: 0,
            samples: 4,
        });
        self.tell_soon = true;
        Ok(())
    }

    /// The motion ends where it is; the handles brake.
    pub(super) fn unfollow(&mut self) {
        if let Some(following) = self.following.take() {
            if following.path.is_some() {
                self.hands.brake(&self.limits);
            }
            self.tell_soon = true;
        }
    }

    /// The cloth by one frame.
    pub(super) fn move_cloth(&mut self) {
        let Some(rate) = self.stage.as_ref().map(|s| s.bench().frame_rate()) else {
            return;
        };
        let targets = match self.next_targets(rate) {
            Ok(targets) => targets,
            Err(error) => {
                self.unfollow();
                return self.notify(Level::Bad, error);
            }
        };
        let Some(stage) = &mut self.stage else { return };
        let stopped = |tracks: Vec<crate::state::Track>| {
            let of = |t: crate::state::Track| t.stopped.map(|why| (t.name, t.kind, why));
            tracks.into_iter().filter_map(of).collect::<Vec<_>>()
        };
        let before = stopped(stage.tracks());
        stage.step(&targets);
        let after = stopped(stage.tracks());
        if let Some(recorder) = &mut self.recorder {
            recorder.keep(stage);
        }
        if let Some((name, kind, why)) = after.into_iter().find(|s| !before.contains(s)) {
            let remedy = match kind {
                Some(MoverKind::Model) => "reset, or let the physics take over",
                _ => "reset",
            };
            self.stop_recording();
            self.notify(Level::Bad, format!("{name} stopped: {why} ({remedy})"));
        }
        if self
            .recorder
            .as_ref()
            .is_some_and(crate::recorder::Recorder::is_full)
        {
            self.stop_recording();
        }
    }

    fn next_targets(&mut self, rate: f64) -> Result<HandleTargets, String> {
        self.begin_motion(rate)?;
        let text = |error: HandleError| error.to_string();
        if let Some(following) = &mut self.following
            && let Some(path) = &following.path
        {
            if following.frame >= path.frame_count() {
                let last = path.at(following.frame as f64 / rate);
                self.following = None;
                self.tell_soon = true;
                self.hands = Hands::at(&last);
            } else {
                let targets = path
                    .targets(following.frame, following.samples)
                    .map_err(text)?;
                following.frame += 1;
                self.hands = self.hands.led_to(targets.end(), 1.0 / rate);
                return Ok(targets);
            }
        }
        self.hands.advance(&self.limits, 1.0 / rate);
        let positions: Vec<DVec3> = self.hands.positions();
        HandleTargets::at_frame_end(positions).map_err(text)
    }

    /// Binds the motion that waits, once the handles are at rest.
    fn begin_motion(&mut self, rate: f64) -> Result<(), String> {
        if let Some(following) = &mut self.following
            && following.path.is_none()
            && self.hands.is_at_rest()
        {
            let motion = named::by_name(&following.name);
            let motion =
                motion.ok_or_else(|| format!("there is no motion {:?}", following.name))?;
            let path = motion.bind(&self.hands.positions(), rate);
            following.path = Some(path.map_err(|error| error.to_string())?);
        }
        Ok(())
    }
}
