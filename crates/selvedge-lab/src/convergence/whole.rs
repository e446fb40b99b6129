//! Whole runs: a method from the first frame of a case to the last, and its measures over all
//! frames together.

use selvedge_data::Drive;
use serde::Serialize;

use super::method::Method;
use super::reference::State;
use super::runs::{Bench, Finished};

/// A whole run against the truth's, or the mean of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WholeRun {
    /// √(mean over frames and vertices of the squared distance) `[m]`.
    pub position_rmse: f64,
    /// √(mean over frames and edges of the squared difference of lengths) `[m]`.
    pub edge_length_rmse: f64,
    /// Mean size of the dihedral angles over all frames `[rad]`.
    pub folds: f64,
    /// The truth's `[rad]`.
    pub true_folds: f64,
    /// The largest (l - l₀)/l₀ of an edge in any frame.
    pub largest_strain: f64,
    /// The truth's.
    pub true_largest_strain: f64,
}

impl WholeRun {
    /// Names of the measures, as CSV has them.
    pub const NAMES: [&'static str; 6] = [
        "position_rmse",
        "edge_length_rmse",
        "folds",
        "true_folds",
        "largest_strain",
        "true_largest_strain",
    ];

    /// Values in the order of [`Self::NAMES`].
    #[must_use]
    pub fn values(&self) -> [f64; 6] {
        [
            self.position_rmse,
            self.edge_length_rmse,
            self.folds,
            self.true_folds,
            self.largest_strain,
            self.true_largest_strain,
        ]
    }

    /// The mean of `all`, and the largest of the strains; none where there are none.
    #[must_use]
    pub fn pooled(all: &[Self]) -> Option<Self> {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let most = |of: fn(&Self) -> f64| all.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        (!all.is_empty()).then(|| Self {
            position_rmse: mean(|run| run.position_rmse),
            edge_length_rmse: mean(|run| run.edge_length_rmse),
            folds: mean(|run| run.folds),
            true_folds: mean(|run| run.true_folds),
            largest_strain: most(|run| run.largest_strain),
            true_largest_strain: most(|run| run.true_largest_strain),
        })
    }

    /// Folds as a part of the truth's; none where that is flat.
    #[must_use]
    pub fn fold_ratio(&self) -> Option<f64> {
        (self.true_folds > 0.0).then(|| self.folds / self.true_folds)
    }
}

impl Bench<'_, '_> {
    /// Runs `method` from frame `first` to frame `last`: the measures, or the reason of an early
    /// end in words. None where an end is asked for.
    pub(super) fn whole(
        &self,
        method: &Method,
        first: usize,
        last: usize,
    ) -> Option<Result<WholeRun, String>> {
        let mut sums = WholeRun {
            largest_strain: f64::NEG_INFINITY,
            true_largest_strain: f64::NEG_INFINITY,
            ..WholeRun::default()
        };
        let frames = last - first;
        match self.whole_sums(method, first..last, &mut sums) {
            Ok(Finished::Yes) => {}
            Ok(Finished::Stopped) => return None,
            Err(problem) => return Some(Err(problem)),
        }
        let count = frames.max(1) as f64;
        Some(Ok(WholeRun {
            position_rmse: (sums.position_rmse / count).sqrt(),
            edge_length_rmse: (sums.edge_length_rmse / count).sqrt(),
            folds: sums.folds / count,
            true_folds: sums.true_folds / count,
            ..sums
        }))
    }

    /// Sums over the frames after each of `frames`: of squares, but for folds.
    fn whole_sums(
        &self,
        method: &Method,
        frames: std::ops::Range<usize>,
        sums: &mut WholeRun,
    ) -> Result<Finished, String> {
        let scene = self.case.scene_by(method);
        let mut runner = self.runner(method, &scene, frames.start)?;
        let path = scene.handle_path().map_err(|error| error.to_string())?;
        let drive = Drive {
            path: &path,
            samples_per_frame: method.substeps as usize,
        };
        for frame in frames {
            runner.step(drive)?;
            let truth = self.truth(frame + 1)?;
            let found = runner.state();
            let found = State {
                positions: &found.positions,
                velocities: &found.velocities,
            };
            let strains = self.gauge.strains(truth, found);
            sums.largest_strain = sums.largest_strain.max(strains.found);
            sums.true_largest_strain = sums.true_largest_strain.max(strains.truth);
            let deviation = self.gauge.deviation(truth, found, strains);
            super::runs::check_finite(&deviation, frame + 1)?;
            sums.position_rmse += deviation.position_rmse.powi(2);
            sums.edge_length_rmse += deviation.edge_length_rmse.powi(2);
            sums.folds += deviation.folds;
            sums.true_folds += deviation.true_folds;
            if self.task.advance_by(method.substeps).is_break() {
                return Ok(Finished::Stopped);
            }
        }
        Ok(Finished::Yes)
    }
}
