//! Paths of handles, compared as the network sees them: relative to their start, in any direction
//! about the vertical.

use glam::DVec3;
use selvedge_data::Trajectory;

/// Largest distance of handles on the same path `[m]`.
const TOLERANCE: f64 = 1e-3;

/// The path of the handles of a trajectory.
pub(super) struct HandleTrack {
    handles: usize,
    frame_rate: f64,
    /// Positions from the middle of the first frame `[m]`, `[frames * handles]`.
    places: Vec<DVec3>,
}

impl HandleTrack {
    /// The path of `trajectory`.
    pub(super) fn of(trajectory: &Trajectory) -> Self {
        let handles = trajectory.handles();
        let start = handles.select(trajectory.frame(0));
        let sum: DVec3 = start.iter().map(|place| place.as_dvec3()).sum();
        let middle = sum / start.len().max(1) as f64;
        let frames = 0..trajectory.frame_count();
        let places = frames.flat_map(|frame| handles.select(trajectory.frame(frame)));
        Self {
            handles: start.len(),
            frame_rate: trajectory.frame_rate(),
            places: places.map(|place| place.as_dvec3() - middle).collect(),
        }
    }

    /// True if `other` is the same path, except for a turn about the vertical, as far as the
    /// shorter one goes, and that is half of this one at least.
    pub(super) fn goes_as(&self, other: &Self) -> bool {
        let is_long = 2 * other.places.len() >= self.places.len();
        if !is_long || self.handles != other.handles || self.frame_rate != other.frame_rate {
            return false;
        }
        let pairs = || self.places.iter().zip(&other.places);
        // The turn that brings them nearest to each other, as in `[eq:local-frame]`.
        let (mut along, mut across) = (0.0, 0.0);
        for (a, b) in pairs() {
            along += a.z * b.z + a.x * b.x;
            across += a.z * b.x - a.x * b.z;
        }
        let (sin, cos) = f64::atan2(across, along).sin_cos();
        pairs().all(|(a, b)| {
            let turned = DVec3::new(cos * a.x + sin * a.z, a.y, cos * a.z - sin * a.x);
            turned.distance(*b) <= TOLERANCE
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::trajectory;

    /// `number`'s swing, turned by `yaw` and moved by `offset`.
    fn swing_of(number: usize, yaw: f64, offset: DVec3) -> HandleTrack {
        let mut track = HandleTrack::of(&trajectory(("a", 9, 40), number));
        let (sin, cos) = yaw.sin_cos();
        for place in &mut track.places {
            let p = *place;
            *place = DVec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x) + offset;
        }
        track
    }

    #[test]
    fn a_path_that_is_turned_about_the_vertical_is_the_same() {
        let path = swing_of(0, 0.0, DVec3::ZERO);
        for yaw in [0.0, 0.7, -2.0, std::f64::consts::PI] {
            assert!(path.goes_as(&swing_of(0, yaw, DVec3::ZERO)), "{yaw}");
        }
        let start = |frames| HandleTrack::of(&trajectory(("a", 9, frames), 0));
        assert!(path.goes_as(&start(20)), "as far as it goes");
        assert!(!path.goes_as(&start(19)), "too short to tell");
    }

    #[test]
    fn another_path_is_another() {
        let path = swing_of(0, 0.0, DVec3::ZERO);
        assert!(!path.goes_as(&swing_of(1, 0.0, DVec3::ZERO)));
        assert!(!path.goes_as(&swing_of(0, 0.0, DVec3::Y * 2e-3)));
        let mirrored = trajectory(("a", 9, 40), 0).mirrored();
        assert!(!path.goes_as(&HandleTrack::of(&mirrored)));
        let mut slower = swing_of(0, 0.0, DVec3::ZERO);
        slower.frame_rate = 30.0;
        assert!(!path.goes_as(&slower));
    }
}
