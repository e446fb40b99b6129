//! Recorded motion: one position per handle and frame of the scene, linear between frames.
//! A recording has no rate of its own: its frames are the scene's.

use glam::DVec3;

use super::bounds::{FARTHEST, split_place};
use super::written::RecordedMotion;
use crate::error::{SceneError, must};

/// Largest distance of the start of a recording from the handles `[m]`. Positions in files are
/// often rounded to a tenth of a millimetre; more than this is another scene.
const START_TOLERANCE: f64 = 1e-3;

/// A recording checked against the handles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RecordedPath {
    positions: Vec<Vec<DVec3>>,
}

impl RecordedPath {
    pub(super) fn new(motion: &RecordedMotion, start: &[DVec3]) -> Result<Self, SceneError> {
        let Some(first) = motion.positions.first() else {
            let expected = "at least one frame";
            return Err(must("positions", expected, "none"));
        };
        for (frame, positions) in motion.positions.iter().enumerate() {
            check_frame(frame, positions, start.len())?;
        }
        for (handle, (&expected, &found)) in start.iter().zip(first).enumerate() {
            let distance = expected.distance(found);
            if distance > START_TOLERANCE {
                let millimetres = distance * 1e3;
                return Err(SceneError(format!(
                    "the recording starts with handle {handle} at {found}, {millimetres:.3} mm from where it stands in the scene, {expected} (1 mm is allowed): move the mesh or the recording"
                )));
            }
        }
        Ok(Self {
            positions: motion.positions.clone(),
        })
    }

    /// Positions `place` frames of the scene after the start.
    pub(super) fn at(&self, place: f64) -> Vec<DVec3> {
        let (before, fraction) = split_place(place, self.positions.len() - 1);
        if fraction == 0.0 {
            return self.positions[before].clone();
        }
        let (from, to) = (&self.positions[before], &self.positions[before + 1]);
        from.iter()
            .zip(to)
            .map(|(a, b)| a.lerp(*b, fraction))
            .collect()
    }
}

fn check_frame(frame: usize, positions: &[DVec3], expected: usize) -> Result<(), SceneError> {
    let found = positions.len();
    if found != expected {
        return Err(SceneError(format!(
            "frame {frame} has positions for {found} handles, the scene has {expected}"
        )));
    }
    let is_usable = |p: &DVec3| (0.0..=FARTHEST).contains(&p.length());
    match positions.iter().position(|p| !is_usable(p)) {
        Some(handle) => Err(SceneError(format!(
            "the position of handle {handle} in frame {frame} must be finite and at most 1e6 m from the origin, found {}",
            positions[handle]
        ))),
        None => Ok(()),
    }
}
