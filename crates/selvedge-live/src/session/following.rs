//! A motion that the handles follow: their targets along its path, from where they took hold.

use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::{HandleError, HandlePath, HandleTargets};

use crate::state::MotionState;

/// Targets per frame.
const SAMPLES: usize = 4;

/// A motion that the handles follow, or will as soon as they have come to rest.
#[derive(Clone)]
pub(super) struct Following {
    pub(super) name: String,
    /// The path of the handles; unknown while they brake.
    pub(super) path: Option<Arc<HandlePath>>,
    pub(super) frame: usize,
    /// The handles that were let go in the last frame, `[handles]`; empty before the first.
    pub(super) free: Vec<bool>,
    /// The distance of each handle from its path since it took hold again `[m]`, `[handles]`; empty
    /// where none did.
    offsets: Vec<DVec3>,
}

impl Following {
    /// The motion `name` from `frame` on, along `path` if that is known.
    pub(super) fn new(name: String, path: Option<Arc<HandlePath>>, frame: usize) -> Self {
        Self {
            name,
            path,
            frame,
            free: Vec::new(),
            offsets: Vec::new(),
        }
    }

    /// The description that pages get.
    pub(super) fn state(&self) -> MotionState {
        let frames = self.path.as_ref().map(|path| path.frame_count());
        MotionState {
            name: self.name.clone(),
            frame: self.frame,
            frames: frames.unwrap_or(0),
        }
    }

    /// Places of the handles along `path`, `frames` after its start at `rate` frames per second
    /// `[m]`, `[handles]`.
    pub(super) fn places(&self, path: &HandlePath, frames: f64, rate: f64) -> Vec<DVec3> {
        let mut places = path.at(frames / rate);
        for (place, offset) in places.iter_mut().zip(&self.offsets) {
            *place += *offset;
        }
        places
    }

    /// The targets of the next frame along `path`.
    pub(super) fn targets(
        &self,
        path: &HandlePath,
        rate: f64,
    ) -> Result<HandleTargets, HandleError> {
        let targets = path.targets(self.frame, SAMPLES)?;
        if self.offsets.is_empty() {
            return Ok(targets);
        }
        let at = |k: usize| self.frame as f64 + k as f64 / SAMPLES as f64;
        let samples = (1..=SAMPLES).flat_map(|k| self.places(path, at(k), rate));
        let shifted = HandleTargets::sampled(samples.collect(), targets.handle_count())?;
        shifted.releasing(let_go(&targets))
    }

    /// Moves the rest of `path` so that it starts at `places` `[m]`, `[handles]`.
    pub(super) fn go_on_from(&mut self, places: &[DVec3], path: &HandlePath, rate: f64) {
        let led = self.places(path, self.frame as f64, rate);
        self.offsets.resize(led.len(), DVec3::ZERO);
        let moves = places.iter().zip(&led).map(|(place, led)| *place - *led);
        for (offset, change) in self.offsets.iter_mut().zip(moves) {
            *offset += change;
        }
    }
}

/// Marks the handles that `targets` let go, `[handles]`.
pub(super) fn let_go(targets: &HandleTargets) -> Vec<bool> {
    let handles = 0..targets.handle_count();
    handles.map(|handle| !targets.holds(handle)).collect()
}
