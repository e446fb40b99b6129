//! Training of learned cloth simulators: from a data set of trajectories to a model file.
//!
//! A [`Trainer`] is a training between two steps. Its main terms:
//!
//! - A **configuration** ([`TrainConfig`]) holds every setting that decides the result. It is read
//!   from TOML, checked once, and saved beside the model.
//! - The **training set** is the training split of a data set, in memory, with a graph per cloth.
//! - A **rollout slot** is one place of the batch. It shows the network one **sample** per frame:
//!   ground truth with noise, or the model's own prediction of the frame before (scheduled
//!   sampling). All that is drawn by chance follows from (seed, step, slot).
//! - A **rollout target** judges the predictions of several frames in a row: the recorded motion,
//!   or where asked for the frames that an [`Expert`], the physics of the data set, makes of a
//!   state that the model led to.
//! - The **losses** ([`LossEvaluator`]) compare accelerations, kinetic energies, edges and bending
//!   angles with the target's, in units of their deviations.
//! - An **engine** ([`Engine`]) does the arithmetic: forward, backward, and the update by [`Adam`].
//!   [`OnProcessor`] makes the one of this machine's processor, whose threads share
//!   **micro-batches** of slots; `selvedge-gpu` makes another. Every engine implements
//!   [`FramePasses`] and takes its slots through the one loop, [`run_slots`].
//! - A **checkpoint** ([`Trainer::save`]) keeps all that decides the rest of a training, which then
//!   goes on bit for bit ([`Trainer::resume`]). [`run`] is the whole loop, with a log.
//!
//! A cloth that swings by a formula, and a network small enough to learn it while this page is
//! tested:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use std::path::Path;
//!
//! use selvedge_cloth::generate::square;
//! use selvedge_cloth::{Cloth, Handles};
//! use selvedge_data::{DatasetPlan, DatasetWriter, Provenance, SectionRule, Split, Trajectory};
//! use selvedge_train::{OnProcessor, TrainConfig, Trainer};
//!
//! // A square of nine vertices that hangs from two corners and swings, over 30 frames.
//! let sheet = square(9, 1.0, 7)?;
//! let handles = Handles::new(&sheet.labels["upper-corners"], 9)?;
//! let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles)?;
//! let swing = |frame: usize, depth: f64| 0.1 * depth * (0.2 * frame as f64).sin();
//! let rest = sheet.mesh.positions();
//! let positions = (0..30).flat_map(|frame| {
//!     let moved = move |p: &glam::DVec3| (*p + glam::DVec3::X * swing(frame, -p.y)).as_vec3();
//!     rest.iter().map(moved)
//! });
//! let provenance = Provenance {
//!     frame_rate: 60.0,
//!     scene: serde_json::Value::Null,
//!     made_by: "a formula".to_owned(),
//! };
//! let trajectory = Trajectory::new(cloth, positions.collect(), provenance)?;
//!
//! // A data set of this one trajectory.
//! let folder = tempfile::tempdir()?;
//! let plan = DatasetPlan {
//!     name: "swinging".to_owned(),
//!     config: serde_json::Value::Null,
//!     train: vec!["swing".to_owned()],
//!     test: Vec::new(),
//!     sections: SectionRule::Whole,
//! };
//! let mut writer = DatasetWriter::open(folder.path(), plan)?;
//! writer.add(Split::Train, "swing", &trajectory)?;
//! let dataset = writer.finish()?;
//!
//! // A training of 40 steps.
//! let text = r#"
//!     name = "tiny"
//!     seed = 1
//!     steps = 40
//!     statistics_samples = 20
//!     log_every = 10
//!     batch = { samples = 4 }
//!     learning_rate = { kind = "constant", rate = 1e-2 }
//!
//!     [model]
//!     node_features = ["velocity", "node-type"]
//!     edge_features = ["vector", "rest-vector"]
//!     encoder = { kind = "mlp" }
//!     latent = 8
//!     blocks = 2
//!
//!     [noise]
//!     deviation = 0.0
//! "#;
//! let cfg = TrainConfig::parse(text, Path::new("tiny.toml"))?;
//! let steps = cfg.steps;
//! let mut trainer = Trainer::new(cfg, &dataset, &OnProcessor::default())?;
//! let first = trainer.step()?.terms.total;
//! let mut last = first;
//! while trainer.steps_done() < steps {
//!     last = trainer.step()?.terms.total;
//! }
//! assert!(last < 0.5 * first, "it learns: {first} to {last}");
//! let model = trainer.model("40 steps on a swing".to_owned())?;
//! assert_eq!(model.spec().blocks, 2);
//! # Ok(())
//! # }
//! ```
//!
//! This crate moves no cloth by itself: `LearnedStepper` of `selvedge-model` uses a model, and
//! `selvedge-lab` evaluates it. It makes no data either; `selvedge-data` reads and writes them.

mod bounds;
mod checkpoint;
mod config;
mod engine;
mod from_model;
mod losses;
mod memory;
mod optimizer;
mod rollout_target;
mod run;
mod schedule;
mod slot;
#[cfg(test)]
mod test_data;
mod trainer;
mod training_set;

pub use bounds::ConfigError;
pub use checkpoint::{CHECKPOINT_FORMAT, ResumeError};
pub use config::{
    BatchConfig, Labels, NoiseConfig, NoiseUnit, ScheduledSampling, Setting, TrainConfig,
};
pub use engine::{
    Engine, EngineError, EngineMaker, FramePasses, Learned, OnProcessor, OverRanks, Setup, SlotRun,
    Update, run_slots,
};
pub use from_model::Origin;
pub use losses::{
    LossEvaluator, LossStatistics, LossTerms, LossWeights, PerQuantity, RunningLossStatistics,
    Triplet,
};
pub use memory::MemoryError;
pub use optimizer::{Adam, AdamRates, AdamSettings, clip_norm};
pub use run::{RunEnd, RunError, RunLimits, files, run};
pub use schedule::{LearningRate, TruthProbability, UnrollFrames};
pub use slot::{Expert, ExpertState, ShownSample};
pub use trainer::{StepReport, TrainError, Trainer};
pub use training_set::{TrainingSetError, domain_of, graph_of};
