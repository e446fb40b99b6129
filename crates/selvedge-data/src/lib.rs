//! Files of Selvedge: meshes, scenes, trajectories and data sets, and the metrics of two
//! trajectories.
//!
//! Every file is read with everything in it checked and written beside its place and renamed
//! ([`write_atomically`]). This crate knows neither the physics nor the learned model: what moves
//! a cloth comes to it as a [`Stepper`](selvedge_cloth::Stepper).

mod atomic;
mod dataset;
mod dataset_writer;
mod distribution;
pub mod export;
pub mod foreign;
mod frames;
pub mod metrics;
mod npy;
mod npz;
mod obj;
mod playback;
mod preset;
mod record;
mod rig;
mod scene;
mod sections;
mod state_file;
mod tensor_file;
mod trajectory;
mod trajectory_file;
mod up_axis;

pub use atomic::{WriteError, write_atomically, write_beside, write_folder_atomically};
pub use dataset::{Dataset, DatasetError, DatasetIndex, DatasetStatistics, Entry, Split, Splits};
pub use dataset_writer::{DatasetPlan, DatasetWriter};
pub use distribution::{Distribution, Distributions, Histogram};
pub use frames::{Frames, FramesError};
pub use npy::NpyError;
pub use npz::NpzError;
pub use obj::{
    ObjError, ObjOptions, ReadObjError, Seams, TextureUnit, parse_obj, parse_obj_with, read_obj,
    write_obj,
};
pub use playback::Playback;
pub use preset::{
    DatasetConfig, DatasetPreset, Forecast, NamedCloth, NamedMotion, PlannedRun, shipped_presets,
};
pub use record::{Drive, Recording, RecordingEnd, record};
pub use rig::{Rig, RigError, RigNode};
pub use scene::{
    GeneratorSpec, GroupMotion, GroupMove, HandleGroup, HandleSelection, LoadedScene,
    MaterialSource, MaterialTable, MeshSource, MeshSpec, MeshSpecError, MotionSource,
    RecordedCsvError, ReleaseSpan, RigMotion, Rotate, SceneFileError, SceneProblem, SceneSpec,
    SceneSpecError, Setting, StartSpec, Transform, materials, open_scene, parse_recorded_csv,
    parse_scene, read_scene, shipped_scenes,
};
pub use sections::{Sample, Section, SectionError, SectionRule};
pub use state_file::{
    ReadStateError, STATES_FORMAT, SavedState, StateChoice, StateError, StateRun, StateSpec,
};
pub use tensor_file::{TensorOut, TensorValues, write_tensors};
pub use trajectory::{Cloth, Provenance, Trajectory, TrajectoryError};
pub use trajectory_file::{ReadTrajectoryError, TrajectoryFileError};
pub use up_axis::UpAxis;
