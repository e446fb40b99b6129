//! Polygons over vertices, as a file of another program has them, and the mesh that is made of
//! them: welded, turned one way, cut into triangles, with a rest shape for each.
//!
//! The rest shape comes from texture coordinates, which are material coordinates `[m]`, from the
//! plane of a flat sheet, or from the form that the mesh has in space.

mod assemble;
mod border;
mod clean;
mod error;
mod fit;
mod options;
mod orient;
mod sew;
mod shape;
mod slits;
mod soup;
mod triangulate;
mod weld;

pub(crate) use self::assemble::assemble;
pub use self::error::{MeshFileError, ReadMeshError};
pub use self::options::{MeshOptions, PatternSource, RestAngles, Seams, TextureUnit};
pub(crate) use self::sew::sew;
pub use self::sew::{PanelPlace, SeamPair, Sewing};
pub use self::soup::ReadMesh;
pub(crate) use self::soup::{Corner, Place, Polygon, Polygons};
pub(crate) use self::triangulate::{triangles_in_space, triangles_of_body};
pub(crate) use self::weld::owners;

#[cfg(test)]
mod tests;
