//! Contact of the cloth with obstacles and with itself: push implicitly, certify, project, else
//! shorten the substep. No state that leaves this module intersects, if none came in that did.
//!
//! Pairs that are near, or would meet within the substep, push in its linear solve
//! ([`touches`], [`barrier`], [`friction`]). Then every pair that could come near is certified to
//! stay apart on the way from the start to the end ([`separation`]). Pairs that are not are pushed
//! apart, by mass; if that does not end, vertices are held back, or the substep is divided.

mod arcsim;
mod barrier;
mod clearances;
mod find;
mod friction;
mod gauge;
mod led;
mod memory;
mod received;
mod separation;
mod squeezed;
mod touches;

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    ContactLaw, ContactMemory, ContactSettings, Obstacle, Pushing, Scene, StepError, Touching,
    VertexId,
};
use selvedge_contact::{Candidates, Intersection, Kind, Pair, Passage, Reach, Surface};

use crate::active_handles::ActiveHandles;
use crate::integrator::History;
use crate::solver::SolveError;
use crate::state::State;
use crate::threads::Threads;
use clearances::Clearances;
pub use gauge::{ContactGauge, FrameContact};
pub(crate) use led::Shift;
pub use led::{FAR, Led};
pub(crate) use memory::of_saved;
use squeezed::WayOut;
pub use squeezed::YieldedContact;
pub(crate) use touches::{Touches, to_single};

/// Times that a solve is repeated, at most, with pairs that met unexpectedly and without those that
/// pulled.
const REPEATS: usize = 8;

/// Distance that points may stray from their expected way, as a part of the thickness.
const SLACK: f64 = 1.0;
/// Times that the slack doubles, at most, where candidates are found again for the same solve: what
/// meets ends elsewhere than was expected, and elsewhere again when the solve is repeated.
const WIDENINGS: u32 = 3;

/// Distance beyond the end of a solve for which candidates are found, should all points go on as
/// they go, in units of the thickness, at most: what is fast has too many candidates.
const FARTHEST_AHEAD: f64 = 4.0;

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
    /// Solves by backward Euler in place of a second-order formula, because what touches changed.
    pub fell_back: u64,
    /// Pairs that push now.
    pub touching: u64,
}

/// A substep to be taken.
#[derive(Clone, Copy)]
pub(crate) struct Span<'a> {
    /// Length `[s]`.
    pub(crate) dt: f64,
    /// Start of the substep as a part of the frame.
    pub(crate) from: f64,
    /// End of the substep as a part of the frame.
    pub(crate) to: f64,
    /// Targets of the active handles at the end `[m]`.
    pub(crate) targets: &'a [DVec3],
    pub(crate) threads: Threads,
    /// True if vertices may be held back where pushing does not end.
    pub(crate) may_hold: bool,
    /// True if an error is final: contact with obstacles is released before that.
    pub(crate) is_last: bool,
}

/// The touches of a solve.
struct Found {
    touches: Touches,
    /// The pairs, in ascending order.
    set: Vec<Touching>,
    /// The features that push, in order.
    pushing: Vec<Pushing>,
}

/// What a substep changes of contact.
#[derive(Clone, Debug, Default)]
pub(crate) struct Carried {
    memory: ContactMemory,
    received: received::Received,
}

/// Contact in a scene.
pub(crate) struct Contact {
    settings: ContactSettings,
    obstacles: Vec<Obstacle>,
    /// Distance of each obstacle from its own path, `[obstacles]`.
    pub(crate) shifts: Vec<Shift>,
    surface: Surface,
    candidates: Candidates,
    /// Searches for candidates since the start of the solve.
    searches: u32,
    /// ĝ of each body with the cloth `[m]`.
    thickness: Vec<f64>,
    /// Coefficient of friction of each body with the cloth.
    friction: Vec<f64>,
    /// ARCSim's law, where the scene asks for it.
    arcsim: Option<arcsim::Law>,
    /// Pairs that are too near in the flat cloth to push.
    neighbours: find::Neighbours,
    mass: Vec<f64>,
    /// Inverse masses, 0 where prescribed `[1/kg]`, `[points]`.
    inverse: Vec<f64>,
    /// Points of obstacles at the start and the end of the frame `[m]`.
    frame: [Vec<DVec3>; 2],
    /// Obstacles over the frame.
    carried: Vec<led::Carried>,
    /// Frames of obstacles in a solve, as [`selvedge_contact::Ways::rigid`] has them.
    rigid: Vec<Option<Passage>>,
    /// Number of the frame at its end.
    next_frame: usize,
    /// All points at the start and the end of a solve `[m]`.
    start: Vec<DVec3>,
    end: Vec<DVec3>,
    /// State at the start of a solve.
    before: State,
    /// What the last substep left, its lists in order.
    pub(crate) memory: ContactMemory,
    /// Direction of gravity, or zero.
    down: DVec3,
    /// Ways out of bodies that are let through, in this frame.
    ways_out: Vec<WayOut>,
    /// Contact that was released so far.
    pub(crate) yielded: Vec<YieldedContact>,
    pub(crate) counts: ContactCounts,
    received: received::Received,
    room: separation::Room,
    clearances: Clearances,
}

impl Contact {
    /// Contact of a validated scene; none if it has none. Vertex `mass` in kg, `[vertices]`.
    pub(crate) fn of(scene: &Scene, mass: &[f64]) -> Option<Self> {
        let settings = scene.contact?;
        let topology = scene.mesh.topology();
        let surface = Surface::new(topology, &scene.obstacles);
        let mut points = scene.mesh.positions().to_vec();
        for obstacle in &scene.obstacles {
            points.extend(obstacle.positions_at(0.0));
        }
        let obstacles = || scene.obstacles.iter();
        let own = |obstacle: &Obstacle| obstacle.thickness().unwrap_or(settings.thickness);
        let thickness = std::iter::once(settings.thickness).chain(obstacles().map(own));
        let rough = |obstacle: &Obstacle| obstacle.friction().min(settings.friction);
        let friction = std::iter::once(settings.friction).chain(obstacles().map(rough));
        let count = points.len();
        let obstacle_points = points[mass.len()..].to_vec();
        let corners: Vec<[DVec2; 3]> = scene.mesh.pattern().faces().collect();
        let candidates = Candidates::new(&surface, &points, settings.self_contact)
            .with_pattern(&surface, &corners);
        Some(Self {
            clearances: Clearances::new(count, candidates.slots()),
            candidates,
            searches: 0,
            thickness: thickness.collect(),
            friction: friction.collect(),
            arcsim: (settings.law == ContactLaw::Arcsim).then(|| arcsim::Law::new(scene, &surface)),
            neighbours: find::Neighbours::new(scene),
            mass: mass.to_vec(),
            inverse: vec![0.0; count],
            frame: [obstacle_points.clone(), obstacle_points],
            next_frame: 0,
            start: points.clone(),
            end: points,
            before: State::at_origin(mass.len()),
            memory: ContactMemory::default(),
            down: scene.environment.gravity.normalize_or_zero(),
            ways_out: Vec::new(),
            yielded: Vec::new(),
            counts: ContactCounts::default(),
            received: received::Received::none(scene.obstacles.len()),
            room: separation::Room::new(count),
            carried: vec![led::Carried::default(); scene.obstacles.len()],
            rigid: Vec::new(),
            obstacles: scene.obstacles.clone(),
            shifts: vec![Shift::default(); scene.obstacles.len()],
            settings,
            surface,
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
        points.extend(self.obstacle_points(frame, rate));
        self.candidates.intersections(&self.surface, &points)
    }

    /// Largest ĝ `[m]`.
    pub(crate) fn largest_thickness(&self) -> f64 {
        self.thickness.iter().copied().fold(0.0, f64::max)
    }

    /// A face in words.
    pub(crate) fn face_name(&self, face: u32) -> String {
        let bodies = self.surface.bodies();
        let body = bodies.partition_point(|body| body.faces.end <= face);
        let number = face - bodies[body].faces.start;
        match body.checked_sub(1) {
            None => format!("face {number} of the cloth"),
            Some(k) => format!("face {number} of obstacle {:?}", self.obstacles[k].name()),
        }
    }

    /// Name of the obstacle that has this face; none if the cloth has it.
    pub(crate) fn body_name(&self, face: u32) -> Option<String> {
        let bodies = self.surface.bodies();
        let body = bodies.partition_point(|body| body.faces.end <= face);
        let obstacle = body.checked_sub(1).map(|k| &self.obstacles[k]);
        obstacle.map(|obstacle| obstacle.name().to_owned())
    }

    /// Takes the places of obstacles for the step from `frame` on, at `rate` frames per second.
    pub(crate) fn enter_frame(&mut self, frame: usize, rate: f64) {
        self.next_frame = frame + 1;
        self.carry_obstacles(frame, rate);
    }

    /// Keeps what a substep changes.
    pub(crate) fn carry(&self, into: &mut Carried) {
        into.memory.clone_from(&self.memory);
        into.received.clone_from(&self.received);
    }

    /// Restores what [`Self::carry`] kept.
    pub(crate) fn put_back(&mut self, from: &Carried) {
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
        let (vertices, bodies) = (self.mass.len(), self.surface.bodies().len());
        memory.released.retain(|one| {
            (one.vertex as usize) < vertices && (1..bodies).contains(&(one.body as usize))
        });
        self.memory = memory;
        self.leave_out_released();
    }

    /// Drops what the last substep left, but for what is released: friction takes hold anew.
    pub(crate) fn forget(&mut self) {
        self.memory = ContactMemory {
            released: std::mem::take(&mut self.memory.released),
            ..ContactMemory::default()
        };
    }

    /// Momentum that each obstacle received since [`Self::forget_received`] `[N s]`, `[obstacles]`.
    pub(crate) fn received(&self) -> &[DVec3] {
        &self.received.all
    }

    /// Names of the obstacles that received momentum since [`Self::forget_received`].
    pub(crate) fn pushers(&self) -> Vec<String> {
        let pairs = self.obstacles.iter().zip(&self.received.all);
        let pushers = pairs.filter(|(_, momentum)| **momentum != DVec3::ZERO);
        pushers
            .map(|(obstacle, _)| obstacle.name().to_owned())
            .collect()
    }

    /// Begins to sum what obstacles receive anew.
    pub(crate) fn forget_received(&mut self) {
        self.received.all.fill(DVec3::ZERO);
    }

    /// Moves `state` by a substep. On an error the state is unusable.
    pub(crate) fn advance(
        &mut self,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<(), StepError> {
        let frame = self.next_frame;
        self.update_inverse(active);
        let (mut done, mut divisions) = (0.0, 0);
        while divisions < self.settings.max_divisions {
            let left = span.dt * (1.0 - done);
            let now = span.from + (span.to - span.from) * done;
            self.put_start(&state.positions, now, span.to);
            let solved = self.solve(left, span, active, state, history);
            solved.map_err(|error| error.at(frame))?;
            let repeated = self.repeat(left, span, active, state, history);
            repeated.map_err(|error| error.at(frame))?;
            let touches = &active.system.touches;
            self.received
                .add_forces(&self.surface, &self.end, left, touches);
            let outcome = self.separate(left, span, state)?;
            self.received.add_pushes(left);
            match outcome {
                separation::Outcome::GivenWay => {
                    self.received.take_back();
                    history.forget();
                    state.copy_from(&self.before);
                    active.system.repeat_start();
                }
                separation::Outcome::Settled { moved } => {
                    if moved {
                        history.forget();
                        active.system.forget_changes();
                    }
                    self.remember(1.0, active);
                    return Ok(());
                }
                separation::Outcome::Safe { part } => {
                    divisions += 1;
                    self.counts.divisions += 1;
                    history.forget();
                    active.system.forget_changes();
                    for (place, before) in state.positions.iter_mut().zip(&self.before.positions) {
                        *place = before.lerp(*place, part);
                    }
                    done += (1.0 - done) * part;
                    self.end[..state.positions.len()].copy_from_slice(&state.positions);
                    self.remember(part, active);
                    if divisions == self.settings.max_divisions
                        && span.is_last
                        && self.give_way(true)
                    {
                        divisions = 0;
                    }
                }
            }
        }
        Err(self.unseparated())
    }

    /// Certifies the end of a solve over `left` `[s]`, and repeats the solve with the pairs that it
    /// missed and without those that pulled.
    fn repeat(
        &mut self,
        left: f64,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<(), SolveError> {
        let mut is_certified = self.certify_solve(span.threads, &state.positions);
        let most = if self.arcsim.is_none() { REPEATS } else { 0 };
        for _ in 0..most {
            let touches = &mut active.system.touches;
            let has_released = self.release(touches);
            let has_caught = !is_certified && self.catch(touches);
            if !(has_released || has_caught) {
                break;
            }
            self.counts.repeated += 1;
            history.forget();
            state.copy_from(&self.before);
            active.system.repeat_start();
            active.advance(left, state, None, span.targets)?;
            is_certified = self.certify_solve(span.threads, &state.positions);
        }
        Ok(())
    }

    /// Leads the cloth from `from` to `to` `[m]`, both of `[vertices]`, on straight ways over the
    /// whole frame, where pairs that have no certificate are pushed apart. Returns true if vertices
    /// were moved. Handles of `active` are not.
    pub(crate) fn lead(
        &mut self,
        threads: Threads,
        active: &ActiveHandles,
        from: &[DVec3],
        to: &mut [DVec3],
    ) -> Result<bool, StepError> {
        self.update_inverse(active);
        self.put_start(from, 0.0, 1.0);
        let was_moved = self.push_apart(threads, to)?;
        to.copy_from_slice(&self.end[..to.len()]);
        Ok(was_moved)
    }

    /// One linear solve over `left` `[s]`, with what touches in it.
    fn solve(
        &mut self,
        left: f64,
        span: Span<'_>,
        active: &mut ActiveHandles,
        state: &mut State,
        history: &mut History,
    ) -> Result<(), SolveError> {
        self.find_candidates(left, state);
        let Found {
            touches,
            set,
            pushing,
        } = self.find_touches(span.threads, left);
        self.counts.solves += 1;
        self.counts.touching = touches.list.len() as u64;
        let jumps = memory::jumps(&self.memory.pushing, &pushing);
        self.memory
            .caught
            .retain(|caught| set.binary_search(&caught.of).is_ok());
        self.memory.pushing = pushing;
        active.system.touches = touches;
        self.before.copy_from(state);
        if active.system.touches.is_empty() && !jumps {
            return active.advance(left, state, Some(history), span.targets);
        }
        let looks_back = active.looks_back();
        if looks_back && !jumps && history.fits(left) {
            return active.advance(left, state, Some(history), span.targets);
        }
        if looks_back {
            self.counts.fell_back += 1;
            history.counts.all += 1;
            history.counts.fell_back += 1;
        }
        active.advance(left, state, None, span.targets)?;
        if jumps || !looks_back {
            history.forget();
        } else {
            history.keep(&self.before, left);
        }
        Ok(())
    }

    /// Puts the points at the start of a solve, and obstacles at its end; parts of the frame.
    fn put_start(&mut self, positions: &[DVec3], now: f64, end: f64) {
        self.room.begin();
        self.searches = 0;
        let cloth = positions.len();
        self.start[..cloth].copy_from_slice(positions);
        self.put_obstacles(now, end);
        let clearances = &mut self.clearances;
        self.candidates
            .start(&self.start, &self.rigid, |slot, way| {
                clearances.go(slot, way)
            });
    }

    fn update_inverse(&mut self, active: &ActiveHandles) {
        self.inverse[..self.mass.len()].fill(0.0);
        for &v in active.system.unknown_vertices() {
            self.inverse[v as usize] = 1.0 / self.mass[v as usize];
        }
    }

    /// Makes sure that the candidates hold for the way on which the cloth is.
    fn find_candidates(&mut self, left: f64, state: &State) {
        for (v, velocity) in state.velocities.iter().enumerate() {
            self.end[v] = self.start[v] + *velocity * left;
        }
        self.cover(true);
    }

    /// Finds the candidates where the points may have left their boxes: `anew`, or in addition to
    /// those there are, which keep their places.
    fn cover(&mut self, anew: bool) {
        if self.candidates.cover(&self.start, &self.end) {
            return;
        }
        let _span = tracing::trace_span!("candidates").entered();
        let mut reach = self.reach();
        reach.slack *= f64::from(1_u32 << self.searches.min(WIDENINGS));
        self.searches += 1;
        let (surface, ends) = (&self.surface, [&self.start[..], &self.end[..]]);
        // ARCSim's choice among pairs that are as near depends on their order.
        if self.arcsim.is_some() {
            self.candidates.find_all(surface, ends, reach);
        } else if anew {
            self.candidates.renew(surface, ends, reach);
        } else {
            self.candidates.widen(surface, ends, reach);
        }
        if self.clearances.follow(&mut self.candidates) {
            self.room.begin();
        }
    }

    /// Takes the way of a solve.
    fn look_ahead(&mut self) {
        let ends = [&self.start[..], &self.end[..]];
        let obstacles = self.carried.iter().zip(&self.surface.bodies()[1..]);
        let moving = obstacles.filter(|(carried, _)| carried.is_new());
        let moving = moving.map(|(_, body)| led::points(body));
        let moving = std::iter::once(0..self.mass.len()).chain(moving);
        self.clearances.look_ahead(&self.candidates, ends, moving);
    }

    fn reach(&self) -> Reach {
        let most = self.largest_thickness();
        // ARCSim chooses among all pairs within twice its thickness.
        let near = if self.arcsim.is_some() { 2.0 } else { 1.0 };
        Reach {
            gap: near * most,
            slack: SLACK * most,
            ahead: FARTHEST_AHEAD * most,
        }
    }

    /// Number of the body that is not the cloth, or 0.
    fn other_body(&self, pair: &Pair) -> usize {
        let first = self.surface.body_of(pair.corners[0]);
        first.max(self.surface.body_of(pair.corners[3]))
    }

    /// A pair in words.
    fn name(&self, pair: &Pair) -> String {
        let body = |point: u32| match self.surface.body_of(point).checked_sub(1) {
            None => String::new(),
            Some(k) => format!(" of obstacle {:?}", self.obstacles[k].name()),
        };
        let own = |point: u32| {
            let body = &self.surface.bodies()[self.surface.body_of(point)];
            VertexId(point - body.points.start)
        };
        let [a, b, c, d] = pair.corners;
        match pair.kind {
            Kind::VertexFace => {
                let (vertex, first) = (own(a), body(a));
                let corners = [b, c, d].map(own);
                let [b, c, e] = corners;
                format!("vertex {vertex}{first} and face {b}-{c}-{e}{}", body(d))
            }
            Kind::EdgeEdge => {
                let (first, second) = (body(a), body(c));
                let [a, b, c, d] = [a, b, c, d].map(own);
                format!("edge {a}-{b}{first} and edge {c}-{d}{second}")
            }
        }
    }
}
