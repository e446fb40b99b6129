//! Geometry of contact between a cloth, itself and obstacles: which pairs of features could meet,
//! how near they are, a proof that they stay apart while they move, a push that keeps them apart,
//! and an exact test for intersections. Knows neither forces nor files.
//!
//! All bodies are one [`CollisionMesh`]: the points of the cloth first, then those of each obstacle. A
//! [`Pair`] is a vertex and a face, or two edges, without a common vertex. Whatever meets first
//! when meshes of triangles that did not touch begin to, is such a pair.
//!
//! ```
//! use glam::DVec3;
//! use selvedge_contact::{Pair, Path, certify};
//!
//! // A vertex that falls onto a triangle, and stops above it or goes through.
//! let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
//! let at = |z: f64| [DVec3::new(0.2, 0.2, z), face[0], face[1], face[2]];
//! let pair = Pair::vertex_face(0, 0, [0, 1, 2, 3]);
//! assert!(certify(pair.kind, Path { from: at(1.0), to: at(0.1) }, 0.01).is_ok());
//! assert!(certify(pair.kind, Path { from: at(1.0), to: at(-1.0) }, 0.01).is_err());
//! ```

mod boxes;
mod candidates;
mod certificate;
mod closest;
mod collision_mesh;
mod eight;
mod intersect;
pub mod number;
mod pair;
mod patches;
mod release;

pub use boxes::Bounds;
pub use candidates::{Candidates, Reach, SweptBoxes, Ways};
pub use certificate::{
    Impact, Path, Straight, approach, at_impact, certify, certify_straight, certify_turning, extent,
};
pub use closest::{Gap, Push, gap, least_gap, push};
pub use collision_mesh::{Body, CollisionEdge, CollisionMesh};
pub use eight::{Gaps, gaps, weights};
pub use intersect::{Intersection, triangles_meet};
pub use pair::{Kind, Pair};
pub use release::{Released, winding};
