//! The axis that points up, here and elsewhere. Ours is y; what has z up is turned by a quarter
//! about x.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Axis of a foreign world that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpAxis {
    /// y, as here.
    #[default]
    Y,
    /// z, as in ARCSim and Blender: their (x, y, z) is our (x, z, -y).
    Z,
}

/// The axis of a turn where none is written.
pub(crate) fn up() -> DVec3 {
    DVec3::Y
}

impl UpAxis {
    /// A point of the foreign world in ours.
    pub(crate) fn to_ours(self, p: DVec3) -> DVec3 {
        match self {
            Self::Y => p,
            Self::Z => DVec3::new(p.x, p.z, -p.y),
        }
    }

    /// A point of our world in the foreign one, exactly.
    pub(crate) fn to_theirs(self, p: Vec3) -> Vec3 {
        match self {
            Self::Y => p,
            Self::Z => Vec3::new(p.x, -p.z, p.y),
        }
    }
}
