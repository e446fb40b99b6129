//! Positions and velocities of a cloth, which the simulator moves.

use glam::DVec3;
use selvedge_cloth::VertexId;

use crate::solver::SolveError;

/// Positions `[m]` and velocities `[m/s]`, `[vertices]` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Positions `[m]`.
    pub(crate) positions: Vec<DVec3>,
    /// Velocities `[m/s]`.
    pub(crate) velocities: Vec<DVec3>,
}

impl State {
    /// A state of this number of vertices, all at the origin and at rest.
    pub(crate) fn at_origin(vertices: usize) -> Self {
        Self::at_rest(vec![DVec3::ZERO; vertices])
    }

    /// A state at rest at `positions` `[m]`, `[vertices]`.
    pub(crate) fn at_rest(positions: Vec<DVec3>) -> Self {
        Self {
            velocities: vec![DVec3::ZERO; positions.len()],
            positions,
        }
    }

    pub(crate) fn both(&self) -> [&[DVec3]; 2] {
        [&self.positions, &self.velocities]
    }

    pub(crate) fn both_mut(&mut self) -> [&mut [DVec3]; 2] {
        [&mut self.positions, &mut self.velocities]
    }

    /// Sets this to `now` + `weight` (`now` - `before`), all of the same size.
    pub(crate) fn extrapolate(&mut self, now: &Self, before: &Self, weight: f64) {
        let states = self.both_mut().into_iter().zip(now.both());
        for ((into, now), before) in states.zip(before.both()) {
            for ((into, now), before) in into.iter_mut().zip(now).zip(before) {
                *into = *now + (*now - *before) * weight;
            }
        }
    }

    /// Goes back to this `part` of the way from `before`, at the part of the change of velocity.
    pub(crate) fn cut_back(&mut self, before: &Self, part: f64) {
        for (ends, starts) in self.both_mut().into_iter().zip(before.both()) {
            for (end, start) in ends.iter_mut().zip(starts) {
                *end = start.lerp(*end, part);
            }
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.velocities.copy_from_slice(&other.velocities);
    }

    /// Checks that every number is finite.
    ///
    /// # Errors
    /// Names the first vertex that moves no longer.
    pub(crate) fn check_finite(&self) -> Result<(), SolveError> {
        let mut moved = self.positions.iter().zip(&self.velocities);
        match moved.position(|(x, v)| !(x.is_finite() && v.is_finite())) {
            Some(vertex) => Err(SolveError::NonFinite {
                vertex: VertexId(vertex as u32),
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_the_way_has_its_part_of_the_change_of_velocity() {
        // A fall of a substep, of which an eighth was safe: with the whole change it would fall eight
        // times as fast.
        let state = |position: DVec3, velocity: DVec3| State {
            positions: vec![position],
            velocities: vec![velocity],
        };
        let before = state(DVec3::ZERO, DVec3::X);
        let mut end = state(DVec3::new(0.8, -0.08, 0.0), DVec3::new(1.0, -0.8, 0.0));
        end.cut_back(&before, 0.125);
        let expected = state(DVec3::new(0.1, -0.01, 0.0), DVec3::new(1.0, -0.1, 0.0));
        assert!(end.positions[0].distance(expected.positions[0]) < 1e-15);
        assert!(end.velocities[0].distance(expected.velocities[0]) < 1e-15);
    }
}
