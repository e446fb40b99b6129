//! The outcome of a study: runs, their means over starts, and over cases.

use selvedge_model::Aspect;
use serde::Serialize;

use super::deviation::Deviation;
use super::method::Method;
use super::settings::Settings;
use super::whole::WholeRun;
use crate::event::End;

/// A run from a true state.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The frame of the start.
    pub start: usize,
    /// Measures after each of the horizons; fewer where the run failed.
    pub deviations: Vec<Deviation>,
    /// Mean part of the vertices that a model that corrects physics knew; none for others.
    pub familiar: Option<f64>,
    /// The reason of an early end.
    pub failure: Option<String>,
}

/// Runs of one method on one case.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The method.
    pub method: Method,
    /// One per start.
    pub runs: Vec<Run>,
    /// The run from the first frame to the last, or the reason of its early end; none where it was
    /// not asked for, or not reached.
    pub whole: Option<Result<WholeRun, String>>,
    /// Aspects of the case that a model was not trained on; none for physics and for a model that
    /// does not say.
    pub beyond: Option<Vec<Aspect>>,
    /// Wall time of a frame on one thread, median over frames `[ms]`; none where it was not taken.
    pub ms_per_frame: Option<f64>,
}

/// Everything about one case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseOutcome {
    /// Its name.
    pub name: String,
    /// Vertices of the cloth.
    pub vertices: usize,
    /// Frames of the starts of which all runs were made.
    pub starts: Vec<usize>,
    /// Frame in which the last run ends.
    pub last: usize,
    /// The second reference run, against the first.
    pub half: Series,
    /// In the order of the settings.
    pub rivals: Vec<Series>,
}

/// The outcome of a study.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Settings that it was made with.
    pub settings: Settings,
    /// Cases with a start at least.
    pub cases: Vec<CaseOutcome>,
    /// References that were there already.
    pub kept: usize,
    /// The end that it came to.
    pub end: End,
}

/// A measure that has an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    Position,
    Velocity,
    Fold,
    EdgeLength,
}

/// One method over all cases at one horizon.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// The method.
    #[serde(flatten)]
    pub method: Method,
    /// Frames after the start.
    pub horizon: usize,
    /// Over starts, then over cases; none where a run failed.
    #[serde(flatten)]
    pub deviation: Option<Deviation>,
}

impl Measure {
    pub(super) const ALL: [Self; 4] =
        [Self::Position, Self::Velocity, Self::Fold, Self::EdgeLength];

    pub(super) fn of(self, deviation: &Deviation) -> f64 {
        match self {
            Self::Position => deviation.position_rmse,
            Self::Velocity => deviation.velocity_rmse,
            Self::Fold => deviation.fold_rmse,
            Self::EdgeLength => deviation.edge_length_rmse,
        }
    }
}

impl Series {
    /// The mean over starts at the horizon of this number; none where a run failed: a mean over the
    /// others would flatter.
    #[must_use]
    pub fn mean(&self, horizon: usize) -> Option<Deviation> {
        let all = self
            .runs
            .iter()
            .map(|run| run.deviations.get(horizon).copied());
        Deviation::pooled(&all.collect::<Option<Vec<_>>>()?)
    }

    /// Mean part of the vertices that a model that corrects physics knew; none for others.
    #[must_use]
    pub fn familiar(&self) -> Option<f64> {
        let all = self.runs.iter().map(|run| run.familiar);
        let all = all.collect::<Option<Vec<f64>>>()?;
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// The measures of the whole run, where there is one that did not fail.
    pub(super) fn whole(&self) -> Option<WholeRun> {
        self.whole.as_ref()?.as_ref().ok().copied()
    }
}

impl Outcome {
    /// The mean of the method of this number over all cases; none where a run failed.
    #[must_use]
    pub fn mean(&self, rival: usize, horizon: usize) -> Option<Deviation> {
        let all = self
            .cases
            .iter()
            .map(|case| case.rivals.get(rival)?.mean(horizon));
        Deviation::pooled(&all.collect::<Option<Vec<_>>>()?)
    }

    /// The mean whole run of the method of this number over all cases; none where one failed or
    /// was not asked for.
    #[must_use]
    pub fn whole(&self, rival: usize) -> Option<WholeRun> {
        let all = self
            .cases
            .iter()
            .map(|case| case.rivals.get(rival)?.whole());
        WholeRun::pooled(&all.collect::<Option<Vec<_>>>()?)
    }

    /// The mean whole run of half the reference's substeps over all cases.
    #[must_use]
    pub fn half_whole(&self) -> Option<WholeRun> {
        let all = self.cases.iter().map(|case| case.half.whole());
        WholeRun::pooled(&all.collect::<Option<Vec<_>>>()?)
    }

    /// The mean of the second reference run over all cases.
    #[must_use]
    pub fn half(&self, horizon: usize) -> Option<Deviation> {
        let all = self.cases.iter().map(|case| case.half.mean(horizon));
        Deviation::pooled(&all.collect::<Option<Vec<_>>>()?)
    }

    /// The mean time of a frame of the method of this number over all cases `[ms]`; none where it
    /// was not taken of all.
    #[must_use]
    pub fn ms_per_frame(&self, rival: usize) -> Option<f64> {
        let times = self
            .cases
            .iter()
            .map(|case| case.rivals.get(rival)?.ms_per_frame);
        let times = times.collect::<Option<Vec<f64>>>()?;
        (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
    }

    /// All runs of `case`, each method once: the second reference run may be a rival too.
    pub(super) fn series<'a>(&self, case: &'a CaseOutcome) -> impl Iterator<Item = &'a Series> {
        let is_rival = self.settings.rivals.contains(&case.half.method);
        let half = (!is_rival).then_some(&case.half);
        half.into_iter().chain(&case.rivals)
    }

    /// Every method at every horizon.
    #[must_use]
    pub fn means(&self) -> Vec<Mean> {
        let settings = &self.settings;
        let methods = settings.rivals.iter().enumerate();
        let all = methods.flat_map(|(rival, method)| {
            let horizons = settings.horizons.iter().enumerate();
            horizons.map(move |(number, &horizon)| Mean {
                method: method.clone(),
                horizon,
                deviation: self.mean(rival, number),
            })
        });
        all.collect()
    }
}
