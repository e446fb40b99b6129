//! Errors of evaluations.

use selvedge_cloth::{ClothError, MotionError};
use selvedge_data::{DatasetError, SceneSpecError, WriteError};
use thiserror::Error;

use crate::folder::FolderError;
use crate::physics::{RestPoseError, RunTrajectoryError, SimulationError};
use crate::start::StartError;
use crate::workers::WorkerError;

/// A choice of cases, methods or numbers that makes no sense; the message names the field and the
/// remedy.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ChoiceError(pub String);

/// An evaluation that failed as a whole. A run that fails is no error, but a row that says so.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum EvaluateError {
    Choice(#[from] ChoiceError),
    Read(#[from] DatasetError),
    Folder(#[from] FolderError),
    RestPose(#[from] RestPoseError),
    Start(#[from] StartError),
    #[error("the reference run: {0}")]
    Reference(#[from] SimulationError),
    #[error("the resolved scene as JSON: {0}")]
    Scene(SceneSpecError),
    Trajectory(#[from] RunTrajectoryError),
    Cloth(#[from] ClothError),
    #[error("the recorded path of the handles: {0}")]
    Path(MotionError),
    #[error("{case}: the kept reference has vanished or changed: run it again")]
    Vanished {
        case: String,
    },
    Write(#[from] WriteError),
    Threads(#[from] WorkerError),
}
