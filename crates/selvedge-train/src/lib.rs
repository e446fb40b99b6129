//! Learning: what a prediction is judged by, how weights follow, how samples are drawn and put
//! together, the loop, and checkpoints from which it goes on bit for bit.

mod aim;
mod checkpoint;
mod config;
mod corpus;
mod engine;
mod gathering;
mod lane;
mod losses;
mod memory;
mod optimizer;
mod run;
mod schedule;
mod shard;
mod shards;
#[cfg(test)]
mod test_data;
mod trainer;
mod unroll;

pub use aim::Return;
pub use checkpoint::{CHECKPOINT_FORMAT, Origin, ResumeError};
pub use config::{
    BatchConfig, ConfigError, InvalidConfig, NoiseConfig, NoiseUnit, ScheduledSampling, Setting,
    SettingError, TrainConfig,
};
pub use corpus::{CorpusError, cloth_graph, graph_of};
pub use engine::{Batch, Engine, EngineError, LaneRun, Learned, Setup, Update};
pub use gathering::Gathered;
pub use lane::Shown;
pub use losses::{
    LossEvaluator, LossStatistics, LossTerms, LossWeights, LossWeightsError, Report,
    RunningLossStatistics, Triplet,
};
pub use memory::{Arithmetic, MemoryError, available_memory};
pub use optimizer::{Adam, AdamError, AdamRates, AdamSettings, clip_norm};
pub use run::{Kept, Limits, RunEnd, RunError, files, run};
pub use schedule::{LearningRate, ScheduleError, TruthProbability, UnrollFrames};
pub use trainer::{StepReport, TrainError, Trainer};
