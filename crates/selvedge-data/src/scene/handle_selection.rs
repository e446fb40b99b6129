//! Selection of the held vertices in a file: by number, by label, in a box, or in
//! groups that have a name, move together and may let go for a while.

use std::ops::Range;

use glam::DVec3;
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::{HandleSchedule, Release};
use serde::Deserialize;

use super::problem::field;
use crate::formats::file_error::Problem;

/// A choice of the held vertices: exactly one of `vertices`, `label`, `box` and `groups`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HandleSelection {
    /// By number, from 0; the order is that of the handles.
    vertices: Option<Vec<u32>>,
    /// By the label of a generated mesh, or the name of an object or group of an OBJ.
    label: Option<String>,
    /// All start positions in a box, its faces included, by number.
    r#box: Option<BoxTable>,
    /// Groups, one after another.
    groups: Option<Vec<HandleGroup>>,
    /// Only groups have it, but people write it here.
    released: Option<Vec<ReleaseSpan>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxTable {
    /// Smallest x, y and z `[m]`.
    min: DVec3,
    /// Largest x, y and z `[m]`.
    max: DVec3,
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
        let Some(groups) = &self.groups else {
            return Ok(Selected {
                vertices: self.vertices(sheet)?,
                ..Selected::default()
            });
        };
        self.check()?;
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

    /// Checks that it says which vertices are meant in one way.
    fn check(&self) -> Result<(), Problem> {
        let ways = [
            self.vertices.is_some(),
            self.label.is_some(),
            self.r#box.is_some(),
            self.groups.is_some(),
        ];
        let problem = if self.released.is_some() {
            "released belongs to a group: groups = [{ name = \"all\", select = { label = \"…\" }, released = […] }]"
        } else if ways.into_iter().filter(|way| *way).count() != 1 {
            "say which vertices are handles in exactly one way: vertices, label, box or groups"
        } else {
            return Ok(());
        };
        Err(field("handles", problem))
    }

    fn vertices(&self, sheet: &Sheet) -> Result<Vec<u32>, Problem> {
        self.check()?;
        if let Some(name) = &self.label {
            return sheet.labels.get(name).cloned().ok_or_else(|| {
                let known: Vec<&str> = sheet.labels.keys().map(String::as_str).collect();
                let known = known.join(", ");
                let problem = format!("the mesh has no label {name:?}; it has [{known}]");
                field("handles.label", problem)
            });
        }
        if let Some(BoxTable { min, max }) = self.r#box {
            let is_inside = |p: &DVec3| p.cmpge(min).all() && p.cmple(max).all();
            let positions = sheet.mesh.positions().iter().zip(0_u32..);
            let inside: Vec<u32> = positions
                .filter(|(position, _)| is_inside(position))
                .map(|(_, vertex)| vertex)
                .collect();
            if inside.is_empty() {
                let problem = format!("no vertex starts between {min} and {max}");
                return Err(field("handles.box", problem));
            }
            return Ok(inside);
        }
        self.vertices.clone().ok_or_else(|| {
            let problem = "selects groups: take vertices, label or box";
            field("handles.groups.select", problem)
        })
    }
}
