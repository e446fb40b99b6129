//! Files of Selvedge: meshes, scenes, trajectories and data sets, and the metrics of two
//! trajectories.
//!
//! Every file is read with everything in it checked and written beside its place and renamed
//! ([`write_atomically`]). This crate knows neither the physics nor the learned model: what moves
//! a cloth comes to it as a [`Stepper`](selvedge_cloth::Stepper).

mod dataset;
pub mod export;
pub mod foreign;
mod formats;
pub mod metrics;
mod rig;
mod scene;
mod trajectory;

pub use dataset::plan::DatasetPlan;
pub use dataset::preset::{
    DatasetConfig, DatasetPreset, Forecast, NamedCloth, NamedMotion, PlannedRun, shipped_presets,
};
pub use dataset::sections::{Sample, Section, SectionError, SectionRule};
pub use dataset::writer::DatasetWriter;
pub use dataset::{Dataset, DatasetError, DatasetIndex, DatasetStatistics, Entry, Split, Splits};
pub use formats::atomic::{WriteError, write_atomically, write_beside, write_folder_atomically};
pub use formats::npy::NpyError;
pub use formats::npz::NpzError;
pub use formats::obj::{
    ObjError, ObjOptions, ReadObjError, Seams, TextureUnit, parse_obj, parse_obj_with, read_obj,
    write_obj,
};
pub use formats::tensor_file::{TensorOut, TensorValues, write_tensors};
pub use formats::up_axis::UpAxis;
pub use metrics::distribution::{Distribution, Distributions, Histogram};
pub use rig::{Rig, RigError, RigNode};
pub use scene::{
    GeneratorSpec, GroupMotion, GroupMove, HandleGroup, HandleSelection, LoadedScene,
    MaterialSource, MaterialTable, MeshSource, MeshSpec, MeshSpecError, MotionSource,
    RecordedCsvError, ReleaseSpan, RigMotion, Rotate, SceneFileError, SceneProblem, SceneSpec,
    SceneSpecError, Setting, StartSpec, Transform, materials, open_scene, parse_recorded_csv,
    parse_scene, read_scene, shipped_scenes,
};
pub use trajectory::file::{ReadTrajectoryError, TrajectoryFileError};
pub use trajectory::frames::{Frames, FramesError};
pub use trajectory::playback::Playback;
pub use trajectory::record::{Drive, Recording, RecordingEnd, record};
pub use trajectory::state_file::{
    ReadStateError, STATES_FORMAT, SavedState, StateChoice, StateError, StateRun, StateSpec,
};
pub use trajectory::{Provenance, Trajectory, TrajectoryError};
