//! Rollouts on a GPU: several cloths side by side as one graph, frame by frame.
//!
//! The processor computes the features and the integration, by the code of `selvedge_model`'s own
//! stepper; the GPU computes the pass between them. A frame that is not finite is rejected: the
//! cloths stay as they were.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, StepError, Stepper, Topology, VertexId, check_targets_hold,
};
use selvedge_model::{
    ClothGraph, Connectivity, Frames, LocalAcceleration, Model, NonFinite, OUTPUTS, Place,
    RolloutError, TwoFrames, Window, Yaw, advance, opening_frames,
};
use thiserror::Error;

use crate::gpu::{Gpu, GpuError};
use crate::passes::{Passes, side_by_side};

/// A cloth and the last frames before now.
pub struct Opening<'a> {
    /// The cloth.
    pub graph: ClothGraph,
    /// Frames, oldest first `[m]`, `[frames][vertices]`. Where there are fewer than the model's
    /// history, the cloth has stood still before them.
    pub start: &'a [&'a [Vec3]],
}

/// Failure of the start of a rollout.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum OpeningError {
    #[error("a rollout needs at least one cloth")]
    NoCloth,
    #[error("cloth {cloth}: {source}")]
    Start { cloth: usize, source: RolloutError },
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Failure of a frame.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FrameError {
    #[error("cloth {cloth}: the position of vertex {vertex} is no longer finite")]
    NonFinite { cloth: usize, vertex: VertexId },
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// One of the cloths.
struct Cloth {
    graph: ClothGraph,
    /// Oldest first, `[history][vertices]`.
    history: Vec<Vec<Vec3>>,
    /// The frame that is being made; after a step the one that left the history.
    next: Vec<Vec3>,
    /// The yaw of the frame before the newest.
    yaw: Yaw,
    /// The yaw before the last step, while that step can be undone.
    yaw_before: Option<Yaw>,
    window: Window,
}

impl Cloth {
    fn positions(&self) -> &[Vec3] {
        self.history.last().map_or(&[], Vec::as_slice)
    }

    /// The yaw of the newest frame.
    fn yaw_now(&self) -> Yaw {
        let handles = self.graph.handles().select(self.positions());
        self.graph.frame().yaw(&handles, self.yaw)
    }

    /// Exchanges the newest frame, or the one that left the history, for `next`.
    fn take_next(&mut self, yaw: Yaw) {
        self.history.rotate_left(1);
        let newest = self.history.len() - 1;
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.yaw_before = Some(std::mem::replace(&mut self.yaw, yaw));
    }

    fn undo_step(&mut self) -> bool {
        let Some(yaw) = self.yaw_before.take() else {
            return false;
        };
        let newest = self.history.len() - 1;
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.history.rotate_right(1);
        self.yaw = yaw;
        true
    }
}

/// Cloths that one model moves on a GPU.
pub struct Rollout {
    model: Arc<Model>,
    cloths: Vec<Cloth>,
    passes: Passes,
}

impl Rollout {
    /// Starts cloths side by side.
    ///
    /// # Errors
    /// [`OpeningError`] for a start that does not fit its cloth, too little memory, or a GPU that
    /// fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        model: Arc<Model>,
        openings: Vec<Opening<'_>>,
    ) -> Result<Self, OpeningError> {
        if openings.is_empty() {
            return Err(OpeningError::NoCloth);
        }
        let mut cloths = Vec::with_capacity(openings.len());
        for (cloth, Opening { graph, start }) in openings.into_iter().enumerate() {
            let history = opening_frames(model.spec(), &graph, start);
            let history = history.map_err(|source| OpeningError::Start { cloth, source })?;
            cloths.push(Cloth {
                history,
                next: vec![Vec3::ZERO; graph.vertex_count()],
                yaw: graph.frame().rest_yaw(),
                yaw_before: None,
                window: Window::default(),
                graph,
            });
        }
        let parts = cloths.iter().map(|cloth| cloth.graph.connectivity());
        let union = Connectivity::union(parts);
        let passes = Passes::new(gpu, model.network(), &union, None, None)?;
        passes.set_weights(model.weights());
        Ok(Self {
            model,
            cloths,
            passes,
        })
    }

    /// The model that moves the cloths.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The number of launches of a frame.
    #[must_use]
    pub fn launches(&self) -> usize {
        self.passes.launches()
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
        self.cloths[cloth].positions()
    }

    /// Lets the step from `frame` of the run to the next be the present one: its wind blows.
    pub fn set_step(&mut self, frame: usize) {
        let cloths = self.cloths.iter_mut();
        cloths.for_each(|cloth| cloth.graph.set_step(frame));
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
        assert_eq!(targets.len(), self.cloths.len(), "targets of every cloth");
        let (spec, normalizers) = (self.model.spec(), self.model.normalizers());
        let cloths = self.cloths.par_iter_mut();
        let yaws = cloths.map(|cloth| {
            // `next` is about to be overwritten.
            cloth.yaw_before = None;
            let yaw = cloth.yaw_now();
            let (window, place) = (&mut cloth.window, Place::alone(&cloth.graph));
            let positions = &cloth.history;
            window.write(spec, &cloth.graph, Frames { positions, yaw }, &place);
            window.normalize(&normalizers.nodes, &normalizers.edges);
            yaw
        });
        let yaws: Vec<Yaw> = yaws.collect();
        for (number, Cloth { graph, window, .. }) in self.cloths.iter().enumerate() {
            if let Some(vertex) = window.first_non_finite(spec, graph.connectivity()) {
                return Err(of_cloth(number)(NonFinite { vertex }));
            }
        }
        let windows = self.cloths.iter().map(|cloth| &cloth.window);
        let input = side_by_side(spec, &windows.collect::<Vec<_>>());
        let mut rows = self.passes.forward(0, &input, &[])?;
        normalizers.acceleration.denormalize(&mut rows);
        let mut rest = &rows[..];
        for (number, cloth) in self.cloths.iter_mut().enumerate() {
            let (next, yaw) = (targets[number], yaws[number]);
            assert_eq!(next.len(), cloth.graph.handles().len(), "targets");
            let rows;
            (rows, rest) = rest.split_at(OUTPUTS * cloth.graph.vertex_count());
            let [.., previous, current] = &cloth.history[..] else {
                unreachable!("a history has two frames at least")
            };
            let frames = TwoFrames {
                graph: &cloth.graph,
                previous,
                current,
            };
            let acceleration = LocalAcceleration { yaw, rows };
            let advanced = advance(&frames, next, acceleration, &mut cloth.next);
            advanced.map_err(of_cloth(number))?;
        }
        for (cloth, yaw) in self.cloths.iter_mut().zip(yaws) {
            cloth.take_next(yaw);
        }
        Ok(())
    }

    /// Replaces the newest frame by `positions` `[m]`, `[cloths][vertices]`.
    ///
    /// # Errors
    /// [`FrameError`]; the cloths are left as they were.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    pub fn replace_frame(&mut self, positions: &[&[Vec3]]) -> Result<(), FrameError> {
        self.check(positions)?;
        for (cloth, positions) in self.cloths.iter_mut().zip(positions) {
            let newest = cloth.history.len() - 1;
            cloth.history[newest].copy_from_slice(positions);
        }
        Ok(())
    }

    /// Takes `positions` `[m]`, `[cloths][vertices]`, as the next frame.
    ///
    /// # Errors
    /// As [`Self::replace_frame`].
    ///
    /// # Panics
    /// As [`Self::replace_frame`].
    pub fn take_frame(&mut self, positions: &[&[Vec3]]) -> Result<(), FrameError> {
        self.check(positions)?;
        for (cloth, positions) in self.cloths.iter_mut().zip(positions) {
            cloth.next.copy_from_slice(positions);
            cloth.take_next(cloth.yaw_now());
            cloth.yaw_before = None;
        }
        Ok(())
    }

    /// Undoes the last step, also if its frame was replaced since. Returns true if a step was
    /// undone: one that came last and succeeded.
    pub fn undo_step(&mut self) -> bool {
        let mut undone = true;
        for cloth in &mut self.cloths {
            undone &= cloth.undo_step();
        }
        undone
    }

    /// Checks the numbers of positions, and that all of them are finite.
    fn check(&self, positions: &[&[Vec3]]) -> Result<(), FrameError> {
        assert_eq!(positions.len(), self.cloths.len(), "every cloth");
        for (number, (cloth, positions)) in self.cloths.iter().zip(positions).enumerate() {
            assert_eq!(positions.len(), cloth.graph.vertex_count(), "positions");
            if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
                let vertex = VertexId(vertex as u32);
                return Err(of_cloth(number)(NonFinite { vertex }));
            }
        }
        Ok(())
    }
}

fn of_cloth(cloth: usize) -> impl Fn(NonFinite) -> FrameError {
    move |NonFinite { vertex }| FrameError::NonFinite { cloth, vertex }
}

/// One cloth that a trained model moves on a GPU.
pub struct GpuStepper {
    rollout: Rollout,
    next: Vec<Vec3>,
    frame: usize,
}

impl GpuStepper {
    /// Starts from the last frames before now, as [`Opening`] has them.
    ///
    /// # Errors
    /// As [`Rollout::new`].
    pub fn new(
        gpu: &Arc<Gpu>,
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, OpeningError> {
        Ok(Self {
            rollout: Rollout::new(gpu, model, vec![Opening { graph, start }])?,
            next: Vec::new(),
            frame: 0,
        })
    }

    /// The model that moves the cloth.
    #[must_use]
    pub fn model(&self) -> &Model {
        self.rollout.model()
    }
}

/// A failure of frame `frame`.
fn of_frame(frame: usize) -> impl Fn(FrameError) -> StepError {
    move |error| match error {
        FrameError::NonFinite { vertex, .. } => StepError::NonFinite { frame, vertex },
        FrameError::Gpu(error) => StepError::Device {
            frame,
            reason: error.to_string(),
        },
    }
}

impl Stepper for GpuStepper {
    fn topology(&self) -> &Topology {
        self.rollout.graph(0).topology()
    }

    fn handles(&self) -> &Handles {
        self.rollout.graph(0).handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.rollout.positions(0)
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_targets_hold(self, targets)?;
        let frame = self.frame + 1;
        self.next.clear();
        self.next.extend(targets.end().iter().map(|p| p.as_vec3()));
        self.rollout.set_step(self.frame);
        self.rollout.step(&[&self.next]).map_err(of_frame(frame))?;
        self.frame = frame;
        Ok(())
    }
}

impl Correctable for GpuStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let replaced = self.rollout.replace_frame(&[positions]);
        replaced.map_err(of_frame(self.frame))
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let taken = self.rollout.take_frame(&[positions]);
        taken.map_err(of_frame(self.frame + 1))?;
        self.frame += 1;
        Ok(())
    }

    fn undo_step(&mut self) {
        self.frame -= usize::from(self.rollout.undo_step());
    }
}

#[cfg(test)]
mod tests;
