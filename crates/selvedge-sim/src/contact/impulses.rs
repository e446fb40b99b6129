//! Momentum that obstacles receive from the cloth. Obstacles do not answer to it: who leads them
//! may.

use glam::DVec3;
use selvedge_cloth::Impulse;
use selvedge_contact::CollisionMesh;

use super::collisions::Collisions;

/// Momentum that obstacles have received over the frame under way.
#[derive(Clone, Debug, Default)]
pub(crate) struct ObstacleImpulses {
    /// `[obstacles]`
    pub(super) all: Vec<Impulse>,
    /// What they have of the change of velocity that the next substep looks back to, `[obstacles]`; empty
    /// after a saved state, which has none.
    pub(crate) carried: Vec<Impulse>,
    /// Forces of the last solve and their moments, `[obstacles]`.
    forces: Vec<Impulse>,
    /// False before the first frame after a saved state.
    pub(crate) are_known: bool,
    /// The same before the last solve.
    before: Vec<Impulse>,
    /// Mass by way that pushes of a projection moved since the last solve `[kg m]`, and its moment,
    /// `[obstacles]`.
    pushed: Vec<Impulse>,
}

impl ObstacleImpulses {
    /// Nothing yet, of so many obstacles.
    pub(super) fn none(obstacles: usize) -> Self {
        Self {
            all: vec![Impulse::ZERO; obstacles],
            carried: vec![Impulse::ZERO; obstacles],
            forces: vec![Impulse::ZERO; obstacles],
            are_known: false,
            before: vec![Impulse::ZERO; obstacles],
            pushed: vec![Impulse::ZERO; obstacles],
        }
    }

    /// Adds what the forces gave in a solve, whose equations hold with points at `place` `[m]`: the cloth
    /// got it. `impulse` is that of a force, and of what the solve looked back to if it is known, with what
    /// the next one looks back to.
    pub(super) fn add_forces(
        &mut self,
        surface: &CollisionMesh,
        place: impl Fn(usize) -> DVec3,
        impulse: impl Fn(DVec3, Option<DVec3>) -> [DVec3; 2],
        collisions: &Collisions,
    ) {
        self.pushed.fill(Impulse::ZERO);
        self.forces.fill(Impulse::ZERO);
        self.before.clone_from(&self.all);
        for collision in &collisions.list {
            let first = surface.body_of(collision.corners[0]);
            let body = first.max(surface.body_of(collision.corners[3]));
            if let Some(own) = body.checked_sub(1) {
                let whole: f64 = collision.weights.iter().sum();
                let displacement = collision.displacement(&place);
                let force = -collision.force_at(displacement);
                let arm = displacement - collision.drift + collision.base;
                self.forces[own] += Impulse {
                    linear: force * whole,
                    angular: arm.cross(force),
                };
            }
        }
        let is_known = !self.carried.is_empty();
        self.carried.resize(self.all.len(), Impulse::ZERO);
        let all = self.all.iter_mut().zip(&mut self.carried);
        for ((all, carried), force) in all.zip(&self.forces) {
            let given = |force, carried| impulse(force, is_known.then_some(carried));
            let [linear, next_linear] = given(force.linear, carried.linear);
            let [angular, next_angular] = given(force.angular, carried.angular);
            *all += Impulse { linear, angular };
            *carried = Impulse {
                linear: next_linear,
                angular: next_angular,
            };
        }
    }

    /// Takes back what the last solve added.
    pub(super) fn take_back(&mut self) {
        self.all.clone_from(&self.before);
    }

    /// Leaves this `part` of what the last solve added.
    pub(super) fn cut_back(&mut self, part: f64) {
        for (all, before) in self.all.iter_mut().zip(&self.before) {
            *all = Impulse {
                linear: before.linear.lerp(all.linear, part),
                angular: before.angular.lerp(all.angular, part),
            };
        }
    }

    /// Notes that a push against this body, 0 for the cloth, moved a `mass` `[kg]` by `shift` to
    /// `place` `[m]`.
    pub(super) fn note_push(&mut self, body: usize, mass: f64, shift: DVec3, place: DVec3) {
        if let Some(own) = body.checked_sub(1) {
            self.pushed[own] += Impulse::at(place, shift * -mass);
        }
    }

    /// Adds the pushes after a solve over `left` `[s]`.
    pub(super) fn add_pushes(&mut self, left: f64) {
        for (all, pushed) in self.all.iter_mut().zip(&self.pushed) {
            *all += Impulse {
                linear: pushed.linear / left,
                angular: pushed.angular / left,
            };
        }
    }
}
