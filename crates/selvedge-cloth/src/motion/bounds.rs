//! Bounds of motions, their clock of 60 frames per second, and a turn about the vertical.

use glam::DVec3;

use crate::error::{SceneError, must};
use crate::geometry::sin_cos;

/// Frames per second in which durations are counted and speeds are given.
pub(crate) const MOTION_RATE: f64 = 60.0;

/// The error of `what`, which needs two handles at least.
pub(super) fn too_few_handles(what: &str, found: usize) -> SceneError {
    SceneError(format!("{what} needs at least 2 handles, found {found}"))
}

/// Farthest from the origin that a handle may be led `[m]`, and the longest displacement: far
/// beyond any cloth, near enough for f64 to tell micrometres.
pub(super) const FARTHEST: f64 = 1e6;

pub(super) const DISPLACEMENT: &str = "finite and at most 1e6 m long";

/// Longest duration of one block or one keyframed motion `[s]`: a day.
pub(super) const LONGEST: f64 = 86_400.0;

/// The frames of 1/60 s in `duration` `[s]`, which must be a whole number of them, one at least.
pub(super) fn whole_frames(
    field: impl std::fmt::Display,
    duration: f64,
) -> Result<usize, SceneError> {
    let frames = duration * MOTION_RATE;
    // Eight digits of a duration such as 1/3 s are enough; 0.333 s is not meant to be 20 frames.
    let whole = (frames - frames.round()).abs() < 1e-6 && frames.round() >= 1.0;
    if whole && duration <= LONGEST {
        return Ok(frames.round() as usize);
    }
    let expected = "a whole number of frames of 1/60 s, at least one, and at most a day";
    let found = format!("{duration} s, which is {frames} frames");
    Err(must(field, expected, found))
}

/// Frames of a scene that cover `frames` of 1/60 s.
pub(super) fn scene_frames(frames: f64, frame_rate: f64) -> usize {
    // 1e-6: a quotient that is whole but for rounding needs no frame more.
    (frames / MOTION_RATE * frame_rate - 1e-6).ceil() as usize
}

/// The sample before `place` (in samples, from 0) and the fraction from it to the next. A place
/// that is whole but for rounding is whole, so that samples are read as they are.
pub(super) fn split_place(place: f64, last: usize) -> (usize, f64) {
    let place = place.clamp(0.0, last as f64);
    let nearest = place.round();
    if (place - nearest).abs() < 1e-9 * nearest.max(1.0) {
        (nearest as usize, 0.0)
    } else {
        (place.floor() as usize, place.fract())
    }
}

/// `point` turned by `angle` `[rad]` about the vertical axis through `axis`.
pub(super) fn turned(point: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let (sin, cos) = sin_cos(angle);
    let (x, z) = (point.x - axis.x, point.z - axis.z);
    DVec3::new(
        axis.x + x * cos + z * sin,
        point.y,
        axis.z - x * sin + z * cos,
    )
}
