//! How the cloth of a session is moved on by one frame: where its handles go, by hand or along a
//! motion, and what is kept of it.
//!
//! A motion may let handles go. Where one takes hold again, or the motion ends, the hand is put where the
//! cloth has the vertex by then, and the rest of the path goes on from there.

use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::motion::named;
use selvedge_cloth::{HandleError, HandlePath, HandleTargets};

use super::Session;
use crate::hand::Hands;
use crate::order::MoverKind;
use crate::state::{Level, MotionState};

/// The name of the motion that is the scene's own.
pub(super) const SCENE_MOTION: &str = "scene";

/// Targets per frame.
const SAMPLES: usize = 4;

/// A motion that the handles follow, or will as soon as they have come to rest.
#[derive(Clone)]
pub(super) struct Following {
    name: String,
    /// Where they go; not known yet while they brake.
    path: Option<Arc<HandlePath>>,
    frame: usize,
    /// Whether each handle was let go in the last frame, `[handles]`; empty before the first.
    free: Vec<bool>,
    /// How far each is from its path, since it took hold again `[m]`, `[handles]`; empty where none did.
    offsets: Vec<DVec3>,
}

impl Following {
    /// From `frame` of the motion on, along `path` if that is known.
    fn new(name: String, path: Option<Arc<HandlePath>>, frame: usize) -> Self {
        Self {
            name,
            path,
            frame,
            free: Vec::new(),
            offsets: Vec::new(),
        }
    }

    pub(super) fn state(&self) -> MotionState {
        let frames = self.path.as_ref().map(|path| path.frame_count());
        MotionState {
            name: self.name.clone(),
            frame: self.frame,
            frames: frames.unwrap_or(0),
        }
    }

    /// Where `path` has the handles `frames` after its start, `rate` in a second `[m]`, `[handles]`.
    fn places(&self, path: &HandlePath, frames: f64, rate: f64) -> Vec<DVec3> {
        let mut places = path.at(frames / rate);
        for (place, offset) in places.iter_mut().zip(&self.offsets) {
            *place += *offset;
        }
        places
    }

    /// The targets of the next frame along `path`.
    fn targets(&self, path: &HandlePath, rate: f64) -> Result<HandleTargets, HandleError> {
        let targets = path.targets(self.frame, SAMPLES)?;
        if self.offsets.is_empty() {
            return Ok(targets);
        }
        let at = |k: usize| self.frame as f64 + k as f64 / SAMPLES as f64;
        let samples = (1..=SAMPLES).flat_map(|k| self.places(path, at(k), rate));
        let shifted = HandleTargets::sampled(samples.collect(), targets.handle_count())?;
        shifted.releasing(let_go(&targets))
    }

    /// The rest of `path` goes on from where the hands are now, `places` `[m]`, `[handles]`.
    fn go_on_from(&mut self, places: &[DVec3], path: &HandlePath, rate: f64) {
        let led = self.places(path, self.frame as f64, rate);
        self.offsets.resize(led.len(), DVec3::ZERO);
        let moves = places.iter().zip(&led).map(|(place, led)| *place - *led);
        for (offset, change) in self.offsets.iter_mut().zip(moves) {
            *offset += change;
        }
    }
}

/// Whether each handle is let go, `[handles]`.
fn let_go(targets: &HandleTargets) -> Vec<bool> {
    let handles = 0..targets.handle_count();
    handles.map(|handle| !targets.holds(handle)).collect()
}

impl Session {
    /// Follows the motion of that name: the scene's own from where the scene starts, another from where the
    /// handles come to rest.
    pub(super) fn follow(&mut self, name: String) -> Result<(), String> {
        if name == SCENE_MOTION {
            self.end_recording("the scene's own motion starts from its beginning: ");
        }
        let stage = self.stage.as_mut().ok_or("there is no cloth yet")?;
        self.following = Some(if name == SCENE_MOTION {
            let path = Arc::new(stage.bench().scene_path()?);
            let mover = stage.mover();
            stage.restart(mover)?;
            self.hands = Hands::at(&stage.places(&stage.hold().handles));
            Following::new(name, Some(path), stage.bench().start_frame())
        } else {
            let motion = named::by_name(&name);
            let motion = motion.ok_or_else(|| format!("there is no motion {name:?}"))?;
            let rate = stage.bench().frame_rate();
            let trial = motion.bind(&self.hands.positions(), rate);
            trial.map_err(|error| error.to_string())?;
            self.unfollow();
            self.hands.brake(&self.limits);
            Following::new(name, None, 0)
        });
        self.tell_soon = true;
        Ok(())
    }

    /// The motion ends where it is; the handles brake.
    pub(super) fn unfollow(&mut self) {
        if let Some(following) = self.following.take() {
            if following.path.is_some() {
                if let Err(problem) = self.take_hold(&following.free) {
                    self.notify(Level::Bad, problem);
                }
                self.hands.brake(&self.limits);
            }
            self.tell_soon = true;
        }
    }

    /// Hands whose handles were let go, as `free` says, `[handles]`, take hold of the cloth where it is.
    fn take_hold(&mut self, free: &[bool]) -> Result<(), String> {
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        if !free.contains(&true) {
            return Ok(());
        }
        stage.take_hold_again(free)?;
        let places = stage.places(&stage.hold().handles);
        for (handle, (place, free)) in places.into_iter().zip(free).enumerate() {
            if *free {
                self.hands.put(handle, place);
            }
        }
        Ok(())
    }

    /// The cloth by one frame.
    pub(super) fn move_cloth(&mut self) {
        let Some(rate) = self.stage.as_ref().map(|s| s.bench().frame_rate()) else {
            return;
        };
        let hands_before = (self.hands.clone(), self.following.clone());
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
        if !stage.is_moving() {
            // Whoever takes over makes this frame.
            (self.hands, self.following) = hands_before;
        }
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
        let path = self.following.as_ref().and_then(|f| f.path.clone());
        if let Some(path) = path
            && let Some(mut following) = self.following.take()
        {
            if following.frame < path.frame_count() {
                let targets = self.lead(&mut following, &path, rate);
                self.following = Some(following);
                return targets;
            }
            let last = following.places(&path, following.frame as f64, rate);
            self.hands = Hands::at(&last);
            self.tell_soon = true;
            self.take_hold(&following.free)?;
        }
        self.hands.advance(&self.limits, 1.0 / rate);
        let positions: Vec<DVec3> = self.hands.positions();
        HandleTargets::at_frame_end(positions).map_err(|error| error.to_string())
    }

    /// Leads the hands along `path` by one frame.
    fn lead(
        &mut self,
        following: &mut Following,
        path: &HandlePath,
        rate: f64,
    ) -> Result<HandleTargets, String> {
        let text = |error: HandleError| error.to_string();
        let mut targets = following.targets(path, rate).map_err(text)?;
        let before = std::mem::replace(&mut following.free, let_go(&targets));
        let now = before.iter().zip(&following.free);
        let taken: Vec<bool> = now.map(|(before, now)| *before && !now).collect();
        if taken.contains(&true) {
            self.take_hold(&taken)?;
            following.go_on_from(&self.hands.positions(), path, rate);
            targets = following.targets(path, rate).map_err(text)?;
        }
        following.frame += 1;
        self.hands = self.hands.led_to(targets.end(), 1.0 / rate);
        Ok(targets)
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
            let path = path.map_err(|error| error.to_string())?;
            following.path = Some(Arc::new(path));
        }
        Ok(())
    }
}
