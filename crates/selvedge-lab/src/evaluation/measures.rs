//! Measures of a run, and its course frame by frame. The formulas are in `selvedge_data::metrics`;
//! all are against the recorded truth.

use glam::Vec3;
use selvedge_data::metrics::{self, Character, MetricError};
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

/// A run beside its truth, as the formulas of the table see it.
struct Compared<'a> {
    truth: &'a Trajectory,
    expected: Frames<'a>,
    found: Frames<'a>,
}

/// Makes [`Measures`] of the table of measures: its fields, its names, its values and its mean.
macro_rules! measures {
    ($($(#[$doc:meta])* $name:ident = $formula:expr;)+) => {
        /// Measures of a whole run.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Measures {
            $($(#[$doc])* pub $name: f64,)+
        }

        impl Measures {
            /// Names of the measures, as JSON and CSV have them.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// Values in the order of [`Self::NAMES`].
            pub fn values(&self) -> impl Iterator<Item = f64> {
                [$(self.$name),+].into_iter()
            }

            fn compute(run: &Compared<'_>) -> Result<Self, MeasureError> {
                $(let $name: fn(&Compared<'_>) -> Result<f64, MetricError> = $formula;)+
                Ok(Self { $($name: $name(run)?,)+ })
            }

            /// Mean of each measure over `all`; none where there are none.
            pub fn mean<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
                let count = all.clone().count();
                let mean = |of: fn(&Self) -> f64| all.clone().map(of).sum::<f64>() / count as f64;
                (count > 0).then(|| Self { $($name: mean(|m| m.$name),)+ })
            }
        }
    };
}

measures! {
    /// √(mean over frames and vertices of the squared distance to the truth) `[m]`.
    position_rmse = |run| metrics::position_rmse(run.expected, run.found);
    /// Mean over frames and vertices of the distance to the truth `[m]`.
    mean_vertex_error = |run| metrics::mean_vertex_error(run.expected, run.found);
    /// The largest distance of a vertex to the truth `[m]`.
    largest_vertex_error = |run| metrics::max_vertex_error(run.expected, run.found);
    /// e₃D: mean over frames of ‖error‖/‖truth‖.
    relative_error = |run| metrics::relative_error(run.expected, run.found);
    /// √(mean over frames and edges of the squared difference of lengths) `[m]`.
    edge_length_rmse =
        |run| metrics::edge_length_rmse(run.expected, run.found, run.truth.topology());
    /// The largest (l - l₀)/l₀ against the material.
    largest_strain = |run| {
        let strains = strains(run.truth, run.found)?;
        Ok(strains.into_iter().fold(f64::NEG_INFINITY, f64::max))
    };
    /// Settling: mean speed of the vertices in the last second `[m/s]`.
    final_speed = |run| metrics::final_speed(run.found, run.truth.frame_rate());
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
        Self::compute(&Compared {
            truth,
            expected: truth.frames(),
            found: Frames::new(positions, truth.vertex_count())?,
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
            largest_strain: strains(truth, b)?,
        })
    }
}

/// The character of a run's `positions` `[m]`, `[frames * vertices]`.
///
/// # Errors
/// When the run is of another mesh.
pub(super) fn character(truth: &Trajectory, positions: &[Vec3]) -> Result<Character, MeasureError> {
    let frames = Frames::new(positions, truth.vertex_count())?;
    Ok(Character::of(frames, truth.cloth(), truth.frame_rate())?)
}

/// The largest strain of each of `frames` against the material of the truth's cloth.
fn strains(truth: &Trajectory, frames: Frames<'_>) -> Result<Vec<f64>, MetricError> {
    let lengths = metrics::material_edge_lengths(truth.cloth());
    metrics::largest_strain(frames, truth.topology(), &lengths)
}
