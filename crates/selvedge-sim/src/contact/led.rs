//! Obstacles that are led by hand: each may be shifted from its own path, straight within a frame.

use glam::DVec3;
use selvedge_cloth::{Obstacle, Rigid};
use selvedge_contact::{Candidates, CollisionMesh, Reach, Ways, gap};

use super::Contact;

/// Gap beyond which two features are far from each other `[m]`.
pub const FAR: f64 = 0.02;

/// A frame made elsewhere, held to contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Led {
    /// Nothing meets on the way: the frame stays as it was, bit for bit.
    Free,
    /// Vertices were pushed apart.
    Pushed,
}

/// Rigid motion of an obstacle away from its own path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shift {
    /// At the last frame.
    pub(crate) now: Rigid,
    /// At the next.
    pub(crate) next: Rigid,
}

impl Shift {
    /// That of an obstacle that stays there.
    pub(crate) fn at(place: Rigid) -> Self {
        Self {
            now: place,
            next: place,
        }
    }
}

impl Contact {
    /// Takes the frame as done: obstacles are where they were led to.
    pub(crate) fn arrive(&mut self) {
        for shift in &mut self.bodies.shifts {
            *shift = Shift::at(shift.next);
        }
    }

    /// Points of the meshes of all obstacles at frame `frame`, at `rate` frames per second `[m]`.
    pub(crate) fn mesh_points(&self, frame: usize, rate: f64) -> Vec<DVec3> {
        self.shifted(|obstacle| obstacle.positions_at(frame as f64 / rate))
    }

    /// The same of what the cloth touches.
    pub(super) fn body_points(&self, frame: usize, rate: f64) -> Vec<DVec3> {
        self.shifted(|obstacle| CollisionMesh::places_of(obstacle, frame as f64 / rate))
    }

    fn shifted<'a, P: Iterator<Item = DVec3> + 'a>(
        &'a self,
        places: impl Fn(&'a Obstacle) -> P,
    ) -> Vec<DVec3> {
        let bodies = self.bodies.obstacles.iter().zip(&self.bodies.shifts);
        let shifted =
            bodies.flat_map(|(obstacle, shift)| places(obstacle).map(|p| shift.now.of(p)));
        shifted.collect()
    }

    /// Smallest gap of each vertex of the cloth at `positions` to what it does not share a vertex
    /// with, at frame `frame` `[m]`, `[vertices]`; `far` where nothing is nearer. A gap of an edge
    /// or a face counts for all its vertices.
    pub(crate) fn vertex_gaps(
        &self,
        positions: &[DVec3],
        frame: usize,
        rate: f64,
        far: f64,
    ) -> Vec<f64> {
        let mut points = positions.to_vec();
        points.extend(self.body_points(frame, rate));
        let reach = Reach {
            gap: far,
            slack: 0.0,
            own_slack: 0.0,
        };
        let mut candidates = Candidates::new(&self.mesh, &points, self.settings.self_contact);
        candidates.find(&self.mesh, Ways::still(&points), reach);
        let mut gaps = vec![far; positions.len()];
        for pair in candidates.pairs() {
            if self.other_body(pair) == 0 && self.neighbours.leave_out(pair, 2.0 * far) {
                continue;
            }
            let distance =
                gap(pair.kind, pair.places(&points)).distance - self.mesh.radius_of(pair);
            for corner in pair.corners {
                if let Some(least) = gaps.get_mut(corner as usize) {
                    *least = least.min(distance);
                }
            }
        }
        gaps
    }
}
