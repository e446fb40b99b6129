//! Polygons over vertices, as a file has them, and the mesh that was made of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::error::MeshFileError;
use glam::{DVec2, DVec3};
use selvedge_cloth::LoosePanels;
use selvedge_cloth::generate::Sheet;

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

impl fmt::Display for Place {
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

    /// The number of a vertex in the file.
    pub(crate) fn number(&self, vertex: u32) -> usize {
        let known = self.numbers.get(vertex as usize).copied();
        known.unwrap_or(vertex as usize)
    }
}
