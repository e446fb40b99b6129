//! Obstacles that are led by hand: each may be shifted from its own path, straight within a frame.

use std::ops::Range;

use glam::{DQuat, DVec3};
use selvedge_cloth::{Obstacle, ObstaclePath};
use selvedge_contact::{Body, Candidates, Frame, Passage, Reach, Ways, gap};

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

/// Distance of an obstacle from its own path `[m]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shift {
    /// At the last frame.
    pub(crate) now: DVec3,
    /// At the next.
    pub(crate) next: DVec3,
}

impl Shift {
    /// That of an obstacle that stays at `offset` `[m]`.
    pub(crate) fn at(offset: DVec3) -> Self {
        Self {
            now: offset,
            next: offset,
        }
    }
}

/// An obstacle over a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Carried {
    /// Its places at the begin and the end, if it is rigid.
    places: Option<[Place; 2]>,
    /// Frame in which it is at rest, if it does not turn too far.
    passage: Option<Passage>,
    /// True if its points differ between the two.
    moves: bool,
    /// True if a solve has its points, which do not move.
    is_put: bool,
    /// True if the last solve got its points anew.
    is_new: bool,
}

/// Rotation and translation `[m]` of an obstacle since the scene began.
type Place = (DQuat, DVec3);

impl Carried {
    /// Returns true if the ways of its points may be others than in the solve before.
    pub(super) fn is_new(&self) -> bool {
        self.is_new
    }
}

/// Points of a body.
pub(super) fn points(body: &Body) -> Range<usize> {
    body.points.start as usize..body.points.end as usize
}

/// The place of a rigid obstacle that is shifted, at a time `[s]`; none if it deforms.
fn place(obstacle: &Obstacle, shift: DVec3, time: f64) -> Option<Place> {
    let deforms = matches!(obstacle.path(), ObstaclePath::Points { .. });
    if deforms && !obstacle.is_still() {
        return None;
    }
    let (first, begin) = obstacle.rigid_place(0.0);
    let (rotation, translation) = obstacle.rigid_place(time);
    let turn = (rotation * first.inverse()).normalize();
    Some((turn, translation + shift - turn * begin))
}

impl Contact {
    /// Puts obstacles where they are at both ends of the step from `frame` on, at `rate` frames per
    /// second. Those that stay where they were cost nothing.
    pub(super) fn carry_obstacles(&mut self, frame: usize, rate: f64) {
        let cloth = self.mass.len();
        let bodies = &self.surface.bodies()[1..];
        let all = self.obstacles.iter().zip(&self.shifts).zip(bodies);
        for (((obstacle, shift), body), carried) in all.zip(&mut self.carried) {
            let times = [frame, frame + 1].map(|frame| frame as f64 / rate);
            let shifts = [shift.now, shift.next];
            let now = place(obstacle, shifts[0], times[0]);
            let places = now.zip(place(obstacle, shifts[1], times[1]));
            let places = places.map(|(now, next)| [now, next]);
            let moves = places.is_none_or(|[now, next]| now != next);
            if places.is_some() && places == carried.places && !moves {
                continue;
            }
            let range = points(body);
            let range = range.start - cloth..range.end - cloth;
            for ((points, shift), time) in self.frame.iter_mut().zip(shifts).zip(times) {
                let new = obstacle.positions_at(time);
                for (point, new) in points[range.clone()].iter_mut().zip(new) {
                    *point = new + shift;
                }
            }
            *carried = Carried {
                places,
                passage: places.and_then(|[now, next]| Passage::new(now, next)),
                moves,
                is_put: false,
                is_new: true,
            };
        }
    }

    /// Puts obstacles where they are at both ends of a solve; parts of the frame.
    pub(super) fn put_obstacles(&mut self, now: f64, end: f64) {
        let cloth = self.mass.len();
        self.rigid.clear();
        let bodies = &self.surface.bodies()[1..];
        for (carried, body) in self.carried.iter_mut().zip(bodies) {
            let passage = carried.passage.map(|passage| passage.between(now, end));
            self.rigid.push(passage);
            carried.is_new = !carried.is_put;
            carried.is_put = !carried.moves;
            if !carried.is_new {
                continue;
            }
            for p in points(body) {
                let (from, to) = (self.frame[0][p - cloth], self.frame[1][p - cloth]);
                self.start[p] = from.lerp(to, now);
                self.end[p] = from.lerp(to, end);
            }
        }
    }

    /// Frames in which obstacles are at rest at frame `frame`, at `rate` frames per second, as
    /// [`Ways::rigid`] has them.
    pub(super) fn rigid_at(&self, frame: usize, rate: f64) -> Vec<Option<Passage>> {
        let obstacles = self.obstacles.iter().zip(&self.shifts);
        let place = |(obstacle, shift): (&Obstacle, &Shift)| {
            let (rotation, origin) = place(obstacle, shift.now, frame as f64 / rate)?;
            Some(Passage::still(Frame::new(rotation, origin)))
        };
        obstacles.map(place).collect()
    }

    /// Takes the frame as done: obstacles are where they were led to.
    pub(crate) fn arrive(&mut self) {
        for shift in &mut self.shifts {
            *shift = Shift::at(shift.next);
        }
    }

    /// Points of all obstacles at frame `frame`, at `rate` frames per second `[m]`.
    pub(crate) fn obstacle_points(&self, frame: usize, rate: f64) -> Vec<DVec3> {
        let mut points = Vec::new();
        for (obstacle, shift) in self.obstacles.iter().zip(&self.shifts) {
            let places = obstacle.positions_at(frame as f64 / rate);
            points.extend(places.map(|p| p + shift.now));
        }
        points
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
        points.extend(self.obstacle_points(frame, rate));
        let reach = Reach {
            gap: far,
            slack: 0.0,
            ahead: 0.0,
        };
        let mut candidates = Candidates::new(&self.surface, &points, self.settings.self_contact);
        candidates.find(&self.surface, Ways::still(&points), reach);
        let mut gaps = vec![far; positions.len()];
        for pair in candidates.pairs() {
            let is_own = self.other_body(pair) == 0 && self.neighbours.join(pair);
            if is_own && self.neighbours.gap(pair) < 2.0 * far {
                continue;
            }
            let distance = gap(pair.kind, pair.places(&points)).distance;
            for corner in pair.corners {
                if let Some(least) = gaps.get_mut(corner as usize) {
                    *least = least.min(distance);
                }
            }
        }
        gaps
    }
}
