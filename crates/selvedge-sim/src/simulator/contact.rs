//! Contact of a simulator: its checks at the start and of frames that were made elsewhere, the
//! places of obstacles, and what it counted.

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandleTargets, Impulse, Rigid, Squeezed, StepError};
use selvedge_contact::Intersection;

use super::Simulator;
use super::error::SimulatorError;
use crate::contact::{Contact, FAR, Led, Shift, YieldedContact};

impl Simulator {
    /// Puts obstacles on their way from this frame to the next.
    pub(super) fn enter_frame(&mut self) {
        if let Some(contact) = &mut self.contact {
            contact.enter_frame(self.frame, self.scene.frame_rate);
        }
    }

    /// Checks that the thickness suits the mesh, and that nothing meets at the start.
    pub(super) fn check_contact(&self) -> Result<(), SimulatorError> {
        let Some(contact) = &self.contact else {
            return Ok(());
        };
        let lengths = self.scene.mesh.pattern().edge_lengths();
        let thickness = contact.largest_thickness();
        let short = lengths.iter().filter(|l| thickness > 0.25 * **l).count();
        let all = self.scene.mesh.topology().edges().iter().zip(&lengths);
        let shortest = all.min_by(|a, b| a.1.total_cmp(b.1));
        if let (Some((edge, length)), true) = (shortest, short > 0) {
            return Err(SimulatorError::Thickness {
                thickness,
                edge: *length,
                ends: edge.vertices,
                short,
                edges: lengths.len(),
            });
        }
        self.check_meeting(self.frame, &self.state.positions)
    }

    /// Checks that nothing meets in `positions` `[m]`, `[vertices]`, of frame `frame`.
    pub(super) fn check_meeting(
        &self,
        frame: usize,
        positions: &[DVec3],
    ) -> Result<(), SimulatorError> {
        match self.meeting(|contact, rate| contact.intersections(positions, frame, rate)) {
            None => Ok(()),
            Some(Meeting { count, pairs, body }) => {
                Err(SimulatorError::Intersections { count, pairs, body })
            }
        }
    }

    /// The error of a frame in which the rounded cloth meets: where it is so far from the origin
    /// that rounding moves two points by as much as the gap that contact keeps.
    pub(super) fn meets_rounded(&self, frame: usize) -> Option<StepError> {
        let floor = self.scene.contact.as_ref()?.floor;
        let coordinates = self.rounded.iter().map(|p| p.abs().max_element());
        let largest = f64::from(coordinates.fold(0.0, f32::max));
        // Each of two points by half a unit in the last place along each axis.
        if 3.0_f64.sqrt() * largest * f64::from(f32::EPSILON) < floor {
            return None;
        }
        let Meeting { count, pairs, .. } = self.written_meeting(frame, &self.rounded)?;
        let rounded = self.rounded.iter().map(|p| p.as_dvec3());
        let distance = rounded.map(DVec3::length).fold(0.0, f64::max);
        Some(StepError::Rounded {
            frame,
            distance,
            count,
            pairs,
        })
    }

    /// Faces that meet in `positions` `[m]`, `[vertices]`, of frame `frame` as it is written.
    fn written_meeting(&self, frame: usize, positions: &[Vec3]) -> Option<Meeting> {
        self.meeting(|contact, rate| contact.written_intersections(positions, frame, rate))
    }

    /// Faces that meet, of those that `find` finds at a frame rate; none where there are none, or the
    /// scene has no contact.
    fn meeting(&self, find: impl Fn(&Contact, f64) -> Vec<Intersection>) -> Option<Meeting> {
        let contact = self.contact.as_ref()?;
        let found = find(contact, self.scene.frame_rate);
        if found.is_empty() {
            return None;
        }
        let pair = |faces: &[u32; 2]| {
            let [a, b] = faces.map(|face| contact.face_name(face));
            format!("{a} and {b}")
        };
        let shown: Vec<String> = found.iter().take(5).map(|f| pair(&f.faces)).collect();
        let more = if found.len() > 5 { ", and more" } else { "" };
        Some(Meeting {
            count: found.len(),
            pairs: shown.join(", ") + more,
            body: found.iter().find_map(|f| contact.body_name(f.faces[1])),
        })
    }

    /// Checks that nothing meets in `positions` `[m]`, `[vertices]`, made elsewhere as frame
    /// `frame`: exactly, of faces at that time. Without contact in the scene there is nothing to
    /// check.
    ///
    /// # Errors
    /// [`StepError::Intersections`] names faces that meet.
    pub fn check_apart(&self, frame: usize, positions: &[Vec3]) -> Result<(), StepError> {
        Self::refuse(frame, self.written_meeting(frame, positions))
    }

    fn refuse(frame: usize, meeting: Option<Meeting>) -> Result<(), StepError> {
        match meeting {
            None => Ok(()),
            Some(Meeting { count, pairs, .. }) => Err(StepError::Intersections {
                frame,
                count,
                pairs,
            }),
        }
    }

    /// Holds a frame that was made elsewhere to contact. From `from`, the frame `frame`, in which
    /// nothing meets, the cloth goes to `to` on straight ways, both `[m]`, `[vertices]`. Pairs of
    /// features that are not certified to stay apart for the whole way are pushed apart, by mass
    /// and with friction. Handles that hold in `targets` stay where `to` has them. The simulator's own state stays,
    /// but for contact that it released: it holds again for vertices that `from` has outside.
    /// Without contact in the scene every frame is free.
    ///
    /// # Errors
    /// [`StepError::Contact`], of the frame after `frame`, if pushing does not end; `to` is left as
    /// it was.
    pub fn lead(
        &mut self,
        frame: usize,
        from: &[Vec3],
        to: &mut [Vec3],
        targets: &HandleTargets,
    ) -> Result<Led, StepError> {
        if self.contact.is_none() {
            return Ok(Led::Free);
        }
        self.change_active(targets)?;
        let (from, mut end) = (wide(from), wide(to));
        let led = self.lead_wide(frame, &from, &mut end)?;
        if led == Led::Pushed {
            for (to, end) in to.iter_mut().zip(end) {
                *to = end.as_vec3();
            }
        }
        Ok(led)
    }

    /// As [`Self::lead`], of positions in double precision; `to` is of no use after an error.
    pub(crate) fn lead_wide(
        &mut self,
        frame: usize,
        from: &[DVec3],
        to: &mut [DVec3],
    ) -> Result<Led, StepError> {
        let Some(contact) = &mut self.contact else {
            return Ok(Led::Free);
        };
        contact.enter_frame(frame, self.scene.frame_rate);
        contact.take_back(from);
        let threads = self.threads.for_cloth(to.len());
        let active = &self.active;
        if threads.run(|| contact.lead(threads, active, from, to))? {
            Ok(Led::Pushed)
        } else {
            Ok(Led::Free)
        }
    }

    /// Leads the obstacle of this number over the next frame away from its own path, by a distance
    /// `[m]` or a rigid motion of where that is; its points go there straight.
    ///
    /// # Errors
    /// [`StepError::Obstacle`] for the number of no obstacle.
    pub fn lead_obstacle(
        &mut self,
        number: usize,
        away: impl Into<Rigid>,
    ) -> Result<(), StepError> {
        self.obstacle_shift(number)?.next = away.into();
        Ok(())
    }

    /// Puts the obstacle of this number at a distance `[m]` or by a rigid motion away from its own
    /// path at once, as if it had been there before.
    ///
    /// # Errors
    /// [`StepError::Intersections`] where it would meet the cloth, [`StepError::Obstacle`] for the number
    /// of none; it stays where it was.
    pub fn put_obstacle(&mut self, number: usize, away: impl Into<Rigid>) -> Result<(), StepError> {
        self.wake();
        let shift = self.obstacle_shift(number)?;
        let before = std::mem::replace(shift, Shift::at(away.into()));
        let (frame, positions) = (self.frame, &self.state.positions);
        let met = self.meeting(|contact, rate| contact.intersections(positions, frame, rate));
        let apart = Self::refuse(frame, met);
        if let (Err(_), Ok(shift)) = (&apart, self.obstacle_shift(number)) {
            *shift = before;
        }
        apart
    }

    /// Puts the first obstacles there, away from their own paths, unchecked.
    pub(super) fn shift_obstacles(&mut self, places: &[Rigid]) {
        for (number, place) in places.iter().enumerate() {
            if let Ok(shift) = self.obstacle_shift(number) {
                *shift = Shift::at(*place);
            }
        }
    }

    fn obstacle_shift(&mut self, number: usize) -> Result<&mut Shift, StepError> {
        let shifts = self.contact.as_mut().map(|c| &mut c.bodies.shifts[..]);
        let shifts = shifts.unwrap_or_default();
        let (frame, count) = (self.frame, shifts.len());
        shifts.get_mut(number).ok_or(StepError::Obstacle {
            frame,
            number,
            count,
        })
    }

    /// Motions from their own paths to where the obstacles are led in the next frame, `[obstacles]`.
    pub fn obstacle_leads(&self) -> Vec<Rigid> {
        let shifts = self.contact.iter().flat_map(|c| &c.bodies.shifts);
        shifts.map(|s| s.next).collect()
    }

    /// Motions of the obstacles away from their own paths now, `[obstacles]`.
    pub fn obstacle_offsets(&self) -> Vec<Rigid> {
        let shifts = self.contact.iter().flat_map(|c| &c.bodies.shifts);
        shifts.map(|s| s.now).collect()
    }

    /// Momentum that each obstacle received from the cloth over the last frame
    /// `[N s]`, `[obstacles]`. Obstacles go on as they are led, whatever they
    /// receive. Vertices that were held back give nothing.
    pub fn obstacle_impulses(&self) -> Vec<DVec3> {
        self.received().iter().map(|one| one.linear).collect()
    }

    /// The same with the angular momentum, `[obstacles]`.
    pub fn received(&self) -> &[Impulse] {
        self.contact.as_ref().map_or(&[], |c| c.received())
    }

    /// Points of all obstacles now `[m]`, those of the first obstacle first; none without contact.
    pub fn obstacle_points(&self) -> Vec<DVec3> {
        let rate = self.scene.frame_rate;
        let contact = self.contact.as_ref();
        contact.map_or_else(Vec::new, |c| c.mesh_points(self.frame, rate))
    }

    /// Smallest gap of each vertex to the rest of the cloth and to obstacles now `[m]`,
    /// `[vertices]`, [`FAR`] where there is none that small; none without contact. Neighbours in
    /// the mesh count as far.
    pub fn vertex_gaps(&self) -> Option<Vec<f64>> {
        let (frame, rate) = (self.frame, self.scene.frame_rate);
        let positions = &self.state.positions;
        let contact = self.contact.as_ref()?;
        Some(contact.vertex_gaps(positions, frame, rate, FAR))
    }

    /// Chooses what becomes of cloth without room from now on, in place of what the scene says.
    pub fn set_squeezed(&mut self, squeezed: Squeezed) {
        if let Some(contact) = &mut self.contact {
            contact.set_squeezed(squeezed);
        }
    }

    /// Contact that was released so far, because bodies left the cloth no room: it is not among
    /// [`Self::intersection_count`].
    pub fn yielded(&self) -> &[YieldedContact] {
        self.contact
            .as_ref()
            .map_or(&[], |contact| &contact.yielded)
    }

    /// Pairs of faces that meet now, exactly, of the cloth at its rounded positions with itself and
    /// with obstacles; 0 without contact.
    pub fn intersection_count(&self) -> usize {
        let (frame, rate) = (self.frame, self.scene.frame_rate);
        let met = |contact: &Contact| contact.written_intersections(&self.rounded, frame, rate);
        self.contact
            .as_deref()
            .map_or(0, |contact| met(contact).len())
    }
}

/// Positions in double precision.
fn wide(positions: &[Vec3]) -> Vec<DVec3> {
    positions.iter().map(|p| p.as_dvec3()).collect()
}

/// Faces that meet.
struct Meeting {
    count: usize,
    /// The first of them, named.
    pairs: String,
    /// The first obstacle that the cloth meets; none if it meets only itself.
    body: Option<String>,
}
