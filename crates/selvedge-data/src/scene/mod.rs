//! Scenes in files: what a person writes ([`read_scene`], TOML, or ARCSim's JSON), what is resolved
//! from it and kept with every result ([`SceneSpec`], JSON), and what is shipped.

mod arcsim;
mod file;
mod handle_selection;
mod loaded;
mod material_source;
mod mesh_spec;
mod motion_source;
mod physics_file;
mod problem;
mod recorded_csv;
mod setting_file;
mod spec;
mod strained;

pub use file::{open_scene, parse_scene, read_scene, shipped_scenes};
pub(crate) use handle_selection::HandleSelection;
pub use loaded::LoadedScene;
pub(crate) use material_source::MaterialSource;
pub use material_source::{materials, open_material};
pub use mesh_spec::{MeshSource, MeshSpec, ObjSource, Rotate, Transform, size_warning};
pub(crate) use motion_source::{MotionSource, Stand};
pub(crate) use problem::{field, not_understood, parse_toml, read_text, unknown};
pub use recorded_csv::parse_recorded_csv;
pub(crate) use setting_file::{
    MeshFile, ResolvedSetting, SettingFile, resolved_obstacles, usual_contact,
};
pub use spec::{SceneSpec, Setting, StartSpec};
pub use strained::{StrainedEdge, Times, panel_stretches, strain_warnings, worst_edges};
