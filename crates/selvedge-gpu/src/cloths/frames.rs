//! Arrays that change from frame to frame: the last positions in a ring, and the yaw of each
//! cloth's local frame. The processor computes the yaws: they follow from the handles alone, whose
//! positions it knows without asking the device.

use glam::Vec3;
use selvedge_model::{ClothGraph, ModelSpec, Yaw};

use crate::cloths::UnionSizes;
use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, args};

/// Numbers of a cloth in a frame, as in `kernels/common.h`.
const CLOTH_NUMBERS: usize = 5;

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
    /// Next positions of the handles, `[handles, 3]` `[m]`.
    pub targets: Region,
}

impl FrameArrays {
    /// Room for the frames of a union.
    pub fn new(plan: &mut Plan, spec: &ModelSpec, sizes: UnionSizes) -> Self {
        let slots = spec.history() + 1;
        let positions = plan.floats("positions", slots * sizes.vertices * 3);
        Self::on(plan, sizes, positions)
    }

    /// Room for a frame of the ring `positions`, which it shares with other frames.
    pub fn on(plan: &mut Plan, sizes: UnionSizes, positions: Region) -> Self {
        Self {
            positions,
            slots: positions.count() / (3 * sizes.vertices).max(1),
            newest: plan.indices("newest frame", 1),
            numbers: plan.floats("local frames", sizes.cloths * CLOTH_NUMBERS),
            targets: plan.floats("targets of handles", 3 * sizes.handles),
        }
    }

    /// The arrays that are written from outside.
    #[must_use]
    pub fn regions(&self) -> [Region; 4] {
        [self.positions, self.newest, self.numbers, self.targets]
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

/// The numbers of all cloths of a union for one frame, on their way to the device.
#[derive(Clone, Debug, Default)]
pub struct FrameNumbers {
    numbers: Vec<f32>,
    targets: Vec<f32>,
}

impl FrameNumbers {
    /// Forgets all cloths.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds the next cloth of the union: the yaw of its newest frame, and the next positions of its
    /// handles `[m]`, `[handles]`.
    pub fn add(&mut self, graph: &ClothGraph, yaw: Yaw, next: &[Vec3]) {
        let gravity = yaw.to_local_f64(graph.environment().gravity).as_vec3();
        self.numbers.extend([yaw.cos() as f32, yaw.sin() as f32]);
        self.numbers.extend(gravity.to_array());
        self.targets.extend(next.iter().flat_map(|p| p.to_array()));
    }

    /// Writes all of it to the device.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// When not all cloths of the union were added.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        frames: &FrameArrays,
        newest: usize,
    ) -> Result<(), DeviceError> {
        loaded.upload(frames.newest, &[newest as u32])?;
        self.upload_local_frames(loaded, frames)?;
        loaded.put(frames.targets, &self.targets)
    }

    /// Writes the local frames, but not the next positions of the handles.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// As [`Self::upload`].
    pub fn upload_local_frames(
        &self,
        loaded: &mut dyn Loaded,
        frames: &FrameArrays,
    ) -> Result<(), DeviceError> {
        loaded.put(frames.numbers, &self.numbers)
    }
}
