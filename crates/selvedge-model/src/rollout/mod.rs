//! A model in use: its network with normalizers, its file, and the stepper that moves a cloth with
//! it.

mod advance;
pub(crate) mod half;
mod hands;
pub(crate) mod model;
pub(crate) mod model_file;
mod names_once;
mod stepper;

pub use advance::{
    LocalAcceleration, NonFinite, TwoFrames, advance, advance_backward, target_acceleration,
};
pub use half::WeightType;
pub use model::{Model, ModelError, Normalizers};
pub use model_file::{MODEL_FORMAT, ModelFileError};
pub use stepper::{LearnedStepper, RolloutError, opening_frames};
