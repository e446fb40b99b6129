//! The layers of the network, each with its backward pass beside its forward pass.
//!
//! All work on tiles of [`TILE`] rows, so that what a layer reads and writes stays in cache and
//! threads can share the tiles without changing any sum: the tiling is fixed, the number of
//! threads is not.

pub(crate) mod block;
pub(crate) mod encoder;
pub(crate) mod gru;
pub(crate) mod mlp;
#[cfg(test)]
mod pytorch;

/// Rows (vertices or arcs) that are taken through a layer at a time.
pub(crate) const TILE: usize = 128;

/// The ranges of rows of the tiles.
pub(crate) fn tiles(rows: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    (0..rows)
        .step_by(TILE)
        .map(move |first| first..rows.min(first + TILE))
}

/// `buffer` with exactly `length` values, of which only new ones are set (to zero).
pub(crate) fn resize<T: Default + Clone>(buffer: &mut Vec<T>, length: usize) {
    buffer.resize(length, T::default());
}
