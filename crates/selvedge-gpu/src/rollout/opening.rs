//! The start of a rollout: cloths with the frames before now, checked and put side by side.

use glam::Vec3;
use selvedge_model::{ClothGraph, Model, RolloutError, Yaw, opening_frames};
use thiserror::Error;

use crate::device::DeviceError;

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
    Device(#[from] DeviceError),
}

/// The processor's side of one cloth.
pub(super) struct Cloth {
    pub(super) graph: ClothGraph,
    /// The vertices of the cloth in the union.
    pub(super) vertices: std::ops::Range<usize>,
    /// Positions of the handles in the newest frame, `[handles]`.
    pub(super) handles: Vec<Vec3>,
    pub(super) yaw: Yaw,
}

impl Cloth {
    /// The yaw of the newest frame; `yaw` is that of the frame before.
    pub(super) fn yaw_now(&self) -> Yaw {
        self.graph.frame().yaw(&self.handles, self.yaw)
    }
}

/// The cloths, and the first frames of all of them, oldest first.
pub(super) fn open(
    model: &Model,
    openings: Vec<Opening<'_>>,
) -> Result<(Vec<Cloth>, Vec<Vec<Vec3>>), OpeningError> {
    if openings.is_empty() {
        return Err(OpeningError::NoCloth);
    }
    let mut frames = vec![Vec::new(); model.spec().history()];
    let mut cloths = Vec::with_capacity(openings.len());
    for (number, Opening { graph, start }) in openings.into_iter().enumerate() {
        let vertices = graph.vertex_count();
        let own = opening_frames(model.spec(), vertices, start).map_err(|source| {
            let cloth = number;
            OpeningError::Start { cloth, source }
        })?;
        let first = frames[0].len();
        for (all, own) in frames.iter_mut().zip(&own) {
            all.extend_from_slice(own);
        }
        cloths.push(Cloth {
            vertices: first..first + vertices,
            handles: graph.handles().select(&own[own.len() - 1]),
            yaw: graph.frame().rest_yaw(),
            graph,
        });
    }
    Ok((cloths, frames))
}
