//! The ways in which a file can say how handles move.

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::motion::named;
use selvedge_cloth::{Keyframe, KeyframeGroup, KeyframeMotion, Motion};
use serde::Deserialize;

use super::file::{SceneProblem, field, parse_toml, read_text};
use super::handle_selection::Groups;
use super::recorded_csv::parse_recorded_csv;

/// One way to say how the handles move; paths are relative to the file that names them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionSource {
    /// A motion that has a name.
    Named(String),
    /// A motion written out.
    Inline(Motion),
    /// A TOML file with a motion written out.
    File(PathBuf),
    /// A CSV file with one position per handle and frame.
    Recorded(PathBuf),
    /// Keyframes for groups of handles, by name.
    Groups(GroupMotion),
}

/// Groups of handles that move rigidly from keyframe to keyframe; a group without moves stays.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupMotion {
    /// How long the motion lasts `[s]`; a whole number of frames of 1/60 s.
    pub duration: f64,
    /// At most one per group.
    #[serde(default)]
    pub moves: Vec<GroupMove>,
}

/// How a group moves.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupMove {
    /// The group's name.
    pub group: String,
    /// The axis of its rotations, through its centre; upwards if there is none.
    #[serde(default = "upwards")]
    pub axis: DVec3,
    /// Where it is when.
    pub keyframes: Vec<Keyframe>,
}

fn upwards() -> DVec3 {
    DVec3::Y
}

impl GroupMotion {
    fn resolve(&self, groups: &Groups) -> Result<Motion, SceneProblem> {
        let handles = |name: &String| {
            let group = groups.iter().find(|group| group.0 == *name);
            group.map(|group| group.1.clone().collect()).ok_or_else(|| {
                let known: Vec<&str> = groups.iter().map(|group| group.0.as_str()).collect();
                let known = known.join(", ");
                let problem =
                    format!("no group of handles is called {name:?}; there are [{known}]");
                field("motion.groups.moves.group", problem)
            })
        };
        let moves = self.moves.iter().map(|moves| {
            Ok(KeyframeGroup {
                handles: handles(&moves.group)?,
                axis: moves.axis,
                keyframes: moves.keyframes.clone(),
            })
        });
        Ok(Motion::Keyframes(KeyframeMotion {
            duration: self.duration,
            groups: moves.collect::<Result<_, SceneProblem>>()?,
        }))
    }
}

impl MotionSource {
    /// Looks up what is named; `groups` are those of the handles.
    pub(crate) fn resolve(&self, folder: &Path, groups: &Groups) -> Result<Motion, SceneProblem> {
        match self {
            Self::Named(name) => named::by_name(name).ok_or_else(|| {
                let known = named::names().join(", ");
                field(
                    "motion.named",
                    format!("no motion is called {name:?}; known are {known}"),
                )
            }),
            Self::Inline(motion) => Ok(motion.clone()),
            Self::Groups(motion) => motion.resolve(groups),
            Self::File(path) => {
                let path = folder.join(path);
                let text = read_text(&path).map_err(|problem| {
                    field("motion.file", format!("{}: {problem}", path.display()))
                })?;
                parse_toml(&text).map_err(|problem| {
                    field("motion.file", format!("{}: {problem}", path.display()))
                })
            }
            Self::Recorded(path) => {
                let path = folder.join(path);
                let named = |problem: String| {
                    field("motion.recorded", format!("{}: {problem}", path.display()))
                };
                let text = read_text(&path).map_err(|error| named(error.to_string()))?;
                let motion = parse_recorded_csv(&text).map_err(|error| named(error.to_string()))?;
                Ok(Motion::Recorded(motion))
            }
        }
    }
}
