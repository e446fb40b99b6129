//! Measures of a run, and its course frame by frame. The formulas are in `selvedge_data::metrics`;
//! all are against the recorded truth.

use glam::Vec3;
use selvedge_data::metrics::{self, MetricError};
use selvedge_data::{Frames, FramesError, Trajectory};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A run is stable up to the first frame in which an edge strains more, (l - l₀)/l₀ against the
/// material.
pub const STRAIN_LIMIT: f64 = 0.2;

/// A run that cannot be measured: of another mesh, or with no frames.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum MeasureError {
    Frames(#[from] FramesError),
    Metric(#[from] MetricError),
}

/// Measures of a whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measures {
    /// √(mean over frames and vertices of the squared distance to the truth) `[m]`.
    pub position_rmse: f64,
    /// Mean over frames and vertices of the distance to the truth `[m]`.
    pub mean_vertex_error: f64,
    /// The largest distance of a vertex to the truth `[m]`.
    pub largest_vertex_error: f64,
    /// e₃D: mean over frames of ‖error‖/‖truth‖.
    pub relative_error: f64,
    /// √(mean over frames and edges of the squared difference of lengths) `[m]`.
    pub edge_length_rmse: f64,
    /// The largest (l - l₀)/l₀ against the material.
    pub largest_strain: f64,
    /// Settling: mean speed of the vertices in the last second `[m/s]`.
    pub final_speed: f64,
}

/// A run frame by frame, `[frames]` each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// `[m]`
    pub position_rmse: Vec<f64>,
    /// `[m]`
    pub edge_length_rmse: Vec<f64>,
    /// Of an edge, against the material.
    pub largest_strain: Vec<f64>,
}

impl Measures {
    /// The measures of a run's `positions` `[m]`, `[frames * vertices]`.
    ///
    /// # Errors
    /// When the run is of another mesh.
    pub fn of(truth: &Trajectory, positions: &[Vec3]) -> Result<Self, MeasureError> {
        let (a, b) = (
            truth.frames(),
            Frames::new(positions, truth.vertex_count())?,
        );
        let topology = truth.topology();
        let strains = metrics::largest_strain(b, topology, &material_lengths(truth))?;
        Ok(Self {
            position_rmse: metrics::position_rmse(a, b)?,
            mean_vertex_error: metrics::mean_vertex_error(a, b)?,
            largest_vertex_error: metrics::max_vertex_error(a, b)?,
            relative_error: metrics::relative_error(a, b)?,
            edge_length_rmse: metrics::edge_length_rmse(a, b, topology)?,
            largest_strain: strains.into_iter().fold(f64::NEG_INFINITY, f64::max),
            final_speed: metrics::final_speed(b, truth.frame_rate())?,
        })
    }

    /// Means of each; none where there are none.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
        let count = all.clone().count();
        if count == 0 {
            return None;
        }
        let mean = |of: fn(&Self) -> f64| all.clone().map(of).sum::<f64>() / count as f64;
        Some(Self {
            position_rmse: mean(|m| m.position_rmse),
            mean_vertex_error: mean(|m| m.mean_vertex_error),
            largest_vertex_error: mean(|m| m.largest_vertex_error),
            relative_error: mean(|m| m.relative_error),
            edge_length_rmse: mean(|m| m.edge_length_rmse),
            largest_strain: mean(|m| m.largest_strain),
            final_speed: mean(|m| m.final_speed),
        })
    }
}

impl Curves {
    /// The course of a run's `positions` `[m]`, `[frames * vertices]`, which may end early.
    ///
    /// # Errors
    /// When the run is of another mesh.
    pub fn of(truth: &Trajectory, positions: &[Vec3]) -> Result<Self, MeasureError> {
        let (a, b) = (
            truth.frames(),
            Frames::new(positions, truth.vertex_count())?,
        );
        let topology = truth.topology();
        Ok(Self {
            position_rmse: metrics::per_frame_rmse(a, b)?,
            edge_length_rmse: metrics::per_frame_edge_length_rmse(a, b, topology)?,
            largest_strain: metrics::largest_strain(b, topology, &material_lengths(truth))?,
        })
    }
}

fn material_lengths(truth: &Trajectory) -> Vec<f64> {
    let coordinates = truth.cloth().material_coordinates();
    metrics::material_edge_lengths(truth.topology(), coordinates)
}
