//! Choices for reading a mesh of another program.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Choices for reading a mesh of another program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeshOptions {
    /// Treatment of vertices with two texture coordinates.
    #[serde(skip_serializing_if = "is_default")]
    pub seams: Seams,
    /// The unit of texture coordinates.
    #[serde(skip_serializing_if = "is_default")]
    pub texture: TextureUnit,
    /// Source of the rest shapes.
    #[serde(skip_serializing_if = "is_default")]
    pub pattern: PatternSource,
    /// Direction in space along which the wale threads of a cloth without a pattern run, as far as
    /// each face allows; up if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thread: Option<DVec3>,
    /// Distance up to which vertices are one `[m]`, in the file's own unit of length. Without it
    /// the vertices of an OBJ stay as they are, and those of formats that split vertices at seams
    /// are welded where they coincide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weld: Option<f64>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Treatment of vertices with two texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Seams {
    /// The panels are sewn together there.
    #[default]
    Sewn,
    /// The sheet is cut open along the seam: the side that comes later in the file gets vertices of
    /// its own, numbered after those of the file.
    Cut,
}

/// The unit of texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TextureUnit {
    /// Metres.
    #[default]
    Metres,
    /// Any: each panel's are stretched along u and along v to be as long as the panel is at the
    /// start, and mirrored back where they are mirrored.
    Fit,
}

/// Source of the rest shapes of faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PatternSource {
    /// Texture coordinates where there are some, otherwise the plane of a flat sheet, otherwise the
    /// shape.
    #[default]
    Texture,
    /// The form of each face in space.
    Shape,
}

/// Angles at which hinges rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestAngles {
    /// Flat.
    Flat,
    /// As the mesh stands in its file.
    Start,
}
