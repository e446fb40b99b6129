//! The software raster: a camera and a stage around a run, light on its surface, and the pixels of
//! one frame.

pub(crate) mod backdrop;
pub(crate) mod camera;
pub(crate) mod marks;
mod props;
pub(crate) mod renderer;
pub(crate) mod samples;
pub(crate) mod shade;
pub(crate) mod stage;
pub(crate) mod sun;
pub(crate) mod surface;
pub(crate) mod triangle;
