//! Obstacles in files: what a scene says of them ([`ObstacleFile`], TOML), what is resolved from it
//! and kept with every result ([`ObstacleSpec`]), and the readers of bodies and of their motions.
//!
//! A body is a mesh from a file, one that is shipped, or a simple one made here. It is still, moves
//! by keyframes or with a node of a rig, or its points move as a file says: a .pc2,
//! an .npz, a .usda with samples, a .glb with morph targets and skins.

mod body;
mod motion;
mod read;
mod spec;
mod weld;
mod written;

pub use self::body::{BodySpec, Cuboid, Plane, Sides, Sphere, Tube};
pub use self::motion::{FramesFile, NodeFile, ObstacleKeyframes, ObstacleMotion};
pub use self::spec::{ObstacleSpec, Placement};
pub(crate) use self::written::ObstacleFile;

#[cfg(test)]
mod tests;
