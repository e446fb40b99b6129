//! The reasons why a picture could not be made.

use glam::Vec3;
use selvedge_cloth::VertexId;
use thiserror::Error;

/// The reason why a picture could not be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ViewError {
    #[error("the run has no frames: there is nothing to show")]
    EmptyRun,
    #[error("no panels were given: a picture needs at least one run")]
    NoPanels,
    #[error("frame {frame} has {found} vertices, but the mesh has {expected}")]
    VertexCount {
        frame: usize,
        expected: usize,
        found: usize,
    },
    #[error("frame {frame}: the position of vertex {vertex} is not finite: {position}")]
    NonFinite {
        frame: usize,
        vertex: VertexId,
        position: Vec3,
    },
    #[error("handle vertex {vertex} is out of range: the mesh has {vertex_count} vertices")]
    Handle {
        vertex: VertexId,
        vertex_count: usize,
    },
    #[error("the frame rate must be finite and positive, found {found} frames per second")]
    FrameRate { found: f64 },
    #[error("frame {frame} was asked for, but the run has only {frames} frames")]
    FrameOutOfRange { frame: usize, frames: usize },
    #[error("{field} is {width} x {height} pixels: both must be between 1 and {largest}")]
    Size {
        field: &'static str,
        width: u32,
        height: u32,
        largest: u32,
    },
    #[error("{field} is {width} x {height} pixels: together at most {most} are allowed")]
    TooManyPixels {
        field: &'static str,
        width: u32,
        height: u32,
        most: u64,
    },
    #[error("a body beside the cloth: {problem}")]
    Body { problem: String },
    #[error("{field} must be {expected}, found {found}")]
    Setting {
        field: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error(
        "panel \"{label}\" has {found} {what}, but panel \"{first}\" has {expected}: panels side by side must match"
    )]
    PanelsDiffer {
        first: String,
        label: String,
        what: &'static str,
        expected: String,
        found: String,
    },
    #[error(
        "the values of {name} have {found} {what}, but the run has {expected}: give one value per vertex and frame"
    )]
    ValueCount {
        name: String,
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("frame {frame}: the value of {name} at vertex {vertex} is not finite: {value}")]
    NonFiniteValue {
        name: String,
        frame: usize,
        vertex: VertexId,
        value: f32,
    },
    #[error("the PNG image could not be written: {0}")]
    Png(#[from] png::EncodingError),
    #[error("the GIF clip could not be written: {0}")]
    Gif(#[from] gif::EncodingError),
}
