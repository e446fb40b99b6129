//! The cloth that moves: one or two steppers with the same handles, and their strain and times.

use std::collections::VecDeque;

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandleTargets, Handles};
use web_time::Instant;

use crate::mover::{Influences, LiveError, LiveStepper, Mover, MoverKind, Start};
use crate::state::TrackState;
use crate::strain_gauge::StrainGauge;
use crate::workshop::ReadyCloth;

/// Frames that are remembered, so that another stepper can take over in mid-motion.
const REMEMBERED: usize = 16;

/// The part of an offset that is left after a frame, and the offset that counts as none `[m]`.
const FADING: f64 = 0.94;
const NEAR: f64 = 1e-4;

/// Frames for which a stand-in is shown.
const SHOWN: usize = 30;

/// The weight of a new time of a step in the mean.
const SMOOTHING: f64 = 0.1;

/// The cloth that moves.
pub(crate) struct LiveCloth {
    ready: Box<ReadyCloth>,
    mover: Mover,
    influences: Influences,
    /// The steppers of the mover; at least one.
    all: Vec<Driven>,
    gauge: StrainGauge,
    frame: usize,
}

/// One stepper.
struct Driven {
    kind: MoverKind,
    stepper: Box<dyn LiveStepper>,
    /// The last frames, oldest first.
    recent: VecDeque<Vec<Vec3>>,
    /// The distance of its handles from the hands `[m]`, `[handles]`; fades.
    offsets: Vec<DVec3>,
    step_ms: Option<f64>,
    strain: f64,
    /// What stood in for it last, and in which frame.
    stood_in: Option<(&'static str, usize)>,
    stopped: Option<String>,
    /// The frame of the cloth that it has come to.
    reached: usize,
}

impl LiveCloth {
    /// A cloth at its beginning. Where `mover` cannot move it the physics does, and the error is
    /// returned beside it.
    pub(crate) fn new(
        ready: Box<ReadyCloth>,
        mover: Mover,
    ) -> Result<(Self, Option<LiveError>), LiveError> {
        let influences = Influences {
            handles: ready.cloth.handles().clone(),
            environment: ready.environment,
        };
        let gauge = StrainGauge::new(&ready.cloth);
        let (mover, all, problem) = match at_beginning(&ready, mover, &influences, &gauge) {
            Ok(all) => (mover, all, None),
            Err(problem) if mover == Mover::Physics => return Err(problem),
            Err(problem) => {
                let mover = Mover::Physics;
                let all = at_beginning(&ready, mover, &influences, &gauge)?;
                (mover, all, Some(problem))
            }
        };
        let live = Self {
            ready,
            mover,
            influences,
            all,
            gauge,
            frame: 0,
        };
        Ok((live, problem))
    }

    /// Back to the beginning, with the handles of the scene; the wind stays.
    pub(crate) fn restart(&mut self) -> Result<(), LiveError> {
        let influences = Influences {
            handles: self.ready.cloth.handles().clone(),
            environment: self.influences.environment,
        };
        self.all = at_beginning(&self.ready, self.mover, &influences, &self.gauge)?;
        (self.influences, self.frame) = (influences, 0);
        Ok(())
    }

    /// Continues with `mover`. A stepper of its kind stays; one that joins takes up the motion of
    /// the leader, also where the leader has stopped.
    pub(crate) fn set_mover(&mut self, mover: Mover) -> Result<(), LiveError> {
        let leader = self.leader();
        let frames: Vec<Vec<Vec3>> = leader.recent.iter().cloned().collect();
        let offsets = leader.offsets.clone();
        let mut joining = Vec::new();
        for &kind in mover.kinds() {
            if !self.all.iter().any(|one| one.is_usable(kind)) {
                let stepper =
                    self.ready
                        .movers
                        .start(kind, Start::Frames(&frames), &self.influences)?;
                let recent = frames.iter().cloned().collect();
                joining.push(Driven {
                    offsets: offsets.clone(),
                    reached: self.frame,
                    ..Driven::new(kind, stepper, recent, &self.gauge)
                });
            }
        }
        joining.extend(std::mem::take(&mut self.all));
        for &kind in mover.kinds() {
            if let Some(at) = joining.iter().position(|one| one.is_usable(kind)) {
                self.all.push(joining.swap_remove(at));
            }
        }
        self.mover = mover;
        Ok(())
    }

    /// Continues with other handles. One with a number in `kept` was the handle of that number
    /// before.
    pub(crate) fn set_handles(
        &mut self,
        handles: Handles,
        kept: &[Option<usize>],
    ) -> Result<(), LiveError> {
        let influences = Influences {
            handles,
            ..self.influences
        };
        self.change(influences, kept)
    }

    /// Continues in another wind `[m/s]`.
    pub(crate) fn set_wind(&mut self, wind: DVec3) -> Result<(), LiveError> {
        let mut influences = self.influences.clone();
        influences.environment.wind = wind;
        let kept: Vec<Option<usize>> = (0..influences.handles.len()).map(Some).collect();
        self.change(influences, &kept)
    }

    /// Continues with the same handles. Those that were `free`, `[handles]`, are attached to the cloth
    /// at its present place.
    pub(crate) fn take_hold_again(&mut self, free: &[bool]) -> Result<(), LiveError> {
        let kept = |(handle, free): (usize, &bool)| (!free).then_some(handle);
        let kept: Vec<Option<usize>> = free.iter().enumerate().map(kept).collect();
        self.change(self.influences.clone(), &kept)
    }

    /// Handles that the motion lets take hold again, marked in `taken`, do so of each cloth at its own
    /// place.
    pub(crate) fn take_hold_in_each(&mut self, taken: impl Iterator<Item = bool>) {
        let kept = taken
            .enumerate()
            .map(|(handle, taken)| (!taken).then_some(handle));
        let kept: Vec<Option<usize>> = kept.collect();
        if kept.contains(&None) {
            self.take_hold(&kept);
        }
    }

    fn change(&mut self, influences: Influences, kept: &[Option<usize>]) -> Result<(), LiveError> {
        let changed = self.all.iter().map(|one| one.stepper.changed(&influences));
        let changed: Result<Vec<_>, LiveError> = changed.collect();
        for (one, stepper) in self.all.iter_mut().zip(changed?) {
            one.stepper = stepper;
        }
        self.influences = influences;
        self.take_hold(kept);
        Ok(())
    }

    /// Takes hold of each vertex at its own place in each cloth, though all follow one hand. A
    /// handle that is `kept` stays as far from the hand as it was.
    fn take_hold(&mut self, kept: &[Option<usize>]) {
        let places = self.places();
        for one in &mut self.all {
            let own = self.influences.handles.select(one.stepper.positions());
            let apart = |(own, place): (&Vec3, &DVec3)| own.as_dvec3() - *place;
            let apart = own.iter().zip(&places).map(apart);
            let offset = |(apart, kept): (DVec3, &Option<usize>)| match kept {
                Some(number) => one.offsets.get(*number).copied().unwrap_or_default(),
                None => apart,
            };
            let offsets = apart.zip(kept).map(offset).collect();
            one.offsets = offsets;
        }
    }

    /// The stepper whose cloth the hands are at: the first that moves or, where none does, the last
    /// to have stopped.
    fn leader(&self) -> &Driven {
        let moving = self.all.iter().find(|one| one.stopped.is_none());
        let last = || self.all.iter().max_by_key(|one| one.reached);
        moving.or_else(last).unwrap_or(&self.all[0])
    }

    /// Steps by one frame, the handles to `targets` of a hand or of a motion. A stepper that fails
    /// stops; the other continues. Returns what to tell people of the first that has stopped now.
    pub(crate) fn step(&mut self, targets: &HandleTargets, by_hand: bool) -> Option<String> {
        self.frame += 1;
        let mut first = None;
        for one in &mut self.all {
            one.stepper.led_by_hand(by_hand);
            let stopped = one.step(targets, &self.gauge, self.frame);
            first = first.or(stopped);
        }
        first
    }

    /// Returns true while a stepper moves.
    pub(crate) fn is_moving(&self) -> bool {
        self.all.iter().any(|one| one.stopped.is_none())
    }

    pub(crate) fn ready(&self) -> &ReadyCloth {
        &self.ready
    }

    pub(crate) fn mover(&self) -> Mover {
        self.mover
    }

    pub(crate) fn influences(&self) -> &Influences {
        &self.influences
    }

    /// Frames since the beginning.
    pub(crate) fn frame(&self) -> usize {
        self.frame
    }

    /// Positions now `[m]`, `[tracks][vertices]`.
    pub(crate) fn positions(&self) -> Vec<&[Vec3]> {
        self.all.iter().map(|one| one.stepper.positions()).collect()
    }

    /// Present places of the handles in the cloth that the hands are at `[m]`, `[handles]`.
    pub(crate) fn places(&self) -> Vec<DVec3> {
        let positions = self.leader().stepper.positions();
        let places = self.influences.handles.of(positions);
        places.map(|p| p.as_dvec3()).collect()
    }

    /// As [`Self::places`], as exactly as the stepper has them.
    pub(crate) fn handle_places(&self) -> Vec<DVec3> {
        self.leader().stepper.handle_places()
    }

    /// Targets that a frame of a motion has.
    pub(crate) fn samples(&self) -> usize {
        let each = self.all.iter().map(|one| one.stepper.samples());
        each.max().unwrap_or(1)
    }

    /// Leads the bodies over the next frame to `offsets` `[m]` from their own paths, `[bodies]`.
    pub(crate) fn lead_bodies(&mut self, offsets: &[DVec3]) {
        for one in &mut self.all {
            for (number, offset) in offsets.iter().enumerate() {
                one.stepper.lead_body(number, *offset);
            }
        }
    }

    /// Puts a body at `offset` `[m]` from its own path at once.
    pub(crate) fn put_body(&mut self, number: usize, offset: DVec3) -> Result<(), LiveError> {
        let mut each = self.all.iter_mut();
        each.try_for_each(|one| one.stepper.put_body(number, offset))
    }

    /// Points of all bodies now `[m]`.
    pub(crate) fn body_points(&self) -> Vec<Vec3> {
        self.leader().stepper.body_points()
    }

    /// Offsets of the bodies where what was led had no room in the last frame.
    pub(crate) fn blocked(&self) -> Option<Vec<DVec3>> {
        self.leader().stepper.blocked()
    }

    /// Momentum that each body received in the last frame `[N s]`, `[bodies]`; empty where there
    /// are none.
    pub(crate) fn impulses(&self) -> Vec<DVec3> {
        self.leader().stepper.impulses()
    }

    /// Smallest gap of each vertex of each cloth `[m]`, `[tracks][vertices]`; 0 vertices where
    /// nothing touches.
    pub(crate) fn gaps(&self) -> Vec<Vec<f32>> {
        let each = self.all.iter();
        each.map(|one| one.stepper.gaps().unwrap_or_default())
            .collect()
    }

    pub(crate) fn tracks(&self) -> Vec<TrackState> {
        self.all.iter().map(|one| one.track(&self.gauge)).collect()
    }
}

/// The steppers of `mover` at the beginning of a cloth.
fn at_beginning(
    ready: &ReadyCloth,
    mover: Mover,
    influences: &Influences,
    gauge: &StrainGauge,
) -> Result<Vec<Driven>, LiveError> {
    let one = |&kind: &MoverKind| {
        let stepper = ready.movers.start(kind, Start::Beginning, influences)?;
        let recent = VecDeque::from([stepper.positions().to_vec()]);
        Ok(Driven::new(kind, stepper, recent, gauge))
    };
    mover.kinds().iter().map(one).collect()
}

impl Driven {
    fn new(
        kind: MoverKind,
        stepper: Box<dyn LiveStepper>,
        recent: VecDeque<Vec<Vec3>>,
        gauge: &StrainGauge,
    ) -> Self {
        Self {
            kind,
            strain: gauge.largest(stepper.positions()),
            stepper,
            recent,
            offsets: Vec::new(),
            step_ms: None,
            stopped: None,
            stood_in: None,
            reached: 0,
        }
    }

    fn is_usable(&self, kind: MoverKind) -> bool {
        self.kind == kind && self.stopped.is_none()
    }

    /// One step, to `frame` of the cloth. Returns what to tell people where it stops.
    fn step(
        &mut self,
        targets: &HandleTargets,
        gauge: &StrainGauge,
        frame: usize,
    ) -> Option<String> {
        if self.stopped.is_some() {
            return None;
        }
        let shifted = self.shifted(targets);
        let started = Instant::now();
        if let Err(error) = self.stepper.step(shifted.as_ref().unwrap_or(targets)) {
            let remedy = match self.kind {
                MoverKind::Model => "reset, or let the solver take over",
                MoverKind::Physics => "reset",
            };
            self.stopped = Some(error.to_string());
            return Some(format!("{} stopped: {error} ({remedy})", self.name()));
        }
        self.reached = frame;
        if let Some(what) = self.stepper.stand_in() {
            self.stood_in = Some((what, frame));
        }
        let now = 1e3 * started.elapsed().as_secs_f64();
        let before = self.step_ms.unwrap_or(now);
        self.step_ms = Some(before + SMOOTHING * (now - before));
        let positions = self.stepper.positions();
        self.strain = gauge.largest(positions);
        let mut oldest = match self.recent.len() {
            REMEMBERED.. => self.recent.pop_front().unwrap_or_default(),
            _ => Vec::new(),
        };
        oldest.clear();
        oldest.extend_from_slice(positions);
        self.recent.push_back(oldest);
        None
    }

    /// The targets for this cloth, where they differ from those of the hands.
    fn shifted(&mut self, targets: &HandleTargets) -> Option<HandleTargets> {
        let far = self.offsets.iter().any(|offset| offset.length() > NEAR);
        if !far || self.offsets.len() != targets.handle_count() {
            return None;
        }
        let end = targets.end().iter().zip(&mut self.offsets);
        let positions = end.map(|(target, offset)| {
            *offset *= FADING;
            *target + *offset
        });
        let shifted = HandleTargets::at_frame_end(positions.collect()).ok()?;
        shifted.releasing(targets.let_go()).ok()
    }

    fn name(&self) -> &'static str {
        match self.kind {
            MoverKind::Model => "Learned model",
            MoverKind::Physics => "Physics",
        }
    }

    fn track(&self, gauge: &StrainGauge) -> TrackState {
        TrackState {
            name: self.name().to_owned(),
            kind: Some(self.kind),
            step_ms: self.step_ms.unwrap_or(0.0),
            strain: self.strain,
            drape: gauge.drape(self.stepper.positions()),
            stand_in: self
                .stood_in
                .filter(|(_, frame)| self.reached - frame < SHOWN)
                .map(|(what, _)| what),
            stopped: self.stopped.clone(),
        }
    }
}
