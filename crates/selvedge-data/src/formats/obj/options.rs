//! Choices for reading an OBJ whose texture coordinates are not those of a cloth in metres.

use serde::{Deserialize, Serialize};

/// Treatment of texture coordinates that are not those of a cloth in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjOptions {
    /// Treatment of vertices with two texture coordinates.
    pub seams: Seams,
    /// The unit of texture coordinates.
    pub texture: TextureUnit,
}

/// Treatment of vertices with two texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Seams {
    /// The file is refused.
    #[default]
    Refuse,
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
    /// Any: each sheet's are stretched along u and along v to be as long as the sheet is at the
    /// start, and mirrored back where they are mirrored.
    Fit,
}
