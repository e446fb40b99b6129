//! Arrays that change from frame to frame: the last positions in a ring, the yaw of each cloth's
//! local frame, and the rigid motions of its handles.
//!
//! The processor computes the yaws and the motions. They follow from the handles alone, whose
//! positions it knows without asking the device.

use glam::Vec3;
use selvedge_model::{Carries, Carry, ClothGraph, Integration, ModelSpec, NodeFeature, Yaw};

use crate::cloths::UnionSizes;
use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, args};

/// Numbers of a [`Carry`]: from, to, cosine and sine of its turn.
const CARRY: usize = 8;

/// Numbers of [`Carries`].
const CARRIES: usize = 3 * CARRY;

/// Numbers of a cloth in a frame, as in `kernels/common.h`.
const CLOTH_NUMBERS: usize = 5;

/// Offsets of the rigid motions among the numbers of one step of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarryLayout {
    /// The motions that past accelerations are measured with.
    pub acceleration: usize,
    /// The motions that expected moves are measured with.
    pub expected: usize,
    /// The motion from the rest pose, then 1, or 0 where there are no handles.
    pub rest: usize,
    /// Numbers of a step; at least 1.
    pub count: usize,
}

impl CarryLayout {
    /// The layout that the features of a spec need.
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

/// The arrays of the arena that change from frame to frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameArrays {
    /// Positions `[slots, vertices, 3]` `[m]`.
    pub positions: Region,
    /// Slots of the ring: one for each frame that features are made from, and one for the next.
    pub slots: usize,
    /// The slot of the newest frame, `[1]`.
    pub newest: Region,
    /// Yaw and local gravity of each cloth, `[cloths, 5]`.
    pub numbers: Region,
    /// Rigid motions that features are measured with, `[cloths, steps, CarryLayout::count]`.
    carries: Region,
    /// Rigid motions of the integration, `[cloths, 24]`.
    pub last: Region,
    /// Next positions of the handles, `[handles, 3]` `[m]`.
    pub targets: Region,
    per_step: usize,
}

impl FrameArrays {
    /// Room for the frames of a union.
    pub fn new(plan: &mut Plan, spec: &ModelSpec, sizes: UnionSizes) -> Self {
        let slots = spec.history() + 1;
        let positions = plan.floats("positions", slots * sizes.vertices * 3);
        Self::on(plan, spec, sizes, positions)
    }

    /// Room for a frame of the ring `positions`, which it shares with other frames.
    pub fn on(plan: &mut Plan, spec: &ModelSpec, sizes: UnionSizes, positions: Region) -> Self {
        let slots = positions.count() / (3 * sizes.vertices).max(1);
        let per_step = sizes.cloths * CarryLayout::of(spec).count;
        Self {
            positions,
            slots,
            newest: plan.indices("newest frame", 1),
            numbers: plan.floats("local frames", sizes.cloths * CLOTH_NUMBERS),
            carries: plan.doubles("motions of handles", spec.window() * per_step),
            last: plan.doubles("next motion of handles", sizes.cloths * CARRIES),
            targets: plan.floats("targets of handles", 3 * sizes.handles),
            per_step,
        }
    }

    /// The rigid motions of the first `steps` steps.
    #[must_use]
    pub fn carries(&self, steps: usize) -> Region {
        self.carries.part(0..steps * self.per_step)
    }

    /// The arrays that are written from outside.
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

    /// The arguments `RING` of a kernel.
    pub(crate) fn ring(&self) -> Vec<NamedArgument> {
        args! {
            positions: self.positions,
            newest: self.newest,
            slots: self.slots,
            vertices: self.positions.count() / (3 * self.slots),
        }
    }

    /// One frame of the ring, `[vertices, 3]`.
    #[must_use]
    pub fn slot(&self, slot: usize) -> Region {
        let size = self.positions.count() / self.slots;
        self.positions.part(slot * size..(slot + 1) * size)
    }
}

/// The last positions and the next ones of the handles of one cloth.
#[derive(Clone, Copy, Debug)]
pub struct HandleFrames<'a> {
    /// Positions in the last frames, oldest first, `[history][handles]` `[m]`.
    pub past: &'a [Vec<Vec3>],
    /// Next positions, `[handles]` `[m]`.
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

    /// Adds the next cloth of the union, for a window of `steps` frames.
    ///
    /// # Panics
    /// When the number of frames of handles is not the history of the spec.
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
        handles: HandleFrames<'_>,
        now: usize,
    ) {
        let HandleFrames { past, next, yaw } = handles;
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

    /// Writes the local frames and the motions of the handles, but not their next positions.
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
