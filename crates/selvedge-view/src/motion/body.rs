//! Bodies beside a cloth: faces over points that are still or move by the frame.

use std::borrow::Cow;

use glam::Vec3;

use crate::ViewError;

/// The beginning of an error about a body.
pub(super) const BESIDE: &str = "a body beside the cloth";

/// A body in the frames of a run.
#[derive(Clone, Debug)]
pub struct Body<'a> {
    faces: &'a [[u32; 3]],
    frames: Vec<Cow<'a, [Vec3]>>,
}

impl<'a> Body<'a> {
    /// A body of `faces` over points `[m]`, `[frames, points]`; of one frame where it is still.
    pub fn new(
        faces: &'a [[u32; 3]],
        frames: impl IntoIterator<Item = Cow<'a, [Vec3]>>,
    ) -> Result<Self, ViewError> {
        let frames: Vec<_> = frames.into_iter().collect();
        let wrong = |problem| Err(ViewError::Invalid(format!("{BESIDE}: {problem}")));
        let points = frames.first().map_or(0, |frame| frame.len());
        for (number, frame) in frames.iter().enumerate() {
            if frame.len() != points {
                return wrong(format!(
                    "has {} points in frame {number} and {points} in the first",
                    frame.len()
                ));
            }
            if let Some(bad) = frame.iter().position(|p| !p.is_finite()) {
                return wrong(format!("frame {number}: point {bad} is not finite"));
            }
        }
        let corners = faces.as_flattened().iter().copied();
        if let Some(beyond) = corners.max().filter(|&p| p as usize >= points) {
            return wrong(format!("a face names point {beyond} of {points}"));
        }
        Ok(Self { faces, frames })
    }

    pub(crate) fn faces(&self) -> &'a [[u32; 3]] {
        self.faces
    }

    /// Number of frames; one where it is still.
    pub(crate) fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Points in a frame; in the only one of a body that is still.
    pub(crate) fn points(&self, frame: usize) -> &[Vec3] {
        let last = self.frames.len().saturating_sub(1);
        self.frames
            .get(frame.min(last))
            .map_or(&[], |points| points)
    }

    /// The height of a body that is level and still: a floor.
    pub(crate) fn level(&self) -> Option<f32> {
        let [only] = self.frames.as_slice() else {
            return None;
        };
        let first = only.first()?.y;
        let is_level = only.iter().all(|p| (p.y - first).abs() < 1e-4);
        is_level.then_some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_defect_is_named() {
        let good = vec![Vec3::ZERO, Vec3::X, Vec3::Z];
        let made = |faces: &'static [[u32; 3]], frames: Vec<Vec<Vec3>>| {
            Body::new(faces, frames.into_iter().map(Cow::Owned)).map(|body| body.level())
        };
        assert_eq!(made(&[[0, 1, 2]], vec![good.clone()]).unwrap(), Some(0.0));
        let raised = good.iter().map(|p| *p + Vec3::Y).collect();
        assert_eq!(
            made(&[[0, 1, 2]], vec![good.clone(), raised]).unwrap(),
            None
        );
        let error = |result: Result<Option<f32>, ViewError>| result.unwrap_err().to_string();
        let missing = made(&[[0, 1, 3]], vec![good.clone()]);
        assert!(error(missing).contains("names point 3 of 3"));
        let fewer = made(&[], vec![good.clone(), vec![Vec3::ZERO]]);
        assert!(error(fewer).contains("has 1 points in frame 1 and 3"));
        let wild = made(&[], vec![vec![Vec3::splat(f32::NAN)]]);
        assert!(error(wild).contains("point 0 is not finite"));
    }
}
