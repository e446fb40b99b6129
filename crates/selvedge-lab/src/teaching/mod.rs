//! Samples for models that correct physics: cloths that move by cheap physics, corrected or not,
//! and converged physics that is asked for the frame after each of their states.
//!
//! Scenes are those of data sets' motions to train on. Each cloth is the work of one thread, and
//! all that is drawn by chance follows from the seed and the cloth's number.

mod cloth;
mod scenes;

use std::error::Error;
use std::sync::Arc;

use rayon::prelude::*;
use selvedge_cloth::Stop;
use selvedge_model::{Domain, Model};
use selvedge_train::{CorrectionSample, SampleSource, TrainConfig};

pub use self::scenes::{TeachingScenes, TeachingScenesError};

use self::cloth::{FORGETFUL, Lesson, TaughtCloth};

/// Cloths that move at once, and their teacher.
pub struct Teaching {
    scenes: TeachingScenes,
    cfg: TrainConfig,
    cloths: Vec<TaughtCloth>,
    /// Part of the frames before which the frame before is forgotten.
    forgetful: f64,
    stop: Stop,
}

impl Teaching {
    /// The cloths of a training by `cfg` in `scenes` that goes on after `first` steps.
    #[must_use]
    pub fn new(scenes: TeachingScenes, cfg: TrainConfig, first: u64) -> Self {
        let cloth = |number| TaughtCloth::new(cfg.seed, first, number);
        Self {
            cloths: (0..cfg.samples.cloths).map(cloth).collect(),
            scenes,
            cfg,
            forgetful: FORGETFUL,
            stop: Stop::default(),
        }
    }

    /// Cloths that were begun anew so far, because a run diverged.
    #[cfg(test)]
    fn diverged(&self) -> u64 {
        self.cloths.iter().map(TaughtCloth::diverged).sum()
    }
}

impl SampleSource for Teaching {
    fn samples(
        &mut self,
        model: Option<&Arc<Model>>,
        own_frames: usize,
    ) -> Result<Option<Vec<CorrectionSample>>, Box<dyn Error + Send + Sync>> {
        let lesson = Lesson {
            scenes: &self.scenes,
            cfg: &self.cfg,
            model,
            own_frames,
            forgetful: self.forgetful,
            stop: &self.stop,
        };
        let cloths = self.cloths.par_iter_mut();
        let samples: Result<Vec<_>, _> = cloths.map(|cloth| cloth.sample(lesson)).collect();
        let samples = samples?.into_iter().flatten().collect();
        Ok((!self.stop.is_wanted()).then_some(samples))
    }

    /// The cloths begin another motion afterwards.
    fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    fn domain(&self) -> Option<&Domain> {
        self.scenes.domain.as_ref()
    }
}

#[cfg(test)]
pub(crate) mod tests;
