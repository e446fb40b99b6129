//! Rollouts on a device: several cloths side by side as one graph, frame by frame.
//!
//! A frame is one schedule: features, network, integration. The processor uploads the next
//! positions of the handles and a few numbers that follow from them, and downloads the positions. A frame that is not finite is rejected: the cloths stay as they were.

mod opening;
mod plan;
pub mod stepper;

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::VertexId;
use selvedge_model::{ClothGraph, Model, Yaw};
use thiserror::Error;

use crate::cloths::UnionSizes;
use crate::cloths::frames::FrameNumbers;
use crate::device::{Device, DeviceError, Loaded, Precision, Prepared, require_memory};

use opening::{Cloth, open};

pub use opening::{Opening, OpeningError};
pub use plan::RolloutPlan;

/// Failure of a frame.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FrameError {
    #[error("cloth {cloth}: the position of vertex {vertex} is no longer finite")]
    NonFinite { cloth: usize, vertex: VertexId },
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// The state before a step, which [`Rollout::undo_step`] restores.
struct Undo {
    slot: usize,
    positions: Vec<Vec3>,
    /// Handles and yaw of each cloth, `[cloths]`.
    cloths: Vec<(Vec<Vec3>, Yaw)>,
}

/// Cloths that one model moves on a device.
pub struct Rollout {
    model: Arc<Model>,
    cloths: Vec<Cloth>,
    plan: RolloutPlan,
    loaded: Box<dyn Loaded>,
    frame: Prepared,
    slot: usize,
    numbers: FrameNumbers,
    positions: Vec<Vec3>,
    downloaded: Vec<u32>,
    /// State before the last step, while that step can be undone.
    undo: Option<Undo>,
}

impl Rollout {
    /// Starts cloths side by side.
    ///
    /// # Errors
    /// [`OpeningError`] for a start that does not fit its cloth, too little memory (with the size
    /// that would fit), or a device that fails.
    pub fn new(
        device: &dyn Device,
        model: Arc<Model>,
        openings: Vec<Opening<'_>>,
        precision: Precision,
    ) -> Result<Self, OpeningError> {
        let (cloths, frames) = open(&model, openings)?;
        let graphs: Vec<&ClothGraph> = cloths.iter().map(|cloth| &cloth.graph).collect();
        let sizes = UnionSizes::of(&graphs);
        let plan = RolloutPlan::new(model.network(), sizes);
        require_memory(device, "this rollout", plan.plan.bytes(), |free| {
            plan::what_fits(model.network(), sizes, free)
        })?;
        let mut loaded = device.load(&plan.program, &plan.plan, precision)?;
        plan.upload(&mut *loaded, &model, &graphs)?;
        for (slot, frame) in frames.iter().enumerate() {
            loaded.put(plan.frames.slot(slot), &flat(frame))?;
        }
        let newest_frame = frames.last().cloned().unwrap_or_default();
        loaded.put(plan.frames.slot(frames.len()), &flat(&newest_frame))?;
        let pack = loaded.prepare(&plan.pack)?;
        loaded.run(pack)?;
        let frame = loaded.prepare(&plan.frame)?;
        Ok(Self {
            slot: frames.len() - 1,
            positions: newest_frame,
            downloaded: vec![0; 3 * sizes.vertices],
            numbers: FrameNumbers::default(),
            undo: None,
            model,
            cloths,
            plan,
            loaded,
            frame,
        })
    }

    /// The model that moves the cloths.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// A cloth.
    ///
    /// # Panics
    /// When there is no such cloth.
    #[must_use]
    pub fn graph(&self, cloth: usize) -> &ClothGraph {
        &self.cloths[cloth].graph
    }

    /// Positions of a cloth now `[m]`, `[vertices]`.
    ///
    /// # Panics
    /// When there is no such cloth.
    #[must_use]
    pub fn positions(&self, cloth: usize) -> &[Vec3] {
        &self.positions[self.cloths[cloth].vertices.clone()]
    }

    /// Moves all cloths by one frame. `targets` are the next positions of the handles `[m]`,
    /// `[cloths][handles]`.
    ///
    /// # Errors
    /// [`FrameError`]; the cloths are left as they were.
    ///
    /// # Panics
    /// When there are not as many targets as handles.
    pub fn step(&mut self, targets: &[&[Vec3]]) -> Result<(), FrameError> {
        let yaws = self.begin(targets)?;
        let next = self.next_slot();
        self.loaded
            .download(self.plan.frames.slot(next), &mut self.downloaded)?;
        let words = self.downloaded.as_chunks::<3>().0;
        let found: Vec<Vec3> = words
            .iter()
            .map(|p| Vec3::from_array(p.map(f32::from_bits)))
            .collect();
        self.check(&found)?;
        self.commit(found, targets, &yaws);
        Ok(())
    }

    /// As [`Loaded::unrecorded`].
    #[must_use]
    pub fn unrecorded(&self) -> Option<&str> {
        self.loaded.unrecorded()
    }

    /// Starts the computation of a frame. Returns the yaws of the cloths.
    fn begin(&mut self, targets: &[&[Vec3]]) -> Result<Vec<Yaw>, DeviceError> {
        self.undo = None;
        assert_eq!(targets.len(), self.cloths.len(), "targets of every cloth");
        self.numbers.clear();
        let mut yaws = Vec::with_capacity(self.cloths.len());
        for (cloth, &next) in self.cloths.iter().zip(targets) {
            assert_eq!(next.len(), cloth.graph.handles().len(), "targets");
            let yaw = cloth.yaw_now();
            self.numbers.add(&cloth.graph, yaw, next);
            yaws.push(yaw);
        }
        self.numbers
            .upload(&mut *self.loaded, &self.plan.frames, self.slot)?;
        self.loaded.run(self.frame)?;
        Ok(yaws)
    }

    /// Accepts the frame that was computed.
    fn commit(&mut self, found: Vec<Vec3>, targets: &[&[Vec3]], yaws: &[Yaw]) {
        let before = Undo {
            slot: self.slot,
            positions: std::mem::replace(&mut self.positions, found),
            cloths: (self.cloths.iter_mut().zip(targets).zip(yaws))
                .map(|((cloth, targets), &yaw)| {
                    let handles = std::mem::replace(&mut cloth.handles, targets.to_vec());
                    (handles, std::mem::replace(&mut cloth.yaw, yaw))
                })
                .collect(),
        };
        self.slot = self.next_slot();
        self.undo = Some(before);
    }

    fn next_slot(&self) -> usize {
        (self.slot + 1) % self.plan.frames.slots
    }

    fn check(&self, positions: &[Vec3]) -> Result<(), FrameError> {
        assert_eq!(positions.len(), self.positions.len(), "positions");
        let Some(found) = positions.iter().position(|p| !p.is_finite()) else {
            return Ok(());
        };
        let of = |cloth: &Cloth| cloth.vertices.contains(&found);
        let cloth = self.cloths.iter().position(of).unwrap_or(0);
        let vertex = VertexId((found - self.cloths[cloth].vertices.start) as u32);
        Err(FrameError::NonFinite { cloth, vertex })
    }

    /// Replaces the newest frame by `positions` `[m]`, `[vertices]` of all cloths one after the
    /// other.
    ///
    /// # Errors
    /// [`FrameError`]; the cloths are left as they were.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    pub fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), FrameError> {
        self.check(positions)?;
        let slot = self.plan.frames.slot(self.slot);
        self.loaded.put(slot, &flat(positions))?;
        for cloth in &mut self.cloths {
            let handles = cloth.graph.handles();
            cloth.handles = handles.select(&positions[cloth.vertices.clone()]);
        }
        self.positions.copy_from_slice(positions);
        Ok(())
    }

    /// Takes `positions` `[m]`, `[vertices]` of all cloths one after the other, as the next frame.
    ///
    /// # Errors
    /// As [`Self::replace_frame`].
    ///
    /// # Panics
    /// As [`Self::replace_frame`].
    pub fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), FrameError> {
        self.check(positions)?;
        let next = self.next_slot();
        self.loaded
            .put(self.plan.frames.slot(next), &flat(positions))?;
        self.slot = next;
        for cloth in &mut self.cloths {
            cloth.yaw = cloth.yaw_now();
            let handles = cloth.graph.handles();
            cloth.handles = handles.select(&positions[cloth.vertices.clone()]);
        }
        self.positions.copy_from_slice(positions);
        self.undo = None;
        Ok(())
    }

    /// Undoes the last step, also if its frame was replaced since. Returns true if a step was
    /// undone: one that came last and succeeded.
    ///
    /// The device needs no call: a step writes a slot outside its window.
    pub fn undo_step(&mut self) -> bool {
        let Some(before) = self.undo.take() else {
            return false;
        };
        self.slot = before.slot;
        self.positions = before.positions;
        for (cloth, (handles, yaw)) in self.cloths.iter_mut().zip(before.cloths) {
            (cloth.handles, cloth.yaw) = (handles, yaw);
        }
        true
    }
}

fn flat(positions: &[Vec3]) -> Vec<f32> {
    positions.iter().flat_map(|p| p.to_array()).collect()
}

#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod tests;
