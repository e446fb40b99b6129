//! Source of the motion of handles in a file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use selvedge_cloth::motion::named;
use selvedge_cloth::{Keyframe, KeyframeGroup, KeyframeMotion, Mesh, Motion, RecordedMotion};
use serde::Deserialize;

use super::handle_selection::Groups;
use super::problem::{field, parse_toml, read_text};
use super::recorded_csv::parse_recorded_csv;
use super::spec::Setting;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{ending_of, read_file};
use crate::formats::npz::NpzPoints;
use crate::rig::Rig;

/// One way to say how the handles move; paths are relative to the file that names them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum MotionSource {
    /// A motion that has a name.
    Named(String),
    /// A motion written out.
    Inline(Motion),
    /// A TOML file with a motion written out.
    File(PathBuf),
    /// A file with one position per handle and frame: CSV, or NumPy's .npz.
    Recorded(PathBuf),
    /// A file of another program (.glb, USD) with nodes that the handles follow.
    Rig(RigMotion),
    /// Keyframes for groups of handles, by name.
    Groups(GroupMotion),
}

impl Default for MotionSource {
    /// Handles that hold still.
    fn default() -> Self {
        Self::Named("still".to_owned())
    }
}

/// Nodes that handles follow, each rigidly from where it starts.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigMotion {
    /// The file with the nodes.
    pub(crate) file: PathBuf,
    /// The node of each group of handles, or of each handle where there are no groups. If there are
    /// none: nodes that are called as the groups, or `handle_0`, `handle_1` and so on.
    #[serde(default)]
    pub(crate) nodes: Option<Vec<String>>,
    /// Name of the animation in a .glb that has several.
    #[serde(default)]
    pub(crate) animation: Option<String>,
}

/// The handles before they move.
pub(crate) struct Stand<'a> {
    /// Groups of the handles; empty where there are none.
    pub(crate) groups: &'a Groups,
    /// Start positions of the handles `[m]`, `[handles]`.
    pub(crate) start: Vec<DVec3>,
    /// Frames per second of the scene.
    pub(crate) frame_rate: f64,
}

impl<'a> Stand<'a> {
    /// The handles of `setting` on its mesh; one that the mesh does not have is reported when the
    /// scene is built.
    pub(crate) fn of(setting: &Setting, mesh: &Mesh, groups: &'a Groups) -> Self {
        let position = |&vertex: &u32| mesh.positions().get(vertex as usize).copied();
        let start = setting
            .handles
            .iter()
            .map(|v| position(v).unwrap_or_default());
        Self {
            groups,
            start: start.collect(),
            frame_rate: setting.frame_rate,
        }
    }
}

impl RigMotion {
    fn resolve(&self, folder: &Path, stand: &Stand<'_>) -> Result<Motion, Problem> {
        let nodes = self.nodes_of(stand)?;
        let (file, animation) = (folder.join(&self.file), self.animation.as_deref());
        let frames = Rig::read_motion(&file, animation, &nodes, stand.frame_rate)
            .map_err(|error| field("motion.rig", error.to_string()))?;
        let moved = |frame: &Vec<DMat4>| {
            let pairs = frame.iter().zip(&stand.start);
            pairs.map(|(node, p)| node.transform_point3(*p)).collect()
        };
        let positions = frames.iter().map(moved).collect();
        Ok(Motion::Recorded(RecordedMotion { positions }))
    }

    /// The name of each handle's node.
    fn nodes_of(&self, stand: &Stand<'_>) -> Result<Vec<String>, Problem> {
        let alone = |k: usize| (format!("handle_{k}"), k..k + 1);
        let single: Groups = (0..stand.start.len()).map(alone).collect();
        let (groups, what) = if stand.groups.is_empty() {
            (&single, "handles")
        } else {
            (stand.groups, "groups of handles")
        };
        let default = || groups.iter().map(|group| group.0.clone()).collect();
        let names: Vec<String> = self.nodes.clone().unwrap_or_else(default);
        let (found, expected) = (names.len(), groups.len());
        if found != expected {
            let problem = format!("names {found} nodes, but there are {expected} {what}");
            return Err(field("motion.rig.nodes", problem));
        }
        let of_group = |(name, group): (&String, &(String, Range<usize>))| {
            std::iter::repeat_n(name.clone(), group.1.len())
        };
        Ok(names.iter().zip(groups).flat_map(of_group).collect())
    }
}

/// The motion in a file: CSV, or an archive with `positions` `[frames, handles, 3]` `[m]`. Where
/// the archive has `handles`, as in an export, these vertices of `[frames, vertices, 3]` are taken;
/// a rate in it must be that of the scene.
fn read_recorded(path: &Path, frame_rate: f64) -> Result<RecordedMotion, Problem> {
    if ending_of(path) == "npz" {
        let unread = |error| Problem(format!("could not be read: {error}"));
        let read = NpzPoints::read(&read_file(path).map_err(unread)?)?;
        if let Some(found) = read.frame_rate.filter(|&found| found != frame_rate) {
            let expected = format!("{frame_rate}, the frame rate of the scene");
            return Err(Problem::array("fps", &expected, found));
        }
        let of_handles = |frame: Vec<DVec3>| match &read.handles {
            Some(handles) => handles.iter().map(|&h| frame[h as usize]).collect(),
            None => frame,
        };
        let positions = read.frames.into_iter().map(of_handles).collect();
        return Ok(RecordedMotion { positions });
    }
    parse_recorded_csv(&read_text(path)?)
}

/// Groups of handles that move rigidly from keyframe to keyframe; a group without moves stays.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GroupMotion {
    /// Duration of the motion `[s]`; a whole number of frames of 1/60 s.
    pub(crate) duration: f64,
    /// At most one per group.
    #[serde(default)]
    pub(crate) moves: Vec<GroupMove>,
}

/// Motion of one group.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GroupMove {
    /// The group's name.
    pub(crate) group: String,
    /// The axis of its rotations, through its centre; upwards if there is none.
    #[serde(default = "crate::formats::up_axis::up")]
    pub(crate) axis: DVec3,
    /// Places of the group over time.
    pub(crate) keyframes: Vec<Keyframe>,
}

impl GroupMotion {
    fn resolve(&self, groups: &Groups) -> Result<Motion, Problem> {
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
            groups: moves.collect::<Result<_, Problem>>()?,
        }))
    }
}

impl MotionSource {
    /// The file that it is read from, relative to the file that names it.
    pub(super) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::Recorded(path) => Some(path.as_path()),
            Self::Rig(motion) => Some(motion.file.as_path()),
            Self::Named(_) | Self::Inline(_) | Self::Groups(_) => None,
        }
    }

    /// Looks up what is named, for handles that stand so.
    pub(crate) fn resolve(&self, folder: &Path, stand: &Stand<'_>) -> Result<Motion, Problem> {
        match self {
            Self::Named(name) => named::by_name(name).ok_or_else(|| {
                let known = named::names().join(", ");
                let problem = format!("no motion is called {name:?}; known are {known}");
                field("motion.named", problem)
            }),
            Self::Inline(motion) => Ok(motion.clone()),
            Self::Groups(motion) => motion.resolve(stand.groups),
            Self::File(path) => {
                let path = folder.join(path);
                let motion = read_text(&path).and_then(|text| parse_toml(&text));
                let motion = motion.map_err(FileError::at(&path));
                motion.map_err(|error| field("motion.file", error))
            }
            Self::Recorded(path) => {
                let path = folder.join(path);
                let motion = read_recorded(&path, stand.frame_rate);
                let motion = motion.map_err(FileError::at(&path));
                let motion = motion.map_err(|error| field("motion.recorded", error))?;
                Ok(Motion::Recorded(motion))
            }
            Self::Rig(motion) => motion.resolve(folder, stand),
        }
    }
}
