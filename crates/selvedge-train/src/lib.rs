//! Learning: what a prediction is judged by, how weights follow, how samples are drawn and put
//! together, the loop, and checkpoints from which it goes on bit for bit.

mod checkpoint;
mod config;
mod engine;
mod fit_normalizers;
mod losses;
mod memory;
mod optimizer;
mod origin;
mod rollout_target;
mod run;
mod schedule;
mod slot;
#[cfg(test)]
mod test_data;
mod trainer;
mod training_set;

pub use checkpoint::{CHECKPOINT_FORMAT, ResumeError};
pub use config::{
    BatchConfig, ConfigError, InvalidConfig, NoiseConfig, NoiseUnit, OffsetRule, ScheduledSampling,
    Setting, SettingError, TrainConfig,
};
pub use engine::{
    Batch, Engine, EngineError, EngineMaker, FramePasses, Learned, OnProcessor, Setup, SlotRun,
    Update, run_slots,
};
pub use fit_normalizers::FitProgress;
pub use losses::{
    LossEvaluator, LossStatistics, LossTerms, LossWeights, LossWeightsError, Report,
    RunningLossStatistics, Triplet,
};
pub use memory::{Arithmetic, MemoryError, available_memory};
pub use optimizer::{Adam, AdamError, AdamRates, AdamSettings, clip_norm};
pub use origin::Origin;
pub use run::{Kept, Limits, RunEnd, RunError, files, run};
pub use schedule::{LearningRate, ScheduleError, TruthProbability, UnrollFrames};
pub use slot::ShownSample;
pub use trainer::{StepReport, TrainError, Trainer};
pub use training_set::{TrainingSetError, graph_of};
