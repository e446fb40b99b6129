//! Files of Selvedge: meshes, scenes, trajectories and data sets, and the metrics of two
//! trajectories.
//!
//! # Terms
//!
//! - A **trajectory** ([`Trajectory`]) is a cloth and its positions over time. [`record`] makes one
//!   from any [`Stepper`](selvedge_cloth::Stepper); [`Playback`] is a stepper again.
//! - A **scene file** ([`open_scene`]) is what a person writes: TOML, or ARCSim's JSON. A
//!   [`SceneSpec`] is the same with every default and name resolved, kept beside every result.
//! - A **data set** ([`Dataset`]) is a folder of trajectories with an index. A [`DatasetPreset`]
//!   describes it, a [`DatasetWriter`] makes it, and training reads **samples** ([`Sample`]: three
//!   frames in a row) from its **sections** ([`Section`]).
//! - [`metrics`] compares two runs, [`export`] writes trajectories for other programs, [`foreign`]
//!   makes them of arrays, and a [`Rig`] gives handles the motion of nodes in a .glb or
//!   .usda file.
//!
//! # Example
//!
//! A scene that is shipped, as a trajectory of one frame, written and read again:
//!
//! ```
//! use selvedge_cloth::Cloth;
//! use selvedge_data::{Provenance, Trajectory, metrics, open_scene};
//!
//! let loaded = open_scene("default")?;
//! let start: Vec<_> = loaded.scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
//! let cloth = Cloth::of_scene(&loaded.scene, start.clone())?;
//! let provenance = Provenance {
//!     frame_rate: loaded.scene.frame_rate,
//!     scene: loaded.spec.to_json()?,
//!     made_by: "an example".to_owned(),
//! };
//! let trajectory = Trajectory::new(cloth, start, provenance)?;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("start.safetensors");
//! trajectory.write(&path)?;
//! let read = Trajectory::read(&path)?;
//! assert_eq!(read, trajectory);
//! assert_eq!(metrics::position_rmse(read.frames(), trajectory.frames())?, 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/custom_stepper.rs` records, compares and exports a stepper of one's own.
//!
//! # What this crate does not do
//!
//! It knows neither the physics nor the learned model. Every file is read with everything in it
//! checked, and written beside its place and renamed ([`write_atomically`]).

// Help for tests names this crate as tests from outside do.
#[cfg(test)]
extern crate self as selvedge_data;

mod dataset;
pub mod export;
pub mod foreign;
mod formats;
pub mod metrics;
mod obstacle;
mod rest_poses;
mod rig;
mod scene;
#[cfg(test)]
mod test_help;
mod trajectory;

pub use dataset::merge::DatasetParts;
pub use dataset::plan::DatasetPlan;
pub use dataset::preset::{
    DatasetConfig, DatasetPreset, Forecast, NamedCloth, NamedMotion, PlannedRun, shipped_presets,
};
pub use dataset::sections::{Sample, Section, SectionRule};
pub use dataset::writer::DatasetWriter;
pub use dataset::{Dataset, DatasetIndex, DatasetStatistics, Entry, Split, Splits};
pub use formats::arrays::{Array, ArrayFile};
pub use formats::atomic::{
    WriteError, folder_of, is_empty_folder, is_writing, remove_parts, target_of, write_atomically,
    write_beside, write_folder_atomically,
};
pub use formats::file_error::{FileError, Problem, readable_path};
pub use formats::input::{ending_of, read_file, read_text};
pub use formats::mesh_file::read_mesh;
pub use formats::obj::{parse_obj_with, write_obj};
pub use formats::polygons::{
    MeshFileError, MeshOptions, PanelPlace, PatternSource, ReadMesh, ReadMeshError, RestAngles,
    SeamPair, Seams, Sewing, TextureUnit,
};
pub use formats::tensor_file::{TensorOut, TensorValues, read_header, write_tensors};
pub use formats::up_axis::UpAxis;
pub use obstacle::{
    BodySpec, Cuboid, FramesFile, NodeFile, ObstacleKeyframes, ObstacleMotion, ObstacleSpec,
    Placement, Plane, Sides, Sphere, Tube,
};
pub use rest_poses::{KeptRestPose, RestPoseFolder};
pub use rig::{MeshMotion, Rig, RigError, RigNode};
pub use scene::{
    LoadedScene, MeshSource, MeshSpec, ObjSource, Rotate, SceneSpec, Setting, StartSpec,
    StrainedEdge, Times, Transform, materials, open_material, open_scene, panel_stretches,
    parse_recorded_csv, parse_scene, read_scene, shipped_scenes, size_warning, strain_warnings,
    worst_edges,
};
pub use trajectory::file::TRAJECTORY_FORMAT;
pub use trajectory::frames::Frames;
pub use trajectory::obstacles::ObstacleTrack;
pub use trajectory::record::{Drive, Playback, Recording, RecordingEnd, record, record_steps};
pub use trajectory::state_file::{STATES_FORMAT, StateChoice, StateRun, StateSpec};
pub use trajectory::{Provenance, Trajectory};
