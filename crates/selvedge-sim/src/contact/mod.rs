//! Contact of the cloth with obstacles and with itself: push implicitly, certify, project, else
//! shorten the substep. No state that leaves this module intersects, if none came in that did.
//!
//! Pairs that are near, or would meet within the substep, push in its linear solve
//! ([`collisions`], [`barrier`], [`friction`]). Then every pair that could come near is certified to
//! stay apart on the way from the start to the end ([`ccd`]). Pairs that are not are pushed
//! apart, by mass ([`projection`]); if that does not end, vertices are held back, or the substep is divided.
//! [`step`] has the loop.

mod active_set;
mod backward;
mod barrier;
mod broad_phase;
mod came_from;
mod ccd;
mod collisions;
mod distance_cache;
mod friction;
mod gauge;
mod impulses;
mod led;
mod memory;
mod narrow_phase;
mod pressure;
mod projection;
mod real;
mod squeezed;
mod step;

use glam::{DMat3, DVec2, DVec3, Vec3};
use selvedge_cloth::{
    ContactMemory, ContactSettings, Impulse, Obstacle, Pushing, Rigid, Scene, VertexId,
};
use selvedge_contact::{Candidates, CollisionMesh, Gap, Intersection, Pair, SweptBoxes};

use crate::active_handles::ActiveHandles;
use crate::state::State;
pub use backward::ObstacleSlope;
#[cfg(test)]
pub(crate) use backward::tests::{AnchorRates, Moved};
pub(crate) use backward::{AnchorSlope, PlaceSlopes, Places, ShapeSlopes};
pub(crate) use came_from::CollisionTape;
pub(crate) use collisions::{Collisions, to_single};
use distance_cache::{PairCache, PathLengths};
pub use gauge::{ContactGauge, FrameContact};
pub(crate) use led::Shift;
pub use led::{FAR, Led};
pub(crate) use memory::of_saved;
use squeezed::WayOut;
pub use squeezed::YieldedContact;
pub(crate) use step::{Advance, Span};

/// Path lengths of the cloth against its middle, and of all points where they are.
const OWN: usize = 0;
const WORLD: usize = 1;

/// Work that contact has taken since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactCounts {
    /// Solves with contact, each one part of a substep.
    pub solves: u64,
    /// Pairs that one direction certified after a solve, at first.
    pub certified: u64,
    /// Pairs that more than one direction certified.
    pub halved: u64,
    /// Solves that were repeated with pairs that had not been expected to meet.
    pub repeated: u64,
    /// Pairs that had no certificate after a solve.
    pub uncertified: u64,
    /// Pushes of a pair in a projection.
    pub projected: u64,
    /// Rounds in which vertices were held back.
    pub held_back: u64,
    /// Substeps that were divided, each division once.
    pub divisions: u64,
    /// Pairs that push now.
    pub touching: u64,
    /// Frames in which the cloth rested, and nothing was solved.
    pub resting: u64,
}

/// The collisions of a solve.
struct ActiveSet {
    collisions: Collisions,
    /// The features that push, in order.
    pushing: Vec<Pushing>,
}

/// What becomes of the history once a substep is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HistoryUse {
    /// The solve has kept it.
    Kept,
    /// It is to be kept.
    ToKeep,
    /// What collisions has changed: no rate goes on.
    Forgotten,
}

/// What a substep changes of contact.
#[derive(Clone, Debug, Default)]
pub(crate) struct Kept {
    memory: ContactMemory,
    received: impulses::ObstacleImpulses,
}

/// The obstacles of a scene, as the cloth meets them.
pub(crate) struct Bodies {
    obstacles: Vec<Obstacle>,
    /// Motion of each obstacle away from its own path, `[obstacles]`.
    pub(crate) shifts: Vec<Shift>,
    /// ĝ of each body with the cloth `[m]`; that of the cloth with itself first.
    thickness: Vec<f64>,
    /// The largest of them.
    most: f64,
    /// Coefficient of friction of each body with the cloth.
    friction: Vec<f64>,
    /// Points of obstacles at the start and the end of the frame `[m]`.
    frame: [Vec<DVec3>; 2],
    /// Turn of each obstacle in the frame, less the identity, `[obstacles]`, and the part of the frame that a
    /// solve takes: what is round turns about its core.
    turns: Vec<DMat3>,
    part: f64,
}

/// What the broad and the narrow phase keep of the candidates.
#[derive(Default)]
struct Cache {
    /// `[candidates]`
    pairs: Vec<PairCache>,
    /// Boxes around the ways in the solve, and places of candidates that they leave open, in room that is
    /// kept.
    swept: SweptBoxes,
    open: Vec<u32>,
    /// Searches for candidates since the start of the solve.
    searches: u32,
    /// Points some solves later, if they go on as they go `[m]`.
    ahead: Vec<DVec3>,
}

/// Contact in a scene.
pub(crate) struct Contact {
    settings: ContactSettings,
    pub(crate) bodies: Bodies,
    mesh: CollisionMesh,
    candidates: Candidates,
    cache: Cache,
    /// Of pairs of the cloth with itself, as [`OWN`], and of all, as [`WORLD`].
    path_lengths: [PathLengths; 2],
    /// Pairs that are too near in the flat cloth to push.
    neighbours: active_set::Neighbours,
    ccd: ccd::CcdState,
    squeeze: pressure::Squeeze,
    mass: Vec<f64>,
    /// Inverse masses, 0 where prescribed `[1/kg]`, `[points]`.
    inverse: Vec<f64>,
    /// Number of the frame at its end.
    next_frame: usize,
    /// All points at the start and the end of a solve `[m]`.
    start: Vec<DVec3>,
    end: Vec<DVec3>,
    /// State at the start of a solve.
    before: State,
    history: HistoryUse,
    /// True if the last solve looked back.
    looked_back: bool,
    /// What the last substep left, its lists in order.
    pub(crate) memory: ContactMemory,
    /// Direction of gravity, or zero.
    down: DVec3,
    /// Ways out of bodies that are let through, in this frame.
    ways_out: Vec<WayOut>,
    /// Contact that was released so far.
    pub(crate) yielded: Vec<YieldedContact>,
    pub(crate) counts: ContactCounts,
    pub(crate) received: impulses::ObstacleImpulses,
}

impl Bodies {
    /// Returns true if no obstacle moves or turns in the frame.
    pub(crate) fn stand_still(&self) -> bool {
        let turns = |turn: &DMat3| turn.abs_diff_eq(DMat3::ZERO, 1e-12);
        self.frame[0] == self.frame[1] && self.turns.iter().all(turns)
    }
}

impl Contact {
    /// Contact of a validated scene; none if it has none. Vertex `mass` in kg, `[vertices]`.
    pub(crate) fn of(scene: &Scene, mass: &[f64]) -> Option<Self> {
        let settings = scene.contact?;
        let topology = scene.mesh.topology();
        let surface = CollisionMesh::new(topology, &scene.obstacles);
        let mut points = scene.mesh.positions().to_vec();
        for obstacle in &scene.obstacles {
            points.extend(CollisionMesh::places_of(obstacle, 0.0));
        }
        let obstacles = || scene.obstacles.iter();
        let own = |obstacle: &Obstacle| obstacle.thickness().unwrap_or(settings.thickness);
        let thickness = std::iter::once(settings.thickness).chain(obstacles().map(own));
        let thickness: Vec<f64> = thickness.collect();
        let rough = |obstacle: &Obstacle| obstacle.friction().min(settings.friction);
        let friction = std::iter::once(settings.friction).chain(obstacles().map(rough));
        let count = points.len();
        let obstacle_points = points[mass.len()..].to_vec();
        let corners: Vec<[DVec2; 3]> = scene.mesh.pattern().faces().collect();
        let bodies = Bodies {
            obstacles: scene.obstacles.clone(),
            shifts: vec![Shift::default(); scene.obstacles.len()],
            most: thickness.iter().copied().fold(0.0, f64::max),
            thickness,
            friction: friction.collect(),
            frame: [obstacle_points.clone(), obstacle_points],
            turns: vec![DMat3::ZERO; scene.obstacles.len()],
            part: 0.0,
        };
        Some(Self {
            candidates: Candidates::new(&surface, &points, settings.self_contact)
                .with_pattern(&surface, &corners),
            bodies,
            cache: Cache::default(),
            neighbours: active_set::Neighbours::new(scene),
            squeeze: pressure::Squeeze::of(scene, mass),
            mass: mass.to_vec(),
            inverse: vec![0.0; count],
            next_frame: 0,
            start: points.clone(),
            end: points,
            before: State::at_origin(mass.len()),
            history: HistoryUse::Kept,
            looked_back: false,
            memory: ContactMemory::default(),
            down: scene.environment.gravity.normalize_or_zero(),
            ways_out: Vec::new(),
            yielded: Vec::new(),
            counts: ContactCounts::default(),
            received: impulses::ObstacleImpulses::none(scene.obstacles.len()),
            ccd: ccd::CcdState::default(),
            path_lengths: [PathLengths::new(mass.len()), PathLengths::new(count)],
            settings,
            mesh: surface,
        })
    }

    /// Faces of the cloth at `positions` `[m]` that meet themselves or an obstacle at frame
    /// `frame`, at `rate` frames per second.
    pub(crate) fn intersections(
        &self,
        positions: &[DVec3],
        frame: usize,
        rate: f64,
    ) -> Vec<Intersection> {
        let mut points = positions.to_vec();
        points.extend(self.body_points(frame, rate));
        self.candidates.intersections(&self.mesh, &points)
    }

    /// As [`Self::intersections`], of a frame as it is written: obstacles in single precision too.
    pub(crate) fn written_intersections(
        &self,
        positions: &[Vec3],
        frame: usize,
        rate: f64,
    ) -> Vec<Intersection> {
        let bodies = self.body_points(frame, rate).into_iter();
        let all = positions.iter().copied().chain(bodies.map(|p| p.as_vec3()));
        let points: Vec<DVec3> = all.map(|p| p.as_dvec3()).collect();
        self.candidates.intersections(&self.mesh, &points)
    }

    /// Points of the cloth and of the obstacles.
    pub(crate) fn point_count(&self) -> usize {
        self.start.len()
    }

    /// Largest ĝ `[m]`.
    pub(crate) fn largest_thickness(&self) -> f64 {
        self.bodies.most
    }

    /// A face in words.
    pub(crate) fn face_name(&self, face: u32) -> String {
        let bodies = self.mesh.bodies();
        let body = bodies.partition_point(|body| body.faces.end <= face);
        let number = face - bodies[body].faces.start;
        match body.checked_sub(1) {
            None => format!("face {number} of the cloth"),
            Some(k) if self.bodies.obstacles[k].core().is_some() => {
                format!("obstacle {:?}", self.bodies.obstacles[k].name())
            }
            Some(k) => format!(
                "face {number} of obstacle {:?}",
                self.bodies.obstacles[k].name()
            ),
        }
    }

    /// Name of the obstacle that has this face; none if the cloth has it.
    pub(crate) fn body_name(&self, face: u32) -> Option<String> {
        let bodies = self.mesh.bodies();
        let body = bodies.partition_point(|body| body.faces.end <= face);
        let obstacle = body.checked_sub(1).map(|k| &self.bodies.obstacles[k]);
        obstacle.map(|obstacle| obstacle.name().to_owned())
    }

    /// Takes the places of obstacles for the step from `frame` on, at `rate` frames per second.
    pub(crate) fn enter_frame(&mut self, frame: usize, rate: f64) {
        self.next_frame = frame + 1;
        for (k, points) in self.bodies.frame.iter_mut().enumerate() {
            points.clear();
            for (obstacle, shift) in self.bodies.obstacles.iter().zip(&self.bodies.shifts) {
                let shift = [shift.now, shift.next][k];
                let places = CollisionMesh::places_of(obstacle, (frame + k) as f64 / rate);
                points.extend(places.map(|p| shift.of(p)));
            }
        }
        let bodies = self.bodies.obstacles.iter().zip(&self.bodies.shifts);
        for (own, (obstacle, shift)) in self.bodies.turns.iter_mut().zip(bodies) {
            let turn = |k: usize, shift: &Rigid| {
                shift.turn * obstacle.rigid_place((frame + k) as f64 / rate).0
            };
            let turned = turn(1, &shift.next) * turn(0, &shift.now).inverse();
            *own = DMat3::from_quat(turned) - DMat3::IDENTITY;
        }
    }

    /// Keeps what a substep changes.
    pub(crate) fn carry(&self, into: &mut Kept) {
        into.memory.clone_from(&self.memory);
        into.received.clone_from(&self.received);
    }

    /// Restores what [`Self::carry`] kept.
    pub(crate) fn put_back(&mut self, from: &Kept) {
        self.memory.clone_from(&from.memory);
        self.received.clone_from(&from.received);
        self.leave_out_released();
    }

    /// Has the candidates leave out what is released.
    fn leave_out_released(&mut self) {
        if self.candidates.released().list() != self.memory.released {
            self.candidates.release(&self.memory.released);
        }
    }

    /// Takes this for the memory that the last substep left. What is released of another scene is
    /// dropped.
    pub(crate) fn remember_saved(&mut self, mut memory: ContactMemory) {
        let (vertices, bodies) = (self.mass.len(), self.mesh.bodies().len());
        memory.released.retain(|one| {
            (one.vertex as usize) < vertices && (1..bodies).contains(&(one.body as usize))
        });
        if memory.still.len() != vertices {
            memory.still.clear();
        }
        self.received.are_known = false;
        self.received.carried.clear();
        self.memory = memory;
        self.leave_out_released();
    }

    /// What each obstacle received since [`Self::forget_received`], `[obstacles]`.
    pub(crate) fn received(&self) -> &[Impulse] {
        &self.received.all
    }

    /// Names of the obstacles that received momentum since [`Self::forget_received`].
    pub(crate) fn pushers(&self) -> Vec<String> {
        let pairs = self.bodies.obstacles.iter().zip(&self.received.all);
        let pushers = pairs.filter(|(_, received)| received.linear != DVec3::ZERO);
        pushers
            .map(|(obstacle, _)| obstacle.name().to_owned())
            .collect()
    }

    /// Begins to sum what obstacles receive anew.
    pub(crate) fn forget_received(&mut self) {
        self.received.all.fill(Impulse::ZERO);
        self.received.are_known = true;
    }

    /// Gap of a pair along a direction between its features, at these `points` `[m]`.
    fn gap_along(&self, pair: &Pair, gap: &Gap, points: &[DVec3]) -> f64 {
        let corners = pair.places(points).into_iter().zip(gap.weights);
        let extent: f64 = corners.map(|(p, weight)| weight * gap.normal.dot(p)).sum();
        extent - self.mesh.radius_of(pair)
    }

    /// Way that the closest point of a round body goes in the solve, because the body turns, from the cloth's
    /// `[m]`; along `normal`, the gap's direction.
    fn turned(&self, pair: &Pair, body: usize, normal: DVec3) -> DVec3 {
        match body.checked_sub(1) {
            Some(own) => {
                self.bodies.turns[own] * normal * (-self.mesh.radius_of(pair) * self.bodies.part)
            }
            None => DVec3::ZERO,
        }
    }

    fn update_inverse(&mut self, active: &ActiveHandles) {
        self.inverse.fill(0.0);
        for &v in active.system.unknown_vertices() {
            self.inverse[v as usize] = 1.0 / self.mass[v as usize];
        }
    }

    /// Number of the body that is not the cloth, or 0.
    fn other_body(&self, pair: &Pair) -> usize {
        let first = self.mesh.body_of(pair.corners[0]);
        first.max(self.mesh.body_of(pair.corners[3]))
    }

    /// A pair in words.
    fn name(&self, pair: &Pair) -> String {
        let feature = |corners: &[u32]| {
            let number = self.mesh.body_of(corners[0]);
            let body = &self.mesh.bodies()[number];
            let own = corners
                .iter()
                .map(|p| VertexId(p - body.points.start).to_string());
            let kind = ["vertex", "edge", "face"][corners.len() - 1];
            let feature = format!("{kind} {}", own.collect::<Vec<_>>().join("-"));
            match number.checked_sub(1).map(|k| &self.bodies.obstacles[k]) {
                None => feature,
                Some(round) if round.core().is_some() => format!("obstacle {:?}", round.name()),
                Some(mesh) => format!("{feature} of obstacle {:?}", mesh.name()),
            }
        };
        let (first, second) = pair.corners.split_at(pair.kind.split());
        format!("{} and {}", feature(first), feature(second))
    }
}
