//! What collisions of a recorded substep came from, for their derivatives.

use glam::{DMat3, DVec3};
use selvedge_cloth::{FrictionAnchor, Touching};
use selvedge_contact::{Kind, Pair, Path, at_impact, gap, weights};

use super::Contact;
use super::barrier::LEAST;
use super::collisions::{Collision, Met, PairLaw, Sticking};
use super::narrow_phase::{edge_share, round_share};
use super::real::Real;
use crate::integrator::{SolveTape, Tape};

/// Difference of a direction from which it is not what the start tells.
const SAME: f64 = 1e-7;

/// What a collision of a recorded substep came from.
#[derive(Clone, Debug)]
pub(crate) struct CollisionTape {
    pub(super) shape: ShapeOrigin,
    /// Direction, weights and masses have derivatives, and the part of the barrier has.
    pub(super) has_way: bool,
    pub(super) has_share: bool,
    pub(super) at: At,
    /// Of friction that slides as an earlier solve has shown: the number of that, and where the cloth's corners
    /// ended `[m]`.
    pub(super) slid: Option<Box<(usize, [DVec3; 4])>>,
    /// The anchor from which it has its pull.
    pub(super) anchor: Option<FrictionAnchor>,
}

/// Where the shape of a collision comes from.
#[derive(Clone, Debug)]
pub(super) enum ShapeOrigin {
    /// The places of its corners.
    Own(Box<ShapeTape>),
    /// The collision of this number in the solve before.
    Earlier(usize),
}

/// What direction, weights, gap and masses of a collision came from.
#[derive(Clone, Debug)]
pub(super) struct ShapeTape {
    pub(super) kind: Kind,
    /// Corners at the start of the substep, and at its end, if they are of an obstacle `[m]`.
    pub(super) starts: [DVec3; 4],
    pub(super) ends: [DVec3; 4],
    /// False for corners of obstacles; and the number of the obstacle.
    pub(super) is_cloth: [bool; 4],
    pub(super) obstacle: Option<usize>,
    /// Inverse masses of the corners, 0 where prescribed `[1/kg]`.
    pub(super) inverse: [f64; 4],
    /// Radius of a round body `[m]`, and the way of its closest point by the direction of the gap, because it turns.
    pub(super) radius: f64,
    pub(super) turn: DMat3,
    /// The way on which the pair meets; none where its direction and weights count as decided.
    pub(super) way: Option<Way>,
    pub(super) share: Share,
}

/// The way on which a pair meets, or comes no nearer than this `distance` `[m]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// Ends of the corners `[m]`: their starts, where the pair is near at once.
    pub(super) to: [DVec3; 4],
    pub(super) distance: f64,
    /// Derivatives of those of the cloth by where it starts, by the velocity there and by the estimate
    /// of an earlier solve, and its number.
    pub(super) by: [f64; 3],
    pub(super) solve: usize,
}

/// Where the gap of a collision's linearisation comes from, where a solve has missed it.
#[derive(Clone, Copy, Debug)]
pub(super) enum At {
    /// It counts as decided.
    Fixed,
    /// It is the gap at the start.
    Start,
    /// It is half of the distance of the features at the start.
    Half,
}

/// Where a collision's part of the barrier comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Share {
    /// It counts as decided.
    Fixed,
    /// From two edges, beside which stand these vertices, and where those start `[m]`.
    Edges([[Option<(usize, DVec3)>; 2]; 2]),
    /// From a round body.
    Round,
}

impl Contact {
    /// Keeps what the collisions of the substep under way, which took `left` `[s]`, came from: before the
    /// anchors of this substep are taken. `point` is that of the substep at which its equations hold.
    pub(super) fn record_collisions(&self, tape: &mut Tape, left: f64, point: f64) {
        let Some(substep) = tape.last() else {
            return;
        };
        let velocities = &substep.start.velocities;
        let (gamma, stages) = (substep.gamma, &mut substep.stages);
        // Where the solve before ended, and what pushed in it.
        let mut before: Vec<DVec3> = Vec::new();
        let mut last: Option<&SolveTape> = None;
        for (number, solve) in stages.iter_mut().flatten().enumerate() {
            let way = |collision: &Collision| {
                let to = |end: &dyn Fn(usize) -> DVec3| {
                    collision.corners.map(|corner| {
                        let v = corner as usize;
                        if v < self.mass.len() { end(v) } else { self.end[v] }
                    })
                };
                match collision.met {
                    Met::Ahead => Way {
                        to: to(&|v| self.start[v] + velocities[v] * left),
                        distance: LEAST * collision.thickness,
                        by: [1.0, left, 0.0],
                        solve: 0,
                    },
                    Met::Solve if !before.is_empty() => Way {
                        to: to(&|v| before[v]),
                        distance: self.settings.floor,
                        by: [1.0 - 1.0 / point, 0.0, 1.0 / point],
                        solve: number - 1,
                    },
                    Met::Start | Met::Solve => Way {
                        to: to(&|v| self.start[v]),
                        distance: f64::INFINITY,
                        by: [0.0; 3],
                        solve: 0,
                    },
                }
            };
            let tape = |(at, collision): (usize, &Collision)| {
                // From the same place of the list on, where most are found.
                let known = || {
                    let pushed = last.map_or(&[][..], |solve| &solve.collisions.list);
                    let all = pushed.iter().enumerate();
                    let all = all.clone().skip(at).chain(all.take(at));
                    all.filter(|(_, own)| own.pair == collision.pair)
                };
                let goes_on = known().find(|(_, own)| own.is_shaped_as(collision));
                let earlier = goes_on.and_then(|(k, own)| Some((own, k, last?.came_from.get(k)?)));
                let mut tape = match earlier {
                    Some((_, k, earlier)) => CollisionTape {
                        shape: ShapeOrigin::Earlier(k),
                        ..earlier.clone()
                    },
                    None => self.collision_tape(collision, way(collision)),
                };
                let is_half = |(_, own): (usize, &Collision)| {
                    let is_start = matches!(own.met, Met::Start);
                    is_start
                        && collision.at == Some(0.5 * own.gap)
                        && own.response.tangent.gap == own.gap
                };
                let is_sliding = matches!(collision.sticking, Sticking::Slides(..));
                if let Some((own, ..)) = earlier.filter(|_| is_sliding)
                    && !own.slides_as(collision)
                {
                    let end = |corner: u32| before.get(corner as usize).copied();
                    let ends = collision
                        .corners
                        .map(|corner| end(corner).unwrap_or_default());
                    tape.slid = Some(Box::new((number - 1, ends)));
                }
                tape.at = match collision.at {
                    Some(at) if at == collision.gap => At::Start,
                    Some(_) if known().any(is_half) => At::Half,
                    _ => tape.at,
                };
                tape
            };
            let list = solve.collisions.list.iter().enumerate();
            solve.came_from = list.map(tape).collect();
            let places = solve.at.positions.iter().zip(&solve.changes[..]);
            let end = |(v, (at, change)): (usize, (&DVec3, &DVec3))| {
                let start = self.start[v];
                start + (*at + *change * gamma - start) / point
            };
            before = places.enumerate().map(end).collect();
            last = Some(solve);
        }
    }

    fn collision_tape(&self, collision: &Collision, way: Way) -> CollisionTape {
        let corners = collision.corners.map(|corner| corner as usize);
        let is_cloth = corners.map(|corner| corner < self.mass.len());
        let starts = corners.map(|corner| self.start[corner]);
        let end = |k: usize| if is_cloth[k] { starts[k] } else { self.end[corners[k]] };
        let (kind, [first, second]) = match collision.pair {
            Touching::Vertex { vertex, other } => (Kind::VertexFace, [vertex, other]),
            Touching::Edges { first, second } => (Kind::EdgeEdge, [first, second]),
        };
        let pair = Pair {
            kind,
            first,
            second,
            corners: collision.corners,
        };
        let (body, radius) = (self.other_body(&pair), self.mesh.radius_of(&pair));
        let turn = match body.checked_sub(1) {
            Some(own) => self.bodies.turns[own] * (-radius * self.bodies.part),
            None => DMat3::ZERO,
        };
        let met = way.places::<f64>(kind, radius, starts, [starts, way.to]);
        let has_way = gap(kind, met).normal.distance(collision.normal) < SAME;
        let share = self.share_tape(collision, &pair, radius > 0.0, met);
        let shape = ShapeTape {
            kind,
            starts,
            ends: std::array::from_fn(end),
            is_cloth,
            obstacle: body.checked_sub(1),
            inverse: corners.map(|corner| self.inverse[corner]),
            radius,
            turn,
            way: has_way.then_some(way),
            share,
        };
        let of = collision.anchored;
        CollisionTape {
            shape: ShapeOrigin::Own(Box::new(shape)),
            has_way,
            has_share: !matches!(share, Share::Fixed),
            at: At::Fixed,
            slid: None,
            anchor: of.and_then(|of| self.anchor(of, collision.normal).copied()),
        }
    }

    /// Where the share of a pair that meets with these corners comes from.
    fn share_tape(
        &self,
        collision: &Collision,
        pair: &Pair,
        is_round: bool,
        met: [DVec3; 4],
    ) -> Share {
        let PairLaw::Barrier { share } = collision.law else {
            return Share::Fixed;
        };
        let (starts, thickness) = (pair.places(&self.start), collision.thickness);
        let (from, found) = if is_round {
            (
                Share::Round,
                round_share::<f64>(pair.kind, starts, thickness),
            )
        } else if pair.kind == Kind::EdgeEdge {
            let wings = self
                .wings(pair)
                .map(|wings| wings.map(|wing| wing.map(|vertex| (vertex, self.start[vertex]))));
            let places = wings.map(|wings| wings.map(|wing| wing.map(|(_, place)| place)));
            let weights = weights::<f64>(pair.kind, met);
            let normal = collision.normal;
            let found = edge_share::<f64>(starts, places, weights, normal, thickness);
            (Share::Edges(wings), found)
        } else {
            return Share::Fixed;
        };
        if share < 1.0 && (found - share).abs() < SAME { from } else { Share::Fixed }
    }
}

impl Way {
    /// Corners where the pair meets; `starts` are the values of the first of both.
    pub(super) fn places<N: Real>(
        &self,
        kind: Kind,
        radius: f64,
        starts: [DVec3; 4],
        ways: [[N::Vector; 4]; 2],
    ) -> [N::Vector; 4] {
        if self.distance == f64::INFINITY {
            return ways[0];
        }
        let path = Path {
            from: starts,
            to: self.to,
        };
        at_impact::<N>(kind, &path, ways, self.distance + radius)
    }
}
