//! Learning to correct physics: from samples of what a cheap frame lacks, made while it learns.
//!
//! A **teacher**, converged physics, is asked for the frame after a state that cheap physics has
//! just predicted from; the difference is what the network has to add. The states are the teacher's
//! own at first and those that the corrected physics gets itself into later, so that the network
//! learns what to do there. There is no data set. Who moves the cloths makes the samples and hands
//! them to a [`CorrectionTrainer`], which keeps the latest ones and learns from each several times.

mod checkpoint;
mod config;
mod learning;
mod run;
mod store;
mod trainer;

pub use checkpoint::{CORRECTION_FORMAT, ResumeCorrectionError, SaveCorrectionError};
pub use config::{CorrectionConfig, SampleConfig, TeacherConfig};
pub use run::{CorrectionEvent, RunCorrectionError, SampleSource, run_correction};
pub use store::CorrectionSample;
pub use trainer::{CorrectionReport, CorrectionTrainError, CorrectionTrainer};
