//! The domain of a model: the cloths, hands, air and fabrics that it was trained on, as bounds of
//! numbers; and the ways in which a scene goes beyond them.
//!
//! A scene has a domain, too, its own numbers. Compared with that of a model it says before the
//! first frame what the model cannot know, exactly and for the price of one look at the hands.

use glam::DVec3;
use selvedge_cloth::{Cloth, Environment, Material, Scene, SceneError};
use serde::{Deserialize, Serialize};

mod departure;

pub use departure::{Aspect, Departure};

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
    /// Largest change of a handle's velocity from frame to frame `[m/s²]`; none in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handle_acceleration: Option<f64>,
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
    /// The domain of `frames` frames of a scene's motion, with a call for the domain of every frame
    /// alone, the one after the start first.
    ///
    /// # Errors
    /// A motion that cannot drive the handles.
    pub fn by_frame(
        scene: &Scene,
        frames: usize,
        mut each: impl FnMut(&Self),
    ) -> Result<Self, SceneError> {
        let path = scene.handle_path()?;
        let handles = scene.handles.len();
        let (mesh, pattern) = (&scene.mesh, scene.mesh.pattern());
        let (vertices, edges) = (mesh.topology().vertex_count(), pattern.edge_lengths());
        let (materials, contact) = (scene.materials().0, scene.contact.is_some());
        let watch = DomainWatch::new(scene.environment.gravity, scene.frame_rate);
        let pattern = (&edges[..], pattern.is_sewn());
        let mut watch = watch.of_cloth(vertices, pattern, materials, contact);
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
    /// vertices and which handles hold, one frame after another.
    pub fn of_frames<'a>(
        cloth: &Cloth,
        materials: &[Material],
        environment: &Environment,
        frame_rate: f64,
        frames: impl Iterator<Item = (&'a [glam::Vec3], Vec<bool>)>,
    ) -> Self {
        let watch = DomainWatch::new(environment.gravity, frame_rate);
        let pattern = cloth.pattern();
        let (vertices, edges) = (cloth.vertex_count(), pattern.edge_lengths());
        let mut watch = watch.of_cloth(vertices, (&edges, pattern.is_sewn()), materials, false);
        let handles = cloth.handles();
        for (frame, (positions, held)) in frames.enumerate() {
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

    /// Widens the domain of all motions so far, if there were any, by that of another one.
    pub fn widen(all: &mut Option<Self>, by: Self) {
        match all {
            Some(all) => all.include(&by),
            none => *none = Some(by),
        }
    }

    /// Widens the bounds by those of `other`.
    fn include(&mut self, other: &Self) {
        self.frame_rate = self.frame_rate.and(other.frame_rate);
        self.vertices = self.vertices.and(other.vertices);
        self.edge_length = self.edge_length.and(other.edge_length);
        self.sewn |= other.sewn;
        self.handles = self.handles.and(other.handles);
        self.height_difference = self.height_difference.max(other.height_difference);
        self.moved_apart = self.moved_apart.max(other.moved_apart);
        self.handle_speed = self.handle_speed.max(other.handle_speed);
        self.handle_acceleration = [self.handle_acceleration, other.handle_acceleration]
            .into_iter()
            .flatten()
            .reduce(f64::max);
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

/// A motion that is watched: its hands and its wind, in a cloth that does not change.
#[derive(Clone, Debug)]
pub struct DomainWatch {
    seen: Domain,
    /// The present frame alone.
    now: Domain,
    /// Against gravity; zero without any.
    up: DVec3,
    /// Handles in the frame before, and which of them held.
    before: Vec<(DVec3, bool)>,
    /// Their velocities there `[m/s]`; none of those that have not held for two frames.
    velocities: Vec<Option<DVec3>>,
    /// Handles when the present set of them took hold.
    together: Vec<(DVec3, bool)>,
}

impl DomainWatch {
    /// Nothing seen yet, under `gravity` `[m/s²]`, at so many frames per second.
    pub fn new(gravity: DVec3, frame_rate: f64) -> Self {
        let none = Bounds {
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        let nothing = Domain {
            frame_rate: Bounds::of(frame_rate),
            vertices: Bounds::of(0.0),
            edge_length: Bounds::of(0.0),
            sewn: false,
            handles: none,
            height_difference: 0.0,
            moved_apart: 0.0,
            handle_speed: 0.0,
            handle_acceleration: Some(0.0),
            wind: 0.0,
            gravity: Bounds::of(gravity.length()),
            fabrics: None,
            contact: false,
        };
        Self {
            now: nothing.clone(),
            seen: nothing,
            up: -gravity.normalize_or_zero(),
            before: Vec::new(),
            velocities: Vec::new(),
            together: Vec::new(),
        }
    }

    /// The same of a cloth with so many vertices, the lengths of the edges in its pattern `[m]`,
    /// whether that is sewn, its fabrics, and contact with itself or bodies if there is any.
    fn of_cloth<'a>(
        mut self,
        vertices: usize,
        (edge_lengths, sewn): (&[f64], bool),
        materials: impl IntoIterator<Item = &'a Material>,
        contact: bool,
    ) -> Self {
        let mean = edge_lengths.iter().sum::<f64>() / edge_lengths.len().max(1) as f64;
        let fabrics = materials.into_iter().map(FabricBounds::of);
        let fabrics = fabrics.reduce(|mut known, fabric| {
            known.include(&fabric);
            known
        });
        for domain in [&mut self.seen, &mut self.now] {
            domain.vertices = Bounds::of(vertices as f64);
            domain.edge_length = Bounds::of(mean);
            domain.sewn = sewn;
            domain.fabrics.clone_from(&fabrics);
            domain.contact = contact;
        }
        self
    }

    /// Sees a frame: where the handles are `[m]`, which of them hold, and the wind `[m/s]`.
    ///
    /// A handle that takes hold may jump; its speed counts from the next frame on.
    pub fn see(&mut self, places: &[DVec3], held: &[bool], wind: DVec3) {
        let frame: Vec<(DVec3, bool)> = places.iter().copied().zip(held.iter().copied()).collect();
        let rate = self.now.frame_rate.most;
        let same_hold = |old: &[(DVec3, bool)]| {
            old.len() == frame.len() && old.iter().zip(&frame).all(|(a, b)| a.1 == b.1)
        };
        if !same_hold(&self.together) {
            self.together.clone_from(&frame);
        }
        let holding = frame.iter().filter(|(_, held)| *held);
        let heights = holding.clone().map(|(place, _)| place.dot(self.up));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        let pairs = self.before.iter().zip(&frame);
        let velocities: Vec<Option<DVec3>> = pairs
            .map(|(a, b)| (a.1 && b.1).then(|| (b.0 - a.0) * rate))
            .collect();
        let speeds = velocities.iter().flatten().map(|v| v.length());
        let changes = self.velocities.iter().zip(&velocities);
        let accelerations =
            changes.filter_map(|(a, b)| Some((*b.as_ref()? - (*a)?).length() * rate));
        self.now.handles = Bounds::of(holding.count() as f64);
        self.now.height_difference = (high - low).max(0.0);
        self.now.moved_apart = moved_apart(&self.together, &frame);
        self.now.handle_speed = speeds.fold(0.0, f64::max);
        self.now.handle_acceleration = Some(accelerations.fold(0.0, f64::max));
        self.now.wind = wind.length();
        self.before = frame;
        self.velocities = velocities;
        self.seen.include(&self.now);
    }

    /// The present frame alone.
    pub fn now(&self) -> &Domain {
        &self.now
    }

    /// All frames so far.
    pub fn seen(self) -> Domain {
        self.seen
    }
}

/// Largest change of a distance `[m]` to the first, the middle and the last of the handles that
/// hold: all there are of up to three, and enough to know that many did not move as one body.
fn moved_apart(then: &[(DVec3, bool)], now: &[(DVec3, bool)]) -> f64 {
    let both = || {
        let pairs = then.iter().zip(now).filter(|(_, now)| now.1);
        pairs.map(|(then, now)| [then.0, now.0])
    };
    let Some(last) = both().count().checked_sub(1) else {
        return 0.0;
    };
    let from = [0, last / 2, last].into_iter();
    let changes = from
        .filter_map(|from| both().nth(from))
        .flat_map(|[then, now]| {
            both().map(move |other| (other[1].distance(now) - other[0].distance(then)).abs())
        });
    changes.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
