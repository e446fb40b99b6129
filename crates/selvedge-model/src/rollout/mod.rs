//! A model in use: its network with normalizers, its file, and the stepper that moves a cloth with
//! it.

mod advance;
pub(crate) mod model;
pub(crate) mod model_file;
mod names_once;
mod state;
mod stepper;

pub use advance::{LocalAcceleration, NonFinite, TwoFrames, advance, advance_backward};
pub use model::{Model, Normalizers};
pub use model_file::{MODEL_FORMAT, ModelFileError, WeightType};
pub use state::RolloutError;
pub use stepper::{Inference, LearnedStepper, OnProcessor};
