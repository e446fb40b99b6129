//! What a mesh in the file of another program is, and when it moves.

use std::path::Path;

use super::bodies::read_body;
use super::error::RigError;
use super::node::Rig;
use crate::formats::file_error::FileError;

/// Largest difference of the time between two frames from the others that is taken for rounding, as
/// a share: files have times in single precision.
const ROUNDING: f64 = 1e-3;

/// A mesh in the file of another program, and when it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMotion {
    /// Name of the node that has it.
    pub name: String,
    /// Number of its points.
    pub points: usize,
    /// Number of its faces.
    pub faces: usize,
    /// Times at which its points are given `[s]`, ascending; none if it does not move.
    pub times: Vec<f64>,
}

impl MeshMotion {
    /// Frames per second, if they are evenly spaced.
    #[must_use]
    pub fn frame_rate(&self) -> Option<f64> {
        let [first, .., last] = self.times.as_slice() else {
            return None;
        };
        let step = (last - first) / (self.times.len() - 1) as f64;
        let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= ROUNDING * step;
        self.times.windows(2).all(is_even).then_some(1.0 / step)
    }
}

impl Rig {
    /// The meshes in a .glb or USD (.usda, .usdc, .usdz) file, and when they move; a .glb
    /// with several animations has its meshes as they stand.
    ///
    /// # Errors
    /// [`FileError`] names the file, and what in it cannot be understood.
    pub fn read_meshes(path: &Path) -> Result<Vec<MeshMotion>, FileError<RigError>> {
        Self::of_file(path, |bytes, format| {
            let body = match read_body(bytes, format, None, false) {
                Err(RigError::Animations { .. }) => read_body(bytes, format, None, true),
                read => read,
            };
            Ok(body?.motions())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_said_where_there_is_one() {
        let motion = |times: &[f64]| MeshMotion {
            name: "sheet".to_owned(),
            points: 4,
            faces: 2,
            times: times.to_vec(),
        };
        let rate = motion(&[1.0, 1.0 + 1.0 / 24.0, 1.0 + 2.0 / 24.0]).frame_rate();
        assert!((rate.unwrap() - 24.0).abs() < 1e-9, "{rate:?}");
        for uneven in [&[][..], &[0.0], &[0.0, 0.1, 0.3]] {
            assert_eq!(motion(uneven).frame_rate(), None);
        }
    }
}
