//! A model in use: its network with normalizers, its file, and the stepper that moves a cloth with
//! it.

pub(crate) mod half;
pub(crate) mod model;
pub(crate) mod model_file;
mod stepper;

pub use half::WeightType;
pub use model::{Model, ModelError, Normalizers};
pub use model_file::{MODEL_FORMAT, ModelFileError};
pub use stepper::{LearnedStepper, RolloutError, integrate, opening_frames};
