//! A rig and its nodes: a tree of transforms that change over time.

use glam::{DMat4, DQuat, DVec3};

use super::track::Track;

/// Nodes that move.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    pub(super) nodes: Vec<RigNode>,
    /// Transform from the world of the file to ours.
    pub(super) world: DMat4,
    /// The time at which its motions begin `[s]`: that of the first key in the file, or where a
    /// stage begins, if that is earlier. What has its first key later rests until then.
    pub(super) start: f64,
    /// Warnings of what of its meshes is not read.
    pub(super) warnings: Vec<String>,
}

/// A node of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigNode {
    /// Name of the node in the file.
    pub name: String,
    pub(super) parent: Option<usize>,
    pub(super) operations: Vec<Operation>,
    /// Reason why its place cannot be said.
    pub(super) obstacle: Option<String>,
}

/// A part of a node's transform.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Operation {
    pub(super) change: Change,
    /// True where it is undone.
    pub(super) is_inverse: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    Translation(Track<DVec3>),
    Scale(Track<DVec3>),
    Turn(Track<DQuat>),
    /// Turns by these angles [degrees] about x, y and z, in the order of these axes (0 is x).
    Angles(Track<DVec3>, &'static [usize]),
    Matrix(Track<DMat4>),
}

impl Operation {
    pub(super) fn new(change: Change) -> Self {
        Self {
            change,
            is_inverse: false,
        }
    }

    pub(super) fn at(&self, time: f64) -> DMat4 {
        let matrix = self.change.at(time);
        match self.is_inverse {
            false => matrix,
            true => matrix.inverse(),
        }
    }
}

impl Change {
    /// The times of its keys `[s]`; none where nothing changes.
    pub(super) fn keys(&self) -> &[f64] {
        match self {
            Self::Translation(track) | Self::Scale(track) | Self::Angles(track, _) => track.keys(),
            Self::Turn(track) => track.keys(),
            Self::Matrix(track) => track.keys(),
        }
    }

    pub(super) fn at(&self, time: f64) -> DMat4 {
        match self {
            Self::Translation(track) => DMat4::from_translation(track.at(time)),
            Self::Scale(track) => DMat4::from_scale(track.at(time)),
            Self::Turn(track) => DMat4::from_quat(track.at(time).normalize()),
            Self::Angles(track, order) => {
                let angles = track.at(time);
                // The first axis turns first, and so stands innermost.
                order.iter().fold(DMat4::IDENTITY, |matrix, &axis| {
                    let turn = DQuat::from_axis_angle(DVec3::AXES[axis], angles[axis].to_radians());
                    DMat4::from_quat(turn) * matrix
                })
            }
            Self::Matrix(track) => track.at(time),
        }
    }
}
