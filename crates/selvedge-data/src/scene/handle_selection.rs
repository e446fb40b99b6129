//! Selection of the held vertices in a file: by number, by label, in a box, or in
//! groups that have a name, move together and may let go for a while.

use std::ops::Range;

use glam::DVec3;
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::{HandleSchedule, Release};
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::problem::field;
use crate::formats::file_error::Problem;

/// A choice of the held vertices, in exactly one way.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "SelectionTable")]
pub(crate) enum HandleSelection {
    /// By number, from 0; the order is that of the handles.
    Vertices(Vec<u32>),
    /// By the label of a generated mesh, or the name of an object or group of an OBJ.
    Label(String),
    /// All start positions in a box, its faces included, by number.
    Box {
        /// Smallest x, y and z `[m]`.
        min: DVec3,
        /// Largest x, y and z `[m]`.
        max: DVec3,
    },
    /// Groups, one after another.
    Groups(Vec<HandleGroup>),
}

/// A selection as it stands in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SelectionTable {
    vertices: Option<Vec<u32>>,
    label: Option<String>,
    r#box: Option<BoxTable>,
    groups: Option<Vec<HandleGroup>>,
    /// Only groups have it, but people write it here.
    released: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxTable {
    min: DVec3,
    max: DVec3,
}

impl Default for HandleSelection {
    /// None: the cloth is free.
    fn default() -> Self {
        Self::Vertices(Vec::new())
    }
}

impl TryFrom<SelectionTable> for HandleSelection {
    type Error = &'static str;

    fn try_from(table: SelectionTable) -> Result<Self, Self::Error> {
        if table.released.is_some() {
            return Err(
                "released belongs to a group: groups = [{ name = \"all\", select = { label = \"…\" }, released = […] }]",
            );
        }
        let within = |BoxTable { min, max }| Self::Box { min, max };
        let ways = [
            table.vertices.map(Self::Vertices),
            table.label.map(Self::Label),
            table.r#box.map(within),
            table.groups.map(Self::Groups),
        ];
        let mut said = ways.into_iter().flatten();
        match (said.next(), said.next()) {
            (Some(only), None) => Ok(only),
            _ => Err(
                "say which vertices are handles in exactly one way: vertices, label, box or groups",
            ),
        }
    }
}

/// Handles that have a name.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HandleGroup {
    /// Name of the group, as the motion uses it.
    pub(crate) name: String,
    /// The vertices of the group; not groups again.
    pub(crate) select: HandleSelection,
    /// Spans of time in which the group lets go.
    #[serde(default)]
    pub(crate) released: Vec<ReleaseSpan>,
}

/// A span of time in which a group is let go.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReleaseSpan {
    /// Start of the span `[s]`.
    pub(crate) from: f64,
    /// End of the span `[s]`; none for good.
    #[serde(default)]
    pub(crate) to: Option<f64>,
}

/// The names of groups, and which handles are theirs.
pub(crate) type Groups = Vec<(String, Range<usize>)>;

/// The chosen handles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Selected {
    /// Vertices of the handles, in order.
    pub(crate) vertices: Vec<u32>,
    /// Groups of the handles; empty where there are none.
    pub(crate) groups: Groups,
    /// Times at which handles let go.
    pub(crate) schedule: HandleSchedule,
}

impl HandleSelection {
    /// The vertices of `sheet` that are chosen.
    pub(crate) fn select(&self, sheet: &Sheet) -> Result<Selected, Problem> {
        let Self::Groups(groups) = self else {
            return Ok(Selected {
                vertices: self.vertices(sheet)?,
                ..Selected::default()
            });
        };
        let mut selected = Selected::default();
        for group in groups {
            if selected.groups.iter().any(|(name, _)| *name == group.name) {
                let problem = format!("two groups are called {:?}", group.name);
                return Err(field("handles.groups", problem));
            }
            let first = selected.vertices.len();
            selected.vertices.extend(group.select.vertices(sheet)?);
            let handles = first..selected.vertices.len();
            let releases = group.released.iter().map(|span| Release {
                handles: handles.clone().collect(),
                from: span.from,
                to: span.to,
            });
            let schedule = HandleSchedule {
                releases: releases.collect(),
            };
            schedule.validate(handles.end).map_err(|error| {
                let problem = format!("{:?}: {error}", group.name);
                field("handles.groups", problem)
            })?;
            selected.schedule.releases.extend(schedule.releases);
            selected.groups.push((group.name.clone(), handles));
        }
        Ok(selected)
    }

    fn vertices(&self, sheet: &Sheet) -> Result<Vec<u32>, Problem> {
        match self {
            Self::Vertices(vertices) => Ok(vertices.clone()),
            Self::Label(name) => sheet.labels.get(name).cloned().ok_or_else(|| {
                let known: Vec<&str> = sheet.labels.keys().map(String::as_str).collect();
                let known = known.join(", ");
                let problem = format!("the mesh has no label {name:?}; it has [{known}]");
                field("handles.label", problem)
            }),
            Self::Box { min, max } => {
                let is_inside = |p: &DVec3| p.cmpge(*min).all() && p.cmple(*max).all();
                let positions = sheet.mesh.positions().iter().zip(0_u32..);
                let inside: Vec<u32> = positions
                    .filter(|(position, _)| is_inside(position))
                    .map(|(_, vertex)| vertex)
                    .collect();
                if inside.is_empty() {
                    let problem = format!("no vertex starts between {min} and {max}");
                    return Err(field("handles.box", problem));
                }
                Ok(inside)
            }
            Self::Groups(_) => {
                let problem = "selects groups: take vertices, label or box";
                Err(field("handles.groups.select", problem))
            }
        }
    }
}
