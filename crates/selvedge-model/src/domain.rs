//! The domain of a model: the cloths, hands, air and fabrics that it was trained on, as bounds of
//! numbers; and the ways in which a scene goes beyond them.
//!
//! A scene has a domain, too, its own numbers. Compared with that of a model it says before the
//! first frame what the model cannot know, exactly and for the price of one look at the hands.

use glam::DVec3;
use selvedge_cloth::{Cloth, Environment, Handles, Material, MotionError, Scene};
use serde::{Deserialize, Serialize};

mod departure;
mod watch;

pub use departure::{Aspect, Departure};
pub use watch::DomainWatch;

/// The domain's key in a model's account of its training.
const ACCOUNT_KEY: &str = "domain";

/// Names of fabrics that a domain lists at most.
const MOST_NAMES: usize = 8;

/// Bounds of a number, both within.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Bounds {
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

/// The cloths, hands, air and fabrics of one or many motions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Frames per second.
    pub frame_rate: Bounds,
    /// Vertices of a cloth.
    pub vertices: Bounds,
    /// Mean length of a cloth's edges in its pattern `[m]`.
    pub edge_length: Bounds,
    /// Some cloth is sewn of panels.
    pub sewn: bool,
    /// Handles that hold at once.
    pub handles: Bounds,
    /// Largest difference in height of two handles that hold `[m]`.
    pub height_difference: f64,
    /// Largest change of the distance between two handles that hold `[m]`.
    pub moved_apart: f64,
    /// Largest speed of a handle `[m/s]`.
    pub handle_speed: f64,
    /// Largest speed of the wind `[m/s]`.
    pub wind: f64,
    /// Gravity `[m/s²]`.
    pub gravity: Bounds,
    /// The fabrics; none where nothing is known of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fabrics: Option<FabricBounds>,
    /// Some cloth touches itself or a body.
    pub contact: bool,
}

/// Bounds of what fabrics are like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FabricBounds {
    /// Names of the first few.
    pub names: Vec<String>,
    /// Mass per area `[kg/m²]`.
    pub density: Bounds,
    /// Mean stiffness against stretching `[N/m]`.
    pub stretch: Bounds,
    /// Mean stiffness against bending `[N m]`.
    pub bend: Bounds,
}

impl From<[f64; 2]> for Bounds {
    fn from(both: [f64; 2]) -> Self {
        Self {
            least: both[0],
            most: both[1],
        }
    }
}

impl From<Bounds> for [f64; 2] {
    fn from(bounds: Bounds) -> Self {
        [bounds.least, bounds.most]
    }
}

impl Bounds {
    /// One number.
    pub fn of(value: f64) -> Self {
        Self {
            least: value,
            most: value,
        }
    }

    /// Bounds of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            most: self.most.max(other.most),
        }
    }
}

impl FabricBounds {
    /// One fabric: stiffnesses are means of its tables `[eq:mean-stiffness]`, stretching along and
    /// across the threads with the law's factor 2.
    pub fn of(material: &Material) -> Self {
        let rows = material.stretch.0.iter();
        let along_and_across = rows.flat_map(|row| [row[0], row[2]]);
        let count = 2.0 * material.stretch.0.len() as f64;
        let bend = material.bend.0.as_flattened();
        Self {
            names: vec![material.name.clone()],
            density: Bounds::of(material.density),
            stretch: Bounds::of(2.0 * along_and_across.sum::<f64>() / count),
            bend: Bounds::of(bend.iter().sum::<f64>() / bend.len() as f64),
        }
    }

    fn include(&mut self, other: &Self) {
        for name in &other.names {
            if self.names.len() < MOST_NAMES && !self.names.contains(name) {
                self.names.push(name.clone());
            }
        }
        self.density = self.density.and(other.density);
        self.stretch = self.stretch.and(other.stretch);
        self.bend = self.bend.and(other.bend);
    }
}

impl Domain {
    /// The domain of `frames` frames of a scene's motion.
    ///
    /// # Errors
    /// A motion that cannot drive the handles.
    pub fn of_scene(scene: &Scene, frames: usize) -> Result<Self, MotionError> {
        Self::by_frame(scene, frames, |_| {})
    }

    /// As [`Self::of_scene`], with a call for the domain of every frame alone, the one after the
    /// start first.
    ///
    /// # Errors
    /// A motion that cannot drive the handles.
    pub fn by_frame(
        scene: &Scene,
        frames: usize,
        mut each: impl FnMut(&Self),
    ) -> Result<Self, MotionError> {
        let path = scene.handle_path()?;
        let handles = scene.handles.len();
        let mut watch = DomainWatch::of_scene(scene);
        let mut start = path.at(0.0);
        let mut held: Vec<bool> = vec![true; handles];
        for frame in 0..frames {
            let Ok(targets) = path.targets(frame, 1) else {
                break;
            };
            held.clear();
            held.extend((0..handles).map(|handle| targets.holds(handle)));
            if frame == 0 {
                watch.see(&std::mem::take(&mut start), &held, DVec3::ZERO);
            }
            let environment = scene.environment.during_step(frame, scene.frame_rate);
            watch.see(targets.end(), &held, environment.wind);
            each(watch.now());
        }
        Ok(watch.seen())
    }

    /// The domain of frames of `cloth`, as a data set has them: `frames` gives the positions of all
    /// vertices, one frame after another. Nothing is known there of handles that let go.
    pub fn of_frames<'a>(
        cloth: &Cloth,
        materials: &[Material],
        environment: &Environment,
        frame_rate: f64,
        frames: impl Iterator<Item = &'a [glam::Vec3]>,
    ) -> Self {
        let edges = cloth.pattern().edge_lengths();
        let mut watch = DomainWatch::new(environment.gravity, frame_rate).with_mesh(
            cloth.vertex_count(),
            &edges,
            cloth.pattern().is_sewn(),
        );
        for material in materials {
            watch = watch.with_fabric(material);
        }
        let handles: &Handles = cloth.handles();
        let held = vec![true; handles.len()];
        for (frame, positions) in frames.enumerate() {
            let places: Vec<DVec3> = handles.of(positions).map(|p| p.as_dvec3()).collect();
            let wind = environment.during_step(frame, frame_rate).wind;
            watch.see(&places, &held, wind);
        }
        watch.seen()
    }

    /// The domain in a model's account of its training; none in an account without one.
    pub(crate) fn in_account(training: &str) -> Result<Option<Self>, serde_json::Error> {
        let Ok(mut account) = serde_json::from_str::<serde_json::Value>(training) else {
            return Ok(None);
        };
        match account.get_mut(ACCOUNT_KEY) {
            Some(domain) => serde_json::from_value(domain.take()).map(Some),
            None => Ok(None),
        }
    }

    /// The account `training` with this domain in it.
    pub(crate) fn write_into(&self, training: &str) -> String {
        let account = serde_json::from_str::<serde_json::Value>(training);
        let mut account = match account {
            Ok(account) if account.is_object() => account,
            _ => serde_json::json!({ "note": training }),
        };
        account[ACCOUNT_KEY] = serde_json::json!(self);
        account.to_string()
    }

    /// Widens the domain of all motions so far, if there were any, by that of another one.
    pub fn widen(all: &mut Option<Self>, by: Self) {
        match all {
            Some(all) => all.include(&by),
            none => *none = Some(by),
        }
    }

    /// Widens the bounds by those of `other`.
    pub fn include(&mut self, other: &Self) {
        self.frame_rate = self.frame_rate.and(other.frame_rate);
        self.vertices = self.vertices.and(other.vertices);
        self.edge_length = self.edge_length.and(other.edge_length);
        self.sewn |= other.sewn;
        self.handles = self.handles.and(other.handles);
        self.height_difference = self.height_difference.max(other.height_difference);
        self.moved_apart = self.moved_apart.max(other.moved_apart);
        self.handle_speed = self.handle_speed.max(other.handle_speed);
        self.wind = self.wind.max(other.wind);
        self.gravity = self.gravity.and(other.gravity);
        self.contact |= other.contact;
        match (&mut self.fabrics, &other.fabrics) {
            (Some(own), Some(others)) => own.include(others),
            (own @ None, Some(others)) => *own = Some(others.clone()),
            (_, None) => {}
        }
    }
}

#[cfg(test)]
mod tests;
