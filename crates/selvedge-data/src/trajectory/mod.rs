//! A trajectory: the positions of a cloth over time, with everything about the cloth that does not
//! change, checked once in [`Trajectory::new`].
//!
//! Positions are world coordinates `[m]` in `f32`, one row of vertices per frame; frame 0 is the
//! start. The file format is in `trajectory/file.rs`; [`Playback`] makes a trajectory a
//! [`Stepper`].
//!
//! [`Stepper`]: selvedge_cloth::Stepper
//! [`Playback`]: crate::Playback

pub(crate) mod file;
pub(crate) mod frames;
mod obstacle_file;
pub(crate) mod obstacles;
pub(crate) mod record;
pub(crate) mod state_file;
#[cfg(test)]
pub(crate) mod test_square;

use glam::Vec3;
use selvedge_cloth::{Cloth, Handles, Topology};
use serde_json::Value;

use crate::formats::file_error::Problem;
use crate::trajectory::frames::Frames;
use crate::trajectory::obstacles::ObstacleTrack;

/// Origin of a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance {
    /// Frames per second.
    pub frame_rate: f64,
    /// The resolved scene ([`SceneSpec`] as JSON); `null` where there is none.
    ///
    /// [`SceneSpec`]: crate::SceneSpec
    pub scene: Value,
    /// Program and version that made it.
    pub made_by: String,
}

/// The positions of a cloth over time: at least one frame, finite everywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    cloth: Cloth,
    positions: Vec<Vec3>,
    provenance: Provenance,
    obstacles: Vec<ObstacleTrack>,
}

impl Trajectory {
    /// Makes a trajectory of `positions` `[m]`, `[frames * vertices]`, one frame after another.
    ///
    /// # Errors
    /// [`Problem`] names the first array, frame and vertex that cannot be used.
    pub fn new(
        cloth: Cloth,
        positions: Vec<Vec3>,
        provenance: Provenance,
    ) -> Result<Self, Problem> {
        let vertices = cloth.vertex_count();
        if positions.is_empty() || !positions.len().is_multiple_of(vertices) {
            let found = positions.len();
            return Err(Problem(format!(
                "positions have {found} entries, which is no whole number of frames of {vertices} vertices"
            )));
        }
        if let Some(bad) = positions.iter().position(|p| !p.is_finite()) {
            let (frame, vertex) = (bad / vertices, bad % vertices);
            return Err(Problem(format!(
                "frame {frame}: the position of vertex {vertex} is not finite: {}",
                positions[bad]
            )));
        }
        let frame_rate = provenance.frame_rate;
        if !(frame_rate.is_finite() && frame_rate > 0.0) {
            return Err(Problem(format!(
                "the frame rate must be finite and positive, found {frame_rate}"
            )));
        }
        Ok(Self {
            cloth,
            positions,
            provenance,
            obstacles: Vec::new(),
        })
    }

    /// Returns the same trajectory with these obstacles beside the cloth.
    ///
    /// # Errors
    /// [`Problem`] names one that does not fit.
    pub fn with_obstacles(mut self, obstacles: Vec<ObstacleTrack>) -> Result<Self, Problem> {
        for obstacle in &obstacles {
            obstacle.check(self.frame_count())?;
        }
        self.obstacles = obstacles;
        Ok(self)
    }

    /// The obstacles beside the cloth.
    pub fn obstacles(&self) -> &[ObstacleTrack] {
        &self.obstacles
    }

    /// Number of frames, the start included.
    pub fn frame_count(&self) -> usize {
        self.positions.len() / self.vertex_count()
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.cloth.vertex_count()
    }

    /// Positions in frame `index` `[m]`, `[vertices]`.
    ///
    /// # Panics
    /// When `index` is not below [`Self::frame_count`], as for a slice.
    pub fn frame(&self, index: usize) -> &[Vec3] {
        self.frames().frame(index)
    }

    /// All frames, as metrics and exporters take them.
    pub fn frames(&self) -> Frames<'_> {
        Frames::of_whole(&self.positions, self.vertex_count())
    }

    /// All positions `[m]`, `[frames * vertices]`, one frame after another.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The cloth, which does not change.
    pub fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    /// The connectivity.
    pub fn topology(&self) -> &Topology {
        self.cloth.topology()
    }

    /// The held vertices.
    pub fn handles(&self) -> &Handles {
        self.cloth.handles()
    }

    /// Frames per second.
    pub fn frame_rate(&self) -> f64 {
        self.provenance.frame_rate
    }

    /// Origin of the trajectory.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}
