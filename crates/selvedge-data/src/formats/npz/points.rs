//! Points over time in an archive, as exports and other programs write them.

use glam::DVec3;

use crate::UpAxis;
use crate::formats::arrays::ArrayFile;
use crate::formats::file_error::Problem;

/// Points over time, y up.
pub(crate) struct NpzPoints {
    /// `[frames, points]` `[m]`
    pub(crate) frames: Vec<Vec<DVec3>>,
    /// The points that are handles, where the archive says it.
    pub(crate) handles: Option<Vec<u32>>,
    /// Frames per second, where the archive says it.
    pub(crate) frame_rate: Option<f64>,
}

impl NpzPoints {
    /// The points in the bytes of an archive: `positions` or else `points`, `[frames, points, 3]`
    /// `[m]`, and `handles`, `fps` `[1]` and `up_axis` `[1]` where they are.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, Problem> {
        let file = ArrayFile::npz(bytes)?;
        let has_points = file.has("points") && !file.has("positions");
        let name = if has_points { "points" } else { "positions" };
        let points = file.floats(name)?.of_shape(&[None, None, Some(3)])?;
        let up = file.up_axis()?;
        let ours = |p: &[f64]| up.to_ours(DVec3::from_slice(p));
        let all: Vec<DVec3> = points.values.chunks_exact(3).map(ours).collect();
        let count = points.shape[1];
        let mut handles = None;
        if file.has("handles") {
            let found = file.wholes("handles")?.of_shape(&[None])?.values;
            if let Some(beyond) = found.iter().find(|&&handle| handle as usize >= count) {
                let expected = format!("vertices below {count}");
                return Err(Problem::array("handles", &expected, beyond));
            }
            handles = Some(found);
        }
        let frame_rate = if file.has("fps") { Some(file.floats("fps")?.single()?) } else { None };
        let frames = all.chunks_exact(count.max(1)).map(<[_]>::to_vec);
        Ok(Self {
            frames: frames.collect(),
            handles,
            frame_rate,
        })
    }
}

impl ArrayFile<'_> {
    /// Axis that points up in an archive; y where it does not say.
    pub(crate) fn up_axis(&self) -> Result<UpAxis, Problem> {
        if !self.has("up_axis") {
            return Ok(UpAxis::Y);
        }
        match self.wholes("up_axis")?.values[..] {
            [1] => Ok(UpAxis::Y),
            [2] => Ok(UpAxis::Z),
            ref other => {
                let found = format!("{other:?}");
                Err(Problem::array("up_axis", "1 for y or 2 for z", found))
            }
        }
    }
}
