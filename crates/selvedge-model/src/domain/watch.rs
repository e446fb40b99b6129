//! The domain of a motion, gathered frame by frame.

use glam::DVec3;
use selvedge_cloth::{Material, Scene};

use super::{Bounds, Domain, FabricBounds};

/// A motion that is watched: its hands and its wind, in a cloth that does not change.
#[derive(Clone, Debug)]
pub struct DomainWatch {
    seen: Domain,
    /// The present frame alone.
    now: Domain,
    /// Against gravity; zero without any.
    up: DVec3,
    /// Handles in this frame, and which of them hold.
    frame: Vec<(DVec3, bool)>,
    /// The same in the frame before.
    before: Vec<(DVec3, bool)>,
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
            wind: 0.0,
            gravity: Bounds::of(gravity.length()),
            fabrics: None,
            contact: false,
        };
        Self {
            now: nothing.clone(),
            seen: nothing,
            up: -gravity.normalize_or_zero(),
            frame: Vec::new(),
            before: Vec::new(),
            together: Vec::new(),
        }
    }

    /// Nothing seen yet, of the cloth of a scene.
    pub fn of_scene(scene: &Scene) -> Self {
        let pattern = scene.mesh.pattern();
        let watch = Self::new(scene.environment.gravity, scene.frame_rate)
            .with_mesh(
                scene.mesh.topology().vertex_count(),
                &pattern.edge_lengths(),
                pattern.is_sewn(),
            )
            .with_contact(scene.contact.is_some());
        let (materials, _) = scene.materials();
        materials.into_iter().fold(watch, Self::with_fabric)
    }

    /// The mesh of the cloth: its vertices, the lengths of its edges in the pattern `[m]`, and
    /// whether it is sewn.
    #[must_use]
    pub fn with_mesh(mut self, vertices: usize, edge_lengths: &[f64], sewn: bool) -> Self {
        let mean = edge_lengths.iter().sum::<f64>() / edge_lengths.len().max(1) as f64;
        for domain in [&mut self.seen, &mut self.now] {
            domain.vertices = Bounds::of(vertices as f64);
            domain.edge_length = Bounds::of(mean);
            domain.sewn = sewn;
        }
        self
    }

    /// A fabric of the cloth.
    #[must_use]
    pub fn with_fabric(mut self, material: &Material) -> Self {
        let fabric = FabricBounds::of(material);
        for domain in [&mut self.seen, &mut self.now] {
            match &mut domain.fabrics {
                Some(known) => known.include(&fabric),
                none => *none = Some(fabric.clone()),
            }
        }
        self
    }

    /// Contact of the cloth with itself or bodies, if there is any.
    #[must_use]
    pub fn with_contact(mut self, contact: bool) -> Self {
        self.seen.contact = contact;
        self.now.contact = contact;
        self
    }

    /// Sees a frame: where the handles are `[m]`, which of them hold, and the wind `[m/s]`.
    ///
    /// A handle that takes hold may jump; its speed counts from the next frame on.
    pub fn see(&mut self, places: &[DVec3], held: &[bool], wind: DVec3) {
        let mut frame = std::mem::take(&mut self.frame);
        frame.clear();
        frame.extend(places.iter().copied().zip(held.iter().copied()));
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
        let speeds = self.before.iter().zip(&frame).filter(|(a, b)| a.1 && b.1);
        let speed = speeds
            .map(|(before, now)| now.0.distance(before.0) * rate)
            .fold(0.0, f64::max);
        self.now.handles = Bounds::of(holding.count() as f64);
        self.now.height_difference = (high - low).max(0.0);
        self.now.moved_apart = moved_apart(&self.together, &frame);
        self.now.handle_speed = speed;
        self.now.wind = wind.length();
        self.frame = std::mem::replace(&mut self.before, frame);
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
