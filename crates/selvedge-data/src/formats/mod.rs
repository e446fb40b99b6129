//! Containers and plain formats that the files of this crate are made of: reading, atomic writing,
//! safetensors, JSON, NumPy arrays and archives, meshes of polygons, Wavefront OBJ, Alembic's
//! container, the axis that points up.

pub(crate) mod arrays;
pub(crate) mod atomic;
pub(crate) mod extent;
pub(crate) mod file_error;
pub(crate) mod input;
pub(crate) mod mesh_file;
pub(crate) mod npy;
pub(crate) mod npz;
pub(crate) mod obj;
pub(crate) mod ogawa;
pub(crate) mod packing;
pub(crate) mod pc2;
pub(crate) mod polygons;
pub(crate) mod tensor_file;
pub(crate) mod up_axis;
