//! Momentum that obstacles receive from the cloth. Obstacles do not answer to it: who leads them
//! may.

use glam::DVec3;
use selvedge_contact::CollisionMesh;

use super::collisions::Collisions;

/// Momentum that obstacles have received over the frame under way.
#[derive(Clone, Debug, Default)]
pub(crate) struct ObstacleImpulses {
    /// `[N s]`, `[obstacles]`.
    pub(super) all: Vec<DVec3>,
    /// False before the first frame after a saved state.
    pub(crate) are_known: bool,
    /// The same before the last solve.
    before: Vec<DVec3>,
    /// Mass by way that pushes of a projection moved since the last solve `[kg m]`, `[obstacles]`.
    pushed: Vec<DVec3>,
}

impl ObstacleImpulses {
    /// Nothing yet, of so many obstacles.
    pub(super) fn none(obstacles: usize) -> Self {
        Self {
            all: vec![DVec3::ZERO; obstacles],
            are_known: false,
            before: vec![DVec3::ZERO; obstacles],
            pushed: vec![DVec3::ZERO; obstacles],
        }
    }

    /// Adds the forces at the end of a solve, where points are at `end` `[m]`, over all of its
    /// `left` `[s]`.
    pub(super) fn add_forces(
        &mut self,
        surface: &CollisionMesh,
        end: &[DVec3],
        left: f64,
        collisions: &Collisions,
    ) {
        self.pushed.fill(DVec3::ZERO);
        self.before.clone_from(&self.all);
        for collision in &collisions.list {
            let first = surface.body_of(collision.corners[0]);
            let body = first.max(surface.body_of(collision.corners[3]));
            if let Some(own) = body.checked_sub(1) {
                let whole: f64 = collision.weights.iter().sum();
                let force = collision.force_at(collision.displacement(|v| end[v]));
                self.all[own] -= force * (whole * left);
            }
        }
    }

    /// Takes back what the last solve added.
    pub(super) fn take_back(&mut self) {
        self.all.clone_from(&self.before);
    }

    /// Leaves this `part` of what the last solve added.
    pub(super) fn cut_back(&mut self, part: f64) {
        for (all, before) in self.all.iter_mut().zip(&self.before) {
            *all = before.lerp(*all, part);
        }
    }

    /// Notes that a push against this body, 0 for the cloth, moved a `mass` `[kg]` by `shift`
    /// `[m]`.
    pub(super) fn note_push(&mut self, body: usize, mass: f64, shift: DVec3) {
        if let Some(own) = body.checked_sub(1) {
            self.pushed[own] -= shift * mass;
        }
    }

    /// Adds the pushes after a solve over `left` `[s]`.
    pub(super) fn add_pushes(&mut self, left: f64) {
        for (all, pushed) in self.all.iter_mut().zip(&self.pushed) {
            *all += *pushed / left;
        }
    }
}
