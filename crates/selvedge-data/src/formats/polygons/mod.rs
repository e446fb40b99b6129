//! Polygons over vertices, as a file of another program has them, and the mesh that is made of
//! them: welded, turned one way, cut into triangles, with a rest shape for each.
//!
//! The rest shape comes from texture coordinates, which are material coordinates `[m]`, from the
//! plane of a flat sheet, or from the form that the mesh has in space.

mod assemble;
mod border;
mod fit;
mod orient;
mod sew;
mod shape;
mod slits;
mod triangulate;
mod weld;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display};

use glam::{DVec2, DVec3};
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::{LoosePanels, MeshError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::formats::file_error::FileError;

pub(crate) use self::assemble::assemble;
pub(crate) use self::sew::sew;
pub use self::sew::{PanelPlace, SeamPair, Sewing};
pub(crate) use self::shape::own_shape;
pub(crate) use self::triangulate::triangles_of_body;
pub(crate) use self::weld::owners;

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

/// Polygons of a file with indices resolved and nothing interpreted.
#[derive(Debug, Default)]
pub(crate) struct Polygons {
    pub(crate) positions: Vec<DVec3>,
    /// Number of each vertex in the file, for errors.
    pub(crate) numbers: Vec<usize>,
    pub(crate) texture: Vec<DVec2>,
    pub(crate) polygons: Vec<Polygon>,
    /// Names of objects and groups that faces belong to, by which these refer to them.
    pub(crate) parts: Vec<Vec<String>>,
    /// Rest angles of edges by their vertices, the smaller first, where the file has them `[rad]`.
    pub(crate) angles: BTreeMap<[u32; 2], f64>,
    /// Vertices by the names of their objects and groups.
    pub(crate) labels: BTreeMap<String, BTreeSet<u32>>,
    /// Names of fabrics, by which faces refer to them.
    pub(crate) fabrics: Vec<String>,
    /// Velocities of vertices, where the file has them `[m/s]`.
    pub(crate) velocities: BTreeMap<u32, DVec3>,
    /// Places before the panels were sewn, by which corners refer to them; empty where nothing was.
    pub(crate) loose: Vec<DVec3>,
    pub(crate) warnings: Vec<String>,
}

/// A face.
#[derive(Clone, Debug)]
pub(crate) struct Polygon {
    pub(crate) place: Place,
    pub(crate) corners: Vec<Corner>,
    /// Number of the fabric that its own label or else a statement before it names among
    /// [`Polygons::fabrics`].
    pub(crate) fabric: Option<u32>,
    /// Number of its objects and groups among [`Polygons::parts`].
    pub(crate) part: usize,
}

impl Polygon {
    /// The vertices of its corners.
    pub(crate) fn vertices(&self) -> impl Iterator<Item = u32> + Clone {
        self.corners.iter().map(|corner| corner.vertex)
    }

    /// The vertices of each of its sides, in its own sense.
    fn sides(&self) -> impl Iterator<Item = [u32; 2]> {
        self.vertices()
            .zip(self.vertices().cycle().skip(1))
            .map(|(a, b)| [a, b])
    }
}

/// A corner of a face: indices from 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) vertex: u32,
    pub(crate) texture: Option<usize>,
    /// Its place before the panels were sewn, where they were.
    pub(crate) loose: Option<u32>,
}

/// Place of a face in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// Line of a text, from 1.
    Line(usize),
    /// Number of the face, from 0.
    Face(usize),
}

impl Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Face(face) => write!(f, "face {face}"),
        }
    }
}

/// A mesh as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadMesh {
    /// The mesh and its labels.
    pub sheet: Sheet,
    /// Velocities of the vertices, where the file has them `[m/s]`, `[vertices]`.
    pub velocities: Option<Vec<DVec3>>,
    /// True where the file has rest angles, which the mesh then has.
    pub has_rest_angles: bool,
    /// The panels before they were sewn, where seams were named.
    pub loose: Option<LoosePanels>,
    /// True where each face's rest shape is its own form in space: there is no pattern.
    pub is_own_shape: bool,
    /// Warnings of what was mended or passed over.
    pub warnings: Vec<String>,
}

impl Polygons {
    /// The places of a polygon's corners.
    pub(crate) fn places(&self, polygon: &Polygon) -> Vec<DVec3> {
        let vertices = polygon.vertices();
        vertices.map(|v| self.positions[v as usize]).collect()
    }

    /// Number of the fabric of that name.
    pub(crate) fn fabric_of(&mut self, name: &str) -> u32 {
        let known = self.fabrics.iter().position(|known| known == name);
        let number = known.unwrap_or_else(|| {
            self.fabrics.push(name.to_owned());
            self.fabrics.len() - 1
        });
        number as u32
    }

    /// The vertices of the object or group that `key` of a scene names.
    pub(super) fn label(
        &self,
        name: &str,
        key: &'static str,
    ) -> Result<&BTreeSet<u32>, MeshFileError> {
        self.labels.get(name).ok_or_else(|| {
            let known: Vec<&str> = self.labels.keys().map(String::as_str).collect();
            MeshFileError::content(format!(
                "{key} names {name:?}, but the mesh has no object or group of that name; it has [{}]",
                known.join(", ")
            ))
        })
    }

    /// The error that faces make no sheet, which borders that were sewn may be at fault for.
    fn no_sheet(&self, problem: String) -> MeshFileError {
        MeshFileError::Content(if self.loose.is_empty() {
            problem
        } else {
            format!(
                "{problem}. That is so once the seams are sewn: name borders of panels that lie along each other, each in one seam"
            )
        })
    }

    /// The number of a vertex in the file.
    pub(crate) fn number(&self, vertex: u32) -> usize {
        let known = self.numbers.get(vertex as usize).copied();
        known.unwrap_or(vertex as usize)
    }
}

/// A file that is not a cloth.
pub type ReadMeshError = FileError<MeshFileError>;

/// Content that is not a cloth. Lines and vertices of an OBJ count from 1, as in the file; in other
/// formats vertices and faces count from 0.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says all")]
pub enum MeshFileError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("{0}")]
    Content(String),
    #[error("has no mesh, only nodes")]
    NoMesh,
}

impl MeshFileError {
    pub(crate) fn content(problem: impl Display) -> Self {
        Self::Content(problem.to_string())
    }
}

impl From<MeshError> for MeshFileError {
    fn from(error: MeshError) -> Self {
        Self::Content(format!("{error} (numbers from 0)"))
    }
}

#[cfg(test)]
mod tests;
