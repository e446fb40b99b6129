//! A borrowed run of frames: flat positions and how many vertices make one frame.

use glam::Vec3;

use crate::formats::file_error::Problem;

/// Frames of a cloth, one after another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames<'a> {
    positions: &'a [Vec3],
    vertex_count: usize,
}

impl<'a> Frames<'a> {
    /// Views `positions` `[m]`, `[frames * vertex_count]`, as frames.
    ///
    /// # Errors
    /// [`Problem`] when the length is no multiple of `vertex_count`.
    pub fn new(positions: &'a [Vec3], vertex_count: usize) -> Result<Self, Problem> {
        if vertex_count == 0 || !positions.len().is_multiple_of(vertex_count) {
            return Err(Problem(format!(
                "{} positions are no whole number of frames of {vertex_count} vertices",
                positions.len()
            )));
        }
        Ok(Self::of_whole(positions, vertex_count))
    }

    /// Views positions whose length has been checked.
    pub(crate) fn of_whole(positions: &'a [Vec3], vertex_count: usize) -> Self {
        Self {
            positions,
            vertex_count,
        }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.positions.len() / self.vertex_count
    }

    /// Returns true when there is no frame.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// Positions in frame `index` `[m]`, `[vertices]`.
    ///
    /// # Panics
    /// When `index` is not below [`Self::len`], as for a slice.
    pub fn frame(&self, index: usize) -> &'a [Vec3] {
        &self.positions[index * self.vertex_count..(index + 1) * self.vertex_count]
    }

    /// The frames in order, each `[vertices]`.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &'a [Vec3]> + use<'a> {
        self.positions.chunks_exact(self.vertex_count)
    }

    /// At most the first `count` frames.
    pub fn first(&self, count: usize) -> Self {
        let kept = count.min(self.len()) * self.vertex_count;
        Self::of_whole(&self.positions[..kept], self.vertex_count)
    }

    /// At most the last `count` frames.
    pub fn last(&self, count: usize) -> Self {
        let dropped = self.len().saturating_sub(count) * self.vertex_count;
        Self::of_whole(&self.positions[dropped..], self.vertex_count)
    }
}
