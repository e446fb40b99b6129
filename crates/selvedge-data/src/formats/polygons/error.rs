//! Errors of meshes in files.

use selvedge_cloth::MeshError;
use thiserror::Error;

use super::soup::Place;
use crate::formats::file_error::FileError;

/// A file that is not a cloth.
pub type ReadMeshError = FileError<MeshFileError>;

/// Content that is not a cloth. Lines and vertices of an OBJ count from 1, as in the file; in other
/// formats vertices and faces count from 0.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MeshFileError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("line {line}: {problem}")]
    Line { line: usize, problem: String },
    #[error("{problem}")]
    Content { problem: String },
    #[error("has no faces{}", without_faces(*vertices))]
    NoFaces { vertices: usize },
    #[error(
        "has no faces left once vertices within {tolerance} of each other are one: give a smaller mesh.weld, in the file's own unit of length"
    )]
    Collapsed { tolerance: f64 },
    #[error("has no mesh, only nodes")]
    NoMesh,
    #[error("{place}: this face names vertex {vertex} twice: remove it, or mend its corners")]
    RepeatedVertex { place: Place, vertex: usize },
    #[error(
        "vertex {vertex} has the texture coordinates {first} and {second}, which mesh.seams = \"refuse\" forbids: leave it out to sew the panels together there, or cut the cloth with mesh.seams = \"cut\""
    )]
    Seam {
        vertex: usize,
        first: String,
        second: String,
    },
    #[error(
        "the texture coordinates of the sheet of vertex {vertex} cannot be stretched along u and v to fit its shape: they need some extent along both; mend them, or take the rest shape from the form in space with mesh.pattern = \"shape\""
    )]
    Fit { vertex: usize },
    #[error(
        "{place}: this face has no texture coordinates, but others have: give it some, or take the rest shape from the form in space with mesh.pattern = \"shape\""
    )]
    MissingTexture { place: Place },
    #[error(
        "{place}: this face of {corners} corners crosses itself or has no area, so that it cannot be cut into triangles: mend it, or triangulate it"
    )]
    Polygon { place: Place, corners: usize },
    #[error(
        "{place}: this face has no area in the pattern ({area:e} m²): mend its texture coordinates, remove it, or take the rest shape from the form in space with mesh.pattern = \"shape\""
    )]
    NoArea { place: Place, area: f64 },
    #[error(
        "{}: the edge from vertex {} to vertex {} belongs to more than two faces (the mesh is not manifold there): separate the layers, each with vertices of its own",
        listed(places), vertices[0], vertices[1]
    )]
    NonManifold {
        places: Vec<Place>,
        vertices: [usize; 2],
    },
    #[error(
        "{} and {}: these faces run through the edge from vertex {} to vertex {} in the same direction, and no turning of faces mends it: the sheet is twisted into itself (as a Möbius strip is); cut it open there",
        places[0], places[1], vertices[0], vertices[1]
    )]
    Twisted {
        places: [Place; 2],
        vertices: [usize; 2],
    },
    #[error("{} and {}: these faces have the same three vertices: remove one of them", places[0], places[1])]
    Duplicate { places: [Place; 2] },
    #[error(
        "mesh.panels: the place of {panel:?} needs an axis that is a direction, and finite numbers"
    )]
    Place { panel: String },
    #[error(
        "seams: the vertices of {name:?} are not one line along the border of a panel, from one end to another: name the vertices of one line without gaps (l statements of a group); a border that is closed is two lines"
    )]
    Border { name: String },
    #[error("seams need a pattern: texture coordinates, or panels that lie flat in one plane")]
    NotFlat,
    #[error(
        "{0}. That is so once the seams are sewn: name borders of panels that lie along each other, each in one seam"
    )]
    Sewn(#[source] Box<MeshFileError>),
    #[error("mesh.weld must be finite and not negative, found {found}")]
    Weld { found: f64 },
    #[error("mesh.thread must be a direction, found {found}")]
    Thread { found: String },
    #[error("{0} (numbers from 0)")]
    Mesh(#[from] MeshError),
}

/// The rest of a message on a file without faces.
fn without_faces(vertices: usize) -> String {
    match vertices {
        0 => " and no vertices: it is empty, or no mesh of the kind that its name says".to_owned(),
        some => format!(
            ", only {some} vertices: a cloth needs at least one; export it as a mesh, not as points, lines or curves"
        ),
    }
}

impl MeshFileError {
    /// The same error, of a mesh whose borders `were_sewn`, if it can be theirs.
    #[must_use]
    pub(crate) fn of_sewn(self, were_sewn: bool) -> Self {
        match self {
            Self::RepeatedVertex { .. }
            | Self::NonManifold { .. }
            | Self::Twisted { .. }
            | Self::Duplicate { .. }
                if were_sewn =>
            {
                Self::Sewn(Box::new(self))
            }
            other => other,
        }
    }

    /// Returns true where the file is of a kind that has meshes, but this one has none.
    #[must_use]
    pub fn is_without_mesh(&self) -> bool {
        matches!(self, Self::NoMesh)
    }
}

fn listed(places: &[Place]) -> String {
    let words: Vec<String> = places.iter().map(ToString::to_string).collect();
    words.join(", ")
}
