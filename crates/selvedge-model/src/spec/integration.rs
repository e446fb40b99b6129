//! The motion of a cloth without its network, to which the network adds its acceleration.
//!
//! Inertial, as in the paper: p^{t+1} = a + 2 p^t - p^{t-1}.
//!
//! Carried `[eq:carried]`, not in the paper: the cloth goes along with the rigid motion of its
//! handles, as a damped pendulum about its rest pose, p^{t+1} = a + M(p^t) + (1 - d) u + s (r -
//! M(p^t)). M is the rigid motion (yaw and translation) of the handles from now to the next frame,
//! u = M(p^t) - M(M'(p^{t-1})) the last move relative to the handles, and r the rest pose at the
//! handles of the next frame. Without a network a cloth at rest then stays the rest pose moved
//! rigidly, and every disturbance dies away.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;

/// The motion of a cloth without its network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Integration {
    /// Uniform motion.
    Inertial {},
    /// Motion along with the handles, back to the rest pose.
    Carried {
        /// Part of the velocity relative to the handles that is lost per frame, d.
        damping: f64,
        /// Part of the way back to the rest pose that is gone per frame squared, s.
        stiffness: f64,
    },
}

impl Default for Integration {
    fn default() -> Self {
        Self::Inertial {}
    }
}

/// The last two frames of a cloth and the way of its handles, all in the world `[m]`.
#[derive(Clone, Copy, Debug)]
pub struct LastFrames<'a> {
    /// The cloth.
    pub graph: &'a ClothGraph,
    /// Positions one frame before the current ones, `[vertices]`.
    pub previous: &'a [Vec3],
    /// Current positions, `[vertices]`.
    pub current: &'a [Vec3],
    /// Positions of the handles one frame later, `[handles]`.
    pub next_handles: &'a [Vec3],
    /// The local frame of the current positions.
    pub yaw: Yaw,
}

impl LastFrames<'_> {
    fn carries(&self) -> Carries {
        let handles = [self.previous, self.current].map(|frame| self.graph.handles().of(frame));
        Carries::new(self.graph, handles, self.next_handles, self.yaw)
    }
}

/// A rigid motion of the handles: a turn about the vertical through `from`, then to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carry {
    /// Centre of the turn `[m]`.
    pub from: DVec3,
    /// Position of that centre afterwards `[m]`.
    pub to: DVec3,
    /// The turn.
    pub turn: Yaw,
}

impl Carry {
    fn between(from: HandlePose, to: HandlePose) -> Self {
        Self {
            from: from.centre,
            to: to.centre,
            turn: Yaw::from_angle(to.yaw.angle() - from.yaw.angle()),
        }
    }

    /// The motion of the handles of `graph` from the rest pose to `handles` `[m]`, `[handles]`, of
    /// yaw `yaw`.
    #[must_use]
    pub fn from_rest(graph: &ClothGraph, handles: &[Vec3], yaw: Yaw) -> Self {
        let to = HandlePose {
            centre: centroid(handles.iter().copied()),
            yaw,
        };
        Self::between(rest(graph), to)
    }

    /// The image of a point `[m]`.
    #[must_use]
    pub fn point(&self, p: Vec3) -> DVec3 {
        self.to + self.turn.to_world_f64(p.as_dvec3() - self.from)
    }
}

/// Rigid motions of handles to the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carries {
    /// From the current frame.
    pub to_next: Carry,
    /// From the frame before.
    pub from_before: Carry,
    /// From the rest pose.
    pub from_rest: Carry,
}

impl Carries {
    /// The motions of handles to `next` in the next frame. `handles` are those of the frame before
    /// and of the current one `[m]`, `[handles]` each; `yaw` belongs to the current frame.
    pub fn new<H>(graph: &ClothGraph, handles: [H; 2], next: &[Vec3], yaw: Yaw) -> Self
    where
        H: ExactSizeIterator<Item = Vec3> + Clone,
    {
        let [before, now] = handles.map(|handles| {
            let centre = centroid(handles.clone());
            let yaw = graph.frame().yaw_of(handles, yaw);
            HandlePose { centre, yaw }
        });
        let next = HandlePose {
            centre: centroid(next.iter().copied()),
            yaw: graph.frame().yaw(next, yaw),
        };
        Self {
            to_next: Carry::between(now, next),
            from_before: Carry::between(before, next),
            from_rest: Carry::between(rest(graph), next),
        }
    }
}

/// Centroid `[m]` and yaw of handles.
#[derive(Clone, Copy)]
struct HandlePose {
    centre: DVec3,
    yaw: Yaw,
}

/// The pose of the handles at rest.
fn rest(graph: &ClothGraph) -> HandlePose {
    HandlePose {
        centre: centroid(graph.handles().of(graph.rest_positions())),
        yaw: graph.frame().rest_yaw(),
    }
}

impl Integration {
    /// Sets `reference` to the positions one frame earlier from which uniform motion leads to the
    /// next frame without a network `[m]`, `[vertices]`. For [`Self::Inertial`] these are the
    /// previous ones.
    pub fn reference(self, frames: &LastFrames<'_>, reference: &mut Vec<Vec3>) {
        let LastFrames {
            graph,
            previous,
            current,
            ..
        } = *frames;
        reference.clear();
        let Self::Carried { damping, stiffness } = self else {
            reference.extend_from_slice(previous);
            return;
        };
        let Carries {
            to_next,
            from_before,
            from_rest,
        } = frames.carries();
        let rows = previous.iter().zip(current).zip(graph.rest_positions());
        reference.extend(rows.map(|((&q, &p), &r)| {
            let here = to_next.point(p);
            let moved = here - from_before.point(q);
            let there = here + (1.0 - damping) * moved + stiffness * (from_rest.point(r) - here);
            (2.0 * p.as_dvec3() - there).as_vec3()
        }));
    }
}

/// The derivative of [`Integration::reference`] with respect to its frames. It is linear, and alike
/// for all vertices: a turn times a share for the previous positions; for the current ones a share
/// of their own and another one that is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSlope {
    previous_share: f64,
    previous_turn: Yaw,
    current_share: f64,
    carried_share: f64,
    carried_turn: Yaw,
}

impl ReferenceSlope {
    /// Adds the gradient of the previous and of the current positions for the gradient
    /// `by_reference` of the reference, all in the world, `[vertices]`.
    pub fn backward(&self, by_reference: &[Vec3], previous: &mut [Vec3], current: &mut [Vec3]) {
        let rows = by_reference.iter().zip(previous).zip(current);
        for ((g, q), p) in rows {
            let g = g.as_dvec3();
            *q += (self.previous_share * self.previous_turn.to_local_f64(g)).as_vec3();
            let carried = self.carried_share * self.carried_turn.to_local_f64(g);
            *p += (self.current_share * g + carried).as_vec3();
        }
    }
}

/// The rest pose of `graph` where `handles` (`[handles]`, of yaw `yaw`) have carried it `[m]`,
/// `[vertices]`; without handles the positions `current` themselves.
pub(crate) fn carried_rest(
    graph: &ClothGraph,
    handles: &[Vec3],
    yaw: Yaw,
    current: &[Vec3],
    rest: &mut Vec<Vec3>,
) {
    rest.clear();
    if handles.is_empty() {
        rest.extend_from_slice(current);
        return;
    }
    let from_rest = Carry::from_rest(graph, handles, yaw);
    let positions = graph.rest_positions().iter();
    rest.extend(positions.map(|&r| from_rest.point(r).as_vec3()));
}

impl Integration {
    /// The derivative of [`Self::reference`] with respect to its frames, the handles held: with M
    /// and M' the turns of the handles to where they go, from now and from the frame before,
    /// ∂reference/∂p^t = 2 - (2 - d - s) M and ∂reference/∂p^{t-1} = (1 - d) M'
    /// `[eq:carried-slope]`.
    #[must_use]
    pub fn reference_slope(self, frames: &LastFrames<'_>) -> ReferenceSlope {
        let Self::Carried { damping, stiffness } = self else {
            return ReferenceSlope {
                previous_share: 1.0,
                previous_turn: Yaw::WORLD,
                current_share: 0.0,
                carried_share: 0.0,
                carried_turn: Yaw::WORLD,
            };
        };
        let carries = frames.carries();
        ReferenceSlope {
            previous_share: 1.0 - damping,
            previous_turn: carries.from_before.turn,
            current_share: 2.0,
            carried_share: -(2.0 - damping - stiffness),
            carried_turn: carries.to_next.turn,
        }
    }
}

/// The mean of `positions`; the origin where there are none.
fn centroid(positions: impl ExactSizeIterator<Item = Vec3>) -> DVec3 {
    let count = positions.len().max(1) as f64;
    positions.map(|p| p.as_dvec3()).sum::<DVec3>() / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::{parts, shaken, turn};

    const CARRIED: Integration = Integration::Carried {
        damping: 0.03,
        stiffness: 0.003,
    };

    fn next(
        integration: Integration,
        graph: &ClothGraph,
        frames: [&[Vec3]; 2],
        handles: &[Vec3],
    ) -> Vec<Vec3> {
        let yaw = graph
            .frame()
            .yaw(&graph.handles().select(frames[1]), Yaw::WORLD);
        let mut reference = Vec::new();
        let last = LastFrames {
            graph,
            previous: frames[0],
            current: frames[1],
            next_handles: handles,
            yaw,
        };
        integration.reference(&last, &mut reference);
        let rows = reference.iter().zip(frames[1]);
        rows.map(|(q, p)| 2.0 * *p - *q).collect()
    }

    #[test]
    fn inertial_is_the_previous_frame_itself() {
        let graph = parts(5, 1).graph();
        let (a, b) = (
            shaken(graph.rest_positions(), 0.01, 1),
            graph.rest_positions(),
        );
        let mut reference = Vec::new();
        let handles = graph.handles().select(b);
        let yaw = graph.frame().rest_yaw();
        let last = LastFrames {
            graph: &graph,
            previous: &a,
            current: b,
            next_handles: &handles,
            yaw,
        };
        Integration::default().reference(&last, &mut reference);
        assert_eq!(reference, a);
    }

    #[test]
    fn a_cloth_at_rest_goes_rigidly_with_its_handles() {
        let graph = parts(5, 1).graph();
        let rest = graph.rest_positions();
        let at = |angle: f64| {
            let by = Vec3::new(0.3, -0.1, 0.2) * angle as f32;
            turn(rest, Yaw::from_angle(angle), by)
        };
        let (previous, current, expected) = (at(0.2), at(0.25), at(0.33));
        let handles = graph.handles().select(&expected);
        for (found, expected) in next(CARRIED, &graph, [&previous, &current], &handles)
            .iter()
            .zip(&expected)
        {
            // A dozen roundings of positions of 1 m.
            assert!(found.distance(*expected) < 2e-6);
        }
    }

    #[test]
    fn a_disturbance_swings_and_dies_away_as_a_damped_pendulum() {
        let graph = parts(5, 1).graph();
        let rest = graph.rest_positions().to_vec();
        let handles = graph.handles().select(&rest);
        let mut start = rest.clone();
        start.iter_mut().for_each(|p| p.x += 0.1);
        for handle in graph.handles().vertices() {
            start[handle.index()] = rest[handle.index()];
        }
        let (mut previous, mut current) = (start.clone(), start);
        // x'' = -s x - d x', stepped as the scheme steps it.
        let (mut q, mut p) = (0.1_f64, 0.1_f64);
        for _ in 0..200 {
            let moved = next(CARRIED, &graph, [&previous, &current], &handles);
            (previous, current) = (current, moved);
            (q, p) = (p, p + 0.97 * (p - q) - 0.003 * p);
            let free = graph
                .handle_mask()
                .iter()
                .position(|h| !h)
                .expect("a free vertex");
            let found = f64::from(current[free].x - rest[free].x);
            assert!((found - p).abs() < 2e-4, "{found} {p}");
        }
        assert!(p.abs() < 0.01);
    }
}
