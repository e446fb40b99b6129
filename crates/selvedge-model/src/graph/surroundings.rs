//! What a cloth could touch, as the features see it: the nearest point of a body or of another layer to
//! each vertex, and the way that both are about to go.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{ContactSettings, Obstacle, Topology, VertexId};
use selvedge_contact::{
    Candidates, CollisionMesh, Kind, Pair, Path, Reach, Ways, certify, gap, push,
};

/// Gap to a body from which on a vertex sees nothing of it `[m]`: cloth that moves at 3 m/s is there
/// after two frames.
const REACH: f64 = 0.1;

/// The same for other layers, below the edges of the finest cloths `[m]`.
const OWN_REACH: f64 = 0.02;

/// Most rounds of pushes that keep a frame apart.
const ROUNDS: usize = 20;

/// How far within its bounds an edge beyond them is brought, as a part of what is between them.
const WITHIN: f64 = 0.02;

/// Bodies around a cloth, in the present step, and whether it meets itself.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    fixed: Arc<Fixed>,
    /// Points of the bodies in the present frame and in the next one `[m]`.
    places: [Vec<DVec3>; 2],
}

#[derive(Debug)]
struct Fixed {
    mesh: CollisionMesh,
    obstacles: Vec<Obstacle>,
    settings: ContactSettings,
    /// The cloth's edges with their shortest and longest lengths `[m]`.
    edges: Vec<([usize; 2], [f64; 2])>,
}

/// What a vertex sees of the nearest point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Near {
    /// Unit direction from the point to the vertex, times 1 - gap / reach.
    pub(crate) nearness: Vec3,
    /// What keeps the two at the thickness of contact, if they go on as they do `[m/frame²]`.
    pub(crate) push: Vec3,
    /// Velocity of the point against the vertex, times 1 - gap / reach `[m/frame]`.
    pub(crate) velocity: Vec3,
}

impl PartialEq for Surroundings {
    fn eq(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|one| &*one.fixed);
        own.settings == other.settings && own.obstacles == other.obstacles
    }
}

impl Surroundings {
    /// Edges beyond the `bounds` of their lengths `[m]`, `[edges]`, are brought back where frames are kept apart.
    pub(crate) fn new(
        cloth: &Topology,
        bounds: Vec<[f64; 2]>,
        settings: ContactSettings,
        obstacles: &[Obstacle],
        frame_rate: f64,
    ) -> Self {
        let mut made = Self {
            fixed: Arc::new(Fixed {
                mesh: CollisionMesh::new(cloth, obstacles),
                obstacles: obstacles.to_vec(),
                settings,
                edges: cloth
                    .edges()
                    .iter()
                    .map(|edge| edge.vertices.map(VertexId::index))
                    .zip(bounds)
                    .collect(),
            }),
            places: Default::default(),
        };
        made.set_step(0, frame_rate);
        made
    }

    /// True where a body moves.
    pub(crate) fn vary(&self) -> bool {
        !self.fixed.obstacles.iter().all(Obstacle::is_still)
    }

    /// Takes the bodies in the step from `frame` to the next.
    pub(crate) fn set_step(&mut self, frame: usize, frame_rate: f64) {
        for (places, frame) in self.places.iter_mut().zip([frame, frame + 1]) {
            let time = frame as f64 / frame_rate;
            let obstacles = self.fixed.obstacles.iter();
            places.clear();
            places.extend(obstacles.flat_map(|body| CollisionMesh::places_of(body, time)));
        }
    }

    /// Thickness of contact of a pair `[m]`.
    fn thickness(&self, pair: &Pair) -> f64 {
        let Fixed {
            mesh,
            obstacles,
            settings,
            ..
        } = &*self.fixed;
        let bodies = [pair.corners[0], pair.corners[3]].map(|corner| mesh.body_of(corner));
        let own = bodies[0].max(bodies[1]).checked_sub(1);
        let own = own.and_then(|body| obstacles[body].thickness());
        own.unwrap_or(settings.thickness)
    }

    /// The pairs that come nearer than `gap` `[m]` on these ways of all points.
    fn pairs(&self, [from, to]: [&[DVec3]; 2], gap: f64, touches_itself: bool) -> Candidates {
        let mut candidates = Candidates::new(&self.fixed.mesh, from, touches_itself);
        let later = to;
        let reach = Reach {
            gap,
            slack: 0.0,
            own_slack: 0.0,
        };
        candidates.find(&self.fixed.mesh, Ways { from, to, later }, reach);
        candidates
    }

    /// Moves the frame `next` that comes after `current` `[m]`, `[vertices]`, by the least along gaps and
    /// edges, until what touches is at the thickness of contact and edges are within their bounds, or the rounds
    /// are over. What is `held` stays. Returns true if an edge was beyond its bounds.
    pub(crate) fn keep_apart(&self, current: &[Vec3], next: &mut [Vec3], held: &[bool]) -> bool {
        let [from, mut to] = [(current, 0), (&*next, 1)].map(|(cloth, at)| {
            let cloth = cloth.iter().map(|p| p.as_dvec3());
            cloth
                .chain(self.places[at].iter().copied())
                .collect::<Vec<_>>()
        });
        if !to.iter().all(|p| p.is_finite()) {
            return false;
        }
        let (mesh, settings) = (&self.fixed.mesh, &self.fixed.settings);
        let most = self.fixed.obstacles.iter().filter_map(Obstacle::thickness);
        let most = most.fold(settings.thickness, f64::max);
        let candidates = self.pairs([&from, &to], 2.0 * most, settings.self_contact);
        let free = |p: u32| f64::from(u8::from(held.get(p as usize) == Some(&false)));
        let mut is_strained = false;
        for _ in 0..ROUNDS {
            let mut has_moved = false;
            for pair in candidates.pairs() {
                // Where the two meet on their way, the side is that on which they were before.
                let radius = mesh.radius_of(pair);
                let path = Path {
                    from: pair.places(&from),
                    to: pair.places(&to),
                };
                let found = match certify(pair.kind, path, radius + settings.floor) {
                    Err(impact) => impact.gap,
                    Ok(()) => gap(pair.kind, path.to),
                };
                let apart = self.thickness(pair) + radius;
                if let Some(push) = push(&found, pair.places(&to), pair.corners.map(free), apart) {
                    for (corner, by) in pair.corners.into_iter().zip(push.moves) {
                        to[corner as usize] += by;
                        has_moved |= by.length_squared() > 1e-12;
                    }
                }
            }
            for (ends, [least, most]) in &self.fixed.edges {
                let vector = to[ends[0]] - to[ends[1]];
                let (length, inner) = (vector.length(), WITHIN * (most - least));
                let shares = ends.map(|v| free(v as u32));
                let both: f64 = shares.iter().sum();
                if (*least..=*most).contains(&length) || length <= 0.0 || both <= 0.0 {
                    continue;
                }
                let goal = length.clamp(least + inner, most - inner);
                let change = vector * ((goal / length - 1.0) / both);
                to[ends[0]] += shares[0] * change;
                to[ends[1]] -= shares[1] * change;
                (has_moved, is_strained) = (true, true);
            }
            if !has_moved {
                break;
            }
        }
        for (next, to) in next.iter_mut().zip(&to) {
            *next = to.as_vec3();
        }
        is_strained
    }

    /// What each vertex sees, given the last two frames `[m]`, `[vertices]` `[eq:nearness]`.
    pub(crate) fn near(&self, previous: &[Vec3], current: &[Vec3]) -> Vec<Near> {
        let Fixed {
            mesh,
            obstacles,
            settings,
            ..
        } = &*self.fixed;
        let mut near = vec![Near::default(); current.len()];
        let cloth = current.iter().map(|p| p.as_dvec3());
        let from: Vec<DVec3> = cloth.chain(self.places[0].iter().copied()).collect();
        let ahead = current.iter().zip(previous);
        let ahead = ahead.map(|(p, q)| 2.0 * p.as_dvec3() - q.as_dvec3());
        let to: Vec<DVec3> = ahead.chain(self.places[1].iter().copied()).collect();
        let mut least = vec![f64::INFINITY; current.len()];
        for (reach, own) in [(REACH, false), (OWN_REACH, true)] {
            if if own { !settings.self_contact } else { obstacles.is_empty() } {
                continue;
            }
            let candidates = self.pairs([&from, &to], reach, own);
            let of_vertices = candidates.pairs().iter().filter(|pair| {
                pair.kind == Kind::VertexFace
                    && (pair.corners[0] as usize) < current.len()
                    && (mesh.body_of(pair.corners[1]) == 0) == own
            });
            for pair in of_vertices {
                let vertex = pair.corners[0] as usize;
                let found = gap(pair.kind, pair.places(&from));
                let (distance, normal) = (found.distance - mesh.radius_of(pair), found.normal);
                if distance >= reach {
                    continue;
                }
                // Both vectors run from the point to the vertex.
                let mut approach = DVec3::ZERO;
                for (corner, weight) in pair.corners.into_iter().zip(found.weights) {
                    approach += weight * (to[corner as usize] - from[corner as usize]);
                }
                let next = distance + normal.dot(approach);
                if next >= least[vertex] {
                    continue;
                }
                least[vertex] = next;
                let part = (1.0 - distance / reach).min(1.0);
                near[vertex] = Near {
                    nearness: (part * normal).as_vec3(),
                    push: ((self.thickness(pair) - next).max(0.0) * normal).as_vec3(),
                    velocity: (-part * approach).as_vec3(),
                };
            }
        }
        near
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use selvedge_cloth::{ObstaclePath, RigidKey, bodies};

    use super::*;

    const RATE: f64 = 60.0;

    /// Two triangles, the second above the first by this `[m]`.
    fn layers(apart: f32) -> (Topology, Vec<Vec3>) {
        let triangle = [Vec3::ZERO, Vec3::Z, Vec3::X];
        let above = triangle.map(|p| 0.25 * (p + Vec3::ONE) + Vec3::Y * (apart - 0.25));
        let topology = Topology::new(6, &[[0, 1, 2], [3, 4, 5]]).unwrap();
        (topology, [triangle, above].concat())
    }

    #[test]
    fn a_vertex_sees_the_nearest_body_and_where_both_are_about_to_be() {
        let key = |time: f64| RigidKey {
            time,
            rotation: DQuat::IDENTITY,
            translation: DVec3::new(0.0, -0.15, 0.0) + DVec3::Y * time,
        };
        let ball = Obstacle::of("ball", bodies::sphere(0.1, 0.02)).unwrap();
        let ball = ball
            .moving(ObstaclePath::Rigid(vec![key(0.0), key(1.0)]))
            .unwrap();
        let far = Obstacle::of("far", bodies::sphere(0.1, 0.02)).unwrap();
        let far = far
            .moving(ObstaclePath::Rigid(vec![RigidKey {
                translation: DVec3::splat(9.0),
                ..key(0.0)
            }]))
            .unwrap();
        let settings = ContactSettings {
            self_contact: false,
            thickness: 2e-3,
            ..ContactSettings::default()
        };
        let (topology, current) = layers(0.3);
        let around = [ball.with_thickness(5e-3).unwrap(), far];
        let mut seen = Surroundings::new(&topology, Vec::new(), settings, &around, RATE);
        assert!(seen.vary());
        // In step 1 the ball is 1/60 m higher, 0.0333 m below the first vertex, which falls by 0.03 m.
        seen.set_step(1, RATE);
        let previous: Vec<Vec3> = current.iter().map(|p| *p + 0.03 * Vec3::Y).collect();
        let near = seen.near(&previous, &current);
        let (gap, rise) = (0.05 - 1.0 / 60.0_f32, 1.0 / 60.0_f32);
        let part = 1.0 - gap / REACH as f32;
        let push = 5e-3 - (gap - rise - 0.03);
        assert!(near[0].nearness.distance(part * Vec3::Y) < 1e-6);
        assert!(near[0].push.distance(push * Vec3::Y) < 1e-6);
        assert!(near[0].velocity.distance(part * (rise + 0.03) * Vec3::Y) < 1e-6);
        assert_eq!(near[1..], [Near::default(); 5]);
        // What a push leads to is the thickness.
        let next = current[0] - 0.03 * Vec3::Y + near[0].push;
        let ball = seen.places[1][0].as_vec3();
        assert!((next.distance(ball) - 0.105).abs() < 1e-6);
    }

    #[test]
    fn layers_see_each_other_within_their_reach() {
        let settings = ContactSettings::default();
        for (apart, sees) in [(0.01, true), (0.03, false)] {
            let (topology, current) = layers(apart);
            let near = Surroundings::new(&topology, Vec::new(), settings, &[], RATE)
                .near(&current, &current);
            let part = 1.0 - apart / OWN_REACH as f32;
            let expected = if sees { part * Vec3::Y } else { Vec3::ZERO };
            for near in &near[3..] {
                assert!(near.nearness.distance(expected) < 1e-5, "{near:?}");
                assert_eq!((near.push, near.velocity), (Vec3::ZERO, Vec3::ZERO));
            }
        }
    }

    #[test]
    fn what_passes_beside_an_edge_is_not_pushed_back() {
        // The second triangle rises from 20 mm below the first to 20 mm above it, 1.5 mm beside its edge.
        let (topology, mut current) = layers(0.0);
        for (k, p) in current[3..].iter_mut().enumerate() {
            *p = Vec3::new(-0.0015 - 0.1 * (k % 2) as f32, -0.02, 0.3 + 0.1 * k as f32);
        }
        let mut next = current.clone();
        next[3..].iter_mut().for_each(|p| p.y = 0.02);
        let before = next.clone();
        let seen = Surroundings::new(&topology, Vec::new(), ContactSettings::default(), &[], RATE);
        let ways = [&current, &next].map(|at| at.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>());
        assert!(
            !seen
                .pairs([&ways[0], &ways[1]], 0.002, true)
                .pairs()
                .is_empty()
        );
        assert!(!seen.keep_apart(&current, &mut next, &[false; 6]));
        assert_eq!(next, before);
    }

    #[test]
    fn edges_beyond_their_bounds_are_brought_back_where_a_body_stops_the_cloth() {
        let slab = Obstacle::of("slab", bodies::cuboid(DVec3::new(4.0, 0.2, 4.0))).unwrap();
        let (topology, flat) = layers(0.3);
        let long: Vec<f64> = topology
            .edges()
            .iter()
            .map(|edge| {
                let [a, b] = edge.vertices.map(|v| flat[v.index()]);
                f64::from(a.distance(b))
            })
            .collect();
        let bounds = long
            .iter()
            .map(|length| [0.85 * length, 1.28 * length])
            .collect();
        let settings = ContactSettings::default();
        let seen = Surroundings::new(&topology, bounds, settings, &[slab], RATE);
        // Two corners of the upper triangle stand on the slab; the third falls through it, or flies off.
        let at = |p: &Vec3| *p + Vec3::new(-0.3, 0.102, -0.3);
        let current: Vec<Vec3> = flat.iter().map(at).collect();
        for way in [
            Vec3::new(0.1, -0.5, 0.0),
            Vec3::new(0.3, 0.2, 0.3),
            Vec3::new(-0.15, 0.0, -0.1),
        ] {
            let mut next = current.clone();
            next[3] += way;
            assert!(seen.keep_apart(&current, &mut next, &[false; 6]));
            for (edge, length) in topology.edges().iter().zip(&long) {
                let [a, b] = edge.vertices.map(|v| next[v.index()]);
                let stretch = f64::from(a.distance(b)) / length;
                assert!((0.849..1.281).contains(&stretch), "{way}: {stretch}");
            }
            assert!(next.iter().all(|p| p.y > 0.1 + 0.95e-3), "{way}");
        }
    }

    #[test]
    fn a_frame_is_kept_apart_from_bodies_and_layers_and_handles_stay() {
        let ball = Obstacle::of("ball", bodies::sphere(0.1, 0.02)).unwrap();
        let slab = Obstacle::of("slab", bodies::cuboid(DVec3::new(4.0, 0.2, 4.0))).unwrap();
        let settings = ContactSettings::default();
        let (topology, start) = layers(0.01);
        for (body, height) in [(&ball, 0.102), (&slab, 0.102)] {
            // Below the middle of the first face, whose corners are all beside the ball.
            let at = |p: &Vec3| *p + Vec3::new(-0.3, height, -0.3);
            let current: Vec<Vec3> = start.iter().map(at).collect();
            let around = std::slice::from_ref(body);
            let seen = Surroundings::new(&topology, Vec::new(), settings, around, RATE);
            for held in [
                vec![false; 6],
                vec![true, false, false, false, false, false],
            ] {
                // The lower layer falls by 8 mm, the upper one by 20 mm.
                let fall = |v: usize| {
                    if held[v] {
                        0.0
                    } else if v < 3 {
                        0.008
                    } else {
                        0.02
                    }
                };
                let fallen = current.iter().enumerate();
                let fallen = fallen.map(|(v, p)| *p - fall(v) * Vec3::Y);
                let mut next: Vec<Vec3> = fallen.collect();
                let before = next.clone();
                seen.keep_apart(&current, &mut next, &held);
                for v in (0..6).filter(|v| held[*v]) {
                    assert_eq!(next[v], before[v]);
                }
                let mut all: Vec<DVec3> = next.iter().map(|p| p.as_dvec3()).collect();
                all.extend(&seen.places[1]);
                let pairs = seen.pairs([&all, &all], 0.01, true);
                let mesh = &seen.fixed.mesh;
                let was = current.iter().map(|p| p.as_dvec3());
                let was: Vec<DVec3> = was.chain(seen.places[0].iter().copied()).collect();
                assert!(!pairs.pairs().is_empty());
                for pair in pairs.pairs() {
                    let [was, now] = [&was, &all].map(|at| gap(pair.kind, pair.places(at)));
                    let apart = now.distance - mesh.radius_of(pair);
                    let least = 0.95 * settings.thickness;
                    assert!(apart > least, "{}: {apart}", body.name());
                    let side = was.normal.dot(now.normal);
                    assert!(side > 0.0, "{}: {pair:?}, {side}", body.name());
                }
            }
        }
    }
}
