//! Bodies beside a cloth: faces over points that are still or move by the frame.

use std::borrow::Cow;

use glam::Vec3;

/// A body in the frames of a run.
#[derive(Clone, Debug)]
pub struct Body<'a> {
    faces: &'a [[u32; 3]],
    frames: Vec<Cow<'a, [Vec3]>>,
}

impl<'a> Body<'a> {
    /// A body of `faces` over points `[m]`, `[frames, points]`; of one frame where it is still. All
    /// frames have the points that the faces name, and they are finite.
    pub fn new(faces: &'a [[u32; 3]], frames: impl IntoIterator<Item = Cow<'a, [Vec3]>>) -> Self {
        let frames: Vec<_> = frames.into_iter().collect();
        let most = faces.as_flattened().iter().max().map_or(0, |p| p + 1) as usize;
        debug_assert!(frames.iter().all(|frame| frame.len() >= most), "points");
        debug_assert!(frames.iter().flat_map(|f| f.iter()).all(|p| p.is_finite()));
        Self { faces, frames }
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
    fn a_floor_is_level_and_still() {
        let ground = vec![Vec3::ZERO, Vec3::X, Vec3::Z];
        let level = |frames: Vec<Vec<Vec3>>| {
            Body::new(&[[0, 1, 2]], frames.into_iter().map(Cow::Owned)).level()
        };
        assert_eq!(level(vec![ground.clone()]), Some(0.0));
        let raised = ground.iter().map(|p| *p + Vec3::Y).collect();
        assert_eq!(level(vec![ground, raised]), None);
    }
}
