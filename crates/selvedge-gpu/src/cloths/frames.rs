//! What changes from frame to frame: the last positions, in a ring in the arena, and what follows from
//! the handles alone, which the CPU computes: the yaw of each cloth's local frame and the rigid motions of
//! its handles.
//!
//! Handles go where they are told, so that the CPU knows them without asking the device.

use glam::Vec3;
use selvedge_model::{Carries, Carry, ClothGraph, Integration, ModelSpec, NodeFeature, Yaw};

use crate::cloths::UnionSizes;
use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::{Plan, Region};

/// Numbers of a [`Carry`]: from, to, cosine and sine of its turn.
const CARRY: usize = 8;

/// Numbers of [`Carries`].
const CARRIES: usize = 3 * CARRY;

/// Numbers of a cloth in a frame, as in `kernels/common.h`.
const CLOTH_NUMBERS: usize = 5;

/// Where the rigid motions of a step of the window stand, in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarryLayout {
    /// Those that past accelerations are measured with.
    pub acceleration: usize,
    /// Those that expected moves are measured with.
    pub expected: usize,
    /// That from the rest pose, then 1, or 0 where there are no handles.
    pub rest: usize,
    /// Numbers of a step; at least 1.
    pub count: usize,
}

impl CarryLayout {
    /// Those that the features of a spec need.
    #[must_use]
    pub fn of(spec: &ModelSpec) -> Self {
        let carried = matches!(spec.integration, Integration::Carried { .. });
        let has = |feature| spec.node_features.contains(&feature);
        let of = |feature| if carried && has(feature) { CARRIES } else { 0 };
        let expected = of(NodeFeature::Acceleration);
        let rest = expected + of(NodeFeature::ExpectedMove);
        let of_rest = if has(NodeFeature::RestOffset) {
            CARRY + 1
        } else {
            0
        };
        Self {
            acceleration: 0,
            expected,
            rest,
            count: (rest + of_rest).max(1),
        }
    }
}

/// What changes from frame to frame, in the arena.
#[derive(Clone, Copy, Debug)]
pub struct FrameArrays {
    /// Positions `[slots, vertices, 3]` `[m]`.
    pub positions: Region,
    /// Frames in the ring: those that features are made from, and the next.
    pub slots: usize,
    /// Which of them is the newest, `[1]`.
    pub newest: Region,
    /// Yaw and local gravity of each cloth, `[cloths, 5]`.
    pub numbers: Region,
    /// Rigid motions that features are measured with, `[cloths, steps, CarryLayout::count]`.
    carries: Region,
    /// Rigid motions of the integration, `[cloths, 24]`.
    pub last: Region,
    /// Where the handles go, `[handles, 3]` `[m]`.
    pub targets: Region,
    per_step: usize,
}

impl FrameArrays {
    /// Room for the frames of a union.
    pub fn new(plan: &mut Plan, spec: &ModelSpec, sizes: UnionSizes) -> Self {
        let slots = spec.history() + 1;
        let positions = plan.floats("positions", slots * sizes.vertices * 3);
        Self::on(plan, spec, sizes, (positions, slots))
    }

    /// Room for a frame of a ring that it shares with others, of so many slots.
    pub fn on(
        plan: &mut Plan,
        spec: &ModelSpec,
        sizes: UnionSizes,
        (positions, slots): (Region, usize),
    ) -> Self {
        let per_step = sizes.cloths * CarryLayout::of(spec).count;
        Self {
            positions,
            slots,
            newest: plan.indices("newest frame", 1),
            numbers: plan.floats("local frames", sizes.cloths * CLOTH_NUMBERS),
            carries: plan.doubles("motions of handles", spec.node_window() * per_step),
            last: plan.doubles("next motion of handles", sizes.cloths * CARRIES),
            targets: plan.floats("targets of handles", 3 * sizes.handles),
            per_step,
        }
    }

    /// The rigid motions of so many steps.
    #[must_use]
    pub fn carries(&self, steps: usize) -> Region {
        self.carries.part(0..steps * self.per_step)
    }

    /// All that is written from outside.
    #[must_use]
    pub fn regions(&self) -> [Region; 6] {
        [
            self.positions,
            self.newest,
            self.numbers,
            self.carries,
            self.last,
            self.targets,
        ]
    }

    /// One frame of the ring, `[vertices, 3]`.
    #[must_use]
    pub fn slot(&self, slot: usize) -> Region {
        let size = self.positions.count() / self.slots;
        self.positions.part(slot * size..(slot + 1) * size)
    }
}

/// What the handles of one cloth did and do.
#[derive(Clone, Copy, Debug)]
pub struct HandleFrames<'a> {
    /// Where they were in the last frames, oldest first, `[history][handles]` `[m]`.
    pub past: &'a [Vec<Vec3>],
    /// Where they go, `[handles]` `[m]`.
    pub next: &'a [Vec3],
    /// The yaw of the newest frame.
    pub yaw: Yaw,
}

/// The numbers of all cloths of a union for one frame, on their way to the device.
#[derive(Clone, Debug, Default)]
pub struct FrameNumbers {
    numbers: Vec<f32>,
    carries: Vec<f64>,
    last: Vec<f64>,
    targets: Vec<f32>,
}

impl FrameNumbers {
    /// Forgets all cloths.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds the next cloth of the union, for a window of so many steps.
    ///
    /// # Panics
    /// When there are not as many frames of handles as the spec looks back.
    pub fn add(
        &mut self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        handles: HandleFrames<'_>,
        steps: usize,
    ) {
        let HandleFrames { past, next, yaw } = handles;
        assert_eq!(past.len(), spec.history(), "frames of handles");
        let gravity = yaw.to_local_f64(graph.environment().gravity).as_vec3();
        self.numbers.extend([yaw.cos() as f32, yaw.sin() as f32]);
        self.numbers.extend(gravity.to_array());
        let newest = past.len() - 1;
        for now in past.len() - steps..past.len() {
            self.add_step(spec, graph, handles, now);
        }
        let pair = [newest - 1, newest].map(|frame| past[frame].iter().copied());
        push_carries(&mut self.last, &Carries::new(graph, pair, next, yaw));
        self.targets.extend(next.iter().flat_map(|p| p.to_array()));
    }

    fn add_step(
        &mut self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        HandleFrames { past, next, yaw }: HandleFrames<'_>,
        now: usize,
    ) {
        let (layout, first) = (CarryLayout::of(spec), self.carries.len());
        let has = |feature| spec.node_features.contains(&feature);
        let carried = matches!(spec.integration, Integration::Carried { .. });
        let at = |frame: usize| past[frame].iter().copied();
        if carried && has(NodeFeature::Acceleration) {
            let pair = [at(now - 2), at(now - 1)];
            let carries = Carries::new(graph, pair, &past[now], yaw);
            push_carries(&mut self.carries, &carries);
        }
        if carried && has(NodeFeature::ExpectedMove) {
            let to = past.get(now + 1).map_or(next, |handles| handles);
            let carries = Carries::new(graph, [at(now - 1), at(now)], to, yaw);
            push_carries(&mut self.carries, &carries);
        }
        if has(NodeFeature::RestOffset) {
            let handles = &past[now];
            let turned = graph.frame().yaw(handles, yaw);
            let carry = Carry::from_rest(graph, handles, turned);
            push_carry(&mut self.carries, &carry);
            let some = if handles.is_empty() { 0.0 } else { 1.0 };
            self.carries.push(some);
        }
        self.carries.resize(first + layout.count, 0.0);
    }

    /// Writes all of it to the device.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// When not all cloths of the union were added, or with other windows.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        frames: &FrameArrays,
        newest: usize,
    ) -> Result<(), DeviceError> {
        loaded.upload(frames.newest, &[newest as u32])?;
        self.upload_motions(loaded, frames)?;
        loaded.put(frames.targets, &self.targets)
    }

    /// Writes what features and the integration are measured with, but not where handles go.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// As [`Self::upload`].
    pub fn upload_motions(
        &self,
        loaded: &mut dyn Loaded,
        frames: &FrameArrays,
    ) -> Result<(), DeviceError> {
        let carries = frames.carries.part(0..self.carries.len());
        loaded.put(frames.numbers, &self.numbers)?;
        loaded.put_doubles(carries, &self.carries)?;
        loaded.put_doubles(frames.last, &self.last)
    }
}

fn push_carry(to: &mut Vec<f64>, carry: &Carry) {
    to.extend(carry.from.to_array());
    to.extend(carry.to.to_array());
    to.extend([carry.turn.cos(), carry.turn.sin()]);
}

fn push_carries(to: &mut Vec<f64>, carries: &Carries) {
    for carry in [&carries.to_next, &carries.from_before, &carries.from_rest] {
        push_carry(to, carry);
    }
}
